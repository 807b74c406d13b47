"""Whether records repeat one course at one operating point, and what that leaves open: on made-up records."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from made_up import option
from tubular_dea.discover.alternatives.operating_point import repeats
from tubular_dea.discover.search import equivalence
from tubular_dea.identify.fitting.cases import Case, Reading
from tubular_dea.protocol import Protocol

TIME = np.arange(0.0, 20.0, 0.01)


def piece(drive: np.ndarray, level: float = 0.0, seed: int = 1) -> SimpleNamespace:
    """A record driven so, whose output follows about a level, with a little noise."""
    noise = np.random.default_rng(seed).standard_normal((2, TIME.size))
    case = Case(Protocol(TIME, {"flow": drive + 0.02 * noise[0]}), (Reading("pressure", TIME),))
    return SimpleNamespace(case=case, record=level + np.convolve(drive, np.ones(20) / 20, "same") + 0.02 * noise[1])


def beats(strength: float = 1.0, late: float = 0.0) -> np.ndarray:
    """A flow that comes in beats of 0.86 s."""
    return strength * np.maximum(np.sin(2 * np.pi * (TIME - late) / 0.86), 0.0)


def wander() -> np.ndarray:
    """A drive that never does the same again."""
    steps = np.random.default_rng(3).uniform(-1, 1, 41)
    return np.interp(TIME, np.arange(41) * 0.5, steps)


@pytest.mark.parametrize(
    ("pieces", "yes"),
    [
        ([piece(beats())], True),
        ([piece(beats(), seed=1), piece(beats(late=0.4), seed=2)], True),  # wherever a record begins
        ([piece(beats()), piece(beats(), level=1.0)], False),  # two levels of what is read
        ([piece(beats()), piece(beats(1.6))], False),  # and of what drives it
        ([piece(wander())], False),
    ],
)
def test_records_repeat_one_course(pieces: list, yes: bool) -> None:
    assert repeats(pieces) is yes


@pytest.mark.parametrize(
    ("repeated", "left", "equal"),
    [
        (True, 5000.0, True),  # it gains 25 000 where the choice gains 35 000
        (False, 5000.0, False),
        (True, 100.0, False),  # the choice leaves noise, which its rival does not
    ],
)
def test_at_one_operating_point_other_laws_are_equal(repeated: bool, left: float, equal: bool) -> None:
    chosen, rival = option("lag", excess=left), option("slew", excess=left + 10_000.0)
    form = equivalence.form_share(chosen, repeated)
    assert equivalence.equivalents(chosen, [rival], {"lag": 35_000.0}, form) == {"lag": ["slew"] if equal else []}
