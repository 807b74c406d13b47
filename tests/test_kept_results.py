"""What a search found outlasts what is in the way of showing it, and is shown with what was asked before it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import tubular_dea as td
from tubular_dea.errors import UserError
from tubular_dea.plants import Build, Input, Output, Plant
from tubular_dea.plants import Path as Way
from tubular_dea.report import close_loop, in_short


def test_what_was_found_is_kept_where_a_report_cannot_be_made(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A disk that was full lost a search of minutes."""
    time, random = np.arange(0.0, 3.0, 0.01), np.random.default_rng(1)
    m = Build("Spring")
    push = m.input("push", "N", nominal=10.0)
    m.output("way", "m", m.define("way_", "m", push / m.parameter("k", "N/m", 50.0, minimum=1.0)))
    plant = Plant(m.model(), [Input("push")], [Output("way")], places=[Way("way")])
    pushes = [10 * np.sin((n + 1) * time) for n in range(3)]
    tables = {
        f"run{n}": {"time [s]": time, "push [N]": p, "way [m]": p / 51 + 1e-3 * random.standard_normal(time.size)}
        for n, p in enumerate(pushes)
    }
    found = td.discover(td.read_recordings(tables, plant))

    def full(*_: object) -> None:
        raise UserError("report.html cannot be written: no space left on device")

    monkeypatch.setattr(close_loop, "report", full)
    with pytest.raises(UserError, match="no space left on device; what was found is kept in .*result.json and"):
        found.report(tmp_path / "out")
    assert sorted(p.name for p in (tmp_path / "out").iterdir()) == ["model.json", "result.json"]
    assert td.load(tmp_path / "out" / "model.json", plant).parameter_values()["k"] == pytest.approx(51, rel=0.01)


def test_what_was_asked_before_the_search_opens_the_page() -> None:
    asked = ["Asked before the search: [noise] radius is 15 mm: is its unit right?", "Told before the search: a copy."]
    (said,) = in_short.asked_first(asked)
    assert said.startswith("all this may be wrong: first see to what was asked before the search: [noise] radius is 15")
    assert said.endswith("is its unit right?")
    assert in_short.asked_first(asked[1:]) == []
