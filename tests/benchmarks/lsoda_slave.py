"""The tube as a pythonfmu slave is usually written: SciPy's LSODA, started anew at every communication step.

Built by stock pythonfmu (see do_step.py); the equations are those of tests/independent.py.
"""

import numpy as np
from pythonfmu import Fmi2Causality, Fmi2Slave, Fmi2Variability, Integer, Real
from scipy.integrate import odeint, solve_ivp

from independent import AT_REST, rhs

TOLERANCE = 1e-6
SIZES = np.array([1.0, 10.0, 1e5, 1e5])  # 1, 1/s, Pa, Pa: the nominal values of our slave


class LsodaTube(Fmi2Slave):
    """Inputs held during a step; `interface` chooses SciPy's way to LSODA: 0 solve_ivp, 1 odeint."""

    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.pressure = 0.0
        self.voltage = 0.0
        self.lambda_2 = 1.0
        self.interface = 0
        self.state = np.array(AT_REST)
        self.register_variable(Real("pressure", causality=Fmi2Causality.input))
        self.register_variable(Real("voltage", causality=Fmi2Causality.input))
        self.register_variable(Real("lambda_2", causality=Fmi2Causality.output))
        self.register_variable(
            Integer("interface", causality=Fmi2Causality.parameter, variability=Fmi2Variability.fixed)
        )

    def do_step(self, current_time, step_size):
        end = current_time + step_size
        inputs = (self.pressure, self.voltage)
        options = {"rtol": TOLERANCE, "atol": TOLERANCE * SIZES}
        if self.interface:
            found = odeint(rhs, self.state, (current_time, end), inputs, tfirst=True, **options)
            self.state = found[-1]
        else:
            found = solve_ivp(rhs, (current_time, end), self.state, "LSODA", args=inputs, **options)
            self.state = found.y[:, -1]
        self.lambda_2 = float(self.state[0])
        return True
