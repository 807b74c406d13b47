"""Two tanks in a row: a pump fills the upper one, it drains into the lower one, whose level is measured.

::

    pump --> |      |
             |  h1  |
             |______|
                |  outflow_1
             |      |
             |  h2  |--- level_2 [V]
             |______|
                |  outflow_2

Equations: dh1/dt = k3 pump - k1 h1, dh2/dt = k1 h1 - k2 h2; level_2 = h2. SQUARE_ROOT has k1 sqrt(h1), k2 sqrt(h2).
Levels are in volts of the sensor, as the records have them (that of the upper tank is not seen: its unit is such that
the tanks have one section); both start unknown, and alike in all records.

Citation: M. Schoukens, J. P. Noel, "Three benchmarks addressing open challenges in nonlinear system identification",
IFAC PapersOnLine 50 (2017) 446-451; T. Wigren, J. Schoukens, "Three free data sets", ECC 2013. What these equations
lack: the outflow goes with the square root of the level, the tanks spill over, the sensor ends at 10 V.

Usage::

    tubular-dea close-loop DATA --plant cosim_examples/plants/cascaded_tanks.py --out OUT
    tubular-dea close-loop DATA --plant cosim_examples/plants/cascaded_tanks.py:SQUARE_ROOT --out OUT
"""

from collections.abc import Callable

import sympy

from tubular_dea.plants import Balance, Build, Coefficient, Input, Output, Path, Plant, root


def tanks(name: str, drained: Callable[[sympy.Symbol], sympy.Expr], rate: float, unit: str) -> Plant:
    """The two tanks with an outflow of `rate` (the first guess, in `unit`) times `drained(level)`."""
    m = Build(name, "Two tanks in a row", __doc__ or "")
    pump = m.input("pump", "V", "Voltage of the pump", nominal=5)
    k1 = m.parameter("k1", unit, rate, "Outflow of the upper tank", minimum=1e-4)
    k2 = m.parameter("k2", unit, rate, "Outflow of the lower tank", minimum=1e-4)
    k3 = m.parameter("k3", "1/s", 0.05, "Inflow of the upper tank", minimum=1e-4)
    h1 = m.state("h1", "V", "Level of the upper tank", start="shared", nominal=10)
    h2 = m.state("h2", "V", "Level of the lower tank", start="shared", nominal=10)
    outflow_1 = m.define("outflow_1", "V/s", k1 * drained(h1), "Outflow of the upper tank")
    outflow_2 = m.define("outflow_2", "V/s", k2 * drained(h2), "Outflow of the lower tank")
    m.derivative(h1, k3 * pump - outflow_1)
    m.derivative(h2, outflow_1 - outflow_2)
    m.output("level_2", "V", h2, "Reading of the lower tank's level")
    outflows = [Coefficient("outflow_1", of="h1"), Coefficient("outflow_2", of="h2")]
    stores, ways = [Balance("h1", below="h2"), Balance("h2")], [Path("pump"), Path("level_2")]
    inputs, outputs = [Input("pump", held=True)], [Output("level_2")]
    return Plant(m.model(), inputs, outputs, places=[*outflows, *stores, *ways])


PLANT = tanks("CascadedTanks", lambda level: level, 0.02, "1/s")
SQUARE_ROOT = tanks("CascadedTanksSquareRoot", lambda level: root(level, 0.01), 0.05, "V0.5/s")
