"""One BLAS thread: the others would wait spinning, on the cores that the experiments' own threads need."""

from __future__ import annotations

from collections.abc import Callable
from typing import ParamSpec, TypeVar, cast

from threadpoolctl import threadpool_limits

P = ParamSpec("P")
R = TypeVar("R")


def one_blas_thread(work: Callable[P, R]) -> Callable[P, R]:
    """`work`, run with one BLAS thread (a discovery takes a third of the time)."""
    return cast("Callable[P, R]", threadpool_limits.wrap(limits=1)(work))
