"""FMUs made elsewhere, unpacked once a process, and what they declare."""

from __future__ import annotations

import atexit
import contextlib
from dataclasses import dataclass
from functools import cache
from typing import Any

import fmpy

from ..files import FileError, FullDiskError, unpack, working_folder
from ..model.declare import Quantity
from .expression import PlanError
from .models import ExternalFmu


@cache
def unpacked(fmu: ExternalFmu) -> tuple[str, Any]:
    """The folder it is unpacked in, and its description; once a process."""
    with contextlib.ExitStack() as stack:
        folder = stack.enter_context(working_folder(f"model: {fmu.name}"))
        path = folder / "model.fmu"
        path.write_bytes(fmu.content)
        try:
            unpack(path, folder)
            description = fmpy.read_model_description(str(folder))
        except FullDiskError:
            raise
        except FileError as problem:
            raise PlanError(f"model: {str(problem).replace(str(path), fmu.name)}") from None
        except Exception as problem:
            why = str(problem).replace(f"{folder}/", "")
            raise PlanError(
                f"model: {fmu.name}: cannot be read as an FMU: {why}; expected an archive with a valid description"
            ) from None
        atexit.register(stack.pop_all().close)
    return str(folder), description


@dataclass(frozen=True)
class Declared:
    """The parameters, the inputs, and all else that an FMU declares, by name; units as it gives them."""

    parameters: dict[str, Quantity]
    inputs: dict[str, Quantity]
    variables: dict[str, Quantity]


def declared(fmu: ExternalFmu) -> Declared:
    """What the FMU declares."""
    _, description = unpacked(fmu)
    found = Declared({}, {}, {})
    for v in description.modelVariables:
        with contextlib.suppress(TypeError, ValueError):
            unit = v.unit or (v.declaredType.unit if v.declaredType else None) or "1"
            q = Quantity(v.name, unit, v.description or "", _number(v.start), "", _number(v.min), _number(v.max))
            if v.causality == "input":
                found.inputs[v.name] = q
            (found.parameters if v.causality == "parameter" else found.variables)[v.name] = q
    return found


def _number(text: object) -> float | None:
    if text is None:
        return None
    word = str(text).lower()
    return float(word == "true") if word in ("true", "false") else float(word)
