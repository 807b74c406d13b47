"""The U.S. FDA's mock circulatory loop: what it opposes to a flow, as a windkessel of three elements.

::

     flow     Z_c              p_C
      o-----[=====]-----+------+----[ R ]----o  0
      |                 |      |
     pressure          === C   outflow
      |                 |
      o-----------------+--------------------o

Equations: C dp_C/dt = flow - outflow, outflow = p_C / R; pressure = p_C + Z_c flow. Every record starts at a pressure
of its own.

Citation: N. Westerhof, J. W. Lankhaar, B. E. Westerhof, "The arterial windkessel", Med. Biol. Eng. Comput. 47 (2009)
131-141. Records: FDA mock circulatory loop, normovolemic, CC0. What these equations lack: the resistance of tubes and
clamps grows with what flows through them.

Usage::

    tubular-dea close-loop DATA --plant cosim_examples/plants/mock_loop.py --out OUT
"""

from tubular_dea.plants import Balance, Build, Coefficient, Input, Output, Path, Plant

m = Build("MockLoop", "Mock circulatory loop as a windkessel of three elements", __doc__ or "")
flow = m.input("flow", "m3/s", "Flow into the loop", nominal=3e-4, display_unit="mL/s")
resistance = m.parameter("R", "Pa.s/m3", 1.3e8, "Outflow resistance", minimum=1e5)
compliance = m.parameter("C", "m3/Pa", 1e-8, "Compliance", minimum=1e-12)
impedance = m.parameter("Z_c", "Pa.s/m3", 7e6, "Impedance of the inlet", minimum=0.0)
stored = m.state("p_C", "Pa", "Pressure of the compliance", start="free", nominal=1e4, display_unit="mmHg")
outflow = m.define(
    "outflow", "m3/s", stored / resistance, "Flow out of the compliance", nominal=1e-4, display_unit="mL/s"
)
m.derivative(stored, (flow - outflow) / compliance)
m.output("pressure", "Pa", stored + impedance * flow, "Pressure at the inlet", nominal=1e4, display_unit="mmHg")

PLANT = Plant(
    m.model(),
    inputs=[Input("flow")],
    outputs=[Output("pressure")],
    places=[
        Coefficient("outflow", of="p_C"),
        Coefficient("C", of="p_C"),
        Balance("p_C"),
        Path("flow", seconds=0.02, delayed=True),
        Path("pressure", seconds=0.02),
    ],
)
