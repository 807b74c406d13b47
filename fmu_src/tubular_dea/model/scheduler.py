r"""The heartbeat scheduler: when the tube is given voltage, and when it is refused.

::

    r_wave   _|_____________________|____________________|___      R waves: trigger, 250 ms refractory
    voltage    ____________            ____________
           ___/            \__________/            \_________      on in systole: the tube expands and takes blood;
             |on|  after R, or before it (rule 7)                  off in diastole: it gives the blood back
             |-------- off ----|   off_fraction, the dicrotic notch or max_on_time, whichever comes first

The polarity is the paper's cycle, opposite to a balloon pump's: voltage expands the tube in systole (less afterload),
its absence lets the wall push in diastole.

Rules, in the order in which they are applied at every sample:

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
6. The pulse begins `on_fraction` of the predicted beat and `on_time` after R, and ends `off_fraction` of it and
   `off_time` after R, or `after_notch` after the dicrotic notch where that is detected first, `max_on_time` after it
   began at the latest; a pulse that was planned from one R ends at once with the next.
   Notch: the pressure has risen by `notch_upstroke` since R, has then fallen by `notch_drop` from its peak, and rises
   again by `notch_rise`.
7. A pulse that begins before its R (a negative begin; or one in the second half of the beat with an end beyond it,
   which says the same of the next R) is announced by the R before, at the predicted time. With its R, its end is
   planned anew from there. An R before the announced begin begins the pulse at once. Where no R has come within
   `late_fraction` of the predicted beat after it was expected, the pulse is withdrawn; an R that comes later begins
   another. A premature beat, one after a lost rhythm and one under a veto announce nothing: the pulse of the next
   beat begins with its R.
8. The amplifier follows with `amplifier_time` and cannot move faster than its slew rate or than its current limit lets
   it charge `load_capacitance`.

Times are exact where the master lands on `next_event`.

Citation: N. Liu et al. (the tube, and the cycle of its assistance, Section I).

Usage::

    from tubular_dea.model.scheduler import heartbeat_scheduler
    model = heartbeat_scheduler({"voltage_on": 5500.0})
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache

import sympy
from sympy import And, Max, Min, Or

from .amplifier import QUANTITIES as AMPLIFIER
from .amplifier import amplifier
from .declare import TIME, Discrete, Model, Parameter, Quantity, sized
from .patients import MMHG
from .sampled import NEVER, SOON, Rules, choose, no, yes

R_WAVE = Quantity("r_wave", "1", "Above 0.5 for a while from each R wave on", 0.0)
PRESSURE = Quantity("aortic_pressure", "Pa", "Pressure in the tube", 0.0, nominal=1e4, display_unit="mmHg")
FIELD = Quantity("electric_field", "V/m", "Field in the tube's active layers", 0.0, nominal=5e7, display_unit="V/um")
MARGIN = Quantity(
    "snap_through_margin", "Pa", "Pressure left before the tube snaps through", 1e5, nominal=1e4, display_unit="mmHg"
)
INPUTS = (R_WAVE, PRESSURE, FIELD, MARGIN)
FIELD_LIMIT = 80e6  # V/m, beyond which no pulse begins


QUANTITIES = (
    sized("voltage_on", "V", "Voltage of a pulse", 5000.0, "", 0.0, 2e4, "kV"),
    sized("on_fraction", "1", "Start of the pulse after R, of the predicted beat", 0.05, "", -0.5, 1.0),
    sized("off_fraction", "1", "End of the pulse after R, of the predicted beat", 0.38, "", 0.0, 1.5),
    sized("on_time", "s", "Added to on_fraction's start of the pulse; negative: earlier", 0.0, "", -0.5, 0.5, "ms"),
    sized("off_time", "s", "Added to off_fraction's end of the pulse; negative: earlier", 0.0, "", -0.5, 0.5, "ms"),
    sized("after_notch", "s", "Time from the dicrotic notch to the end of the pulse", 0.0, "", 0.0, 2.0, "ms"),
    sized("late_fraction", "1", "How late an announced R may be, of the predicted beat", 0.15, "", 0.0, 1.0),
    sized("max_on_time", "s", "Longest pulse", 0.4, "", 0.0, 2.0, "ms"),
    sized("refractory", "s", "Time after an R wave in which there is no other", 0.25, "", 0.0, 1.0, "ms"),
    sized("longest_rr", "s", "Longer intervals are not used for the rhythm", 2.5, "", 0.3, 10.0),
    sized("dropout_factor", "1", "Predicted beats without R after which the rhythm is lost", 1.5, "", 1.05, 5.0),
    sized("premature_factor", "1", "Shorter intervals, in predicted beats, are premature", 0.8, "", 0.0, 1.0),
    sized("shortened", "1", "Length of the pulse of a premature beat, of a whole one", 0.5, "", 0.0, 1.0),
    sized("field_limit", "V/m", "Largest field", FIELD_LIMIT, "", 1e5, 1e9, "V/um"),
    sized("field_hysteresis", "V/m", "Below the limit by this the field is safe again", 10e6, "", 0.0, 1e9, "V/um"),
    sized("margin_limit", "Pa", "Smallest distance to the snap-through fold", 10 * MMHG, "", -1e5, 1e5, "mmHg"),
    sized(
        "margin_hysteresis", "Pa", "Above the limit by this the margin is safe again", 5 * MMHG, "", 0.0, 1e5, "mmHg"
    ),
    sized("veto_hold", "s", "Shortest veto", 1.0, "", 0.0, 1e3),
    sized("notch_upstroke", "Pa", "Rise since R that shows the systole", 10 * MMHG, "", 0.0, 1e5, "mmHg"),
    sized("notch_drop", "Pa", "Fall from the peak before a notch", 3 * MMHG, "", 0.0, 1e5, "mmHg"),
    sized("notch_rise", "Pa", "Rise that makes a minimum a notch", 0.5 * MMHG, "", 1.0, 1e5, "mmHg"),
    *AMPLIFIER,
    sized("load_capacitance", "F", "Capacitance that the current charges", 20e-9, "", 1e-15, 1.0, "nF"),
)
PREMATURE_ACTION = Quantity(
    "premature_action", "1", "Pulse of a premature beat: 0 skip, 1 shorten", 0, "", 0, 1, 1.0, type="Integer"
)

TUNABLE = (
    "voltage_on",
    "on_fraction",
    "off_fraction",
    "on_time",
    "off_time",
    "after_notch",
    "max_on_time",
    "field_limit",
    "margin_limit",
)
PARAMETERS = (*(Parameter(q, tunable=q.name in TUNABLE) for q in QUANTITIES), Parameter(PREMATURE_ACTION))

COUNTS = (
    "beats",
    "pulses",
    "assisted_beats",
    "premature_beats",
    "skipped_pulses",
    "withdrawn_pulses",
    "vetoes",
    "dropouts",
    "ignored_edges",
    "notches",
)
OUTPUTS = (
    "voltage",
    "target_voltage",
    "next_event",
    "state",
    "predicted_rr",
    "last_r",
    "pulse_on",
    "pulse_off",
    "on",
    "awaiting",
    "r_accepted",
    "premature",
    "lost",
    "veto",
    "veto_cause",
    "notch",
    *COUNTS,
    "amplifier_current",
)
STATES = {0: "learning", 1: "waiting", 2: "delay", 3: "on", 4: "skipped", 5: "lost", 6: "veto"}


def heartbeat_scheduler(values: Mapping[str, float] | None = None) -> Model:
    """The scheduler; `values` (SI units) replace the defaults."""
    definitions, voltage = amplifier(sympy.Symbol("load_capacitance", real=True))
    model = Model(
        name="HeartbeatScheduler",
        description="Voltage pulses in step with the heart, with their refusals",
        documentation=__doc__ or "",
        inputs=INPUTS,
        parameters=PARAMETERS,
        definitions=definitions,
        states=(voltage,),
        outputs=OUTPUTS,
        discretes=_discretes(),
    )
    return model.with_values(values or {})


# The rules ----------------------------------------------------------------------------------------------------


@cache
def _discretes() -> tuple[Discrete, ...]:
    rules = Rules([*INPUTS, *QUANTITIES, PREMATURE_ACTION])
    _r_waves(rules)
    _prediction(rules)
    _rhythm(rules)
    _veto(rules)
    _notch(rules)
    _pulse(rules)
    return tuple(rules.made)


def _r_waves(r: Rules) -> None:
    """Rule 1."""
    high = r.flag("r_high", "The R wave signal is high", r.s["r_wave"] > sympy.Float(0.5))
    edge = r.flag("r_edge", "The R wave signal has risen", And(yes(high), no(r.old("r_high"))))
    since = r.add("since_r", "s", "Time since the last R wave", TIME - r.old("last_r"))
    accepted = r.flag("r_accepted", "An R wave, now", And(yes(edge), since >= r.s["refractory"] - SOON))
    r.count("ignored_edges", "Rises of the R wave signal within the refractory time", And(yes(edge), no(accepted)))
    r.add("last_r", "s", "Time of the last R wave", choose(yes(accepted), TIME, r.old("last_r")), start=-NEVER)
    r.count("beats", "R waves", yes(accepted))


def _prediction(r: Rules) -> None:
    """Rule 2: five intervals, newest first, and their median (a network of minima and maxima)."""
    taken = r.flag(
        "rr_taken",
        "The interval since the last R wave is learned",
        And(yes(r.s["r_accepted"]), r.s["since_r"] <= r.s["longest_rr"]),
    )
    first = And(yes(taken), r.old("intervals") < sympy.Float(0.5))
    interval = r.s["since_r"]
    names = [f"rr_{i}" for i in range(1, 6)]
    for i, name in enumerate(names):
        shifted = interval if i == 0 else r.old(names[i - 1])
        learned = choose(yes(taken), shifted, r.old(name))
        r.add(name, "s", f"RR interval, {i} before the last", choose(first, interval, learned))
    r.count("intervals", "RR intervals learned", yes(taken))
    a, b, c, d, e = (r.s[name] for name in names)
    low = r.add("rr_low", "s", "Larger of the smaller ones of two pairs", Max(Min(a, b), Min(c, d)))
    high = r.add("rr_high", "s", "Smaller of the larger ones of two pairs", Min(Max(a, b), Max(c, d)))
    lower = r.add("rr_lower", "s", "Smaller of these two", Min(low, high))
    upper = r.add("rr_upper", "s", "Larger of these two", Max(low, high))
    r.add("predicted_rr", "s", "Median of the last five RR intervals", Max(lower, Min(upper, e)))
    r.flag("learned", "Three intervals are known", r.s["intervals"] > sympy.Float(2.5))


def _rhythm(r: Rules) -> None:
    """Rules 3 and 4, against the prediction from before this beat."""
    known, accepted, expected = r.old("intervals") > sympy.Float(2.5), yes(r.s["r_accepted"]), r.old("predicted_rr")
    late = And(known, r.s["since_r"] >= r.s["dropout_factor"] * expected - SOON)
    r.add("lost", "1", "The rhythm is lost", choose(late, 1, choose(accepted, 0, r.old("lost"))))
    r.count("dropouts", "Times the rhythm was lost", And(yes(r.s["lost"]), no(r.old("lost"))))
    early = And(known, accepted, r.s["since_r"] < r.s["premature_factor"] * expected)
    r.add("premature", "1", "The last R wave was premature", choose(accepted, choose(early, 1, 0), r.old("premature")))
    r.count("premature_beats", "Premature beats", early)


def _veto(r: Rules) -> None:
    """Rule 5. Causes: 1 the field, 2 the margin, 3 both."""
    field = r.s["electric_field"] >= r.s["field_limit"]
    margin = r.s["snap_through_margin"] <= r.s["margin_limit"]
    safe = And(
        r.s["electric_field"] <= r.s["field_limit"] - r.s["field_hysteresis"],
        r.s["snap_through_margin"] >= r.s["margin_limit"] + r.s["margin_hysteresis"],
        r.old("veto_since") + r.s["veto_hold"] - SOON <= TIME,
    )
    veto = r.add("veto", "1", "Voltage is refused", choose(Or(field, margin), 1, choose(safe, 0, r.old("veto"))))
    began = And(yes(veto), no(r.old("veto")))
    since = choose(Or(field, margin), TIME, r.old("veto_since"))
    r.add("veto_since", "s", "Time the last veto began or was renewed", since, start=-NEVER)
    r.add(
        "veto_cause",
        "1",
        "Cause of the last veto: 1 field, 2 margin, 3 both",
        choose(began, choose(field, 1, 0) + choose(margin, 2, 0), r.old("veto_cause")),
    )
    r.count("vetoes", "Vetoes", began)


def _notch(r: Rules) -> None:
    """The pressure's foot since R, then its peak, then the least since the peak."""
    p, begins = r.s["aortic_pressure"], yes(r.s["r_accepted"])
    foot = r.add("foot", "Pa", "Least pressure since R", choose(begins, p, Min(r.old("foot"), p)), nominal=1e4)
    systole = r.add(
        "systole",
        "1",
        "The pressure has risen since R",
        choose(begins, 0, choose(p >= foot + r.s["notch_upstroke"], 1, r.old("systole"))),
    )
    highest = choose(no(systole), p, Max(r.old("peak"), p))
    peak = r.add("peak", "Pa", "Largest pressure in systole", highest, nominal=1e4)
    least = choose(p >= peak, p, Min(r.old("lowest"), p))
    lowest = r.add("lowest", "Pa", "Least pressure since the peak", least, nominal=1e4)
    found = And(yes(systole), peak >= lowest + r.s["notch_drop"], p >= lowest + r.s["notch_rise"])
    notch = r.add("notch", "1", "The dicrotic notch has passed", choose(begins, 0, choose(found, 1, r.old("notch"))))
    r.count("notches", "Dicrotic notches", And(yes(notch), no(r.old("notch"))))


def _pulse(r: Rules) -> None:
    """Rules 6 and 7: planned at R or announced before it, begun and ended in time, cancelled at once when refused."""
    _offsets(r)
    _planned_at_r(r)
    _announced(r)
    s, accepted = r.s, yes(r.s["r_accepted"])
    on = r.flag(
        "on", "The pulse is on", And(yes(s["planned"]), s["pulse_on"] - SOON <= TIME, s["pulse_off"] - SOON > TIME)
    )
    r.count("pulses", "Pulses", And(yes(on), Or(no(r.old("on")), And(accepted, no(s["carried"])))))
    its = And(yes(on), no(s["awaiting"]))
    served = r.add("served", "1", "The beat has its pulse", choose(its, 1, choose(accepted, 0, r.old("served"))))
    r.count("assisted_beats", "Beats with a pulse", And(yes(served), Or(no(r.old("served")), accepted)))
    r.add("target_voltage", "V", "Voltage set point of the amplifier", s["voltage_on"] * on, nominal=5e3)
    _shown(r)


def _offsets(r: Rules) -> None:
    """Begin and end of a pulse from its own R on: a pulse lies about that R, or after it."""
    s, beat = r.s, r.s["predicted_rr"]
    begin, end = s["on_fraction"] * beat + s["on_time"], s["off_fraction"] * beat + s["off_time"]
    shift = choose(And(2 * begin >= beat, end > beat), beat, choose(end <= 0, -beat, 0))
    shift = r.add("pulse_shift", "s", "How much later the pulse's own R is expected", shift)
    begins = r.add("pulse_begin", "s", "Begin of a pulse after its R", begin - shift)
    r.add("pulse_end", "s", "End of a pulse after its R", end - shift)
    r.flag("early", "Pulses begin before their R", begins < 0)


def _planned_at_r(r: Rules) -> None:
    """Rule 6. A pulse that is on already, announced for this R, goes on."""
    s, accepted = r.s, yes(r.s["r_accepted"])
    skip = And(yes(s["premature"]), s["premature_action"] < sympy.Float(0.5))
    wanted = And(accepted, yes(s["learned"]), no(s["lost"]))
    planned = And(wanted, sympy.Not(skip), no(s["veto"]))
    r.count("skipped_pulses", "Pulses skipped for a premature beat", And(wanted, skip))
    carried = r.flag(
        "carried", "A pulse begun before its R goes on", And(planned, yes(r.old("awaiting")), yes(r.old("on")))
    )
    after = Max(s["pulse_begin"], 0)
    length = Min(Max(s["pulse_end"] - after, 0), s["max_on_time"]) * choose(yes(s["premature"]), s["shortened"], 1)
    begin = choose(planned, choose(yes(carried), r.old("pulse_on"), TIME + after), r.old("pulse_on"))
    begin = r.add("plan_on", "s", "Start of the pulse planned from R", begin)
    ended = And(yes(s["notch"]), no(r.old("notch")), yes(r.old("on")), no(r.old("awaiting")))
    end = choose(ended, Min(r.old("pulse_off"), TIME + s["after_notch"]), r.old("pulse_off"))
    end = choose(planned, Min(TIME + after + length, begin + s["max_on_time"]), end)
    end = r.add("plan_off", "s", "End of the pulse planned from R", end)
    over = r.flag("over", "The pulse is over", And(end - SOON <= TIME, sympy.Not(planned)))
    refused = Or(accepted, yes(s["lost"]), yes(s["veto"]), yes(over))
    r.add("open", "1", "A pulse is planned or on", choose(planned, 1, choose(refused, 0, r.old("planned"))))


def _announced(r: Rules) -> None:
    """Rule 7: once a beat, when the pulse of the last R is over."""
    s, accepted = r.s, yes(r.s["r_accepted"])
    regular = And(yes(s["learned"]), no(s["lost"]), no(s["veto"]), no(s["premature"]), sympy.Not(accepted))
    announce = r.flag(
        "announce",
        "The pulse of the next R is announced, now",
        And(yes(s["early"]), regular, no(s["open"]), no(r.old("announced"))),
    )
    r.add("announced", "1", "It is", choose(accepted, 0, Max(r.old("announced"), announce)))
    expected = s["last_r"] + s["predicted_rr"]
    begin = expected + s["pulse_begin"]
    end = Min(expected + Min(s["pulse_end"], s["late_fraction"] * s["predicted_rr"]), begin + s["max_on_time"])
    r.add("pulse_on", "s", "Start of the planned pulse", choose(yes(announce), begin, s["plan_on"]), start=-NEVER)
    r.add("pulse_off", "s", "End of the planned pulse", choose(yes(announce), end, s["plan_off"]), start=-NEVER)
    r.add("planned", "1", "A pulse is planned or on", Max(s["open"], announce))
    ended = Or(accepted, no(s["open"]))
    r.add("awaiting", "1", "The pulse awaits its R", choose(yes(announce), 1, choose(ended, 0, r.old("awaiting"))))
    r.count(
        "withdrawn_pulses",
        "Pulses withdrawn because no R came",
        And(yes(r.old("awaiting")), yes(r.old("on")), yes(s["over"])),
    )


def _shown(r: Rules) -> None:
    """The state, and when it changes next."""
    s = r.s
    skip = And(yes(s["premature"]), s["premature_action"] < sympy.Float(0.5), no(s["planned"]))
    ready = choose(yes(s["on"]), 3, choose(yes(s["planned"]), 2, choose(skip, 4, 1)))
    r.add(
        "state",
        "1",
        "; ".join(f"{k} {v}" for k, v in STATES.items()),
        choose(yes(s["veto"]), 6, choose(yes(s["lost"]), 5, choose(no(s["learned"]), 0, ready))),
    )
    planned_event = choose(yes(s["on"]), s["pulse_off"], choose(yes(s["planned"]), s["pulse_on"], NEVER))
    latest = s["last_r"] + s["dropout_factor"] * s["predicted_rr"]
    deadline = choose(And(yes(s["learned"]), no(s["lost"])), latest, NEVER)
    r.add("next_event", "s", "Time of the next decision that is known", Min(planned_event, deadline), start=NEVER)
