"""What is recorded on a bench: which signals drive the model, which one it is held against, and what is plausible."""

from __future__ import annotations

from dataclasses import dataclass, field

from ..model.dea import GEOMETRY
from ..model.declare import Quantity


@dataclass(frozen=True)
class Signal:
    """A recorded quantity: `unit` in SI; `held` from its sample to the next, or continuous between samples.

    A recording whose largest value is not between `least` and `most` was labelled with a wrong unit: `mislabelled`
    names what it then is, below and above.
    """

    name: str
    unit: str
    held: bool = False
    least: float = 0.0
    most: float = float("inf")
    mislabelled: tuple[str, str] = ("", "")


@dataclass(frozen=True)
class Bench:
    """The signals of a kind of bench and what the model calls them.

    `absolute_names` of the output are relative to zero, the others to the rest state `rest` (SI). `measured` is the
    model's output that reports what the sensor reports.
    """

    model: str
    inputs: tuple[Signal, ...]
    output: Signal
    absolute_names: tuple[str, ...]
    relative_names: tuple[str, ...]
    measured: str
    rest: float = 0.0
    least_samples: int = 50
    geometry: dict[str, Quantity] = field(default_factory=dict)

    @property
    def output_names(self) -> tuple[str, ...]:
        """All headings under which the output may stand."""
        return (*self.absolute_names, *self.relative_names)

    def example(self) -> str:
        """A header as it is expected."""
        cells = [
            "time [s]",
            *(f"{s.name} [{s.unit}]" for s in self.inputs),
            f"{self.output_names[0]} [{self.output.unit}]",
        ]
        return ",".join(cells)


TUBE = Bench(
    model="TubularDEA",
    inputs=(
        Signal("pressure", "Pa", False, 400.0, 1e5, ("mmHg or kPa labelled Pa", "Pa labelled mmHg or kPa")),
        Signal("voltage", "V", True, 25.0, 1e5, ("kV labelled V", "V labelled kV")),
    ),
    output=Signal("radius", "m", False, 0.0, 0.2, ("", "mm or um labelled m")),
    absolute_names=("radius",),
    relative_names=("displacement", "radial_displacement"),
    measured="measured_displacement",
    rest=15e-3,
    geometry={q.name: q for q in GEOMETRY if q.type == "Real"},
)

AORTA = Bench(
    model="AorticAfterload",
    inputs=(Signal("flow", "m3/s", False, 1.5e-5, 2e-3, ("L/min labelled mL/s", "mL/s labelled L/min or m3/s")),),
    output=Signal("pressure", "Pa", False, 1000.0, 1e5, ("mmHg or kPa labelled Pa", "Pa labelled mmHg or kPa")),
    absolute_names=("pressure",),
    relative_names=(),
    measured="measured_pressure",
    least_samples=100,
)
