"""The check of numerical errors: no effect may be named for what a tighter tolerance changes in the answers."""

from __future__ import annotations

from collections.abc import Mapping

from ...identify.study.study import Study

# Set by judgement. Check: `python -m blind.score --nulls 60 --seed 1000`
NUMERIC_MARGIN = 4.0  # [1] times what a halved tolerance changes (sum of squares) that no effect may explain


def numeric_gain(study: Study, values: Mapping[str, float]) -> float:
    """The gain (sum of squares in units of the noise) that the change under a halved tolerance may cause.

    An effect with a smaller gain is not named.
    """
    return NUMERIC_MARGIN * study.problem((), [], values).numerical_error(finer=2)
