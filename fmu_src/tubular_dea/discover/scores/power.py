"""Detection limits: for every effect the smallest size that these recordings would have shown.

An effect of a size changes the whitened residual by c, of which c_p is left once everything that is fitted has taken
what it can: the model's parameters, zeros and gains, switching instants, delays and rises that files have in common.
|c_p|^2 is what the effect is expected to score. The detection limit is the size at which that exceeds what acceptance
asks of a score with a probability of POWER. For an effect with a share (a lag) the size is its time constant: the one
at which the whole effect would be detected. Sizes are sought from those that scores at "off" tell, by simulating the
effect as large as it would be: a short lag shows with the fourth power of its length, and a mass in the first ringing.
Where parameters have far to move to make up for it, what is left is taken from where they went (compensated.py). Where
instants, delays and rises take most of an effect, they do so by much more than their columns say, as they are estimated
anew: there they are estimated from recordings with the effect. A delay of what jumps is seen where some jump passes a
sample, and where between two samples an input switched is not known.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.special import ndtri

from ...identify.fitting.fit import Fit
from ...identify.study.adjust import adjusted, with_all_columns
from ...identify.study.common_nuisances import common_nuisances
from ...identify.study.study import Study
from ...identify.threads import side_by_side
from ...kernel import KernelError
from ...model.effect import Effect
from .bank import HIDDEN, Candidate, Point, candidates_at, is_late
from .compensated import Compensation, step_towards
from .parameters import all_off

# Set by convention (Cohen, "Statistical power analysis for the behavioral sciences", 1988).
# Check: `pytest tests/test_acceptance.py::test_what_would_have_been_seen_is_as_large_as_it_takes`
POWER = 0.8  # [1] share of records with an effect of that size in which it is seen

# Set by theory: what an effect scores grows with the square of its size, that of a short lag with the fourth power.
# Check: `pytest tests/test_rounds.py`
SLOWEST_GAIN = 2.0  # [1] power of the gain over a size beyond those that were simulated, at least
FASTEST_GAIN = 4.0  # [1] the same at most

# Set by judgement: what is scored grows as the power says after two sizes, and not at all where a level is not reached.
# Check: `python -m blind.limits --seed 500`
SIMULATED = 7  # [1] sizes at which an effect is simulated at most, each where those before say the limit is
NEARLY = 4.0  # [1] times by which what is scored there may differ from what is needed: the size by less than twice
UNCHANGED = 0.01  # [1] change of a score from one size to the next, that is none
FARTHEST_SIZE = 30.0  # [1] times by which a size may differ from the one before

# Set by measurement: of a delay of 2.5 ms of a sensor beside filtered monitors, columns leave 300 of 1092, and monitors
# that are estimated anew 248, 25, 17 and 16 after so many times. Check: `python -m blind.limits --seed 500`
TAKEN = 0.5  # [1] share of an effect that is left, below which what takes the rest is estimated anew
FOLLOWS = 3  # [1] times that it is

Sizes = dict[str, float | None]


@dataclass(frozen=True)
class Guess:
    """The size of an effect's parameter `name` that scores at "off" tell, at a `shape` of its grid; None for none.

    `growth` is -1 where the effect grows as that falls (a rate limit).
    """

    effect: Effect
    shape: dict[str, float]
    name: str
    size: float | None
    growth: float = 1.0

    def at(self, size: float) -> Point:
        """The effect at a size: its shape, and the strength at which the chord is taken."""
        if self.name in self.effect.shapes:  # the whole effect of that length
            share = next(n for n in self.effect.off if n in self.effect.on)
            return {**self.shape, self.name: size}, {share: self.effect.on[share] - self.effect.off[share]}
        side = np.sign(self.effect.typical[self.name] - self.effect.off[self.name]) or 1.0
        return self.shape, {self.name: float(side) * size}


def needed(threshold: float) -> float:
    """The score that an effect has to be expected to reach, so that it reaches `threshold` with a probability of
    POWER."""
    return float((np.sqrt(threshold) + ndtri(POWER)) ** 2)


def guesses(listed: Sequence[Candidate], jacobian: np.ndarray, least: float) -> list[Guess]:
    """The size of every effect that would score `least`, from the candidates at the present model with `jacobian`
    (N, k)."""
    basis, _ = np.linalg.qr(jacobian)
    found = []
    for effect in {c.effect.id: c.effect for c in listed}.values():
        tangents = [c for c in listed if c.effect.id == effect.id]
        statistics = [_left(c, basis) for c in tangents]
        best = _as_usual(effect, tangents, statistics)
        name, shape = tangents[best].names[0], tangents[best].shape
        if name in effect.on:
            name = next(iter(effect.shapes))
            size, growth = _length(name, tangents, statistics, least, effect.trades.get(name, 0.0))
        else:
            growth = 1.0
            size = float(np.sqrt(least / statistics[best])) if statistics[best] > 0 else None
        found.append(Guess(effect, shape, name, size, growth))
    return found


def _as_usual(effect: Effect, tangents: Sequence[Candidate], statistics: Sequence[float]) -> int:
    """Which of an effect's tangents is nearest to its usual shape; the most visible one where that does not show, and
    of shares, whose shape is sought."""
    most = int(np.argmax(statistics))
    if tangents[most].names[0] in effect.on or not tangents[most].shape:
        return most
    away = np.array([[abs(value - effect.typical[name]) for name, value in t.shape.items()] for t in tangents])
    usual = int(np.argmin(np.sum(away / np.maximum(away.max(axis=0), 1e-300), axis=1)))
    return usual if statistics[usual] > 0 else most


def detection_limits(study: Study, fitted: Fit, guessed: Sequence[Guess], least: float) -> dict[str, Sizes]:
    """The detection limit (SI) by effect and parameter; None where no size would have been detected.

    `fitted` is the model without effects, `least` the score that an effect has to be expected to reach.
    """
    common = common_nuisances(study, followed=True)
    basis, held = (np.linalg.qr(j)[0] for j in (common.beside(fitted.jacobian), fitted.jacobian))
    compensation = Compensation(study, fitted, common)
    searches = {g.effect.id: _SizeSearch(g, [g.size]) for g in guessed if g.size is not None}
    for _ in range(SIMULATED):
        sought = {name: s for name, s in searches.items() if not (s.ended or s.settled(least))}
        if not sought:
            break
        chords = compensation.of(*_chords(study, fitted, list(sought.values())))
        for name, search in sought.items():
            if name in chords:
                left = _left(replace(chords[name], columns=common.apply(chords[name].columns)), basis)
                search.scored(left, least, taken=left < TAKEN * _left(chords[name], held))
            else:  # the model has no answer there
                search.ended = True

    training = replace(study, pieces=study.training)
    if any(s.taken and not s.ended for s in searches.values()):
        known = with_all_columns(training, (), fitted.values)
        training = replace(training, pieces=[p or q for p, q in zip(known, study.training, strict=True)])

    def limit(guess: Guess) -> float | None:
        search = searches.get(guess.effect.id)
        if search is None:
            return None
        if search.taken and not search.ended:
            search = _SizeSearch(guess, [search.sizes[-1]], fewest=1)
            while len(search.scores) < SIMULATED and not search.settled(least):
                followed = _followed(training, fitted, guess, search.sizes[-1])
                if followed is None:
                    break
                search.scored(followed, least, taken=True)
        size = search.limit(least)
        return size if size is None else max(size, _passing(study, guess))

    return {g.effect.id: {g.name: size} for g, size in zip(guessed, side_by_side(limit, guessed), strict=True)}


def _passing(study: Study, guess: Guess) -> float:
    """The delay [s] with which one of the jumps, each anywhere between two samples, passes a sample with a probability
    of POWER; 0 for what is no delay of jumps."""
    if not is_late(study, guess.effect):
        return 0.0
    widths = [e.latest - e.earliest for p in study.training for e in p.driven.edges]
    return float(np.median(widths or [0.0]) * (1 - (1 - POWER) ** (1 / max(len(widths), 1))))


@dataclass
class _SizeSearch:
    """The sizes of an effect so far, the last of them not simulated yet, and what the others scored.

    `fewest` are simulated at least. `taken`: instants, delays and rises take most of it. `ended`: the model had no
    answer at the last size.
    """

    guess: Guess
    sizes: list[float]
    scores: list[float] = field(default_factory=list)
    fewest: int = 2
    taken: bool = False
    ended: bool = False

    def scored(self, score: float, least: float, taken: bool) -> None:
        """Take in what the last size scored, of which the rest of the fit has `taken` most or not."""
        self.scores.append(score)
        self.taken = taken
        self.sizes.append(_next(self.sizes, self.scores, least, self.guess.growth))

    def settled(self, least: float) -> bool:
        """Whether the last size that was simulated scored nearly what is needed, or as much as that before: where an
        effect is a little more than off however small it is."""
        if len(self.scores) < self.fewest:
            return False
        last, before = self.scores[-1], self.scores[-2:][0]
        unchanged = len(self.scores) > 1 and abs(last - before) < UNCHANGED * before
        return least / NEARLY <= last <= least * NEARLY or (last > least and unchanged)

    def limit(self, least: float) -> float | None:
        """Where `least` is scored; beside a jump of the score the smallest effect that was seen. None where none of the
        simulated sizes was, and the last of them changed nothing."""
        if self.settled(least):
            return _extrapolated(self.sizes, self.scores, least, self.guess.growth)
        seen, unseen = _between(self.sizes, self.scores, least, self.guess.growth)
        if seen is None and self.scores and self.scores[-1] <= 0:
            return None
        return seen if seen is not None and unseen is not None and not self.ended else self.sizes[-1]


def _chords(
    study: Study, fitted: Fit, searches: Sequence[_SizeSearch]
) -> tuple[dict[str, Candidate], dict[str, dict[str, float]]]:
    """What each effect changes at its present size, in one column, and its strength there, by id; without those that
    cannot be simulated."""
    asked = {s.guess.effect.id: s.guess.at(s.sizes[-1]) for s in searches}
    made = candidates_at(
        study, fitted.values, fitted.residual.size, points=lambda e: [asked[e.id]] if e.id in asked else []
    )
    strengths = {name: strength for name, (_, strength) in asked.items()}
    whole = {c.effect.id: next(iter(strengths[c.effect.id].values())) * c.columns[:, :1] for c in made}
    return {c.effect.id: replace(c, columns=whole[c.effect.id]) for c in made}, strengths


def _followed(training: Study, fitted: Fit, guess: Guess, size: float) -> float | None:
    """What an effect of that size scores in `training` once each record's own numbers are estimated from what it makes
    of them; None where it cannot be simulated."""
    shape, strength = guess.at(size)
    values = dict(fitted.values)
    kernel = training.compiled.scorers((), None)[guess.effect.id]
    off = all_off(kernel.model.effects, training.catalogue)
    effect = {n: guess.effect.off[n] + v for n, v in strength.items()}
    response = training.response((), training.pieces).by(kernel)
    try:
        read = response.outputs_alone(off | fitted.values | shape | effect)
        work = replace(training, pieces=[replace(p, record=r) for p, r in zip(training.pieces, read, strict=True)])
        for _ in range(FOLLOWS):
            work = adjusted(work, (), values, fitted.free)
        residual, jacobian = _linearised(work, fitted, values)
        step = step_towards(jacobian, residual, fitted.scaled.size, float(np.linalg.norm(residual)))
        if step is not None:
            problem = work.problem((), fitted.free, values)
            values = problem.values(problem.inside(problem.scaled(values) + step))
            work = adjusted(work, (), values, fitted.free)
            residual, jacobian = _linearised(work, fitted, values)
    except KernelError:
        return None
    column = Candidate(guess.effect, shape, (guess.name,), residual[:, None])
    return _left(column, np.linalg.qr(jacobian)[0])


def _linearised(work: Study, fitted: Fit, values: Mapping[str, float]) -> tuple[np.ndarray, np.ndarray]:
    """Residual and Jacobian of a study at `values` (SI), without the residual of the prior: it is about others."""
    problem = work.problem((), fitted.free, values)
    residual, jacobian = problem.linearised(problem.scaled(values))
    residual[sum(p.record.size for p in work.training) :] = 0.0
    return residual, jacobian


def _next(sizes: Sequence[float], scored: Sequence[float], least: float, growth: float) -> float:
    """Where `least` is scored, not beyond a size that scored more or less: halfway to it then."""
    guess = _extrapolated(sizes, scored, least, growth)
    seen, unseen = _between(sizes, scored, least, growth)
    if seen is None or unseen is None or min(seen, unseen) < guess < max(seen, unseen):
        return guess
    return float(np.sqrt(seen * unseen))


def _extrapolated(sizes: Sequence[float], scored: Sequence[float], least: float, growth: float) -> float:
    """Where `least` is scored, as a power of the size says from the last two that were; not far from the last."""
    if scored[-1] <= 0:
        return sizes[len(scored) - 1] * FARTHEST_SIZE**growth
    n, power = len(scored), growth * SLOWEST_GAIN
    if n > 1 and scored[-2] > 0 and sizes[n - 1] != sizes[n - 2]:
        power = float(np.log(scored[-1] / scored[-2]) / np.log(sizes[n - 1] / sizes[n - 2]))
    power = growth * float(np.clip(growth * power, SLOWEST_GAIN, FASTEST_GAIN))
    return sizes[n - 1] * float(np.clip((least / scored[-1]) ** (1 / power), 1 / FARTHEST_SIZE, FARTHEST_SIZE))


def _between(
    sizes: Sequence[float], scored: Sequence[float], least: float, growth: float
) -> tuple[float | None, float | None]:
    """The smallest effect among those that scored `least`, and the largest that did not; None where there is none."""
    tried = sorted(zip(sizes, scored, strict=False), key=lambda one: growth * one[0])
    seen = [size for size, score in tried if score >= least]
    unseen = [size for size, score in tried if score < least]
    return (seen[0] if seen else None), (unseen[-1] if unseen else None)


def _left(candidate: Candidate, basis: np.ndarray) -> float:
    """The expected score of a candidate's first column: what the `basis` of all that is fitted leaves of it."""
    column = candidate.columns[:, 0]
    left = column - basis @ (basis.T @ column)
    size = float(np.linalg.norm(left))
    return size**2 if size > HIDDEN * float(np.linalg.norm(column)) else 0.0


def _length(
    name: str, listed: Sequence[Candidate], statistics: Sequence[float], least: float, trade: float = 0.0
) -> tuple[float | None, float]:
    """The time constant `name` (or rate, or frequency) at which the whole effect would score `least`, and 1 if the
    effect grows with it or -1: as it does where it takes the place of a share (`trade`), or as its scores say.

    Of a lag longer than a record, other parameters take more than of a shorter one.
    """
    best: dict[float, float] = {}
    for candidate, statistic in zip(listed, statistics, strict=True):
        at = candidate.shape[name]
        best[at] = max(best.get(at, 0.0), statistic)
    lengths = np.array(sorted(best))
    levels = np.array([best[x] for x in lengths])
    if levels.max() <= 0:
        return None, 1.0
    x, y = np.log(lengths), np.log(np.maximum(levels, 1e-300))
    if trade < 0 or (not trade and y[0] > y[-1]):  # it grows as this falls (a rate limit): start from the other end
        x, y = -x[::-1], y[::-1]
        return float(np.exp(-_crossing(x, y, float(np.log(least))))), -1.0
    return float(np.exp(_crossing(x, y, float(np.log(least))))), 1.0


def _crossing(x: np.ndarray, y: np.ndarray, level: float) -> float:
    """Where y, which rises over x to its largest, reaches `level`; extrapolated linearly before the first point and
    from the largest on."""
    x, y = x[: int(np.argmax(y)) + 1], y[: int(np.argmax(y)) + 1]
    above = np.flatnonzero(y >= level)
    if not above.size:
        return float(x[-1] + (level - y[-1]) / SLOWEST_GAIN)
    i = int(above[0])
    if i == 0:
        slope = np.clip((y[1] - y[0]) / (x[1] - x[0]) if x.size > 1 else SLOWEST_GAIN, SLOWEST_GAIN, FASTEST_GAIN)
        return float(x[0] - (y[0] - level) / slope)
    return float(x[i - 1] + (level - y[i - 1]) * (x[i] - x[i - 1]) / (y[i] - y[i - 1]))
