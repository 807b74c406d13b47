"""States that can be saved."""

from __future__ import annotations

import hashlib
import struct
from typing import NamedTuple

from .guard import Refused
from .integrator import NX
from .stand_in import GUID, NAME, VARIABLES
from .table import INF, Vector

INSTANTIATED, INITIALIZATION, STEPPING, TERMINATED = 1, 2, 16, 32
MODE_NAMES = {
    INSTANTIATED: "before initialization mode",
    INITIALIZATION: "in initialization mode",
    STEPPING: "in step mode",
    TERMINATED: "after terminate",
}
DEFAULT_TOLERANCE, SMALLEST_TOLERANCE, LARGEST_TOLERANCE = 1e-6, 1e-12, 1e-2


class Snapshot(NamedTuple):
    """Everything that determines the future of an instance. It is never changed: to keep it is to save it."""

    time: float
    start: float
    stop: float  # infinite where the host gave none
    tolerance: float
    h: float  # step size to go on with; 0 before the first step
    x: Vector
    u: Vector
    p: Vector
    mode: int


FRESH = Snapshot(
    time=0.0,
    start=0.0,
    stop=INF,
    tolerance=DEFAULT_TOLERANCE,
    h=0.0,
    x=(0.0,) * NX,
    u=tuple(v.start for v in VARIABLES if v.kind == "INPUT"),
    p=tuple(v.start for v in VARIABLES if v.kind == "PARAMETER"),
    mode=INSTANTIATED,
)

MARK = b"PYstate1" + GUID.encode("ascii")
LAYOUT = struct.Struct(f"<{5 + NX + len(FRESH.u) + len(FRESH.p)}di")
DIGEST = 8  # bytes of SHA-256 behind mark and values


def to_bytes(state: Snapshot) -> bytes:
    """Mark, values and a checksum; doubles are kept bit by bit."""
    body = MARK + LAYOUT.pack(*state[:5], *state.x, *state.u, *state.p, state.mode)
    return body + hashlib.sha256(body).digest()[:DIGEST]


def from_bytes(data: bytes) -> Snapshot:
    """The saved state; `Refused` where the bytes are not exactly those of a state of this model."""
    function = "fmi2DeSerializeFMUstate"
    size = len(MARK) + LAYOUT.size + DIGEST
    if len(data) != size:
        raise Refused(f"{function}: expected {size} bytes but was given {len(data)}")
    if not data.startswith(MARK):
        raise Refused(f"{function}: expected a state of {NAME} {GUID} but was given another")
    if hashlib.sha256(data[:-DIGEST]).digest()[:DIGEST] != data[-DIGEST:]:
        raise Refused(f"{function}: the state's checksum is wrong; it was changed")
    values = LAYOUT.unpack(data[len(MARK) : -DIGEST])
    time, begin, stop, tolerance, h = values[:5]
    after_x = 5 + NX
    after_u = after_x + len(FRESH.u)
    x, u, p = values[5:after_x], values[after_x:after_u], values[after_u:-1]
    return Snapshot(time, begin, stop, tolerance, h, x, u, p, values[-1])
