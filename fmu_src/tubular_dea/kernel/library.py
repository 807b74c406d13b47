"""The compiled libraries of a model, and how they are loaded: the only place that does."""

from __future__ import annotations

import ctypes
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from ..emit import sensitivities
from ..export.compile import native_source, processor_flags
from ..export.package import KERNEL_SOURCES, core_sources
from ..export.remembered import remembered_library
from ..model.declare import Model
from .checks import KernelError

BATCH_SOURCES = ("kernel.h", "batch.c", "batch.h", "lanes.c", "lanes.h")
TANGENT_SOURCES = ("tangent.c", "tangent.h")
TOGETHER = {  # files that are compiled as one: for every file the compiler starts and reads the headers anew
    "trajectories.c": ("rosenbrock.c", "pieces.c", "model.c", "equilibrium.c", "start.c", "kernel.c"),
    "tangents.c": ("tangent.c", "gradients.c"),
}


def trajectory_library(model: Model) -> ctypes.CDLL:
    """Trajectories of `model` alone: the same code as in `kernel_library`, in half of the time to compile that."""
    kind = "trajectories"
    return load(
        remembered_library(model, kind, lambda: _together(core_sources(model, *KERNEL_SOURCES)), processor_flags())
    )


def kernel_library(model: Model, observed: tuple[str, ...]) -> ctypes.CDLL:
    """Trajectories of `model`, and their sensitivities, those of the outputs `observed` among them."""

    def sources() -> Mapping[str, str]:
        gradients = {
            "gradients.h": sensitivities.header(model, observed),
            "gradients.c": sensitivities.source(model, observed),
        }
        tangents = {name: native_source(name) for name in TANGENT_SOURCES}
        return _together(core_sources(model, *KERNEL_SOURCES) | tangents | gradients)

    return load(remembered_library(model, f"kernel of {observed}", sources, processor_flags()))


def batch_library(model: Model) -> ctypes.CDLL:
    """Many rows of `model` at once."""
    kind = "batch"
    return load(remembered_library(model, kind, lambda: core_sources(model, *BATCH_SOURCES), processor_flags()))


def _together(sources: Mapping[str, str]) -> dict[str, str]:
    """The same sources with those files in one that are compiled as one."""
    units = {unit: [part for part in parts if part in sources] for unit, parts in TOGETHER.items()}
    joined = {unit: "".join(f'#include "{part}.h"\n' for part in parts) for unit, parts in units.items() if parts}
    inside = {part for parts in units.values() for part in parts}
    return {f"{name}.h" if name in inside else name: text for name, text in sources.items()} | joined


def load(path: Path) -> ctypes.CDLL:
    """A compiled library; `KernelError` where it cannot be loaded (a cache on a disk mounted without execution)."""
    try:
        return ctypes.CDLL(str(path))
    except OSError as problem:
        raise KernelError(f"{problem}; set TUBULAR_DEA_CACHE to a folder from which programs may run") from None


def pointer(array: np.ndarray) -> ctypes.c_void_p:
    """The address of a contiguous array, as a C function takes it, with the array that it keeps alive.

    As `array.ctypes.data_as` makes it, in half of its time, which is a tenth of that of a short trajectory.
    """
    address = ctypes.c_void_p(array.ctypes.data)
    address.array = array  # type: ignore[attr-defined]
    return address
