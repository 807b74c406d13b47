"""Work side by side on all processors; and one BLAS thread, as the others would wait spinning on these cores."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from threading import local
from typing import ParamSpec, TypeVar, cast

from threadpoolctl import threadpool_limits

from ..processors import processors

P = ParamSpec("P")
R = TypeVar("R")
T = TypeVar("T")

_here = local()  # `busy`: this thread is one of as many as there are processors


def side_by_side(work: Callable[[T], R], items: Iterable[T]) -> list[R]:
    """`work` of every item, in their order, by a thread a processor: kernels and numpy run without Python's lock.

    By the calling thread, where that is one of such threads itself, or there is one item: a thread takes longer to
    start than a short trajectory.
    """
    listed = list(items)
    if len(listed) < 2 or free_processors() < 2:
        return [work(item) for item in listed]
    many = len(listed) >= processors()
    with ThreadPoolExecutor(min(len(listed), processors()), initializer=_begin, initargs=(many,)) as pool:
        return list(pool.map(work, listed))


def free_processors() -> int:
    """How many threads are worth while here: one where every processor has its thread already."""
    return 1 if getattr(_here, "busy", False) else processors()


def _begin(busy: bool) -> None:
    _here.busy = busy


def one_blas_thread(work: Callable[P, R]) -> Callable[P, R]:
    """`work`, run with one BLAS thread (a discovery takes a third of the time)."""
    return cast("Callable[P, R]", threadpool_limits.wrap(limits=1)(work))
