"""Laws: relations that may act at a place of any plant, one per file, found by its presence.

A place declares where something may act and its kind; a law declares what may act at places of a kind; `law(place)` is
a candidate, nested in the base model and off at a declared value. `python -m tubular_dea.plants` prints
an index of them.

A law file has a docstring (what it is, drawing, equation, source, usual sizes), `KINDS` (the kinds of places it acts
at), `NEEDS` (what it needs there, in words) and `law(site)`, its `Effect` at that place, or None where it makes
no sense. `_site.py` is what it reads there: unit, sizes, names; `taken` and `put` for signals, `added` for balances.
"""

from __future__ import annotations

from ..model.scales import moved_by, seconds, undefined
from .places import Balance, Coefficient, Path, Place, check, effects_at, kinds, laws

__all__ = [
    "Balance",
    "Coefficient",
    "Path",
    "Place",
    "check",
    "effects_at",
    "kinds",
    "laws",
    "moved_by",
    "seconds",
    "undefined",
]
