"""Slave: what pythonfmu calls."""

from __future__ import annotations

import math
import sys
from collections.abc import Sequence
from typing import Any

from pythonfmu import Fmi2Slave
from pythonfmu.enums import Fmi2Status

from .curve import fold_point, rest_state
from .ending import release_at_exit
from .guard import Refused, entry, instances_alive, tell_python
from .integrator import HELD, NO_FOLD, Unsolvable, advance
from .messages import check_range, explained, variable_of
from .snapshot import (
    DEFAULT_TOLERANCE,
    FRESH,
    INITIALIZATION,
    INSTANTIATED,
    LARGEST_TOLERANCE,
    MODE_NAMES,
    SMALLEST_TOLERANCE,
    STEPPING,
    TERMINATED,
    Snapshot,
    from_bytes,
    to_bytes,
)
from .stand_in import CURVE, GUID, NAME, VARIABLES, derivatives, outputs, start
from .table import INF, Curve, SlaveVariable, Vector


class PythonSlave(Fmi2Slave):
    """One instance: pythonfmu makes it, calls the methods below and passes on what they log."""

    def __init__(self, **kwargs: Any) -> None:
        super().__init__(**kwargs)
        self.modelName = NAME
        if self.resources in sys.path:  # put there by pythonfmu's library to find this file, and not needed longer
            sys.path.remove(self.resources)
        self._now = FRESH
        # What follows from the snapshot, kept until that changes
        self._start_is_stale = True
        self._y: Vector | None = None
        self._y_has_fold = False
        self._fold_key: Any = None
        self._fold = (0.0, 0.0)  # unknown and load
        instances_alive.add(self)
        if self.resources:
            release_at_exit(self.resources)

    # Initialization

    @entry
    def setup_experiment(
        self, start_time: float, stop_time: float | None = None, tolerance: float | None = None
    ) -> None:
        """Times in s; a tolerance out of bounds is brought into them, with a warning."""
        self._allow("fmi2SetupExperiment", INSTANTIATED)
        if not math.isfinite(start_time):
            raise Refused(f"start time: expected a finite number but was given {start_time:g}")
        if stop_time is not None and not stop_time >= start_time:
            raise Refused(f"stop time: expected at least the start time {start_time:g} but was given {stop_time:g}")
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

    @entry
    def enter_initialization_mode(self) -> None:
        """From here the start follows from parameters and inputs."""
        self._allow("fmi2EnterInitializationMode", INSTANTIATED)
        self._now = self._now._replace(mode=INITIALIZATION)
        self._forget()

    @entry
    def exit_initialization_mode(self) -> None:
        """The start is taken; from here the instance steps."""
        self._allow("fmi2ExitInitializationMode", INITIALIZATION)
        self._take_start()
        self._now = self._now._replace(mode=STEPPING, h=0.0)
        now = self._now
        message = f"initialized at time {now.time:.9g} with tolerance {now.tolerance:g}"
        self.log(message, Fmi2Status.ok, "logEvents")

    @entry
    def terminate(self) -> None:
        """Values can still be read."""
        self._allow("fmi2Terminate", STEPPING)
        self._now = self._now._replace(mode=TERMINATED)

    # Stepping

    @entry
    def do_step(self, current_time: float, step_size: float) -> bool:
        """One communication step, in s; False (fmi2Discard), a message and no change where there is none."""
        try:
            self._allow("fmi2DoStep", STEPPING)
            self._check_step(current_time, step_size)
            self._step(current_time, current_time + step_size)
        except Refused as refusal:
            tell_python(self.instance_name, refusal)
            self.log(str(refusal), Fmi2Status.discard, "logStatusDiscard")
            return False
        return True

    def _check_step(self, time: float, step: float) -> None:
        now = self._now
        if not 0 < step < INF:
            raise Refused(f"communication step size: expected a positive finite number in s but was given {step:g}")
        # Hosts count time in their own ways: allow rounding, and a part of the step that changes nothing
        slack = max(1e-15 * abs(now.time), min(1e-9 * max(abs(now.time), step), 1e-3 * step))
        if not abs(time - now.time) <= slack:
            raise Refused(
                f"communication point: expected the present time {now.time:.12g} s but was given {time:.12g};"
                " the instance neither goes back in time nor skips any, unless a saved state is restored"
            )
        if not math.isfinite(time + step):
            raise Refused(
                f"communication step: expected an end that is a number but {step:g} s after {time:.12g} s there is none"
            )
        if time + step > now.stop + slack:
            raise Refused(
                f"communication step: expected an end at or before the stop time {now.stop:.12g} s but was "
                f"given {time + step:.12g}"
            )
        if not time + step > time:
            raise Refused(
                f"communication step size: {step:g} s is lost in rounding at time {time:.12g} s; expected more"
            )

    def _step(self, time: float, end: float) -> None:
        now = self._now
        try:
            x, h = advance(time, end, now.x, now.h, now.u, now.p, now.tolerance)
        except Unsolvable as failure:
            raise Refused(explained(failure)) from None
        self._now = now._replace(time=end, x=x, h=h)
        self._y = None

    # Values

    @entry
    def get_real(self, vrs: list[int]) -> list[float]:
        """Values in SI units."""
        return self._get("fmi2GetReal", "Real", vrs)

    @entry
    def get_integer(self, vrs: list[int]) -> list[int]:
        """Integer parameters."""
        return [int(value) for value in self._get("fmi2GetInteger", "Integer", vrs)]

    @entry
    def get_boolean(self, vrs: list[int]) -> list[bool]:
        """Boolean parameters."""
        return [value != 0 for value in self._get("fmi2GetBoolean", "Boolean", vrs)]

    @entry
    def get_string(self, vrs: list[int]) -> list[str]:
        """There are none."""
        return [str(value) for value in self._get("fmi2GetString", "String", vrs)]

    @entry
    def set_real(self, vrs: list[int], values: list[float]) -> None:
        """Inputs and real parameters in SI units; they hold from now on."""
        self._set("fmi2SetReal", "Real", vrs, values)

    @entry
    def set_integer(self, vrs: list[int], values: list[int]) -> None:
        """Integer parameters."""
        self._set("fmi2SetInteger", "Integer", vrs, values)

    @entry
    def set_boolean(self, vrs: list[int], values: list[bool]) -> None:
        """Boolean parameters."""
        self._set("fmi2SetBoolean", "Boolean", vrs, [bool(value) for value in values])

    @entry
    def set_string(self, vrs: list[int], values: list[str]) -> None:
        """There are none."""
        self._set("fmi2SetString", "String", vrs, [0.0 for _ in values])

    def _get(self, function: str, transported: str, vrs: Sequence[int]) -> list[float]:
        self._allow(function, INITIALIZATION | STEPPING | TERMINATED)
        return [self._value(variable_of(function, transported, vr)) for vr in vrs]

    def _value(self, variable: SlaveVariable) -> float:
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
            raise Refused(f"{variable.name} is not a finite number at time {now.time:.9g}; check inputs and parameters")
        return float(value)

    def _calculated(self, variable: SlaveVariable) -> float:
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
            variable = variable_of(function, transported, vr)
            self._check_settable(function, variable)
            check_range(function, variable, value)
            (u if variable.kind == "INPUT" else p)[variable.place] = float(value)
        changed = (tuple(u), tuple(p)) != (now.u, now.p)
        if changed:
            self._now = now._replace(u=tuple(u), p=tuple(p))
            self._forget()

    def _check_settable(self, function: str, variable: SlaveVariable) -> None:
        if variable.kind == "INPUT":
            return
        if variable.kind != "PARAMETER":
            raise Refused(
                f"{function}: {variable.name} is calculated by the model and cannot be set; set inputs and parameters"
            )
        if variable.variability == "fixed" and self._now.mode == STEPPING:
            raise Refused(
                f"{function}: {variable.name} is a fixed parameter; set it before the end of initialization mode"
            )

    # Saved states

    @entry
    def _get_fmu_state(self) -> Snapshot:
        now = self._now
        return now._replace(x=FRESH.x) if now.mode == INITIALIZATION else now  # there x follows from the rest

    @entry
    def _set_fmu_state(self, state: Any) -> None:
        if not isinstance(state, Snapshot):
            raise Refused(f"fmi2SetFMUstate: expected a state of {NAME} {GUID} but was given another")
        self._now = state
        self._forget()

    @staticmethod
    @entry
    def _fmu_state_to_bytes(state: Any) -> bytes:
        if not isinstance(state, Snapshot):
            raise Refused(f"fmi2SerializeFMUstate: expected a state of {NAME} {GUID} but was given another")
        return to_bytes(state)

    @staticmethod
    @entry
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
                    f"and the fold at {load:.6g}, but the load was {now.u[CURVE.load]:.6g}; lower the load,"
                    " change the other inputs, or do not start at equilibrium"
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
