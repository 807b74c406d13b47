"""Patients: whole parameter sets of the ventricle and its windkessel, in SI units, with their sources.

`healthy` is Simaan et al. (2009), Table I and the text: E_max 2 mmHg/mL, E_min 0.06 mmHg/mL, V_0 10 mL, 75 beats a
minute, R_M 0.005, R_A 0.001, R_C 0.0398, R_S 1.0 mmHg s/mL, C_S 1.33 mL/mmHg. Its closed loop is opened here: the
atrium becomes a constant filling pressure, the one that loop has at the end of diastole (7.4 mmHg). L is of the size
Stergiopulos et al. (1999) find in man.

`failing`: in severe heart failure (ejection fraction below 40 %) the ventricle's elastance is less than half of the
arterial one, where in health it is nearly twice as large (Asanoi, Sasayama, Kameyama, Circ. Res. 65 (1989) 483-493).
The arterial elastance R / T is 1.25 mmHg/mL here; E_max is 0.5 mmHg/mL (2.0 in health). The raised filling pressure of
decompensation, 14 mmHg, keeps the flow up: end-diastolic volume 242 mL, ejection fraction 21 %, 91/62 mmHg.

`stiff` is the healthy ventricle before stiff arteries: C 0.6 mL/mmHg and the characteristic impedance that belongs to
it; Z_c ~ sqrt(L/C) rises as C falls (O'Rourke, Arterial Function in Health and Disease, 1982).
"""

from __future__ import annotations

from ..errors import UserError

MMHG = 133.322  # Pa
ML = 1e-6  # m3
RESISTANCE = MMHG / ML  # 1 mmHg s/mL in Pa s/m3


class PatientError(UserError, ValueError):
    """A patient set that is unknown, incomplete or out of bounds."""


HEALTHY = {
    "heart_rate": 75 / 60,
    "E_max": 2.0 * MMHG / ML,
    "E_min": 0.06 * MMHG / ML,
    "V_0": 10 * ML,
    "filling_pressure": 7.4 * MMHG,
    "venous_pressure": 7.4 * MMHG,
    "R_mitral": 0.005 * RESISTANCE,
    "R_aortic": 0.001 * RESISTANCE,
    "Z_c": 0.0398 * RESISTANCE,
    "C": 1.33 * ML / MMHG,
    "R": 1.0 * RESISTANCE,
    "L": 0.005 * RESISTANCE,
    "ventricular_volume_start": 130 * ML,
    "aortic_pressure_start": 75 * MMHG,
}

FAILING = HEALTHY | {
    "E_max": 0.5 * MMHG / ML,
    "filling_pressure": 14 * MMHG,
    "venous_pressure": 14 * MMHG,
    "ventricular_volume_start": 240 * ML,
    "aortic_pressure_start": 62 * MMHG,
}

STIFF = HEALTHY | {"C": 0.6 * ML / MMHG, "Z_c": 0.06 * RESISTANCE, "elements": 3}

PATIENTS: dict[str, dict[str, float]] = {"healthy": HEALTHY, "failing": FAILING, "stiff": STIFF}
