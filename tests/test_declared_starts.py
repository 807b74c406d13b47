"""A base that ends far from the plant takes the records' unknown starts along: the search begins at the declared values
too. A coil behind a diode, whose current the base lets run backwards."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import tubular_dea as td
from tubular_dea.discover.options import refit
from tubular_dea.discover.options.acceptance import clean
from tubular_dea.discover.options.options import Option, fitted_option
from tubular_dea.discover.scores.bootstrap import NullScores
from tubular_dea.discover.scores.parameters import lost
from tubular_dea.discover.search import declared
from tubular_dea.discover.search.declared import begun_as_declared, with_declared_starts
from tubular_dea.discover.search.revision import Search
from tubular_dea.discover.search.rounds import Round
from tubular_dea.identify.fitting.problem import Free
from tubular_dea.identify.study.adjust import adjusted
from tubular_dea.identify.study.study import PRIOR, Study, study
from tubular_dea.model.effect import with_effects
from tubular_dea.plants import Balance, Build, Coefficient, Input, Output, Plant
from tubular_dea.plants.load import load_plant

AWAY = {"E": 210.0, "g": 61.0, "r": 3.7, "R": 1.0, "C": 2.1e-4}  # a measured converter's base ended there
TRUE = {"E": 33.0, "g": 8.3, "r": 2.7, "R": 100.0, "C": 3.3e-5}
COIL, STEP, SAMPLES, FINE, NOISE = 1e-3, 2e-5, 250, 50, 0.05


def buck() -> Plant:
    """A converter's mean voltage, a coil, a capacitor and a load; the diode is missing."""
    m = Build("Buck", "A buck converter")
    control = m.input("control", "V", nominal=2.5)
    source, gain = m.parameter("E", "V", 32.0, minimum=0), m.parameter("g", "1", 8.0, minimum=0)
    r, load = m.parameter("r", "ohm", 1.0, minimum=0), m.parameter("R", "ohm", 50.0, minimum=0.1)
    coil, capacitor = m.parameter("L", "H", COIL, tunable=False), m.parameter("C", "F", 1e-4, minimum=1e-7)
    i, v = m.state("i", "A", start="free", nominal=2.0), m.state("v", "V", start="free", nominal=15.0)
    loss = m.define("loss", "V", r * i, nominal=2.0)
    m.derivative(i, (source - gain * control - loss - v) / coil)
    m.derivative(v, (i - v / load) / capacitor)
    m.output("voltage", "V", v)
    return Plant(m.model(), [Input("control")], [Output("voltage")], [Balance("i"), Coefficient("loss", of="i")])


def recorded(folder: Path, name: str, seed: int) -> None:
    """A record of the converter with an ideal diode, by small explicit steps; it starts at rest at its first input."""
    rng, p = np.random.default_rng(seed), TRUE
    switched, levels = np.sort(rng.integers(0, SAMPLES, 10)), rng.uniform(1.6, 3.4, 11)
    control = levels[np.searchsorted(switched, np.arange(SAMPLES), side="right")]
    i = (p["E"] - p["g"] * control[0]) / (p["r"] + p["R"])
    v, read, h = i * p["R"], [i * p["R"]], STEP / FINE
    for k in range(SAMPLES - 1):
        for part in (np.arange(FINE) + 0.5) / FINE:
            driven = p["E"] - p["g"] * (control[k] + part * (control[k + 1] - control[k]))
            i = max(i + h * (driven - p["r"] * i - v) / COIL, 0.0)
            v += h * (i - v / p["R"]) / p["C"]
        read.append(v)
    columns = [np.arange(SAMPLES) * STEP, control, np.array(read) + NOISE * rng.standard_normal(SAMPLES)]
    np.savetxt(
        folder / f"{name}.csv",
        np.column_stack(columns),
        delimiter=",",
        header="time [s],control [V],voltage [V]",
        comments="",
    )


def settled_at(work: Study, values: dict[str, float]) -> tuple[Study, Option]:
    """The base with the records' starts as some parameters make them likely, fitted from there."""
    made = adjusted(work, (), values)
    base = fitted_option(made, (), values, ())
    assert base is not None
    return made, base


def test_a_search_from_a_base_that_ran_away_begins_at_the_declared_values_too(tmp_path: Path) -> None:
    """Where the base lets the coil's current be thirty times what it is, no candidate's fit comes back."""
    for seed, name in enumerate("abc"):
        recorded(tmp_path, name, seed + 1)
    work = study(td.read_recordings(tmp_path, buck()), ["c"], PRIOR)
    away, base = settled_at(work, AWAY)
    assert lost(work.plant, base.fitted)
    start = dict(base.fitted.values) | {"i_one_way_part": 0.5, "i_one_way_level": 0.0}
    there = fitted_option(away, ("one_way(i)",), start, ())
    assert there is not None and not clean(there.lack_of_fit)
    found = Search(base, base, away, away)
    step = with_declared_starts(found, Round((), [], NullScores(np.zeros(1)), 30.0, [there], False, ""), print)
    best = step.options[0]
    assert step.accepted and "begun at the declared values" in step.reason
    assert best.ids == ("one_way(i)",) and clean(best.lack_of_fit)
    assert {n: best.fitted.values[n] for n in TRUE} == pytest.approx(TRUE, rel=0.05)
    assert found.study is not away  # the search goes on with its starts


STIFF = {
    "C_2": -1.37e6,
    "C_3": 9.76e6,
    "eps_r": 3.0,
    "eta_o": 2.26e6,
    "k_1": 69e6,
    "eta_1": 3e6,
    "k_2": 6e6,
    "eta_2": 2e5,
}


def test_of_several_strengths_those_that_cost_least_are_begun(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of a fluid of 28 g a score told 10, from where no fit came to it; 30 g is one of the strengths of a mass."""
    tube = load_plant("tube")
    work, score = SimpleNamespace(catalogue=tube.catalogue), SimpleNamespace(id="added_mass")
    starts = [{"added_mass": 0.01}, *declared._of_other_strengths(work, score, {"added_mass": 0.01})]
    assert len(starts) == 8

    def misses(scaled: np.ndarray) -> np.ndarray:
        return scaled - 0.028

    problem = SimpleNamespace(
        free=[Free("added_mass", 0.035)], scaled=lambda values: np.array([*values.values()]), residuals=misses
    )
    monkeypatch.setattr(refit, "problem_with", lambda study, ids: problem)
    best = refit.cheapest_starts(work, ("added_mass",), starts, 2)
    assert [start["added_mass"] for start in best] == [0.03, 0.02]
    assert refit.cheapest_starts(work, ("added_mass",), starts[:2], 2) == starts[:2]


@pytest.mark.parametrize(
    ("scored", "others", "best"), [(90.0, 80.0, 90.0), (110.0, 80.0, 80.0), (110.0, 120.0, 110.0), (110.0, None, 110.0)]
)
def test_other_strengths_are_begun_where_a_score_leads_nowhere(
    monkeypatch: pytest.MonkeyPatch, scored: float, others: float | None, best: float
) -> None:
    """Beside 100 of the base. What an effect without other strengths came to is kept."""
    costs = {"score": scored, "other": others}
    fits = {name: SimpleNamespace(cost=cost) for name, cost in costs.items() if cost is not None}
    monkeypatch.setattr(declared, "cheapest_starts", lambda study, ids, starts, most: starts)
    monkeypatch.setattr(
        declared, "best_of_starts", lambda study, ids, starts, refined: fits.get(starts[0]) if starts else None
    )
    begun = declared._begun(None, ("mass",), "score", ["other"] if others else [], 100.0)
    assert begun is not None and begun.cost == best


def test_a_mass_is_found_where_the_base_ran_away(tmp_path: Path) -> None:
    """The fluid in a tube, 28 g, with which it rings at 145 Hz."""
    tube, random = load_plant("tube"), np.random.default_rng(5)
    model = with_effects(tube.model, ["added_mass"], tube.catalogue)
    for name, volts in (("a", "5 kV"), ("b", "6.5 kV")):
        run = td.simulate(
            model,
            pressure="60 mmHg",
            voltage=f"pulses 0 {volts} every 0.5 from 0.2134 for 0.23",
            stop=1.5,
            interval="0.2 ms",
            parameters={"added_mass": 0.028, "C_1": 344e3, "eps_r": 2.74, "eta_o": 717e3, "start_at_equilibrium": 1.0},
        )
        read = 1e6 * run["radial_displacement"] + 5 * random.standard_normal(run.time.size)
        table = np.column_stack([run.time, run["pressure"] / 133.322, run["voltage"] / 1e3, read])
        head = "time [s],pressure [mmHg],voltage [kV],radial_displacement [um]"
        np.savetxt(tmp_path / f"{name}.csv", table, "%.6g", ",", header=head, comments="")
    work = study(td.read_recordings(tmp_path), [], PRIOR)
    made = adjusted(work, (), tube.model.parameter_values() | STIFF)
    base = fitted_option(made, (), tube.model.parameter_values() | STIFF, ())
    assert base is not None
    tried = {one.ids[0]: one for _, one in begun_as_declared(made, base)}
    assert tried["added_mass"].fitted.values["added_mass"] == pytest.approx(0.028, rel=0.1)
    assert tried["added_mass"].lack_of_fit.ratio < 1.2


@pytest.mark.parametrize("start", [0.0, 3e-4])
def test_a_declared_start_at_which_no_file_begins_is_asked_about(start: float) -> None:
    """A stroke declared to start at 0.3 mm began at 0 in every file: "the model lacks a gain of the laser"."""
    m = Build("Piston", "A piston on oil")
    x, k = m.state("x", "m", "Stroke", start=start, nominal=4e-4, display_unit="um"), m.parameter("k", "1/s", 2.0)
    m.derivative(x, k * (m.input("drive", "m", nominal=4e-4) - x))
    m.output("stroke", "m", x, display_unit="um")
    plant = Plant(m.model(), [Input("drive", held=True)], [Output("stroke", zero=5e-6)])
    time, rng = np.arange(600) * 0.01, np.random.default_rng(4)
    pushed = np.where(time > 1.0, 4e-4, 0.0)
    stroke = np.where(time > 1.0, 4e-4 * (1 - np.exp(-2.0 * (time - 1.0))), 0.0)
    tables = {
        name: {"time [s]": time, "drive [m]": pushed, "stroke [um]": 1e6 * stroke + rng.standard_normal(time.size)}
        for name in ("one", "two")
    }
    asked = [said for said in td.read_recordings(tables, plant).findings() if "declared start" in said]
    assert len(asked) == (start > 0)
    assert all(said.startswith("stroke begins with") and "300 um there: is that start right?" in said for said in asked)
