"""Models with effects, compiled: each combination once, several at a time.

Compiling one model takes as long as several hundred thousand steps of the integrator. So for short records the
candidates of a round share a few kernels, all off except the requested ones. Where refits of long ones ask for
sensitivities again and again, every combination has a kernel. Effects with switching states, which shorten the
integrator's steps, are kept from the others, and so are delays, which add points to the inputs.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from functools import cached_property
from threading import Lock, Thread, main_thread

import sympy

from ...errors import UserError
from ...kernel import Kernel
from ...model.declare import Model, unchecked
from ...model.effect import Effect, added
from ...model.starts import loosened, unknowns
from ...plants.plant import Plant
from ..threads import side_by_side

Ids = tuple[str, ...]

# Set by measurement: a step costs 1.2 us in a library each, 2.0 us with six and 6.8 us with all thirty of the tube's in
# one; compiling them all takes 35, 8.5 and 4.3 s on one core. Two of fifteen take no longer than one of thirty, and can
# be compiled side by side; of a plant with 119 effects a round beside a friction takes 5 s with fifteen and 17 s with
# all in one. Check: `python tests/benchmarks/scoring.py`
SHARED = 6  # [1] effects in one library for scores
BESIDE_FOUND = 15  # [1] the same beside effects that were found, for which each other find needs a library of its own

# Set by measurement: of the silverbox's six laws that switch, a trajectory of 1000 samples takes 22 ms in a library of
# all nine that are lively and the 22 without dynamics, 18 with these six alone, 6.5 with three; three delays 1 ms.
# Check: `python tests/benchmarks/first_run.py`
SWITCHING = 3  # [1] effects that switch, in one library for scores on short records

# Set by measurement: of a tube under load (14 000 samples) residuals and their derivatives take 150 to 170 ms where six
# effects with dynamics share a kernel and 50 to 100 where those without share one, 15 to 25 in one each, and a refit
# needs 20 to 40; to compile one takes a second, once. Check: `python tests/benchmarks/first_run.py`
SHORT_POINTS = 5_000  # [1] samples (or points of inputs) up to which refits share kernels

# Set by measurement: of the tanks a trajectory of 1023 steps takes 0.4 ms with one law in the kernel and 0.8 with all
# 32 that have no dynamics, its sensitivities 0.7 and 2.6; to compile either takes 0.5 s. With all 38 of the silverbox,
# the 344 000 points of one record took 3.2 s and not 0.05. Check: `python -m measured.table`
FEW_POINTS = 20_000  # [1] the same up to which scores do so by kind
MANY_POINTS = 100_000  # [1] the same from which on laws that switch are scored alone

# Own dynamics of an effect: none, linear, a delay, else.
STILL, CALM, DELAYED, LIVELY = "still", "calm", "delayed", "lively"


class Compiled:
    """Kernels of a plant's model with effects added, in the order of its catalogue."""

    def __init__(
        self, plant: Plant, outputs: Sequence[str] = (), points: float = math.nan, loose: bool = False
    ) -> None:
        """`outputs` are those that were recorded, and are differentiated (default: all); `points` are the samples of
        all records together. `loose`: what effects remember at the start of a record is unknown, too."""
        self.plant = plant
        self.loose = loose
        self._outputs = list(outputs) or [o.name for o in plant.outputs]
        self.base = plant.model
        self.catalogue = plant.catalogue
        self._place = {name: i for i, name in enumerate(self.catalogue)}
        self._short = points <= SHORT_POINTS
        self._few, self._many = points <= FEW_POINTS, points >= MANY_POINTS
        self._kernels: dict[Ids, Kernel] = {}
        self._gathered: list[Ids] = []
        self._unknown: dict[Ids, dict[str, float]] = {}
        self._locks: defaultdict[Ids, Lock] = defaultdict(Lock)

    def model(self, ids: Iterable[str], *more: Effect) -> Model:
        """The model with the effects `ids` of the catalogue and `more`, all off."""
        model = added(self.base, [*(self.catalogue[name] for name in self._ordered(ids)), *more])
        return loosened(model) if self.loose else model

    def unknown(self, ids: Ids) -> dict[str, float]:
        """The parameters of an unknown start of the model with the effects `ids`, with their usual sizes (SI)."""
        if ids not in self._unknown:
            self._unknown[ids] = unknowns(self.model(ids))
        return self._unknown[ids]

    def gather(self, present: Ids, names: Iterable[str]) -> None:
        """Let models with one of `names` beside `present` share kernels from now on, where records are short."""
        if not self._short:
            return
        wanted = {*names}
        still, calm = (tuple(n for n in self._of(kind) if n in wanted) for kind in (STILL, CALM))
        groups = [self._ordered((*present, *group)) for group in (still, *_cut(calm, SHARED)) if group]
        self._gathered += groups
        side_by_side(self._compiled, groups)

    def kernel(self, ids: Iterable[str] = (), *more: Effect) -> Kernel:
        """A compiled model that has the effects `ids` of the catalogue and `more`, and what was gathered with them."""
        names = self._ordered(ids)
        if not names or more:
            return self._compiled(names, *more)
        return self._compiled(min((g for g in self._gathered if {*names} <= {*g}), key=len, default=names))

    def _compiled(self, names: Ids, *more: Effect, differentiated: bool = True) -> Kernel:
        key = (*names, *(e.id for e in more))
        with self._locks[key]:
            if key not in self._kernels:
                self._kernels[key] = Kernel(self.model(names, *more), self._outputs, differentiated)
        return self._kernels[key]

    def _scorer(self, names: Ids, *more: Effect) -> Kernel:
        """A kernel for scores, which are differences: few of them are ever asked for sensitivities."""
        return self._compiled(names, *more, differentiated=False)

    def scorers(self, present: Ids, effects: Sequence[Effect] | None = None) -> dict[str, Kernel]:
        """A compiled model with each candidate in addition to `present`, by the candidate's id.

        The catalogue's effects (`effects` None) share libraries: SHARED a library, BESIDE_FOUND where effects are
        present, and of short records all of a kind where it has no dynamics. Other effects have one each.
        """
        if effects is not None:
            made = side_by_side(lambda effect: self._scorer(self._ordered(present), effect), effects)
            return {effect.id: kernel for effect, kernel in zip(effects, made, strict=True)}
        groups = self._groups(present)
        named = [self._ordered((*present, *group)) for group in groups]
        if self._short and self._of(STILL):
            self._gathered.append(named[0])  # it has all without dynamics beside those present
        kernels = side_by_side(self._scorer, named)
        return {name: kernel for group, kernel in zip(groups, kernels, strict=True) for name in group}

    def begin(self) -> None:
        """Compile the base, and what the first scores of the catalogue will need, beside what the caller does until
        then: they are in the cache, for any other of these."""
        Thread(target=self._ahead, args=[lambda: [()]]).start()
        Thread(target=self._ahead, args=[lambda: self._groups(())]).start()

    def _ahead(self, wanted: Callable[[], Iterable[Ids]]) -> None:
        with suppress(UserError):  # whoever asks for the kernel meets the same
            for names in wanted():
                if main_thread().is_alive():  # else the program has ended, early
                    self._compiled(names, differentiated=not names)

    def _groups(self, present: Ids) -> list[Ids]:
        """The catalogue's effects in groups that share a library for scores."""
        names = list(self.catalogue)
        if self._few:
            still, delayed = ([g] if g else [] for g in (self._of(STILL), self._of(DELAYED)))
            return [*still, *delayed, *_cut(self._of(CALM), SHARED), *_cut(self._of(LIVELY), SWITCHING)]
        lively = [n for n in names if self.kinds[n] in (DELAYED, LIVELY)]
        calm = [n for n in names if n not in lively]
        size = BESIDE_FOUND if present else SHARED
        return [*_cut(calm, size), *_cut(lively, 1 if self._many else size)]

    def _of(self, kind: str) -> Ids:
        """The catalogue's effects of a kind."""
        return tuple(n for n in self.catalogue if self.kinds[n] == kind)

    @cached_property
    def kinds(self) -> dict[str, str]:
        """The kind of own dynamics of every effect of the catalogue."""
        return {name: self._kind(effect) for name, effect in self.catalogue.items()}

    def _kind(self, effect: Effect) -> str:
        """A state is calm whose own rate is a number."""
        with unchecked():
            model = effect(self.base)
        fixed = {p.quantity.symbol for p in model.parameters}
        own = model.states[len(self.base.states) :]
        if len(model.delays) > len(self.base.delays):
            return DELAYED
        calm = all(_linear(sympy.sympify(s.derivative), s.quantity.symbol, fixed) for s in own)
        return (CALM if calm else LIVELY) if own else STILL

    def _ordered(self, ids: Iterable[str]) -> Ids:
        return tuple(sorted({*ids}, key=self._place.__getitem__))


def _linear(expression: sympy.Expr, symbol: sympy.Symbol, fixed: set[sympy.Symbol]) -> bool:
    """Whether an expression is written as linear in a symbol, by a factor of numbers and `fixed` symbols."""
    holding = [a for a in expression.args if symbol in a.free_symbols]
    if expression == symbol or not holding:
        return True
    others = {s for a in expression.args if a not in holding for s in a.free_symbols}
    alone = expression.is_Add or (expression.is_Mul and len(holding) == 1 and others <= fixed)
    return alone and all(_linear(a, symbol, fixed) for a in holding)


def _cut(names: Sequence[str], size: int) -> list[Ids]:
    """The names in groups of a size."""
    return [tuple(names[i : i + size]) for i in range(0, len(names), size)]
