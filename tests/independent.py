"""The paper's tube written a second time, by hand: what every other implementation is held against.

Nothing here comes from the package, and nothing here is generated. The paper sums forces (eq. 16);
this file divides that sum by the wall volume of one half tube, V = 2 pi r_o h_o l_o, and works with
the slope u = (R - r_o) / l_o and the squares of the stretches, so that a slip in the one derivation
is not repeated in the other:

    lambda_1 = sqrt(1 + u^2)          sin(theta) = u / lambda_1        (3), (4) corrected
    d lambda_1 / d lambda_2 = (r_o / l_o) u / lambda_1
    h l = h_o l_o / lambda_2                                           (1): the hoop area A_2

    2 rho r_o lambda_2'' = p (1 + lambda_2) lambda_1 / h_o
                           - 2 sigma_axial sin(theta) / (l_o lambda_1)
                           - sigma_hoop / (r_o lambda_2)

All quantities are SI. Source: Liu et al., "Control-oriented modeling and analysis of tubular
dielectric elastomer actuators dedicated to cardiac assist devices", eqs. (1)-(18), Tables I, III.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import pi

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

PARAMETERS: dict[str, float] = {
    # Table I: geometry and constants of nature
    "l_o": 24.5e-3,  # m, half length
    "r_o": 15e-3,  # m, radius at rest
    "h_o": 1e-3,  # m, wall
    "h_ao": 100e-6,  # m, one active layer
    "rho": 1e3,  # kg/m^3
    "eps_o": 8.854e-12,  # F/m
    # Table III: identified by the authors
    "C_1": 333.056e3,  # Pa
    "C_2": -32.5032e3,  # Pa
    "C_3": 2.86041e3,  # Pa
    "eps_r": 2.8,
    "eta_o": 745.854e3,  # Pa s
    "k_1": 19.6758e6,  # Pa
    "eta_1": 6495.68e3,  # Pa s
    "k_2": 2.414e6,  # Pa
    "eta_2": 6508.21e3,  # Pa s
    # The design's two additions: active share of the wall in the Maxwell term, layers in parallel
    "phi": 1.0,
    "n_layers": 8.0,
}

Parameters = Mapping[str, float]
Protocol = Mapping[str, Sequence[float]]

AT_REST = (1.0, 0.0, 0.0, 0.0)
RTOL = 1e-10
ATOL = (1e-12, 1e-9, 1e-5, 1e-5)  # 1, 1/s, Pa, Pa: each about 1e-10 of what the state reaches


def slope(lambda_2: float, par: Parameters) -> float:
    """u = (R - r_o) / l_o [1], the tangent of theta: Fig. 4."""
    return (lambda_2 - 1) * par["r_o"] / par["l_o"]


def elastic_stresses(lambda_2: float, voltage: float, par: Parameters) -> tuple[float, float]:
    """(sigma_m, sigma_hoop) [Pa] of eqs. (8) and (14).

    With a = lambda_1^2, b = lambda_2^2 the invariant is I_1 = a + b + 1/(a b), and
    lambda_i dW/dlambda_i = 2 a_i dW/da_i = 2 W'(I_1) (a_i - 1/(a b)).
    """
    a = 1 + slope(lambda_2, par) ** 2
    b = lambda_2**2
    c = 1 / (a * b)  # lambda_3^2
    j = a + b + c - 3
    stiffness = 2 * (par["C_1"] + j * (2 * par["C_2"] + 3 * par["C_3"] * j))
    field_squared = voltage**2 / (par["h_ao"] ** 2 * c)
    maxwell = par["phi"] * par["eps_o"] * par["eps_r"] * field_squared
    return stiffness * (a - c) - maxwell, stiffness * (b - c) - maxwell


def rhs(t: float, x: Sequence[float], pressure: float, voltage: float, par: Parameters = PARAMETERS) -> list[float]:
    """dx/dt of x = (lambda_2, lambda_2_rate, sigma_vis1, sigma_vis2); pressure [Pa], voltage [V].

    Eq. (18), arranged as in the head of this file. Only arithmetic, so complex x is allowed.
    `t` [s] is there for the integrators and not used: the tube has no clock.
    """
    lambda_2, rate, branch_1, branch_2 = x
    u = slope(lambda_2, par)
    lambda_1 = (1 + u * u) ** 0.5
    sine = u / lambda_1
    lambda_1_rate = par["r_o"] / par["l_o"] * sine * rate

    sigma_m, sigma_hoop = elastic_stresses(lambda_2, voltage, par)
    axial = sigma_m + branch_1 + branch_2 + par["eta_o"] * lambda_1_rate
    push = pressure * (1 + lambda_2) * lambda_1 / par["h_o"]
    pull = 2 * axial * sine / (par["l_o"] * lambda_1) + sigma_hoop / (par["r_o"] * lambda_2)
    return [
        rate,
        (push - pull) / (2 * par["rho"] * par["r_o"]),
        par["k_1"] * (lambda_1_rate - branch_1 / par["eta_1"]),
        par["k_2"] * (lambda_1_rate - branch_2 / par["eta_2"]),
    ]


def rhs_printed_angle(
    t: float, x: Sequence[float], pressure: float, voltage: float, par: Parameters = PARAMETERS
) -> list[float]:
    """As `rhs`, with the denominator of eq. (4) as printed: sqrt(l_o^2 + (lambda_2 - 1) r_o^2)."""
    lambda_2, rate, branch_1, branch_2 = x
    u = slope(lambda_2, par)
    lambda_1 = (1 + u * u) ** 0.5
    sine = u / lambda_1
    printed_sine = u / (1 + (lambda_2 - 1) * (par["r_o"] / par["l_o"]) ** 2) ** 0.5

    result = rhs(t, x, pressure, voltage, par)
    sigma_m, _ = elastic_stresses(lambda_2, voltage, par)
    axial = sigma_m + branch_1 + branch_2 + par["eta_o"] * par["r_o"] / par["l_o"] * sine * rate
    lever = axial / (par["l_o"] * lambda_1 * par["rho"] * par["r_o"])
    result[1] -= lever * (printed_sine - sine)
    return result


def jacobian(
    x: Sequence[float], pressure: float, voltage: float, par: Parameters = PARAMETERS, right_side: Callable = rhs
) -> np.ndarray:
    """d rhs / d x by complex steps: exact to rounding, and no second derivation to get wrong."""
    step = 1e-30
    columns = []
    for i in range(4):
        shifted = [complex(value) for value in x]
        shifted[i] += step * 1j
        image = right_side(0.0, shifted, pressure, voltage, par)
        columns.append([complex(value).imag / step for value in image])
    return np.array(columns).T


def mass(par: Parameters = PARAMETERS) -> float:
    """m [kg] of eq. (16): density times the wall of both halves."""
    return par["rho"] * 2 * pi * par["r_o"] * par["h_o"] * 2 * par["l_o"]


def capacitance(lambda_2: float, par: Parameters = PARAMETERS) -> float:
    """C [F] of n_layers plates in parallel, each lambda_1 lambda_2 times as wide and as thin."""
    area = 2 * pi * par["r_o"] * 2 * par["l_o"]
    stretch_squared = (1 + slope(lambda_2, par) ** 2) * lambda_2**2
    layers = par["n_layers"] * par["eps_o"] * par["eps_r"]
    return layers * area * stretch_squared / par["h_ao"]


def inner_surface(radius: np.ndarray, par: Parameters = PARAMETERS) -> np.ndarray:
    """A_3 = 2 pi (r_o + R) l [m^2] at radius R [m], eq. (16)."""
    return 2 * pi * (par["r_o"] + radius) * np.hypot(par["l_o"], radius - par["r_o"])


def tube_volume(radius: np.ndarray, par: Parameters = PARAMETERS) -> np.ndarray:
    """Cylinder at rest plus the integral of A_3 dR [m^3], by Gauss-Legendre on 40 nodes.

    The integrand is analytic, so 40 nodes are exact to rounding up to lambda_2 = 4.
    """
    node, weight = np.polynomial.legendre.leggauss(40)
    half = (np.atleast_1d(radius) - par["r_o"])[:, None] / 2
    added = (inner_surface(par["r_o"] + half * (1 + node), par) * weight * half).sum(axis=1)
    return 2 * pi * par["r_o"] ** 2 * par["l_o"] + added


def static_pressure(lambda_2: float, voltage: float, par: Parameters = PARAMETERS) -> float:
    """The pressure [Pa] that holds the rested tube at lambda_2 under `voltage` [V]."""
    u = slope(lambda_2, par)
    a = 1 + u * u
    sigma_m, sigma_hoop = elastic_stresses(lambda_2, voltage, par)
    pull = 2 * sigma_m * u / (par["l_o"] * a) + sigma_hoop / (par["r_o"] * lambda_2)
    return par["h_o"] * pull / ((1 + lambda_2) * a**0.5)


def static_stiffness(lambda_2: float, voltage: float, par: Parameters = PARAMETERS) -> float:
    """d p / d lambda_2 [Pa] of `static_pressure` at constant voltage, by a complex step."""
    return complex(static_pressure(lambda_2 + 1e-30j, voltage, par)).imag / 1e-30


def fold_stretch(voltage: float, par: Parameters = PARAMETERS) -> float:
    """lambda_2 of the first maximum of p(lambda_2) above lambda_2 = 1 at constant voltage [V]."""
    grid = np.linspace(1.0, 3.0, 401)
    for low, high in pairwise(grid):
        if static_stiffness(low, voltage, par) > 0 >= static_stiffness(high, voltage, par):
            return brentq(static_stiffness, low, high, args=(voltage, par), xtol=1e-14)
    raise ValueError(f"The tube has no fold between lambda_2 = 1 and 3 at {voltage:g} V.")


def fold(voltage: float, par: Parameters = PARAMETERS) -> tuple[float, float]:
    """(radius [m], pressure [Pa]) where the tube snaps through at constant voltage [V]."""
    lambda_2 = fold_stretch(voltage, par)
    return par["r_o"] * lambda_2, static_pressure(lambda_2, voltage, par)


def equilibrium_radius(pressure: float, voltage: float, par: Parameters = PARAMETERS) -> float:
    """R [m] at rest under `pressure` [Pa] and `voltage` [V], on the branch below the fold."""
    top = fold_stretch(voltage, par)
    limit = static_pressure(top, voltage, par)
    if pressure > limit:
        raise ValueError(
            f"Expected a pressure below the fold at {voltage:g} V, {limit:g} Pa, but was given {pressure:g} Pa."
        )

    def imbalance(lambda_2: float) -> float:
        return static_pressure(lambda_2, voltage, par) - pressure

    return par["r_o"] * brentq(imbalance, 0.7, top, xtol=1e-15)


def eigenvalues(pressure: float, voltage: float, par: Parameters = PARAMETERS) -> np.ndarray:
    """The four eigenvalues [1/s] at the equilibrium below the fold, by ascending real part."""
    lambda_2 = equilibrium_radius(pressure, voltage, par) / par["r_o"]
    values = np.linalg.eigvals(jacobian((lambda_2, 0.0, 0.0, 0.0), pressure, voltage, par))
    return values[np.argsort(values.real)]


@dataclass(frozen=True)
class SmoothPiece:
    """A stretch of protocol without a corner inside: both inputs are straight lines in time [s]."""

    start: float
    stop: float
    pressure: tuple[float, float]  # Pa at start and stop
    voltage: tuple[float, float]  # V at start and stop

    def inputs(self, t: float) -> tuple[float, float]:
        """(pressure [Pa], voltage [V]) at time t, also a little outside the piece."""
        share = (t - self.start) / (self.stop - self.start)
        (p_0, p_1), (v_0, v_1) = self.pressure, self.voltage
        return p_0 + share * (p_1 - p_0), v_0 + share * (v_1 - v_0)


def smooth_pieces(protocol: Protocol) -> list[SmoothPiece]:
    """The protocol cut at its breakpoints. A time listed twice is a jump and makes no piece."""
    columns = [protocol[name] for name in ("time", "pressure", "voltage")]
    pieces = []
    for (start, p_0, v_0), (stop, p_1, v_1) in pairwise(zip(*columns, strict=True)):
        if stop < start:
            raise ValueError(f"Expected rising breakpoints but {stop:g} s follows {start:g} s.")
        if stop > start:
            pieces.append(SmoothPiece(start, stop, (p_0, p_1), (v_0, v_1)))
    return pieces


def solve_piece(
    piece: SmoothPiece, times: np.ndarray, state: np.ndarray, par: Parameters, right_side: Callable
) -> tuple[np.ndarray, np.ndarray]:
    """(states at `times`, state at the end) from `state` at the start of `piece`, by Radau."""
    solution = solve_ivp(
        lambda t, x: right_side(t, x, *piece.inputs(t), par),
        (piece.start, piece.stop),
        state,
        method="Radau",
        t_eval=np.append(times[times < piece.stop], piece.stop),
        jac=lambda t, x: jacobian(x, *piece.inputs(t), par, right_side),
        rtol=RTOL,
        atol=ATOL,
    )
    if not solution.success:
        raise RuntimeError(f"Radau stopped in {piece.start:g}..{piece.stop:g} s: {solution.message}")
    return solution.y.T[: times.size], solution.y[:, -1]


def sampled_states(
    protocol: Protocol, times: np.ndarray, par: Parameters, x0: Sequence[float], right_side: Callable
) -> tuple[np.ndarray, np.ndarray]:
    """(states, voltages [V]) at `times` [s].

    A sample at a breakpoint belongs to the piece after it, so inputs have their value after a jump;
    the last piece also owns its end.
    """
    pieces = smooth_pieces(protocol)
    first, last = pieces[0].start, pieces[-1].stop
    if times.size == 0 or times[0] < first or times[-1] > last or np.any(np.diff(times) <= 0):
        raise ValueError(f"Expected rising sample times within {first:g} s to {last:g} s.")
    state = np.array(x0, dtype=float)
    states, voltages = [], []
    for piece in pieces:
        here = times[(times >= piece.start) & ((times < piece.stop) | (piece.stop == last))]
        sampled, state = solve_piece(piece, here, state, par, right_side)
        states.append(sampled)
        voltages.append(piece.inputs(here)[1])
    if times[-1] == last:
        voltages[-1][-1] = protocol["voltage"][-1]  # the protocol may end in a jump
    return np.concatenate(states), np.concatenate(voltages)


def trajectory(
    protocol: Protocol,
    times: Sequence[float],
    par: Parameters | None = None,
    x0: Sequence[float] = AT_REST,
    right_side: Callable = rhs,
) -> dict[str, np.ndarray]:
    """What the tube does under `protocol`, at `times` [s]; at a jump, the value after it.

    `protocol` maps "time" [s], "pressure" [Pa] and "voltage" [V] to breakpoints of equal number,
    linear in between; a time listed twice is a jump.
    """
    par = PARAMETERS if par is None else par
    x, voltage = sampled_states(protocol, np.asarray(times, float), par, x0, right_side)
    lambda_2, rate = x[:, 0], x[:, 1]
    radius = par["r_o"] * lambda_2
    lambda_1 = np.sqrt(1 + slope(lambda_2, par) ** 2)
    farad = capacitance(lambda_2, par)
    return {
        "radius": radius,
        "lambda_2": lambda_2,
        "lambda_2_rate": rate,
        "sigma_vis1": x[:, 2],
        "sigma_vis2": x[:, 3],
        "electric_field": voltage * lambda_1 * lambda_2 / par["h_ao"],
        "tube_volume": tube_volume(radius, par),
        "tube_flow": inner_surface(radius, par) * par["r_o"] * rate,
        "capacitance": farad,
        "charge": farad * voltage,
    }
