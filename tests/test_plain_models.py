"""Models that are not the tube: no equilibrium curve, no state at all, one state, dozens of states, declared starts.

What such a model needs of the emitters, the kernel and the FMUs, against closed forms and scipy.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable
from pathlib import Path

import fmpy
import numpy as np
import pytest
import sympy
from fmpy.validation import validate_fmu
from scipy.linalg import expm

from tubular_dea.emit.python import compile_python
from tubular_dea.export.package import native_fmu
from tubular_dea.export.python_fmu import python_fmu
from tubular_dea.kernel import Kernel, KernelError, SensitivityError
from tubular_dea.model.declare import Definition, Discrete, Model, Parameter, Quantity, State, before
from tubular_dea.protocol import Protocol

U = Quantity("load", "N", "Load", 0.0)
Y = Quantity("reading", "m", "What is read")
CELLS = 40


def parameter(name: str, value: float, unit: str = "1", tunable: bool = True) -> Parameter:
    return Parameter(Quantity(name, unit, name, value, nominal=abs(value) or 1.0), tunable)


def state(name: str, derivative: sympy.Expr, start: sympy.Expr | float = 0.0) -> State:
    return State(Quantity(name, "m", name), sympy.sympify(derivative), sympy.sympify(start), sympy.sympify(start))


def model_of(name: str, parameters: list[Parameter], states: list[State], reading: sympy.Expr) -> Model:
    return Model(
        name,
        f"{name}, a test",
        f"{name}, a test.",
        (U,),
        tuple(parameters),
        (Definition(Y, reading),),
        tuple(states),
        (Y.name,),
    )


def static_law() -> Model:
    """reading = gain tanh(load / scale): no state."""
    gain, scale = parameter("gain", 2e-3, "m"), parameter("scale", 3.0, "N")
    return model_of("StaticLaw", [gain, scale], [], gain.quantity.symbol * sympy.tanh(U.symbol / scale.quantity.symbol))


def one_state() -> Model:
    """A lag that starts where a fixed parameter says, twice over."""
    tau, begin = parameter("tau", 0.5, "s"), parameter("begin", 0.3, "m", tunable=False)
    x = sympy.Symbol("x", real=True)
    lag = state("x", (U.symbol - x) / tau.quantity.symbol, 2 * begin.quantity.symbol)
    return model_of("OneState", [tau, begin], [lag], 3 * x)


def chain() -> Model:
    """Heat along a rod of CELLS cells, fed at its head; both ends may start warm."""
    rate, warm = parameter("rate", 40.0, "1/s"), parameter("warm", 0.5, "m", tunable=False)
    k = rate.quantity.symbol
    x = sympy.symbols(f"x0:{CELLS}", real=True)
    left, right = [U.symbol, *x[:-1]], [*x[1:], x[-1]]
    starts = [warm.quantity.symbol, *[0.0] * (CELLS - 2), warm.quantity.symbol**2]
    states = [state(str(c), k * (a - 2 * c + b), s) for c, a, b, s in zip(x, left, right, starts, strict=True)]
    return model_of("Chain", [rate, warm], states, x[-1] + x[0])


MODELS = {"static": static_law, "one": one_state, "chain": chain}
PROTOCOL = Protocol.of([0, 1, 1, 2], load=[0, 3, -1, -1])
TIMES = np.array([0, 0.25, 0.999, 1.0, 1.001, 1.7, 2.0])


def static_exact(times: np.ndarray) -> np.ndarray:
    return 2e-3 * np.tanh(PROTOCOL.at(times)["load"] / 3.0)


def lag_exact(times: np.ndarray, tau: float = 0.5, begin: float = 0.3) -> np.ndarray:
    """The lag's answer to the ramp 3 t over 1 s, then to -1."""

    def ramp(t: np.ndarray | float) -> np.ndarray:
        return 3 * (t - tau) + (2 * begin + 3 * tau) * np.exp(-np.asarray(t) / tau)

    return 3 * np.where(times < 1, ramp(times), -1 + (ramp(1.0) + 1) * np.exp(-(times - 1) / tau))


def chain_exact(times: np.ndarray) -> np.ndarray:
    """By the matrix exponential of the chain with the input and its slope as two more states."""
    A = np.diag([-2.0] * CELLS) + np.diag([1.0] * (CELLS - 1), 1) + np.diag([1.0] * (CELLS - 1), -1)
    A[-1, -1] = -1.0
    whole = np.zeros((CELLS + 2, CELLS + 2))
    whole[:CELLS, :CELLS] = 40 * A
    whole[0, CELLS], whole[CELLS, CELLS + 1] = 40, 1
    start = np.zeros(CELLS + 2)
    start[0], start[CELLS - 1], start[-1] = 0.5, 0.25, 3.0
    middle = expm(whole) @ start
    middle[CELLS:] = -1.0, 0.0
    found = [expm(whole * t) @ start if t < 1 else expm(whole * (t - 1)) @ middle for t in times]
    return np.array([x[0] + x[CELLS - 1] for x in found])


EXACT = {"static": static_exact, "one": lag_exact, "chain": chain_exact}


@pytest.mark.parametrize("name", MODELS)
def test_trajectories(name: str) -> None:
    found = Kernel(MODELS[name]()).simulate(PROTOCOL, TIMES, tolerance=1e-8)
    assert np.max(np.abs(found[Y.name] - EXACT[name](TIMES))) < 1e-6
    assert found.steps > 0 or name == "static"


@pytest.mark.parametrize("name", MODELS)
def test_sensitivities_start_values_among_them(name: str) -> None:
    """Against differences over the same mesh; `begin` and `warm` are not tunable and act through the start alone."""
    kernel = Kernel(MODELS[name]())
    seen = kernel.simulate(PROTOCOL, TIMES, tolerance=1e-8, sensitivities=list(kernel.defaults))
    for i, (parameter_name, value) in enumerate(kernel.defaults.items()):
        d = 1e-5 * value
        sides = [kernel.simulate(PROTOCOL, TIMES, {parameter_name: value + s}, mesh=seen.mesh) for s in (d, -d)]
        for key in (*kernel.states, Y.name):
            difference = (sides[0][key] - sides[1][key]) / (2 * d)
            exact = seen.sensitivities[key][:, i]
            assert np.max(np.abs(exact - difference)) < 1e-7 * (1 + np.max(np.abs(exact))), (key, parameter_name)
    assert np.any(seen.sensitivities[Y.name] != 0)


def test_sensitivity_to_a_start_value_in_closed_form() -> None:
    kernel = Kernel(one_state())
    seen = kernel.simulate(Protocol.of([0, 2], load=[0, 0]), TIMES, tolerance=1e-9, sensitivities=["begin"])
    assert np.allclose(seen.sensitivities["x"][:, 0], 2 * np.exp(-TIMES / 0.5), rtol=1e-8)
    assert seen.sensitivities[Y.name][0, 0] == 6.0


def test_a_fixed_parameter_of_the_equations_alone_is_refused() -> None:
    model = one_state()
    tau = parameter("tau", 0.5, "s", tunable=False)
    fixed = dataclasses.replace(model, parameters=(tau, *model.parameters[1:]))
    with pytest.raises(SensitivityError, match="no sensitivity to 'tau': expected a parameter that is tunable or sets"):
        Kernel(fixed).simulate(PROTOCOL, TIMES, sensitivities=["tau"])


@pytest.mark.parametrize("name", MODELS)
@pytest.mark.parametrize("kind", ["fmi2", "fmi3", "python"])
def test_fmus(name: str, kind: str, tmp_path: Path) -> None:
    """Valid, and right under an input that is held over each step."""
    model = MODELS[name]()
    path = tmp_path / f"{model.name}.fmu"
    build: dict[str, Callable[[], Path]] = {
        "fmi2": lambda: native_fmu(model, 2, path),
        "fmi3": lambda: native_fmu(model, 3, path),
        "python": lambda: python_fmu(model, path),
    }
    build[kind]()
    assert validate_fmu(str(path)) == []
    held = np.array([(0.0, 2.0), (1.0, 2.0)], dtype=[("time", float), ("load", float)])
    interfaces = ["CoSimulation"] if kind == "python" else ["CoSimulation", "ModelExchange"]
    expected = Kernel(model).simulate(Protocol.of([0, 1], load=[2, 2]), np.array([1.0]), tolerance=1e-9)[Y.name][-1]
    for interface in interfaces:
        found = fmpy.simulate_fmu(
            str(path),
            fmi_type=interface,
            input=held,
            stop_time=1.0,
            output=[Y.name],
            relative_tolerance=1e-8,
            output_interval=0.1,
            step_size=0.1,
        )
        assert math.isclose(found[Y.name][-1], expected, rel_tol=1e-5), interface


def test_no_curve_says_so() -> None:
    with pytest.raises(KernelError, match="StaticLaw has no equilibrium curve"):
        Kernel(static_law()).curve(np.array([1.0]), {})


@pytest.mark.parametrize("name", ["static", "one"])
def test_a_quarter_of_a_million_breakpoints(name: str) -> None:
    """As a measured input has them: one step a piece."""
    n = 250_000
    time = np.arange(n) / 1000.0
    load = np.sin(time)
    kernel = Kernel(MODELS[name]())
    found = kernel.simulate(Protocol(time, {"load": load}), time)
    assert n - 1 <= found.steps <= 1.1 * n
    if name == "static":
        assert np.allclose(found[Y.name], 2e-3 * np.tanh(load / 3.0), rtol=1e-14, atol=0)
    else:
        late = time > 5
        tau = 0.5
        answer = (np.sin(time) - tau * np.cos(time)) / (1 + tau**2)
        assert np.max(np.abs(found["x"] - answer)[late]) < 1e-4


def test_names_are_the_user_s() -> None:
    """Names of the emitters' own arrays, of C's words and of its functions serve as well as any others."""
    names = ["u", "du", "p", "h", "J", "L", "double", "exp", "square", "y_out", "v_x", "INFINITY", "lambda", "max"]
    values = [parameter(name, 1.0 + i) for i, name in enumerate(names)]
    x = sympy.Symbol("x", real=True)
    terms = sum((i + 1) * p.quantity.symbol**2 for i, p in enumerate(values))
    model = model_of("Names", values, [state("x", U.symbol + sympy.exp(-x) - 0.01 * terms * x)], x)
    dx = Kernel(model).derivatives(np.array([0.5]), np.array([2.0]))[0]
    total = sum((i + 1) * (1.0 + i) ** 2 for i in range(len(names)))
    assert math.isclose(dx, 2 + math.exp(-0.5) - 0.01 * total * 0.5, rel_tol=1e-14)
    p = tuple(p.quantity.value for p in values)
    assert math.isclose(compile_python(model).derivatives(0.0, (0.5,), (2.0,), (0.0,), p, ())[0], dx, rel_tol=1e-14)


def test_what_decays_between_samples_comes_to_zero(tmp_path: Path) -> None:
    """A sampled value halved 1100 times: no denormal number on the way, which would be slow."""
    halved = Quantity("halved", "1", "Halved at every sample", 1.0)
    model = dataclasses.replace(
        model_of("Halving", [], [], U.symbol),
        outputs=("reading", "halved"),
        discretes=(Discrete(halved, sympy.Integer(1), before(halved) / 2),),
    )
    path = native_fmu(model, 2, tmp_path / "Halving.fmu")
    rows = fmpy.simulate_fmu(str(path), stop_time=1.1, step_size=1e-3, output_interval=1e-3, output=["halved"])
    found = rows["halved"]
    assert found[10] in (2.0**-10, 2.0**-11)
    assert found[-1] == 0
    assert np.min(found[found > 0]) >= np.finfo(float).tiny


def test_a_state_that_decays_comes_to_zero(tmp_path: Path) -> None:
    """The same for a state: exp(-1000) is below the smallest normal number."""
    x = sympy.Symbol("x", real=True)
    model = model_of("Decaying", [], [state("x", -x + 0 * U.symbol, 1.0)], x)
    path = native_fmu(model, 2, tmp_path / "Decaying.fmu")
    rows = fmpy.simulate_fmu(str(path), stop_time=1000, step_size=1, output_interval=1, output=["x"])
    found = np.abs(rows["x"])
    assert found[1] == pytest.approx(np.exp(-1), rel=1e-5)
    assert found[-1] == 0
    assert np.min(found[found > 0]) >= np.finfo(float).tiny


def test_integer_sizes_are_numbers_like_any_other() -> None:
    """A declaration may say 10 where it means 10.0; the derivative to that start alone is as exact."""
    x, start = sympy.Symbol("x", real=True), Parameter(Quantity("x_start", "m", "Start", 5, nominal=10), tunable=False)
    model = model_of("IntegerSizes", [start], [state("x", -x, start.quantity.symbol)], x)
    protocol, times = Protocol.of([0.0, 1.0], load=[0.0, 0.0]), np.linspace(0, 1, 5)
    run = Kernel(model).simulate(protocol, times, tolerance=1e-8, sensitivities=["x_start"])
    np.testing.assert_allclose(run.sensitivities["x"][:, 0], np.exp(-times), rtol=1e-6)
