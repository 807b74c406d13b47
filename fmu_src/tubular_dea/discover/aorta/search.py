"""One effect after another, while one convinces on every record.

An effect convinces if in every record it takes a tenth of the squared residual away, with positive evidence, and
predicts the last quarter better, which takes no part in any fit. Evidence counts independent samples: the residual's
correlation is taken into account by its effective number. Rivals that are hardly worse are as good: they are named
beside it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

from .candidates import CANDIDATES
from .fits import Fitted, Ids, fit_record
from .records import Record

LEAST_SHARE = 0.1  # of the squared residual that an effect has to take away, in every record
LEAST_EVIDENCE = 2.0  # log evidence in every record
TOLD_APART = 3.0  # log evidence, all records together, by which a rival has to be worse
MOST_EFFECTS = 2

Progress = Callable[[str], None]


@dataclass(frozen=True)
class Option:
    """Effects `ids` fitted to every record, and what the last of them brings over the model before it.

    `evidence` is the log evidence in each record; `taken` and `taken_held_out` are the shares of the squared residual
    that go away, in the record in which least does.
    """

    ids: Ids
    fits: list[Fitted]
    evidence: list[float]
    taken: float
    taken_held_out: float

    @property
    def convinces(self) -> bool:
        """Enough goes away in every record, with evidence in each, and something at every held-out end."""
        return self.taken >= LEAST_SHARE and self.taken_held_out > 0 and min(self.evidence) > LEAST_EVIDENCE


@dataclass(frozen=True)
class Round:
    """One effect more: all `options` over the model with `present` effects, the largest evidence first."""

    present: Ids
    options: list[Option]
    accepted: Option | None
    equivalent: list[str]


@dataclass
class Loop:
    """The search on all records: the windkessel of three elements, and the rounds."""

    base: list[Fitted]
    rounds: list[Round] = field(default_factory=list)

    @property
    def accepted(self) -> list[Round]:
        """The rounds that accepted an effect."""
        return [r for r in self.rounds if r.accepted]

    @property
    def after(self) -> list[Fitted]:
        """The fits with the accepted effects."""
        return next((r.accepted.fits for r in reversed(self.rounds) if r.accepted), self.base)

    @property
    def chosen(self) -> Ids:
        """The accepted effects in the order in which they were."""
        return self.after[0].effects


def search(records: Sequence[Record], tell: Progress = lambda what: None) -> Loop:
    """Accept effects while one convinces on every record."""
    tell("windkessel of three elements")
    loop = Loop([fit_record(r, ()) for r in records])
    for _ in range(MOST_EFFECTS):
        loop.rounds.append(_round(loop.after, tell))
        if not loop.rounds[-1].accepted:
            break
    return loop


def evidence(before: Fitted, after: Fitted) -> float:
    """Log evidence of one fit over another on the same record, in independent samples."""
    independent = before.independent()
    more = len(after.values) - len(before.values)
    return float(0.5 * independent * math.log(before.squares() / after.squares())
                 - 0.5 * more * math.log(max(independent, 2.0)))  # fmt: skip


def _round(before: list[Fitted], tell: Progress) -> Round:
    present, options = before[0].effects, []
    for name in CANDIDATES:
        if name not in present:
            tell(f"with {name}")
            options.append(_option(before, (*present, name)))
    options.sort(key=lambda o: -sum(o.evidence))
    convincing = [o for o in options if o.convinces]
    best = convincing[0] if convincing else None
    near = [o.ids[-1] for o in convincing[1:] if sum(o.evidence) > sum(convincing[0].evidence) - TOLD_APART]
    return Round(present, options, best, near)


def _option(before: list[Fitted], ids: Ids) -> Option:
    fits = [fit_record(f.record, ids, f.values) for f in before]
    pairs = list(zip(before, fits, strict=True))
    taken = [1 - max(b.squares(held) / a.squares(held) for a, b in pairs) for held in (False, True)]
    return Option(ids, fits, [evidence(a, b) for a, b in pairs], *taken)
