"""Which sizes of a named effect the recordings determine."""

from __future__ import annotations

from collections.abc import Sequence

from ...model.effect import Effect

# Set by judgement. Check: `pytest tests/test_report_words.py -k determined`
SPANS = 100.0  # [1] times by which an interval's far end may be the near one, for a size that is told


def determined(effect: Effect, name: str, ends: Sequence[float | None]) -> bool:
    """Whether an interval tells a parameter: it neither includes the value without effect nor spans a large factor.

    A level may be at 0, and of an end that is open a remark tells what is known.
    """
    low, high = ends
    if low is None or high is None or name in effect.levels:
        return low is not None or high is not None
    off = effect.off.get(name, 0.0)
    near, far = sorted((abs(low - off), abs(high - off)))
    return (low - off) * (high - off) > 0 and far <= SPANS * near
