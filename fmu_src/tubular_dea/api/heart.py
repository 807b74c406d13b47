"""The inputs of every run of the assisted heart: a patient, a rhythm, a tube, settings, and the coupling."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TypeAlias

import numpy as np

from ..cosim.heart_assist import models
from ..cosim.heartbeats import Ecg, detect, read_ecg, read_r_times
from ..cosim.master import SCHEMES, Options
from ..cosim.trial import Trial
from ..errors import ArgumentError
from ..files import write_atomically
from ..model.dea import tubular_dea
from ..model.declare import Model
from ..model.patient_files import as_toml, read_patient
from ..model.windkessel import PARAMETERS, check_known, checked_patient
from ..plants.saved import as_json
from .given import Amount, AnyModel, amount, settings_of, tube_of

LONGEST_STEP = 0.005  # s; with 10 ms a run without assist is off by a tenth of what the assist changes
NO_PULSE = 25.0  # V; a smaller one moves nothing: its unit was left out
MODEL_FILE, PATIENT_FILE = "model.json", "patient.toml"
GIVEN = "given"  # the name of a patient that has no other

AnyPatient: TypeAlias = str | Path | Mapping[str, Amount]
Settings: TypeAlias = Mapping[str, Amount]


@dataclass(frozen=True)
class Stepping:
    """The coupling of the loop: the scheme, the communication step [s], and whether the step is adaptive."""

    scheme: str = "implicit"
    step: float = 1e-3
    variable: bool = False

    def options(self) -> Options:
        """For the master; `ArgumentError` for what it cannot do."""
        if self.scheme not in SCHEMES:
            raise ArgumentError("scheme", f": expected one of {', '.join(SCHEMES)} but was given {self.scheme!r}")
        if not 0 < self.step <= LONGEST_STEP:
            raise ArgumentError(
                "step",
                f": expected a positive number of seconds, at most {LONGEST_STEP:g}, but was given {self.step:g}",
            )
        if self.variable:
            return Options(self.scheme, 10 * self.step, order=1, variable=True, tolerance=1e-4)
        return Options(self.scheme, self.step, order=1)


@dataclass(frozen=True)
class Rhythm:
    """Recorded beats: R times [s], and the ECG they were found in; nothing where the heart beats by itself."""

    times: np.ndarray | None = None
    ecg: Ecg | None = None

    @classmethod
    def of(cls, ecg: str | Path | None, lead: str | None, r_times: str | Path | np.ndarray | None) -> Rhythm:
        """From a recorded ECG, or from R times [s] in a file or an array."""
        if ecg is not None and r_times is not None:
            raise ArgumentError("r_times", ": they and an ECG exclude each other; give one of them")
        if ecg is not None:
            read = read_ecg(Path(ecg), lead)
            return cls(detect(read), read)
        if r_times is None:
            return cls()
        return cls(read_r_times(Path(r_times)) if isinstance(r_times, str | Path) else np.asarray(r_times, float))

    @property
    def paced(self) -> bool:
        """Whether the heart is paced by recorded beats."""
        return self.times is not None

    def shown(self) -> tuple[np.ndarray, np.ndarray] | None:
        """The ECG over the time of the run, which starts with the first R wave."""
        if self.ecg is None or self.times is None:
            return None
        return np.arange(self.ecg.signal.size) / self.ecg.rate - self.times[0], self.ecg.signal


@dataclass(frozen=True)
class Loop:
    """The loop, checked: values in SI units, `settings` by "part.name".

    `patient_name` and `model_file` are how the command line calls patient and tube, `given` the settings as they came.
    `tube` is None for the paper's.
    """

    patient_name: str
    patient: Mapping[str, float]
    rhythm: Rhythm
    tube: Model | None
    model_file: str
    settings: Mapping[str, float]
    given: Settings
    stepping: Stepping
    beats: int
    controlled: bool = False

    @classmethod
    def of(
        cls,
        patient: AnyPatient,
        voltage: Amount,
        beats: int,
        tube: AnyModel,
        settings: Settings | None,
        rhythm: Rhythm,
        stepping: Stepping,
        controlled: bool = False,
    ) -> Loop:
        """From the arguments of `assist`."""
        stepping.options()
        values = patient_of(patient)
        model = tube_of(tube)
        own = None if model == tubular_dea() else model
        file = str(tube) if isinstance(tube, str | Path) and str(tube).endswith(".json") else ""
        parts = models(rhythm.paced, own, controlled)
        chosen = {"scheduler.voltage_on": _voltage(parts["scheduler"], voltage)} | settings_of(parts, settings)
        name = GIVEN if isinstance(patient, Mapping) else str(patient)
        return cls(name, values, rhythm, own, file, chosen, settings or {}, stepping, beats, controlled)

    @property
    def parts(self) -> dict[str, Model]:
        """The models by part."""
        return models(self.rhythm.paced, self.tube, self.controlled)

    def trial(self, controlled: bool = False) -> Trial:
        """The trial of this loop, with compiled slaves."""
        rate, options = self.settings.get("heart.heart_rate"), self.stepping.options()
        return Trial.of(self.patient, self.beats, self.rhythm.times, self.tube, options, rate, controlled)

    def patient_in(self, out: Path) -> str:
        """How commands call the patient; one that was given value by value is written to `out`."""
        if self.patient_name != GIVEN:
            return self.patient_name
        return str(write_atomically(out / PATIENT_FILE, as_toml(self.patient).encode()))

    def model_file_in(self, out: Path) -> str:
        """The file that holds the tube, "" for the paper's; a tube in memory alone is written to `out`."""
        if self.tube is None or self.model_file:
            return self.model_file
        return str(write_atomically(out / MODEL_FILE, as_json(self.tube).encode()))


def _voltage(scheduler: Model, given: Amount) -> float:
    """The voltage of a pulse [V], within what the scheduler allows."""
    q, value = scheduler.quantity("voltage_on"), amount(given, "V", "voltage")
    if not q.allows(value):
        allowed = f"{1e-3 * (q.minimum or 0):g} to {1e-3 * (q.maximum or math.inf):g} kV"
        raise ArgumentError("voltage", f": expected {allowed} but was given {1e-3 * value:g} kV")
    if 0 < value < NO_PULSE:
        raise ArgumentError(
            "voltage", f": expected 0, or at least {NO_PULSE:g} V, but was given {value:g} V; was {value:g} kV meant?"
        )
    return value


def patient_of(patient: AnyPatient) -> dict[str, float]:
    """A patient's values (SI) by name, from a TOML file, or given one by one."""
    if not isinstance(patient, Mapping):
        return read_patient(str(patient))
    check_known(patient, "patient")
    units = {p.quantity.name: p.quantity.unit for p in PARAMETERS}
    values = {name: amount(v, units[name], f"patient {name}") for name, v in patient.items()}
    return checked_patient(values, "patient")
