r"""The heartbeat scheduler: when the tube is given voltage, and when it is refused.

::

    r_wave   _|_____________________|____________________|___      R waves: trigger, 250 ms refractory
    voltage    ____________            ____________
           ___/            \__________/            \_________      on in systole: the tube expands and takes blood;
             |on_delay|                                            off in diastole: it gives the blood back
             |---- off_time ---|   or at the dicrotic notch, or after max_on_time, whichever comes first

The polarity is the paper's cycle, opposite to a balloon pump's: voltage expands the tube in systole (less afterload),
its absence lets the wall push in diastole.

Rules, in the order in which they are applied at every sample (`_discretes`, one a line):

1. An R wave is a rise of `r_wave` through 0.5, not sooner than `refractory` after the last one.
2. The predicted beat is the median of the last five RR intervals (up to `longest_rr`; the first one counts five times);
   nothing is assisted before three of them are known.
3. No R within `dropout_factor` of the predicted beat: rhythm lost, voltage off at once, until an R comes that follows
   another one within that time.
4. An R sooner than `premature_factor` of the predicted beat is premature: its pulse is skipped (`premature_action` 0)
   or shortened to `shortened` of its length (1).
5. Veto, with a hysteresis: where the field reaches `field_limit`, or the pressure comes within `margin_limit` of the
   snap-through fold, the voltage goes off; it stays off for the rest of that beat and at least for `veto_hold`, and
   until field and margin are on the other side of the hysteresis.
6. The pulse begins `on_fraction` of the predicted beat after R and ends `off_fraction` of it after R, at the dicrotic
   notch if that is detected first, `max_on_time` after it began at the latest, and at once with the next R.
   Notch: the pressure has risen by `notch_upstroke` since R, has then fallen by `notch_drop` from its peak, and rises
   again by `notch_rise`.
7. The amplifier follows with `amplifier_time` and cannot move faster than its slew rate or than its current limit lets
   it charge `load_capacitance`.

Times are exact where the master lands on `next_event`.

Citation: N. Liu et al. (the tube, and the cycle of its assistance, Section I).

Parameters: `PARAMETERS`.

Usage::

    from tubular_dea.model.scheduler import heartbeat_scheduler
    model = heartbeat_scheduler({"voltage_on": 5500.0})
"""

from __future__ import annotations

from collections.abc import Mapping

import sympy
from sympy import And, Max, Min, Or, tanh

from .declare import TIME, Definition, Discrete, Model, Parameter, Quantity, State, before
from .patients import MMHG

NEVER = 1e9  # s: no event is planned
SOON = 1e-7  # s: events this close have come

R_WAVE = Quantity("r_wave", "1", "Above 0.5 for a while from each R wave on", 0.0)
PRESSURE = Quantity("aortic_pressure", "Pa", "Pressure in the tube", 0.0, nominal=1e4, display_unit="mmHg")
FIELD = Quantity("electric_field", "V/m", "Field in the tube's active layers", 0.0, nominal=5e7, display_unit="V/um")
MARGIN = Quantity("snap_through_margin", "Pa", "Pressure left before the tube snaps through", 1e5, nominal=1e4,
                  display_unit="mmHg")  # fmt: skip
INPUTS = (R_WAVE, PRESSURE, FIELD, MARGIN)


def _real(name: str, unit: str, description: str, value: float, low: float, high: float,
          display_unit: str | None = None) -> Quantity:
    return Quantity(name, unit, description, value, "", low, high, nominal=abs(value) or 1.0, display_unit=display_unit)


QUANTITIES = (
    _real("voltage_on", "V", "Voltage of a pulse", 5000.0, 0.0, 2e4, "kV"),
    _real("on_fraction", "1", "Start of the pulse after R, of the predicted beat", 0.05, 0.0, 1.0),
    _real("off_fraction", "1", "End of the pulse after R, of the predicted beat", 0.38, 0.0, 1.5),
    _real("max_on_time", "s", "Longest pulse", 0.4, 0.0, 2.0, "ms"),
    _real("refractory", "s", "Time after an R wave in which there is no other", 0.25, 0.0, 1.0, "ms"),
    _real("longest_rr", "s", "Longer intervals say nothing of the rhythm", 2.5, 0.3, 10.0),
    _real("dropout_factor", "1", "Predicted beats without R after which the rhythm is lost", 1.5, 1.05, 5.0),
    _real("premature_factor", "1", "Shorter intervals, in predicted beats, are premature", 0.8, 0.0, 1.0),
    _real("shortened", "1", "Length of the pulse of a premature beat, of a whole one", 0.5, 0.0, 1.0),
    _real("field_limit", "V/m", "Largest field", 80e6, 1e5, 1e9, "V/um"),
    _real("field_hysteresis", "V/m", "Below the limit by this the field is safe again", 10e6, 0.0, 1e9, "V/um"),
    _real("margin_limit", "Pa", "Smallest distance to the snap-through fold", 10 * MMHG, -1e5, 1e5, "mmHg"),
    _real("margin_hysteresis", "Pa", "Above the limit by this the margin is safe again", 5 * MMHG, 0.0, 1e5, "mmHg"),
    _real("veto_hold", "s", "Shortest veto", 1.0, 0.0, 1e3),
    _real("notch_upstroke", "Pa", "Rise since R that shows the systole", 10 * MMHG, 0.0, 1e5, "mmHg"),
    _real("notch_drop", "Pa", "Fall from the peak before a notch", 3 * MMHG, 0.0, 1e5, "mmHg"),
    _real("notch_rise", "Pa", "Rise that makes a minimum a notch", 0.5 * MMHG, 1.0, 1e5, "mmHg"),
    _real("amplifier_time", "s", "Time constant of the amplifier", 5e-4, 1e-6, 1.0, "ms"),
    _real("slew_rate", "V/s", "Fastest change of the voltage", 1e6, 1.0, 1e12),
    _real("current_limit", "A", "Largest current of the amplifier", 10e-3, 1e-9, 1e3, "mA"),
    _real("load_capacitance", "F", "Capacitance that the current charges", 20e-9, 1e-15, 1.0, "nF"),
)  # fmt: skip
PREMATURE_ACTION = Quantity("premature_action", "1", "Pulse of a premature beat: 0 skip, 1 shorten", 0, "", 0, 1, 1.0,
                            type="Integer")  # fmt: skip

TUNABLE = ("voltage_on", "on_fraction", "off_fraction", "max_on_time", "field_limit", "margin_limit")
PARAMETERS = (*(Parameter(q, tunable=q.name in TUNABLE) for q in QUANTITIES), Parameter(PREMATURE_ACTION))

VOLTAGE = Quantity("voltage", "V", "Voltage of the amplifier", nominal=5e3, display_unit="kV")

COUNTS = ("beats", "pulses", "premature_beats", "skipped_pulses", "vetoes", "dropouts", "ignored_edges", "notches")
OUTPUTS = (
    "voltage", "target_voltage", "next_event", "state", "predicted_rr", "last_r", "pulse_on", "pulse_off", "on",
    "r_accepted",
    "premature", "lost", "veto", "veto_cause", "notch", *COUNTS, "amplifier_current",
)  # fmt: skip
STATES = {0: "learning", 1: "waiting", 2: "delay", 3: "on", 4: "skipped", 5: "lost", 6: "veto"}


def heartbeat_scheduler(values: Mapping[str, float] | None = None) -> Model:
    """The scheduler; `values` (SI units) replace the defaults."""
    rate = sympy.Symbol("fastest", real=True)
    target, voltage = sympy.Symbol("target_voltage", real=True), VOLTAGE.symbol
    s = {q.name: q.symbol for q in QUANTITIES}
    speed = Definition(
        Quantity("fastest", "V/s", "Fastest change of the voltage: slew rate or current limit", nominal=1e6),
        Min(s["slew_rate"], s["current_limit"] / s["load_capacitance"]),
    )
    change = rate * tanh((target - voltage) / (rate * s["amplifier_time"]))
    current = Definition(
        Quantity("amplifier_current", "A", "Current into the load capacitance", nominal=1e-3, display_unit="mA"),
        s["load_capacitance"] * change,
    )
    model = Model(
        name="HeartbeatScheduler",
        description="Voltage pulses in step with the heart, with their refusals",
        documentation=__doc__ or "",
        inputs=INPUTS,
        parameters=PARAMETERS,
        definitions=(speed, current),
        states=(State(VOLTAGE, change, sympy.Integer(0), sympy.Integer(0)),),
        outputs=OUTPUTS,
        discretes=tuple(_discretes()),
    )
    return model.with_values(values or {})


# The rules ----------------------------------------------------------------------------------------------------


def _if(condition: sympy.Basic, then: sympy.Expr | float, otherwise: sympy.Expr | float) -> sympy.Expr:
    return sympy.Piecewise((sympy.sympify(then), condition), (sympy.sympify(otherwise), True), evaluate=False)


def _yes(symbol: sympy.Expr) -> sympy.Basic:
    """Truth of a discrete that is 0 or 1."""
    return symbol > sympy.Float(0.5)


def _no(symbol: sympy.Expr) -> sympy.Basic:
    return symbol < sympy.Float(0.5)


class _Rules:
    """Discretes in the making: `s` symbols by name, `old` what they were before this sample."""

    def __init__(self) -> None:
        self.s: dict[str, sympy.Symbol] = {q.name: q.symbol for q in (*INPUTS, *QUANTITIES, PREMATURE_ACTION)}
        self.made: list[Discrete] = []

    def old(self, name: str) -> sympy.Symbol:
        return before(Quantity(name, "1", ""))

    def add(self, name: str, unit: str, description: str, update: sympy.Expr, start: float = 0.0,
            nominal: float = 1.0) -> sympy.Symbol:
        quantity = Quantity(name, unit, description, nominal=nominal)
        self.made.append(Discrete(quantity, sympy.Float(start), sympy.sympify(update)))
        self.s[name] = quantity.symbol
        return quantity.symbol

    def flag(self, name: str, description: str, condition: sympy.Basic) -> sympy.Symbol:
        return self.add(name, "1", description, _if(condition, 1, 0))

    def count(self, name: str, description: str, condition: sympy.Basic) -> sympy.Symbol:
        return self.add(name, "1", description, self.old(name) + _if(condition, 1, 0))


def _discretes() -> list[Discrete]:
    rules = _Rules()
    _r_waves(rules)
    _prediction(rules)
    _rhythm(rules)
    _veto(rules)
    _notch(rules)
    _pulse(rules)
    return rules.made


def _r_waves(r: _Rules) -> None:
    """Rule 1."""
    high = r.flag("r_high", "The R wave signal is high", r.s["r_wave"] > sympy.Float(0.5))
    edge = r.flag("r_edge", "The R wave signal has risen", And(_yes(high), _no(r.old("r_high"))))
    since = r.add("since_r", "s", "Time since the last R wave", TIME - r.old("last_r"))
    accepted = r.flag("r_accepted", "An R wave, now", And(_yes(edge), since >= r.s["refractory"] - SOON))
    r.count("ignored_edges", "Rises of the R wave signal within the refractory time", And(_yes(edge), _no(accepted)))
    r.add("last_r", "s", "Time of the last R wave", _if(_yes(accepted), TIME, r.old("last_r")), start=-NEVER)
    r.count("beats", "R waves", _yes(accepted))


def _prediction(r: _Rules) -> None:
    """Rule 2: five intervals, newest first, and their median (a network of minima and maxima)."""
    taken = r.flag("rr_taken", "The interval since the last R wave is learned",
                   And(_yes(r.s["r_accepted"]), r.s["since_r"] <= r.s["longest_rr"]))
    first = And(_yes(taken), r.old("intervals") < sympy.Float(0.5))
    interval = r.s["since_r"]
    names = [f"rr_{i}" for i in range(1, 6)]
    for i, name in enumerate(names):
        shifted = interval if i == 0 else r.old(names[i - 1])
        learned = _if(_yes(taken), shifted, r.old(name))
        r.add(name, "s", f"RR interval, {i} before the last", _if(first, interval, learned))
    r.count("intervals", "RR intervals learned", _yes(taken))
    a, b, c, d, e = (r.s[name] for name in names)
    low = r.add("rr_low", "s", "Larger of the smaller ones of two pairs", Max(Min(a, b), Min(c, d)))
    high = r.add("rr_high", "s", "Smaller of the larger ones of two pairs", Min(Max(a, b), Max(c, d)))
    lower = r.add("rr_lower", "s", "Smaller of these two", Min(low, high))
    upper = r.add("rr_upper", "s", "Larger of these two", Max(low, high))
    r.add("predicted_rr", "s", "Median of the last five RR intervals", Max(lower, Min(upper, e)))
    r.flag("learned", "Three intervals are known", r.s["intervals"] > sympy.Float(2.5))


def _rhythm(r: _Rules) -> None:
    """Rules 3 and 4, against the prediction from before this beat."""
    known, accepted, expected = r.old("intervals") > sympy.Float(2.5), _yes(r.s["r_accepted"]), r.old("predicted_rr")
    late = And(known, r.s["since_r"] >= r.s["dropout_factor"] * expected - SOON)
    r.add("lost", "1", "The rhythm is lost", _if(late, 1, _if(accepted, 0, r.old("lost"))))
    r.count("dropouts", "Times the rhythm was lost", And(_yes(r.s["lost"]), _no(r.old("lost"))))
    early = And(known, accepted, r.s["since_r"] < r.s["premature_factor"] * expected)
    r.add("premature", "1", "The last R wave was premature", _if(accepted, _if(early, 1, 0), r.old("premature")))
    r.count("premature_beats", "Premature beats", early)


def _veto(r: _Rules) -> None:
    """Rule 5. Causes: 1 the field, 2 the margin, 3 both."""
    field = r.s["electric_field"] >= r.s["field_limit"]
    margin = r.s["snap_through_margin"] <= r.s["margin_limit"]
    safe = And(r.s["electric_field"] <= r.s["field_limit"] - r.s["field_hysteresis"],
               r.s["snap_through_margin"] >= r.s["margin_limit"] + r.s["margin_hysteresis"],
               r.old("veto_since") + r.s["veto_hold"] - SOON <= TIME)
    veto = r.add("veto", "1", "Voltage is refused", _if(Or(field, margin), 1, _if(safe, 0, r.old("veto"))))
    began = And(_yes(veto), _no(r.old("veto")))
    since = _if(Or(field, margin), TIME, r.old("veto_since"))
    r.add("veto_since", "s", "Time the last veto began or was renewed", since, start=-NEVER)
    r.add("veto_cause", "1", "Cause of the last veto: 1 field, 2 margin, 3 both",
          _if(began, _if(field, 1, 0) + _if(margin, 2, 0), r.old("veto_cause")))
    r.count("vetoes", "Vetoes", began)


def _notch(r: _Rules) -> None:
    """The pressure's foot since R, then its peak, then the least since the peak."""
    p, begins = r.s["aortic_pressure"], _yes(r.s["r_accepted"])
    foot = r.add("foot", "Pa", "Least pressure since R", _if(begins, p, Min(r.old("foot"), p)), nominal=1e4)
    systole = r.add("systole", "1", "The pressure has risen since R",
                    _if(begins, 0, _if(p >= foot + r.s["notch_upstroke"], 1, r.old("systole"))))
    peak = r.add("peak", "Pa", "Largest pressure in systole", _if(_no(systole), p, Max(r.old("peak"), p)), nominal=1e4)
    least = _if(p >= peak, p, Min(r.old("lowest"), p))
    lowest = r.add("lowest", "Pa", "Least pressure since the peak", least, nominal=1e4)
    found = And(_yes(systole), peak >= lowest + r.s["notch_drop"], p >= lowest + r.s["notch_rise"])
    notch = r.add("notch", "1", "The dicrotic notch has passed", _if(begins, 0, _if(found, 1, r.old("notch"))))
    r.count("notches", "Dicrotic notches", And(_yes(notch), _no(r.old("notch"))))


def _pulse(r: _Rules) -> None:
    """Rule 6: planned at R, begun and ended in time, cancelled at once when refused."""
    s, accepted = r.s, _yes(r.s["r_accepted"])
    skip = And(_yes(s["premature"]), s["premature_action"] < sympy.Float(0.5))
    wanted = And(accepted, _yes(s["learned"]), _no(s["lost"]))
    planned = And(wanted, sympy.Not(skip), _no(s["veto"]))
    r.count("skipped_pulses", "Pulses skipped for a premature beat", And(wanted, skip))
    begin = TIME + s["on_fraction"] * s["predicted_rr"]
    length = Min(Max(s["off_fraction"] - s["on_fraction"], 0) * s["predicted_rr"], s["max_on_time"])
    r.add("pulse_on", "s", "Start of the planned pulse", _if(planned, begin, r.old("pulse_on")), start=-NEVER)
    shorter = _if(_yes(s["premature"]), s["shortened"], 1)
    r.add("pulse_off", "s", "End of the planned pulse", _if(planned, begin + length * shorter, r.old("pulse_off")),
          start=-NEVER)
    over = Or(s["pulse_off"] - SOON <= TIME, And(_yes(s["notch"]), _yes(r.old("on"))))
    open_ = r.add("planned", "1", "A pulse is planned or on",
                  _if(planned, 1, _if(Or(accepted, _yes(s["lost"]), _yes(s["veto"]), over), 0, r.old("planned"))))
    on = r.flag("on", "The pulse is on", And(_yes(open_), s["pulse_on"] - SOON <= TIME, s["pulse_off"] - SOON > TIME))
    r.count("pulses", "Pulses", And(_yes(on), Or(_no(r.old("on")), accepted)))
    r.add("target_voltage", "V", "What the amplifier is told", s["voltage_on"] * on, nominal=5e3)
    ready = _if(_yes(on), 3, _if(_yes(open_), 2, _if(skip, 4, 1)))
    r.add("state", "1", "; ".join(f"{k} {v}" for k, v in STATES.items()),
          _if(_yes(s["veto"]), 6, _if(_yes(s["lost"]), 5, _if(_no(s["learned"]), 0, ready))))
    planned_event = _if(_yes(on), s["pulse_off"], _if(_yes(open_), s["pulse_on"], NEVER))
    latest = s["last_r"] + s["dropout_factor"] * s["predicted_rr"]
    deadline = _if(And(_yes(s["learned"]), _no(s["lost"])), latest, NEVER)
    r.add("next_event", "s", "Time of the next decision that is known", Min(planned_event, deadline), start=NEVER)
