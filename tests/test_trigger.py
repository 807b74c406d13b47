"""What a trigger says about the instants of edges: bounds on made-up edges."""

from __future__ import annotations

import numpy as np
import pytest

from tubular_dea.identify.inputs.edges import Edge
from tubular_dea.identify.inputs.trigger import _delay, triggered

TIME = 0.01 * np.arange(1000)
TURNS = (100, 300, 500)  # samples before the trigger rises


def trigger() -> np.ndarray:
    """Up for half a second after each of TURNS."""
    return np.sum([(np.arange(TIME.size) > n) & (np.arange(TIME.size) <= n + 50) for n in TURNS], axis=0).astype(float)


def rising(late: float, count: int = 3) -> list[Edge]:
    """Edges that a monitor saw within two samples, `late` [s] after the trigger."""
    return [
        Edge("voltage", TIME[n] + late + 0.01, TIME[n] + late, TIME[n] + late + 0.02, 0.0, 0.0, 5e3)
        for n in TURNS[:count]
    ]


@pytest.mark.parametrize(("late", "count", "tells"), [(0.02, 3, True), (0.02, 2, False), (0.035, 3, False)])
def test_a_trigger_tells_if_it_made_enough_edges_shortly_before(late: float, count: int, tells: bool) -> None:
    """A monitor with twice the trigger's uncertainty; an edge is made within 50 ms."""
    edges = rising(late, count)
    edges[0] = Edge("voltage", edges[0].time, edges[0].earliest, edges[0].latest - 0.01, 0.0, 0.0, 5e3)
    found = triggered(edges, TIME, trigger())
    assert (found != edges) is tells


def test_edges_that_come_alike_leave_the_delay_between_their_bounds() -> None:
    first = np.array([[0.0, 1.0], [10.0, 11.0], [20.0, 21.0]])
    assert _delay(first, first + 0.3) == pytest.approx((-0.7, 1.3))


def test_edges_that_come_at_any_part_of_a_sample_tell_the_mean_delay() -> None:
    first = np.array([[0.0, 1.0], [10.0, 11.0], [20.0, 21.0], [30.0, 31.0]])
    spread = np.array([-0.15, 0.15, -0.15, 0.15])  # of a sample: more than the tenth that is alike
    least, most = _delay(first, first + 0.3 + spread[:, None])
    assert (least, most) == pytest.approx((0.3 - 3 * 0.15 / 2, 0.3 + 3 * 0.15 / 2))  # three standard errors
    least, most = _delay(first, first + 0.3 + 0.6 * spread[:, None])
    assert (least, most) == pytest.approx((0.39 - 1, 0.21 + 1))
