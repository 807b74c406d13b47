"""Checks of the kernel's arguments, as in an FMU: the C code relies on them."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from typing import Any

import numpy as np

from ..errors import UserError, list_of_names
from ..model.declare import Model, Quantity, nearest
from ..protocol import Protocol

ULPS = 1000  # of a time: points of a protocol that are closer may be one, where a step ends


class KernelError(UserError, RuntimeError):
    """A trajectory that could not be computed, or an argument that cannot be used; the text says where and why."""


def parameter_array(model: str, parameters: Mapping[str, Quantity], given: Mapping[str, float]) -> np.ndarray:
    """The values of all `parameters` of a model in their order (SI units), those that are `given` by name in place."""
    for name, value in by_name("parameters", given).items():
        check_value(declared(model, "parameter", name, parameters), value)
    return np.array([float(given.get(name, q.value or 0.0)) for name, q in parameters.items()])


def check_value(q: Quantity, value: float) -> None:
    """`KernelError` unless `value` is a number of the quantity's type inside its bounds."""
    unit = "" if q.unit == "1" else f" {q.unit}"
    measured = f" in{unit}" if unit else ""
    try:
        number = float(value)
    except (TypeError, ValueError):
        raise KernelError(f"{q.name}: expected a number{measured} but was given {value!r}") from None
    if not math.isfinite(number):
        raise KernelError(f"{q.name}: expected a finite number{measured} but was given {number:g}")
    if q.type == "Integer" and number != round(number):
        raise KernelError(f"{q.name}: expected an integer but was given {number:g}")
    if q.type == "Boolean" and number not in (0.0, 1.0):
        raise KernelError(f"{q.name}: expected true or false (1 or 0) but was given {number:g}")
    if q.minimum is not None and number < q.minimum:
        raise KernelError(f"{q.name}: expected at least {q.minimum:g}{unit} but was given {number:.10g}")
    if q.maximum is not None and number > q.maximum:
        raise KernelError(f"{q.name}: expected at most {q.maximum:g}{unit} but was given {number:.10g}")


def check_rows(q: Quantity, values: np.ndarray) -> None:
    """`KernelError` for the first of `values`, one a row or one for all, that `check_value` would refuse."""
    if values.size == 1:
        return check_value(q, values.item())
    bad = np.flatnonzero(unfit(q, values))
    if bad.size:
        try:
            check_value(q, float(values.flat[bad[0]]))
        except KernelError as problem:
            raise KernelError(f"{problem} in row {bad[0]}") from None


def unfit(q: Quantity, values: np.ndarray) -> np.ndarray:
    """Which of `values` `check_value` would refuse, all at once."""
    bad = ~np.isfinite(values) | fractional(q, values)
    if q.minimum is not None:
        bad |= values < q.minimum
    if q.maximum is not None:
        bad |= values > q.maximum
    return bad


def fractional(q: Quantity, values: np.ndarray) -> np.ndarray:
    """Which of `values` are between those of an integer, or neither true nor false."""
    if q.type == "Boolean":
        return ~np.isin(values, (0.0, 1.0))
    return values != np.round(values) if q.type == "Integer" else np.zeros(values.shape, bool)


def by_name(what: str, given: Mapping[str, Any]) -> Mapping[str, Any]:
    """`given`; `KernelError` unless it has values by name."""
    if not isinstance(given, Mapping):
        raise KernelError(f"{what}: expected values by name, as in a dict, but was given {given!r}")
    return given


def declared(model: str, kind: str, name: str, quantities: Mapping[str, Quantity]) -> Quantity:
    """The parameter or input of that name; `KernelError` where a model has none."""
    if name not in quantities:
        raise KernelError(f"{model} has no {kind} {name!r}{nearest(name, quantities)}")
    return quantities[name]


def check_protocol(model: Model, protocol: Protocol) -> None:
    """`KernelError` unless times ascend from the first to a later last one, and inputs are numbers in their bounds."""
    if not isinstance(protocol, Protocol):
        raise KernelError(f"protocol: expected a Protocol, as Protocol.of makes it, but was given {protocol!r}")
    time = np.asarray(protocol.time, dtype=float)
    if not (_ascends(time) and time.size >= 2 and math.isfinite(time[0]) and math.isfinite(time[-1])):
        raise KernelError("protocol: expected at least two finite times [s] that do not descend")
    if not time[-1] > time[0]:
        raise KernelError(f"protocol: expected an end after its start but both are at {time[0]:g} s")
    for q in model.inputs:
        if q.name not in protocol.inputs:
            continue  # the protocol itself says what it lacks
        values = np.asarray(protocol.inputs[q.name], dtype=float)
        if values.shape != time.shape:
            raise KernelError(f"{q.name}: expected {time.size} values, one a time, but was given {values.size}")
        for extreme in (values.min(), values.max()):  # NaN where there is any
            check_value(q, float(extreme))


def ascending(what: str, given: np.ndarray, first: float, last: float) -> np.ndarray:
    """`given` as an array of doubles; `KernelError` unless they are ascending times [s] from `first` to `last`."""
    times = doubles(what, given)
    if not _ascends(times) or (times.size and not first <= times[0] <= times[-1] <= last):
        raise KernelError(f"{what}: expected ascending times from {first:g} to {last:g} s")
    return times


def _ascends(times: np.ndarray) -> bool:
    """Whether these are times (n,) that do not descend, and of several none is NaN."""
    return times.ndim == 1 and bool((times[:-1] <= times[1:]).all())


def doubles(what: str, given: object) -> np.ndarray:
    """`given` as an array of doubles; `KernelError` for what holds no numbers."""
    try:
        return np.ascontiguousarray(given, dtype=float)
    except (TypeError, ValueError):
        raise KernelError(f"{what}: expected numbers but was given {given!r}") from None


def positive(what: str, value: float) -> float:
    """`value`; `KernelError` unless it is a positive finite number."""
    if not isinstance(value, int | float | np.number):
        raise KernelError(f"{what}: expected a positive number but was given {value!r}")
    if not (value > 0 and math.isfinite(value)):
        raise KernelError(f"{what}: expected a positive number but was given {value:g}")
    return value


def whole(what: str, value: int) -> int:
    """`value`; `KernelError` unless it is a positive whole number."""
    if positive(what, value) != int(value):
        raise KernelError(f"{what}: expected a whole number but was given {value:g}")
    return int(value)


def known(model: Model, what: str, given: Sequence[str], names: Collection[str]) -> list[str]:
    """The `given` names; `KernelError` for one that is not among `names`."""
    listed = list_of_names(what, given)
    for name in listed:
        if name not in names:
            raise KernelError(f"{what}: {model.name} has no value {name!r}{nearest(name, names)}")
    return listed


def finite(what: str, found: np.ndarray) -> np.ndarray:
    """`found`; `KernelError` where the equations give no finite number."""
    if not np.all(np.isfinite(found)):
        raise KernelError(f"{what}: the equations give no finite number here; check states, inputs and parameters")
    return found


def vector(what: str, given: Sequence[float] | np.ndarray, names: Sequence[str]) -> np.ndarray:
    """`given` as an array of doubles; `KernelError` unless it holds one finite number for each of `names`."""
    values = doubles(what, given)
    if values.shape != (len(names),):
        raise KernelError(f"{what}: expected {len(names)} values ({', '.join(names)}) but was given {values.size}")
    if not np.all(np.isfinite(values)):
        raise KernelError(f"{what}: expected finite numbers but was given {values[~np.isfinite(values)][0]:g}")
    return values


def check_mesh(mesh: np.ndarray, points: np.ndarray) -> None:
    """`KernelError` unless steps of a mesh (m,) end at all points (n,) of a protocol, but the first."""
    later = points[points > points[0]]
    ends = np.concatenate([points[:1], mesh])
    behind = np.searchsorted(ends, later)
    nearest = np.minimum(np.abs(ends[np.minimum(behind, ends.size - 1)] - later), np.abs(ends[behind - 1] - later))
    if np.any(nearest > ULPS * np.spacing(np.abs(later))):
        raise KernelError("mesh: expected steps that end at every point of the protocol up to the last sample")
