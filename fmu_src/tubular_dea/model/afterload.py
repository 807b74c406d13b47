"""What the aorta opposes to a flow: a windkessel of three elements, and what recordings may show that it lacks.

::

     flow    Z_c       inertance     aortic_pressure at the left
      o--+--[===]--+---(( ))---+---[ R ]---o outflow_pressure
         +--(( ))--+           |
      Z_c / parallel_rate     === C
                               |

Equations: C dp_C/dt = Q - (p_C - p_out) / R; dQ_b/dt = parallel_rate (Q - Q_b); p = p_C + Z_c (Q - Q_b) + L dQ/dt.
The probes: Q_probe(t) = Q(t - flow_delay); dp_s/dt = (p - p_s) / tau_sensor,
p_probe(t) = (p + sensor_share (p_s - p))(t - pressure_delay).

Citation: N. Westerhof, J. W. Lankhaar, B. E. Westerhof, "The arterial windkessel", Med. Biol. Eng. Comput. 47 (2009)
131-141; the inertance beside Z_c: N. Stergiopulos, B. E. Westerhof, N. Westerhof, Am. J. Physiol. 276 (1999) H81-H88.
Delays of flow probes: their output filters (Transonic T400: 10 to 40 ms).

Parameters: `PARAMETERS`; an extra is off where its parameter (of the sensor's lag: its share) is 0.

Usage::

    from tubular_dea.model.afterload import aortic_afterload
    model = aortic_afterload({"R": 1.2e8, "C": 1.1e-8, "Z_c": 6e6, "flow_delay": 0.03})
"""

from __future__ import annotations

from collections.abc import Mapping

import sympy

from .declare import Definition, Delay, Model, Parameter, Quantity, State, rate

LARGEST_DELAY = 0.5  # s
FLOW = Quantity("flow", "m3/s", "Flow into the aorta", 0.0, nominal=1e-4, display_unit="mL/s")
PARAMETERS = (
    Quantity("R", "Pa.s/m3", "Peripheral resistance", 1.3e8, "Westerhof 2009", 1.0, None, 1e8),
    Quantity("C", "m3/Pa", "Compliance", 1e-8, "Westerhof 2009", 1e-15, None, 1e-8),
    Quantity("Z_c", "Pa.s/m3", "Characteristic impedance", 7e6, "Westerhof 2009", 0.0, None, 1e7),
    Quantity("inertance", "Pa.s2/m3", "Inertance in series", 0.0, "Westerhof 2009", None, None, 1e5),
    Quantity("parallel_rate", "1/s", "Z_c over the inertance beside it", 0.0, "Stergiopulos 1999", 0.0, None, 10.0),
    Quantity("outflow_pressure", "Pa", "Pressure at which the outflow stops", 0.0, "Westerhof 2009", None, None, 1e4,
             display_unit="mmHg"),
    Quantity("flow_delay", "s", "By how much the flow probe is late", 0.0, "Transonic T400", 0.0, LARGEST_DELAY, 0.01),
    Quantity("pressure_delay", "s", "By how much the pressure probe is late", 0.0, "Transonic T400", 0.0,
             LARGEST_DELAY, 0.01),
    Quantity("tau_sensor", "s", "Time constant of the pressure probe", 0.01, "Transonic T400", 1e-4, 10.0, 0.01),
    Quantity("sensor_share", "1", "Share of the reading that the probe smooths", 0.0, "Transonic T400", 0.0, 1.0),
    Quantity("p_C_start", "Pa", "Pressure of the compliance at the start", 1.2e4, "", None, None, 1e4,
             display_unit="mmHg"),
    Quantity("Q_b_start", "m3/s", "Flow through the inertance beside Z_c at the start", 0.0, "", None, None, 1e-4,
             display_unit="mL/s"),
)  # fmt: skip
FIXED = ("p_C_start", "Q_b_start")


def aortic_afterload(values: Mapping[str, float] | None = None) -> Model:
    """The declared model, with some values changed by name (SI)."""
    s = {q.name: q.symbol for q in (FLOW, *PARAMETERS)}
    pressure = _pressure("aortic_pressure", "Pressure at the root of the aorta")
    stored = _pressure("p_C", "Pressure of the compliance")
    slow = _pressure("slow_pressure", "Aortic pressure, smoothed by the probe")
    beside = Quantity("Q_b", "m3/s", "Flow through the inertance beside Z_c", nominal=1e-4, display_unit="mL/s")
    impedance = stored.symbol + s["Z_c"] * (s["flow"] - beside.symbol)
    at_start = impedance.subs({stored.symbol: s["p_C_start"], beside.symbol: s["Q_b_start"]})
    read = pressure.symbol + s["sensor_share"] * (slow.symbol - pressure.symbol)
    model = Model(
        name="AorticAfterload",
        description="Windkessel of three elements with what recordings show that it lacks",
        documentation=__doc__ or "",
        inputs=(FLOW,),
        parameters=tuple(Parameter(q, tunable=q.name not in FIXED) for q in PARAMETERS),
        definitions=(
            Definition(pressure, impedance + s["inertance"] * rate(FLOW)),
            Definition(Quantity("probed_flow", "m3/s", "Flow at the probe", nominal=1e-4), sympy.Add(s["flow"], 0)),
            Definition(_pressure("probed_pressure", "Pressure at the probe, read without delay"), read),
        ),
        states=(
            State(stored, (s["flow"] - (stored.symbol - s["outflow_pressure"]) / s["R"]) / s["C"],
                  s["p_C_start"], s["p_C_start"]),
            State(beside, s["parallel_rate"] * (s["flow"] - beside.symbol), s["Q_b_start"], s["Q_b_start"]),
            State(slow, (pressure.symbol - slow.symbol) / s["tau_sensor"], at_start, at_start),
        ),
        outputs=("aortic_pressure",),
    )  # fmt: skip
    late_flow = Quantity("late_flow", "m3/s", "Flow through the probe, delayed", nominal=1e-4)
    late_pressure = _pressure("late_pressure", "Pressure at the probe, delayed")
    reported = Quantity("measured_flow", "m3/s", "What the flow probe reports", nominal=1e-4, display_unit="mL/s")
    model = model.extend(delays=[Delay(late_flow, of="probed_flow", by="flow_delay"),
                                 Delay(late_pressure, of="probed_pressure", by="pressure_delay")])  # fmt: skip
    model = model.observe(reported, late_flow.symbol)
    model = model.observe(_pressure("measured_pressure", "What the pressure probe reports"), late_pressure.symbol)
    return model.with_values(values or {})


def _pressure(name: str, description: str) -> Quantity:
    return Quantity(name, "Pa", description, nominal=1e4, display_unit="mmHg")
