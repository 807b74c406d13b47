"""What the API is handed: each thing it cannot use is refused in one line that names the argument."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

import tubular_dea as td

REFUSED: dict[str, tuple[Callable[[Path], object], str]] = {
    "one effect": (
        lambda out: td.add_effects("tube", "electrode_resistance"),
        "effects: expected a list, as ['electrode_resistance'], but was given 'electrode_resistance' alone",
    ),
    "a model for a plant": (
        lambda out: td.add_effects(td.tube(), ["creep"]),
        "plant: expected a Plant, 'tube', 'aorta' or a FILE.py[:NAME] but was given a Model",
    ),
    "load": (lambda out: td.load(5), "path: expected a path but was given 5"),
    "save": (lambda out: td.save(5, out / "model.json"), "model: expected a Model but was given 5"),
    "save where": (lambda out: td.save(td.tube(), 5), "path: expected a path but was given 5"),
    "no recordings": (lambda out: td.read_recordings(None), "data: expected a path but was given None"),
    "discover": (lambda out: td.discover(5), "data: expected a path but was given 5"),
    "identify": (lambda out: td.identify([1, 2]), "data: expected a path but was given a list"),
    "sweep": (lambda out: td.sweep(5), "plan: expected a path but was given 5"),
    "workers": (lambda out: td.sweep({}, workers="two"), "workers: expected a whole number but was given 'two'"),
    "build": (lambda out: td.build_fmu(5, out / "x.fmu"), "model: expected a Model, a Plant or a file but was given 5"),
    "build where": (lambda out: td.build_fmu(td.tube(), 5), "path: expected a path but was given 5"),
    "platforms": (
        lambda out: td.build_fmu(td.tube(), out / "x.fmu", platforms=3),
        "platforms: expected a name or a list of names but was given 3",
    ),
    "plant": (lambda out: td.load_plant(None), "plant: expected a Plant, 'tube', 'aorta' or a FILE.py"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_refused(tmp_path: Path, case: str) -> None:
    call, said = REFUSED[case]
    with pytest.raises(td.UserError) as refusal:
        call(tmp_path)
    assert str(refusal.value).startswith(said)
    assert not any(tmp_path.iterdir())
