"""An effect by itself, from its declaration alone: the cut does what the whole model does, and is drawn so."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from test_laws import DRIVES, PLACES, at
from tubular_dea.discover.answer.own_curve import Excitation, IsolatedEffect, own_curve
from tubular_dea.discover.scores.parameters import effect_parameters
from tubular_dea.identify.fitting.fit import Fit
from tubular_dea.kernel import Kernel
from tubular_dea.model.alone import alone
from tubular_dea.model.declare import DeclarationError, Model
from tubular_dea.model.effect import Effect
from tubular_dea.plants.tube import PLANT
from tubular_dea.report.parts import percent

SPREAD = 0.1  # standard deviation of every parameter, in the solver's numbers


def fit_of(model: Model, effect: Effect, values: dict[str, float]) -> Fit:
    """A fit that ended at the effect's usual size, each of its parameters with a standard error of 10 %."""
    free = effect_parameters(effect)
    known = model.parameter_values() | dict(effect.typical) | values
    scaled = np.array([f.to_scaled(known[f.name]) for f in free])
    covariance = np.diag(
        [(SPREAD if f.logarithmic else SPREAD * abs(s)) ** 2 for f, s in zip(free, scaled, strict=True)]
    )
    none = np.zeros((0, len(free)))
    return Fit(known, scaled, 0.0, none[:, 0], none, covariance, free, {f.name: 0.0 for f in free}, True)


def law(plant: str, name: str) -> tuple[Model, Effect]:
    """A law at a place of one of the small plants of `test_laws`."""
    found = [e for i in range(len(PLACES[plant][1])) for e in at(plant, i) if e.id == name]
    return PLACES[plant][0](), found[0]


def isolated_of(
    plant: str, name: str, values: dict[str, float] | None = None
) -> tuple[IsolatedEffect, list[Excitation]]:
    model, effect = law(plant, name)
    drive, times = DRIVES[plant], np.linspace(0, DRIVES[plant].time[-1], 801)
    run = Kernel(model).simulate(drive, times)
    given = {s.quantity.name: run[s.quantity.name] for s in model.states} | drive.at(times)
    return IsolatedEffect(model, effect, fit_of(model, effect, values or {})), [Excitation(times, given)]


@pytest.mark.parametrize(
    ("plant", "name"),
    [
        ("oscillator", "lag(position)"),
        ("oscillator", "delay(position)"),
        ("oscillator", "dry_friction(v)"),
        ("oscillator", "relaxation(v)"),
        ("oscillator", "dependence(spring)"),
        ("tanks", "power(flow_1)"),
        ("tanks", "spill_over(upper)"),
        ("tanks", "echo(pump)"),
        ("tanks", "rate_limit(pump)"),
    ],
)
def test_the_cut_does_what_the_effect_does_in_the_whole_model(plant: str, name: str) -> None:
    """Along a trajectory of the whole model with the effect in it, driven by that trajectory's states and inputs."""
    model, effect = law(plant, name)
    cut, values = alone(model, effect), dict(effect.typical)
    whole = effect(model)
    if cut.output not in whole.outputs:
        whole = replace(whole, outputs=(*whole.outputs, cut.output))
    drive = DRIVES[plant]
    fine = np.unique(np.concatenate([np.linspace(drive.time[0], drive.time[-1], 6001), drive.time]))
    run = Kernel(whole).simulate(drive, fine, values, tolerance=1e-9)
    isolated = IsolatedEffect(model, effect, fit_of(model, effect, {}))
    states = {s.quantity.name: run[s.quantity.name] for s in model.states}
    found = isolated.run(Excitation(fine, states | drive.at(fine)), isolated.on)[cut.output]
    error = np.abs(found - run[cut.output])
    assert np.quantile(error, 0.99) < 2e-3 * np.ptp(run[cut.output])  # but for samples beside a jump of the drive


@pytest.mark.parametrize(
    ("plant", "name", "kind"),
    [
        ("oscillator", "lag(position)", "step"),
        ("oscillator", "dry_friction(v)", "loop"),
        ("oscillator", "quadratic_drag(v)", "curve"),
        ("oscillator", "drift(position)", "time"),
        ("oscillator", "delay(force)", "step"),
        ("tanks", "softening(flow_1)", "loop"),
        ("tanks", "power(flow_1)", "curve"),
        ("sensor", "saturation(load)", "curve"),
    ],
)
def test_each_is_drawn_as_what_it_is(plant: str, name: str, kind: str) -> None:
    isolated, excitations = isolated_of(plant, name)
    curve = own_curve(isolated, excitations)
    assert curve is not None and curve.kind == kind
    assert np.all(np.isfinite(curve.on)) and np.all(curve.low <= curve.high)
    assert np.ptp(curve.on - curve.off) > 0


def test_what_is_the_same_whatever_moves_has_no_curve() -> None:
    assert own_curve(*isolated_of("tanks", "offset(pump)")) is None
    assert own_curve(*isolated_of("oscillator", "offset(v)")) is None


def test_a_lags_step_is_an_exponential_with_its_time_constant() -> None:
    isolated, excitations = isolated_of("oscillator", "lag(force)", {"force_lag_tau": 0.2})
    isolated.jumping = {"force"}
    curve = own_curve(isolated, excitations)
    assert curve is not None and curve.kind == "step" and curve.ends == (-2.0, 3.0)
    after = curve.x > 1e-6
    assert curve.on[after] == pytest.approx(-2 + 5 * (1 - np.exp(-curve.x[after] / 0.2)), abs=5e-3)
    assert curve.on[curve.x < 0] == pytest.approx(-2)
    slow, fast = (0.2 * np.exp(z * SPREAD) for z in (1.96, -1.96))
    assert curve.low[after] == pytest.approx(-2 + 5 * (1 - np.exp(-curve.x[after] / slow)), abs=0.08)
    assert curve.high[after] == pytest.approx(-2 + 5 * (1 - np.exp(-curve.x[after] / fast)), abs=0.08)


def test_a_frictions_loop_is_as_high_as_its_force() -> None:
    isolated, excitations = isolated_of("oscillator", "dry_friction(v)")
    curve = own_curve(isolated, excitations)
    assert curve is not None and curve.over is not None and curve.over.name == "x"
    force = isolated.on["v_dry_friction_force"]
    assert np.ptp(curve.on) == pytest.approx(2 * force, rel=0.03)
    top = curve.on > 0.95 * force
    assert (curve.high - curve.on)[top] == pytest.approx(1.96 * SPREAD * force, rel=0.1)


def test_an_effect_may_say_how_it_is_shown() -> None:
    model, effect = law("oscillator", "dependence(spring)")
    shown = replace(effect, curve="spring over x")
    assert alone(model, shown).over == "x"
    with pytest.raises(DeclarationError, match="it is shown over 'v', which it does not act on; there are x"):
        alone(model, replace(effect, curve="spring over v"))
    with pytest.raises(DeclarationError, match="has no definition 'sprung'; did you mean spring"):
        alone(model, replace(effect, curve="sprung over x"))


@pytest.mark.parametrize(
    ("name", "kind", "shown", "over"),
    [
        ("friction_hysteresis", "loop", "F_cir", "lambda_2"),
        ("electrode_resistance", "step", "electrode_voltage", None),
        ("mullins_softening", "loop", "dW_dI_1", "lambda_2"),
        ("rate_dependent_viscosity", "curve", "sigma_eta", "lambda_2_rate"),
    ],
)
def test_effects_of_the_tube(name: str, kind: str, shown: str, over: str | None) -> None:
    """Which know nothing of how they are drawn."""
    effect = PLANT.catalogue[name]
    assert effect.curve == ""
    protocol = PLANT.standard()["step to 6 kV"] if PLANT.standard else None
    assert protocol is not None
    times = np.linspace(0, 16, 2000)
    run = Kernel(PLANT.model).simulate(protocol, times)
    given = {s.quantity.name: run[s.quantity.name] for s in PLANT.model.states} | protocol.at(times)
    isolated = IsolatedEffect(PLANT.model, effect, fit_of(PLANT.model, effect, {}), {"voltage"})
    curve = own_curve(isolated, [Excitation(times, given)])
    assert curve is not None
    assert (curve.kind, curve.shown.name, curve.over.name if curve.over else None) == (kind, shown, over)


@pytest.mark.parametrize(
    ("share", "words"), [(0.0, "0%"), (0.003, "less than 1%"), (0.42, "42%"), (0.997, "more than 99%"), (1.0, "100%")]
)
def test_a_share_that_is_not_all_is_not_called_so(share: float, words: str) -> None:
    assert percent(share) == words
