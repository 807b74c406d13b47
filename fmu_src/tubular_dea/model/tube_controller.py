r"""The tube controller: it holds the tube at a radius by its voltage, also where the tube would not stay by itself.

::

    reference_radius --[ ramp ]--> r --+--> [ computed voltage ] --> [ limits ] --> [ amplifier ] --> voltage
                                       ^             ^                                   |
                                       |   estimate  |                                   |
                                    [ observer: model + bias ] <-------------------------'
                                       ^          ^
                              pressure |          | displacement

Linearisation. The wall's mass matters above 3 kHz only (its eigenvalue is -164 000 1/s at 25 mm), so that the balance
of equation (16), solved for the damper's rate, is the whole model: with the declaration's own expressions at the
estimated stretch l,

    damping(l) dl/dt = pressure + bias - elastic(l) - share(l) (s_1 + s_2) + electric(l) V^2,
    ds_i/dt = k_i dlambda_1/dt - k_i / eta_i s_i.

V^2 enters alone and linearly: the voltage that gives any wanted rate is computed (exact linearisation, and no gain to
be scheduled). What is left is dl/dt = wanted rate, an integrator; LQR gives its gain, and with it all that is fast in
the closed loop. The branches s_i decay by themselves (-3 and -0.37 1/s): their estimate needs no correction.

Observer. The same model, corrected by the measured displacement; `bias`, a pressure, is what the model lacks (wrong
parameters, an offset of the pressure). Its gains are a Kalman filter's at the design point. It is also the controller's
integral action; since it is driven by the voltage that was applied, limits included, it does not wind up.

Limits: the field at the estimated stretch; no voltage below 0; slew rate and current of the amplifier. The reference
ramps by `reference_rate` and waits for the tube where that cannot follow by `lead`.

Modes: 1 track; 0 safe, where `enable` is 0: the voltage goes to `safe_voltage` by `fallback_slew`, the observer goes
on, and tracking starts again from where the tube is (bumpless); 2 fault: as 0, from the time the displacement is off
what the model says by `innovation_limit`, or the radius is beyond `largest_radius`, until `enable` is taken away.
Without voltage the tube falls back to its stable branch from every radius up to 25.6 mm below 170 mmHg.

Sampled every `sample_time`, whatever the communication step; exact where the master lands on `next_event`.

Citation: N. Liu et al., Section V (control beyond the snap-through as the next step); gains: LQR and Kalman filter of
the design point.

Parameters: its own, and the tube's (Tables I and III of the paper) as assumed by the controller.

Usage::

    from tubular_dea.model.tube_controller import tube_controller
    model = tube_controller({"field_limit": 140e6})
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import sympy
from sympy import And, Max, Min, Or, sqrt

from .amplifier import QUANTITIES as AMPLIFIER
from .amplifier import VOLTAGE, amplifier
from .dea import tubular_dea
from .declare import TIME, Model, Parameter, Quantity, sized
from .reduced import PARTS, reduced
from .sampled import SOON, Rules, choose, no, yes
from .whole import whole

REFERENCE = Quantity("reference_radius", "m", "Radius to hold", 0.02, "", 0.0151, 0.0275, 1e-2, "mm")
PRESSURE = Quantity(
    "pressure", "Pa", "Transmural pressure of the tube, as measured", 0.0, nominal=1e4, display_unit="mmHg"
)
DISPLACEMENT = Quantity(
    "displacement", "m", "Radial displacement of the tube, as measured", 0.0, nominal=1e-3, display_unit="mm"
)
ENABLE = Quantity("enable", "1", "Above 0.5: track the reference; else go to the safe voltage", 1.0)
INPUTS = (REFERENCE, PRESSURE, DISPLACEMENT, ENABLE)


STRETCH = sympy.Symbol("lambda_2", real=True)
DESIGN = "LQR and Kalman filter of the design point"
QUANTITIES = (
    sized("sample_time", "s", "Time between samples", 1e-3, "", 1e-5, 0.1, "ms"),
    sized("tracking_gain", "1/s", "LQR gain: wanted rate of the stretch over its error", 60.0, DESIGN, 0.0, 1e4),
    sized("stretch_gain", "1", "Kalman gain of the stretch, a sample", 0.18, DESIGN, 0.0, 1.0),
    sized("bias_gain", "Pa", "Kalman gain of the bias, a sample and unit of stretch", 3.05e4, DESIGN, 0.0, 1e9),
    sized("field_limit", "V/m", "Largest field", 85e6, "", 1e5, 1e9, "V/um"),
    sized("reference_rate", "m/s", "Fastest change of the reference", 0.05, "", 1e-6, 10.0),
    sized("lead", "m", "How far the reference may be ahead of the tube", 1e-3, "", 1e-6, 0.1, "mm"),
    sized("safe_voltage", "V", "Voltage to fall back to", 0.0, "", 0.0, 2e4, "kV"),
    sized("fallback_slew", "V/s", "Rate at which the voltage falls back", 1e5, "", 1.0, 1e12),
    sized("innovation_limit", "m", "Measured minus expected displacement that is a fault", 1e-3, "", 1e-6, 1.0, "mm"),
    sized("largest_radius", "m", "A larger estimated radius is a fault", 28e-3, "", 1e-3, 1.0, "mm"),
    *AMPLIFIER,
)
TUNABLE = ("tracking_gain", "field_limit", "reference_rate", "safe_voltage", "fallback_slew")
# The controller's parameters of the tube.
# Samples by which the field is looked ahead while the tube expands: sensor delay, a sample, and the amplifier. Without
# it the field passed its limit by 0.7 % in fast moves, with it by 0.1 % (`pytest tests/test_controller.py -k holds`).
AHEAD = 4
STARTS = ("lambda_2_start", "start_at_equilibrium")
BELIEVED = tuple(p for p in tubular_dea().parameters if p.quantity.name not in STARTS)
PARAMETERS = (*(Parameter(q, tunable=q.name in TUNABLE) for q in QUANTITIES), *BELIEVED)
OUTPUTS = (
    "voltage",
    "target_voltage",
    "mode",
    "limited",
    "reference",
    "estimated_radius",
    "bias",
    "innovation",
    "expected_field",
    "amplifier_current",
    "load_capacitance",
    "next_event",
)
MODES = {0: "safe", 1: "track", 2: "fault"}
LIMITED = {0: "no", 1: "by the field", 2: "at no voltage"}


def tube_controller(values: Mapping[str, float] | None = None) -> Model:
    """The controller; `values` (SI units) replace the defaults."""
    rules = _Sampled([*INPUTS, VOLTAGE, *(p.quantity for p in PARAMETERS)])
    _clock(rules)
    _observer(rules)
    _mode(rules)
    _reference(rules)
    _voltage(rules)
    definitions, voltage = amplifier(rules.s["load_capacitance"])
    model = Model(
        name="TubeController",
        description="Holds the tube at a radius by its voltage, beyond the snap-through fold too",
        documentation=__doc__ or "",
        inputs=INPUTS,
        parameters=PARAMETERS,
        definitions=definitions,
        states=(voltage,),
        outputs=OUTPUTS,
        discretes=tuple(rules.made),
    )
    return model.with_values(values or {})


class _Sampled(Rules):
    """Rules that are applied when the clock ticks; between ticks everything is as it was."""

    def at_tick(
        self,
        name: str,
        unit: str,
        description: str,
        update: sympy.Expr | float,
        start: sympy.Expr | float = 0.0,
        **size: Any,
    ) -> sympy.Symbol:
        """A discrete that keeps its value between ticks; `size` is its nominal value and display unit, as in `add`."""
        held = choose(yes(self.s["tick"]), update, self.old(name))
        return self.add(name, unit, description, held, start, **size)


def _clock(r: _Sampled) -> None:
    tick = r.flag("tick", "A sample is due", r.old("next_event") - SOON <= TIME)
    period = r.s["sample_time"]
    r.add("since_tick", "s", "Time since the sample before", choose(yes(tick), TIME - r.old("last_tick"), 0))
    r.add("last_tick", "s", "Time of the last sample", choose(yes(tick), TIME, r.old("last_tick")))
    following = (whole((TIME + SOON) / period) + 1) * period
    r.add("next_event", "s", "Time of the next sample", choose(yes(tick), following, r.old("next_event")), start=-1.0)


def _observer(r: _Sampled) -> None:
    """Prediction by the model over the time since the last sample, and correction by what was measured."""
    s, h = r.s, r.s["since_tick"]
    at_rest = 1 + s["displacement"] / s["r_o"]
    before = r.old("stretch")
    slope = {name: sympy.diff(e, STRETCH) for name, e in reduced().items()}
    for name, expression in reduced().items():
        r.at_tick(
            f"{name}_then",
            PARTS[name][0],
            f"{PARTS[name][1]}, at the last sample",
            expression.xreplace({STRETCH: before}),
            nominal=PARTS[name][2],
        )
    squared = (r.old("applied") ** 2 + s["voltage"] ** 2) / 2  # over the time since then
    stresses = r.old("branch_1") + r.old("branch_2")
    net = s["pressure"] + r.old("bias") - s["elastic_then"] - s["share_then"] * stresses + s["electric_then"] * squared
    stiffness = (slope["elastic"] - slope["electric"] * squared).xreplace({STRETCH: before})
    stiffness = r.at_tick("stiffness", "Pa", "Slope of the balance over the stretch", Max(stiffness, 0), nominal=1e4)
    moved = h * net / (s["damping_then"] + h * stiffness)  # implicit where the tube is stable: no limit to the step
    predicted = before + moved
    innovation = r.at_tick("innovation", "1", "Measured minus predicted stretch", at_rest - predicted, nominal=1e-3)
    stretch = r.at_tick("stretch", "1", "Estimated stretch", predicted + s["stretch_gain"] * innovation, at_rest)
    along = s["along_then"] * (stretch - before)
    for i in (1, 2):
        k, eta = s[f"k_{i}"], s[f"eta_{i}"]
        relaxed = (r.old(f"branch_{i}") + k * along) / (1 + h * k / eta)
        r.at_tick(f"branch_{i}", "Pa", f"Estimated stress of Maxwell branch {i}", relaxed, nominal=1e5)
    r.at_tick(
        "bias",
        "Pa",
        "Estimated pressure that the model lacks",
        r.old("bias") + s["bias_gain"] * innovation,
        nominal=1e3,
        display_unit="mmHg",
    )
    r.at_tick("estimated_radius", "m", "Estimated radius", s["r_o"] * stretch, nominal=1e-2, display_unit="mm")
    r.at_tick("applied", "V", "Voltage at the last sample", s["voltage"], nominal=5e3, display_unit="kV")
    for name, expression in reduced().items():
        if name in ("elastic", "share", "electric", "damping", "field_share", "capacity"):
            r.at_tick(
                name, PARTS[name][0], PARTS[name][1], expression.xreplace({STRETCH: stretch}), nominal=PARTS[name][2]
            )


def _mode(r: _Sampled) -> None:
    s = r.s
    off = s["innovation"] * s["r_o"]
    fault = Or(off > s["innovation_limit"], -off > s["innovation_limit"], s["estimated_radius"] > s["largest_radius"])
    enabled = s["enable"] > sympy.Float(0.5)
    faulty = And(enabled, Or(fault, r.old("mode") > sympy.Float(1.5)))
    text = "; ".join(f"{k} {v}" for k, v in MODES.items())
    r.at_tick("mode", "1", text, choose(faulty, 2, choose(enabled, 1, 0)))
    r.flag("tracking", "The reference is tracked", And(s["mode"] > sympy.Float(0.5), s["mode"] < sympy.Float(1.5)))


def _reference(r: _Sampled) -> None:
    """From the tube's radius on, no faster than `reference_rate`, no farther ahead than `lead`."""
    s, radius = r.s, r.s["estimated_radius"]
    step = s["reference_rate"] * s["since_tick"]
    before = choose(no(r.old("tracking")), radius, r.old("reference"))
    wanted = Min(Max(s["reference_radius"], before - step), before + step)
    near = Min(Max(wanted, radius - s["lead"]), radius + s["lead"])
    r.at_tick(
        "reference", "m", "Reference, ramped", choose(yes(s["tracking"]), near, radius), nominal=1e-2, display_unit="mm"
    )
    rate = choose(And(yes(s["tracking"]), s["since_tick"] > 0), (s["reference"] - before) / s["since_tick"], 0)
    r.at_tick("reference_speed", "m/s", "Rate of the reference", rate, nominal=1e-2)


def _voltage(r: _Sampled) -> None:
    """The voltage that gives the wanted rate, within the limits."""
    s = r.s
    error = (s["reference"] - s["estimated_radius"]) / s["r_o"]
    wanted = s["reference_speed"] / s["r_o"] + s["tracking_gain"] * error
    stresses = s["share"] * (s["branch_1"] + s["branch_2"])
    needed = (s["damping"] * wanted + s["elastic"] + stresses - s["pressure"] - s["bias"]) / s["electric"]
    needed = r.at_tick("needed", "V2", "Square of the voltage that gives the wanted rate", needed, nominal=2.5e7)
    ahead = s["stretch"] + AHEAD * Max(s["stretch"] - r.old("stretch"), 0)
    at_limit = s["field_limit"] / reduced()["field_share"].xreplace({STRETCH: ahead})
    largest = r.at_tick("largest_voltage", "V", "Voltage at the field limit", at_limit, nominal=5e3, display_unit="kV")
    tracked = Min(sqrt(Max(needed, 0)), largest)
    fall = s["fallback_slew"] * s["since_tick"]
    now = r.old("target_voltage")
    fallen = Min(Max(Min(s["safe_voltage"], largest), now - fall), now + fall)
    target = r.at_tick(
        "target_voltage",
        "V",
        "Voltage set point of the amplifier",
        choose(yes(s["tracking"]), tracked, fallen),
        nominal=5e3,
        display_unit="kV",
    )
    limited = choose(needed > largest**2, 1, choose(needed < 0, 2, 0))
    text = "Whether the voltage is limited: " + "; ".join(f"{k} {v}" for k, v in LIMITED.items())
    r.at_tick("limited", "1", text, choose(yes(s["tracking"]), limited, 0))
    r.at_tick(
        "expected_field", "V/m", "Field at the target", s["field_share"] * target, nominal=5e7, display_unit="V/um"
    )
    r.at_tick(
        "load_capacitance", "F", "Capacitance of the tube", s["capacity"], start=20e-9, nominal=1e-8, display_unit="nF"
    )
