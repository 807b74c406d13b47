"""Effects that a record cannot tell apart are one finding with several names.

Two effects are equivalent on a record if, both fitted in full, one explains it as well as the other: within what
chance gives, and within what the functional form of an effect may cost. The latter is a share of what the effect
explains, because no law in the catalogue is exactly the one in the tube.
"""

from __future__ import annotations

from collections.abc import Sequence

from .options import Option

CHANCE = 12.0  # difference of twice the log likelihood that chance explains
FORM_SHARE = 0.02  # of the gain that another functional form of the same effect may lose
WEAK_SHARE, WEAK = 0.5, 80.0  # the same where the gain is small, and the most it then may lose


def equivalents(base: Option, chosen: Option, rivals: Sequence[Option]) -> dict[str, list[str]]:
    """For every effect of `chosen`, the ids of those that would do in its place, best first."""
    gain = base.misfit - chosen.misfit
    reach = max(CHANCE, FORM_SHARE * gain, min(WEAK_SHARE * gain, WEAK))
    found: dict[str, list[str]] = {name: [] for name in chosen.ids}
    for rival in rivals:
        missing = [i for i in chosen.ids if i not in rival.ids]
        extra = [i for i in rival.ids if i not in chosen.ids]
        near = -2 * (rival.evidence - chosen.evidence) < reach
        if near and len(missing) == len(extra) == 1 and extra[0] not in found[missing[0]]:
            found[missing[0]].append(extra[0])
    return found
