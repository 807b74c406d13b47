"""Files dropped on the page are understood, or refused, exactly as the command line does: same numbers, same words."""

from __future__ import annotations

import base64
from pathlib import Path

import numpy as np
import pytest
from lab_page import BENCH, Page

from laboratory import drawn
from tubular_dea.errors import ColumnError, UserError
from tubular_dea.identify.records.data import read_experiment
from tubular_dea.identify.records.start import detected
from tubular_dea.plants.tube import PLANT

SEEDS = 80
GOOD = (BENCH / "03_step_6kV.csv").read_text()


def lines(edit: object) -> str:
    """The good recording with its lines changed by a function."""
    return "\n".join(edit(GOOD.splitlines()))


def cell(number: int, place: int, text: str) -> str:
    def edit(rows: list[str]) -> list[str]:
        cells = rows[number - 1].split(",")
        rows[number - 1] = ",".join([*cells[:place], text, *cells[place + 1 :]])
        return rows

    return lines(edit)


def column(place: int, change: object) -> str:
    """The good recording with all numbers of a column changed."""

    def edit(rows: list[str]) -> list[str]:
        out = rows[:1]
        for i, row in enumerate(rows[1:]):
            cells = row.split(",")
            cells[place] = f"{change(i, float(cells[place])):.9g}"
            out.append(",".join(cells))
        return out

    return lines(edit)


def _pulses(number: int) -> float:
    """A voltage of short pulses at 8 bit, which reads zero for long between them."""
    place = number % 68
    return [1640.6, 6234.4, 6187.5, 656.3, -234.4][place] if place < 5 else 46.9 * (place in (12, 18, 24))


def _german(row: str) -> str:
    """A row with decimal commas and three decimals of a radius in mm."""
    *cells, last = row.split(",")
    number = "radius [mm]" if last.startswith("radius") else f"{1e3 * float(last):.3f}"
    return ";".join([*cells, number]).replace(".", ",")


def _grouped_by_none(row: str) -> str:
    """A row of three decimals behind commas, and of a radius in whole micrometres."""
    *cells, last = row.split(",")
    if last.startswith("radius"):
        return ";".join([*cells, "radius [um]"])
    numbers = [f"{float(cell) + 2.0 * (k == 0):.3f}".replace(".", ",") for k, cell in enumerate(cells)]
    return ";".join([*numbers, f"{1e6 * float(last):.0f}"])


REFUSED = {
    "empty": "",
    "blank": "\n\n\n",
    "prose": "dear diary,\ntoday the tube burst\n",
    "one row": lines(lambda rows: rows[:2]),
    "headings alone": "time [s],pressure [Pa]\n",
    "no pressure": GOOD.replace("pressure [Pa]", "druck"),
    "two that may be": GOOD.replace("pressure [Pa]", "druck [Pa]").replace("radius [m]", "soll [Pa]"),
    "two pressures": GOOD.replace("pressure [Pa]", "Druck Soll [mbar]").replace("radius [m]", "Druck Ist [mbar]"),
    "nothing with its name": GOOD.replace("pressure [Pa]", "P").replace("voltage [V]", "U").replace("radius", "d"),
    "a size of nothing": column(3, lambda i, v: 2 * v).replace("radius [m]", "Laser [m]"),
    "no unit": GOOD.replace("pressure [Pa]", "pressure"),
    "wrong unit": GOOD.replace("[Pa]", "[V]"),
    "a rate": GOOD.replace("[Pa]", "[/min]"),
    "unknown unit": GOOD.replace("[Pa]", "[mmgH]"),
    "odd unit": GOOD.replace("[Pa]", "[parsec]"),
    "twice": GOOD.replace("voltage [V]", "pressure [Pa]"),
    "no output": column(3, lambda i, v: 2 * v).replace("radius", "depth"),
    "both outputs": GOOD.replace("voltage [V]", "displacement [m]"),
    "text in a cell": cell(100, 1, "oops"),
    "infinite": cell(100, 1, "inf"),
    "long cell": cell(77, 3, "x" * 90),
    "quotes in a cell": cell(50, 2, "it's"),
    "no time": cell(60, 0, ""),
    "time goes back": cell(60, 0, "0.001"),
    "too many cells": cell(60, 3, "0.015,4,5"),
    "decimal commas": GOOD.replace(".", ","),
    "too short": lines(lambda rows: rows[:30]),
    "unclosed quote": cell(90, 1, '"12'),
    "s labelled ms": GOOD.replace("time [s]", "time [ms]"),
    "ms labelled s": column(0, lambda i, v: 1e3 * v),
    "mmHg labelled Pa": column(1, lambda i, v: v / 133.322),
    "an absolute pressure": column(1, lambda i, v: v + 101_325.0),
    "kV labelled V": column(2, lambda i, v: v / 1e3),
    "V labelled kV": GOOD.replace("voltage [V]", "voltage [kV]"),
    "mm labelled m": column(3, lambda i, v: 1e3 * v),
    "below rest": column(3, lambda i, v: v - 0.004),
    "the other way": column(3, lambda i, v: 30 - 1e3 * v).replace("radius [m]", "radius [mm]"),
    "a displacement the other way": column(3, lambda i, v: 15e3 - 1e6 * v).replace("radius [m]", "displacement [um]"),
    "Pa labelled kPa": GOOD.replace("[Pa]", "[kPa]"),
    "um labelled cm": column(3, lambda i, v: 1e6 * v).replace("radius [m]", "radius [cm]"),
    "constant": column(3, lambda i, v: 0.015),
    "only noise": column(3, lambda i, v: 0.015 + 1e-5 * np.sin(1e4 * i * i)),
    "two columns with its name": GOOD.replace("radius [m]", "laser radius [m]").replace(
        "voltage [V]", "set radius [m]"
    ),
    "frozen": column(3, lambda i, v: 0.0155 if 900 < i < 1000 else v),
    "saturated": column(3, lambda i, v: min(v, 0.0166)),
    "saturated with noise": column(3, lambda i, v: v if v < 0.0166 else 0.0166 + 1e-6 * np.sin(1e4 * i * i)),
    "mostly gaps": column(1, lambda i, v: v if i % 3 == 0 else np.nan),
    "output gone": column(3, lambda i, v: v if i < 40 else np.nan),
    "output never there": column(3, lambda i, v: np.nan),
    "input never there": column(1, lambda i, v: np.nan),
}
UNDERSTOOD = {
    "good": GOOD,
    "another heading": GOOD.replace("pressure [Pa]", "P_lumen (Pa)").replace("voltage [V]", "HV [V]"),
    "an output's name in its heading": GOOD.replace("radius [m]", "Laser radius 2 (m)"),
    "the longer name": GOOD.replace("radius [m]", "Baumer radial displacement (m)"),
    "a radius by its size": GOOD.replace("radius", "depth"),
    "a displacement by its size": column(3, lambda i, v: v - 0.015).replace("radius", "depth"),
    "a diameter": column(3, lambda i, v: 2 * v).replace("radius [m]", "Diameter of the tube [m]"),
    "short pulses on a coarse monitor": column(2, lambda i, v: _pulses(i)),
    "decimals like thousands": lines(lambda rows: [_german(row) for row in rows]),
    "decimals like thousands in all columns": lines(lambda rows: [_grouped_by_none(row) for row in rows]),
    "semicolons": GOOD.replace(",", ";"),
    "tabs": GOOD.replace(",", "\t"),
    "capitals": GOOD.replace("time [s]", "TIME (S)"),
    "a time t and a temperature T": lines(
        lambda rows: [f"{row},{'23.1' if i else 'T [degC]'}" for i, row in enumerate(rows)]
    ).replace("time [s]", "t [s]"),
    "units with brackets": GOOD.replace("[V]", "[A.(V/A)]").replace("[m]", "[V/(V/m)]"),
    "other units": GOOD.replace("voltage [V]", "Voltage / V").replace("[m]", "(m)"),
    "gaps": column(1, lambda i, v: np.nan if 200 < i < 300 else v),
    "doubled rows": lines(lambda rows: [*rows[:200], rows[199], *rows[200:220], rows[219], *rows[220:]]),
    "comments": "# bench 3\n# tube 14\n" + GOOD,
    "repeated headings": lines(lambda rows: [*rows[:300], rows[0], *rows[300:]]),
    "coarse clock": column(0, lambda i, v: np.floor(100 * v) / 100),
    "trailing text": GOOD + "end of file\n",
    "extra column": lines(lambda rows: [f"{row},{'remark' if i == 0 else 'fine'}" for i, row in enumerate(rows)]),
    "no second output": lines(lambda rows: [f"{row},{'nan' if i else 'current [A]'}" for i, row in enumerate(rows)]),
    "still second output": lines(lambda rows: [f"{row},{'0' if i else 'current [A]'}" for i, row in enumerate(rows)]),
    "cut last line": GOOD.rstrip("\n")[:-12],
    "latin-1": "# t = 23 °C, µ\n" + GOOD,
    "starts loaded": lines(lambda rows: [rows[0], *rows[200:]]),
}


def as_bytes(name: str, text: str) -> bytes:
    return text.encode("latin-1") if name == "latin-1" else text.encode()


def by_python(path: Path) -> dict:
    try:
        e = read_experiment(path, PLANT)
    except UserError as problem:
        words = problem.otherwise if isinstance(problem, ColumnError) else str(problem)  # a page has no options
        return {"refused": words.replace(str(path), path.name)}
    assert e.source is not None
    return {
        "time": e.time,
        "inputs": e.inputs,
        "outputs": e.outputs,
        "loaded": detected(e, PLANT) != "rested",
        "unused": list(e.source.unused),
        "remarks": list(e.source.remarks),
        "format": e.source.format,
    }


def by_page(page: Page, name: str, raw: bytes) -> dict:
    return page.run(
        """
        const raw = Uint8Array.from(atob(given[1]), (c) => c.charCodeAt(0));
        try {
          const e = lab.readExperiment(given[0], raw);
          const list = (v) => Array.from(v, (x) => Number.isNaN(x) ? null : x);
          const lists = (values) => Object.fromEntries(Object.entries(values).map(([n, v]) => [n, list(v)]));
          return { time: list(e.time), inputs: lists(e.inputs), outputs: lists(e.outputs),
                   loaded: e.start !== "rested", unused: e.unused, remarks: e.remarks, format: e.format };
        } catch (problem) {
          return { refused: problem.message };
        }
    """,
        name,
        base64.b64encode(raw).decode(),
    )


def compare(page: Page, folder: Path, raw: bytes) -> dict:
    path = folder / "a.csv"
    path.write_bytes(raw)
    wanted, got = by_python(path), by_page(page, path.name, raw)
    assert got.get("refused") == wanted.get("refused")
    if "refused" in wanted:
        return wanted
    np.testing.assert_allclose(got["time"], wanted["time"], rtol=1e-12, atol=1e-9)
    for kind in ("inputs", "outputs"):
        assert got[kind].keys() == wanted[kind].keys()
        for name, values in wanted[kind].items():
            np.testing.assert_allclose(np.array(got[kind][name], float), values, rtol=1e-12, atol=1e-15)
    for said in ("loaded", "unused", "remarks", "format"):
        assert got[said] == wanted[said], said
    return wanted


@pytest.mark.parametrize("name", REFUSED)
def test_refusals_have_the_same_words(browser: Page, tmp_path: Path, name: str) -> None:
    assert "refused" in compare(browser.ready(), tmp_path, as_bytes(name, REFUSED[name]))


@pytest.mark.parametrize("name", UNDERSTOOD)
def test_recordings_have_the_same_numbers(browser: Page, tmp_path: Path, name: str) -> None:
    assert "refused" not in compare(browser.ready(), tmp_path, as_bytes(name, UNDERSTOOD[name]))


@pytest.mark.long
def test_files_of_any_laboratory_are_read_alike(browser: Page, tmp_path: Path) -> None:
    browser.ready()
    understood = [seed for seed in range(SEEDS) if "refused" not in compare(browser, tmp_path, drawn(seed).raw)]
    assert len(understood) > SEEDS / 3, understood
