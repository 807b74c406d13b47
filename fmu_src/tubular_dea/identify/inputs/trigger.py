"""Switching instants from a recorded trigger: often no better known than from the monitor.

A logical signal sampled together with the monitor changes between the same two samples. It tells more where the
amplifier follows it after a delay: an edge that comes `delay` after a trigger, which came between two samples, lies
between these moved by the delay, and between the two of its own. The delay is common to a record's edges of one
direction. It is known from how often it carries an edge past a sample, where that is so for some edges and not for
others: they then fall anywhere between samples, and the mean of the differences is the delay.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from .edges import Edge

# Set by judgement. Check: `pytest tests/test_trigger.py`,
# `python -m blind.score --nulls 12 --conventions edges trigger --seed 1000`
FEWEST = 3  # [1] edges that a delay is taken from at least
SURE = 3.0  # [standard errors] that the delay is off at most
TRIGGER_ALIKE = 0.1  # [samples] spread of edges after their triggers below which they tell no more of the delay
NEAR_TRIGGER = 0.05  # [s] from a trigger to the edge that it makes, at most


def triggered(edges: Sequence[Edge], time: np.ndarray, trigger: np.ndarray) -> list[Edge]:
    """The edges with what a trigger (n,) of two levels, of either polarity, says about them.

    Where no delay agrees with all of them, the trigger is independent of the edges and is not used.
    """
    turned = np.flatnonzero(np.diff(trigger) != 0)
    result = list(edges)
    for rising in (True, False):
        mine = [i for i, e in enumerate(edges) if (abs(e.high) > abs(e.low)) == rising]
        pairs = [(i, j) for i in mine if (j := _made_by(edges[i], time, turned)) is not None]
        if len(pairs) < FEWEST:
            continue
        first = np.array([(time[j], time[j + 1]) for _, j in pairs])
        own = np.array([(edges[i].earliest, edges[i].latest) for i, _ in pairs])
        least, most = _delay(first, own)
        if least > most:
            continue
        for (i, _), (begin, end) in zip(pairs, first, strict=True):
            earliest = max(edges[i].earliest, begin + least)
            latest = min(edges[i].latest, end + most)
            at = edges[i].time if edges[i].rise else (earliest + latest) / 2
            result[i] = replace(edges[i], time=float(np.clip(at, earliest, latest)), earliest=earliest, latest=latest)
    return result


def _delay(first: np.ndarray, own: np.ndarray) -> tuple[float, float]:
    """Bounds of the delay [s] from triggers between times `first` (m, 2) to edges between times `own` (m, 2)."""
    least, most = float(np.max(own[:, 0] - first[:, 1])), float(np.min(own[:, 1] - first[:, 0]))
    later = own.mean(axis=1) - first.mean(axis=1)
    spread = float(np.std(later))
    if spread < TRIGGER_ALIKE * float(np.mean(first[:, 1] - first[:, 0])):
        return least, most
    error = SURE * spread / float(np.sqrt(later.size))
    return max(least, float(later.mean()) - error), min(most, float(later.mean()) + error)


def _made_by(edge: Edge, time: np.ndarray, turned: np.ndarray) -> int | None:
    """The last sample before the trigger turned that made an edge: the latest one that may have."""
    before = turned[time[turned] <= edge.latest]
    return int(before[-1]) if before.size and edge.latest - time[before[-1]] < NEAR_TRIGGER else None
