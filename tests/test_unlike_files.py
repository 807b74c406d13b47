"""Files that differ by more than monitors do are told, and no answer says that nothing is missing."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from types import SimpleNamespace

import pytest

import made_up
import tubular_dea as td
from blind.laboratory import laboratory, write
from test_adjust import FREE, PLANT, TRUTH, ramps, recorded, study_of
from tubular_dea.discover import engine, judgement
from tubular_dea.discover.alternatives import unlike_files as alternative
from tubular_dea.discover.alternatives.unlike_files import Unlike, unlike_files
from tubular_dea.discover.answer import between_files
from tubular_dea.identify.study import nuisances
from tubular_dea.identify.study.adjust import adjusted
from tubular_dea.plants.plant import Input, Output

BASE = SimpleNamespace(ids=(), fitted=SimpleNamespace(values=TRUTH))


def unlike(change: float) -> Unlike | None:
    """What is told of six files, every second one of which has a load that is larger by a share."""
    plant = replace(PLANT, inputs=[Input("load", zero=0.1)], outputs=[Output("reading")])
    listed = [recorded(i, ramps(i), gain=1 + change * (i % 2 - 0.5)) for i in range(6)]
    return unlike_files(adjusted(study_of(listed, plant), (), TRUTH, FREE), BASE)


def test_files_that_differ_as_no_monitor_does_are_told() -> None:
    found = unlike(0.03)
    assert found is not None and found.input == "load" and found.output == "reading"
    changes = [own["load"] for own in found.changes.values()]
    assert changes == pytest.approx([0.015 * (-1) ** i for i in range(6)], abs=3e-3)
    study = SimpleNamespace(plant=PLANT)
    (said,) = between_files.unlike(SimpleNamespace(unlike=found, study=study, named=made_up.option()))
    assert said.startswith("The files are explained together only as if")
    far = made_up.option("lag", excess=1e5)
    assert (
        "make up for what the model lacks"
        in between_files.unlike(SimpleNamespace(unlike=found, study=study, named=far))[0]
    )
    assert "load +1.5% in file-0, -1.5% in file-1" in said and "another" in said


def test_a_gain_has_to_be_well_known(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of noise as slow as a file, too little is seen."""
    plant = replace(PLANT, inputs=[Input("load", zero=0.1)], outputs=[Output("reading")])
    work = adjusted(
        study_of([recorded(i, ramps(i), gain=1 + 0.03 * (i % 2)) for i in range(6)], plant), (), TRUTH, FREE
    )
    found = unlike_files(work, BASE)
    assert found is not None
    piece = next(p for p in work.pieces if p.name == found.piece)
    known = (nuisances.share_unknown(work, piece) * piece.nuisances.sd)[piece.nuisances.names.index("gain of load")]
    times = abs(found.changes[found.piece]["load"]) / known
    assert times > 2 * alternative.KNOWN
    for share, told in ((0.99, True), (1.01, False)):
        monkeypatch.setattr(alternative, "KNOWN", share * times)
        again = unlike_files(work, BASE)
        assert (again is not None and again.piece == found.piece) is told


def test_gains_as_monitors_have_them_are_no_finding() -> None:
    assert unlike(0.006) is None
    assert between_files.unlike(SimpleNamespace(unlike=None)) == []


@pytest.mark.parametrize(
    ("ids", "word", "against"),
    [
        (("lag",), "effect_found", 1),
        (("lag",), "ambiguous", 1),
        (("lag",), "partly_explained", 0),  # a remainder is told
        ((), "no_effect", 0),  # "unexplained", with the files' gains
    ],
)
def test_effects_that_need_a_gain_that_no_monitor_has_do_not_explain_all(
    monkeypatch: pytest.MonkeyPatch, ids: tuple[str, ...], word: str, against: int
) -> None:
    """An echo in the pressure of beats was a stop and a viscosity, with a gain that was 1.1 % less in these alone."""
    monkeypatch.setattr(judgement, "_strained", lambda found, described: ())
    one = Unlike("load", "file-1", "reading", 43e-6)
    said = judgement._implausible(SimpleNamespace(), made_up.option(*ids), word, one)
    assert said == ("a gain of load that changes from file to file",) * against
    assert judgement._implausible(SimpleNamespace(), made_up.option(*ids), word, None) == ()


@pytest.mark.long
@pytest.mark.parametrize(
    ("seed", "drifts", "kept"),
    [(7700000, "stiffness_drift", None), (7900000, "sensor_drift", ["monitor_gains", "order", "laser_zero"])],
)
def test_a_drift_over_files_in_a_row_is_no_gain_of_each(
    seed: int, drifts: str, kept: list[str] | None, tmp_path: Path
) -> None:
    """A stiffness that falls by 2.8 % over eight files was gains of -1.5 % to +1.0 %, and nothing was named."""
    write(laboratory(seed, drifts, kept), tmp_path / "set")
    found = td.discover(td.read_recordings(tmp_path / "set"))
    assert (found.verdict, [e.id for e in found.effects]) == ("effect_found", [drifts])
    assert found.discovery.unlike is None


@pytest.mark.parametrize(
    ("before", "firm", "left", "kept"),
    [
        (("friction",), ("friction",), 0.0, "firm"),  # gains of 1 and 2 % had stood beside it
        (("friction",), ("friction", "lag"), 0.0, "found"),  # more effects than with gains that change
        (("friction",), ("friction",), 9e4, "found"),  # with firm gains more than noise is left
        ((), ("friction",), 0.0, "firm"),
        ((), (), 0.0, "found"),
    ],
)
def test_gains_that_change_give_way_to_effects_that_explain_everything(
    monkeypatch: pytest.MonkeyPatch, before: tuple[str, ...], firm: tuple[str, ...], left: float, kept: str
) -> None:
    @dataclass(frozen=True)
    class Work:
        firm: bool = False

    base = made_up.option(excess=1e5)
    searches = {
        "found": replace(made_up.found(base, made_up.option(*before), study=Work()), base_study=Work()),
        "firm": made_up.found(base, made_up.option(*firm, excess=left), study=Work(firm=True)),
    }
    asked = []
    monkeypatch.setattr(engine, "unlike_files", lambda study, chosen: True)
    monkeypatch.setattr(engine, "base_settled", lambda study, fitted, seed: (study, fitted))
    monkeypatch.setattr(engine, "_searched", lambda study, *given: asked.append(study) or searches["firm"])
    assert engine._with_firm_monitors(searches["found"], 0.0, 1, lambda what: None) is searches[kept]
    assert asked == [Work(firm=True)]
    monkeypatch.setattr(engine, "unlike_files", lambda study, chosen: None)
    assert engine._with_firm_monitors(searches["found"], 0.0, 1, lambda what: None) is searches["found"]
    assert len(asked) == 1
