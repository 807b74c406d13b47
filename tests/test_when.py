"""When the model misses the records: told where most of it is in a few short stretches."""

from __future__ import annotations

import numpy as np
import pytest

from tubular_dea.discover.answer.when import _marked

RANDOM = np.random.default_rng(5)
NOISE = [RANDOM.standard_normal(n) ** 2 for n in (4000, 6000)]


def test_what_happened_for_a_moment_is_where_it_was() -> None:
    squares = [s.copy() for s in NOISE]
    squares[1][2500:2800] += 25.0  # a supply that tripped for 300 samples
    quiet, tripped = _marked(squares)
    assert not quiet.any()
    there = np.flatnonzero(tripped)
    assert 2450 <= there[0] < there[-1] <= 2850
    assert there.size >= 150


@pytest.mark.parametrize("added", [0.0, 5.0], ids=["noise alone", "everywhere"])
def test_nothing_is_told_where_nothing_stands_out(added: float) -> None:
    assert not any(m.any() for m in _marked([s + added for s in NOISE]))
