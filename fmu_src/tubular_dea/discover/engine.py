"""From recordings to a verdict: the steps of the discovery, in their order."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from ..identify.data import Recordings
from ..identify.doubt import with_monitors
from ..identify.fit import Fit
from ..identify.problem import Problem
from ..identify.procedure import ordered_fit
from ..identify.threads import one_blas_thread
from ..model.dea import tubular_dea
from ..model.declare import Model
from . import acceptance, base, channels, equivalence, inputs_noise, next_experiment, numerics, residuals, selection
from .channels import Localisation
from .law_doubt import with_law, with_rivals
from .next_experiment import Proposal
from .options import Option
from .revision import Search
from .study import Study, study

SEED = 20240

Progress = Callable[[str], None]


@dataclass(frozen=True)
class Discovery:
    """All that was found, and how: what result.json and the report are made from."""

    recordings: Recordings
    study: Study
    verdict: str
    search: Search
    located: Localisation | None
    equivalent: dict[str, list[str]]
    tests_before: dict[str, float]
    tests_after: dict[str, float]
    numeric: float
    coloured: float
    held_ratio: float
    proposal: Proposal | None

    @property
    def base(self) -> Option:
        """The recalibrated base model."""
        return self.search.base

    @property
    def chosen(self) -> Option:
        """The model with the effects that were accepted."""
        return self.search.chosen


@one_blas_thread
def discover(recordings: Recordings, tell: Progress = lambda what: None, model: Model | None = None,
             seed: int = SEED) -> Discovery:  # fmt: skip
    """The discovery over some recordings of a tube; the same recordings and seed give the same result."""
    tell("monitors and noise")
    work = study(recordings, model or tubular_dea())
    tell("recalibrate the base model")
    work, fitted = _recalibrated(work, seed)
    numeric = numerics.numeric_gain(work, fitted.values)
    found = selection.search(work, fitted, numeric, seed, tell)
    fitted = found.base.fitted
    located = None
    if found.chosen.ids or not acceptance.clean(found.base.adequacy):
        tell("locate the residual")
        located = channels.localise(work, (), fitted, found.base.adequacy.excess)
    tell("verdict")
    held = _held_ratio(work, found.chosen)
    equivalent = equivalence.equivalents(found.chosen, found.rivals, found.gains)
    verdict = decide(found, held, equivalent)
    found.chosen = _described(work, found.chosen, _equals(found, equivalent))
    return Discovery(
        recordings, work, verdict, found, located, equivalent,
        residuals.tests(work, (), found.base.fitted), residuals.tests(work, found.chosen.ids, found.chosen.fitted),
        numeric, inputs_noise.coloured_rms(work, fitted.values), held,
        next_experiment.propose(work, _competitors(found, equivalent)),
    )  # fmt: skip


def decide(found: Search, held_ratio: float, equivalent: dict[str, list[str]]) -> str:
    """no_effect, effect_found, ambiguous or unexplained."""
    state, before = found.chosen.adequacy, found.base.adequacy
    if not found.chosen.ids:
        return "no_effect" if acceptance.clean(state) else "unexplained"
    if not acceptance.clean(state) and not acceptance.nearly(state, before, held_ratio):
        return "unexplained"
    return "ambiguous" if any(equivalent.values()) else "effect_found"


def _recalibrated(work: Study, seed: int) -> tuple[Study, Fit]:
    """The base fitted, then again with the weights that the monitors' noise asks for there."""
    first = base.recalibrate(work, seed=seed)
    weighted = work.weighted(inputs_noise.weights(work, first.values))
    return weighted, base.recalibrate(weighted, 1, seed, first.values)


def _described(work: Study, option: Option, rivals: Sequence[Option]) -> Option:
    """The option as it is reported: branches in order, intervals that count the monitors' noise and other laws."""

    def in_order(one: Option) -> tuple[Problem, Fit]:
        fixed = {n: v for n, v in one.fitted.values.items() if n not in one.fitted.names}
        problem = work.problem(one.ids, one.fitted.free, fixed)
        return problem, ordered_fit(problem, one.fitted)

    problem, fitted = in_order(option)
    doubtful = with_monitors(problem, fitted, [p.driven for p in work.training])
    doubtful = with_rivals(doubtful, [in_order(r)[1] for r in rivals])
    return replace(option, fitted=with_law(problem, option.ids, doubtful))


def _held_ratio(work: Study, chosen: Option) -> float:
    if not work.held_out:
        return 1.0
    return float((chosen.held_out / residuals.expected_squares(work, work.held_out)) ** 0.5)


def _equals(found: Search, equivalent: dict[str, list[str]]) -> list[Option]:
    """The rivals that would do in place of the chosen model."""
    return [r for r in found.rivals if any(i in names for names in equivalent.values() for i in r.ids)]


def _competitors(found: Search, equivalent: dict[str, list[str]]) -> list[Option]:
    """The chosen model and its equivalents; without any, the nearest rival, or the base."""
    nearest = _equals(found, equivalent) or found.rivals[:1] or ([found.base] if found.chosen.ids else [])
    if not nearest and found.rounds and found.rounds[-1].options:
        nearest = found.rounds[-1].options[:1]
    return [found.chosen, *nearest]
