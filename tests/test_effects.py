"""Effects: off they are the base model, they compose, and an FMU carries them with their parameters tunable."""

from __future__ import annotations

import itertools
import re
from dataclasses import replace
from functools import cache
from pathlib import Path

import fmpy
import numpy as np
import pytest
from fmpy.validation import validate_fmu
from scipy.integrate import cumulative_trapezoid

import tubular_dea as td
from tubular_dea.discover.scores.parameters import all_off
from tubular_dea.emit import tables
from tubular_dea.emit.python import compile_python
from tubular_dea.export.package import native_fmu
from tubular_dea.identify.fitting.compiled import Compiled
from tubular_dea.kernel import Kernel
from tubular_dea.model.dea import tubular_dea
from tubular_dea.model.declare import DeclarationError
from tubular_dea.plants.effects import catalogue, with_effects
from tubular_dea.plants.tube import PLANT
from tubular_dea.protocol import Protocol

IDS = tuple(catalogue())
DESIGN = {  # the effects of the tube that design.md names; those that drift over a long record are laws of any plant
    "electrical": [
        "electrode_resistance",
        "amplifier_slew",
        "charge_trapping",
        "stretch_dependent_permittivity",
        "field_dependent_permittivity",
    ],
    "mechanical": [
        "rate_dependent_viscosity",
        "stretch_dependent_viscosity",
        "hoop_viscoelasticity",
        "third_maxwell_branch",
        "mullins_softening",
        "friction_hysteresis",
        "permanent_set",
        "prestretch",
        "passive_layer_stiffness",
        "strain_stiffening",
        "clamp_compliance",
        "added_mass",
        "rigid_stop",
        "thermal_softening",
    ],
    "pressure": ["pressure_offset", "pressure_gain", "pressure_delay", "pneumatic_line"],
    "sensor": ["radius_offset", "radius_gain", "sensor_lag", "sensor_delay"],
}


def test_the_readme_lists_every_effect_of_the_tube() -> None:
    root = Path(__file__).resolve().parents[1]
    section = (
        (root / "README.md").read_text(encoding="utf-8").partition("### Effects of the tube\n")[2].partition("\n## ")[0]
    )
    rows = re.findall(r"^\| (\w+) \| (.+) \|$", section, re.MULTILINE)[1:]
    listed = {channel: re.findall(r"`(\w+)`", effects) for channel, effects in rows}
    assert {i: channel for channel, ids in listed.items() for i in ids} == {
        i: effect.channel for i, effect in PLANT.catalogue.items()
    }
    assert all((root / path).is_file() for path in re.findall(r"\((fmu_src/[^)]+)\)", section))


# Chains along one signal, terms in one stress, memory with memory, delays with lags: in both orders.
PAIRS = (
    ("amplifier_slew", "electrode_resistance"),
    ("charge_trapping", "field_dependent_permittivity"),
    ("stretch_dependent_permittivity", "field_dependent_permittivity"),
    ("pressure_gain", "pressure_offset"),
    ("pressure_delay", "pneumatic_line"),
    ("voltage_delay", "electrode_resistance"),
    ("sensor_lag", "sensor_delay"),
    ("radius_gain", "sensor_lag"),
    ("prestretch", "permanent_set"),
    ("mullins_softening", "thermal_softening"),
    ("stretch_dependent_viscosity", "third_maxwell_branch"),
    ("friction_hysteresis", "rigid_stop"),
)
PROTOCOL = Protocol.of(
    [0, 0.5, 1, 1, 2, 2, 3], pressure=[0, 1.2e4, 1.2e4, 1.2e4, 1.2e4, 1.2e4, 0.9e4], voltage=[0, 0, 0, 5e3, 5e3, 0, 0]
)
TIMES = np.linspace(0, 3, 301)


@cache
def kernel_of(*ids: str) -> Kernel:
    """The compiled base with effects."""
    return Kernel(with_effects(tubular_dea(), ids))


@pytest.fixture(scope="module")
def base():
    return tubular_dea()


@pytest.fixture(scope="module")
def expected(kernel):
    return kernel.simulate(PROTOCOL, TIMES, tolerance=1e-8, with_fold=True)


def points(model) -> list[dict[str, float]]:
    """States and inputs at which right-hand sides are compared."""
    rng = np.random.default_rng(7)
    ranges = {
        "lambda_2": (0.9, 1.7),
        "lambda_2_rate": (-9, 9),
        "sigma_vis1": (-2e5, 2e5),
        "sigma_vis2": (-2e5, 2e5),
        "pressure": (0, 2e4),
        "voltage": (0, 7e3),
        "voltage_rate": (-1e4, 1e4),
    }
    return [{name: rng.uniform(*span) for name, span in ranges.items()} for _ in range(5)]


@cache
def plain(*ids: str):
    """The model with effects in plain Python."""
    return compile_python(with_effects(tubular_dea(), ids))


def evaluate(model, point: dict[str, float]) -> dict[str, float]:
    """State derivatives and outputs of plain Python at a point; other states anywhere, what is delayed as it is."""
    tube = plain(*model.effects)
    late = {d.quantity.name: point.get(d.of, 0.0) for d in model.delays}
    x = tuple(point.get(s.quantity.name, 0.5) for s in model.states)
    u = (*(point[q.name] for q in model.inputs), *late.values())
    moving = [*(q.name for q in model.inputs), *(d.of for d in model.delays)]
    du = tuple(point.get(f"{name}_rate", 0.0) for name in moving)
    p = tuple(model.parameter_values().values())
    dx = tube.derivatives(0.0, x, u, du, p, (2e4,))
    y = tube.outputs(0.0, x, u, du, p, (2e4,))
    values = dict(zip(tube.OUTPUTS, y, strict=True))
    return {s.quantity.name: d for s, d in zip(model.states, dx, strict=True)} | values


def test_the_catalogue_has_the_ids_of_the_design() -> None:
    """Under the names and in the channels that result.json gives them; more may come."""
    listed = catalogue()
    wanted = {name: channel for channel, names in DESIGN.items() for name in names}
    assert {name: listed[name].channel for name in wanted if name in listed} == wanted
    assert {effect.channel for effect in listed.values()} == set(DESIGN)
    assert [effect.id for effect in listed.values()] == list(listed)


@pytest.mark.parametrize("name", IDS)
def test_declaration(name: str) -> None:
    effect = catalogue()[name]
    assert {q.name for q in effect.parameters} == set(effect.typical)
    assert effect.off and effect.fit and effect.amplitudes
    for line in ("Equation:", "Source:", "Typical:"):
        assert line in effect.documentation, f"{name}'s text lacks '{line}'"
    for q in effect.parameters:
        assert q.source and q.description and q.minimum is not None and q.maximum is not None
        for value in (effect.off.get(q.name, q.value), effect.typical[q.name], *effect.shapes.get(q.name, ())):
            assert q.minimum <= value <= q.maximum, f"{q.name} = {value} is outside its own bounds"
    assert any(effect.typical[n] != value for n, value in effect.off.items()), f"{name} is off where it is typical"


@pytest.mark.parametrize("name", IDS)
def test_off_is_the_base_at_a_point(name: str, base) -> None:
    changed = catalogue()[name](base)
    assert changed.effects == (name,)
    for point in points(base):
        ours, theirs = evaluate(changed, point), evaluate(base, point)
        late = {d.of for d in changed.delays}
        for key, value in theirs.items():
            if key == "measured_displacement" and "sensor_signal" in late:
                continue  # its past is compared in test_off_is_the_base_over_time
            assert ours[key] == pytest.approx(value, rel=1e-11, abs=1e-12), key


@pytest.mark.parametrize("name", IDS)
def test_off_is_the_base_over_time(name: str, expected) -> None:
    effect = catalogue()[name]
    kernel = kernel_of(name)
    shaped = {q.name: effect.typical[q.name] for q in effect.parameters} | dict(effect.off)
    seen = kernel.simulate(PROTOCOL, TIMES, shaped, tolerance=1e-8, with_fold=True)
    for output, scale in (("lambda_2", 1.0), ("measured_displacement", 1e-2), ("snap_through_margin", 1e5)):
        assert np.max(np.abs(seen[output] - expected[output])) < 1e-8 * scale, output
    assert np.max(np.abs(seen["current"] - expected["current"])) < 1e-7


@pytest.mark.parametrize("name", IDS)
def test_on_it_shows_and_rests_where_its_curve_says(name: str, expected) -> None:
    """At a typical size it changes the record, and after long rest lambda_2 is that of the equilibrium curve."""
    effect = catalogue()[name]
    kernel = kernel_of(name)
    values = dict(effect.typical) | ({"lambda_2_stop": 1.15} if name == "rigid_stop" else {})
    seen = kernel.simulate(PROTOCOL, TIMES, values, tolerance=1e-7)
    shift = np.max(np.abs(seen["measured_displacement"] - expected["measured_displacement"]))
    least = 1e-6 if name in ("added_mass", "permittivity_drift") else 1e-5
    assert shift > least, f"a typical {name} moves the record by {shift:.1e} m only"
    if name.endswith("_drift"):
        return  # it does not rest
    slow = Protocol.of([0, 20, 120], pressure=[0, 1e4, 1e4], voltage=[0, 4e3, 4e3])
    rest = kernel.simulate(slow, np.array([120.0]), values)["lambda_2"]
    load, _, _ = kernel.curve(rest, {"pressure": 1e4, "voltage": 4e3}, values)
    memory = values.get("friction_pressure", 0.0)
    assert load[0] == pytest.approx(1e4, abs=20 + memory), f"{name} rests at {load[0]:.1f} Pa, not 10 kPa"


@pytest.mark.parametrize("pair", PAIRS, ids=" + ".join)
def test_pairs_compose_in_any_order(pair: tuple[str, str], expected) -> None:
    effects = [catalogue()[name] for name in pair]
    off = {n: v for e in effects for n, v in (dict(e.typical) | dict(e.off)).items()}
    on = {n: v for e in effects for n, v in e.typical.items()}
    measured = []
    for order in (pair, pair[::-1]):
        kernel = kernel_of(*order)
        seen = kernel.simulate(PROTOCOL, TIMES, off, tolerance=1e-8)
        assert np.max(np.abs(seen["measured_displacement"] - expected["measured_displacement"])) < 1e-10
        measured.append(kernel.simulate(PROTOCOL, TIMES, on, tolerance=1e-7)["measured_displacement"])
    assert np.all(np.isfinite(measured))
    assert np.max(np.abs(measured[0] - measured[1])) < 2e-4  # chains that do not commute differ a little


def test_electrostriction_pulls_as_the_energy_says(base) -> None:
    """What the voltage adds to the load goes with the slope of the capacitance, as energy does: the rest cancels."""
    stretch, slope, volts = np.array([1.1, 1.2, 1.3]), -0.2, {"pressure": 0.0, "voltage": 5e3}
    values = base.parameter_values()
    (plain, *_), (rest, *_) = (Kernel(base).curve(stretch, volts | {"voltage": v}, {}) for v in (5e3, 0.0))
    changed, *_ = kernel_of("stretch_dependent_permittivity").curve(stretch, volts, {"eps_stretch": slope})
    cone = (values["r_o"] / values["l_o"]) ** 2 * (stretch - 1)
    along = np.sqrt(1 + cone * (stretch - 1))
    grows = 2 * (cone / along**2 + 1 / stretch)  # the logarithm of the capacitance, with the stretch
    expected = np.exp(slope * (along + stretch - 2)) * (1 + slope * (cone / along + 1) / grows)
    assert (changed - rest) / (plain - rest) == pytest.approx(expected, rel=5e-3)


def test_all_of_them_compose(base) -> None:
    for order in (IDS, IDS[::-1]):
        model = with_effects(base, order)
        assert model.effects == order
        assert "Effects added" in tables.page(model)
    for a, b in itertools.islice(itertools.permutations(IDS, 2), 0, None, 23):
        with_effects(base, (a, b))


def test_an_effect_goes_in_once(base) -> None:
    with pytest.raises(DeclarationError, match="cannot be added twice"):
        with_effects(base, ["sensor_lag", "sensor_lag"])
    with pytest.raises(DeclarationError, match="did you mean sensor_lag"):
        with_effects(base, ["sensor_leg"])


def test_an_effect_that_is_none_is_refused_in_words(base) -> None:
    """A function without `return` ended in an AttributeError, a parameter that is in no tuple in a TypeError."""
    lag = PLANT.catalogue["sensor_lag"]
    with pytest.raises(DeclarationError, match="sensor_lag: apply: expected a function that returns the changed model"):
        replace(lag, apply=lambda model: None)(base)
    with pytest.raises(DeclarationError, match="parameters: expected a tuple of Quantity"):
        replace(lag, parameters=lag.parameters[0])
    with pytest.raises(DeclarationError, match="off: expected a parameter"):
        replace(lag, off={})


def test_a_plant_is_not_offered_an_effect_that_it_has() -> None:
    """It was in a model with many of them, and no longer in the catalogue that tells how it is switched off."""
    have = "sensor_delay"
    plant = replace(PLANT, model=PLANT.catalogue[have](PLANT.model))
    assert {*PLANT.catalogue} - {*plant.catalogue} == {have}
    kernels = Compiled(plant).scorers(())
    off = all_off(kernels["sensor_lag"].model.effects, plant.catalogue)
    assert not any(q.name in off for q in PLANT.catalogue[have].parameters)


@pytest.mark.parametrize("version", [2, 3])
def test_an_fmu_carries_effects_tunable(version: int, base, tmp_path) -> None:
    ids = (
        "electrode_resistance",
        "friction_hysteresis",
        "mullins_softening",
        "thermal_softening",
        "rigid_stop",
        "rate_dependent_viscosity",
        "sensor_delay",
    )
    values = {n: v for name in ids for n, v in catalogue()[name].typical.items()}
    model = with_effects(base, ids).with_values(values)
    path = native_fmu(model, version, tmp_path / "Effects.fmu")
    assert validate_fmu(str(path)) == []
    described = {v.name: v for v in fmpy.read_model_description(str(path)).modelVariables}
    for name, value in values.items():
        assert described[name].variability == "tunable" and float(described[name].start) == pytest.approx(value)
    result = fmpy.simulate_fmu(
        str(path),
        stop_time=1.0,
        step_size=0.01,
        output_interval=0.01,
        start_values={"pressure": 1e4, "voltage": 4e3},
        output=["measured_displacement"],
    )
    protocol = Protocol.of([0, 1], pressure=[1e4, 1e4], voltage=[4e3, 4e3])
    expected = Kernel(model).simulate(protocol, np.minimum(result["time"], 1.0))["measured_displacement"]
    assert np.max(np.abs(result["measured_displacement"] - expected)) < 1e-7


@pytest.mark.parametrize("line", [0.0, 1 / 3])
def test_electrodes_charge_as_their_equation_says(line: float, base) -> None:
    kernel = Kernel(with_effects(base, ["electrode_resistance"]))
    tau, held = 0.02, {"tau_e": 0.02, "tau_e_stretch": 0.0, "electrode_line": line, "electrode_share": 1.0}
    protocol = Protocol.of([0, 0.1, 0.1, 0.4], pressure=[1e3] * 4, voltage=[0, 0, 4e3, 4e3])
    times = np.linspace(0.1, 0.4, 301)
    run = kernel.simulate(protocol, times, held, tolerance=1e-8)
    tube = base.parameter_values()
    lambda_1 = np.sqrt(1 + (tube["r_o"] / tube["l_o"]) ** 2 * (run["lambda_2"] - 1) ** 2)
    seen = run["electric_field"] * tube["h_ao"] / (lambda_1 * run["lambda_2"])
    since = (times - 0.1) / tau
    expected = 4e3 * ((1 + line) * (1 - np.exp(-since)) - line * (1 - np.exp(-4 * since)))
    assert seen == pytest.approx(expected, abs=0.5)


def test_a_chord_sees_a_delay_of_some_turns_that_its_tangent_does_not() -> None:
    """The tube rings at 60 to 120 Hz after a switching: a delay of 17 ms has nothing to do with the speed of that."""
    step, time = 5e-4, np.arange(0, 4, 5e-4)
    run = td.simulate(td.tube(), pressure="80 mmHg", voltage="step 0 5 kV at 2", times=time, stop=4)

    def late(by: float) -> np.ndarray:
        return np.interp(time - by, time, run["radius"])

    def explained(column: np.ndarray) -> float:
        return float((left @ column) ** 2 / (left @ left) / (column @ column))

    left = late(0.017) - late(0.0)
    chords = [explained(late(s) - late(0.0)) for s in PLANT.catalogue["sensor_delay"].strengths["sensor_delay"]]
    assert max(chords) > 0.8 > 0.6 > explained(late(step) - late(0.0))


def test_a_resistance_fills_the_capacitance_of_the_moving_tube() -> None:
    """What flows through it is the charge: a tube whose capacitance grows by a half draws more than at rest."""
    tube, tau = td.add_effects("tube", ["electrode_resistance"], tau_e="20 ms"), 0.02
    voltage = td.Protocol.of([0, 0.1, 0.101, 0.8, 0.801, 1.5], voltage=[0, 0, 5e3, 5e3, 0, 0], pressure=[14e3] * 6)
    run = td.simulate(tube, voltage, times=np.linspace(0, 1.5, 30_001))
    electrodes = run["charge"] / run["capacitance"]
    geometry = (run["lambda_1"] * run["lambda_2"]) ** 2
    resistance = tau / float((run["capacitance"] / geometry)[0])  # of the tube without load
    flowed = cumulative_trapezoid((run["voltage"] - electrodes) / resistance, run.time, initial=0.0)
    assert np.abs(flowed - run["charge"]).max() < 2e-3 * run["charge"].max()
    assert run["capacitance"].max() > 1.1 * run["capacitance"][0]
