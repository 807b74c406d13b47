"""Models with effects, compiled: each combination once, several at a time."""

from __future__ import annotations

from collections.abc import Iterable

from ..identify.threads import side_by_side
from ..kernel import Kernel
from ..model.declare import Model
from ..model.effects import Effect, catalogue

Ids = tuple[str, ...]


class Compiled:
    """Kernels of `base` with effects added, by the tuple of their ids in the order they were found."""

    def __init__(self, base: Model) -> None:
        self.base = base
        self._kernels: dict[Ids, Kernel] = {}

    def model(self, ids: Ids, *more: Effect) -> Model:
        """The model with the effects `ids` of the catalogue and `more`, all off."""
        model = self.base
        for effect in [*(catalogue()[name] for name in ids), *more]:
            model = effect(model)
        return model

    def kernel(self, ids: Ids = (), *more: Effect) -> Kernel:
        """The compiled model with the effects `ids` of the catalogue and `more`."""
        key = (*ids, *(e.id for e in more))
        if key not in self._kernels:
            self._kernels[key] = Kernel(self.model(ids, *more))
        return self._kernels[key]

    def everything(self) -> Kernel:
        """The model with the whole catalogue in it: one library for the scores of all candidates."""
        return self.kernel(tuple(catalogue()))

    def prepare(self, ids: Ids, candidates: Iterable[Effect]) -> None:
        """Compile the model with `ids` and each of the candidates."""
        side_by_side(lambda effect: self.kernel(ids, effect), candidates)
