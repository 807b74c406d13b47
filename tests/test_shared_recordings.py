"""The recordings beside the project, read as they should be: against pandas, which is told how each set is written."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from shared_data import shared, shared_files
from tubular_dea.identify.records.data import read_folder
from tubular_dea.plants.tube import PLANT
from tubular_dea.recordings import read

PLAIN = {"sep": ",", "names": ["time", "pressure", "voltage", "radius"], "skiprows": 1}
SI = {"time": 1.0, "pressure": 1.0, "voltage": 1.0, "radius": 1.0}
# How the ten sets of the laboratory are written, seen in an editor: pandas' words, units in SI, samples in a second.
LAB: dict[str, tuple[dict[str, Any], dict[str, float], float]] = {
    **{
        f"lab-{i}": (PLAIN, SI, rate)
        for i, rate in ((1, 250), (2, 500), (3, 250), (4, 250), (5, 250), (6, 250), (8, 500), (9, 500))
    },
    "lab-7": (
        PLAIN | {"sep": ";", "decimal": ",", "encoding": "utf-8-sig"},
        {"time": 1.0, "pressure": 100.0, "voltage": 1e3, "radius": 1e-3},
        250,
    ),
    "lab-10": (
        PLAIN | {"sep": "\t", "skiprows": 3, "names": ["time", "voltage", "radius", "pressure", "comment"]},
        {"time": 1.0, "pressure": 133.322, "voltage": 1.0, "radius": 1e-6},
        250,
    ),
}


@pytest.mark.parametrize("name", LAB)
def test_the_laboratorys_sets(name: str) -> None:
    pandas = pytest.importorskip("pandas")
    words, si, rate = LAB[name]
    recordings = read_folder(shared(f"lab/{name}"), PLANT)
    assert len(recordings.experiments) == 8 and not recordings.left_out
    for experiment in recordings.experiments:
        assert experiment.source and not experiment.source.remarks and not experiment.source.missing
        assert experiment.source.unused == (("comment",) if name == "lab-10" else ())
        own = pandas.read_csv(experiment.source.path, **words)
        np.testing.assert_allclose(experiment.time, own["time"], rtol=1e-12)
        assert 1 / np.median(np.diff(experiment.time)) == pytest.approx(rate)
        for signal in ("pressure", "voltage"):
            np.testing.assert_allclose(experiment.inputs[signal], own[signal] * si[signal], rtol=1e-12, atol=1e-9)
        displacement = experiment.outputs[PLANT.outputs[0].name]
        np.testing.assert_allclose(displacement, own["radius"] * si["radius"] - 0.015, rtol=0, atol=1e-12)


def test_the_benchs_sets() -> None:
    pandas = pytest.importorskip("pandas")
    files = shared_files("bench", "*/*.csv")
    for path in {path.parent: path for path in files}.values():
        own = pandas.read_csv(path)
        for column, heading in zip(read(path).columns, own.columns, strict=True):
            assert column.heading == heading
            np.testing.assert_array_equal(column.values, own[heading])


def test_the_aortas_files() -> None:
    pandas = pytest.importorskip("pandas")
    for path in shared_files("aorta", "*vivo_data/*.csv"):
        own, table = pandas.read_csv(path, comment="#"), read(path)
        clock = pandas.to_timedelta(own["timestamp"]).dt.total_seconds()
        np.testing.assert_allclose(table.columns[0].values, clock, rtol=0, atol=1e-9)
        np.testing.assert_allclose(table.columns[1].values, own.iloc[:, 1], rtol=1e-15)
        assert table.columns[0].clock and table.notes["unit"] == ("mmHg" if "AoP" in path.name else "L/min")
    for path in shared_files("aorta", "stergiopulos1999_data/*.csv"):
        own, table = pandas.read_csv(path, header=None), read(path)
        assert table.heading_line == 0
        np.testing.assert_allclose(np.array([c.values for c in table.columns]).T, own, rtol=1e-15)


@pytest.mark.parametrize(
    ("name", "units"),
    [("mock_loop", ["s", "mL/s", "mmHg", "mmHg"]), ("cascaded_tanks", ["s", "V", "V"]), ("silverbox", ["s", "V", "V"])],
)
def test_the_measured_files(name: str, units: list[str]) -> None:
    pandas = pytest.importorskip("pandas")
    for path in shared_files(f"measured/{name}", "*.csv")[:3]:
        own, table = pandas.read_csv(path), read(path)
        assert [c.heading for c in table.columns] == list(own.columns) and [c.unit for c in table.columns] == units
        np.testing.assert_allclose(np.array([c.values for c in table.columns]).T, own, rtol=1e-15)


def test_missing_data_skip_a_test_but_fail_it_in_ci(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("CI", raising=False)
    with pytest.raises(pytest.skip.Exception, match="shared/data/nowhere is not beside the repository"):
        shared("nowhere")
    monkeypatch.setenv("CI", "true")
    with pytest.raises(pytest.fail.Exception, match="expected shared/data/nowhere"):
        shared("nowhere")
