"""What the aorta opposes to a flow: a windkessel of three elements, and what recordings may show that it lacks.

::

     flow    Z_c      L          aortic_pressure at the left; measured_flow: what a probe reports, `flow_delay` late
      o-----[===]---(( ))--+---[ R ]---o outflow_pressure
                           |
                          === C
                           |

Equations: C dp_C/dt = Q - (p_C - p_out) / R; p = p_C + Z_c Q + L dQ/dt; Q_probe(t) = Q(t - flow_delay).

Citation: N. Westerhof, J. W. Lankhaar, B. E. Westerhof, "The arterial windkessel", Med. Biol. Eng. Comput. 47 (2009)
131-141. Delays of flow probes: their output filters (Transonic T400: 10 to 40 ms).

Parameters: `PARAMETERS`; the three extras are off at 0.

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
    Quantity("outflow_pressure", "Pa", "Pressure at which the outflow stops", 0.0, "Westerhof 2009", None, None, 1e4,
             display_unit="mmHg"),
    Quantity("flow_delay", "s", "By how much the flow probe is late", 0.0, "Transonic T400", 0.0, LARGEST_DELAY, 0.01),
    Quantity("p_C_start", "Pa", "Pressure of the compliance at the start", 1.2e4, "", None, None, 1e4,
             display_unit="mmHg"),
)  # fmt: skip
FIXED = ("p_C_start",)


def aortic_afterload(values: Mapping[str, float] | None = None) -> Model:
    """The declared model, with some values changed by name (SI)."""
    s = {q.name: q.symbol for q in (FLOW, *PARAMETERS)}
    stored = Quantity("p_C", "Pa", "Pressure of the compliance", nominal=1e4, display_unit="mmHg")
    pressure = Quantity("aortic_pressure", "Pa", "Pressure at the root of the aorta", nominal=1e4, display_unit="mmHg")
    now = Quantity("probed_flow", "m3/s", "Flow through the probe", nominal=1e-4)
    late = Quantity("late_flow", "m3/s", "Flow through the probe, delayed", nominal=1e-4)
    seen = Quantity("measured_flow", "m3/s", "What the flow probe reports", nominal=1e-4, display_unit="mL/s")
    outflow = (stored.symbol - s["outflow_pressure"]) / s["R"]
    model = Model(
        name="AorticAfterload",
        description="Windkessel of three elements with what recordings show that it lacks",
        documentation=__doc__ or "",
        inputs=(FLOW,),
        parameters=tuple(Parameter(q, tunable=q.name not in FIXED) for q in PARAMETERS),
        definitions=(
            Definition(pressure, stored.symbol + s["Z_c"] * s["flow"] + s["inertance"] * rate(FLOW)),
            Definition(now, sympy.Add(s["flow"], 0)),
        ),
        states=(State(stored, (s["flow"] - outflow) / s["C"], s["p_C_start"], s["p_C_start"]),),
        outputs=("aortic_pressure",),
    )
    model = model.extend(delays=[Delay(late, of="probed_flow", by="flow_delay")]).observe(seen, late.symbol)
    return model.with_values(dict(values or {}))
