"""The best pulse for a patient."""

from __future__ import annotations

import json
import shlex
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..control.optimum import OBJECTIVES, Limits, Optimum, Pulse
from ..control.optimum import optimise as search
from ..cosim.course import Course
from ..cosim.heart_assist import models
from ..cosim.master import Run
from ..errors import ArgumentError
from ..files import write_atomically
from ..model.units import factor
from ..progress import progress_bar
from . import tables
from .compare import aligned, run_cases
from .given import Amount, AnyModel, amount
from .heart import AnyPatient, Loop, Rhythm, Settings, Stepping

if TYPE_CHECKING:
    import pandas
    from matplotlib.figure import Figure

DEFAULT, OPTIMUM = "default", "optimum"
TIMING = ("scheduler.on_fraction", "scheduler.off_fraction", "scheduler.on_time", "scheduler.off_time")


@dataclass(frozen=True, repr=False)
class PulseResult:
    """The best pulse (`optimum`), and its runs and those of the given pulse with the scheduler (`runs`, `courses`)."""

    loop: Loop
    optimum: Optimum
    runs: Mapping[str, Run]
    courses: Mapping[str, Course]

    def __repr__(self) -> str:
        return f"<PulseResult: {self.lines()[0]}>"

    @property
    def pulse(self) -> Pulse:
        """Begin and end in beats after R, voltage [V]."""
        return self.optimum.pulse

    @property
    def settings(self) -> dict[str, float]:
        """The pulse as settings of `assist`, by "part.name" in SI units."""
        return {
            "scheduler.voltage_on": self.pulse.voltage,
            "scheduler.on_fraction": self.pulse.begin,
            "scheduler.off_fraction": self.pulse.end,
            "scheduler.on_time": 0.0,
            "scheduler.off_time": 0.0,
        }

    def lines(self) -> list[str]:
        """The optimum, its benefit, and its sensitivity to disturbances, as text."""
        from ..report.compare import table
        from ..report.optimum import ROBUSTNESS, robustness, sentence

        return [
            sentence(self.optimum, self.courses[DEFAULT]),
            *aligned(*table(self.courses)),
            *aligned(list(ROBUSTNESS), robustness(self.optimum)),
        ]

    def command(self, out: str | Path) -> str:
        """The command that runs the optimum into the folder `out`/run, with everything else as it was asked for."""
        loop, out = self.loop, Path(out)
        kept = [f"{n}={v}" for n, v in loop.given.items() if n not in (*TIMING, "scheduler.voltage_on")]
        kept += [f"scheduler.on_fraction={self.pulse.begin:.4g}", f"scheduler.off_fraction={self.pulse.end:.4g}"]
        words = ["tubular-dea", "assist", "--patient", loop.patient_in(out), "--voltage", f"{self.pulse.voltage:.0f}V"]
        file = loop.model_file_in(out)
        words += ["--model", file] if file else []
        words += [word for setting in kept for word in ("--set", setting)]
        return shlex.join([*words, "--out", str(out / "run")])

    def to_pandas(self) -> pandas.DataFrame:
        """The benefit of the disturbed pulse: one row per disturbance. Needs the extra `tables`."""
        return tables.table([asdict(c) for c in self.optimum.robustness], "what")

    def to_dict(self) -> dict[str, Any]:
        """All of it as plain values, as optimum.json has it (but for the command)."""
        best = self.optimum
        seconds = {"begin_seconds": best.pulse.begin * best.period, "end_seconds": best.pulse.end * best.period}
        return {
            "objective": OBJECTIVES[best.objective][1],
            "pulse": asdict(best.pulse) | seconds,
            "change": best.gain,
            "default": asdict(best.default) | {"change": best.default_gain},
            "begins_after_ejection": best.ahead,
            "map": {"figures": best.figures, "without": best.without, "trajectories": best.rows},
            "robustness": [asdict(c) for c in best.robustness],
            "run": self.courses[OPTIMUM].summary(),
            "field_V_per_um": best.figures["largest_field"] * factor("V/m", "V/um"),
        }

    def plot(self, figure: Figure | None = None) -> Figure:
        """Every timing at its best voltage, with the optimum; drawn into `figure` if it is given."""
        from ..report.optimum import draw_map

        return draw_map(self.optimum, figure)

    def report(self, out: str | Path) -> list[Path]:
        """Write optimum.html, .png and .json to the folder `out`; returns their paths."""
        from ..report import optimum as drawn

        out, command = Path(out), self.command(out)
        written = drawn.write(out, self.optimum, self.runs, self.courses, command)
        text = json.dumps(self.to_dict() | {"command": command}, indent=1, allow_nan=False) + "\n"
        return [*written, write_atomically(out / "optimum.json", text.encode())]


def best_pulse(
    patient: AnyPatient = "failing",
    voltage: Amount = "5.5 kV",
    *,
    objective: str = "stroke_work_per_stroke_volume",
    largest_voltage: Amount = "10 kV",
    beats: int = 15,
    tube: AnyModel = "tube",
    settings: Settings | None = None,
    scheme: str = "implicit",
    step: float = 1e-3,
    variable: bool = False,
    progress: bool = False,
) -> PulseResult:
    """When to pulse the tube, and how strongly, within the limits of field, margin and amplifier.

    Parameters
    ----------
    objective : str
        The index to lower (``"stroke_work_per_stroke_volume"``, ``"stroke_work"``) or to raise (``"stroke_volume"``,
        ``"mean_aortic_pressure"``).
    largest_voltage : float or str
        The limit of the amplifier [V].
    patient, voltage, beats, tube, settings, scheme, step, variable, progress
        As in `assist`; the limits are the scheduler's, as in ``{"scheduler.field_limit": "75 V/um"}``, and the pulse
        that these settings give is run beside the best one.

    Returns
    -------
    PulseResult
        The pulse, its benefit, the map of all timings, and the cost of disturbances.

    Raises
    ------
    UserError
        For invalid arguments, and where no pulse meets the limits or none helps.

    References
    ----------
    R. Y. Rubinstein, D. P. Kroese, "The Cross-Entropy Method", Springer (2004): the search around the best points.

    Examples
    --------
    >>> import tubular_dea as td
    >>> best = td.best_pulse("failing", beats=8)
    >>> best.optimum.gain < best.optimum.default_gain < 0
    True
    """
    if objective not in OBJECTIVES:
        raise ArgumentError("objective", f": expected one of {', '.join(OBJECTIVES)} but was given {objective!r}")
    loop = Loop.of(patient, voltage, beats, tube, settings, Rhythm(), Stepping(scheme, step, variable))
    scheduler = models()["scheduler"].parameter_values() | _of(loop.settings, "scheduler")
    model, changed = loop.tube, _of(loop.settings, "tube")
    if changed:
        model = loop.parts["tube"].with_values(changed)
    heart, limits = {**loop.patient, **_of(loop.settings, "heart")}, _limits(scheduler, largest_voltage)
    usual = Pulse(scheduler["on_fraction"], scheduler["off_fraction"], scheduler["voltage_on"])
    with progress_bar(unit=" trajectories", desc="optimise", disable=not progress) as bar:
        best = search(heart, limits, objective, usual, model, bar.update)
    chosen = {**loop.settings, **PulseResult(loop, best, {}, {}).settings}
    return PulseResult(loop, best, *run_cases(loop, {DEFAULT: loop.settings, OPTIMUM: chosen}, progress))


def _of(settings: Mapping[str, float], part: str) -> dict[str, float]:
    return {n.partition(".")[2]: v for n, v in settings.items() if n.partition(".")[0] == part}


def _limits(scheduler: Mapping[str, float], largest_voltage: Amount) -> Limits:
    largest = amount(largest_voltage, "V", "largest_voltage")
    if largest <= 0:
        raise ArgumentError("largest_voltage", f": expected more than 0 V but was given {largest:g} V")
    return Limits(
        scheduler["field_limit"],
        scheduler["margin_limit"],
        largest,
        scheduler["slew_rate"],
        scheduler["current_limit"],
        scheduler["load_capacitance"],
        scheduler["max_on_time"],
    )
