"""Work side by side on all processors; and one BLAS thread, as the others would wait spinning on these cores."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from typing import ParamSpec, TypeVar, cast

from threadpoolctl import threadpool_limits

from ..processors import processors

P = ParamSpec("P")
R = TypeVar("R")
T = TypeVar("T")


def side_by_side(work: Callable[[T], R], items: Iterable[T]) -> list[R]:
    """`work` of every item, in their order, by a thread a processor: kernels and numpy run without Python's lock."""
    with ThreadPoolExecutor(processors()) as pool:
        return list(pool.map(work, items))


def one_blas_thread(work: Callable[P, R]) -> Callable[P, R]:
    """`work`, run with one BLAS thread (a discovery takes a third of the time)."""
    return cast("Callable[P, R]", threadpool_limits.wrap(limits=1)(work))
