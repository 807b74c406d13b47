"""Patients by name or from a TOML file, whole or based on another."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from pathlib import Path

from ..errors import UserError
from ..files import read_whole
from .declare import nearest
from .patients import PATIENTS
from .units import UnitError, quantity
from .windkessel import PARAMETERS, check_known, checked_patient, patient

BASE = "based_on"


def read_patient(text: str) -> dict[str, float]:
    """A patient by name, or from a TOML file of `name = "value unit"` (or numbers in SI units).

    A file that starts with `based_on = "failing"` needs to name only what differs from that patient.
    """
    if text in PATIENTS:
        return patient(text)
    path = Path(text)
    if path.suffix != ".toml":
        if path.exists():
            known = ", ".join(PATIENTS)
            raise UserError(
                f"{path}: expected a patient's .toml, as `tubular-dea patient` writes it, or one of {known}"
            )
        return patient(text)  # tells which patients there are
    try:
        given = tomllib.loads(read_whole(path).decode())
    except (ValueError, RecursionError) as problem:
        raise UserError(f"{path}: cannot be read as a patient set: {problem}") from None
    base = given.pop(BASE, None)
    if base is not None and (not isinstance(base, str) or base not in PATIENTS):
        raise UserError(f"{path}: {BASE}: there is no patient {base!r}{nearest(str(base), PATIENTS)}")
    tables = [name for name, value in given.items() if isinstance(value, dict)]
    if tables:
        raise UserError(f"{path}: [{tables[0]}]: expected no tables; write the keys at the top of the file")
    check_known(given, path.name)  # before the values: of a parameter that is not known there is no unit to expect
    values = {name: _value(path, name, value) for name, value in given.items()}
    return checked_patient({**(patient(base) if base else {}), **values}, path.name)


def as_toml(values: Mapping[str, float]) -> str:
    """A patient's values (SI) as `read_patient` reads them."""
    whole = {p.quantity.name for p in PARAMETERS if p.quantity.type == "Integer"}
    return "".join(f"{name} = {int(v) if name in whole else repr(float(v))}\n" for name, v in values.items())


def _value(path: Path, name: str, value: object) -> float:
    units = {p.quantity.name: p.quantity.unit for p in PARAMETERS}
    if isinstance(value, bool) or not isinstance(value, str | int | float):
        raise UserError(f'{path}: {name}: expected a number, or text like "1.2 mL/mmHg", and nothing else')
    try:
        return quantity(str(value), units[name])
    except UnitError as problem:
        raise UserError(f"{path}: {name}: {problem}") from None
