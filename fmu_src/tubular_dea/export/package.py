"""FMUs from models: sources, libraries, descriptions and documentation in one reproducible archive."""

from __future__ import annotations

import io
import zipfile
from collections.abc import Callable, Iterable
from importlib import resources
from pathlib import Path

import fmpy

from ..emit import c, model_description, rodas5p, tables, to_c
from ..files import write_atomically
from ..model.declare import Model
from .compile import Platform, host, native_source, shared_library, universal

CORE_SOURCES = (
    "rosenbrock.c",
    "rosenbrock.h",
    "attempt.h",
    "method.h",
    "equilibrium.c",
    "equilibrium.h",
    "start.c",
    "start.h",
    "variable.h",
    "powers.h",
)
FMU_SOURCES = (
    "instance.c",
    "instance.h",
    "exchange.c",
    "exchange.h",
    "delay.c",
    "delay.h",
    "values.c",
    "step.c",
    "saved_state.c",
    "sensitivity.c",
)
KERNEL_SOURCES = ("kernel.c", "kernel.h", "pieces.c", "pieces.h")  # what whole trajectories need besides
MASTER_SOURCES = (
    "master.c",
    "master.h",
    "master_state.h",
    "master_tables.c",
    "master_slaves.c",
    "master_steps.c",
    "master_loop.c",
    "master_watch.c",
)  # of a coupled run
FMI_HEADERS = {
    2: ("fmi2Functions.h", "fmi2FunctionTypes.h", "fmi2TypesPlatform.h"),
    3: ("fmi3Functions.h", "fmi3FunctionTypes.h", "fmi3PlatformTypes.h"),
}

Progress = Callable[[str], None]


def sources(model: Model, version: int) -> dict[str, str]:
    """All C files of the FMU: the emitted model, the integrator, the FMI interface and its headers."""
    headers = Path(fmpy.__file__).parent / "c-code"
    files = core_sources(model, *FMU_SOURCES, f"fmi{version}.c")
    files |= {name: (headers / name).read_text(encoding="utf-8") for name in FMI_HEADERS[version]}
    return files


def core_sources(model: Model, *native: str) -> dict[str, str]:
    """What every library of `model` is compiled from: the emitted C, the integrator, and the `native` files named."""
    directional = "sensitivity.c" in native  # the only file that calls `model_tangent`, half of the printing
    files = {
        "model.c": c.source(model, directional),
        "model.h": c.header(model, directional),
        "rodas5p.h": rodas5p.header(),
        "step_control.h": to_c.step_control_header(),
    }
    return files | {name: native_source(name) for name in (*CORE_SOURCES, *native)}


def one_unit(files: dict[str, str]) -> dict[str, str]:
    """The same C files as one unit for the compiler, which takes half as long as file by file.

    The integrator's equations are in the model's header, which is read once.
    """
    parts = {f"{name}.h" if name.endswith(".c") else name: text for name, text in files.items()}
    unit = "".join(f'#include "{name}.h"\n' for name in sorted(files) if name.endswith(".c"))
    return parts | {"unit.c": f"#define MODEL_SOLVER\n{unit}"}


def native_fmu(
    model: Model,
    version: int,
    path: Path,
    platforms: Iterable[Platform] | None = None,
    progress: Progress = lambda what: None,
) -> Path:
    """Write the native FMU of `model` for FMI `version` (2 or 3) with libraries for `platforms` (this machine).

    `progress` receives each platform's name once its library is built. The same model and platforms give the
    same bytes on every machine.
    """
    code = sources(model, version)
    compiled = tuple(sorted(name for name in code if name.endswith(".c")))
    files: dict[str, bytes] = {f"sources/{name}": text.encode() for name, text in code.items()}
    files |= _descriptions(model, version, compiled) | _documentation(model, version)
    libraries: dict[str, bytes] = {}
    for target in [host()] if platforms is None else platforms:
        libraries[target.name] = shared_library(one_unit(code), target)
        folder = target.fmi2 if version == 2 else target.fmi3
        files[f"binaries/{folder}/{model.name}{target.suffix}"] = libraries[target.name]
        progress(target.name)
    if version == 2:
        files |= _darwin64(model, libraries)
    return write_atomically(path, archive(files))


def archive(files: dict[str, bytes]) -> bytes:
    """A zip of `files` in sorted order without clock or permissions of this machine: the same bytes anywhere."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as bundle:
        for name in sorted(files):
            entry = zipfile.ZipInfo(name, date_time=(1980, 1, 1, 0, 0, 0))
            entry.compress_type = zipfile.ZIP_DEFLATED
            entry.create_system = 3
            entry.external_attr = 0o644 << 16
            bundle.writestr(entry, files[name])
    return buffer.getvalue()


def icon() -> bytes:
    """The icon of the models (PNG)."""
    return (resources.files("tubular_dea") / "export" / "icon.png").read_bytes()


def licence() -> bytes:
    """The licence of this package, and of the FMI headers among the sources."""
    return (resources.files("tubular_dea") / "export" / "licence.txt").read_bytes()


def _descriptions(model: Model, version: int, compiled: tuple[str, ...]) -> dict[str, bytes]:
    if version == 2:
        return {"modelDescription.xml": model_description.fmi2(model, "native", compiled).encode(), "model.png": icon()}
    files = {
        "modelDescription.xml": model_description.fmi3(model).encode(),
        "sources/buildDescription.xml": model_description.build_description(model, compiled).encode(),
        "terminalsAndIcons/icon.png": icon(),
    }
    return files | {"terminalsAndIcons/terminalsAndIcons.xml": model_description.terminals(model).encode()}


def _documentation(model: Model, version: int) -> dict[str, bytes]:
    licences = "documentation/licenses/license.txt" if version == 3 else "documentation/license.txt"
    return {"documentation/index.html": tables.page(model).encode(), licences: licence()}


def _darwin64(model: Model, libraries: dict[str, bytes]) -> dict[str, bytes]:
    """FMI 2 hosts look for macOS in `darwin64`: a library for both processors where both were built."""
    both = [libraries.get("macos-x86_64"), libraries.get("macos-aarch64")]
    found = [library for library in both if library]
    if not found:
        return {}
    library = universal(*found) if len(found) == 2 else found[0]
    return {f"binaries/darwin64/{model.name}.dylib": library}
