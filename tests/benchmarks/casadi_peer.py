"""CVODES as casadi offers it: right-hand side and exact Jacobian generated and compiled, one call a smooth piece.

The equations are those of tests/independent.py, which casadi traces; it compiles into a temporary folder.
"""

from __future__ import annotations

import contextlib
import functools
import sys
import tempfile

import casadi
import numpy as np

import peers

FOLDER = tempfile.TemporaryDirectory()
COMPILER = {"compiler": f"{sys.executable} -m ziglang cc", "flags": ["-O3"], "cleanup": False}
COMPILED = {"jit": True, "compiler": "shell", "jit_cleanup": False, "jit_options": COMPILER}


@functools.cache
def integrator(start: float, samples: tuple[float, ...], rtol: float) -> casadi.Function:
    """From `start` [s] to each of `samples` [s]; parameters are (start, pressure, its slope, voltage, its slope)."""
    x, p, t = casadi.SX.sym("x", 4), casadi.SX.sym("p", 5), casadi.SX.sym("t")
    since = t - p[0]
    ode = casadi.vertcat(*peers.tube.rhs(t, [x[i] for i in range(4)], p[1] + p[2] * since, p[3] + p[4] * since))
    options = COMPILED | {"reltol": rtol, "abstol": rtol, "max_num_steps": 1_000_000}
    with contextlib.chdir(FOLDER.name):
        return casadi.integrator("F", "cvodes", {"x": x, "p": p, "t": t, "ode": ode}, start, samples, options)


def solve_casadi(protocol: peers.tube.Protocol, times: np.ndarray, rtol: float) -> np.ndarray:
    """lambda_2 [1] at the rising `times` [s], which must hold every breakpoint."""
    state, out = peers.start_of(protocol), [peers.start_of(protocol)[:1]]
    for piece in peers.tube.smooth_pieces(protocol):
        start, stop, *inputs = peers.with_slopes(piece)
        inside = times[(times > start) & (times <= stop)]
        found = integrator(start, tuple(inside), rtol)(x0=state, p=[start, *inputs])["xf"].full()
        out.append(found[0])
        state = found[:, -1]
    return np.concatenate(out)
