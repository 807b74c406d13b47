"""Who computes the pieces of a sweep: threads of this process, or the workers of a Dask cluster.

Both take the same pieces, call the same pure function, and hand results over as they come. At most a few pieces a
worker are under way, so that memory does not grow with the sweep.
"""

from __future__ import annotations

import os
import pickle
from collections.abc import Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, CancelledError, Future, ThreadPoolExecutor, wait
from contextlib import contextmanager
from itertools import islice
from typing import Any

from ..errors import UserError
from .extra import load
from .plan import Plan
from .rows import Rows, Study, compute

Piece = tuple[int, int]
AHEAD = 3  # pieces a worker that are under way


class BackendError(UserError, RuntimeError):
    """A cluster that cannot be reached or that gave up."""


class Threads:
    """Threads of this process; the compiled model runs without Python's lock."""

    def __init__(self, workers: int | None = None) -> None:
        self.workers = workers or _processors()

    def run(self, plan: Plan, pieces: Iterable[Piece]) -> Iterator[tuple[Piece, Rows]]:
        """(piece, its rows), in the order in which they are finished."""
        study = Study(plan)
        workers = self.workers if study.threads else 1
        waiting = iter(pieces)
        with ThreadPoolExecutor(workers) as pool:
            under_way: dict[Future[Rows], Piece] = {}
            try:
                while True:
                    for piece in islice(waiting, AHEAD * workers - len(under_way)):
                        under_way[pool.submit(study.rows, *piece)] = piece
                    if not under_way:
                        return
                    done, _ = wait(under_way, return_when=FIRST_COMPLETED)
                    for future in sorted(done, key=lambda f: under_way[f]):
                        yield under_way.pop(future), future.result()
            finally:
                pool.shutdown(wait=True, cancel_futures=True)


class Cluster:
    """The workers of a Dask cluster. A piece that a worker takes with it when it dies is computed by another."""

    def __init__(self, client: Any) -> None:
        self.client = client

    def run(self, plan: Plan, pieces: Iterable[Piece]) -> Iterator[tuple[Piece, Rows]]:
        """(piece, its rows), in the order in which they are finished."""
        distributed = load("distributed", "a cluster")
        content, fingerprint = pickle.dumps(plan), plan.fingerprint
        waiting = iter(pieces)
        under_way: dict[Any, Piece] = {}

        def submit(count: int) -> list[Any]:
            """Up to `count` more pieces; fewer than none where workers have just died."""
            made = []
            for piece in islice(waiting, max(0, count)):
                key = f"rows-{fingerprint[:16]}-{piece[0]}"
                future = self.client.submit(compute, fingerprint, content, *piece, key=key, retries=3)
                under_way[future] = piece
                made.append(future)
            return made

        completed = distributed.as_completed(submit(AHEAD * self._workers()), with_results=True)
        try:
            for future, rows in completed:
                yield under_way.pop(future), rows
                future.release()
                for fresh in submit(AHEAD * self._workers() - len(under_way)):
                    completed.add(fresh)
        except (distributed.KilledWorker, CancelledError, OSError) as problem:
            raise BackendError(f"the cluster gave up: {problem}; the rows so far are kept, run it again") from None

    def _workers(self) -> int:
        return max(1, sum(self.client.nthreads().values()))


@contextmanager
def backend(
    workers: int | None, local_cluster: int | None, scheduler: str | None, timeout: float = 10.0
) -> Iterator[Threads | Cluster]:
    """The backend of the command line's options: threads, worker processes on this machine, or a scheduler's."""
    if local_cluster is None and scheduler is None:
        yield Threads(workers)
        return
    distributed = load("distributed", "a cluster")
    if scheduler is not None:
        try:
            client = distributed.Client(scheduler, timeout=timeout)
        except (OSError, ValueError, TimeoutError) as problem:
            raise BackendError(f"--scheduler {scheduler}: it cannot be reached: {problem}") from None
        with client:
            yield Cluster(client)
        return
    with (
        distributed.LocalCluster(n_workers=local_cluster, threads_per_worker=1, dashboard_address=None) as cluster,
        distributed.Client(cluster) as client,
    ):
        yield Cluster(client)


def _processors() -> int:
    try:
        return len(os.sched_getaffinity(0))
    except AttributeError:
        return os.cpu_count() or 1
