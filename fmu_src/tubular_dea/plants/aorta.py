"""The aorta as a windkessel of three elements, and the effects that this model may lack.

::

     flow     Z_c              p_C
      o-----[=====]-----+------+----[ R ]----o  0
      |                 |      |
     pressure          === C   outflow
      |                 |
      o-----------------+--------------------o

Equations: C dp_C/dt = flow - p_C / R; pressure = p_C + Z_c flow. Own effects: an inertance in series adds L dflow/dt to
the pressure; one beside Z_c takes the flow Q_b off it, dQ_b/dt = parallel_rate (flow - Q_b); the outflow stops at a
pressure of its own, outflow = (p_C - p_out) / R. Delays of the probes, their lag, a resistance that grows with the flow
and the like are laws at the places.

Citation: N. Westerhof, J. W. Lankhaar, B. E. Westerhof, "The arterial windkessel", Med. Biol. Eng. Comput. 47 (2009)
131-141; the inertance beside Z_c: N. Stergiopulos, B. E. Westerhof, N. Westerhof, Am. J. Physiol. 276 (1999) H81-H88.
Delays of flow probes: their output filters (Transonic T400: 10 to 40 ms).

Usage::

    tubular-dea close-loop DATA --plant aorta --out OUT
"""

from __future__ import annotations

from ..laws import Balance, Coefficient, Path
from ..model.build import Build
from ..model.change import added
from ..model.declare import Model, Quantity, State
from ..model.effect import Effect
from .plant import Input, Output, Plant

PROBES = 0.02  # s: the usual delay or lag of a probe

m = Build("AorticAfterload", "Windkessel of three elements behind the aortic valve", __doc__ or "")
flow = m.input("flow", "m3/s", "Flow into the aorta", nominal=3e-4, display_unit="mL/s")
R = m.parameter("R", "Pa.s/m3", 1.3e8, "Peripheral resistance", minimum=1e3, source="Westerhof 2009")
C = m.parameter("C", "m3/Pa", 1e-8, "Compliance", minimum=1e-15, source="Westerhof 2009")
Z_c = m.parameter("Z_c", "Pa.s/m3", 7e6, "Characteristic impedance", minimum=0.0, source="Westerhof 2009")
stored = m.state("p_C", "Pa", "Pressure of the compliance", start="free", nominal=1.2e4, display_unit="mmHg")
inflow = m.define("inflow", "m3/s", flow, "Flow that reaches the aorta", nominal=3e-4, display_unit="mL/s")
m.define("inflow_rate", "m3/s2", m.rate(flow), "Its rate", nominal=5e-3)
outflow = m.define("outflow", "m3/s", stored / R, "Flow into the periphery", nominal=1e-4, display_unit="mL/s")
m.derivative(stored, (inflow - outflow) / C)
m.output(
    "pressure", "Pa", stored + Z_c * inflow, "Pressure at the root of the aorta", nominal=1.2e4, display_unit="mmHg"
)


def _inertance(model: Model) -> Model:
    return added(model, "pressure", model["inertance"] * model["inflow_rate"])


def _parallel(model: Model) -> Model:
    beside = Quantity("Q_b", "m3/s", "Flow through the inertance beside Z_c", nominal=1e-4, display_unit="mL/s")
    rate = model["parallel_rate"] * (model["inflow"] - beside.symbol)
    model = model.extend(states=[State(beside, rate, model["Q_b_start"])])
    return added(model, "pressure", -model["Z_c"] * beside.symbol)


def _outflow_pressure(model: Model) -> Model:
    return added(model, "outflow", -model["outflow_pressure"] / model["R"])


EFFECTS = (
    Effect(
        "inertance",
        "aorta",
        "The blood's mass, in series",
        _inertance,
        (Quantity("inertance", "Pa.s2/m3", "Inertance in series", 0.0, "Westerhof 2009", -1e7, 1e7, 1e5),),
        off={"inertance": 0.0},
        typical={"inertance": 1e5},
        documentation="Equation: pressure += inertance d(flow)/dt.",
    ),
    Effect(
        "parallel_inertance",
        "aorta",
        "The blood's mass, beside Z_c",
        _parallel,
        (
            Quantity(
                "parallel_rate", "1/s", "Z_c over the inertance beside it", 0.0, "Stergiopulos 1999", 0.0, 1e3, 10.0
            ),
            Quantity("Q_b_start", "m3/s", "Flow through it at the start", 0.0, "Stergiopulos 1999", -1e-2, 1e-2, 1e-4),
        ),
        off={"parallel_rate": 0.0},
        typical={"parallel_rate": 10.0, "Q_b_start": 0.0},
        refine=("Q_b_start",),
        documentation="Equation: pressure -= Z_c Q_b, d(Q_b)/dt = parallel_rate (flow - Q_b).",
    ),
    Effect(
        "outflow_pressure",
        "aorta",
        "The outflow stops at a pressure of its own",
        _outflow_pressure,
        (
            Quantity(
                "outflow_pressure",
                "Pa",
                "Pressure at which the outflow stops",
                0.0,
                "Westerhof 2009",
                -5e4,
                5e4,
                1e3,
                "mmHg",
            ),
        ),
        off={"outflow_pressure": 0.0},
        typical={"outflow_pressure": 1e3},
        documentation="Equation: outflow = (p_C - outflow_pressure) / R.",
    ),
)
FLOW_NAMES = {"delay": "flow_delay", "lag": "flow_lag", "offset": "flow_offset", "gain": "flow_gain"}
PRESSURE_NAMES = {
    "delay": "pressure_delay",
    "offset": "pressure_offset",
    "gain": "pressure_gain",
    "lag": "sensor_lag",
    "lag.tau": "tau_sensor",
    "lag.share": "sensor_share",
}
PLANT = Plant(
    m.model(),
    inputs=(Input("flow", channel="flow probe"),),
    outputs=(Output("pressure", channel="pressure probe"),),
    places=(
        Path("flow", delayed=True, signal="inflow", channel="flow probe", names=FLOW_NAMES, seconds=PROBES),
        Path("pressure", channel="pressure probe", names=PRESSURE_NAMES, seconds=PROBES),
        Coefficient("outflow", of="p_C", channel="periphery"),
        Balance("p_C", channel="aorta"),
        Coefficient("C", of="p_C", channel="aorta"),
    ),
    own={effect.id: effect for effect in EFFECTS},
)
