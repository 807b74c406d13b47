"""The vocabulary of the reader of recordings, as tables for the page: units, missing values, names of time."""

from __future__ import annotations

from typing import Any

from ..identify.records import checks, columns, labels, start
from ..identify.signals import monitors, sampling
from ..model import units
from ..recordings import cells, layout, table, text


def vocabulary() -> dict[str, Any]:
    """What `recordings` and `identify` compare with; the page's reader has no lists of its own."""
    return {
        "units": {name: [u.factor, list(u.exponents), u.offset] for name, u in units._NAMED.items()},
        "alsoUnits": dict(units._ALSO),
        "joinedUnits": dict(units._JOINED),
        "signs": {chr(code): mark or "" for code, mark in units._SIGNS.items()},
        "alsoTime": list(columns.ALSO_TIME),
        "sizes": {"atRest": columns.AT_REST, "grown": columns.GROWN, "changed": columns.CHANGED},
        "missing": sorted(cells.MISSING),
        "truth": dict(cells.TRUTH),
        "sample": layout.SAMPLE,
        "least": text.LEAST,
        "prose": text.PROSE,
        "quoted": text.QUOTED,
        "often": text.OFTEN,
        "few": table.FEW,
        "standstill": checks.STANDSTILL,
        "air": list(checks.AIR),
        "lively": checks.LIVELY,
        "saturated": checks.SATURATED,
        "band": checks.AT_STOP,
        "away": checks.AWAY,
        "quieter": checks.QUIETER,
        "order": checks.HIGH_ORDER,
        "smooth": checks.SMOOTHED_OUT,
        "coarse": checks.COARSE_SENSOR,
        "structure": checks.STRUCTURE,
        "quiet": monitors.QUIET,
        "uneven": sampling.UNEVEN,
        "rounded": sampling.ROUNDED,
        "whole": sampling.WHOLE,
        "labels": {
            "usual": {si: list(names) for si, names in labels.USUAL.items()},
            "told": labels.MOST_TOLD,
            "fromUsual": labels.FROM_USUAL,
        },
        "first": start.FIRST_SAMPLES,
        "clearly": start.CLEARLY,
        "zeros": start.ZEROS,
        "faint": start.FAINT_SIGNAL,
    }
