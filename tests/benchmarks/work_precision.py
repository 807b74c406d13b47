"""Time for a trajectory at equal error: our kernel against SciPy's LSODA and compiled CVODE, in one run.

    python tests/benchmarks/work_precision.py                both step experiments and both ramps
    python tests/benchmarks/work_precision.py step_4kV       one of them

Each solver is timed over a range of tolerances and read off at an error of 1e-6 in lambda_2 (largest over all
samples, 10 ms apart, against SciPy's Radau at 1e-10). `prestretched_4kV` is the paper's step experiment: settled
under 95 mmHg, 4 kV for 10 s, 15 s in all; `step_4kV` also ramps the pressure up from rest, where the tube rings
undamped at 387 Hz. LSODA stands there twice: SciPy's `odeint` on a
right-hand side folded by hand until plain Python gets no faster, and `solve_ivp` on the equations as the paper has
them (the Python this project emits), which is how most people call it. CVODE has the analytic Jacobian, compiled: once
in a C program without a call into Python between the first piece and the last, once as casadi runs it.
"""

from __future__ import annotations

import argparse
import ctypes
import functools

import numpy as np
from scipy.integrate import solve_ivp

import peers
from casadi_peer import solve_casadi
from tubular_dea.emit.python import compile_python
from tubular_dea.kernel import MOST_STEPS, NO_LIMIT, Kernel
from tubular_dea.model.dea import tubular_dea

CASES = (peers.PRESTRETCHED, "step_4kV", "ramp_4kV", "ramp_7kV_snap_through")
ERROR = 1e-6  # of lambda_2
TOLERANCES = (1e-2, *peers.TOLERANCES[:-3])


@functools.cache
def kernel() -> Kernel:
    """The compiled model."""
    return Kernel(tubular_dea())


@functools.cache
def prepared(name: str) -> tuple:
    """The arguments of the kernel's C function that do not change from call to call, and the states it fills."""
    protocol, times = peers.experiment(name)
    points = np.array(protocol["time"], float)
    u = np.column_stack([protocol["pressure"], protocol["voltage"]]).astype(float)
    p = kernel().parameters({"start_at_equilibrium": float("start" in protocol)})
    x = np.empty((times.size, 4))
    return tuple(np.ctypeslib.as_ctypes(a.ravel()) for a in (p, points, u, times)), x, (p, points, u, times)


def solve_kernel(name: str, rtol: float) -> np.ndarray:
    """lambda_2 of experiment `name` from one call of the compiled kernel."""
    (p, points, u, times), x, _ = prepared(name)
    failed = kernel()._library.kernel_trajectory(
        p,
        ctypes.c_long(len(points)),
        points,
        u,
        ctypes.c_double(rtol),
        ctypes.c_long(MOST_STEPS),
        ctypes.c_long(NO_LIMIT),
        ctypes.c_long(len(times)),
        times,
        0,
        x.ctypes.data_as(ctypes.c_void_p),
        None,
        ctypes.c_long(0),
        None,
        (ctypes.c_long * 2)(),
        ctypes.byref(ctypes.c_double()),
    )
    assert not failed
    return x[:, 0]


def solve_lsoda_ivp(protocol: peers.tube.Protocol, times: np.ndarray, rtol: float) -> np.ndarray:
    """lambda_2 by `solve_ivp(method="LSODA")`, piece by piece, on the equations as they are emitted in Python."""
    derivatives = compile_python(kernel().model).derivatives
    p = list(kernel().parameters())
    state, out = peers.start_of(protocol), np.full(times.size, np.nan)
    for piece in peers.tube.smooth_pieces(protocol):
        start, stop, p_0, p_1, v_0, v_1 = peers.with_slopes(piece)

        def rhs(t: float, x: np.ndarray, a: tuple = (start, p_0, p_1, v_0, v_1)) -> list[float]:
            since = t - a[0]
            u = (a[1] + a[2] * since, a[3] + a[4] * since)
            return derivatives(t, x.tolist(), u, (a[2], a[4]), p, (0.0,))

        inside = (times > start) & (times < stop)
        out[times == start] = state[0]
        grid = np.concatenate([times[inside], [stop]])
        found = solve_ivp(rhs, (start, stop), state, "LSODA", grid, rtol=rtol, atol=rtol * peers.SIZES)
        out[inside] = found.y[0, :-1]
        state = found.y[:, -1]
    out[times == stop] = state[0]
    return out


def main() -> None:
    """Print milliseconds at the error and ratios, one line a case."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("cases", nargs="*", default=CASES)
    cases = parser.parse_args().cases
    print(f"microseconds at an error of {ERROR:g} in lambda_2, and ratios to this project's kernel")
    columns = ("CVODE, C host", "CVODES, casadi", "LSODA, odeint", "LSODA, solve_ivp")
    print(f"{'':22}{'kernel':>9}{''.join(f'{column:>20}' for column in columns)}")
    for name in cases:
        protocol, times = peers.experiment(name)
        reference = peers.tube.trajectory(protocol, times, x0=peers.start_of(protocol))["lambda_2"]
        mine = lambda _protocol, _times, rtol, name=name: solve_kernel(name, rtol)  # noqa: E731
        solvers = (mine, peers.solve_cvode, solve_casadi, peers.solve_lsoda, solve_lsoda_ivp)
        seconds = [
            peers.seconds_at_error(peers.work_precision(solve, protocol, times, reference, TOLERANCES), ERROR)
            for solve in solvers
        ]
        ours, *others = (1e6 * s for s in seconds)
        row = "".join(f"{other:11.0f} ({other / ours:6.1f}x)" for other in others)
        print(f"{name:22}{ours:9.1f}{row}")


if __name__ == "__main__":
    main()
