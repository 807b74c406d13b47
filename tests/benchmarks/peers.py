"""What the tube's own integrator is measured against: LSODA in Python and CVODE in C.

    python tests/benchmarks/peers.py                    # the paper's step experiment at 4 kV
    python tests/benchmarks/peers.py step_6kV           # any other folder of tests/reference
    python tests/benchmarks/peers.py prestretched_4kV   # the same step from a pre-stretched tube

Both peers solve the equations of `tests/independent.py` (no package code), piece by piece between
the protocol's corners, report lambda_2 at every sample of the trace, and are called alike,
`solve(protocol, times, rtol) -> lambda_2`, from the state `protocol["start"]` if there is one and from rest
if not:

* `solve_lsoda`: SciPy's `odeint` on a right-hand side in plain Python. It is the fastest of SciPy's
  three ways to LSODA: `ode("lsoda")` takes 1.3 times as long here, `solve_ivp` three times. A
  Jacobian in plain Python would save 5 %.
* `solve_cvode`: CVODE (BDF, dense solver, analytic Jacobian) from the SUNDIALS in FMPy's wheel,
  in C from the first piece to the last: `cvode_driver.c`, by `python -m ziglang cc -O3`.

Absolute tolerances are `rtol` times the size of each state. At an error of 1e-6 in lambda_2 neither
peer gains more than 3 % from sizes up to thirty times larger or smaller, nor CVODE from stability
detection, stop times or more frequent Jacobians instead of its defaults.
"""

from __future__ import annotations

import argparse
import ctypes
import subprocess
import sys
import tempfile
import tomllib
from collections.abc import Callable, Iterable, Sequence
from functools import cache
from math import sqrt
from pathlib import Path
from time import perf_counter

import numpy as np
from scipy.integrate import odeint

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import independent as tube

HERE = Path(__file__).resolve().parent
REFERENCE = HERE.parent / "reference"
Solve = Callable[[tube.Protocol, np.ndarray, float], np.ndarray]

SIZES = np.array([1.0, 1.0, 1e4, 1e4])  # 1, 1/s, Pa, Pa
PRESTRETCHED = "prestretched_4kV"
TOLERANCES = tuple(10.0 ** -(k / 2) for k in range(5, 19))  # rtol 3e-3 to 1e-9


def start_of(protocol: tube.Protocol) -> np.ndarray:
    """The state at the first breakpoint: "start" of the protocol, or rest."""
    return np.array(protocol.get("start", tube.AT_REST), dtype=float)


def with_slopes(piece: tube.SmoothPiece) -> tuple[float, ...]:
    """(start, stop [s], pressure [Pa], its slope [Pa/s], voltage [V], its slope [V/s]).

    As Python's own floats: a NumPy scalar among them would slow the whole right-hand side.
    """
    span = piece.stop - piece.start
    (p_0, p_1), (v_0, v_1) = piece.pressure, piece.voltage
    lines = (piece.start, piece.stop, p_0, (p_1 - p_0) / span, v_0, (v_1 - v_0) / span)
    return tuple(map(float, lines))


class Folded:
    """The parameters as the right-hand side wants them, all products taken beforehand."""

    par = tube.PARAMETERS
    ratio = par["r_o"] / par["l_o"]
    inertia = 1 / (2 * par["rho"] * par["r_o"])
    push, pull, squeeze = inertia / par["h_o"], -2 * inertia / par["l_o"], -inertia / par["r_o"]
    c_1, c_2, c_3 = 2 * par["C_1"], 4 * par["C_2"], 6 * par["C_3"]
    maxwell = par["phi"] * par["eps_o"] * par["eps_r"] / par["h_ao"] ** 2
    eta, k_1, k_2 = par["eta_o"], par["k_1"], par["k_2"]
    decay_1, decay_2 = k_1 / par["eta_1"], k_2 / par["eta_2"]


def python_rhs() -> Callable[..., tuple]:
    """The right-hand side for `odeint`, as fast as plain Python reasonably gets.

    Constants are locals of the closure, and `tolist` leaves NumPy at the door: arithmetic on
    Python's own floats is four times faster than on NumPy's scalars.
    """
    ratio, push, pull, squeeze = Folded.ratio, Folded.push, Folded.pull, Folded.squeeze
    c_1, c_2, c_3, maxwell = Folded.c_1, Folded.c_2, Folded.c_3, Folded.maxwell
    eta, k_1, k_2 = Folded.eta, Folded.k_1, Folded.k_2
    decay_1, decay_2 = Folded.decay_1, Folded.decay_2

    def rhs(t: float, x: np.ndarray, start: float, p_0: float, p_1: float, v_0: float, v_1: float) -> tuple:
        lam, rate, vis_1, vis_2 = x.tolist()
        since = t - start
        v = v_0 + v_1 * since
        u = ratio * (lam - 1)
        a, b = 1 + u * u, lam * lam
        c = 1 / (a * b)
        j = a + b + c - 3
        stiffness, field = c_1 + j * (c_2 + c_3 * j), maxwell * v * v * a * b
        lambda_1 = sqrt(a)
        rate_1 = ratio * u / lambda_1 * rate
        axial = stiffness * (a - c) - field + vis_1 + vis_2 + eta * rate_1
        return (
            rate,
            push * (p_0 + p_1 * since) * (1 + lam) * lambda_1
            + pull * axial * u / a
            + squeeze * (stiffness * (b - c) - field) / lam,
            k_1 * rate_1 - decay_1 * vis_1,
            k_2 * rate_1 - decay_2 * vis_2,
        )

    return rhs


def solve_lsoda(protocol: tube.Protocol, times: np.ndarray, rtol: float) -> np.ndarray:
    """lambda_2 [1] at the rising `times` [s] by SciPy's LSODA."""
    rhs = python_rhs()
    state, lambda_2 = start_of(protocol), []
    for piece in tube.smooth_pieces(protocol):
        start, stop, *inputs = with_slopes(piece)
        inside = times[(times > start) & (times < stop)]
        if start in times:
            lambda_2.append(state[:1])
        states, report = odeint(
            rhs,
            state,
            np.concatenate(([start], inside, [stop])),
            args=(start, *inputs),
            tfirst=True,
            rtol=rtol,
            atol=rtol * SIZES,
            mxstep=1_000_000,
            full_output=True,
        )
        if report["message"] != "Integration successful.":
            raise RuntimeError(f"LSODA stopped in {start:g}..{stop:g} s: {report['message']}")
        lambda_2.append(states[1:-1, 0])
        state = states[-1]
    if times[-1] == stop:
        lambda_2.append(state[:1])
    return np.concatenate(lambda_2)


def load_sundials() -> None:
    """Make FMPy's SUNDIALS libraries visible to libraries loaded after them."""
    import fmpy

    folder = Path(fmpy.__file__).parent / "sundials" / fmpy.platform_tuple
    if not sys.platform.startswith("linux") or not folder.is_dir():
        raise RuntimeError(f"Expected FMPy's SUNDIALS for Linux for the CVODE peer but this is {fmpy.platform_tuple}.")
    for part in ("core", "nvecserial", "sunmatrixdense", "sunlinsoldense", "cvode"):
        ctypes.CDLL(str(folder / f"sundials_{part}.so"), mode=ctypes.RTLD_GLOBAL)


@cache
def cvode_library() -> ctypes.CDLL:
    """cvode_driver.c, compiled with the parameters as constants and loaded beside SUNDIALS."""
    load_sundials()
    constants = [f"-DPAR_{name}={float(value)!r}" for name, value in tube.PARAMETERS.items()]
    with tempfile.TemporaryDirectory() as folder:
        library = Path(folder) / "cvode_driver.so"
        command = [sys.executable, "-m", "ziglang", "cc", "-O3", "-shared", "-fPIC", *constants]
        command += [str(HERE / "cvode_driver.c"), "-o", str(library)]
        compiled = subprocess.run(command, capture_output=True, text=True, check=False)
        if compiled.returncode != 0:
            raise RuntimeError(f"The CVODE driver did not compile:\n{compiled.stderr}")
        driver = ctypes.CDLL(str(library))
    address, number, count = ctypes.c_void_p, ctypes.c_double, ctypes.c_int
    driver.tube_rhs.argtypes = driver.tube_jacobian.argtypes = [address, number, number, address]
    driver.tube_rhs.restype = driver.tube_jacobian.restype = None
    driver.tube_solve.argtypes = [address, count, address, address, count, number, address, address]
    return driver


def solve_cvode(protocol: tube.Protocol, times: np.ndarray, rtol: float) -> np.ndarray:
    """lambda_2 [1] at the rising `times` [s] by CVODE in C."""
    pieces = np.array([with_slopes(piece) for piece in tube.smooth_pieces(protocol)])
    start, atol, lambda_2 = start_of(protocol), rtol * SIZES, np.empty(times.size)
    flag = cvode_library().tube_solve(
        pieces.ctypes.data,
        len(pieces),
        start.ctypes.data,
        times.ctypes.data,
        times.size,
        rtol,
        atol.ctypes.data,
        lambda_2.ctypes.data,
    )
    if flag != 0:
        raise RuntimeError(f"CVODE stopped with its flag {flag} at rtol {rtol:g}.")
    return lambda_2


PEERS: dict[str, Solve] = {"SciPy LSODA": solve_lsoda, "CVODE in C": solve_cvode}


def best_seconds(run: Callable[[], object], repeats: int = 9) -> float:
    """The shortest of `repeats` runs [s], after one that is not counted."""
    run()
    seconds = []
    for _ in range(repeats):
        begin = perf_counter()
        run()
        seconds.append(perf_counter() - begin)
    return min(seconds)


def work_precision(
    solve: Solve,
    protocol: tube.Protocol,
    times: np.ndarray,
    reference: np.ndarray,
    tolerances: Iterable[float] = TOLERANCES,
) -> list[tuple[float, float]]:
    """(largest |lambda_2 - reference|, seconds) of `solve`, one pair for each tolerance."""
    points = []
    for rtol in tolerances:
        error = float(np.abs(solve(protocol, times, rtol) - reference).max())
        points.append((error, best_seconds(lambda rtol=rtol: solve(protocol, times, rtol))))
    return points


def seconds_at_error(points: Sequence[tuple[float, float]], error: float) -> float:
    """Seconds a solver needs for `error`, on straight lines between `points` in logarithms.

    A point that another beats in both error and time is left out: nobody would choose it. A solver whose fastest
    run is already better than `error` needs the time of that run.
    """
    best: list[tuple[float, float]] = []
    for candidate in sorted(points):
        if not best or candidate[1] < best[-1][1]:
            best.append(candidate)
    errors, seconds = np.log(best).T
    if np.log(error) < errors[0]:
        raise ValueError(f"Expected an error of at least {best[0][0]:.1e} but was given {error:g}.")
    return float(np.exp(np.interp(np.log(error), errors, seconds)))


def prestretched() -> tuple[tube.Protocol, np.ndarray]:
    """The paper's step experiment: settled under 95 mmHg, then 4 kV for 10 s; 15 s in all."""
    pressure = 95 * 133.322
    lambda_2 = tube.equilibrium_radius(pressure, 0.0) / tube.PARAMETERS["r_o"]
    protocol = {
        "time": [0.0, 1.0, 1.0, 11.0, 11.0, 15.0],
        "pressure": [pressure] * 6,
        "voltage": [0.0, 0.0, 4e3, 4e3, 0.0, 0.0],
        "start": (lambda_2, 0.0, 0.0, 0.0),
    }
    return protocol, np.arange(1501) * 0.01


def experiment(name: str) -> tuple[tube.Protocol, np.ndarray]:
    """(protocol, sample times [s]) of one folder of tests/reference, or of the pre-stretched step."""
    if name == PRESTRETCHED:
        return prestretched()
    folder = REFERENCE / name
    if not folder.is_dir():
        known = ", ".join([PRESTRETCHED, *sorted(path.name for path in REFERENCE.iterdir())])
        raise ValueError(f"Expected one of {known} but was given {name}.")
    case = tomllib.loads((folder / "case.toml").read_text(encoding="utf-8"))
    count = round(case["stop"] / case["interval"]) + 1
    return case["inputs"], np.arange(count) * case["interval"]


def main() -> None:
    """Print each peer's work and precision on one experiment, and its time at an error of 1e-6."""
    parser = argparse.ArgumentParser(description="Work and precision of LSODA and CVODE.")
    parser.add_argument("case", nargs="?", default="step_4kV", help=f"a folder of tests/reference, or {PRESTRETCHED}")
    try:
        protocol, times = experiment(parser.parse_args().case)
    except ValueError as problem:
        parser.error(str(problem))
    reference = tube.trajectory(protocol, times, x0=start_of(protocol))["lambda_2"]
    print(f"{'':14}{'rtol':>10}{'error':>10}{'ms':>10}")
    for name, solve in PEERS.items():
        points = work_precision(solve, protocol, times, reference)
        for rtol, (error, seconds) in zip(TOLERANCES, points, strict=True):
            print(f"{name:14}{rtol:10.1e}{error:10.1e}{seconds * 1e3:10.3f}")
        print(f"{name:14}{'':10}{1e-6:10.1e}{seconds_at_error(points, 1e-6) * 1e3:10.3f}  <-")


if __name__ == "__main__":
    main()
