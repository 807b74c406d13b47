"""The assisted heart, with and without assist."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..cosim.beats import INDICES
from ..cosim.course import Course, follow
from ..cosim.heart_assist import models
from ..cosim.hold import RADIUS, Held, held_radius, how_held
from ..cosim.master import Run
from ..files import write_atomically
from . import tables
from .given import Amount, AnyModel, amount
from .heart import AnyPatient, Loop, Rhythm, Settings, Stepping

if TYPE_CHECKING:
    import pandas
    from matplotlib.figure import Figure

WITHOUT, WITH = "without assist", "with assist"


@dataclass(frozen=True, repr=False)
class AssistResult:
    """The heart `without` and with assist (`assisted`), and the assessment of the assist (`course`).

    ``result.assisted["heart.aortic_pressure"]`` is a value over ``result.assisted.time`` [s], in SI units. `loop` is
    the coupled system.
    """

    loop: Loop
    without: Run
    assisted: Run
    course: Course

    def __repr__(self) -> str:
        return f"<AssistResult: {self.verdict}>"

    @property
    def verdict(self) -> str:
        """The verdict in a sentence; ``course.verdict.word`` is ``"assisted"``, ``"partly"`` or ``"not"``."""
        return self.course.verdict.text

    @property
    def runs(self) -> dict[str, Run]:
        """Both runs by name."""
        return {WITHOUT: self.without, WITH: self.assisted}

    @property
    def held(self) -> Held | None:
        """How well a controller held its radius during the pulses; None without one, and where none got there."""
        return how_held(self.assisted, self.loop.settings) if self.loop.controlled else None

    def change(self, figure: str) -> float | None:
        """Relative change of a figure's mean, such as ``"stroke_work"``; None where it is not meaningful."""
        return self.course.change(figure)

    def lines(self) -> list[str]:
        """The verdict, the indices and the counts as text."""
        rows = self.course.rows()
        width = max(len(row[0]) for row in rows)
        judged = f"over {self.course.judged_words}"
        said = [
            self.verdict,
            *self._hold(),
            self._note(),
            f"{judged:{width}}  {'without':>8}  {'with, mean ± sd':>16}  {'worst':>8}  change",
        ]
        for label, without, with_, worst, change in rows:
            said.append(f"{label:{width}}  {without:>8}  {with_:>16}  {worst:>8}  {change}".rstrip())
        return [*said, *(f"{what:{width}}  {number:>8}" for what, number in self.course.counts())]

    def to_pandas(self) -> pandas.DataFrame:
        """One row a figure: means without and with, deviation, worst, change, SI unit.

        Over the assisted beats from the third on. Needs the extra `tables`.
        """
        rows = []
        for figure in INDICES:
            a, b = self.course.without.get(figure.name), self.course.assisted.get(figure.name)
            if b is not None:
                means = {"figure": figure.name, "without": a.mean if a else np.nan, "with": b.mean}
                spread = {"deviation": b.deviation, "worst": b.worst}
                rows.append({**means, **spread, "change": self.change(figure.name), "unit": figure.si})
        return tables.table(rows, "figure")

    def to_dict(self) -> dict[str, Any]:
        """All of it as plain values, as summary.json has it."""
        told = {"patient": self.loop.patient_name, "settings": dict(self.loop.settings)}
        return self.course.summary() | told | ({"held": asdict(self.held)} if self.held else {})

    def plot(self, figure: Figure | None = None) -> Figure:
        """Pressure-volume loops without and with assist; drawn into `figure` if it is given."""
        from ..report.assist import draw_loops, pressure_volume

        return draw_loops(pressure_volume(self.runs, self.course.judged[-1]), figure)

    def plot_beats(self, figure: Figure | None = None) -> Figure:
        """Pressures, volumes, displacement and field over the last beats; drawn into `figure` if it is given."""
        from ..report.assist import draw_panels
        from ..report.rhythm import panels, window

        made = panels(self.runs, window(self.assisted, self.course), self.limits(), self.loop.rhythm.shown())
        return draw_panels(made, figure)

    def limits(self) -> dict[str, float]:
        """The scheduler's limits: largest field [V/m], smallest margin to snap-through [Pa]."""
        declared = {f"scheduler.{n}": v for n, v in models()["scheduler"].parameter_values().items()}
        known = {**declared, **self.loop.settings}
        return {
            "electric_field": known["scheduler.field_limit"],
            "snap_through_margin": known["scheduler.margin_limit"],
        }

    def report(self, out: str | Path) -> list[Path]:
        """Write all values (CSV), report.html with its pictures, summary.json and lab.html to the folder `out`.

        Returns their paths. There is no lab.html with a controller, which that page does not have.
        """
        from ..report import assist as drawn

        out = Path(out)
        paths = [run.write(out / f"{name.replace(' ', '_')}.csv") for name, run in self.runs.items()]
        paths += drawn.write(
            out, self.runs, self.course, [self._note(), *self._hold()], self.limits(), self.loop.rhythm.shown()
        )
        text = json.dumps(self.to_dict(), indent=1, allow_nan=False) + "\n"
        paths.append(write_atomically(out / "summary.json", text.encode()))
        return paths if self.loop.controlled else [*paths, self._page(out)]

    def _hold(self) -> list[str]:
        """How well the radius was held, where one was to be."""
        if not self.loop.controlled:
            return []
        return [self.held.text if self.held else "No pulse was long enough for the tube to get to the radius to hold."]

    def _note(self) -> str:
        settings, stepping = self.loop.settings, self.loop.stepping
        pulses = f"of {settings['scheduler.voltage_on'] / 1e3:g} kV"
        if RADIUS in settings:
            pulses = f"to hold a radius of {1e3 * settings[RADIUS]:g} mm"
        return (
            f"Patient {self.loop.patient_name}, tube {self.loop.parts['tube'].title}, pulses {pulses}; "
            f"{stepping.scheme} coupling, communication step {stepping.step:g} s."
        )

    def _page(self, out: Path) -> Path:
        """The same heart, tube and device, live in any browser."""
        from ..lab.opened import assisted_heart
        from ..lab.page import write

        loop = self.loop
        times = () if loop.rhythm.times is None else tuple(loop.rhythm.times.tolist())
        called, file = (loop.patient_in(out), loop.patient), loop.model_file_in(out)
        return write(out / "lab.html", assisted_heart(loop.parts, called, loop.settings, loop.beats, times, file))


def assist(
    patient: AnyPatient = "failing",
    voltage: Amount = "5.5 kV",
    *,
    beats: int = 15,
    tube: AnyModel = "tube",
    settings: Settings | None = None,
    ecg: str | Path | None = None,
    lead: str | None = None,
    r_times: str | Path | np.ndarray | None = None,
    controller: Amount | None = None,
    scheme: str = "implicit",
    step: float = 1e-3,
    variable: bool = False,
    progress: bool = False,
) -> AssistResult:
    """A heart with and without assist: ventricle and windkessel, tube and scheduler, coupled.

    Parameters
    ----------
    patient : str, Path or mapping
        ``"failing"``, ``"healthy"``, ``"stiff"``, a TOML file, or all values by name (SI, or with a unit).
    voltage : float or str
        Voltage of a pulse [V].
    beats : int
        Number of beats, at least 5 (the scheduler learns for three).
    tube : Model, str or Path
        A tube such as a discovery's model, or a model.json (default: the paper's).
    settings : mapping of str to float or str, optional
        Parameters of heart, tube or scheduler by "part.name", as in ``{"scheduler.on_time": "-70 ms"}``.
    ecg : str or Path, optional
        Follow the beats of a recorded ECG: CSV (time [s],ecg [mV]) or a WFDB record.
    lead : str, optional
        Column or signal of the ECG (default: the first).
    r_times : str, Path or array of shape (n,), optional
        Follow beats at these R times [s].
    controller : float or str, optional
        Hold this radius [m] during pulses, with the tube controller.
    scheme : {"implicit", "gauss-seidel", "jacobi"}
        The coupling scheme; explicit ones diverge in stiff arteries and near the fold, which is reported.
    step : float
        Communication step [s], at most 0.005.
    variable : bool
        Let the error estimate choose the step, up to ten times `step`.
    progress : bool
        Show bars on standard error.

    Returns
    -------
    AssistResult
        Both runs, the indices over the assisted beats from the third on, and a verdict.

    Raises
    ------
    UserError
        For invalid arguments, and for runs that end early, with time and reason.

    Examples
    --------
    >>> import tubular_dea as td
    >>> helped = td.assist("failing", "5.5 kV", beats=10)
    >>> helped.course.verdict.word
    'assisted'
    >>> f"{100 * helped.change('stroke_work_per_stroke_volume'):.0f} %"
    '-2 %'

    Source: indices and their formulas are in `tubular_dea.cosim.beats`, each with its own.
    """
    rhythm, controlled = Rhythm.of(ecg, lead, r_times), controller is not None
    loop = Loop.of(
        patient, voltage, beats, tube, settings, rhythm, Stepping(scheme, step, variable), controlled=controlled
    )
    trial = loop.trial(controlled)
    without = trial.run({**loop.settings, "scheduler.voltage_on": 0.0}, WITHOUT if progress else "")
    if controller is not None:
        radius = amount(controller, "m", "controller")
        loop = replace(loop, settings={**loop.settings, **held_radius(radius, loop.settings, without)})
    assisted = trial.run(loop.settings, WITH if progress else "")
    return AssistResult(loop, without, assisted, follow(without, assisted))
