"""The signatures of all effects of a plant: the residual that each leaves in the plant's standard experiments.

The plant is simulated with an effect at its usual size and without. The part of the difference that the plant's own
parameters would absorb in a fit is removed (linearised, with the weak prior of the fits and a sensor's usual noise).
Unknown start values are fitted too. Two effects look alike where their signatures are nearly parallel: the cosine
between them is near 1 or -1.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.cluster.hierarchy import leaves_list, linkage
from scipy.spatial.distance import squareform

from ...identify.fitting.cases import Case, Reading
from ...identify.fitting.compiled import Compiled
from ...identify.fitting.response import FINER, Response
from ...identify.study.study import PRIOR
from ...identify.threads import one_blas_thread, side_by_side
from ...kernel import Kernel, KernelError
from ...laws import seconds
from ...model.effect import Effect
from ...plants.plant import Plant
from ...protocol import Protocol
from ..scores.parameters import all_off, base_parameters
from .next_experiment import sweeps

# Set by judgement: pictures, by which nothing is decided. Check: `pytest tests/test_atlas.py`, `tubular-dea atlas`
ATLAS_SAMPLES = 6000  # [samples] of every experiment
ATLAS_NOISE = 3e-3  # [1] of an output's largest value: a sensor's usual noise, beside which the prior counts
BENCH_LENGTH = 60.0  # [1] times the plant's own usual time: experiments on a plant that declares none
TAKEN_UP = 0.01  # [1] of what an effect changes: what leaves less than this is taken up by the plant's own parameters

Progress = Callable[[str], None]


@dataclass(frozen=True)
class Signature:
    """The change that an effect at its usual size makes (rms), and the `residual` (N,) that a refit leaves of it.

    Both are relative to the outputs' largest values; `residual` is None where the model cannot be solved.
    """

    effect: Effect
    changed: float
    residual: np.ndarray | None

    @property
    def remains(self) -> float:
        """The rms of the residual, relative to the outputs' largest values."""
        return 0.0 if self.residual is None else float(np.sqrt(np.mean(self.residual**2)))

    @property
    def visible(self) -> bool:
        """Whether a residual remains that the plant's own parameters cannot absorb."""
        return self.remains > TAKEN_UP * self.changed > 0


@dataclass(frozen=True)
class Atlas:
    """The signatures of all effects in `cases` (N values; `base` without effects), similar ones next to each other.

    `scale` is the largest value of every output; residuals are in units of it. `cosines` (m, m) is of the effects.
    """

    plant: Plant
    names: list[str]
    cases: list[Case]
    base: np.ndarray
    scale: dict[str, float]
    effects: list[Signature]
    cosines: np.ndarray

    def parts(self) -> list[tuple[str, Case, Reading, slice]]:
        """Name of the experiment, case and reading of every stretch of the N values."""
        found, begin = [], 0
        for name, case in zip(self.names, self.cases, strict=True):
            for reading, part in zip(case.readings, case.parts, strict=True):
                found.append((name, case, reading, slice(begin + part.start, begin + part.stop)))
            begin += case.times.size
        return found


@one_blas_thread
def atlas(plant: Plant, tell: Progress = lambda what: None) -> Atlas:
    """The atlas of a plant; `tell` reports progress: 2 steps, and one for each effect."""
    tell("compile")
    compiled, protocols = Compiled(plant, [o.name for o in plant.outputs if o.required]), experiments(plant)
    cases = [_case(plant, protocol) for protocol in protocols.values()]
    values, kernels = plant.model.parameter_values(), compiled.scorers(())
    distinct = {id(kernel): kernel for kernel in kernels.values()}
    bases = dict(zip(distinct, side_by_side(lambda k: _Off.of(plant, k, cases), distinct.values()), strict=True))
    base = Response(compiled.kernel(), cases).outputs(values, FINER)
    scale = _largest(cases, base)
    unit = np.concatenate([np.full(r.times.size, scale[r.output] or 1.0) for case in cases for r in case.readings])
    tell("the plant's own parameters")
    own = _own(plant, compiled.kernel(), cases, values) / unit[:, None]

    def one(effect: Effect) -> Signature:
        tell(effect.id)
        try:
            changed = bases[id(kernels[effect.id])].changed(effect) / unit
        except KernelError:
            return Signature(effect, 0.0, None)
        return Signature(effect, float(np.sqrt(np.mean(changed**2))), _remaining(changed, own))

    found = side_by_side(one, plant.catalogue.values())
    ordered, cosines = _ordered(plant, found)
    return Atlas(plant, list(protocols), cases, np.concatenate(base), scale, ordered, cosines)


@dataclass(frozen=True)
class _Off:
    """A model with several effects, all off at `values`, and its outputs there."""

    response: Response
    values: dict[str, float]
    outputs: list[np.ndarray]

    @classmethod
    def of(cls, plant: Plant, kernel: Kernel, cases: Sequence[Case]) -> _Off:
        off = all_off(kernel.model.effects, plant.catalogue)
        values = plant.model.parameter_values() | off
        response = Response(kernel, cases)
        return cls(response, values, response.outputs_alone(values, FINER))

    def changed(self, effect: Effect) -> np.ndarray:
        """The change of the outputs (N,) by an effect at its usual size."""
        answers = self.response.outputs_alone(self.values | dict(effect.typical), FINER)
        return np.concatenate([a - b for a, b in zip(answers, self.outputs, strict=True)])


def _largest(cases: Sequence[Case], answers: Sequence[np.ndarray]) -> dict[str, float]:
    """The largest value of every output."""
    found: dict[str, float] = {}
    for case, answer in zip(cases, answers, strict=True):
        for reading, part in zip(case.readings, case.parts, strict=True):
            found[reading.output] = max(found.get(reading.output, 0.0), float(np.abs(answer[part]).max()))
    return found


def experiments(plant: Plant) -> dict[str, Protocol]:
    """The standard protocols of a plant; steps and sweeps of its inputs if it declares none."""
    if plant.standard is not None:
        return plant.standard()
    usual = {s.name: plant.quantity(s.name).nominal for s in plant.inputs}
    if plant.experiments is not None:
        return plant.experiments(usual)
    span = BENCH_LENGTH * seconds(plant.model)
    return sweeps(plant, usual, span, span / ATLAS_SAMPLES)


def _case(plant: Plant, protocol: Protocol) -> Case:
    times = np.linspace(protocol.time[0], protocol.time[-1], ATLAS_SAMPLES)
    return Case(protocol, tuple(Reading(o.name, times) for o in plant.outputs if o.required))


def _own(plant: Plant, kernel: Kernel, cases: Sequence[Case], values: Mapping[str, float]) -> np.ndarray:
    """The sensitivities (N, k) of the readings to the plant's own parameters, shared ones and those of each record."""
    shared, each = base_parameters(plant), list(plant.each_start)
    _, blocks = Response(kernel, cases).sensitivities(values, [*(f.name for f in shared), *each])
    columns = np.concatenate([block[:, : len(shared)] for block in blocks])
    columns *= [f.slope(values[f.name]) for f in shared]
    ends = np.cumsum([0, *(len(block) for block in blocks)])
    starts = np.zeros((ends[-1], len(each) * len(blocks)))
    for i, block in enumerate(blocks):
        mine = block[:, len(shared) :] * list(plant.each_start.values())
        starts[ends[i] : ends[i + 1], i * len(each) : (i + 1) * len(each)] = mine
    return np.concatenate([columns, starts], axis=1)


def _remaining(changed: np.ndarray, own: np.ndarray) -> np.ndarray:
    """The residual (N,) that a fit of the plant's own parameters leaves of a change."""
    information = own.T @ own / ATLAS_NOISE**2 + np.eye(own.shape[1]) / PRIOR**2
    return changed - own @ np.linalg.solve(information, own.T @ changed / ATLAS_NOISE**2)


def _ordered(plant: Plant, found: Sequence[Signature]) -> tuple[list[Signature], np.ndarray]:
    """Effects ordered by channel, and within it so that neighbours are alike (average linkage of the cosines)."""
    size = found[0].residual.size if found and found[0].residual is not None else 1
    columns = np.column_stack([np.zeros(size) if e.residual is None or not e.visible else e.residual for e in found])
    columns /= np.maximum(np.linalg.norm(columns, axis=0), 1e-300)
    cosines = columns.T @ columns
    places: list[int] = []
    for channel in plant.channels:
        group = [i for i, e in enumerate(found) if e.effect.channel == channel]
        there = [i for i in group if found[i].visible]
        if len(there) > 2:
            apart = np.clip(1 - np.abs(cosines[np.ix_(there, there)]), 0, 1)
            np.fill_diagonal(apart, 0)
            tree = linkage(squareform(apart, checks=False), "average", optimal_ordering=True)
            there = [there[i] for i in leaves_list(tree)]
        places += [*there, *(i for i in group if not found[i].visible)]
    return [found[i] for i in places], cosines[np.ix_(places, places)]
