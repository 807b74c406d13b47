"""The engine on hardware that others built and measured: one table.

Usage, from tests/: python -m measured.table [NAME ...] [--own FILE.py DATA]

Every row is one `tubular-dea close-loop`: base model, effects named, error before and after on recordings that took no
part in any fit. Data: ../shared/data (licences beside them), not part of the repository: what is not there is skipped,
and that is said. Published figures are those of the benchmarks' authors.
"""

from __future__ import annotations

import argparse
import json
import shutil
import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path

from tubular_dea.cli import main

ROOT = Path(__file__).resolve().parents[2]
DATA = ROOT.parent / "shared" / "data"
PLANTS = ROOT / "cosim_examples" / "plants"
MMHG = 133.322


@dataclass(frozen=True)
class Case:
    """A plant, its recordings, those held out, the table's unit (and how many SI units it is), a published figure."""

    name: str
    plant: str
    data: Path
    held_out: tuple[str, ...] = ()
    unit: str = "V"
    scale: float = 1.0
    published: str = ""


def cases(folder: Path) -> list[Case]:
    """All measured plants; the pig's records are joined into `folder`."""
    measured, loop = DATA / "measured", str(PLANTS / "mock_loop.py")
    steps = ("NV_step05", "NV_step10", "NV_step15")
    tanks, tank = measured / "cascaded_tanks", str(PLANTS / "cascaded_tanks.py")
    return [
        Case("tanks, linear outflow", tank, tanks, ("validation",), published="0.699 V (grey box with code)"),
        Case("tanks, square root", f"{tank}:SQUARE_ROOT", tanks, ("validation",), published="0.699 V"),
        Case("mock loop", loop, measured / "mock_loop", steps, "mmHg", MMHG),
        Case("pig in vivo", "aorta", pig(folder / "in_vivo", "invivo_data", 2), (), "mmHg", MMHG),
        Case("pig's heart ex vivo", "aorta", pig(folder / "ex_vivo", "exvivo_data", 1), (), "mmHg", MMHG),
        Case("silverbox", str(PLANTS / "silverbox.py"), measured / "silverbox", ("arrow", "multisine_2"), "mV", 1e-3),
    ]


def pig(folder: Path, source: str, records: int) -> Path:
    """Aortic flow and pressure of the pig, from files of their own, side by side; where they are not, their place."""
    if not (DATA / "aorta" / source).exists():
        return DATA / "aorta" / source
    folder.mkdir(parents=True, exist_ok=True)
    for number in range(1, records + 1):
        flow, pressure = (_column(DATA / "aorta" / source / f"Ao_baseline1_Ao{what}{number}.csv") for what in "QP")
        lines = ["time [s],flow [L/min],pressure [mmHg]"]
        lines += [f"{t:.4f},{q},{p}" for (t, p), (_, q) in zip(pressure, flow, strict=True)]
        (folder / f"record_{number}.csv").write_text("\n".join(lines) + "\n")
    return folder


def _column(path: Path) -> Iterator[tuple[float, str]]:
    """Time since the first sample [s] and value, as it stands."""
    rows = [line.split(",") for line in path.read_text().splitlines()[2:]]
    begin = datetime.fromisoformat(f"2000-01-01T{rows[0][0]}")
    for clock, value in rows:
        yield (datetime.fromisoformat(f"2000-01-01T{clock}") - begin).total_seconds(), value


def run(case: Case, out: Path) -> tuple[dict, float]:
    """result.json of one plant, and how long it took [s]."""
    begin = time.perf_counter()
    held = ["--hold-out", *case.held_out] if case.held_out else []
    if main(["close-loop", str(case.data), "--plant", case.plant, "--out", str(out), *held]):
        raise SystemExit(f"{case.name}: close-loop refused its data")
    return json.loads((out / "result.json").read_text()), time.perf_counter() - begin


def row(case: Case, result: dict, seconds: float) -> str:
    """A row of the table: errors of every recording that was held out."""
    named = ", ".join(e["id"] for e in result["effects"]) or "-"
    names = result["held_out"]
    before, after = (result["error"][k]["per_experiment"] for k in ("recalibrated", "after"))
    size = [f"{before[n]['rmse'] / case.scale:.3g} -> {after[n]['rmse'] / case.scale:.3g}" for n in names]
    fit = " / ".join(f"{after[n]['fit_percent']:.1f}" for n in after)
    return (
        f"| {case.name} | {result['verdict']} | {named} | {'; '.join(size)} {case.unit} | {fit} | "
        f"{case.published or '-'} | {seconds:.0f} |"
    )


def table(wanted: list[str], own: list[str] | None = None) -> None:
    """Print the rows of `wanted` plants (all by default), and of a reader's own."""
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        listed = cases(folder)
        if own:
            listed = [Case("own", own[0], Path(own[1]), unit="SI")]
        print("| plant | verdict | named | error on held-out recordings | fit of each [%] | published | s |")
        print("|---|---|---|---|---|---|---|")
        for case in listed:
            if wanted and case.name not in wanted:
                continue
            if not case.data.exists():
                print(f"{case.name}: skipped, its recordings are not included and not in {case.data}", flush=True)
            else:
                result, seconds = run(case, folder / "out")
                print(row(case, result, seconds), flush=True)
                shutil.rmtree(folder / "out")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*")
    parser.add_argument("--own", nargs=2, metavar=("FILE.py", "DATA"))
    options = parser.parse_args()
    table(options.names, options.own)
