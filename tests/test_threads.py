"""Work side by side: results in order, nested calls, and what happens where something fails."""

import threading
import time

import pytest

from tubular_dea.identify import threads


@pytest.fixture(params=[1, 2, 5])
def processors(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> int:
    """As many processors as a machine may have."""
    monkeypatch.setattr(threads, "processors", lambda: request.param)
    threads._pool.cache_clear()
    yield request.param
    threads._pool.cache_clear()


def test_results_are_in_the_order_of_the_items(processors: int) -> None:
    """Whatever takes how long."""

    def slow_at_first(i: int) -> int:
        time.sleep(0.01 if i < 3 else 0)
        return i * i

    assert threads.side_by_side(slow_at_first, range(20)) == [i * i for i in range(20)]
    assert threads.side_by_side(slow_at_first, []) == []


def test_as_many_threads_as_processors_work_at_once(processors: int) -> None:
    """The calling one among them: all wait for each other here."""
    together = threading.Barrier(processors, timeout=30)
    workers = threads.side_by_side(lambda _: (together.wait(), threading.get_ident())[1], range(processors))
    assert len(set(workers)) == processors
    assert threading.get_ident() in workers


def test_work_in_work_ends_at_any_depth(processors: int) -> None:
    """No thread waits for one that waits for it; and none is asked for where every processor has one."""

    def deeper(depth: int) -> int:
        if not depth:
            return 1
        return sum(threads.side_by_side(deeper, [depth - 1] * 3))

    assert deeper(5) == 3**5
    busy = threads.side_by_side(lambda _: threads.free_processors(), range(processors))
    assert busy == [1] * processors
    assert threads.free_processors() == processors


def test_the_first_error_is_raised_and_the_rest_not_begun(processors: int) -> None:
    """The error is the same in every run."""
    begun = []

    def fails(i: int) -> int:
        begun.append(i)
        time.sleep(0.01 if i == 4 else 0)
        if i >= 4:
            raise ValueError(f"item {i}")
        return i

    with pytest.raises(ValueError, match="item 4"):
        threads.side_by_side(fails, range(1000))
    assert len(begun) <= 4 + processors
    assert threads.free_processors() == processors
    assert threads.side_by_side(abs, [-1, -2]) == [1, 2]


def test_after_an_interrupt_nothing_is_left_at_work(processors: int) -> None:
    """Ctrl-C reaches the calling thread alone."""
    caller, begun = threading.get_ident(), []

    def interrupted(i: int) -> None:
        begun.append(i)
        if threading.get_ident() == caller:
            raise KeyboardInterrupt
        time.sleep(0.02)

    with pytest.raises(KeyboardInterrupt):
        threads.side_by_side(interrupted, range(1000))
    count = len(begun)
    time.sleep(0.1)
    assert len(begun) == count < 1000
