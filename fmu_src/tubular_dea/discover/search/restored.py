"""The effects that make a strained base plausible: what it lacks may hide in its parameters.

A tube with a third branch of 25 s is followed by one with two to within the noise of five files that begin under load,
the slower of which has become the third: 100 times as viscous as declared.
"""

from __future__ import annotations

from collections.abc import Sequence

from ...identify.study.study import Study
from ...kernel import KernelError
from ..options.options import Option
from ..scores.parameters import implausible
from .declared import begun_as_declared
from .equivalence import CHANCE


def restored(study: Study, base: Option, strained: Sequence[str]) -> dict[str, list[str]]:
    """The effects, best first, that explain as much as the base, which has none, and which of its `strained` parameters
    are plausible with each, where no others are not. All begin at the declared values."""
    try:
        tried = [one for _, one in begun_as_declared(study, base)]
    except KernelError:  # the model has no answer at its declared values
        return {}
    return restoring(study, [o for o in tried if o.misfit < base.misfit + CHANCE], strained)


def restoring(study: Study, tried: Sequence[Option], strained: Sequence[str]) -> dict[str, list[str]]:
    """The last effects of those options that explain most, best first, and which of the `strained` parameters are
    plausible with each, where no others are not."""
    left = {o.ids[-1]: implausible(study.plant, o.fitted) for o in tried}
    good = [o for o in tried if not o.impossible and {*left[o.ids[-1]]} < {*strained}]
    least = min((o.misfit for o in good), default=0.0)
    near = sorted((o for o in good if o.misfit < least + CHANCE), key=lambda o: o.misfit)
    return {o.ids[-1]: [n for n in strained if n not in left[o.ids[-1]]] for o in near}
