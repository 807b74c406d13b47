"""A start under load, taken as an equilibrium where that and an effect explain more than states of its own.

States that are estimated at the start of every file can follow what a slow effect does there, such as a drift or
creep: nothing is left then, and nothing is found. Whether they do cannot be told from a file. Together with the effect
it can: a plant that rested under its first load explains the same with less.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from ...identify.records.experiment import UNKNOWN, Recordings
from ...identify.study.study import Study


def started_at_equilibrium(prepared: Study, held_out: Sequence[str], recordings: Recordings) -> Study | None:
    """The study as `prepared` for fits, from an equilibrium wherever a start was found to be under load and bench.toml
    does not say what it is; None where there is no such start. `held_out` are the names of the pieces held out."""
    begun = {e.name: recordings.begun_by(e) for e in recordings.experiments}
    open_to = {name for name, e in begun.items() if e.start == UNKNOWN and not e.start_said}
    if not open_to:
        return None
    return replace(
        prepared,
        pieces=[
            replace(p, loose=p.loose and p.source not in open_to, held_out=p.name in held_out) for p in prepared.pieces
        ],
    )
