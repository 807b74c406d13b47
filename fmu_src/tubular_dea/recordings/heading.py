"""A heading taken apart: `Pressure [mbar]`, `time (s)`, `time_s`, `Time/s`, `U in kV`, `Radius, mm`."""

from __future__ import annotations

import re

from ..model.units import is_unit

_BRACKETS = [
    re.compile(rf"(?P<name>.*?)\s*{pair}")
    for pair in (
        r"\[(?P<unit>[^\]]*)\]",
        r"\((?P<unit>[^()]*(?:\([^()]*\))?[^()]*)\)",
        r"\{(?P<unit>[^}]*)\}",
        "<(?P<unit>[^>]*)>",
    )
]
_SLASH = re.compile(r"(?P<name>[^/]+?)\s*/\s*(?P<unit>.+)")
_IN = re.compile(r"(?P<name>.+?)\s+in\s+(?P<unit>.+)")
_FORM = re.compile(
    r"(?=.*([dmyhs])\1)[dmyhs]{1,4}([:./\- T,]+([dmyhs]{1,4}|f{1,6}|0{1,6}|x{1,6}))+", re.IGNORECASE
)  # hh:mm:ss.fff
_WORDS = re.compile(r"(?P<name>.+?)(?:\s*,\s*|\s*;\s*|\s*:\s*|[\s_.-]+)(?P<unit>[^\s_,;:\d.-][^\s_,;:]*)")


def parts(heading: str) -> tuple[str, str]:
    """Name and unit of a heading; the unit is "" where none is said.

    What stands in brackets behind the name is a unit, known or not; after a slash, a comma, "in", a space or an
    underscore only what is known as one.
    """
    plain = " ".join(heading.strip().strip("\"'").split())
    bracketed = next((m for m in (pattern.match(plain) for pattern in _BRACKETS) if m), None)
    if bracketed and bracketed["name"]:
        return name(bracketed["name"]), bracketed["unit"].strip()
    for pattern in (_SLASH, _IN, _WORDS):
        match = pattern.fullmatch(plain)
        if match and is_unit(match["unit"]):
            return name(match["name"]), match["unit"].strip().removeprefix("(").removesuffix(")")
    return name(plain), ""


def name(text: str) -> str:
    """A name in small letters with underscores, so that `Laser 2` and `laser_2` are one."""
    return re.sub(r"[\s_\-./]+", "_", text.strip().strip("\"'#").casefold()).strip("_:,;")


def is_unit_cell(cell: str) -> bool:
    """Whether a cell of a row of units may be one: [s], (kPa), mm, hh:mm:ss, or "-" for none."""
    plain = cell.strip().strip("[](){}<>\"' ")
    return plain in ("", "-", "--") or is_unit(plain) or _is_form(plain)


def unit_of(cell: str) -> str:
    """The unit in a cell of a row of units."""
    plain = cell.strip().strip("\"' ")
    while plain[:1] in "[({<" and plain[-1:] in "])}>" and plain:
        plain = plain[1:-1].strip()
    return "" if plain in ("-", "--") or _is_form(plain) else plain


def _is_form(text: str) -> bool:
    """Whether a text shows how times of a clock are written, as hh:mm:ss does: they have no unit."""
    return _FORM.fullmatch(text) is not None and not is_unit(text)
