"""Sensitivities: the derivative of the discrete solution, against differences over the same mesh and against theory."""

from __future__ import annotations

import time as clock
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from tubular_dea.emit.python import compile_python
from tubular_dea.kernel import Kernel, KernelError, SensitivityError
from tubular_dea.model.dea import tubular_dea
from tubular_dea.model.declare import Model
from tubular_dea.plants.effects import catalogue, with_effects
from tubular_dea.protocol import Protocol

PROTOCOL = Protocol.of(
    [0, 0.5, 1, 1, 2, 2, 3], pressure=[0, 1.2e4, 1.2e4, 1.2e4, 1.2e4, 1.2e4, 0.9e4], voltage=[0, 0, 0, 5e3, 5e3, 0, 0]
)
TIMES = np.linspace(0, 3, 301)
EFFECTS = (
    "electrode_resistance",
    "friction_hysteresis",
    "mullins_softening",
    "pneumatic_line",
    "rigid_stop",
    "rate_dependent_viscosity",
    "strain_stiffening",
    "thermal_softening",
)


def unbounded(model: Model) -> Model:
    """The model without bounds of its parameters: differences at a bound look beyond it. Delays keep theirs."""
    kept = {d.by for d in model.delays}
    free = [
        p if p.quantity.name in kept else replace(p, quantity=replace(p.quantity, minimum=None, maximum=None))
        for p in model.parameters
    ]
    return replace(model, parameters=tuple(free))


@cache
def kernel_of(*ids: str) -> Kernel:
    return Kernel(unbounded(with_effects(tubular_dea(), ids)))


def tunable(kernel: Kernel) -> list[str]:
    return [p.quantity.name for p in kernel.model.parameters if p.tunable]


def size(kernel: Kernel, name: str) -> float:
    q = kernel.model.quantity(name)
    return max(abs(q.value or 0.0), q.nominal)


def differences(
    kernel: Kernel,
    values: dict[str, float],
    name: str,
    mesh: np.ndarray | None,
    step: float = 1e-5,
    tolerance: float = 1e-6,
) -> dict[str, np.ndarray]:
    """Central differences of the measured displacement and of the states."""
    d = step * size(kernel, name)
    now = (kernel.defaults | values)[name]
    sides = [kernel.simulate(PROTOCOL, TIMES, {**values, name: now + s}, tolerance, mesh=mesh) for s in (d, -d)]
    return {key: (sides[0][key] - sides[1][key]) / (2 * d) for key in ("measured_displacement", *kernel.states)}


def check(kernel: Kernel, values: dict[str, float], names: list[str], within: float = 3e-6, step: float = 1e-5) -> None:
    seen = kernel.simulate(PROTOCOL, TIMES, values, sensitivities=names)
    for i, name in enumerate(names):
        exact = seen.sensitivities["measured_displacement"][:, i]
        scale = np.max(np.abs(exact))
        error = np.max(np.abs(differences(kernel, values, name, seen.mesh, step)["measured_displacement"] - exact))
        rounding = 1e-16 / (step * size(kernel, name))
        assert error <= within * scale + rounding, f"{name}: off by {error:.1e}, the largest is {scale:.1e}"


def test_base_model_over_its_own_mesh() -> None:
    kernel = kernel_of()
    names = tunable(kernel)
    seen = kernel.simulate(PROTOCOL, TIMES, sensitivities=names)
    assert seen.parameters == tuple(names)
    for i, name in enumerate(names):
        for key, difference in differences(kernel, {}, name, seen.mesh, step=1e-4).items():
            exact = seen.sensitivities[key][:, i]
            assert np.max(np.abs(difference - exact)) < 2e-4 * np.max(np.abs(exact)), (key, name)
    check(kernel, {}, names)


@pytest.mark.parametrize("name", EFFECTS)
@pytest.mark.parametrize("state", ["off", "typical"])
def test_effects(name: str, state: str) -> None:
    effect = catalogue()[name]
    values = dict(effect.typical) | ({"lambda_2_stop": 1.15} if name == "rigid_stop" else {})
    values |= dict(effect.off) if state == "off" else {}
    names = [*dict.fromkeys((*effect.fit, *effect.amplitudes, "C_1"))]
    corner = name == "rigid_stop"  # it is 2e-4 wide, which a difference sees
    check(kernel_of(name), values, names, 1e-4 if corner else 1e-5, 1e-6 if corner else 1e-5)


def test_values_are_those_of_the_adaptive_run() -> None:
    kernel = kernel_of()
    plain = kernel.simulate(PROTOCOL, TIMES)
    seen = kernel.simulate(PROTOCOL, TIMES, sensitivities=["C_1"])
    assert seen.steps == plain.steps
    for name in ("lambda_2", "measured_displacement", "sigma_vis1"):
        assert np.max(np.abs(seen[name] - plain[name])) <= 1e-10 * np.max(np.abs(plain[name]))


def test_they_tend_to_the_derivative_of_the_exact_solution() -> None:
    kernel = kernel_of()
    names = ["C_1", "eps_r", "eta_o", "k_1"]
    fine = kernel.simulate(PROTOCOL, TIMES, tolerance=1e-10, sensitivities=names)
    usual = kernel.simulate(PROTOCOL, TIMES, tolerance=1e-6, sensitivities=names)
    a, b = (r.sensitivities["measured_displacement"] for r in (fine, usual))
    assert np.all(np.max(np.abs(a - b), axis=0) < 2e-3 * np.max(np.abs(a), axis=0))


def test_a_kept_mesh_makes_the_cost_smooth() -> None:
    """Second differences over tiny parameter steps: at the level of rounding on a kept mesh."""
    kernel = kernel_of()
    mesh = kernel.mesh(PROTOCOL, tolerance=1e-4)
    C_1 = kernel.defaults["C_1"]
    cost = [
        float(np.sum(kernel.simulate(PROTOCOL, TIMES, {"C_1": C_1 * (1 + i * 1e-7)}, mesh=mesh)["lambda_2"]))
        for i in range(-4, 5)
    ]
    assert np.max(np.abs(np.diff(cost, 2))) < 1e-9
    slope = kernel.simulate(PROTOCOL, TIMES, mesh=mesh, sensitivities=["C_1"]).sensitivities["lambda_2"].sum()
    assert (cost[-1] - cost[0]) / (8e-7 * C_1) == pytest.approx(slope, rel=1e-5)


def test_the_emitted_first_derivatives_agree_with_complex_steps() -> None:
    """d(dx)/dp of the equations themselves, by a complex step in plain Python: the integrator's input is exact."""
    tube = compile_python(tubular_dea())
    p = list(tube.PARAMETERS.values())
    x, u, zeros = (1.3, 2.0, 1e4, -2e4), (1.2e4, 5e3), (0.0, 0.0)
    import cmath

    complex_tube = compile_python(tubular_dea())
    for function in ("derivatives",):
        getattr(complex_tube, function).__globals__["math"] = cmath
    for i, name in enumerate(list(tube.PARAMETERS)[:9]):
        h = 1e-20 * abs(p[i])
        moved = [*p]
        moved[i] = p[i] + 1j * h
        exact = [d.imag / h for d in map(complex, complex_tube.derivatives(0.0, x, u, zeros, moved, (0.0,)))]
        seeds = [0.0] * len(p)
        seeds[i] = 1.0
        tangent, _ = tube.tangent(0.0, x, u, zeros, p, (0.0,), 0.0, (0.0,) * 4, zeros, zeros, seeds, (0.0,))
        assert tangent == pytest.approx(exact, rel=1e-12, abs=1e-18), name


def test_rest_states_move_with_parameters() -> None:
    """Started at rest and left there: the sensitivity is that of the equilibrium curve."""
    kernel = kernel_of()
    held = Protocol.of([0, 1], pressure=[1.2e4, 1.2e4], voltage=[4e3, 4e3])
    start = {"start_at_equilibrium": 1.0}
    times = np.array([0.0, 1.0])
    seen = kernel.simulate(held, times, start, sensitivities=["C_1", "eps_r", "eta_o"])
    rest = seen["lambda_2"][:1]
    inputs = {"pressure": 1.2e4, "voltage": 4e3}
    for i, name in enumerate(("C_1", "eps_r")):
        d = 1e-5 * kernel.defaults[name]
        loads = [kernel.curve(rest, inputs, {name: kernel.defaults[name] + s})[0][0] for s in (d, -d)]
        slope = kernel.curve(rest, inputs)[1][0]
        expected = -(loads[0] - loads[1]) / (2 * d) / slope
        assert seen.sensitivities["lambda_2"][:, i] == pytest.approx(expected, rel=1e-6)
    assert np.max(np.abs(seen.sensitivities["lambda_2"][:, 2])) < 1e-12


@pytest.mark.parametrize("name", ["pressure_delay", "sensor_delay"])
def test_delays(name: str) -> None:
    """To a delay itself by the signal's rate, against differences of tightly integrated trajectories."""
    kernel = kernel_of(name)
    values = {name: 0.012}
    seen = kernel.simulate(PROTOCOL, TIMES, values, 1e-8, sensitivities=[name, "C_1"])
    exact = seen.sensitivities["measured_displacement"][:, 0]
    difference = differences(kernel, values, name, None, 1e-3, 1e-10)["measured_displacement"]
    away = np.abs(TIMES[:, None] - np.array([0.5, 1.0, 2.0]) - 0.012).min(axis=1) > 2e-3  # kinks pass there
    assert np.max(np.abs(difference - exact)[away]) < 2e-3 * np.max(np.abs(exact))
    off = kernel.simulate(PROTOCOL, TIMES, {name: 0.0}, 1e-8, sensitivities=[name])
    assert np.max(np.abs(off.sensitivities["measured_displacement"])) > 0


def test_they_can_be_compiled_when_they_are_asked_for() -> None:
    model = with_effects(tubular_dea(), ["electrode_resistance"])
    now, later = Kernel(model), Kernel(model, differentiated=False)
    for options in ({}, {"sensitivities": ["C_1", "tau_e"]}):
        runs = [kernel.simulate(PROTOCOL, TIMES, {"tau_e": 0.01}, **options) for kernel in (now, later)]
        for name in runs[0].values:
            np.testing.assert_array_equal(runs[0][name], runs[1][name])
        for name, derivative in runs[0].sensitivities.items():
            np.testing.assert_array_equal(derivative, runs[1].sensitivities[name])


def test_threads_do_not_disturb_each_other() -> None:
    kernel = kernel_of()
    work = [{"C_1": kernel.defaults["C_1"] * (1 + 0.01 * i)} for i in range(8)]

    def run(values: dict[str, float]) -> np.ndarray:
        return kernel.simulate(PROTOCOL, TIMES, values, sensitivities=["C_1", "k_1"]).sensitivities["lambda_2"]

    with ThreadPoolExecutor(4) as pool:
        together = list(pool.map(run, work))
    assert all(np.array_equal(a, run(values)) for a, values in zip(together, work, strict=True))


def test_bench_inputs_are_cheap() -> None:
    """A breakpoint every 4 ms: 4 000 samples with 11 columns; the figure printed is for the record."""
    rng = np.random.default_rng(3)
    time = 0.004 * np.arange(4000)
    pressure = 1.2e4 * np.minimum(1, time / 4) + 25 * rng.standard_normal(time.size)
    voltage = np.where((time > 6) & (time < 11), 5e3, 0.0) + 4 * rng.standard_normal(time.size)
    grid, straight, held = np.repeat(time, 2)[1:], np.repeat(pressure, 2)[1:], np.repeat(voltage, 2)[:-1]
    protocol = Protocol.of(grid, pressure=straight, voltage=held)
    kernel = kernel_of("electrode_resistance")
    names = tunable(kernel)[:11]
    values = dict(catalogue()["electrode_resistance"].typical)
    kernel.simulate(protocol, time, values, 1e-4, sensitivities=names)
    began = clock.process_time()
    seen = kernel.simulate(protocol, time, values, 1e-4, sensitivities=names)
    spent = clock.process_time() - began
    print(f"{spent * 1e3:.0f} ms for {seen.steps} steps and {len(names)} columns")
    assert spent < 1.0, "this took 0.04 s on the machine it was written on"


def test_what_cannot_be_varied_is_refused() -> None:
    kernel = kernel_of()
    with pytest.raises(SensitivityError, match="expected a parameter that is tunable or sets a start value"):
        kernel.simulate(PROTOCOL, TIMES, sensitivities=["l_o"])
    with pytest.raises(SensitivityError, match="did you mean"):
        kernel.simulate(PROTOCOL, TIMES, sensitivities=["eps_rr"])
    with pytest.raises(KernelError, match="no sensitivities"):
        kernel.simulate(PROTOCOL, TIMES, sensitivities=["C_1"], with_fold=True)
    with pytest.raises(KernelError, match="no rest state"):
        beyond = Protocol.of([0, 1], pressure=[9e4, 9e4], voltage=[0, 0])
        kernel.simulate(beyond, np.array([0.5]), {"start_at_equilibrium": 1.0}, sensitivities=["C_1"])
