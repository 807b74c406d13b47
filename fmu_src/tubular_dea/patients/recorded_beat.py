"""The average beat of a recorded arterial pressure: cut at its upstrokes, beats alike averaged.

Reads what `recordings` reads (columns pressure, flow, ecg; or a headless file of time and pressure), and WFDB records.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.signal import find_peaks

from ..cosim.heartbeats import FASTEST, LEADS, SLOWEST, Ecg, detect
from ..errors import UserError
from ..extra import load
from ..identify.records.columns import is_in
from ..identify.signals.sampling import usual_step
from ..model.units import UnitError, factor
from ..recordings import Table, read

# Set by judgement. Check: `pytest tests/test_patient.py`
BEAT_POINTS = 200  # [1] points of the average beat
BEATS_ALIKE = 0.15  # [1] of the median length: beats whose own differs by more are left out
ENDS_ALIKE = 0.15  # [1] of the swing, within which a beat ends as high as it begins
SMOOTHED_FOR = 0.02  # [s] over which the slope of the pressure is averaged
STEEP = 0.4  # [1] of most upstrokes' slope that each has at least
STEEPEST_SHARE = 0.98  # [1] quantile of the slope that stands for most upstrokes'
RISES_FOR = 0.15  # [s] before and after its steepest place within which an upstroke rises
HIGH = 0.5  # [1] of most upstrokes' rise that each has at least
HIGHEST_SHARE = 0.8  # [1] quantile of the rises that stands for most: every second may be a valve's closure
BEATS_AGREE = 1.25  # [1] times as many beats as the pressure that an ECG may show, or as few
LEAST_VALID = 0.5  # [1] share of the samples that have to be numbers
FEWEST_BEATS = 3  # [1] beats of like length that have to be there, and as many with a flow
FEWEST_TIMES = 20  # [samples] of a recording at least
MORE_BEATS = 3  # [1] upstrokes of the pressure from which on a recording is more than one beat,
FEWEST_UPSTROKES = 4  # [1] and how many it then has at least
FLOW_COVERS = 0.9  # [1] share of a single beat that its flow has to cover

# Set by measurement: recorded beats (shared/data, cosim_examples) differ by at most 0.4, those of the models with
# noise of 5 mmHg or breathing of 20 by 0.6, stretches of noise, random walks and stairs by 1.1 to 6.
# Check: `pytest tests/test_patient.py`
MOST_UNLIKE = 0.8  # [1] of the swing that beats share, by which they differ from one another, both as rms

# Set by convention: what arteries have. Check: `pytest tests/test_patient.py::test_bad_recordings_are_refused`
LOWEST_MEDIAN = 10.0  # [mmHg] of a pressure
HIGHEST_MEDIAN = 300.0  # [mmHg] of it
LEAST_SWING = 1.0  # [mmHg] of it in a beat

UNITS = {"pressure": ("Pa", "mmHg"), "flow": ("m3/s", "mL/s"), "ecg": ("V", "mV")}  # SI, and what a bare column means
NAMES = {"pressure": ("pressure", "abp", "art", "aop", "p"), "flow": ("flow", "aoq", "q"), "ecg": LEADS}


class PatientRecordError(UserError, ValueError):
    """A recording that no patient can be fitted to."""


@dataclass(frozen=True)
class Signals:
    """A recording over `time` [s]: pressure [Pa], and flow [m3/s] and ECG where there are any (NaN: missing).

    `remarks` tell how it was understood where that is not plain.
    """

    time: np.ndarray
    pressure: np.ndarray
    flow: np.ndarray | None = None
    ecg: np.ndarray | None = None
    remarks: tuple[str, ...] = ()


@dataclass(frozen=True)
class RecordedBeat:
    """The average of `beats` beats of `period` [s] at BEAT_POINTS equal times: pressure [Pa] and its spread from beat
    to beat, flow [m3/s] or None; `by` is what the beats were cut at, `remarks` tell how it was understood."""

    period: float
    beats: int
    pressure: np.ndarray
    spread: np.ndarray
    flow: np.ndarray | None
    by: str
    remarks: tuple[str, ...] = ()

    @property
    def phase(self) -> np.ndarray:
        """The places of the points in the beat, 0 to 1."""
        return np.arange(BEAT_POINTS) / BEAT_POINTS


def read_signals(path: Path, flow: Path | None = None) -> Signals:
    """A recording from a table or a WFDB record; `flow` is a second table over the same time."""
    if path.suffix in (".hea", ".dat") or (path.suffix == "" and path.with_suffix(".hea").is_file()):
        if flow is not None:
            raise PatientRecordError(f"{flow}: a flow beside a WFDB record is not read; give the pressure as a table")
        return _wfdb(path.with_suffix(""))
    table = read(path)
    time, (pressure, said) = _time(table), _sure(table, "pressure", "arterial pressure")
    with_flow = _column(table, "flow") if any(c.name for c in table.columns) else None
    if flow is not None:
        other = read(flow)
        values, more = _sure(other, "flow", "aortic flow")
        with_flow, said = np.interp(time, _time(other), values, np.nan, np.nan), said + more
    return Signals(time, pressure, with_flow, _column(table, "ecg"), said)


def average(signals: Signals, what: str) -> RecordedBeat:
    """The average beat; `PatientRecordError` says of the recording `what` why there is none."""
    pressure = _filled(signals.pressure, what)
    rate = (signals.time.size - 1) / float(np.ptp(signals.time))
    if _one_beat(signals.time, pressure):
        return _whole(signals, pressure, what)
    marks = _marks(signals, pressure, rate, what)
    lengths = np.diff(marks)
    period = float(np.median(lengths))
    if not 60 / FASTEST <= period <= 60 / SLOWEST:
        raise PatientRecordError(f"{what}: beats of {period:.2f} s; expected {SLOWEST:g} to {FASTEST:g} a minute")
    alike = np.abs(lengths / period - 1) < BEATS_ALIKE
    places = marks[:-1][alike][:, None] + lengths[alike][:, None] * np.arange(BEAT_POINTS) / BEAT_POINTS
    if len(places) < FEWEST_BEATS:
        raise PatientRecordError(f"{what}: {len(places)} beats of like length; expected at least {FEWEST_BEATS}")
    cut, by = np.interp(places, signals.time, pressure), "upstrokes of the pressure"
    _check_alike(cut, np.diff(np.interp(marks, signals.time, pressure))[alike], what)
    flow, said = _flow(signals, places, what)
    return RecordedBeat(period, len(places), cut.mean(axis=0), cut.std(axis=0), flow, by, signals.remarks + said)


def _check_alike(cut: np.ndarray, rises: np.ndarray, what: str) -> None:
    """`PatientRecordError` unless the pressure `cut` (m, BEAT_POINTS) into beats comes back to where it was, so that
    `rises` (m,) from one to the next are small, and beats are like one another. Each may be on a level of its own, as
    breathing and drift leave them."""
    mean, found = cut.mean(axis=0), f"{what}: no heart beats found: the {len(cut)} most regular rises of the pressure"
    ask = "give a recording of the arterial pressure of a beating heart"
    if abs(rises.mean()) > ENDS_ALIKE * np.ptp(mean):
        step = float(rises.mean()) / factor("mmHg", "Pa")
        apart = f"{abs(step):.3g} mmHg {'above' if step > 0 else 'below'}"
        raise PatientRecordError(f"{found} are each {apart} the last; expected a pressure that comes back; {ask}")
    shared, each = mean - mean.mean(), cut - cut.mean(axis=1, keepdims=True)
    unlike = float(np.sqrt(np.mean((each - shared) ** 2) / np.mean(shared**2)))
    if unlike > MOST_UNLIKE:
        raise PatientRecordError(
            f"{found} differ by {unlike:.2g} times what they have in common; expected at most {MOST_UNLIKE:g}; {ask}"
        )


def _flow(signals: Signals, places: np.ndarray, what: str) -> tuple[np.ndarray | None, tuple[str, ...]]:
    """The average flow of the beats at `places` (m, BEAT_POINTS) that it covers as a whole, and what is said of it."""
    if signals.flow is None:
        return None, ()
    found = np.interp(places, signals.time, signals.flow)
    whole = found[np.isfinite(found).all(axis=1)]
    if len(whole) < FEWEST_BEATS:
        raise PatientRecordError(
            f"{what}: the flow covers {len(whole)} whole beats of the pressure's {len(found)}; expected at least "
            f"{FEWEST_BEATS}: give a flow over the same time, or leave it out"
        )
    return whole.mean(axis=0), (f"The flow covers {len(whole)} of these beats.",) * (len(whole) < len(found))


def _time(table: Table) -> np.ndarray:
    named = next((c for c in table.columns if c.name.lower() in ("time", "t")), table.columns[0])
    time = np.asarray(named.values, float)
    if time.size < FEWEST_TIMES or not np.all(np.diff(time) > 0):
        raise PatientRecordError(f"{table.path}: expected at least {FEWEST_TIMES} ascending times in the first column")
    return time


def _sure(table: Table, name: str, words: str) -> tuple[np.ndarray, tuple[str, ...]]:
    """A signal that must be there, by its heading or as the only one in a unit of its kind, and what is said of it."""
    values = _column(table, name)
    if values is not None:
        return values, ()
    alike = [c for c in table.columns if c.unit and is_in(c.unit, UNITS[name][0])]
    if len(alike) != 1:
        raise PatientRecordError(
            f"{table.heading_place}: expected a column of the {words}, as in '{name} [{UNITS[name][1]}]', but found "
            f"{table.headings}; rename the one that it is"
        )
    said = f"The {name} is read from {alike[0].shown}, the only column in a unit of its kind."
    return np.asarray(alike[0].values, float) * factor(alike[0].unit, UNITS[name][0]), (said,)


def _column(table: Table, name: str) -> np.ndarray | None:
    """A signal by its heading; of a headless table with two columns, the second."""
    found = next((c for c in table.columns if c.name.lower() in NAMES[name]), None)
    if found is not None and sum(c.name == found.name for c in table.columns) > 1:
        raise PatientRecordError(f"{table.heading_place}: column {found.shown} appears twice; expected it once")
    if found is None and len(table.columns) == 2 and not table.columns[1].name and name != "ecg":
        found = table.columns[1]
    if found is None:
        return None
    si, usual = UNITS[name]
    try:
        return np.asarray(found.values, float) * factor(found.unit or usual, si)
    except UnitError as problem:
        raise PatientRecordError(f"{table.path}, column {found.shown}: {problem}") from None


def _wfdb(path: Path) -> Signals:
    if not path.with_suffix(".hea").is_file():
        raise PatientRecordError(f"{path}: cannot be read as a WFDB record: there is no {path.with_suffix('.hea')}")
    wfdb = load("wfdb", f"{path}: reading WFDB records", "ecg", ", or convert to CSV")
    try:
        record = wfdb.rdrecord(str(path))
    except (OSError, ValueError, LookupError, TypeError, AttributeError) as problem:
        raise PatientRecordError(f"{path}: cannot be read as a WFDB record: {problem}") from None
    time = np.arange(record.p_signal.shape[0]) / float(record.fs)
    found = {}
    for signal, unit, values in zip(record.sig_name, record.units, record.p_signal.T, strict=True):
        kind = "pressure" if unit.lower() == "mmhg" else "ecg" if unit == "mV" and "resp" not in signal.lower() else ""
        if kind and kind not in found:
            found[kind] = np.asarray(values, float) * factor(unit, UNITS[kind][0])
    if "pressure" not in found:
        raise PatientRecordError(f"{path}: expected a signal in mmHg; there are {', '.join(record.sig_name)}")
    return Signals(time, found["pressure"], None, found.get("ecg"))


def _filled(values: np.ndarray, what: str) -> np.ndarray:
    good = np.isfinite(values)
    if good.mean() < LEAST_VALID:
        raise PatientRecordError(f"{what}: more than half of the pressure is missing")
    median, swing = (float(v) * factor("Pa", "mmHg") for v in (np.median(values[good]), np.ptp(values[good])))
    if not LOWEST_MEDIAN < median < HIGHEST_MEDIAN:
        raise PatientRecordError(
            f"{what}: the pressure is {median:.3g} mmHg in the median; "
            f"expected {LOWEST_MEDIAN:g} to {HIGHEST_MEDIAN:g}: check its unit"
        )
    if swing < LEAST_SWING:
        raise PatientRecordError(f"{what}: expected an arterial pressure that beats by more than {LEAST_SWING:g} mmHg")
    return np.interp(np.arange(values.size), np.flatnonzero(good), values[good])


def _one_beat(time: np.ndarray, pressure: np.ndarray) -> bool:
    """Whether the recording is a single beat: one pulse, and as high at its end as at its begin."""
    swing = float(np.ptp(pressure))
    return bool(
        np.ptp(time) < 60 / SLOWEST
        and _upstrokes(pressure, time).size < MORE_BEATS
        and abs(pressure[0] - pressure[-1]) < ENDS_ALIKE * swing
    )


def _whole(signals: Signals, pressure: np.ndarray, what: str) -> RecordedBeat:
    """The recording as one beat; what is missing from its end to its begin counts as one sample."""
    step = usual_step(signals.time)
    period = float(np.ptp(signals.time)) + step
    places = signals.time[0] + period * np.arange(BEAT_POINTS) / BEAT_POINTS

    def periodic(values: np.ndarray) -> np.ndarray:
        return np.interp(places, np.append(signals.time, signals.time[0] + period), np.append(values, values[0]))

    flow, by = signals.flow, "the recording, which is one beat"
    if flow is not None:
        there = np.flatnonzero(np.isfinite(flow))
        if there.size < FLOW_COVERS * flow.size:
            raise PatientRecordError(f"{what}: the flow covers {there.size} of {flow.size} samples; leave it out")
        flow = periodic(np.interp(np.arange(flow.size), there, flow[there]))
    return RecordedBeat(period, 1, periodic(pressure), np.zeros(BEAT_POINTS), flow, by, signals.remarks)


def _marks(signals: Signals, pressure: np.ndarray, rate: float, what: str) -> np.ndarray:
    """Where beats begin [s]: the steepest upstrokes of the pressure. An ECG beside it has to show as many.

    R waves are not suitable for cutting: detectors switch from one wave to another in distorted leads.
    """
    marks = _upstrokes(pressure, signals.time)
    if marks.size < FEWEST_UPSTROKES:
        raise PatientRecordError(
            f"{what}: {marks.size} beats found in the pressure; expected at least {FEWEST_UPSTROKES}"
        )
    if signals.ecg is None:
        return marks
    seen = detect(Ecg(signals.ecg, rate)).size
    if not 1 / BEATS_AGREE < seen / marks.size < BEATS_AGREE:
        raise PatientRecordError(
            f"{what}: {seen} beats found in the ECG but {marks.size} in the pressure; check the lead, or leave it out"
        )
    return marks


def _upstrokes(pressure: np.ndarray, time: np.ndarray) -> np.ndarray:
    """The steepest places of the pressure [s]: peaks of its slope, half as high as most, no closer than hearts beat.

    After each the pressure rises by half of what it does in most beats: the wave after the valve's closure may be as
    steep, but is small.
    """
    step = usual_step(time)
    slope = np.gradient(pressure, time)
    width = max(1, round(SMOOTHED_FOR / step))
    slope = np.convolve(slope, np.ones(width) / width, mode="same")
    apart = max(1, round(60 / FASTEST / step))
    found, _ = find_peaks(slope, height=STEEP * float(np.quantile(slope, STEEPEST_SHARE)), distance=apart)
    if not found.size:
        return np.empty(0)
    reach = max(1, round(RISES_FOR / step))
    rises = np.array([pressure[i : i + reach].max() - pressure[max(0, i - reach) : i + 1].min() for i in found])
    return np.asarray(time[found[rises >= HIGH * float(np.quantile(rises, HIGHEST_SHARE))]])
