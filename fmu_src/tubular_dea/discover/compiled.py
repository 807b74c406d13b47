"""Models with effects, compiled: each combination once, several at a time."""

from __future__ import annotations

from collections.abc import Iterable
from concurrent.futures import ThreadPoolExecutor

from ..kernel import Kernel
from ..model.declare import Model
from ..model.effects import catalogue

Ids = tuple[str, ...]


class Compiled:
    """Kernels of `base` with effects added, by the tuple of their ids in the order they were found."""

    def __init__(self, base: Model) -> None:
        self.base = base
        self._kernels: dict[Ids, Kernel] = {}

    def model(self, ids: Ids) -> Model:
        """The model with the effects `ids`, off."""
        model = self.base
        for name in ids:
            model = catalogue()[name](model)
        return model

    def kernel(self, ids: Ids = ()) -> Kernel:
        """The compiled model with the effects `ids`."""
        if ids not in self._kernels:
            self._kernels[ids] = Kernel(self.model(ids))
        return self._kernels[ids]

    def prepare(self, wanted: Iterable[Ids], workers: int = 2) -> None:
        """Compile what will be needed, `workers` at a time."""
        with ThreadPoolExecutor(workers) as pool:
            list(pool.map(self.kernel, [ids for ids in wanted if ids not in self._kernels]))
