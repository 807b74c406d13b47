"""R waves for the scheduler: from a list of times, or detected in a recorded ECG (sleepecg's Pan-Tompkins detector)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..errors import UserError
from ..extra import load
from ..files import FileError, read_whole
from ..model.units import UnitError, factor
from ..model.windkessel import R_WAVE_DURATION
from ..protocol import Protocol
from ..recordings.heading import name as plain
from ..recordings.heading import parts
from ..tabular import TableError, rows

LEADS = ("ecg", "ekg", "ii", "v", "mlii", "mcl1", "i", "iii", "v5")  # names of a column that is an ECG

# Set by theory: the detector passes 5 to 30 Hz. Check: `pytest tests/test_scheduler.py -k bad_ecgs`
LEAST_RATE = 60.0  # [Hz] of an ECG, and more than that

SLOWEST, FASTEST = 15.0, 250.0  # beats per minute that can be a heart's: 40 to 220, and half a tachycardia beyond


class HeartbeatError(UserError, ValueError):
    """An ECG or a list of R times that holds no usable beats."""


@dataclass(frozen=True)
class Ecg:
    """One lead: `signal` (any unit; NaN where the recording dropped out) at `rate` [Hz]."""

    signal: np.ndarray
    rate: float

    @property
    def duration(self) -> float:
        """Length of the recording [s]."""
        return float(self.signal.size / self.rate)


def r_waves(times: Sequence[float] | np.ndarray, stop: float) -> Protocol:
    """The signal `r_wave` for R waves at `times` [s]: 1 for 20 ms from each on, else 0, from 0 to `stop` [s]."""
    times = np.asarray(times, dtype=float)
    if times.size == 0:
        raise HeartbeatError("R waves: expected at least one time but was given none")
    if not np.all(np.isfinite(times)) or np.any(np.diff(times) <= 0):
        raise HeartbeatError("R waves: expected finite, ascending times in s")
    times = times[(times > 0) & (times < stop)]
    width = np.minimum(R_WAVE_DURATION, np.diff(times, append=stop) / 2)
    edges = np.column_stack([times, times, times + width, times + width]).ravel()
    levels = np.tile([0.0, 1.0, 1.0, 0.0], times.size)
    return Protocol.of([0.0, *edges, stop], r_wave=[0.0, *levels, 0.0])


def pace(times: Sequence[float] | np.ndarray, stop: float) -> Protocol:
    """The signal `pace` [Hz] that makes a paced ventricle beat at `times` [s]: 1 / RR from each R wave to the next.

    The first R wave is at time 0: the ventricle starts with it, as long before the first of `times` as that one is
    before the second.
    """
    given = np.array(times, dtype=float)
    if given.size < 2:
        raise HeartbeatError(f"pacing: expected at least 2 R waves but was given {given.size}")
    rates = 1 / np.diff(given, append=2 * given[-1] - given[-2])
    begins = given - given[0]
    inside = begins < stop
    marks = np.repeat(begins[inside], 2)[1:]
    return Protocol.of([*marks, stop], pace=list(np.repeat(rates[inside], 2)))


def detect(ecg: Ecg) -> np.ndarray:
    """Times [s] of the R waves in `ecg`; `HeartbeatError` where there are none, or none like a heart's.

    Dropouts (NaN) are bridged by straight lines, in which no beat is found.
    """
    finder = load("sleepecg.heartbeats", "ECG: finding beats", "ecg", ", or give R times")
    if ecg.rate <= LEAST_RATE:
        raise HeartbeatError(
            f"ECG: {ecg.rate:.3g} samples a second; expected more than {LEAST_RATE:g}, to find beats: is the unit of "
            "its time right? Else give R times"
        )
    signal = np.asarray(ecg.signal, dtype=float)
    if signal.ndim != 1 or signal.size < 2 * ecg.rate:
        raise HeartbeatError(f"ECG: expected one lead of at least 2 s but was given {signal.size / ecg.rate:.2f} s")
    good = np.isfinite(signal)
    if not good.any() or np.ptp(signal[good]) == 0:
        raise HeartbeatError("ECG: there are no beats in a signal that does not move; check the lead")
    filled = np.interp(np.arange(signal.size), np.flatnonzero(good), signal[good])
    found = np.array(finder.detect_heartbeats(filled, ecg.rate), dtype=np.intp)
    found = found[good[found]]
    _plausible(found.size, ecg.duration, "ECG", "check the lead")
    return np.asarray(found / ecg.rate, dtype=float)


def read_ecg(path: Path, lead: str | None = None) -> Ecg:
    """An ECG from a CSV file (`time [s],ecg [mV]`) or a WFDB record (`.hea` or `.dat`; needs the package wfdb).

    `lead` names the column or signal; by default it is the first signal of a record, and of a table the column named
    as a lead is, or in mV.
    """
    if path.suffix in (".hea", ".dat", ""):
        return _read_wfdb(path.with_suffix(""), lead)
    wanted = f"the columns 'time [s]' and '{lead or 'ecg'} [mV]'"
    try:
        table = rows(path)
    except TableError as problem:  # names the file itself
        raise HeartbeatError(str(problem)) from None
    if len(table) < 3:
        below = max(0, len(table) - 1)
        raise HeartbeatError(f"{path}: expected {wanted} and at least two rows of numbers below but found {below}")
    header = [parts(cell) for cell in table[0][1]]
    named = [name for name, _ in header]
    asked = [k for k, one in enumerate(header) if (one[0] == plain(lead) if lead else _is_lead(*one))]
    if "time" not in named or not asked:
        more = "; name the column of the ECG as the lead (--lead)" * (lead is None and len(header) > 1)
        raise HeartbeatError(f"{path}, line {table[0][0]}: expected {wanted} but found {', '.join(table[0][1])}{more}")
    places = named.index("time"), asked[0]
    try:
        second = factor(header[places[0]][1] or "s", "s")
    except UnitError as problem:
        raise HeartbeatError(f"{path}, line {table[0][0]}, column 'time': {problem}") from None
    read = [[_number(path, n, row[i] if i < len(row) else "") for n, row in table[1:]] for i in places]
    time, signal = _ascending(path, [n for n, _ in table[1:]], read[0]), np.array(read[1])
    return Ecg(signal, float((time.size - 1) / ((time[-1] - time[0]) * second)))


def _is_lead(name: str, unit: str) -> bool:
    """Whether a column is an ECG, by its name or as only an ECG is in millivolts."""
    return name in LEADS or unit in ("mV", "uV", "µV", "μV")


def _number(path: Path, line: int, cell: str) -> float:
    """A cell as a number, NaN where it is empty."""
    try:
        return float(cell or "nan")
    except ValueError:
        raise HeartbeatError(f"{path}, line {line}: expected a number but found {cell!r}") from None


def _ascending(path: Path, lines: Sequence[int], times: Sequence[float]) -> np.ndarray:
    """The times [s] of these lines as an array; `HeartbeatError` names the first that does not ascend."""
    back = np.flatnonzero(~(np.diff(times) > 0))
    if back.size:
        line, before, after = lines[back[0] + 1], times[back[0]], times[back[0] + 1]
        raise HeartbeatError(
            f"{path}, line {line}: expected ascending times but {after:g} s follows {before:g} s; sort the lines"
        )
    return np.array(times)


def read_r_times(path: Path) -> np.ndarray:
    """R times [s], one a line (what follows a comma is not read); `HeartbeatError` where they do not ascend."""
    try:
        lines = read_whole(path).decode("utf-8").splitlines()
    except FileError as problem:  # says all there is to say, and names the file
        raise HeartbeatError(str(problem)) from None
    except ValueError as problem:
        raise HeartbeatError(f"{path}: expected one R time [s] a line: {problem}") from None
    there = [i for i, line in enumerate(lines, 1) if line.strip()]
    times = _ascending(path, there, [_number(path, i, lines[i - 1].split(",")[0].strip()) for i in there])
    if times.size < 2:
        raise HeartbeatError(f"{path}: expected one R time [s] a line, at least two, but found {times.size}")
    _plausible(times.size, float(np.ptp(times)) * times.size / (times.size - 1), str(path), "check their unit, s")
    return times


def _plausible(beats: int, duration: float, what: str, advice: str) -> None:
    """`HeartbeatError` unless so many beats in `duration` [s] can be a heart's."""
    if beats < 2 or not SLOWEST / 2 <= 60 * beats / duration <= FASTEST:
        raise HeartbeatError(
            f"{what}: {beats} beats found in {duration:.1f} s; expected {SLOWEST:g} to {FASTEST:g} a minute; {advice}"
        )


def _read_wfdb(path: Path, lead: str | None) -> Ecg:
    if not path.with_suffix(".hea").is_file():
        raise HeartbeatError(f"{path}: cannot be read as a WFDB record: there is no file {path.with_suffix('.hea')}")
    wfdb = load("wfdb", f"{path}: reading WFDB records", "ecg", ", or convert to CSV")
    try:
        record = wfdb.rdrecord(str(path))
    except (OSError, ValueError, LookupError, TypeError, AttributeError) as problem:
        raise HeartbeatError(f"{path}: cannot be read as a WFDB record: {problem}") from None
    if lead is not None and lead not in record.sig_name:
        raise HeartbeatError(f"{path}: there is no lead {lead!r}; there are {', '.join(record.sig_name)}")
    place = record.sig_name.index(lead) if lead else 0
    return Ecg(np.asarray(record.p_signal[:, place], dtype=float), float(record.fs))
