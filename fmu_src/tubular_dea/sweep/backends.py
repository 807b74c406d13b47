"""The backends that compute the parts of a sweep: threads of this process, or the workers of a Dask cluster.

Both take the same ranges of rows, call the same pure function, and hand parts over as they come. At most a few parts a
worker are under way, so that memory does not grow with the sweep.
"""

from __future__ import annotations

import asyncio
import logging
import pickle
import signal
from collections.abc import Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, CancelledError, Future, ThreadPoolExecutor, wait
from contextlib import contextmanager
from itertools import islice
from multiprocessing import resource_tracker
from queue import SimpleQueue
from typing import Any

from ..errors import UserError
from ..extra import load
from ..processors import processors
from .parts import Part, RowRange, part, task
from .plan import Plan
from .rows import PreparedPlan

AHEAD = 2  # parts a thread, or tasks a worker, that are under way
QUIET = {  # half of what Dask does while it waits: profiles, its own clock, what the disks do; nothing here reads them
    "distributed.worker.profile.enabled": False,
    "distributed.admin.tick.interval": "1s",
    "distributed.admin.system-monitor.interval": "10s",
}
TASK_SECONDS = 1.0  # a task takes no longer, so that results come steadily, unless one part does


class BackendError(UserError, RuntimeError):
    """A cluster that cannot be reached or that gave up."""


class Threads:
    """Threads of this process; the compiled model runs without Python's lock."""

    def __init__(self, workers: int | None = None) -> None:
        self.workers = workers or processors()

    def run(self, plan: Plan, ranges: Sequence[RowRange]) -> Iterator[Part]:
        """The parts, in the order in which they are finished."""
        prepared = PreparedPlan(plan)
        workers = self.workers if prepared.threads else 1
        waiting = iter(ranges)
        with ThreadPoolExecutor(workers) as pool:
            under_way: set[Future[Part]] = set()
            try:
                while True:
                    fresh = islice(waiting, AHEAD * workers - len(under_way))
                    under_way |= {pool.submit(part, prepared, *rows) for rows in fresh}
                    if not under_way:
                        return
                    done, under_way = wait(under_way, return_when=FIRST_COMPLETED)
                    yield from sorted((future.result() for future in done), key=lambda made: made.start)
            except KeyboardInterrupt:  # what is under way is finished and handed over
                pool.shutdown(wait=True, cancel_futures=True)
                yield from (future.result() for future in under_way if future.done() and not future.cancelled())
                raise
            finally:
                pool.shutdown(wait=True, cancel_futures=True)


class Cluster:
    """The workers of a Dask cluster. A task that a worker takes with it when it dies is computed by another."""

    def __init__(self, client: Any) -> None:
        self.client = client

    def run(self, plan: Plan, ranges: Sequence[RowRange]) -> Iterator[Part]:
        """The parts, in the order in which they are finished.

        A task is several parts, as many as take TASK_SECONDS, and fewer towards the end: what Dask asks for each
        task is then little beside its work.
        """
        distributed = load("distributed", "a cluster", "sweep")
        content, fingerprint = pickle.dumps(plan), plan.fingerprint
        waiting, each = list(ranges), float("inf")  # the seconds a part takes
        finished: SimpleQueue[Any] = SimpleQueue()  # as_completed of Dask may sleep for 0.1 s beside a result
        under_way = 0
        try:
            while waiting or under_way:
                workers = max(1, sum(self.client.nthreads().values()))
                while waiting and under_way < AHEAD * workers:
                    share = -(-2 * len(waiting) // (3 * workers))  # of what is left, so that all end together
                    size = max(1, min(share, int(TASK_SECONDS / each)))
                    taken, waiting[:size] = waiting[:size], []
                    key = f"rows-{fingerprint[:16]}-{taken[0][0]}"
                    future = self.client.submit(task, fingerprint, content, taken, key=key, retries=3)
                    future.add_done_callback(finished.put)
                    under_way += 1
                future = finished.get()
                parts, seconds = future.result()
                each = seconds / len(parts)
                under_way -= 1
                yield from parts
        except (distributed.KilledWorker, CancelledError, OSError) as problem:
            why = str(problem).partition("\n")[0].rstrip(".")
            raise BackendError(f"the cluster gave up: {why}; the rows so far are kept, run it again") from None


@contextmanager
def backend(
    workers: int | None, local_cluster: int | None, scheduler: str | None, timeout: float = 10.0
) -> Iterator[Threads | Cluster]:
    """The backend of the command line's options: threads, worker processes on this machine, or a scheduler's."""
    if local_cluster is None and scheduler is None:
        yield Threads(workers)
        return
    distributed = load("distributed", "a cluster", "sweep")
    if scheduler is not None:
        _check_answers(distributed, scheduler, timeout)
        try:
            # As the default, one that fails at its address would leave Dask set to a cluster that is not there.
            client = distributed.Client(scheduler, timeout=timeout, set_as_default=False)
        except (OSError, ValueError) as problem:
            raise BackendError(f"the scheduler {scheduler} cannot be used: {problem}") from None
        with client:
            yield Cluster(client)
        return
    with load("dask", "a cluster", "sweep").config.set(QUIET):
        with _no_interrupts():
            cluster = distributed.LocalCluster(
                n_workers=local_cluster, threads_per_worker=1, dashboard_address=":0", silence_logs=logging.CRITICAL
            )
        with cluster, distributed.Client(cluster) as client:
            yield Cluster(client)


def _check_answers(distributed: Any, scheduler: str, timeout: float) -> None:
    """`BackendError` where no scheduler answers at an address.

    Asked before a client is made: one that has no answer leaves threads behind, waits for ever where a web server
    listens, and takes what another program says for the length of a message.
    """

    async def asked() -> None:
        async with distributed.rpc(scheduler, timeout=timeout) as remote:
            await asyncio.wait_for(remote.identity(), timeout)

    with ThreadPoolExecutor(1) as pool:  # where a notebook has a loop of its own, this thread has none
        try:
            pool.submit(asyncio.run, asked()).result()
        except (Exception, MemoryError) as problem:
            silent = isinstance(problem, MemoryError) or not str(problem)  # the first: a length that is none
            why = f"nothing in its language within {timeout:g} s" if silent else str(problem).partition("\n")[0]
            raise BackendError(
                f"no Dask scheduler answers at {scheduler!r} ({why}); give its address as in tcp://10.0.0.1:8786"
            ) from None


@contextmanager
def _no_interrupts() -> Iterator[None]:
    """Ctrl-C waits until the end, and never reaches threads and processes that are begun here: a terminal sends it to
    all, and each would say so."""
    masked = hasattr(signal, "pthread_sigmask")  # not on Windows
    if masked:
        resource_tracker.ensure_running()  # begun later, it would let Ctrl-C through again
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT}) if masked else set()
    try:
        yield
    finally:
        if masked:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)
