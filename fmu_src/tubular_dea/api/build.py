"""FMUs from models."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Literal, TypeAlias

from ..errors import ArgumentError
from ..export.compile import PLATFORMS, Platform, host
from ..export.package import native_fmu
from ..export.python_fmu import python_fmu
from ..model.declare import Model
from ..plants.load import load_plant as named_plant
from .given import AnyModel, AnyPlant, brief, model_of, path_of, plant_of
from .work import steps

Platforms: TypeAlias = str | Sequence[str]


def platforms_of(names: Platforms) -> list[Platform]:
    """The platforms behind ``"host"``, ``"all"`` or the names of some."""
    if not isinstance(names, Sequence):
        raise ArgumentError("platforms", f": expected a name or a list of names but was given {brief(names)}")
    listed = [names] if isinstance(names, str) else list(names)
    known = ["host", "all", *(p.name for p in PLATFORMS)]
    for name in listed:
        if name not in known:
            raise ArgumentError("platforms", f": expected some of {', '.join(known)} but was given {name!r}")
    if "all" in listed:
        return list(PLATFORMS)
    return [p for p in PLATFORMS if p.name in listed or ("host" in listed and p == host())]


def build_fmu(
    model: AnyModel,
    path: str | Path,
    *,
    fmi: Literal[2, 3] = 2,
    platforms: Platforms = "host",
    python: bool = False,
    plant: AnyPlant | None = None,
) -> Path:
    """Write a model as an FMU, for model exchange and co-simulation.

    Parameters
    ----------
    model : Model, Plant, str or Path
        ``td.tube()``, the model of a discovery, ``"tube"``, ``"FILE.py[:NAME]"``, a model.json.
    path : str or Path
        The file to write, as in ``"out/TubularDEA.fmu"``.
    fmi : {2, 3}
        The version of FMI.
    platforms : str or sequence of str
        ``"host"`` (this machine), ``"all"``, or names; all can be built with this package alone.
    python : bool
        Write it by pythonfmu (FMI 2.0, co-simulation), in Python that can be read and changed.
    plant : Plant, str or Path, optional
        The plant of a model.json, if it is declared in a file of your own.

    Returns
    -------
    Path
        The file. The same model and platforms give the same bytes.

    Raises
    ------
    UserError
        For a model that cannot be loaded, an unknown platform, and where nothing can be written.

    Examples
    --------
    >>> import tubular_dea as td
    >>> td.build_fmu(td.tube(C_1="340 kPa"), "stiffer.fmu").name
    'stiffer.fmu'

    Source: FMI 2.0.4 and 3.0.1, https://fmi-standard.org.
    """
    chosen, target, targets = model_of(model, plant), path_of(path, "path"), platforms_of(platforms)
    if fmi not in (2, 3):
        raise ArgumentError("fmi", f": expected 2 or 3 but was given {fmi!r}")
    if not python:
        return native_fmu(chosen, fmi, target, targets)
    if chosen.delays:
        raise ArgumentError("python", f": {chosen.name} has pure delays, which only the native FMUs carry")
    return python_fmu(chosen, target)


def build_fmus(
    out: str | Path = "build",
    model: AnyModel | None = None,
    *,
    platforms: Platforms = "host",
    plant: AnyPlant = "tube",
    progress: bool = False,
) -> list[Path]:
    """Write all FMUs of a model below a folder: fmi2/, fmi3/, python/, and a bill of materials.

    Parameters
    ----------
    out : str or Path
        The folder to write to.
    model : Model, Plant, str or Path, optional
        What is written (default: the plant's own model). Without a model and a plant these are the tube, the heart,
        the scheduler, the tube controller, and HeartAssist.ssp, which wires them.
    platforms : str or sequence of str
        As in `build_fmu`.
    plant : Plant, str or Path
        The plant of the model.
    progress : bool
        Show a bar on standard error.

    Returns
    -------
    list of Path
        The files. A model with pure delays comes without python/: only the native FMUs carry them.

    Raises
    ------
    UserError
        For a model that cannot be loaded, an unknown platform, and where nothing can be written.

    Examples
    --------
    >>> import tubular_dea as td
    >>> written = td.build_fmus("better", td.tube(["electrode_resistance"], tau_e="12 ms"))
    >>> [path.relative_to("better").as_posix() for path in written]
    ['fmi2/TubularDEA.fmu', 'fmi3/TubularDEA.fmu', 'python/TubularDEA.fmu', 'bom.json']
    """
    from ..export.bom import bill_of_materials

    folder, targets, chosen = path_of(out, "out"), platforms_of(platforms), plant_of(plant)
    if model is not None or chosen.file or chosen.name != named_plant("tube").name:
        shown = chosen.model if model is None else model_of(model, chosen)
        written = _written([shown], [], folder, targets, progress)
    else:
        written = _written([chosen.model], _companions(), folder, targets, progress)
        written.append(_archive(folder))
    return [*written, bill_of_materials(written, targets, folder)]


def _companions() -> list[Model]:
    """The tube's companions, which come as native FMUs only."""
    from ..model.scheduler import heartbeat_scheduler
    from ..model.tube_controller import tube_controller
    from ..model.windkessel import aortic_windkessel

    return [aortic_windkessel(), heartbeat_scheduler(), tube_controller()]


def _written(
    models: Sequence[Model], native_only: Sequence[Model], out: Path, targets: list[Platform], shown: bool
) -> list[Path]:
    """The FMUs of some models, and of some more without python/."""
    written, every = [], [*models, *native_only]
    with steps(shown, 2 * len(every) * len(targets) + len(models), "library") as tell:
        for model in every:
            written += [native_fmu(model, v, out / f"fmi{v}" / f"{model.name}.fmu", targets, tell) for v in (2, 3)]
            if model in models and not model.delays:
                written.append(python_fmu(model, out / "python" / f"{model.name}.fmu"))
                tell("python")
    return written


def _archive(out: Path) -> Path:
    """HeartAssist.ssp: the failing heart's whole loop, from the FMI 2.0 FMUs below `out`."""
    from ..cosim.heart_assist import archive
    from ..cosim.heart_assist import models as heart_models
    from ..model.windkessel import patient

    slaves = {part: out / "fmi2" / f"{model.name}.fmu" for part, model in heart_models().items()}
    return archive(slaves, out / "HeartAssist.ssp", patient("failing"))
