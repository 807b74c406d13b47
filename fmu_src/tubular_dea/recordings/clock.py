"""Times as clocks write them: 13:07:30.234, 1:07:30,234 PM, 2020-12-02T13:07:30.234Z, 02.12.2020 13:07:30."""

from __future__ import annotations

import datetime
import re
from collections.abc import Sequence

import numpy as np

DAY = 86400.0
_TIME = r"(?:(?P<h>\d{1,3}):)?(?P<m>\d{1,2}):(?P<s>\d{1,2}(?:[.,]\d*|:\d{3})?)\s*(?P<half>[AaPp]\.?[Mm]\.?)?"
_DATE = r"\d{1,4}(?P<mark>[-./])\d{1,2}(?P=mark)\d{1,4}"
_ZONE = r"\s*(?:Z|UTC|GMT|[-+]\d\d:?\d\d)?"
_CLOCK = re.compile(rf"(?:(?P<date>{_DATE})\.?(?:T|,?\s+))?{_TIME}{_ZONE}")
DATE = re.compile(_DATE)


def is_clock(cell: str) -> bool:
    """Whether a cell is a time of day, with or without a date."""
    return ":" in cell and _CLOCK.fullmatch(cell) is not None


def seconds(cells: Sequence[str], missing: Sequence[bool]) -> np.ndarray:
    """Seconds since the midnight before the first cell; NaN where a cell is missing or is no time.

    A time without a date that falls back by more than half a day has passed midnight. Years come first or last in a
    date; where days and months are ambiguous, the next date is the next day.
    """
    times, days = np.full(len(cells), np.nan), np.zeros(len(cells))
    dates: dict[str, int] = {}
    for i, cell in enumerate(cells):
        match = None if missing[i] else _CLOCK.fullmatch(cell)
        if match is None:
            continue
        times[i] = _of_day(match)
        if match["date"]:
            if match["date"] not in dates:
                dates[match["date"]] = _day(match["date"], len(dates))
            days[i] = dates[match["date"]]
    times += DAY * (days - (min(dates.values()) if dates else 0))
    there = np.flatnonzero(np.isfinite(times))
    if not dates and there.size:
        passed = np.append(False, np.diff(times[there]) < -DAY / 2)
        times[there] += DAY * np.cumsum(passed)
    return times


def _of_day(match: re.Match[str]) -> float:
    hours, whole = int(match["h"] or 0), match["s"].replace(",", ".").replace(":", ".")
    if match["half"]:
        hours = hours % 12 + (12 if match["half"][0] in "Pp" else 0)
    return 3600.0 * hours + 60.0 * int(match["m"]) + float(whole)


def _day(date: str, following: int) -> int:
    """A number of the day: the calendar's where the year stands first, or the next one where dates are ambiguous."""
    parts = [int(part) for part in re.split(r"[-./]", date)]
    try:
        if parts[0] > 31:
            return datetime.date(parts[0], parts[1], parts[2]).toordinal()
    except ValueError:
        pass
    return following
