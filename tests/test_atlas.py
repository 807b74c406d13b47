"""The atlas: what effects leave is what a refit leaves, look-alikes stand together, and the page opens anywhere."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from tubular_dea.cli import main
from tubular_dea.discover.experiments import atlas as room
from tubular_dea.discover.experiments.atlas import Atlas, Signature
from tubular_dea.identify.fitting.response import Response
from tubular_dea.kernel import Kernel
from tubular_dea.model.effect import equations, with_effects
from tubular_dea.plants.load import load_plant
from tubular_dea.plants.tube_experiments import standard

EXAMPLES = Path(__file__).parents[1] / "cosim_examples" / "plants"
LARGEST = 3_000_000  # bytes of a page


@pytest.fixture(scope="module")
def tanks() -> Atlas:
    return room.atlas(load_plant(str(EXAMPLES / "cascaded_tanks.py")))


def of(atlas: Atlas, name: str) -> Signature:
    return next(e for e in atlas.effects if e.effect.id == name)


def test_what_own_parameters_do_as_well_leaves_nothing(tanks: Atlas) -> None:
    """A gain of the pump is k3; a start and a zero of the first tank are not seen apart from the starts."""
    assert not of(tanks, "gain(pump)").visible
    assert of(tanks, "gain(pump)").changed > 1e-3
    assert of(tanks, "power(outflow_1)").visible
    assert of(tanks, "saturation(pump)").changed == 0


def test_what_is_left_is_orthogonal_to_own_parameters(tanks: Atlas) -> None:
    """Moving k1 by 1 % and refitting it cannot make the residual smaller: the two are at right angles."""
    kernel, values = Kernel(tanks.plant.model), tanks.plant.model.parameter_values()
    moved, still = (
        np.concatenate(Response(kernel, tanks.cases).outputs(values | {"k1": values["k1"] * factor}, finer=1e3))
        for factor in (1.0001, 1.0)
    )
    column = (moved - still) / np.linalg.norm(moved - still)
    one = of(tanks, "power(outflow_1)")
    effect = with_effects(tanks.plant.model, [one.effect.id], tanks.plant.catalogue).with_values(one.effect.typical)
    whole = np.concatenate(Response(Kernel(effect), tanks.cases).outputs(values, finer=1e3)) - still
    assert abs(column @ whole) / np.linalg.norm(whole) > 0.05
    assert abs(column @ one.residual) / np.linalg.norm(one.residual) < 1e-3


def test_look_alikes_of_a_place_are_neighbours(tanks: Atlas) -> None:
    """Within a place the sum of likenesses of neighbours is more than in the order of the catalogue."""
    for channel in ("outflow_1", "level_2"):
        found = [i for i, e in enumerate(tanks.effects) if e.effect.channel == channel and e.visible]
        listed = [e.effect.id for e in tanks.effects]
        declared = sorted(found, key=lambda i: list(tanks.plant.catalogue).index(listed[i]))
        close, far = (
            sum(abs(tanks.cosines[a, b]) for a, b in zip(order, order[1:], strict=False)) for order in (found, declared)
        )
        assert close > far
        places = {tanks.effects[i].effect.channel for i in range(min(found), max(found) + 1)}
        assert places == {channel}


def test_the_page_of_the_tube(tmp_path: Path) -> None:
    assert main(["atlas", "--out", str(tmp_path / "atlas.html")]) == 0
    text = (tmp_path / "atlas.html").read_text(encoding="utf-8")
    assert len(text) < LARGEST
    assert not re.search(r"(src|href)=\"(?!#)", text), "nothing is fetched"
    for name in load_plant("tube").catalogue:
        assert f'id="{name}"' in text
    assert text.count("<h3 id=") == len(load_plant("tube").catalogue)
    assert text.count("Equation") >= len(load_plant("tube").catalogue)


def test_the_tubes_experiments_are_those_of_the_bench() -> None:
    """Steps jump, ramps do not, and pressure and voltage end where the recorded ones do."""
    made = standard()
    jumps = {name: int(np.sum(np.diff(p.time) == 0)) for name, p in made.items()}
    assert jumps["step to 4 kV"] == jumps["step to 6 kV"] == 2
    assert jumps["ramp to 7 kV"] == jumps["pressure triangles"] == 0
    assert jumps["voltage steps"] == 23 and jumps["heartbeats at 5 kV"] == 24
    assert made["step to 6 kV"].at(np.array([1.999, 2.0, 11.999, 12.0]))["voltage"].tolist() == [0, 6e3, 6e3, 0]
    for protocol in made.values():
        assert np.all(np.diff(protocol.time) >= 0)


def test_an_effect_without_documentation_shows_what_it_changes() -> None:
    plant = load_plant("aorta")
    lag = plant.catalogue["sensor_lag"]
    bare = type(lag)(**{**vars(lag), "documentation": ""})
    assert "d(slow)/dt" in equations(plant.model, lag)
    text = equations(plant.model, bare)
    assert re.search(r"d\(\w+\)/dt = .*tau_sensor", text)
    assert "sensor_share" in text


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--out", "atlas"], "--out atlas: expected the name of a page that ends in .html, as in atlas.html"),
        (["--out", "a.html", "--plant", "nothing"], "--plant nothing: expected FILE.py[:NAME] or a plant"),
    ],
)
def test_bad_input_is_said_in_one_line(
    words: list[str], message: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["atlas", *words]) == 2
    said = capsys.readouterr().err
    assert message in said and len(said.strip().splitlines()) == 1
    assert not list(tmp_path.iterdir())
