"""The left ventricle and the aorta it ejects into: time-varying elastance, two valves, a windkessel.

::

     filling    mitral            aortic valve
     pressure   valve   ________               Z_c            aortic_pressure: here the tube is filled (tube_flow)
       o--------|>|----| E(t)   |----|>|---+--[===]--+----+-----[ R ]----o venous_pressure
                       | V, p_v |          |         |    |
                       '--------'          '-(( L ))-'   === C
                                        (4 elements: L       |
                                         beside Z_c)        ---

Equations:

* elastance E = E_min + (E_max - E_min) e(t_n), p_v = E (V - V_0), dV/dt = Q_mitral - Q_aortic. The activation e is
  the double Hill curve of Stergiopulos et al. (1996) with the numbers of Simaan et al. (2009):
  e = 1.55 (t_n/0.7)^1.9 / (1 + (t_n/0.7)^1.9) / (1 + (t_n/1.17)^21.9), t_n = t / (0.2 s + 0.15 T), T one beat.
* valves: Q = D g(D), with D the pressure that drives the flow and g the conductance, which goes from closed to open
  within a few `valve_width` around D = 0 as a tanh (Pfaller et al. (2019) do so with the resistance): a continuous
  right-hand side. Behind the aortic valve Z_c is in series and D = p_v - p_C + Z_c (Q_tube + Q_L), the drive with
  the valve's own flow taken out: no equation has to be solved for the flow.
* windkessel: C dp_C/dt = Q_aortic - Q_tube - (p_C - p_venous) / R;
  aortic pressure = p_C + Z_c (Q_aortic - Q_tube - Q_L), L dQ_L/dt = Z_c (Q_aortic - Q_tube - Q_L).
  2 elements: Z_c = 0 and Q_L = 0. 3: Q_L = 0. 4: as written (Stergiopulos et al. 1999).

Citations:

* M. A. Simaan et al., "A dynamical state space representation and performance analysis of a feedback-controlled rotary
  left ventricular assist device", IEEE Trans. Control Syst. Technol. 17 (2009) 15-28: the healthy values.
* N. Stergiopulos, J. J. Meister, N. Westerhof, "Determinants of stroke volume and systolic and diastolic aortic
  pressure", Am. J. Physiol. 270 (1996) H2050-H2059: the activation.
* N. Stergiopulos, B. E. Westerhof, N. Westerhof, "Total arterial inertance as the fourth element of the windkessel
  model", Am. J. Physiol. 276 (1999) H81-H88: the fourth element beside Z_c.
* M. R. Pfaller et al., "The importance of the pericardium for cardiac biomechanics: from physiology to computational
  modeling", Biomech. Model. Mechanobiol. 18 (2019) 503-529: smooth valves.

Parameters: those of the healthy heart are listed below; `tubular_dea.patient` gives those of other patients.

Usage::

    from tubular_dea.model.windkessel import aortic_windkessel, patient
    model = aortic_windkessel()                          # healthy
    model = aortic_windkessel(patient("failing"))
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Mapping

import sympy
from sympy import tanh

from .declare import TIME, Definition, Model, Parameter, Quantity, State, nearest, sized
from .patients import MMHG, PATIENTS, RESISTANCE, PatientError
from .whole import cycle_fraction, rename

# The R wave shows this part of a cycle before its exact place, so that a master which lands there sees it.
R_WAVE_LEAD = 1e-6
R_WAVE_DURATION = 0.02  # s

TUBE_FLOW = Quantity(
    "tube_flow",
    "m3/s",
    "Flow from the aorta into the tube",
    0.0,
    "the flow conjugate to the wall's work",
    nominal=1e-4,
    display_unit="mL/s",
)

PACE = Quantity("pace", "Hz", "Beats per second, now", 1.25, nominal=1.0, display_unit="1/min")

SIMAAN = "Simaan et al. (2009)"


ELASTANCE, COMPLIANCE, INERTANCE = "Pa/m3", "m3/Pa", "Pa.s2/m3"

_V = PATIENTS["healthy"]
QUANTITIES = (
    sized("heart_rate", "Hz", "Beats per second", _V["heart_rate"], SIMAAN, 0.3, 5.0, "1/min"),
    sized("E_max", ELASTANCE, "Largest elastance of the ventricle", _V["E_max"], SIMAAN, 1e5, 1e10, "mmHg/mL"),
    sized("E_min", ELASTANCE, "Elastance of the resting ventricle", _V["E_min"], SIMAAN, 1e5, 1e10, "mmHg/mL"),
    sized("V_0", "m3", "Volume of the ventricle without pressure", _V["V_0"], SIMAAN, 0.0, 1e-3, "mL"),
    sized("T_offset", "s", "Time scale of the activation: its constant part", 0.2, SIMAAN, 1e-3, 1.0),
    sized("T_fraction", "1", "Time scale of the activation: its part of the beat", 0.15, SIMAAN, 0.0, 1.0),
    sized(
        "filling_pressure",
        "Pa",
        "Pressure before the mitral valve",
        _V["filling_pressure"],
        "end-diastolic atrial pressure of Simaan's closed loop",
        0.0,
        1e4,
        "mmHg",
    ),
    sized(
        "venous_pressure",
        "Pa",
        "Pressure behind the peripheral resistance",
        _V["venous_pressure"],
        "as filling_pressure: the loop closes into the atrium",
        0.0,
        1e4,
        "mmHg",
    ),
    sized("R_mitral", "Pa.s/m3", "Resistance of the open mitral valve", _V["R_mitral"], SIMAAN, 1e3, 1e10, "mmHg.s/mL"),
    sized("R_aortic", "Pa.s/m3", "Resistance of the open aortic valve", _V["R_aortic"], SIMAAN, 1e3, 1e10, "mmHg.s/mL"),
    sized(
        "R_closed",
        "Pa.s/m3",
        "Resistance of a closed valve",
        1e4 * RESISTANCE,
        "tight against R",
        1e8,
        1e16,
        "mmHg.s/mL",
    ),
    sized(
        "valve_width",
        "Pa",
        "Pressure over which a valve opens",
        0.2 * MMHG,
        "small against the beat",
        1e-2,
        1e4,
        "mmHg",
    ),
    sized(
        "Z_c",
        "Pa.s/m3",
        "Characteristic impedance (3 and 4 elements)",
        _V["Z_c"],
        f"{SIMAAN}, R_C",
        0.0,
        1e10,
        "mmHg.s/mL",
    ),
    sized("C", COMPLIANCE, "Compliance of the arteries", _V["C"], f"{SIMAAN}, C_S", 1e-11, 1e-6, "mL/mmHg"),
    sized("R", "Pa.s/m3", "Peripheral resistance", _V["R"], f"{SIMAAN}, R_S", 1e6, 1e12, "mmHg.s/mL"),
    sized(
        "L",
        INERTANCE,
        "Inertance beside Z_c (4 elements)",
        _V["L"],
        "Stergiopulos et al. (1999)",
        1e3,
        1e12,
        "mmHg.s2/mL",
    ),
    sized(
        "ventricular_volume_start",
        "m3",
        "Volume of the ventricle at the start",
        _V["ventricular_volume_start"],
        "end of diastole",
        0.0,
        1e-2,
        "mL",
    ),
    sized(
        "aortic_pressure_start",
        "Pa",
        "Pressure of the arteries at the start",
        _V["aortic_pressure_start"],
        "end of diastole",
        0.0,
        1e5,
        "mmHg",
    ),
    sized("phase_start", "1", "Place in the cycle at the start; 0 is the R wave", 0.0, "", 0.0, 1.0),
)
ELEMENTS = Quantity(
    "elements", "1", "Elements of the windkessel: 2 (R, C), 3 (Z_c) or 4 (L)", 2, "", 2, 4, 1.0, type="Integer"
)

TUNABLE = ("heart_rate", "E_max", "E_min", "filling_pressure", "C", "R")
PARAMETERS = (*(Parameter(q, tunable=q.name in TUNABLE) for q in QUANTITIES), Parameter(ELEMENTS))

PHASE = Quantity("phase", "1", "Cycles since the start; whole numbers are R waves")
VOLUME = Quantity("ventricular_volume", "m3", "Volume of the left ventricle", nominal=1e-4, display_unit="mL")
PRESSURE_C = Quantity("arterial_pressure", "Pa", "Pressure of the compliance C", nominal=1e4, display_unit="mmHg")
INERTIAL_FLOW = Quantity("inertial_flow", "m3/s", "Flow through L", nominal=1e-4, display_unit="mL/s")
TUBE_WORK = Quantity("tube_work", "J", "Work the aorta has done on the tube", nominal=1.0, display_unit="mJ")
STROKE_WORK = Quantity("ventricular_work", "J", "Work the ventricle has done", nominal=1.0, display_unit="mJ")

OUTPUTS = (
    "aortic_pressure",
    "ventricular_pressure",
    "ventricular_volume",
    "aortic_flow",
    "activation",
    "r_wave",
    "mitral_flow",
    "phase",
    "next_r_wave",
    "arterial_pressure",
    "tube_work",
    "ventricular_work",
    "ventricular_energy",
)


def aortic_windkessel(values: Mapping[str, float] | None = None) -> Model:
    """Ventricle, valves and windkessel; `values` (SI units) replace the healthy defaults."""
    model = Model(
        name="AorticWindkessel",
        description="Left ventricle (time-varying elastance, valves) and windkessel with 2, 3 or 4 elements",
        documentation=__doc__ or "",
        inputs=(TUBE_FLOW,),
        parameters=PARAMETERS,
        definitions=tuple(_definitions()),
        states=_states(),
        outputs=OUTPUTS,
    )
    return model.with_values(values or {})


def paced_windkessel(values: Mapping[str, float] | None = None) -> Model:
    """The same, paced: the input `pace` [Hz] takes the place of the parameter heart_rate.

    With the pace 1 / RR from each recorded R wave to the next, the ventricle's R waves are the recorded ones.
    """
    model = aortic_windkessel({n: v for n, v in (values or {}).items() if n != "heart_rate"})
    pace = {sympy.Symbol("heart_rate", real=True): PACE.symbol}
    return dataclasses.replace(
        model,
        name="PacedWindkessel",
        description=f"{model.description}, paced by an input",
        inputs=(TUBE_FLOW, PACE),
        parameters=tuple(p for p in model.parameters if p.quantity.name != "heart_rate"),
        definitions=tuple(dataclasses.replace(d, expression=rename(d.expression, pace)) for d in model.definitions),
        states=tuple(dataclasses.replace(s, derivative=rename(s.derivative, pace)) for s in model.states),
    )


def patient(name: str, changes: Mapping[str, float] | None = None) -> dict[str, float]:
    """The parameter set of that name with `changes`, complete and checked; SI units."""
    if name not in PATIENTS:
        raise PatientError(f"there is no patient {name!r}{nearest(name, PATIENTS)}")
    return checked_patient({**PATIENTS[name], **(changes or {})}, name)


def check_known(given: Iterable[str], name: str) -> None:
    """`PatientError` for the first name given to the patient `name` that is none of its parameters."""
    known = [p.quantity.name for p in PARAMETERS]
    for parameter in given:
        if parameter not in known:
            raise PatientError(f"patient {name!r}: there is no parameter {parameter!r}{nearest(parameter, known)}")


def checked_patient(values: Mapping[str, float], name: str) -> dict[str, float]:
    """`values` if they are a whole patient set: every name known, none missing, each within its bounds."""
    check_known(values, name)
    declared = {p.quantity.name: p.quantity for p in PARAMETERS}
    missing = [n for n in PATIENTS["healthy"] if n not in values]
    if missing:
        q = declared[missing[0]]
        raise PatientError(f"patient {name!r} lacks {', '.join(missing)}; give {q.name} ({q.description}) in {q.unit}")
    for given, value in values.items():
        q = declared[given]
        if not q.allows(value):
            raise PatientError(
                f"patient {name!r}: {given}: expected {q.minimum} to {q.maximum} {q.unit} but was given {value:g}"
            )
    return {n: float(v) for n, v in values.items()}


def _definitions() -> list[Definition]:
    """Activation, ventricle, valves and windkessel, in this order."""
    s = {q.name: q.symbol for q in (TUBE_FLOW, *QUANTITIES, ELEMENTS, PHASE, VOLUME, PRESSURE_C, INERTIAL_FLOW)}
    definitions: list[Definition] = []

    def define(
        name: str,
        unit: str,
        description: str,
        expression: sympy.Expr,
        nominal: float = 1.0,
        display_unit: str | None = None,
    ) -> sympy.Symbol:
        quantity = Quantity(name, unit, description, nominal=nominal, display_unit=display_unit)
        definitions.append(Definition(quantity, expression))
        return quantity.symbol

    one, zero = sympy.Integer(1), sympy.Integer(0)
    cycle = define("cycle", "1", "Place in the cycle, 0 to 1", cycle_fraction(s["phase"]))
    t_n = define(
        "t_n",
        "1",
        "Time in the cycle over the time scale of the activation",
        cycle / (s["heart_rate"] * s["T_offset"] + s["T_fraction"]),
    )
    rise = define("rise", "1", "First Hill curve", (t_n / sympy.Float("0.7")) ** sympy.Float("1.9"))
    fall = define("fall", "1", "Second Hill curve", (t_n / sympy.Float("1.17")) ** sympy.Float("21.9"))
    activation = define(
        "activation",
        "1",
        "Activation of the ventricle: 0 at rest, 1 at its strongest",
        sympy.Float("1.55") * rise / (1 + rise) / (1 + fall),
    )
    elastance = define(
        "elastance",
        ELASTANCE,
        "Elastance of the ventricle",
        s["E_min"] + (s["E_max"] - s["E_min"]) * activation,
        1e8,
        "mmHg/mL",
    )
    p_v = define(
        "ventricular_pressure",
        "Pa",
        "Pressure of the left ventricle",
        elastance * (s["ventricular_volume"] - s["V_0"]),
        1e4,
        "mmHg",
    )
    define(
        "ventricular_energy",
        "J",
        "Energy stored in the elastance of the ventricle",
        p_v * (s["ventricular_volume"] - s["V_0"]) / 2,
        1.0,
        "mJ",
    )

    closed = 1 / s["R_closed"]
    drive = define("mitral_drive", "Pa", "Pressure that drives the mitral flow", s["filling_pressure"] - p_v, 1e3)
    gate = define(
        "mitral_opening", "1", "Opening of the mitral valve, 0 to 1", (1 + tanh(drive / s["valve_width"])) / 2
    )
    define(
        "mitral_flow",
        "m3/s",
        "Flow into the ventricle",
        drive * (closed + (1 / s["R_mitral"] - closed) * gate),
        1e-4,
        "mL/s",
    )

    z = define(
        "Z",
        "Pa.s/m3",
        "Impedance in series: Z_c but for 2 elements",
        s["Z_c"] * sympy.Piecewise((one, s["elements"] > sympy.Float(2.5)), (zero, True)),
        1e6,
        "mmHg.s/mL",
    )
    drive = define(
        "aortic_drive",
        "Pa",
        "Pressure that drives the aortic flow",
        p_v - s["arterial_pressure"] + z * (s["tube_flow"] + s["inertial_flow"]),
        1e3,
    )
    gate = define(
        "aortic_opening", "1", "Opening of the aortic valve, 0 to 1", (1 + tanh(drive / s["valve_width"])) / 2
    )
    aortic_flow = define(
        "aortic_flow",
        "m3/s",
        "Flow out of the ventricle",
        drive * (closed + (1 / (s["R_aortic"] + z) - closed) * gate),
        1e-4,
        "mL/s",
    )
    define(
        "aortic_pressure",
        "Pa",
        "Pressure of the aorta where the tube is",
        s["arterial_pressure"] + z * (aortic_flow - s["tube_flow"] - s["inertial_flow"]),
        1e4,
        "mmHg",
    )

    ahead = define("cycle_ahead", "1", "Place in the cycle, a little ahead", cycle_fraction(s["phase"] + R_WAVE_LEAD))
    define(
        "r_wave",
        "1",
        "1 for 20 ms from the R wave on, else 0",
        sympy.Piecewise((one, ahead < R_WAVE_DURATION * s["heart_rate"]), (zero, True)),
    )
    define(
        "next_r_wave", "s", "Time of the next R wave", TIME + (1 - ahead + sympy.Float(R_WAVE_LEAD)) / s["heart_rate"]
    )
    return definitions


def _states() -> tuple[State, ...]:
    """Phase, ventricle, compliance, inertance, and the two integrals of power."""
    one, zero = sympy.Integer(1), sympy.Integer(0)
    s = {
        n: sympy.Symbol(n, real=True)
        for n in (
            "heart_rate",
            "mitral_flow",
            "aortic_flow",
            "aortic_pressure",
            "ventricular_pressure",
            "tube_flow",
            "C",
            "R",
            "venous_pressure",
            "Z_c",
            "L",
            "elements",
            "ventricular_volume_start",
            "aortic_pressure_start",
            "phase_start",
            "arterial_pressure",
            "inertial_flow",
        )
    }
    has_inertance = sympy.Piecewise((one, s["elements"] > sympy.Float(3.5)), (zero, True))
    into = s["aortic_flow"] - s["tube_flow"]

    def state(quantity: Quantity, derivative: sympy.Expr, start: sympy.Expr) -> State:
        return State(quantity, derivative, start, start)

    return (
        state(PHASE, s["heart_rate"], s["phase_start"]),
        state(VOLUME, s["mitral_flow"] - s["aortic_flow"], s["ventricular_volume_start"]),
        state(
            PRESSURE_C,
            (into - (s["arterial_pressure"] - s["venous_pressure"]) / s["R"]) / s["C"],
            s["aortic_pressure_start"],
        ),
        state(INERTIAL_FLOW, has_inertance * s["Z_c"] / s["L"] * (into - s["inertial_flow"]), zero),
        state(TUBE_WORK, s["aortic_pressure"] * s["tube_flow"], zero),
        state(STROKE_WORK, s["ventricular_pressure"] * (s["aortic_flow"] - s["mitral_flow"]), zero),
    )
