"""The tubular dielectric elastomer actuator: equations (1)-(18) and Tables I and III of the paper.

::

            2 l_o (clamped at both ends)              h_a: one active layer, field E = V / h_a
        |<-------------------------->|              ______________________________
        |        .-''''''''-.        |             |  electrode  +V               |
        |    .-'      ^      '-.     |             |  elastomer, 100 um           |
     ===|--'          | R        '---|===          |  electrode   0               |
        |      - - - -|- - - - -     |  r_o        |  ... n_layers, rolled twice  |
     ===|--.          |          .---|===          |______________________________|
        |    '-.      v       .-'    |
        |        '-........-'        |              lambda_1 = l / l_o   (along the generatrix)
             pressure p inside                      lambda_2 = R / r_o   (hoop, at the middle)

Equations: listed below, one definition a line, numbered as in the paper.

Citation: N. Liu, T. Martinez, A. Walter, Y. Civet, Y. Perriard, "Control-oriented modeling and analysis of
tubular dielectric elastomer actuators dedicated to cardiac assist devices".

Parameters: Table I (geometry, fixed) and Table III (identified, tunable) of the paper.

Usage::

    from tubular_dea.model.dea import tubular_dea
    model = tubular_dea()
    model.expression("sigma_hoop")
"""

from __future__ import annotations

import sympy
from sympy import asinh, pi, sqrt

from .declare import Definition, EquilibriumCurve, Model, Parameter, Quantity, State, Terminal, rate, sized

MMHG = 133.322  # Pa

PRESSURE = Quantity(
    "pressure",
    "Pa",
    "Transmural pressure p: inside minus outside the tube",
    0.0,
    "Eq. (16)",
    nominal=1e4,
    display_unit="mmHg",
)
VOLTAGE = Quantity("voltage", "V", "Voltage V across each active layer", 0.0, "Eq. (6)", nominal=5e3, display_unit="kV")


IDENTIFIED = (
    sized("C_1", "Pa", "Yeoh coefficient of (I_1 - 3)", 333.056e3, "Table III", 1.0, None, "kPa"),
    sized("C_2", "Pa", "Yeoh coefficient of (I_1 - 3)^2", -32.5032e3, "Table III", None, None, "kPa"),
    sized("C_3", "Pa", "Yeoh coefficient of (I_1 - 3)^3", 2.86041e3, "Table III", 1e-3, None, "kPa"),
    sized("eps_r", "1", "Relative permittivity of the elastomer", 2.8, "Table III", 1.0),
    sized("eta_o", "Pa.s", "Damping of the parallel damper", 745.854e3, "Table III", 1e-3, None, "kPa.s"),
    sized("k_1", "Pa", "Stiffness of Maxwell branch 1", 19.6758e6, "Table III", 1.0, None, "MPa"),
    sized("eta_1", "Pa.s", "Damping of Maxwell branch 1", 6495.68e3, "Table III", 1.0, None, "kPa.s"),
    sized("k_2", "Pa", "Stiffness of Maxwell branch 2", 2.414e6, "Table III", 1.0, None, "MPa"),
    sized("eta_2", "Pa.s", "Damping of Maxwell branch 2", 6508.21e3, "Table III", 1.0, None, "kPa.s"),
)

GEOMETRY = (
    sized("l_o", "m", "Half length of the tube at rest", 24.5e-3, "Table I", 1e-4, 10.0, "mm"),
    sized("r_o", "m", "Mean radius of the tube at rest", 15e-3, "Table I", 1e-4, 10.0, "mm"),
    sized("h_o", "m", "Wall thickness at rest", 1e-3, "Table I", 1e-6, 1.0, "mm"),
    sized("h_ao", "m", "Thickness of one active layer at rest", 100e-6, "Table I", 1e-8, 1.0, "um"),
    sized("rho", "kg/m3", "Density of the wall", 1e3, "Table I", 1.0, 1e5),
    sized("phi", "1", "Fraction of the wall that the field fills: 1 is the paper's", 1.0, "Eqs. (8), (14)", 0.0, 1.0),
    Quantity(
        "n_layers", "1", "Number of active layers, electrically in parallel", 8, "Fig. 2", 1, 1000, 10.0, type="Integer"
    ),
    sized("lambda_2_start", "1", "Hoop stretch at the start of the simulation", 1.0, "x(0), Section III", 0.7, 3.0),
    Quantity(
        "start_at_equilibrium",
        "1",
        "Start at rest under the initial pressure and voltage instead of at lambda_2_start",
        0,
        type="Boolean",
    ),
)

PARAMETERS = (
    *(Parameter(quantity, tunable=True) for quantity in IDENTIFIED),
    *(Parameter(quantity) for quantity in GEOMETRY),
)

LAMBDA_2 = Quantity(
    "lambda_2", "1", "Hoop stretch R / r_o at the middle of the tube", source="Eq. (17)", minimum=0.0
)  # lambda_3 is its inverse
LAMBDA_2_RATE = Quantity("lambda_2_rate", "1/s", "Rate of the hoop stretch", source="Eq. (17)", nominal=10.0)
SIGMA_VIS1 = Quantity(
    "sigma_vis1", "Pa", "Stress of Maxwell branch 1", source="Eq. (10)", nominal=1e5, display_unit="kPa"
)
SIGMA_VIS2 = Quantity(
    "sigma_vis2", "Pa", "Stress of Maxwell branch 2", source="Eq. (10)", nominal=1e5, display_unit="kPa"
)
SNAP_THROUGH_PRESSURE = Quantity(
    "snap_through_pressure",
    "Pa",
    "Largest pressure the tube carries at rest at the present voltage: the fold of p(lambda_2)",
    source="Fig. 9",
    nominal=1e4,
    display_unit="mmHg",
)

OUTPUTS = (
    "radial_displacement",
    "lambda_2",
    "electric_field",
    "radius",
    "lambda_1",
    "thickness",
    "tube_volume",
    "tube_flow",
    "capacitance",
    "charge",
    "current",
    "snap_through_pressure",
    "snap_through_margin",
    "measured_displacement",
)

TERMINALS = (
    Terminal(
        "lumen",
        "Blood in the tube: pressure, and the flow conjugate to the wall's work",
        (("pressure", "pressure"), ("flow", "tube_flow")),
    ),
    Terminal("electrodes", "Electrodes of the active layers", (("voltage", "voltage"), ("current", "current"))),
)


def tubular_dea() -> Model:
    """The paper's model as it stands in design.md section 1 (equation (4) corrected)."""
    return Model(
        name="TubularDEA",
        description="Tubular dielectric elastomer actuator for cardiac assist",
        documentation=__doc__ or "",
        inputs=(PRESSURE, VOLTAGE),
        parameters=PARAMETERS,
        definitions=tuple(_definitions()),
        states=_states(),
        outputs=OUTPUTS,
        curve=EquilibriumCurve(
            balance="equilibrium_pressure",
            load="pressure",
            unknown="lambda_2",
            fold=SNAP_THROUGH_PRESSURE,
            lower=0.7,
            fold_lower=1.0,
            upper=3.0,
            start_switch="start_at_equilibrium",
        ),
        terminals=TERMINALS,
        sensors=("measured_displacement",),
    )


def printed_sine(model: Model) -> Model:
    """The model with sin(theta) as equation (4) prints it, a square missing under the root.

    It contradicts the equation's own first equality; it is kept to show how little it changes
    (at most 0.03 mm and 1 mmHg).
    """
    r_o, l_o, lambda_2 = model["r_o"], model["l_o"], model["lambda_2"]
    return model.replace("sin_theta", r_o * (lambda_2 - 1) / sqrt(l_o**2 + (lambda_2 - 1) * r_o**2))


def _definitions() -> list[Definition]:
    """Equations (1)-(16) in the paper's order, then what a bench or a circuit sees."""
    s = {
        q.name: q.symbol
        for q in (
            PRESSURE,
            VOLTAGE,
            *IDENTIFIED,
            *GEOMETRY,
            LAMBDA_2,
            LAMBDA_2_RATE,
            SIGMA_VIS1,
            SIGMA_VIS2,
            SNAP_THROUGH_PRESSURE,
        )
    }
    definitions: list[Definition] = []

    def define(
        name: str,
        unit: str,
        source: str,
        description: str,
        expression: sympy.Expr,
        nominal: float = 1.0,
        display_unit: str | None = None,
    ) -> sympy.Symbol:
        quantity = Quantity(name, unit, description, source=source, nominal=nominal, display_unit=display_unit)
        definitions.append(Definition(quantity, expression))
        return quantity.symbol

    l_o, r_o, h_o, h_ao, lambda_2 = s["l_o"], s["r_o"], s["h_o"], s["h_ao"], s["lambda_2"]
    eps_o = define("eps_o", "F/m", "Table I", "Vacuum permittivity", sympy.Float("8.854e-12"), 1e-11)
    mass = define("m", "kg", "Section III", "Mass of the wall", s["rho"] * 2 * pi * r_o * h_o * 2 * l_o, 5e-3)

    # Geometry, equations (1)-(4)
    lambda_1 = define(
        "lambda_1", "1", "Eq. (3)", "Stretch along the generatrix", sqrt(1 + (r_o / l_o) ** 2 * (lambda_2 - 1) ** 2)
    )
    d_lambda_1 = define(
        "dlambda_1_dlambda_2",
        "1",
        "Eq. (10)",
        "Slope of lambda_1 over lambda_2",
        (r_o / l_o) ** 2 * (lambda_2 - 1) / lambda_1,
    )
    lambda_3 = define("lambda_3", "1", "Eq. (1)", "Stretch across the wall", 1 / (lambda_1 * lambda_2))
    length = define("l", "m", "Eq. (3)", "Half length of the deformed generatrix", l_o * lambda_1, 0.02, "mm")
    thickness = define("thickness", "m", "Eq. (1)", "Wall thickness h at the middle", h_o * lambda_3, 1e-3, "mm")
    radius = define("radius", "m", "Eq. (1)", "Radius R at the middle of the tube", r_o * lambda_2, 0.01, "mm")
    sin_theta = define(
        "sin_theta", "1", "Eq. (4), corrected", "Sine of the generatrix angle", r_o * (lambda_2 - 1) / length
    )

    # Stresses, equations (6)-(11), (14)
    field = define(
        "electric_field",
        "V/m",
        "Eq. (6)",
        "Electric field in an active layer",
        s["voltage"] * lambda_1 * lambda_2 / h_ao,
        5e7,
        "V/um",
    )
    maxwell = define(
        "sigma_maxwell",
        "Pa",
        "Eqs. (8), (14)",
        "Maxwell stress over the wall",
        s["phi"] * eps_o * s["eps_r"] * field**2,
        1e5,
        "kPa",
    )
    i_1 = define("I_1", "1", "Eq. (7)", "First invariant", lambda_1**2 + lambda_2**2 + lambda_3**2)
    slope = define(
        "dW_dI_1",
        "Pa",
        "Eq. (7)",
        "Slope of Yeoh's energy",
        s["C_1"] + 2 * s["C_2"] * (i_1 - 3) + 3 * s["C_3"] * (i_1 - 3) ** 2,
        1e5,
        "kPa",
    )
    sigma_m = define(
        "sigma_m",
        "Pa",
        "Eq. (8)",
        "Longitudinal hyperelastic minus Maxwell stress",
        slope * (2 * lambda_1**2 - 2 * lambda_3**2) - maxwell,
        1e5,
        "kPa",
    )
    sigma_eta = define(
        "sigma_eta",
        "Pa",
        "Eq. (11)",
        "Stress of the parallel damper",
        s["eta_o"] * d_lambda_1 * s["lambda_2_rate"],
        1e5,
        "kPa",
    )
    sigma_vis = define(
        "sigma_vis", "Pa", "Eq. (9)", "Stress of the Maxwell branches", s["sigma_vis1"] + s["sigma_vis2"], 1e5, "kPa"
    )
    sigma_hoop = define(
        "sigma_hoop",
        "Pa",
        "Eq. (14)",
        "Hoop hyperelastic minus Maxwell stress",
        slope * (2 * lambda_2**2 - 2 * lambda_3**2) - maxwell,
        1e5,
        "kPa",
    )

    # Forces, equations (12)-(16)
    a_1 = define("A_1", "m2", "Eq. (13)", "Longitudinal cross section", 2 * pi * r_o * h_o / lambda_1, 1e-4)
    f_dea = define("F_dea", "N", "Eq. (12)", "Longitudinal force", (sigma_m + sigma_vis + sigma_eta) * a_1, 10.0)
    a_2 = define("A_2", "m2", "Eq. (15)", "Hoop cross section (one half of the length)", thickness * length, 1e-5)
    f_cir = define("F_cir", "N", "Eq. (15)", "Hoop force in radial direction", 2 * pi * sigma_hoop * a_2, 10.0)
    a_3 = define("A_3", "m2", "Eq. (16)", "Inner surface", 2 * pi * (r_o + radius) * length, 5e-3)
    define(
        "lambda_2_acceleration",
        "1/s2",
        "Eq. (16)",
        "Second derivative of the hoop stretch",
        (s["pressure"] * a_3 - 2 * f_dea * sin_theta - f_cir) / (mass * r_o),
        1e3,
    )
    define(
        "equilibrium_pressure",
        "Pa",
        "Eq. (16)",
        "Pressure that holds the tube at rest",
        (2 * f_dea * sin_theta + f_cir) / a_3,
        1e4,
        "mmHg",
    )

    # What a bench, a windkessel and an amplifier see
    displacement = define(
        "radial_displacement", "m", "R - r_o", "Radial displacement at the middle of the tube", radius - r_o, 1e-3, "mm"
    )
    define(
        "tube_flow",
        "m3/s",
        "A_3 dR/dt",
        "Flow into the tube, conjugate to the wall's work",
        a_3 * r_o * s["lambda_2_rate"],
        1e-4,
        "mL/s",
    )
    define(
        "tube_volume",
        "m3",
        "Integral of A_3 dR",
        "Volume conjugate to the wall's work; the cylinder at lambda_2 = 1",
        _tube_volume(r_o, l_o, displacement, length),
        1e-5,
        "mL",
    )
    area = 2 * pi * r_o * 2 * l_o
    capacitance = define(
        "capacitance",
        "F",
        "n_layers plates",
        "Capacitance of the active layers in parallel",
        s["n_layers"] * eps_o * s["eps_r"] * area * (lambda_1 * lambda_2) ** 2 / h_ao,
        1e-8,
        "nF",
    )
    define("charge", "C", "C V", "Charge on the electrodes", capacitance * s["voltage"], 1e-5, "uC")
    define(
        "current",
        "A",
        "d(C V)/dt",
        "Charging current; a jump of the voltage moves its charge at once and is seen in the charge alone",
        capacitance * rate(VOLTAGE)
        + s["voltage"] * 2 * capacitance * (d_lambda_1 / lambda_1 + 1 / lambda_2) * s["lambda_2_rate"],
        1e-4,
        "uA",
    )
    define(
        "snap_through_margin",
        "Pa",
        "Fig. 9",
        "Pressure left before the tube snaps through at rest; a step of the voltage keeps to it too while the wall "
        "is damped by a thirtieth of Table III or more (a tenth with a hundredfold mass)",
        s["snap_through_pressure"] - s["pressure"],
        1e4,
        "mmHg",
    )
    define("measured_displacement", "m", "Section III", "What the bench's laser reports", displacement, 1e-3, "mm")
    return definitions


def _tube_volume(r_o: sympy.Symbol, l_o: sympy.Symbol, s: sympy.Symbol, length: sympy.Symbol) -> sympy.Expr:
    """2 pi r_o^2 l_o + integral of 2 pi (2 r_o + s) sqrt(l_o^2 + s^2) ds from 0 to s = R - r_o."""
    strip = r_o * (s * length + l_o**2 * asinh(s / l_o))
    return 2 * pi * (r_o**2 * l_o + strip + (length**3 - l_o**3) / 3)


def _states() -> tuple[State, ...]:
    """Equations (17)-(18)."""
    d_lambda_1, speed = sympy.symbols("dlambda_1_dlambda_2 lambda_2_rate", real=True)
    k_1, k_2, eta_1, eta_2 = sympy.symbols("k_1 k_2 eta_1 eta_2", real=True)
    zero = sympy.Integer(0)
    return (
        State(LAMBDA_2, speed, sympy.Symbol("lambda_2_start", real=True), LAMBDA_2.symbol),
        State(LAMBDA_2_RATE, sympy.Symbol("lambda_2_acceleration", real=True), zero, zero),
        State(SIGMA_VIS1, k_1 * d_lambda_1 * speed - k_1 / eta_1 * SIGMA_VIS1.symbol, zero, zero),
        State(SIGMA_VIS2, k_2 * d_lambda_1 * speed - k_2 / eta_2 * SIGMA_VIS2.symbol, zero, zero),
    )
