"""Saved states hold everything, bit for bit; runs do not depend on time, instance, thread or process."""

from __future__ import annotations

import ctypes
import subprocess
import sys
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest

from drivers import CS, ME, Host
from refusals import ERROR, refused

STEP = 1e-3
SNAP = {"pressure": 20000.0, "voltage": 7000.0}  # far beyond the fold at 7 kV


def snapping(fmu: Path, until: float = 1.8) -> Host:
    """A host in the middle of the snap-through: beyond the fold (1.53 in lambda_2), and moving."""
    host = Host(fmu)
    host.set(**SNAP)
    host.initialize()
    while host.get("lambda_2")[0] < until:
        host.step(host.get("time")[0], STEP)
    assert host.get("lambda_2_rate")[0] > 0.3
    return host


def run(host: Host, steps: int) -> bytes:
    """Some steps with changing inputs and steps that are not all alike; the state at the end."""
    start = host.get("time")[0]
    for i in range(steps):
        host.set(pressure=12000.0 + 500.0 * (i % 7), voltage=4000.0 + 100.0 * (i % 5))
        host.step(start + i * STEP, STEP)
    return host.saved()


def test_rollback_in_the_middle_of_a_snap_through(fmu: Path) -> None:
    with snapping(fmu) as host:
        middle = host.saved()
        end = run(host, 50)
        assert end != middle
        for _ in range(3):
            host.restore(middle)
            assert host.saved() == middle
            assert run(host, 50) == end


def test_states_move_between_instances_and_versions(fmi2_fmu: Path, fmi3_fmu: Path) -> None:
    with snapping(fmi2_fmu) as first, Host(fmi2_fmu) as second, Host(fmi3_fmu) as third:
        state = first.saved()
        end = run(first, 50)
        for other in (second, third):
            other.restore(state)
            assert run(other, 50) == end


CONTINUE = """
import sys
from pathlib import Path
from drivers import Host
from test_fmi_states import run
with Host(Path(sys.argv[1])) as host:
    host.restore(bytes.fromhex(sys.stdin.read()))
    print(run(host, 50).hex())
"""


def test_states_move_into_another_process(fmu: Path) -> None:
    with snapping(fmu) as host:
        state = host.saved()
        end = run(host, 50)
    done = subprocess.run(
        [sys.executable, "-c", CONTINUE, str(fmu)],
        input=state.hex(),
        cwd=Path(__file__).parent,
        capture_output=True,
        text=True,
        check=True,
    )
    assert bytes.fromhex(done.stdout.strip()) == end


def test_hidden_things_are_saved(fmi2_fmu: Path) -> None:
    """The internal step size, the tolerance, the stop time, input derivatives and whether they are spent."""
    with snapping(fmi2_fmu) as host:
        host.set_input_derivatives([2e4, 1e4])
        fresh, time = host.saved(), host.get("time")[0]
        host.step(time, STEP)
        spent, current = host.saved(), host.get("current")
        host.step(time + STEP, STEP)
        end = host.saved()
        host.restore(spent)
        assert host.get("current") == current, "the slope of the voltage at the end of the step"
        host.step(time + STEP, STEP)
        assert host.saved() == end
        host.restore(fresh)
        host.step(time, STEP)
        assert host.saved() == spent
    with Host(fmi2_fmu) as strict, Host(fmi2_fmu) as other:
        strict.initialize(tolerance=1e-9, stop=1.0)
        other.restore(strict.saved())
        with refused(other, "stop time 1 s"):
            other.step(0.0, 2.0)
        strict.set(**SNAP), other.set(**SNAP)
        strict.step(0.0, 0.5), other.step(0.0, 0.5)
        assert strict.saved() == other.saved()


@pytest.mark.parametrize("kind", [CS, ME])
def test_every_mode_is_saved(fmu: Path, kind: str) -> None:
    with Host(fmu, kind) as host:
        host.set(pressure=5000.0)
        host.enter()
        initial = host.saved()
        assert host.get("pressure", "radius") == [5000.0, 0.015]
        assert host.saved() == initial, "looking changes nothing"
        host.fmu.exitInitializationMode()
        host.restore(initial)
        host.set(lambda_2_start=1.1)
        assert host.get("radius") == [pytest.approx(0.0165)]


# Bytes that are not a state ---------------------------------------------------------------------------


def bad_states(good: bytes) -> Iterator[tuple[str, bytes]]:
    """What went wrong, and the bytes: every single bit flipped, truncated, extended, of another model."""
    for place in range(len(good)):
        for bit in range(8):
            flipped = bytes([good[place] ^ (1 << bit)])
            yield f"bit {bit} of byte {place}", good[:place] + flipped + good[place + 1 :]
    for size in (0, 1, 8, len(good) - 1, len(good) + 1, 2 * len(good)):
        yield f"size {size}", (good * 2)[:size]
    yield "noise", np.random.default_rng(1).bytes(len(good))
    yield "zeros", bytes(len(good))


def as_bytes(host: Host, data: bytes) -> ctypes.Array:
    """The bytes as an array of what the version calls a byte."""
    byte = ctypes.c_char if host.version == 2 else ctypes.c_uint8
    return (byte * max(1, len(data))).from_buffer_copy(data or b"\0")


def test_bytes_that_are_not_a_state_are_refused(fmu: Path) -> None:
    deserialize = "DeSerializeFMUstate" if fmu.parent.name.startswith("fmi2") else "DeserializeFMUState"
    with snapping(fmu) as host:
        good, count = host.saved(), 0
        for what, bad in bad_states(good):
            state, told = ctypes.c_void_p(), len(host.messages)
            assert host.call(deserialize, as_bytes(host, bad), len(bad), ctypes.byref(state)) == ERROR, what
            assert not state.value, what
            assert len(host.messages) == told + 1, what
            count += 1
        assert count == 8 * len(good) + 8
        assert host.saved() == good


def checksum(data: bytes) -> bytes:
    """As at the end of saved states: FNV-1a by words, each turned by 29 bits."""
    value = 14695981039346656037
    for i in range(0, len(data), 8):
        value ^= int.from_bytes(data[i : i + 8], sys.byteorder)
        value = (value << 29 | value >> 35) * 1099511628211 % 2**64
    return value.to_bytes(8, sys.byteorder)


def test_states_of_another_model_are_refused(fmu: Path) -> None:
    with Host(fmu) as host:
        host.initialize()
        good = host.saved()
        assert checksum(good[:-8]) == good[-8:]
        another = good[:-8].replace(host.fmu.guid.encode(), b"{" + b"0" * 36 + b"}")
        with refused(host, "expected a state of TubularDEA", "given another"):
            host.restore(another + checksum(another))


@pytest.mark.parametrize(("kind", "other", "words"), [(CS, ME, "model exchange"), (ME, CS, "co-simulation")])
def test_states_of_the_other_interface_are_refused(fmu: Path, kind: str, other: str, words: str) -> None:
    with Host(fmu, kind) as giver, Host(fmu, other) as taker:
        giver.initialize()
        with refused(taker, f"expected a state of a {words}"):
            taker.restore(giver.saved())


def test_null_states_are_refused(fmu: Path) -> None:
    with Host(fmu) as host:
        state = "FMUstate" if host.version == 2 else "FMUState"
        size = ctypes.c_size_t()
        for function, arguments in [
            (f"Get{state}", (None,)),
            (f"Set{state}", (None,)),
            (f"Serialized{state}Size", (None, ctypes.byref(size))),
            (f"Serialize{state}", (None, None, 0)),
            ("DeSerializeFMUstate" if host.version == 2 else "DeserializeFMUState", (None, 0, None)),
        ]:
            assert host.call(function, *arguments) == ERROR
            assert "NULL" in host.messages[-1]
        held = host.fmu.getFMUState()
        assert host.call(f"Serialize{state}", held, as_bytes(host, bytes(10)), 10) == ERROR
        assert "expected room for" in host.messages[-1]
        host.fmu.freeFMUState(held)


# Determinism ------------------------------------------------------------------------------------------


def test_runs_and_instances_are_alike(fmu: Path) -> None:
    with Host(fmu) as first, Host(fmu) as second:
        ends = set()
        for host in (first, second, first):
            host.set(pressure=12000.0)
            host.initialize()
            ends.add(run(host, 100))
            host.fmu.reset()
        assert len(ends) == 1


def test_threads_do_not_matter(fmu: Path) -> None:
    """64 instances with different parameters in 16 threads, stepped in turns, against one after the other."""
    hosts = [Host(fmu) for _ in range(64)]
    try:
        for i, host in enumerate(hosts):
            host.set(C_1=3.0e5 + 1e3 * i, pressure=12000.0)
            host.initialize()
        starts = [host.saved() for host in hosts]
        serial = [run(host, 40) for host in hosts]
        for host, start in zip(hosts, starts, strict=True):
            host.restore(start)
        with ThreadPoolExecutor(16) as pool:
            threaded = list(pool.map(lambda host: run(host, 40), hosts))
        assert threaded == serial
        assert len(set(serial)) == 64
    finally:
        for host in hosts:
            host.__exit__(None, None, None)
