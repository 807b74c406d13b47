"""A trial: one patient, one tube, one rhythm; it can be run with any number of settings of the device.

Usage::

    trial = Trial.of(patient("failing"), beats=15)
    without, with_ = trial.run({"scheduler.voltage_on": 0.0}), trial.run({"scheduler.voltage_on": 5500.0})
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..errors import ArgumentError
from ..model.declare import Model
from ..progress import progress_bar
from ..protocol import Protocol
from .heart_assist import fmus, heart_assist
from .heartbeats import pace
from .master import MOST_STEPS, Options, Run, simulate

FEWEST_BEATS = 5  # the scheduler learns for three
SECONDS = "{desc}: {percentage:3.0f}% {n:.0f} of {total:.0f} s [{elapsed}<{remaining}]"
AFTER = 0.05  # s: the run goes on so long after its last R wave, to see it


@dataclass(frozen=True)
class Trial:
    """`patient` in SI units, FMUs by part, end of the run [s], and the pace where recorded beats are followed."""

    patient: Mapping[str, float]
    slaves: Mapping[str, Path]
    stop: float
    pace: Protocol | None = None
    options: Options | None = None

    @classmethod
    def of(
        cls,
        patient: Mapping[str, float],
        beats: int,
        r_times: np.ndarray | None = None,
        tube: Model | None = None,
        options: Options | None = None,
        heart_rate: float | None = None,
        controlled: bool = False,
    ) -> Trial:
        """A trial of `beats` beats: recorded ones at `r_times` [s], or the patient's own (at `heart_rate` [Hz])."""
        if beats < FEWEST_BEATS:
            raise ArgumentError(
                "beats", f": expected at least {FEWEST_BEATS} (the scheduler learns for three) but was given {beats}"
            )
        if r_times is None:
            rate = heart_rate or patient["heart_rate"]
            most = int(MOST_STEPS * (options or Options()).step * rate)
            if beats > most:
                raise ArgumentError("beats", f": expected at most {most}, or a larger step, but was given {beats}")
            stop, told = (beats + AFTER) / rate, None
        elif r_times.size < beats + 2:
            raise ArgumentError(
                "beats", f": expected at most {r_times.size - 2}, which the recording has, but was given {beats}"
            )
        else:
            stop = float(r_times[beats] - r_times[0] + AFTER)
            told = pace(r_times, stop)
        return cls(patient, fmus(None, told is not None, tube, controlled), stop, told, options)

    def run(self, settings: Mapping[str, float], name: str = "") -> Run:
        """The whole run with `settings` by "part.variable"; a progress bar called `name`, if it has one.

        Without voltage, the controller is left out.
        """
        slaves, given = dict(self.slaves), dict(settings)
        if "controller" in slaves and not settings.get("scheduler.voltage_on", 1.0):
            del slaves["controller"]
            given = {name: v for name, v in given.items() if not name.startswith("controller.")}
        system = heart_assist(slaves, self.patient, given, self.pace)
        with progress_bar(total=round(self.stop, 3), bar_format=SECONDS, desc=name, disable=not name) as bar:

            def progress(time: float) -> None:
                bar.update(round(time - bar.n, 3))

            return simulate(system, self.stop, self.options, progress=progress).completed()
