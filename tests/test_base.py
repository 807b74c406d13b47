"""From where the base model is searched, and which place it ends in: on made-up fits."""

from __future__ import annotations

from dataclasses import dataclass, field
from types import SimpleNamespace

import pytest

from tubular_dea.discover.options import base
from tubular_dea.identify.fitting.fit import FitError

DECLARED = {"stiffness": 1.0, "branch": 2.0}


@dataclass
class Search:
    """Answers `fit` by where it begins and what it may cost; None for a start at which the model has no answer."""

    first: float | None = 100.0  # where it starts from the declared values
    again: float | None = 100.0  # from the declared branches beside the best values, and from
    moved: float | None = 100.0  # around these
    asked: list[dict] = field(default_factory=list)

    def fit(self, problem: object, start: dict, starts: int = 1, spread: float = 0.0, seed: int = 0, **more: float):
        kind = "moved" if more.get("move") else "again" if "evaluations" in more else "first"
        self.asked.append({"kind": kind, "problem": problem, "start": start, "starts": starts, "spread": spread} | more)
        cost = getattr(self, kind)
        if cost is None and starts == 1:
            raise FitError("a burst tube")
        return SimpleNamespace(values={"stiffness": 5.0, "branch": 7.0, "by": kind}, cost=cost or 0.0)


def searched(
    monkeypatch: pytest.MonkeyPatch, search: Search, beginning: str | None = None, **plant: object
) -> SimpleNamespace:
    """The base that such a search ends in; where records are long, their `beginning` is a problem of its own."""
    monkeypatch.setattr(base, "fit", search.fit)
    monkeypatch.setattr(base, "base_parameters", lambda plant: [])
    monkeypatch.setattr(base, "_most_steps", lambda problem, best: 10.0 * best.values["stiffness"])
    model = SimpleNamespace(parameter_values=lambda: dict(DECLARED))
    known = SimpleNamespace(
        **{"model": model, "restarts": {"branch": DECLARED["branch"]}, "safer": (), "stages": ()} | plant
    )
    study = SimpleNamespace(plant=known, problem=lambda *a: "all")
    study.beginning = study if beginning is None else SimpleNamespace(plant=known, problem=lambda *a: beginning)
    return base.recalibrate(study)


def test_further_places_confirm_the_first(monkeypatch: pytest.MonkeyPatch) -> None:
    search = Search(again=98.1, moved=101.0)  # no better than converged searches differ
    assert searched(monkeypatch, search).values["by"] == "first"
    assert sorted(a["kind"] for a in search.asked) == ["again", "first", "moved"]
    again, moved = (next(a for a in search.asked if a["kind"] == kind) for kind in ("again", "moved"))
    assert again["start"]["stiffness"] == moved["start"]["stiffness"] == 5.0  # where the first ended
    assert again["start"]["branch"] == DECLARED["branch"]
    assert moved["start"]["branch"] == 7.0
    assert again["most_steps"] == moved["most_steps"] == 50.0  # where the first ended, and no limit before
    assert not any("most_steps" in a for a in search.asked if a["kind"] == "first")


def test_a_better_place_is_gone_on_from(monkeypatch: pytest.MonkeyPatch) -> None:
    search = Search(again=97.9)
    searched(monkeypatch, search)
    assert [a["kind"] for a in search.asked].count("first") == 2
    assert search.asked[-1]["start"]["by"] == "again"


def test_places_without_an_answer_confirm_nothing_and_spoil_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    search = Search(again=None, moved=None)
    assert searched(monkeypatch, search).cost == 100.0
    assert len(search.asked) == 3


def test_where_the_declared_values_have_no_answer_safer_ones_are_tried(monkeypatch: pytest.MonkeyPatch) -> None:
    search = Search(first=None, again=None, moved=None)
    assert searched(monkeypatch, search, safer=(lambda v: v | {"stiffness": 3.0},)).cost == 0.0
    declared, safer, anywhere, *_ = search.asked
    assert declared["start"] == anywhere["start"] == DECLARED and declared["starts"] == 1
    assert safer["start"]["stiffness"] == 3.0
    assert anywhere["starts"] > 1 and anywhere["spread"] > base.MOVE  # wider than the confirmations are


def test_long_records_are_fitted_from_where_their_beginnings_lead_to(monkeypatch: pytest.MonkeyPatch) -> None:
    search = Search()
    searched(monkeypatch, search, beginning="the first minute")
    *brief, last = search.asked
    assert [a["problem"] for a in brief] == ["the first minute"] * 3  # with what confirms it
    assert brief[0]["start"] == DECLARED
    assert last["problem"] == "all" and last["start"]["by"] == "first"
