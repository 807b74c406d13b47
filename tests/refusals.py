"""What a refused call must look like: an error status, a message that says why, and nothing changed."""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass

import pytest
from fmpy.fmi1 import FMICallException

from drivers import CS, ME, Host

OK, WARNING, DISCARD, ERROR = range(4)
MODES = {
    "I": "instantiated",
    "N": "initialization",
    "E": "event",
    "C": "continuous time",
    "S": "step",
    "T": "terminated",
}
MODES_OF = {CS: "INST", ME: "INECT"}


@contextmanager
def refused(host: Host, *words: str) -> Iterator[None]:
    """The calls inside end in an error whose message has all `words`, and leave the instance as it was."""
    before, told = host.saved(), len(host.messages)
    with pytest.raises(FMICallException) as caught:
        yield
    assert caught.value.status == ERROR
    message = " ".join(host.messages[told:])
    missing = [word for word in words if word not in message]
    assert not missing, f"{message!r} does not say {missing}"
    assert host.saved() == before, f"{caught.value.function} was refused but changed the instance"


@dataclass(frozen=True)
class Call:
    """An FMI function with valid arguments, the modes in which it is allowed (letters of MODES, those of its
    interface only), and what it then answers."""

    function: str
    modes: str
    arguments: Callable[[Host], tuple] = lambda host: ()
    interface: str = CS + ME
    answer: int = OK

    def allowed(self, kind: str, mode: str) -> bool:
        return kind in self.interface and mode in self.modes


def vrs(host: Host, *names: str) -> ctypes.Array:
    """Value references as a C array."""
    return (ctypes.c_uint32 * len(names))(*(host.vr[name] for name in names))


def doubles(*values: float) -> ctypes.Array:
    """Values as a C array."""
    return (ctypes.c_double * len(values))(*values)


def states_by_mode(host: Host) -> dict[str, bytes]:
    """A saved state in every mode that the interface has, on the way through a normal life."""
    states = {}
    if host.version == 2:
        host.fmu.setupExperiment()
    states["I"] = host.saved()
    host.fmu.enterInitializationMode()
    states["N"] = host.saved()
    host.fmu.exitInitializationMode()
    states["S" if host.kind == CS else "E"] = host.saved()
    if host.kind == ME:
        host.fmu.enterContinuousTimeMode()
        states["C"] = host.saved()
    host.fmu.terminate()
    states["T"] = host.saved()
    return states


def check_state_machine(host: Host, calls: Sequence[Call]) -> int:
    """Every call in every mode: answered where it is allowed, refused by name and without effect where not."""
    states = states_by_mode(host)
    assert set(states) == set(MODES_OF[host.kind])
    for call in calls:
        for mode, state in states.items():
            host.restore(state)
            told = len(host.messages)
            status = host.call(call.function, *call.arguments(host))
            where = f"{call.function} in mode {MODES[mode]} of {host.kind}: {host.messages[told:]}"
            if call.allowed(host.kind, mode):
                assert status == call.answer, where
            else:
                assert status == ERROR, where
                assert call.function in host.messages[-1] or "fixed parameter" in host.messages[-1], where
                assert host.saved() == state, where
    return len(calls) * len(states)
