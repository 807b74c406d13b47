"""Options with the nuisance parameters that they make likely themselves: starts, zeros, switching instants, delays."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from ...identify.fitting.compiled import Ids
from ...identify.fitting.fit import AGREE, Fit, described, may_be_better
from ...identify.study.adjust import MOST_SETTLES, adjusted, with_starts_at
from ...identify.study.read_starts import begins_elsewhere, read_starts
from ...identify.study.study import Study, carried
from ...kernel import KernelError
from ..alternatives.zeros import impossible
from ..options.acceptance import clean
from ..options.options import Option, fitted_option, option, problem_of
from ..scores.parameters import declared_values, lost

# Set by measurement: without the charging of electrodes zeros of a laser were estimated to differ by 178 um, with it by
# 1.5, and the 30 um that all have in common show. Check: `pytest tests/test_settle.py -k common`
LESS_APART = 10.0  # [1] times by which files differ less with an option: what was estimated without it stood for it


def own_nuisances(study: Study, one: Option) -> tuple[Study, Option]:
    """An option with nuisance parameters as it makes them likely itself, and the study that has these.

    A start under load and the parameters that it is estimated with change together, in several steps. Where more than
    noise is left, parameters that a fit may lose (`Plant.restart`) begin once more at their declared values; where
    some are far from these, or a sensor would need a zero that none has, all begin there: two branches may have taken
    each other's place, and that of a viscosity, or zeros and a parameter that of friction, which is there by now.
    """
    tried = [iterated(study, one)]
    study, one = tried[0]
    if not clean(one.lack_of_fit) and study.plant.restart:
        again = fitted_option(study, one.ids, one.fitted.values | study.plant.restarts, one.refined)
        if again is not None and may_be_better(again.fitted, one.fitted):
            tried.append(iterated(study, again))
    if lost(study.plant, one.fitted) or (one.ids and impossible(study, one) is not None):
        tried += _begun_as_read(study, one, one.fitted.values | declared_values(study.plant, one.fitted))
    elif not clean(one.lack_of_fit) and begins_elsewhere(study, study.training):
        tried += _begun_as_read(study, one, one.fitted.values)
    return min(tried, key=lambda settled: settled[1].misfit)


def as_read(study: Study, ids: Ids) -> Study:
    """The study without the starts that were estimated: they belong to other parameters."""
    declared = study.plant.model.parameter_values()
    first = [{n: declared.get(n, 0.0) for n in study.unknown(ids, p)} for p in study.pieces]
    cases = [
        replace(p.case, own=dict(p.case.own) | own | read_starts(study.plant, p.case, p.record))
        for p, own in zip(study.pieces, first, strict=True)
    ]
    return replace(study, pieces=carried([replace(p, case=c) for p, c in zip(study.pieces, cases, strict=True)]))


def fit_as_declared(study: Study, fitted: Fit) -> Fit | None:
    """The base at its declared values, with its residual and columns there; None where it has no answer."""
    problem = study.problem((), fitted.free, {})
    try:
        return described(problem, problem.scaled(study.plant.model.parameter_values()))
    except KernelError:
        return None


def _begun_as_read(study: Study, one: Option, values: Mapping[str, float]) -> list[tuple[Study, Option]]:
    """The option fitted once more from `values`, with nuisance parameters as these make them likely; nothing where a
    model with both those and the effects has no answer."""
    try:
        begun = adjusted(as_read(study, one.ids), one.ids, values, one.fitted.free, started=False)
    except KernelError:
        return []
    again = fitted_option(begun, one.ids, values, one.refined)
    return [] if again is None else [iterated(begun, again)]


def iterated(study: Study, one: Option) -> tuple[Study, Option]:
    """An option and its nuisance parameters, each taken anew until the option gains no more.

    None are taken that fit it worse, but for the first time where it leaves more than noise, or nothing tells how much
    that is: then what it is settled with may stand for what it lacks. So it is where files seem to differ far less with
    the option than before: zeros that stood for its effect may have hidden another one.
    """
    complete = clean(one.lack_of_fit) and one.lack_of_fit.coloured == 1
    for turn in range(MOST_SETTLES):
        moved = adjusted(study, one.ids, one.fitted.values, one.fitted.free)
        again = fitted_option(moved, one.ids, one.fitted.values, one.refined)
        if again is None:
            break
        gained = again.gain_over(one)
        if gained < 0 and (turn or (complete and not _closer(study, moved))):
            break
        study, one = moved, again
        if abs(gained) < AGREE:
            break
    return _with_starts_where_it_ended(study, one)


def _with_starts_where_it_ended(study: Study, one: Option) -> tuple[Study, Option]:
    """An option with what unknown starts change where its fit ended: what they did where it began would make
    parameters that do nearly the same look determined."""
    if not any(study.unknown(one.ids, p) for p in study.pieces):
        return study, one
    there = with_starts_at(study, one.ids, one.fitted.values)
    fitted = described(problem_of(there, one), one.fitted.scaled, one.fitted.converged)
    return there, option(there, one.ids, fitted, one.refined)


def _closer(before: Study, after: Study) -> bool:
    """Whether zeros or gains of some monitor differ far less between files than was estimated before."""
    return any(spread < before.spread.get(name, 0.0) / LESS_APART for name, spread in after.spread.items())
