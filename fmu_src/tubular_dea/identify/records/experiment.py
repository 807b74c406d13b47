"""Experiments: what every recording becomes once it has been read, in SI units, and all those of a folder."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from ...plants.plant import Output, Plant
from ...recordings import ReadError

DataError = ReadError  # recordings that cannot be used: as files, or for what they say

RESTED, EQUILIBRIUM, UNKNOWN = "rested", "equilibrium", "unknown"
STARTS = (RESTED, EQUILIBRIUM, UNKNOWN)  # what a plant may start from


@dataclass(frozen=True)
class Source:
    """How a file was understood: its `format`, the column of every signal (`heading [unit]`), those not used, remarks.

    `missing` counts the cells of each signal that hold no number; `units` are those of the file's columns, by signal.
    `row` is what `lines` of the experiment count: lines, or samples of a file without any.
    """

    path: Path
    format: str
    columns: dict[str, str]
    unused: tuple[str, ...]
    remarks: tuple[str, ...]
    missing: dict[str, int]
    units: dict[str, str]
    row: str


@dataclass(frozen=True)
class Experiment:
    """One recording in SI units: `time` (n,), `inputs` and `outputs` by name, each (n,), outputs NaN where missing.

    Outputs are as the model puts them out (a radius less its rest). `lines` are the numbers of the samples' lines in
    the file. `trigger` (n,) is a logical signal of the switching, where it was recorded. `start` is how the plant
    starts (`STARTS`), `start_said` whether bench.toml says so; `begins` [s] when, on a clock of the whole folder,
    where experiments follow without rest, and `follows` names the one before it. `source` says how the file was
    understood. `part_of` names the file of which it is a run, or the whole of which it is what comes before or after a
    long gap; `guessed` (n,) tells at which samples an input is a guess, as it was not recorded for long while it moves
    (`gaps`). `relative_noise` (n,) of an output is its noise over the usual one, where that grows with the reading.
    """

    name: str
    time: np.ndarray
    inputs: dict[str, np.ndarray]
    outputs: dict[str, np.ndarray]
    lines: np.ndarray
    trigger: np.ndarray | None = None
    start: str = RESTED
    start_said: bool = False
    begins: float | None = None
    follows: str = ""
    source: Source | None = None
    part_of: str = ""
    guessed: np.ndarray | None = None
    relative_noise: Mapping[str, np.ndarray] = field(default_factory=dict)

    def seen(self, output: str) -> np.ndarray:
        """Where an output was recorded, shape (n,); all False if it is not in the file."""
        return np.isfinite(self.outputs[output]) if output in self.outputs else np.zeros(self.time.size, bool)


@dataclass(frozen=True)
class Recordings:
    """All experiments of a folder and what its bench.toml says: `geometry` by parameter name, noise by signal name.

    `left_out` names files that hold no table, such as somebody's notes, `still` those in which nothing moves.
    """

    plant: Plant
    experiments: list[Experiment]
    geometry: dict[str, float] = field(default_factory=dict)
    noise: dict[str, float] = field(default_factory=dict)
    source: str = ""
    left_out: tuple[str, ...] = ()
    still: tuple[str, ...] = ()

    @property
    def known_parameters(self) -> dict[str, float]:
        """The model's parameters that the geometry gives [SI]."""
        return {n: v for n, v in self.geometry.items() if n in self.plant.model.parameter_values()}

    @property
    def commanded(self) -> set[str]:
        """The signals that were not measured: what stands in the files is exact."""
        return commanded(self.noise)

    @property
    def starts(self) -> dict[str, str]:
        """How each experiment starts, by name: one that follows another as that does, unless bench.toml says it."""
        return {e.name: self.begun_by(e).start for e in self.experiments}

    def begun_by(self, experiment: Experiment) -> Experiment:
        """The experiment whose start decides how another one begins: itself, or the first of those that it follows."""
        own = {e.name: e for e in self.experiments}
        while experiment.follows in own and not experiment.start_said:
            experiment = own[experiment.follows]
        return experiment

    def with_parts(self, names: Sequence[str]) -> list[str]:
        """The names of experiments, and of all parts of those that were cut at gaps."""
        return [*names, *(e.name for e in self.experiments if e.part_of in names and e.name not in names)]

    @property
    def fitted_outputs(self) -> list[Output]:
        """The outputs that take part in fits: recorded in some file, and not driven by the rate of an input."""
        return fitted_outputs(self.plant, self.experiments)


def fitted_outputs(plant: Plant, experiments: Sequence[Experiment]) -> list[Output]:
    """The outputs that are recorded in some file, and not driven by the rate of an input."""
    there = [o for o in plant.outputs if any(e.seen(o.name).any() for e in experiments)]
    return [o for o in there if not o.feels_rates]


def commanded(noise: Mapping[str, float]) -> set[str]:
    """The signals that are said to have no noise: they were commanded, and not measured."""
    return {name for name, level in noise.items() if level == 0}
