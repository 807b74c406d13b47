"""The protocols and points that every path is checked against.

Reference traces live in tests/reference/<case>/ (see origin.md there); `case(name)` reads one.
"""

from __future__ import annotations

import tomllib
from dataclasses import dataclass
from pathlib import Path

import numpy as np

REFERENCE = Path(__file__).parent / "reference"
CASES = sorted(folder.name for folder in REFERENCE.iterdir() if folder.is_dir())
MMHG = 133.322  # Pa

# Points (lambda_2, lambda_2_rate [1/s], sigma_vis1 [Pa], sigma_vis2 [Pa]; pressure [Pa], voltage [V]) at which
# right-hand sides and Jacobians are compared: rest, work, near the fold, beyond the snap, compressed.
POINTS = [
    ((1.0, 0.0, 0.0, 0.0), (0.0, 0.0)),
    ((1.0, 0.3, 10.0, -5.0), (12665.59, 4000.0)),
    ((1.25, -0.2, 3.0e4, 1.0e3), (12665.59, 5000.0)),
    ((1.6, 2.0, 1.0e5, 4.0e4), (18000.0, 4000.0)),
    ((2.4, 8.0, 5.0e5, 9.0e4), (14000.0, 7000.0)),
    ((0.9, 0.1, -2.0e3, 50.0), (-3000.0, -2500.0)),
]


@dataclass(frozen=True)
class Case:
    """One reference trace: inputs as breakpoints (SI), samples, and tolerances by signal."""

    name: str
    inputs: dict[str, list[float]]
    stop: float
    interval: float
    tolerance: dict[str, float]
    time: np.ndarray
    lambda_2: np.ndarray
    electric_field: np.ndarray

    def pieces(self) -> list[tuple[float, float, np.ndarray, np.ndarray]]:
        """(start, end, inputs at start, slopes) of each smooth piece; inputs are pressure [Pa], voltage [V]."""
        time = self.inputs["time"]
        values = np.column_stack([self.inputs["pressure"], self.inputs["voltage"]])
        return [
            (a, b, values[i], (values[i + 1] - values[i]) / (b - a))
            for i, (a, b) in enumerate(zip(time, time[1:], strict=False))
            if b > a
        ]


def case(name: str) -> Case:
    """The reference trace `name`."""
    folder = REFERENCE / name
    with (folder / "case.toml").open("rb") as file:
        text = tomllib.load(file)
    table = np.genfromtxt(folder / "reference.csv", delimiter=",", skip_header=1)
    header = (folder / "reference.csv").read_text().splitlines()[0].split(",")
    column = {name.split(" ")[0]: table[:, i] for i, name in enumerate(header)}
    return Case(
        name,
        text["inputs"],
        text["stop"],
        text["interval"],
        text["tolerance"],
        column["time"],
        column["lambda_2"],
        column["electric_field"],
    )
