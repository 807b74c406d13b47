"""A verdict keeps a law that is there: one of each kind of place; `python -m blind.laws` has them all."""

from __future__ import annotations

import pytest

from blind.laws import answer
from test_laws import PLACES, at


@pytest.mark.long
@pytest.mark.parametrize(
    ("plant", "law"), [("oscillator", "quadratic_drag(v)"), ("oscillator", "dependence(c)"), ("tanks", "power(level)")]
)
def test_a_law_is_named(plant: str, law: str) -> None:
    (effect,) = (e for i in range(len(PLACES[plant][1])) for e in at(plant, i) if e.id == law)
    said, found = answer(plant, effect)
    assert said == "named", found.to_pandas()
