"""There is one Rodas5P: whoever steps with it takes the same steps over the same problem."""

from __future__ import annotations

import ctypes
import importlib
import itertools
import math
import sys
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from tubular_dea.emit import rodas5p, step_control
from tubular_dea.emit.to_c import c_function, step_control_header
from tubular_dea.export.compile import cached_library, host, native_source
from tubular_dea.export.python_fmu import slave_source
from tubular_dea.kernel import Kernel
from tubular_dea.kernel.batch import Batch, Breakpoints, Probe
from tubular_dea.model.dea import tubular_dea
from tubular_dea.model.declare import Model
from tubular_dea.protocol import Protocol

START = {"lambda_2_start": 1.15}
TIME = [0.0, 0.4, 0.4, 1.0]
PRESSURE, VOLTAGE = [1.1e4, 1.1e4, 1.3e4, 1.3e4], [0.0, 0.0, 5e3, 5e3]
PROTOCOL = Protocol.of(TIME, pressure=PRESSURE, voltage=VOLTAGE)
END = np.array([1.0])


@pytest.fixture(scope="module")
def slave(model: Model, tmp_path_factory: pytest.TempPathFactory) -> ModuleType:
    name, code = slave_source(model)
    folder = tmp_path_factory.mktemp("slave")
    (folder / f"{name}.py").write_text(code, encoding="utf-8")
    sys.path.insert(0, str(folder))
    try:
        return importlib.import_module(name)
    finally:
        sys.path.remove(str(folder))


def python_steps(slave: ModuleType, tolerance: float, monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """Where the accepted steps of the pythonfmu slave end."""
    ends: list[float] = []
    attempt = slave.attempt

    def noted(begin: object, h: float, u: tuple, p: tuple) -> tuple:
        x, error = attempt(begin, h, u, p)
        if 0 <= error <= 1:
            ends.append(begin.time + h)
        return x, error

    monkeypatch.setattr(slave, "attempt", noted)
    p = tuple(START.get(v.name, v.start) for v in slave.VARIABLES if v.kind == "PARAMETER")
    x, h = slave.start((0.0, 0.0), p), 0.0
    for begin, end, u in ((0.0, 0.4, (1.1e4, 0.0)), (0.4, 1.0, (1.3e4, 5e3))):
        x, h = slave.advance(begin, end, x, h, u, p, tolerance)
    return ends


@pytest.mark.parametrize("tolerance", [1e-4, 1e-6, 1e-8])
def test_same_accepted_steps(
    kernel: Kernel, slave: ModuleType, tolerance: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    mesh = kernel.mesh(PROTOCOL, START, tolerance)
    plain = kernel.simulate(PROTOCOL, END, START, tolerance)
    assert plain.steps == mesh.size
    assert plain.rejected > 0, "refusals are part of it"

    kept = kernel.simulate(PROTOCOL, END, START, mesh=mesh, sensitivities=["C_1"])
    ends = np.array([[found[name][-1] for name in kernel.states] for found in (kept, plain)])
    assert np.allclose(*ends, rtol=1e-9, atol=0), "tangents: to rounding, their steps being differences of times"

    probes = [Probe("final", name) for name in kernel.states]
    inputs = {
        "pressure": Breakpoints(np.array([TIME]), np.array([PRESSURE])),
        "voltage": Breakpoints(np.array([TIME]), np.array([VOLTAGE])),
    }
    rows = Batch(kernel.model, probes).trajectories(9, START, inputs, 1.0, tolerance)
    assert np.all(rows.steps == mesh.size)
    assert np.array_equal(rows.values, np.tile(ends[1], (9, 1))), "lanes: to the last bit"

    ends = python_steps(slave, tolerance, monkeypatch)
    assert len(ends) == mesh.size
    apart = np.max(np.abs(np.array(ends) / mesh - 1))
    assert apart < 1e-11 / tolerance, "Python: to rounding, which its equations do in another order"


def test_corners_cost_no_refusals(kernel: Kernel) -> None:
    """The noise of a monitor bends the pressure at every sample; half of all attempts were refused there. Lanes take
    the same steps, whatever row was in them before."""
    time = np.linspace(0, 1, 251)
    pressure = 1.2e4 + 30 * np.random.default_rng(1).standard_normal(time.size)
    drive = Protocol.of(time, pressure=pressure, voltage=np.zeros(time.size))
    plain = kernel.simulate(drive, END, START, 1e-6)
    assert plain.rejected < 0.1 * plain.steps
    inputs = {"pressure": Breakpoints(time[None], pressure[None]), "voltage": Breakpoints(time[None], time[None] * 0)}
    rows = Batch(kernel.model, [Probe("final", "lambda_2")]).trajectories(20, START, inputs, 1.0, 1e-6)
    assert np.all(rows.steps == plain.steps)
    np.testing.assert_allclose(rows.values, plain["lambda_2"][-1], rtol=1e-12)


def test_a_method_of_order_five_with_an_error_of_order_four() -> None:
    """The coefficients, by what they do: x' = -x and x' = cos t over one step of h and one of h / 2."""

    def step(h: float, J: float, f, f_t: float) -> tuple[float, float]:
        x0 = 1.0
        shift, k, at = 1 / (h * rodas5p.GAMMA), [], x0
        for stage in rodas5p.STAGES:
            at = x0 + sum(a * b for a, b in zip(stage.a, k, strict=False)) if stage.a or not k else at + k[-1]
            slopes = sum(c * b for c, b in zip(stage.c, k, strict=False)) / h
            k.append((f(stage.alpha * h, at) + slopes + stage.delta * h * f_t) / (shift - J))
        return at + k[-1], k[-1]

    decay = [step(h, -1.0, lambda t, x: -x, 0.0) for h in (0.2, 0.1)]
    drift = [step(h, 0.0, lambda t, x: np.cos(t + 0.3), -np.sin(0.3)) for h in (0.2, 0.1)]
    exact = [[np.exp(-0.2), np.exp(-0.1)], [1 + np.sin(h + 0.3) - np.sin(0.3) for h in (0.2, 0.1)]]
    for found, truth in zip((decay, drift), exact, strict=True):
        errors = [abs(x - t) for (x, _), t in zip(found, truth, strict=True)]
        estimates = [abs(e) for _, e in found]
        assert 5.3 < np.log2(errors[0] / errors[1]) < 7.7
        assert 4.3 < np.log2(estimates[0] / estimates[1]) < 6.7
        assert errors[0] < estimates[0]


def test_nothing_of_the_method_is_written_twice() -> None:
    """Its coefficients are in one file of the package."""
    package = Path(sys.modules["tubular_dea"].__file__).parent
    texts = {p: p.read_text(encoding="utf-8") for p in package.rglob("*") if p.suffix in (".py", ".c", ".h", ".js")}
    for number in ("0.21193756319429014", "-14.155112264123755", "37.80277123390563"):
        assert [p.name for p, text in texts.items() if number in text] == ["rodas5p.py"]
    assert Kernel(tubular_dea()).states


NUMBERS = (0.0, 5e-324, 1e-300, 1e-12, 0.3, 1.0, 1 + 2**-52, 7.5, 1e9, 1e160, math.inf, math.nan, -1.0)
CONTROL = {
    step_control.growth: 1,
    step_control.resolving: 3,
    step_control.is_last: 3,
    step_control.is_too_short: 2,
    step_control.is_accepted: 1,
    step_control.wanted_next: 5,
}


@pytest.fixture(scope="module")
def compiled() -> ctypes.CDLL:
    """The printed step control, each function callable as `c_<name>`."""
    lines = [
        '#include "method.h"',
        "#ifdef _WIN32",
        "#define OPEN __declspec(dllexport)",
        "#else",
        '#define OPEN __attribute__((visibility("default")))',
        "#endif",
    ]
    for function, n in CONTROL.items():
        names = "abcde"[:n]
        taken = ", ".join(f"double {a}" for a in names)
        name = function.__name__
        lines.append(f"OPEN double c_{name}({taken}) {{ return {name}({', '.join(names)}); }}")
    sources = {
        "test.c": "\n".join([*lines, ""]),
        "method.h": native_source("method.h"),
        "rodas5p.h": rodas5p.header(),
        "step_control.h": step_control_header(),
    }
    return ctypes.CDLL(str(cached_library(sources, host())))


@pytest.mark.parametrize("function", CONTROL, ids=lambda f: f.__name__)
def test_the_printed_step_control_is_that_of_python(function, compiled: ctypes.CDLL) -> None:
    """To the last bit, for numbers that no step has as for those of every step."""
    n = CONTROL[function]
    printed = compiled[f"c_{function.__name__}"]
    printed.restype, printed.argtypes = ctypes.c_double, [ctypes.c_double] * n
    mean_squares = NUMBERS[:-1]  # never negative: no root of such a number
    wheres = [mean_squares] * 3 if function is step_control.resolving else [NUMBERS] * min(n, 3)
    wheres += [(0, 1)] * (n - len(wheres))
    for given in itertools.product(*wheres):
        ours, theirs = float(function(*given)), printed(*given)
        assert ours == theirs or (math.isnan(ours) and math.isnan(theirs)), given


def test_what_c_does_not_have_is_not_translated() -> None:
    def power(a: float) -> float:
        """Where C has a function."""
        return a**0.5

    def loop(a: float) -> float:
        """A sum."""
        for _ in range(3):
            a += 1
        return a

    with pytest.raises(TypeError, match="Pow"):
        c_function(power)
    with pytest.raises(TypeError, match="for _ in"):
        c_function(loop)


@pytest.mark.parametrize("time", [[0.0, 0.4, 0.5, 1.0], [0.0, 0.4, 0.4, 0.5, 0.5, 1.0]])
def test_a_bend_is_no_jump_and_neither_is_a_breakpoint_that_stands_twice(kernel: Kernel, time: list[float]) -> None:
    """Steps go on as large as they were; all that integrate step alike there, too."""
    load, volts = (np.interp(time, [0, 0.4, 0.5, 1], y) for y in ([1.1e4, 1.1e4, 1.3e4, 1.2e4], [0, 0, 4e3, 5e3]))
    plain = kernel.simulate(Protocol.of(time, pressure=load, voltage=volts), END, START, 1e-6)
    inputs = {n: Breakpoints(np.array([time]), v[None, :]) for n, v in (("pressure", load), ("voltage", volts))}
    rows = Batch(kernel.model, [Probe("final", name) for name in kernel.states]).trajectories(
        2, START, inputs, 1.0, 1e-6
    )
    assert np.all(rows.steps == plain.steps)
    assert np.array_equal(rows.values[0], [plain[name][-1] for name in kernel.states])
    once = Protocol.of([0.0, 0.4, 0.5, 1.0], pressure=[1.1e4, 1.1e4, 1.3e4, 1.2e4], voltage=[0, 0, 4e3, 5e3])
    again = kernel.simulate(once, END, START, 1e-6)
    assert again.steps == plain.steps and again["lambda_2"][-1] == plain["lambda_2"][-1]


def test_many_bends_cost_no_new_look_at_the_step_size_each(kernel: Kernel) -> None:
    """A sine by 200 lines took 919 steps while every bend began as a jump does."""
    time = np.arange(0, 4.01, 0.02)
    wave = Protocol.of(time, pressure=1e4 + 1e3 * np.sin(6 * time), voltage=0 * time)
    assert kernel.simulate(wave, time[-1:], {"start_at_equilibrium": 1.0}, 1e-5).steps < 700
