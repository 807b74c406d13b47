"""The base model refitted together with the records' own numbers: zeros, starts, switching instants, delays, noise."""

from __future__ import annotations

from dataclasses import replace

from ..identify.fitting.fit import AGREE, Fit
from ..identify.study.adjust import MOST_SETTLES, SETTLES, adjusted
from ..identify.study.noise_limit import with_noise_of
from ..identify.study.study import Piece, Study
from .alternatives import input_noise
from .options import base
from .options.options import option
from .scores.parameters import base_parameters
from .search.settle import iterated

# Set by judgement. Check: `python -m blind.score --nulls 12 --conventions antialias edges --seed 1000`
SAME_DELAY = 0.04  # [samples] up to which delays of monitors have settled


def recalibrated(work: Study, seed: int, chosen: bool) -> tuple[Study, Fit]:
    """The base fitted, and refitted with nuisance parameters estimated and samples weighted for the monitors' noise.

    `chosen`: the held-out experiments are not the user's choice. Those at which the base then has no answer (a start
    beyond its fold) take part in the fit.
    """
    if any(work.unknown((), p) for p in work.pieces):
        # A fit needs a first estimate of where the plant starts. The declared values are passed whole, with the switch
        # of the start: without it the base of lab-4 ends in a wrong optimum.
        work = adjusted(work, (), work.plant.model.parameter_values(), base_parameters(work.plant), started=False)
    fitted = base.recalibrate(work, seed=seed)
    if chosen and (fewer := _with_those_followed(work, fitted)) is not None:
        work, fitted = fewer, base.recalibrate(fewer, seed=seed)
    work, fitted = base_settled(work, fitted, seed)
    if chosen and (fewer := _with_those_followed(work, fitted)) is not None:
        work, fitted = base_settled(fewer, base.recalibrate(fewer, 1, seed, fitted.values), seed)
    lost = base.elsewhere(work, fitted)
    if lost is not None:
        moved, again = iterated(work, option(work, (), lost))
        if again.fitted.cost < fitted.cost - AGREE:
            return base_settled(moved, again.fitted, seed)
    return work, fitted


def base_settled(work: Study, fitted: Fit, seed: int) -> tuple[Study, Fit]:
    """The base and the records' own numbers, each taken anew at the other: until delays of monitors have settled, then
    until the base gains no more. At a low sampling rate, instants and viscosities follow each other slowly."""
    for number in range(MOST_SETTLES):
        before = work.delays
        work = replace(with_noise_of(work, fitted), remembering=True)
        work = adjusted(work, (), fitted.values, base_parameters(work.plant))
        if number == 0:
            work = input_noise.bounded_by_outputs(work, fitted.values)
        sensitivities = input_noise.input_sensitivities(work, fitted.values)
        work = input_noise.weighted(input_noise.told_by_outputs(work, fitted.values, sensitivities), sensitivities)
        fitted = base.recalibrate(work, 1, seed, fitted.values)
        moved = max((abs(by - before.get(name, 0.0)) for name, by in work.delays.items()), default=0.0)
        if number + 1 >= SETTLES and moved < SAME_DELAY:
            break
    work, last = iterated(work, option(work, (), fitted))
    return work, last.fitted


def _with_those_followed(work: Study, fitted: Fit) -> Study | None:
    """The study with only those held out at which the base has an answer; None where it has one at all of them."""
    followed = [not p.held_out or _follows(work, fitted, p) for p in work.pieces]
    if all(followed):
        return None
    return replace(
        work, pieces=[replace(p, held_out=p.held_out and f) for p, f in zip(work.pieces, followed, strict=True)]
    )


def _follows(work: Study, fitted: Fit, piece: Piece) -> bool:
    """Whether the base model has an answer at a piece."""
    return work.asked((), [piece.case]).possible(work.shared(fitted.values))[0] is not None
