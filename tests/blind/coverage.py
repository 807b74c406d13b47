"""How often the 95 % intervals of an identification hold: `python -m blind.coverage` from `tests/` prints a table.

Every trial draws a tube and writes recordings by the independent bench, with the noise of sensor and monitors; nothing
is missing in the model. Noise, drives, switching instants and zeros are found from the files as `identify` does. One
step of Gauss and Newton from the truth gives the estimate and its covariance, which costs one linearisation; `--full N`
runs N whole joint fits from Table III besides (or from Table II by the paper's stages: `--table-2 N`).
"""

from __future__ import annotations

import argparse
import tempfile
from pathlib import Path

import numpy as np

from blind import bench
from tubular_dea.identify.fitting.fit import described
from tubular_dea.identify.fitting.intervals import interval
from tubular_dea.identify.records.data import read_folder
from tubular_dea.identify.study import procedure
from tubular_dea.identify.study.adjust import adjusted
from tubular_dea.identify.study.monitor_uncertainty import with_monitor_noise
from tubular_dea.identify.study.study import Study, study
from tubular_dea.model.dea import IDENTIFIED
from tubular_dea.plants.tube import PLANT, TABLE_II

NAMES = [q.name for q in IDENTIFIED]
Ends = list[tuple[float, float, float, float]]  # of each parameter: truth, estimate, lower and upper end


def recorded(seed: int, only: list[str] | None = None) -> tuple[Study, dict[str, float]]:
    """Recordings in which nothing is missing, as `identify` studies them, and the truth behind them."""
    with tempfile.TemporaryDirectory() as folder:
        data = Path(folder) / "data"
        tube = bench.draw(seed, "none")
        bench.write(tube, data, seed, only)
        work = study(read_folder(data, PLANT), held_out=(), effects=False)
    return work, dict(zip(NAMES, tube.identified, strict=True))


def linearised(seed: int, only: list[str] | None = None) -> Ends:
    """Intervals from one linearisation at the truth."""
    work, truth = recorded(seed, only)
    free = procedure.free_parameters(PLANT.model, truth)
    work = adjusted(work, (), truth, free)
    problem = work.problem((), free, truth)
    at = problem.scaled(truth)
    there = described(problem, at)
    found = at - there.covariance @ (there.jacobian.T @ there.residual)
    half = 1.96 * np.sqrt(np.diag(with_monitor_noise(problem, there, work.training, work.monitor_noise).covariance))
    si = [
        [f.to_si(float(x)) for f, x in zip(problem.free, row, strict=True)]
        for row in (found, found - half, found + half)
    ]
    return [(truth[n], *row) for n, row in zip(problem.names, zip(*si, strict=True), strict=True)]


def full(seed: int, table_2: bool = False, only: list[str] | None = None) -> Ends:
    """Intervals of a whole identification."""
    work, truth = recorded(seed, only)
    start = PLANT.model.parameter_values()
    if table_2:
        start = procedure.staged(work, start | TABLE_II)
    _, first = procedure.joint(work, start, 1)
    work = adjusted(work, (), first.values, first.free)
    _, best = procedure.joint(work, first.values, 1)
    return [(truth[n], best.values[n], *interval(best, n)) for n in best.names]


def table(trials: list[Ends]) -> str:
    """A line a parameter: how often the interval has the truth, and the error of the estimate."""
    ends = np.array(trials)  # (trials, parameters, 4)
    truth, found, low, high = np.moveaxis(ends, 2, 0)
    held = (np.minimum(low, high) <= truth) & (truth <= np.maximum(low, high))
    error = np.abs(found / truth - 1)
    lines = [
        f"{n:8s} holds {held[:, i].mean():6.1%}   error median {np.median(error[:, i]):.2%}, "
        f"largest {error[:, i].max():.2%}"
        for i, n in enumerate(NAMES)
    ]
    uncertainty = np.sqrt(0.95 * 0.05 / held.size)
    return "\n".join([*lines, f"all      holds {held.mean():6.1%} of {held.size} (chance: +-{1.96 * uncertainty:.1%})"])


def main() -> None:
    """Run the trials and print the tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--trials", type=int, default=60, help="linearised at the truth")
    parser.add_argument("--full", type=int, default=0, help="whole joint fits from Table III")
    parser.add_argument("--table-2", type=int, default=0, help="the paper's stages from Table II, then joint fits")
    options = parser.parse_args()
    for words, count, run in (
        ("linearised at the truth", options.trials, linearised),
        ("joint fits from Table III", options.full, full),
        ("stages from Table II, then joint fits", options.table_2, lambda seed: full(seed, True)),
    ):
        if count:
            print(f"{words}, {count} tubes\n{table([run(seed) for seed in range(1, count + 1)])}", flush=True)


if __name__ == "__main__":
    main()
