"""A co-simulation slave in plain Python: one model, one file, nothing but Python's standard library.

`python_fmu.py` puts an emitted model in place of the stand-in below, and this becomes the code of an FMU. As
it stands it simulates the stand-in, so that it can be imported, run and checked by itself::

    slave = Slave(instance_name="test")
    slave.setup_experiment(0.0, None, None)
    slave.enter_initialization_mode()
    slave.set_real([1], [0.4])
    slave.exit_initialization_mode()
    slave.do_step(0.0, 0.01)
    slave.get_real([2])
"""

# Nothing here needs more than Python 3.9, because the host brings the Python (hence no zip(strict=...)).
# ruff: noqa: B905

from __future__ import annotations

import ctypes
import functools
import hashlib
import logging
import math
import struct
import sys
import weakref
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

from pythonfmu import Fmi2Slave
from pythonfmu.enums import Fmi2Status

INF = math.inf
Vector = Sequence[float]


class Variable(NamedTuple):
    """What modelDescription.xml says of a variable; its value reference is its place in `VARIABLES`."""

    name: str
    unit: str
    kind: str  # TIME, INPUT, OUTPUT, STATE, DERIVATIVE, PARAMETER or FOLD
    place: int  # in the tuple of its kind
    type: str  # Real, Integer or Boolean
    variability: str
    minimum: float
    maximum: float
    start: float
    needs_fold: bool  # its value needs the fold of the equilibrium curve


class Curve(NamedTuple):
    """The equilibrium curve load = f(unknown): see `fold_point` and `rest_state`."""

    load: int  # the input that is the load
    switch: int  # the parameter that starts the model on the curve
    moved_by: tuple[int, ...]  # the inputs that move the curve
    lower: float  # the branch in use begins here,
    fold_lower: float  # its fold is sought from here
    upper: float  # to here


# Model: a stand-in, replaced by the emitted one -----------------------------------------------------------

NAME = "StandIn"
GUID = "{00000000-0000-4000-8000-000000000000}"
VARIABLES: tuple[Variable, ...] = (
    Variable("time", "s", "TIME", 0, "Real", "continuous", -INF, INF, 0.0, False),
    Variable("load", "N", "INPUT", 0, "Real", "continuous", -INF, INF, 0.0, False),
    Variable("x", "1", "STATE", 0, "Real", "continuous", -10.0, INF, 0.0, False),
    Variable("margin", "N", "OUTPUT", 0, "Real", "continuous", -INF, INF, 0.0, True),
    Variable("der(x)", "1/s", "DERIVATIVE", 0, "Real", "continuous", -INF, INF, 0.0, False),
    Variable("damping", "N.s", "PARAMETER", 0, "Real", "tunable", 1e-3, INF, 0.1, False),
    Variable("at_rest", "1", "PARAMETER", 1, "Boolean", "fixed", -INF, INF, 0.0, False),
)
NOMINAL = (1.0,)
FLOORS = ((0, -10.0),)
CURVE: Curve | None = Curve(0, 1, (), -1.0, 0.0, 2.0)


def derivatives(time: float, x: Vector, u: Vector, du: Vector, p: Vector, fold: Vector) -> Vector:
    """A softening spring (x - x^3 / 3) and a damper under a load."""
    return ((u[0] - x[0] + x[0] ** 3 / 3) / p[0],)


def outputs(time: float, x: Vector, u: Vector, du: Vector, p: Vector, fold: Vector) -> Vector:
    """The outputs that are not states."""
    return (fold[0] - u[0],)


def start(u: Vector, p: Vector) -> Vector:
    """Initial states away from equilibrium."""
    return (0.0,)


def equilibrium(unknown: float, u: Vector, p: Vector) -> tuple[float, float, Vector]:
    """The load at rest over x, its slope, and the states there."""
    return unknown - unknown**3 / 3, 1 - unknown**2, (unknown,)


PLACES = ((0, 0),)


def linearise(
    time: float, x: Vector, u: Vector, du: Vector, p: Vector, fold: Vector
) -> tuple[Vector, Vector, Vector]:
    """State derivatives, d(dx)/dx at `PLACES` (elsewhere it is zero), and d(dx)/dt at fixed states."""
    return derivatives(time, x, u, du, p, fold), ((x[0] ** 2 - 1) / p[0],), (du[0] / p[0],)


def multiply(J: Vector, v: Vector) -> Vector:
    """J v."""
    return (J[0] * v[0],)


def factorise(shift: float, J: Vector) -> tuple[Vector, Vector]:
    """Factors of shift I - J, and the pivots."""
    pivot = shift - J[0]
    return (1 / pivot,), (pivot,)


def solve(L: Vector, b: Vector) -> Vector:
    """k with (shift I - J) k = b."""
    return (L[0] * b[0],)


# Integrator -----------------------------------------------------------------------------------------------
#
# Rodas5P: a stiffly accurate, L-stable Rosenbrock method of order 5 with an embedded order 4, in eight
# stages. G. Steinebach, "Construction of Rosenbrock-Wanner method Rodas5P and numerical benchmarks within the
# Julia Differential Equations package", BIT Numerical Mathematics 63:27, 2023. It uses the exact Jacobian.
# Inputs are held during a communication step.

MAX_STEPS = 100_000  # internal steps in one communication step: bounded, so that no call hangs
NX = len(NOMINAL)
HELD = (0.0,) * sum(v.kind == "INPUT" for v in VARIABLES)  # rates of the inputs
NO_FOLD = (0.0,)  # no state derivative may use the fold: it is an output only
GAMMA = 0.21193756319429014


class Unsolvable(ArithmeticError):
    """The integrator came to `time` and states `x` and no further; the text says why."""

    def __init__(self, why: str, time: float, x: Vector) -> None:
        super().__init__(why)
        self.time, self.x = time, x


LATELY = 10  # attempts: where one of the last ones came to a state's minimum, that is why there is no step
BELOW = -1.0  # what `attempt` gives for an error where a state goes below its minimum


class BelowMinimum(ArithmeticError):
    """A step or a stage of it left the range in which the equations hold."""


def check_above(x: Vector) -> None:
    """Raises `BelowMinimum` where a state is not above its minimum (`FLOORS`: places and minima)."""
    for place, floor in FLOORS:
        if x[place] <= floor:
            raise BelowMinimum


class Begin(NamedTuple):
    """The equations at the beginning of a step."""

    time: float
    x: Vector
    dx: Vector
    J: Vector  # the entries of d(dx)/dx at `PLACES`
    dx_dt: Vector
    scale: Vector  # one over the tolerance of each state


def linearised(time: float, x: Vector, u: Vector, p: Vector, tolerance: float) -> Begin:
    """The equations at (time, x); tolerances are relative to |x| + nominal."""
    try:
        dx, J, dx_dt = linearise(time, x, u, HELD, p, NO_FOLD)
    except (ArithmeticError, ValueError):  # division by zero, root of a negative number, overflow
        raise Unsolvable("size", time, x) from None
    scale = [1 / (tolerance * (nominal + abs(a))) for nominal, a in zip(NOMINAL, x)]
    return Begin(time, x, dx, J, dx_dt, scale)


def mean_square(scale: Vector, value: Vector) -> float:
    """Mean square of the values over their tolerances."""
    total = 0.0
    for s, v in zip(scale, value):
        scaled = s * v
        total += scaled * scaled
    return total / NX


class Stage(NamedTuple):
    """One stage: its place in the step, and its weights of d(dx)/dt and of the stages before it. Where there
    is no `a`, it stands at the stage before plus that one's k."""

    alpha: float
    delta: float
    a: tuple[float, ...]
    c: tuple[float, ...]


# fmt: off
STAGES = (
    Stage(0.0, 0.21193756319429014, (), ()),
    Stage(0.6358126895828704, -0.42387512638858027, (3.0,), (-14.155112264123755,)),
    Stage(0.4095798393397535, -0.3384627126235924, (2.849394379747939, 0.45842242204463923),
          (-17.97296035885952, -2.859693295451294)),
    Stage(0.9769306725060716, 1.8046452872882734,
          (-6.954028509809101, 2.489845061869568, -10.358996098473584),
          (147.12150275711716, -1.41221402718213, 71.68940251302358)),
    Stage(0.4288403609558664, 2.325825639765069,
          (2.8029986275628964, 0.5072464736228206, -0.3988312541770524, -0.04721187230404641),
          (165.43517024871676, -0.4592823456491126, 42.90938336958603, -5.961986721573306)),
    Stage(1.0, 0.0,
          (-7.502846399306121, 2.561846144803919, -11.627539656261098, -0.18268767659942256,
           0.030198172008377946),
          (24.854864614690072, -3.0009227002832186, 47.4931110020768, 5.5814197821558125,
           -0.6610691825249471)),
    Stage(1.0, 0.0, (),
          (30.91273214028599, -3.1208243349937974, 77.79954646070892, 34.28646028294783, -19.097331116725623,
           -28.087943162872662)),
    Stage(1.0, 0.0, (),
          (37.80277123390563, -3.2571969029072276, 112.26918849496327, 66.9347231244047, -40.06618937091002,
           -54.66780262877968, -9.48861652309627)),
)
# fmt: on


def stages(
    time: float, x: Vector, dx: Vector, dx_dt: Vector, h: float, L: Vector, u: Vector, p: Vector
) -> tuple[Vector, Vector]:
    """One step of size h: the states at its end and their error. `L` are the factors of I / (h GAMMA) - J.

    Most of the time goes into this function, so an FMU has it written out for the states of its model.
    """
    y, rates = list(x), dx
    k: list[Vector] = []
    for stage in STAGES:
        if stage.a:
            y = [x[i] + sum(a * before[i] for a, before in zip(stage.a, k)) for i in range(NX)]
        elif k:
            y = [y[i] + k[-1][i] for i in range(NX)]
        if k:
            check_above(y)
            rates = derivatives(time + stage.alpha * h, y, u, HELD, p, NO_FOLD)
        sums = [sum(c * before[i] for c, before in zip(stage.c, k)) for i in range(NX)]
        k.append(solve(L, [rates[i] + sums[i] / h + stage.delta * h * dx_dt[i] for i in range(NX)]))
    return tuple(y[i] + k[-1][i] for i in range(NX)), k[-1]


def attempt(begin: Begin, h: float, u: Vector, p: Vector) -> tuple[Vector, float]:
    """One step: the states at its end, and the square of the error over its tolerance, infinite where the
    step broke down, `BELOW` where a state left the range of the equations.

    A pivot that is small beside the shift has lost its digits.
    """
    shift = 1 / (h * GAMMA)
    try:
        L, pivots = factorise(shift, begin.J)
        if not min(map(abs, pivots)) > 1e-9 * shift:
            return begin.x, INF
        x_new, difference = stages(begin.time, begin.x, begin.dx, begin.dx_dt, h, L, u, p)
        check_above(x_new)
    except BelowMinimum:
        return begin.x, BELOW
    except (ArithmeticError, ValueError):
        return begin.x, INF
    error = mean_square(begin.scale, difference)
    return x_new, error if error < INF else INF


def growth(error: float) -> float:
    """By how much the step may grow (or must shrink) for the square of an error of order 5."""
    if not 0 <= error < INF:
        return 0.1
    return min(10.0, max(0.1, 0.8 * max(error, 1e-12) ** -0.1))


def resolving_step(begin: Begin, limit: float) -> float:
    """A step that resolves the fastest motion, at most `limit`: where inputs or states have jumped, the step
    size of before says nothing.

    Along the solution x'' = J x' + dx/dt, and x''' is near J x''. Their ratio is the speed of the fastest
    motion, and x'' over the square of that speed how far it goes; beyond the tolerance, the step should
    resolve it.
    """
    second = [a + b for a, b in zip(multiply(begin.J, begin.dx), begin.dx_dt)]
    a = mean_square(begin.scale, second)
    b = mean_square(begin.scale, multiply(begin.J, second))
    if not (0 < a < INF and 0 < b < INF):
        return limit
    speed = b / a  # squares, here and below
    reach = a / speed / speed
    return min(limit, (1e-6 * reach) ** -0.1 / math.sqrt(speed)) if 1 < reach < INF else limit


def advance(
    time: float, end: float, x: Vector, h: float, u: Vector, p: Vector, tolerance: float
) -> tuple[Vector, float]:
    """From `time` to `end` under the inputs `u`: the states there, and the step size to go on with. `h` is
    the step size of before, or 0. Raises `Unsolvable`."""
    begin = linearised(time, x, u, p, tolerance)
    h = resolving_step(begin, h if h > 0 else end - time)
    tries, since_below = 0, LATELY
    while True:
        left = end - begin.time
        wanted, rejected = h, False
        while True:
            tries += 1
            if tries > MAX_STEPS:
                raise Unsolvable("steps", begin.time, begin.x)
            last = wanted >= left - max(1e-9 * left, 4e-15 * abs(begin.time))  # leave no crumbs
            step = left if last else wanted
            if not (step > 4e-16 * abs(begin.time) and step > 1e-300):
                raise Unsolvable("minimum" if since_below < LATELY else "size", begin.time, begin.x)
            x_new, error = attempt(begin, step, u, p)
            proposed = step * growth(error)
            since_below = 0 if error == BELOW else since_below + 1
            if 0 <= error <= 1:
                break
            wanted, rejected = proposed, True
        h = min(proposed, step) if rejected else max(proposed, wanted) if last else proposed
        if last:
            return x_new, h
        begin = linearised(begin.time + step, x_new, u, p, tolerance)


# Equilibrium ----------------------------------------------------------------------------------------------

SCAN = 100  # scanning steps along the curve: folds closer than (upper - fold_lower) / SCAN are not told apart


def falling_zero(f: Callable[[float], float], a: float, b: float) -> float:
    """The zero between a (value positive) and b (not positive): regula falsi with Illinois weights."""
    fa, fb, middle, side = f(a), f(b), b, 0
    for _ in range(200):
        if not (fb != 0 and b - a > 4e-16 * b):
            break
        middle = (fa * b - fb * a) / (fa - fb)
        if not a < middle < b:
            middle = 0.5 * (a + b)
        value = f(middle)
        if value > 0:
            a, fa = middle, value
            fb *= 0.5 if side == 1 else 1.0
            side = 1
        elif value < 0:
            b, fb = middle, value
            fa *= 0.5 if side == -1 else 1.0
            side = -1
        else:
            return middle
    return middle


def fold_point(curve: Curve, u: Vector, p: Vector) -> tuple[float, float]:
    """Unknown and load at the first local maximum of the load; at the interval's end if there is none."""

    def slope(unknown: float) -> float:
        return equilibrium(unknown, u, p)[1]

    width = (curve.upper - curve.fold_lower) / SCAN
    unknown = curve.upper
    if not slope(curve.fold_lower) > 0:
        unknown = curve.fold_lower
    else:
        for i in range(1, SCAN + 1):
            right = curve.fold_lower + i * width
            if not slope(right) > 0:
                unknown = falling_zero(slope, right - width, right)
                break
    return unknown, equilibrium(unknown, u, p)[0]


def rest_state(curve: Curve, u: Vector, p: Vector, fold: float) -> Vector | None:
    """The states at rest under the inputs, on the branch before the unknown `fold`; None if there is none."""

    def surplus(unknown: float) -> float:
        return u[curve.load] - equilibrium(unknown, u, p)[0]

    if not surplus(curve.lower) > 0 or not surplus(fold) <= 0:
        return None
    return equilibrium(falling_zero(surplus, curve.lower, fold), u, p)[2]


# States that can be saved ---------------------------------------------------------------------------------

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
    time=0.0, start=0.0, stop=INF, tolerance=DEFAULT_TOLERANCE, h=0.0, x=(0.0,) * NX,
    u=tuple(v.start for v in VARIABLES if v.kind == "INPUT"),
    p=tuple(v.start for v in VARIABLES if v.kind == "PARAMETER"),
    mode=INSTANTIATED,
)  # fmt: skip

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


# What pythonfmu calls -------------------------------------------------------------------------------------


class Refused(ValueError):
    """A call that was refused; nothing has changed."""

    def __repr__(self) -> str:
        return str(self)  # pythonfmu's library logs the repr


_instances: weakref.WeakSet[Slave] = weakref.WeakSet()


def _survive(*instances: Slave) -> None:
    """Keep the instances usable after an exception that goes out to pythonfmu's library.

    That library (0.7) answers every exception with fmi2Fatal and gives up its references to the instance, its
    class and its messages, yet goes on using them: without one more reference to each, the second refusal
    would bring down the host's process. Static methods do not know their instance, so they save all of them.
    """
    for kept in (Slave, *instances, *(instance.log_queue for instance in instances)):
        ctypes.pythonapi.Py_IncRef(ctypes.py_object(kept))


def _tell_python(who: str, error: BaseException) -> None:
    """To Python's log as well: pythonfmu's library passes on messages only if the host asked for logging."""
    logging.getLogger(NAME).error("%s: %s", who, error, exc_info=not isinstance(error, Refused))


def _entry(method: Callable[..., Any]) -> Callable[..., Any]:
    """A method that pythonfmu's library calls."""

    @functools.wraps(method)
    def guarded(*arguments: Any) -> Any:
        try:
            return method(*arguments)
        except BaseException as error:
            known = isinstance(arguments[0], Slave)
            _tell_python(arguments[0].instance_name if known else NAME, error)
            _survive(*([arguments[0]] if known else _instances))
            raise

    return guarded


class Slave(Fmi2Slave):
    """One instance: pythonfmu makes it, calls the methods below and passes on what they log."""

    def __init__(self, **kwargs: Any) -> None:
        super().__init__(**kwargs)
        self.modelName = NAME
        if (
            self.resources in sys.path
        ):  # put there by pythonfmu's library to find this file, and not needed longer
            sys.path.remove(self.resources)
        self._now = FRESH
        # What follows from the snapshot, kept until that changes
        self._start_is_stale = True
        self._y: Vector | None = None
        self._y_has_fold = False
        self._fold_key: Any = None
        self._fold = (0.0, 0.0)  # unknown and load
        _instances.add(self)

    # Initialization

    @_entry
    def setup_experiment(
        self, start_time: float, stop_time: float | None = None, tolerance: float | None = None
    ) -> None:
        """Times in s; a tolerance out of bounds is brought into them, with a warning."""
        self._allow("fmi2SetupExperiment", INSTANTIATED)
        if not math.isfinite(start_time):
            raise Refused(f"start time: expected a finite number but was given {start_time:g}")
        if stop_time is not None and not stop_time >= start_time:
            raise Refused(
                f"stop time: expected at least the start time {start_time:g} but was given {stop_time:g}"
            )
        if tolerance is not None and not 0 < tolerance < INF:
            raise Refused(f"tolerance: expected a positive number but was given {tolerance:g}")
        used = DEFAULT_TOLERANCE
        if tolerance is not None:
            used = min(LARGEST_TOLERANCE, max(SMALLEST_TOLERANCE, tolerance))
            if used != tolerance:
                message = (
                    f"tolerance: expected {SMALLEST_TOLERANCE:g} to {LARGEST_TOLERANCE:g} but was given "
                    f"{tolerance:g}; using {used:g}"
                )
                self.log(message, Fmi2Status.warning, "logStatusWarning")
        stop = INF if stop_time is None else stop_time
        self._now = self._now._replace(time=start_time, start=start_time, stop=stop, tolerance=used)

    @_entry
    def enter_initialization_mode(self) -> None:
        """From here the start follows from parameters and inputs."""
        self._allow("fmi2EnterInitializationMode", INSTANTIATED)
        self._now = self._now._replace(mode=INITIALIZATION)
        self._forget()

    @_entry
    def exit_initialization_mode(self) -> None:
        """The start is taken; from here the instance steps."""
        self._allow("fmi2ExitInitializationMode", INITIALIZATION)
        self._take_start()
        self._now = self._now._replace(mode=STEPPING, h=0.0)
        now = self._now
        message = f"initialized at time {now.time:.9g} with tolerance {now.tolerance:g}"
        self.log(message, Fmi2Status.ok, "logEvents")

    @_entry
    def terminate(self) -> None:
        """Values can still be read."""
        self._allow("fmi2Terminate", STEPPING)
        self._now = self._now._replace(mode=TERMINATED)

    # Stepping

    @_entry
    def do_step(self, current_time: float, step_size: float) -> bool:
        """One communication step, in s; False (fmi2Discard), a message and no change where there is none."""
        try:
            self._allow("fmi2DoStep", STEPPING)
            self._check_step(current_time, step_size)
            self._step(current_time, current_time + step_size)
        except Refused as refusal:
            _tell_python(self.instance_name, refusal)
            self.log(str(refusal), Fmi2Status.discard, "logStatusDiscard")
            return False
        return True

    def _check_step(self, time: float, step: float) -> None:
        now = self._now
        if not 0 < step < INF:
            raise Refused(
                f"communication step size: expected a positive finite number in s but was given {step:g}"
            )
        # Hosts count time in their own ways: allow rounding, and a part of the step that changes nothing
        slack = max(1e-15 * abs(now.time), min(1e-9 * max(abs(now.time), step), 1e-3 * step))
        if not abs(time - now.time) <= slack:
            raise Refused(
                f"communication point: expected the present time {now.time:.12g} s but was given {time:.12g};"
                " the instance neither goes back in time nor skips any, unless a saved state is restored"
            )
        if not math.isfinite(time + step):
            raise Refused(
                f"communication step: expected an end that is a number but {step:g} s after {time:.12g} s "
                "there is none"
            )
        if time + step > now.stop + slack:
            raise Refused(
                f"communication step: expected an end at or before the stop time {now.stop:.12g} s but was "
                f"given {time + step:.12g}"
            )
        if not time + step > time:
            raise Refused(
                f"communication step size: {step:g} s is lost in rounding at time {time:.12g} s; expected "
                "more"
            )

    def _step(self, time: float, end: float) -> None:
        now = self._now
        try:
            x, h = advance(time, end, now.x, now.h, now.u, now.p, now.tolerance)
        except Unsolvable as failure:
            raise Refused(_explained(failure)) from None
        self._now = now._replace(time=end, x=x, h=h)
        self._y = None

    # Values

    @_entry
    def get_real(self, vrs: list[int]) -> list[float]:
        """Values in SI units."""
        return self._get("fmi2GetReal", "Real", vrs)

    @_entry
    def get_integer(self, vrs: list[int]) -> list[int]:
        """Integer parameters."""
        return [int(value) for value in self._get("fmi2GetInteger", "Integer", vrs)]

    @_entry
    def get_boolean(self, vrs: list[int]) -> list[bool]:
        """Boolean parameters."""
        return [value != 0 for value in self._get("fmi2GetBoolean", "Boolean", vrs)]

    @_entry
    def get_string(self, vrs: list[int]) -> list[str]:
        """There are none."""
        return [str(value) for value in self._get("fmi2GetString", "String", vrs)]

    @_entry
    def set_real(self, vrs: list[int], values: list[float]) -> None:
        """Inputs and real parameters in SI units; they hold from now on."""
        self._set("fmi2SetReal", "Real", vrs, values)

    @_entry
    def set_integer(self, vrs: list[int], values: list[int]) -> None:
        """Integer parameters."""
        self._set("fmi2SetInteger", "Integer", vrs, values)

    @_entry
    def set_boolean(self, vrs: list[int], values: list[bool]) -> None:
        """Boolean parameters."""
        self._set("fmi2SetBoolean", "Boolean", vrs, [bool(value) for value in values])

    @_entry
    def set_string(self, vrs: list[int], values: list[str]) -> None:
        """There are none."""
        self._set("fmi2SetString", "String", vrs, [0.0 for _ in values])

    def _get(self, function: str, transported: str, vrs: Sequence[int]) -> list[float]:
        self._allow(function, INITIALIZATION | STEPPING | TERMINATED)
        return [self._value(_variable(function, transported, vr)) for vr in vrs]

    def _value(self, variable: Variable) -> float:
        now = self._now
        if variable.kind == "TIME":
            return now.time
        if variable.kind == "INPUT":
            return now.u[variable.place]
        if variable.kind == "PARAMETER":
            return now.p[variable.place]
        self._take_start()
        try:
            value = self._calculated(variable)
        except (ArithmeticError, ValueError):
            value = math.nan
        if not math.isfinite(value):
            raise Refused(
                f"{variable.name} is not a finite number at time {now.time:.9g}; check inputs and parameters"
            )
        return float(value)

    def _calculated(self, variable: Variable) -> float:
        """States, their derivatives, the fold and outputs; outputs together, and only when one is wanted."""
        now = self._now
        if variable.kind == "STATE":
            return now.x[variable.place]
        if variable.kind == "DERIVATIVE":
            return derivatives(now.time, now.x, now.u, HELD, now.p, NO_FOLD)[variable.place]
        if variable.kind == "FOLD":
            return self._fold_now()[1]
        if self._y is None or (variable.needs_fold and not self._y_has_fold):
            fold = (self._fold_now()[1],) if variable.needs_fold else NO_FOLD
            self._y = outputs(now.time, now.x, now.u, HELD, now.p, fold)
            self._y_has_fold = variable.needs_fold
        return self._y[variable.place]

    def _fold_now(self) -> tuple[float, float]:
        """The fold under the present inputs; calculated anew only where they or the parameters moved it."""
        assert CURVE is not None
        now = self._now
        key = (tuple(now.u[i] for i in CURVE.moved_by), now.p)
        if key != self._fold_key:
            self._fold = fold_point(CURVE, now.u, now.p)
            self._fold_key = key
        return self._fold

    def _set(self, function: str, transported: str, vrs: Sequence[int], values: Sequence[float]) -> None:
        self._allow(function, INSTANTIATED | INITIALIZATION | STEPPING)
        now = self._now
        u, p = list(now.u), list(now.p)
        for vr, value in zip(vrs, values):
            variable = _variable(function, transported, vr)
            self._check_settable(function, variable)
            _check_range(function, variable, value)
            (u if variable.kind == "INPUT" else p)[variable.place] = float(value)
        changed = (tuple(u), tuple(p)) != (now.u, now.p)
        if changed:
            self._now = now._replace(u=tuple(u), p=tuple(p))
            self._forget()

    def _check_settable(self, function: str, variable: Variable) -> None:
        if variable.kind == "INPUT":
            return
        if variable.kind != "PARAMETER":
            raise Refused(
                f"{function}: {variable.name} is calculated by the model and cannot be set; set inputs and "
                "parameters"
            )
        if variable.variability == "fixed" and self._now.mode == STEPPING:
            raise Refused(
                f"{function}: {variable.name} is a fixed parameter; set it before the end of initialization "
                "mode"
            )

    # Saved states

    @_entry
    def _get_fmu_state(self) -> Snapshot:
        now = self._now
        return now._replace(x=FRESH.x) if now.mode == INITIALIZATION else now  # there x follows from the rest

    @_entry
    def _set_fmu_state(self, state: Any) -> None:
        if not isinstance(state, Snapshot):
            raise Refused(f"fmi2SetFMUstate: expected a state of {NAME} {GUID} but was given another")
        self._now = state
        self._forget()

    @staticmethod
    @_entry
    def _fmu_state_to_bytes(state: Any) -> bytes:
        if not isinstance(state, Snapshot):
            raise Refused(f"fmi2SerializeFMUstate: expected a state of {NAME} {GUID} but was given another")
        return to_bytes(state)

    @staticmethod
    @_entry
    def _fmu_state_from_bytes(state: bytes) -> Snapshot:
        return from_bytes(state)

    # Within

    def _allow(self, function: str, modes: int) -> None:
        mode = self._now.mode
        if not mode & modes:
            raise Refused(f"{function} cannot be called {MODE_NAMES[mode]}; the call was ignored")

    def _forget(self) -> None:
        self._start_is_stale = True
        self._y = None

    def _take_start(self) -> None:
        """Initial states from parameters and inputs, while in initialization mode."""
        now = self._now
        if now.mode != INITIALIZATION or not self._start_is_stale:
            return
        x: Vector | None = start(now.u, now.p)
        if CURVE is not None and now.p[CURVE.switch] != 0:
            x, load = self._rest(CURVE)
            if x is None:
                raise Refused(
                    "no rest state to start at: expected a load between that of the lower end of the curve "
                    f"and the fold at {load:.6g}, but the load was {now.u[CURVE.load]:.6g}; lower the load or"
                    " the voltage, or do not start at equilibrium"
                )
        assert x is not None
        for variable in VARIABLES:
            if variable.kind == "STATE" and x[variable.place] <= variable.minimum:
                raise Refused(
                    f"start value of {variable.name}: expected more than {variable.minimum:g}, where the "
                    f"equations end, but was given {x[variable.place]:.6g}"
                )
        self._now = now._replace(x=tuple(x))
        self._start_is_stale = False
        self._y = None

    def _rest(self, curve: Curve) -> tuple[Vector | None, float]:
        """The states at rest, or None, and the load at the fold."""
        try:
            unknown, load = self._fold_now()
            return rest_state(curve, self._now.u, self._now.p, unknown), load
        except (ArithmeticError, ValueError):
            return None, math.nan


def _variable(function: str, transported: str, vr: int) -> Variable:
    """The variable of a value reference, if it is of the type that the function transports."""
    if not 0 <= vr < len(VARIABLES):
        raise Refused(f"{function}: unknown value reference {vr}; expected 0 to {len(VARIABLES) - 1}")
    variable = VARIABLES[vr]
    if variable.type != transported:
        raise Refused(
            f"{function}: {variable.name} is of type {variable.type}, not {transported}; use the function of "
            "its type"
        )
    return variable


def _check_range(function: str, variable: Variable, value: float) -> None:
    subject = f"{function}: {variable.name}"
    unit = "" if variable.unit == "1" else f" {variable.unit}"
    if not math.isfinite(value):
        in_unit = f" in{unit}" if unit else ""
        raise Refused(f"{subject}: expected a finite number{in_unit} but was given {value:g}")
    if value < variable.minimum:
        raise Refused(f"{subject}: expected at least {variable.minimum:g}{unit} but was given {value:g}")
    if value > variable.maximum:
        raise Refused(f"{subject}: expected at most {variable.maximum:g}{unit} but was given {value:g}")


def _explained(failure: Unsolvable) -> str:
    """What the integrator could not do, and where it was."""
    states = sorted((v for v in VARIABLES if v.kind == "STATE"), key=lambda v: v.place)
    values = ", ".join(f"{v.name} = {value:.6g}" for v, value in zip(states, failure.x))
    where = f"at time {failure.time:.9g} with {values}; the instance is as it was before the step"
    if str(failure) == "steps":
        return (
            f"more than {MAX_STEPS} internal steps were needed: stopped {where}; use a shorter step or a "
            "larger tolerance"
        )
    if str(failure) == "minimum":
        v = min(states, key=lambda v: (failure.x[v.place] - v.minimum) / NOMINAL[v.place])
        return (
            f"{v.name} would come to {v.minimum:g}, where the equations end, {where}; check inputs and "
            "parameters, and their units"
        )
    return f"no step size, however small, solves the equations {where}; check inputs and parameters"
