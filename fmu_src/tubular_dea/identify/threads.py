"""Work side by side on all processors; and one BLAS thread, as the others would wait spinning on these cores."""

from __future__ import annotations

import os
from collections import deque
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor, wait
from functools import cache
from threading import local
from typing import Generic, ParamSpec, TypeVar, cast

from threadpoolctl import threadpool_limits

from ..processors import processors

P = ParamSpec("P")
R = TypeVar("R")
T = TypeVar("T")

_here = local()  # `busy`: this thread is one of as many as there are processors


def side_by_side(work: Callable[[T], R], items: Iterable[T]) -> list[R]:
    """`work` of every item, in their order, by a thread a processor: kernels and numpy run without Python's lock.

    The calling thread is one of them, and the only one where that is one of as many already, or there is one item. Of
    items that fail, the first one's error is raised; those after it are not begun.
    """
    listed = list(items)
    helpers = min(len(listed), free_processors()) - 1
    if helpers < 1:
        return [work(item) for item in listed]
    shared = _Shared(work, listed)
    asked = [_pool(os.getpid()).submit(shared.take) for _ in range(helpers)]
    try:
        shared.take()
    finally:  # after Ctrl-C too, none is left at work
        shared.left.clear()
        wait([future for future in asked if not future.cancel()])
    if shared.failed:
        raise shared.failed[min(shared.failed)]
    return [shared.found[i] for i in range(len(listed))]


class _Shared(Generic[T, R]):
    """Items that threads take one after the other; results and errors by the item's place."""

    def __init__(self, work: Callable[[T], R], listed: list[T]) -> None:
        self.work = work
        self.left = deque(enumerate(listed))
        self.busy = len(listed) >= processors()
        self.found: dict[int, R] = {}
        self.failed: dict[int, Exception] = {}

    def take(self) -> None:
        """Work on what is left until nothing is, or something fails."""
        before, _here.busy = getattr(_here, "busy", False), self.busy
        try:
            while True:
                try:
                    i, item = self.left.popleft()
                except IndexError:
                    return
                try:
                    self.found[i] = self.work(item)
                except Exception as error:  # raised where all was waited for
                    self.failed[i] = error
                    self.left.clear()
        finally:
            _here.busy = before


@cache
def _pool(process: int) -> ThreadPoolExecutor:
    """The threads of this process, which start once: it takes longer than a short trajectory."""
    return ThreadPoolExecutor(max(processors() - 1, 1))


def free_processors() -> int:
    """How many threads are worth while here: one where every processor has its thread already."""
    return 1 if getattr(_here, "busy", False) else processors()


def one_blas_thread(work: Callable[P, R]) -> Callable[P, R]:
    """`work`, run with one BLAS thread (a discovery takes a third of the time)."""
    return cast("Callable[P, R]", threadpool_limits.wrap(limits=1)(work))
