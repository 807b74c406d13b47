"""A model whose equations end on the way through a recorded experiment: said with the plant's file."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from ..kernel import KernelError
from ..plants.plant import Plant


@contextmanager
def recorded(plant: Plant) -> Iterator[None]:
    """Work on recordings of `plant`; where its model ends early, the error says what may be wrong with it."""
    try:
        yield
    except KernelError as problem:
        raise KernelError(
            f"{plant.file or plant.name}: the model cannot follow a recorded experiment: {problem}; look for a wrong "
            "sign in a derivative, and for a declared value far from the plant's"
        ) from None
