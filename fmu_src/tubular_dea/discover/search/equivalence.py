"""Equivalence sets: effects that the recordings cannot distinguish are one finding with several names.

Two effects are equivalent if, both fully fitted, they explain the recordings equally well: within chance, and within
the cost of a slightly wrong functional form. The latter is a share of what the effect explains, because no law of the
catalogue is exactly that of the plant.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from ..options.acceptance import clean, far
from ..options.options import Option

# Set by judgement. Check: `pytest tests/test_acceptance.py`,
# `python -m blind.score --singles 2 --seed 1000`
CHANCE = 12.0  # [squared standard deviations] by which models differ by chance; an effect that gains less is dropped
FORM_SHARE = 0.02  # [1] share of the gain that another functional form of the same effect may lose
WEAK_SHARE = 0.6  # [1] the same where the gain is small
WEAK_MOST = 120.0  # [squared standard deviations] that it then may lose at most

# Set by judgement. Check: `pytest tests/test_acceptance.py`, `python -m measured.table`
ERROR_SHARE = 0.2  # [1] share of the misfit that says nothing, of a model whose own error is far above the noise

# Set by judgement: one that leaves noise alone has shown its form. Check: `pytest tests/test_acceptance.py -k form`
WORSE = 2.0  # [1] times the misfit of such an effect that another one may leave at most

# Set by judgement: one level of the mock loop gives the law that holds over levels 0.65 of the gain of the best one.
# Check: `pytest tests/test_operating_point.py`
ONE_POINT_SHARE = 0.5  # [1] share of the gain that another law may lose where records repeat and no law leaves noise


def form_share(chosen: Option, repeated: bool) -> float:
    """The share of an effect's gain that another one may lose and still be equivalent; `repeated`: see
    `operating_point`."""
    return ONE_POINT_SHARE if repeated and not clean(chosen.lack_of_fit) else FORM_SHARE


def stands_in(
    rival: Option, chosen: Option, gains: Mapping[str, float], form: float = FORM_SHARE
) -> tuple[str, str] | None:
    """The effect of `chosen` and the one of `rival` that is equivalent to it; None where there is none, or where it
    would have to be stronger than it can be.

    `gains` is by how much the misfit falls by each effect of `chosen`; another law may lose the share `form` of it.
    """
    missing = [i for i in chosen.ids if i not in rival.ids]
    extra = [i for i in rival.ids if i not in chosen.ids]
    if not len(missing) == len(extra) == 1 or extra[0] in rival.impossible:
        return None
    if clean(chosen.lack_of_fit) and rival.squares > WORSE * chosen.squares:
        return None
    apart = 2 * (chosen.evidence - rival.evidence)
    return (missing[0], extra[0]) if apart < told_apart(chosen, gains[missing[0]], form) else None


def told_apart(chosen: Option, gain: float, form: float = FORM_SHARE) -> float:
    """The difference in misfit from which on another effect is no equivalent of one of `chosen` that gains so much."""
    return max(CHANCE, form * gain, min(WEAK_SHARE * gain, WEAK_MOST), error_reach(chosen))


def error_reach(chosen: Option) -> float:
    """The difference in misfit that is not significant where a model is far from the plant: a share of its misfit."""
    return ERROR_SHARE * chosen.squares if far(chosen) else 0.0


def equivalents(
    chosen: Option, rivals: Sequence[Option], gains: Mapping[str, float], form: float = FORM_SHARE
) -> dict[str, list[str]]:
    """The ids of the effects that are equivalent to each effect of `chosen`, best first."""
    found: dict[str, list[str]] = {name: [] for name in chosen.ids}
    for pair in (stands_in(rival, chosen, gains, form) for rival in rivals):
        if pair and pair[1] not in found[pair[0]]:
            found[pair[0]].append(pair[1])
    return found


def in_its_place(chosen: Option, rivals: Sequence[Option], name: str, other: str) -> list[Option]:
    """The rivals that have the effect `other` in place of the effect `name` of the choice."""
    swapped = {*chosen.ids} - {name} | {other}
    return [r for r in rivals if {*r.ids} == swapped]


def beyond_chance(chosen: Option, rivals: Sequence[Option], name: str, other: str) -> bool:
    """Whether `other` in place of the effect `name` fits worse than chance makes it: it is equivalent only because no
    law is exactly that of the plant."""
    best = max((r.evidence for r in in_its_place(chosen, rivals, name, other)), default=chosen.evidence)
    return 2 * (chosen.evidence - best) > CHANCE
