"""The only interface to compiled code: the emitted C, compiled for this machine and called from Python.

The integrator, the equations and the starting rules are the same sources as in the FMUs; whole trajectories,
their sensitivities and many rows at once take one call each.
"""

from .checks import KernelError
from .tangents import SensitivityError
from .trajectories import DEFAULT_TOLERANCE, MOST_STEPS, NO_LIMIT, Driven, Kernel, Trajectory

__all__ = [
    "DEFAULT_TOLERANCE",
    "MOST_STEPS",
    "NO_LIMIT",
    "Driven",
    "Kernel",
    "KernelError",
    "SensitivityError",
    "Trajectory",
]
