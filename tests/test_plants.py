"""What a plant is: what it names must be in its model, and the tube is one."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import sympy

import tubular_dea as td
from made_up import option
from tubular_dea.discover.answer.outcome import advice
from tubular_dea.discover.experiments.next_experiment import Proposal, at_channel, kind, sweeps
from tubular_dea.laws.places import Balance, Coefficient, Path
from tubular_dea.model.build import Build
from tubular_dea.model.declare import DeclarationError
from tubular_dea.model.smooth import root, step
from tubular_dea.plants.effects import catalogue
from tubular_dea.plants.plant import Exchange, Input, Output, Plant, Stage
from tubular_dea.plants.tube import PLANT, TABLE_II
from tubular_dea.protocol import Protocol


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (
            {"inputs": [Input("presure"), Input("voltage")]},
            "TubularDEA: Input('presure'): TubularDEA has no such input; did you mean pressure?",
        ),
        (
            {"inputs": [Input("pressure")]},
            "expected an Input for every input of TubularDEA but there is none for 'voltage'",
        ),
        ({"outputs": []}, "expected at least one Output but was given none"),
        ({"outputs": [Output("radius_of_it")]}, "Output('radius_of_it'): TubularDEA puts out no such quantity"),
        ({"outputs": [Output("sigma_hoop")]}, "Output('sigma_hoop'): TubularDEA puts out no such quantity"),
        (
            {"outputs": [Output("radius", {"radius": "r_0"})]},
            "Output('radius'): TubularDEA has no parameter 'r_0'; did you mean r_o?",
        ),
        ({"geometry": ["l_o", "lenght"]}, "geometry: TubularDEA has no parameter 'lenght'"),
        (
            {"exchanges": [Exchange({"k_1": "k_3", "k_3": "k_1"}, lambda v: True)]},
            "exchanges: TubularDEA has no parameter",
        ),
        (
            {"stages": [Stage(("C_1", "C_9"), "elastic", lambda drives: [0])]},
            "Stage('elastic'): TubularDEA has no parameter 'C_9'",
        ),
        ({"starts": {"mine": {"C1": 3e5}}}, "starts 'mine': TubularDEA has no parameter 'C1'; did you mean C_1?"),
        ({"restart": ["eta"]}, "restart: TubularDEA has no parameter 'eta'"),
    ],
)
def test_a_plant_that_names_what_its_model_has_not_is_refused(change: dict, words: str) -> None:
    with pytest.raises(DeclarationError) as refusal:
        replace(PLANT, **change)
    assert words in str(refusal.value)


def test_an_output_that_never_changes_is_refused() -> None:
    """It took 41 s to an answer in which a drift of that output was the nearest effect."""
    m = Build("Still", "A gauge on nothing")
    x, k = m.state("x", "m", "Position"), m.parameter("k", "N/m", 2.0, "Stiffness")
    m.derivative(x, m.input("push", "m/s", "Speed"))
    m.output("gauge", "N/m", 2 * k, "Stiffness")
    with pytest.raises(DeclarationError, match=r"Output\('gauge'\) depends on no state and no input of Still"):
        Plant(m.model(), inputs=[Input("push")], outputs=[Output("gauge")])


def test_a_parameter_in_no_equation_is_refused() -> None:
    m = Build("Slide", "A mass that is pushed")
    v, mass = m.state("v", "m/s", "Speed"), m.parameter("mass", "kg", 2.0, "Mass", tunable=True)
    m.parameter("friction", "N.s/m", 1.0, "Friction, forgotten in the balance", tunable=True)
    m.derivative(v, m.input("push", "N", "Force") / mass)
    m.output("read", "m/s", v, "Speed")
    with pytest.raises(DeclarationError, match="the parameter 'friction' is in no equation of Slide"):
        Plant(m.model(), inputs=[Input("push")], outputs=[Output("read")])


def test_the_headings_of_a_file_are_told_with_their_units() -> None:
    assert PLANT.headers() == "time [s],pressure [Pa],voltage [V],radius [m]"
    second = replace(PLANT, outputs=[*PLANT.outputs[:1], Output("current", required=False)])
    assert second.headers() == PLANT.headers()  # files may have it
    assert Plant(PLANT.model, PLANT.inputs, [Output("charge")]).headers().endswith(",charge [C]")


def test_the_tube_has_its_effects_in_its_channels() -> None:
    assert set(catalogue()) <= set(PLANT.catalogue)
    assert set(PLANT.channels) == {"electrical", "mechanical", "pressure", "sensor"}
    assert {s.channel for s in PLANT.inputs} | {o.channel for o in PLANT.outputs} <= set(PLANT.channels)


def test_exchangeable_branches_are_put_in_order() -> None:
    values = PLANT.model.parameter_values()
    assert PLANT.ordered(values) == values
    swapped = values | {"k_1": values["k_2"], "k_2": values["k_1"], "eta_1": values["eta_2"], "eta_2": values["eta_1"]}
    assert PLANT.ordered(swapped) == values
    come = PLANT.exchanged(swapped)
    assert {n: swapped[come[n]] for n in come} == values
    assert PLANT.exchanged({"k_1": 1.0, "eta_1": 2.0}) == {"k_1": "k_1", "eta_1": "eta_1"}  # a branch is held


def test_the_stages_take_the_experiments_that_they_are_about() -> None:
    def driven(height: float, ramp: bool) -> Protocol:
        rise = 5.0 if ramp else 0.0
        return Protocol.of([0, 1, 1 + rise, 10], pressure=[0, 9e3, 9e3, 9e3], voltage=[0, 0, height, height])

    drives = [driven(0.0, True), driven(6e3, False), driven(7e3, True), driven(4e3, True), driven(4e3, False)]
    picked = {stage.names: stage.select(drives) for stage in PLANT.stages}
    assert picked == {
        ("C_1", "eps_r"): [3],
        ("C_2", "C_3"): [2],
        ("C_1", "eps_r", "C_2", "C_3"): [2, 3],
        ("eta_o", "k_1", "eta_1", "k_2", "eta_2"): [4],
    }
    for stage in PLANT.stages:  # without such experiments, all of them
        assert stage.select([driven(0.0, True)] * 2) == [0, 1]


def test_equal_branches_are_moved_apart_before_they_are_searched() -> None:
    start = PLANT.model.parameter_values() | TABLE_II
    viscous = PLANT.stages[-1]
    moved = viscous.prepare(start)
    times = moved["eta_1"] / moved["k_1"], moved["eta_2"] / moved["k_2"]
    assert times[1] == pytest.approx(5 * times[0])
    assert viscous.prepare(moved) == moved


def test_the_largest_inputs_keep_their_sign() -> None:
    drives = [
        Protocol.of([0, 1], pressure=[0, 5e3], voltage=[0, -6e3]),
        Protocol.of([0, 1], pressure=[0, 9e3], voltage=[0, 4e3]),
    ]
    assert PLANT.nominal_inputs(drives) == {"pressure": 9e3, "voltage": -6e3}


def test_feasible_experiments_stay_within_what_was_recorded() -> None:
    assert PLANT.experiments is not None
    made = PLANT.experiments({"pressure": 9e3, "voltage": -6e3})
    assert len(made) >= 3
    for words, protocol in made.items():
        assert words and np.all(np.diff(protocol.time) >= 0)
        assert np.abs(protocol.inputs["pressure"]).max() <= 9e3 + 1e-9
        assert np.abs(protocol.inputs["voltage"]).max() <= 6e3 + 1e-9


def test_steps_and_sweeps_stay_below_what_was_recorded() -> None:
    """Of each input in turn, up to 85 % of its largest value, the other held at half of its own."""
    largest = {"pressure": 10e3, "voltage": -6e3}
    made = sweeps(PLANT, largest, 20.0, 0.01)
    assert len(made) == 4
    for words, protocol in made.items():
        moved, other = ("pressure", "voltage") if "of pressure" in words else ("voltage", "pressure")
        share = protocol.inputs[moved] / largest[moved]
        assert share.min() == 0 and share.max() == pytest.approx(0.85, rel=1e-2)
        assert np.all(protocol.inputs[other] == 0.5 * largest[other])
        assert ("63.8 mmHg" if moved == "pressure" else "-5.1 kV") in words  # in their usual units
        if words.startswith("steps"):
            heights = share[:-1][np.diff(share) == 0]
            assert heights.size == 10 and np.unique(heights).size > 5  # each held for a tenth of the time
            assert np.all(np.diff(protocol.time)[np.diff(share) == 0] == pytest.approx(2.0))


def test_a_sweep_of_what_never_is_0_starts_where_it_was_recorded() -> None:
    made = sweeps(PLANT, {"pressure": 10e3, "voltage": 6e3}, 20.0, 0.01, {"pressure": 5e3, "voltage": 0.0})
    for words, protocol in made.items():
        low, high = (5e3, 9.25e3) if "of pressure" in words else (7.5e3, 7.5e3)
        assert protocol.inputs["pressure"].min() == low and protocol.inputs["pressure"].max() == pytest.approx(high)


def test_an_experiment_that_tells_nothing_apart_is_not_advised() -> None:
    outputs = [SimpleNamespace(channel="sensor")]
    study = SimpleNamespace(
        plant=SimpleNamespace(name="Axis", experiments=None, inputs=[SimpleNamespace(name="force")], outputs=outputs),
        catalogue={"lag(a)": SimpleNamespace(channel="force")},
    )
    for verdict, proposal, words in [
        (
            "ambiguous",
            Proposal("steps of force", 0.1),
            "no experiment of steps and sweeps of force within the recorded",
        ),
        ("ambiguous", None, "range distinguishes lag(a) from lag(b); a second sensor may."),
        (
            "ambiguous",
            Proposal("a sweep of force", 2e-6),
            "nothing distinguishes lag(a) from lag(b): in the Axis they are one thing under several names",
        ),
        (
            "ambiguous",
            Proposal("steps of force", 72.0),
            "steps of force, which distinguishes lag(a) from lag(b) by 12 ",
        ),
        ("effect_found", Proposal("steps of force", 0.1), "repeat the experiments on another specimen"),
    ]:
        chosen, equals = option("lag(a)"), {"lag(a)": ["lag(b)"]}
        found = SimpleNamespace(
            verdict=verdict, proposal=proposal, chosen=chosen, equivalent=equals, study=study, strained=()
        )
        found.chosen_gains, found.repeated = {"lag(a)": 1000.0}, False
        assert words in advice(found)
    study.catalogue = {"lag(a)": SimpleNamespace(channel="sensor")}
    assert "repeat the experiments with another sensor" in advice(found)
    assert kind(PLANT) == "of those declared for the TubularDEA"


@pytest.mark.parametrize(
    ("read", "measure"), [(1.0, "what else acts on level"), (2.0, "level itself too, or what else")]
)
def test_what_to_do_in_a_channel_can_be_done(read: float, measure: str) -> None:
    """Nobody can put a second sensor on a coefficient, nor measure what is read already."""
    m = Build("Cell", "A store that drains")
    pump = m.input("pump", "m/s", nominal=1.0)
    level = m.state("level", "m", start=0.0, nominal=0.5)
    drain = m.define("drain", "m/s", m.parameter("k", "1/s", 1.0) * level)
    m.derivative(level, pump - drain)
    m.output("reading", "m", read * level if read != 1 else level)
    places = [Path("reading"), Balance("level"), Coefficient("drain", of="level"), Coefficient("k", of="pump")]
    plant = Plant(m.model(), inputs=[Input("pump")], outputs=[Output("reading")], places=places)
    told = {c: at_channel(plant, c) for c in ("reading", "level", "drain", "k")}
    assert told["reading"] == "repeat an experiment with a second sensor in the reading channel"
    assert told["level"].startswith(f"repeat an experiment and measure {measure}")
    assert told["drain"].startswith("repeat one course of pump at several levels of level")
    assert told["k"].startswith("record steps of pump of several heights")
    moving = [Balance("level", displacement="level"), places[2]]  # of a speed no level can be set
    told = at_channel(SimpleNamespace(places=moving, inputs=plant.inputs, model=plant.model), "drain")
    assert told == "repeat one course of pump in several sizes, as drain may depend on more than level"


def test_a_coefficient_may_depend_on_two_quantities() -> None:
    """What the second place adds has names of its own; what is the same at both is there once."""
    m = Build("Shaft", "a shaft", "Two masses")
    torque = m.input("torque", "N.m", nominal=1.0)
    k, c = m.parameter("k", "N.m", 30.0), m.parameter("c", "N.m.s", 0.1)
    twist, speed = m.state("twist", "rad", nominal=0.05), m.state("speed", "rad/s", nominal=20.0)
    shaft = m.define("shaft", "N.m", k * twist + c * speed, nominal=1.0)
    m.derivative(twist, speed)
    m.derivative(speed, (torque - shaft) / m.parameter("J", "kg.m2", 0.01))
    m.output("angle", "rad", 1.0 * twist)
    places = [Coefficient("shaft", of="speed"), Coefficient("shaft", of="twist")]
    both = Plant(m.model(), inputs=[Input("torque", held=True)], outputs=[Output("angle")], places=places).catalogue
    assert {"dependence(shaft)", "shaft_dependence_twist", "softening(shaft)", "shaft_softening_twist"} <= both.keys()
    assert "shaft_power_twist" not in both and "power(shaft)" in both
    assert len({q.name for e in both.values() for q in e.parameters}) == sum(len(e.parameters) for e in both.values())


def test_the_width_of_a_root_may_be_a_parameter() -> None:
    m = Build("Orifice", "A valve")
    drop, width = m.input("drop", "Pa", nominal=1e4), m.parameter("width", "Pa", 100.0, tunable=False)
    gain = m.parameter("gain", "m3/s/Pa0.5", 1e-6)
    m.output("flow", "m3/s", gain * root(drop, width))
    run = td.simulate(Plant(m.model(), [Input("drop")], [Output("flow")]), drop=1e4, stop=1.0)
    assert run["flow"][-1] == pytest.approx(1e-4, rel=1e-3)


@pytest.mark.parametrize("size", ["5 um", float("nan"), -1.0, True])
def test_a_size_of_a_signal_is_a_number(size: Any) -> None:
    """`zero="5 um"` was a traceback once a file had been read."""
    with pytest.raises(DeclarationError, match=r"Output\('position'\): zero: expected a number that is not negative"):
        Output("position", zero=size)
    with pytest.raises(DeclarationError, match=r"Input\('load'\): least: expected a number"):
        Input("load", least=size)
    assert Output("position", zero=np.float64(5e-6)).known_zero == 5e-6


def test_a_step_at_a_number_is_one() -> None:
    """A friction of 2 step(v) - 1 with v at rest was a traceback."""
    x = sympy.Symbol("x", real=True)
    assert [step(x).subs(x, at) for at in (-1, 0, sympy.Float(0.0), 1)] == [0, 0, 0, 1]


def test_an_effect_that_is_none_is_told_what_is_like_it() -> None:
    with pytest.raises(KeyError, match=r"no effect 'electrode_resistence'; did you mean electrode_resistance"):
        PLANT.catalogue["electrode_resistence"]
    assert PLANT.catalogue.get("electrode_resistence") is None
