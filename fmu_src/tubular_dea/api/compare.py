"""Several settings of the device compared with no assist."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..cosim.beats import INDICES
from ..cosim.course import Course, follow
from ..cosim.master import Run
from ..errors import ArgumentError
from ..files import write_atomically
from . import tables
from .assist import WITHOUT
from .given import Amount, AnyModel, items, settings_of
from .heart import AnyPatient, Loop, Rhythm, Settings, Stepping

if TYPE_CHECKING:
    import pandas
    from matplotlib.figure import Figure

VOLTAGE = "voltage"  # in the settings of a case: short for scheduler.voltage_on


@dataclass(frozen=True, repr=False)
class ComparisonResult:
    """Runs by name, the one without assist first; the assessments of the others (`courses`), and their settings."""

    loop: Loop
    runs: Mapping[str, Run]
    courses: Mapping[str, Course]
    settings: Mapping[str, Mapping[str, float]]

    def __repr__(self) -> str:
        return f"<ComparisonResult: {', '.join(self.courses)}>"

    def lines(self) -> list[str]:
        """The means of all figures as text."""
        from ..report.compare import table

        return aligned(*table(self.courses))

    def to_pandas(self) -> pandas.DataFrame:
        """One row a figure: its mean without assist and for each of the settings, SI unit. Needs the extra `tables`."""
        first, rows = next(iter(self.courses.values())), []
        for figure in INDICES:
            means = {name: course.assisted.get(figure.name) for name, course in self.courses.items()}
            shown = {"without": first.without.get(figure.name), **means}
            values = {name: spread.mean if spread else np.nan for name, spread in shown.items()}
            rows.append({"figure": figure.name, **values, "unit": figure.si})
        return tables.table(rows, "figure")

    def to_dict(self) -> dict[str, Any]:
        """All of it as plain values, as comparison.json has it."""
        return {name: c.summary() | {"settings": dict(self.settings[name])} for name, c in self.courses.items()}

    def plot(self, figure: Figure | None = None) -> Figure:
        """All runs over the last beats; drawn into `figure` if it is given."""
        from ..report.assist import draw_panels
        from ..report.compare import beats_of

        return draw_panels(beats_of(self.runs, self.courses), figure)

    def report(self, out: str | Path) -> list[Path]:
        """Write comparison.html, .png and .json to the folder `out`; returns their paths."""
        from ..report import compare as drawn

        out = Path(out)
        written = drawn.write(out, self.runs, self.courses, f"Patient {self.loop.patient_name}.")
        text = json.dumps(self.to_dict(), indent=1, allow_nan=False) + "\n"
        return [*written, write_atomically(out / "comparison.json", text.encode())]


def compare(
    cases: Mapping[str, Settings],
    patient: AnyPatient = "failing",
    voltage: Amount = "5.5 kV",
    *,
    beats: int = 15,
    tube: AnyModel = "tube",
    settings: Settings | None = None,
    ecg: str | Path | None = None,
    lead: str | None = None,
    r_times: str | Path | np.ndarray | None = None,
    scheme: str = "implicit",
    step: float = 1e-3,
    variable: bool = False,
    progress: bool = False,
) -> ComparisonResult:
    """The assisted heart with several settings of the device, compared with no assist.

    Parameters
    ----------
    cases : mapping of str to mapping
        Settings by the name of the case, as in ``{"weak": {"voltage": "4 kV"}, "early": {"scheduler.on_time":
        "-70 ms"}}``; they come on top of `settings`. ``"voltage"`` is short for ``"scheduler.voltage_on"``.
    patient, voltage, beats, tube, settings, ecg, lead, r_times, scheme, step, variable, progress
        As in `assist`.

    Returns
    -------
    ComparisonResult
        All runs, and the figures of each case compared with the same beats without assist.

    Raises
    ------
    UserError
        For arguments that cannot be used, and where a run ends early, with time and reason.

    References
    ----------
    H. Suga, Am. J. Physiol. 236 (1979) H498-H505: the pressure-volume area.

    R. Fincke et al., J. Am. Coll. Cardiol. 44 (2004) 340-348: the cardiac power output.

    S. J. Sarnoff et al., Am. J. Physiol. 192 (1958) 148-156: the tension-time index.

    G. D. Buckberg et al., Circ. Res. 30 (1972) 67-81: the diastolic pressure-time index.

    Examples
    --------
    >>> import tubular_dea as td
    >>> both = td.compare({"4 kV": {"voltage": "4 kV"}, "5.5 kV": {}}, "failing", beats=8)
    >>> changes = [course.change("stroke_work_per_stroke_volume") for course in both.courses.values()]
    >>> changes[1] < changes[0] < 0
    True
    """
    named = {name: dict(items("cases", case, name)) for name, case in items("cases", cases)}
    if not named:
        raise ArgumentError("cases", ": expected at least one case but was given none")
    loop = Loop.of(
        patient, voltage, beats, tube, settings, Rhythm.of(ecg, lead, r_times), Stepping(scheme, step, variable)
    )
    chosen = {
        name: {**loop.settings, **settings_of(loop.parts, _spelled(case), "cases", [VOLTAGE])}
        for name, case in named.items()
    }
    return ComparisonResult(loop, *run_cases(loop, chosen, progress), chosen)


def run_cases(
    loop: Loop, cases: Mapping[str, Mapping[str, float]], progress: bool
) -> tuple[dict[str, Run], dict[str, Course]]:
    """Runs by name, the one without assist first; and the assessments of the others."""
    trial, first = loop.trial(), next(iter(cases.values()))
    runs = {WITHOUT: trial.run({**first, "scheduler.voltage_on": 0.0}, WITHOUT if progress else "")}
    runs |= {name: trial.run(settings, name if progress else "") for name, settings in cases.items()}
    return runs, {name: follow(runs[WITHOUT], runs[name]) for name in cases}


def _spelled(case: Settings) -> dict[str, Amount]:
    return {"scheduler.voltage_on" if name == VOLTAGE else name: value for name, value in case.items()}


def aligned(header: list[str], rows: list[list[str]]) -> list[str]:
    """A table as lines: the first column to the left, the others to the right."""
    widths = [max(len(row[i]) for row in (header, *rows)) for i in range(len(header))]
    padded = (
        [row[0].ljust(widths[0]), *(cell.rjust(w) for cell, w in zip(row[1:], widths[1:], strict=True))]
        for row in (header, *rows)
    )
    return ["  ".join(cells).rstrip() for cells in padded]
