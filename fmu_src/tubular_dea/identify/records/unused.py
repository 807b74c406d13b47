"""What was found in the files of recordings but not used, and how they were understood."""

from __future__ import annotations

from ...model.units import is_unit, parse
from ...recordings.heading import parts
from ...recordings.table import some
from .experiment import Recordings


def not_used(recordings: Recordings) -> list[str]:
    """What was found in the files but not used, as text, once for all files."""
    sources = {e.source.path: e.source for e in recordings.experiments if e.source}  # parts of a file have one
    columns: dict[str, int] = {}
    for source in sources.values():
        for heading in source.unused:
            columns[heading] = columns.get(heading, 0) + 1
    said = [
        f"not used: column {heading!r} in {n} of {len(sources)} files{_may_be(recordings, heading)}"
        for heading, n in columns.items()
    ]
    if recordings.left_out:
        hold = "holds" if len(recordings.left_out) == 1 else "hold"
        said.append(f"not used: {some(recordings.left_out)}, which {hold} no table")
    said += [f"not used: {name}, in which nothing moves" for name in recordings.still]
    remarks: dict[str, list[str]] = {}
    for source in [e.source for e in recordings.experiments if e.source]:
        for remark in source.remarks:
            if source.path.name not in (names := remarks.setdefault(remark, [])):
                names.append(source.path.name)
    said += [f"{names[0] if len(names) == 1 else f'{len(names)} files'}: {r}" for r, names in remarks.items()]
    return said


def _may_be(recordings: Recordings, heading: str) -> str:
    """That an unused column has the unit of an output that no file has; "" where it has not."""
    unit, there = parts(heading)[1], {name for e in recordings.experiments for name in e.outputs}
    if not unit or not is_unit(unit):
        return ""
    kind, plant = parse(unit).exponents, recordings.plant
    left = [o for o in plant.outputs if o.name not in there and parse(plant.quantity(o.name).unit).exponents == kind]
    return f" (if it is the {left[0].headings[0]}: --columns {left[0].headings[0]}={heading!r})" if left else ""
