"""Run the assisted heart: ventricle and windkessel, tube and scheduler, strongly coupled; with and without assist.

Writes report.html (figures to zoom), PNGs, the values over time (CSV) and the figures of the last beat (JSON).
"""

from __future__ import annotations

import argparse
import json
import tomllib
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from tqdm import tqdm

from ..cosim.beats import compare, measure
from ..cosim.heart_assist import fmus, heart_assist, models
from ..cosim.heartbeats import detect, pace, read_ecg, read_r_times
from ..cosim.master import SCHEMES, Options, Run, simulate
from ..cosim.system import System
from ..errors import UserError
from ..files import write_atomically
from ..model.patients import PATIENTS
from ..model.units import UnitError, quantity
from ..model.windkessel import PARAMETERS, checked_patient, patient
from ..protocol import Protocol
from .settings import part_values

EXAMPLE = """example:
  tubular-dea assist --patient failing --voltage 5.5kV --out assisted
  tubular-dea assist --patient stiff --voltage 6kV --set scheduler.off_fraction=0.35 --out stiff
  tubular-dea assist --patient failing --ecg record.hea --beats 30 --out recorded"""
LONGEST_STEP = 0.02  # s; beyond it a beat is no longer resolved


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options of `tubular-dea assist`."""
    parser.add_argument(
        "--patient",
        default="failing",
        help=f"one of {', '.join(PATIENTS)}, or a TOML file with a whole parameter set (default: failing)",
    )
    parser.add_argument("--voltage", default="5.5 kV", help="voltage of a pulse (default: 5.5 kV)")
    parser.add_argument("--beats", type=int, default=15, help="beats to run (default: 15)")
    parser.add_argument(
        "--set",
        action="append",
        default=[],
        metavar="PART.NAME=VALUE[UNIT]",
        help="change a parameter of heart, tube or scheduler, as in heart.C=0.6mL/mmHg",
    )
    parser.add_argument("--ecg", type=Path, help="beat as a recorded ECG does: CSV (time [s],ecg [mV]) or WFDB record")
    parser.add_argument("--lead", help="column or signal of the ECG (default: the first)")
    parser.add_argument("--r-times", type=Path, help="beat at the R times [s] in this file, one a line")
    parser.add_argument("--scheme", default="implicit", choices=SCHEMES, help="coupling (default: implicit)")
    parser.add_argument("--step", type=float, default=1e-3, help="communication step [s] (default: 0.001)")
    parser.add_argument(
        "--variable", action="store_true", help="let the error estimate choose the step, up to 10 times --step"
    )
    parser.add_argument("--out", type=Path, default=Path("assisted"), help="folder to write to (default: assisted)")


def run(options: argparse.Namespace) -> None:
    """Run twice, compare, write."""
    if not 0 < options.step <= LONGEST_STEP:
        raise UserError(
            f"--step: expected a positive number of seconds, at most {LONGEST_STEP:g}, but was given {options.step:g}"
        )
    values = read_patient(options.patient)
    beats = _beats(options)
    settings = part_values(models(paced=beats is not None), options.set)
    settings.setdefault("scheduler.voltage_on", _number(options.voltage, "V", "--voltage"))
    stop, paced = _stop(options, values, settings, beats)
    slaves = fmus(paced=paced is not None)
    runs = {}
    for name, voltage in (("without assist", 0.0), ("with assist", settings["scheduler.voltage_on"])):
        system = heart_assist(slaves, values, {**settings, "scheduler.voltage_on": voltage}, paced)
        runs[name] = _simulate(system, stop, options, name).completed()
    for name, made in runs.items():
        made.write(options.out / f"{name.replace(' ', '_')}.csv")
    _report(options, runs, settings)


def read_patient(text: str) -> dict[str, float]:
    """A patient by name, or from a TOML file of `name = "value unit"` (or numbers in SI units)."""
    if text in PATIENTS:
        return patient(text)
    path = Path(text)
    if path.suffix != ".toml":
        return patient(text)  # tells which patients there are
    try:
        given = tomllib.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError) as problem:
        raise UserError(f"{path}: cannot be read as a patient set: {problem}") from None
    declared = {p.quantity.name: p.quantity for p in PARAMETERS}
    for name, value in given.items():
        if isinstance(value, bool) or not isinstance(value, str | int | float):
            raise UserError(f'{path}: {name}: expected a number, or text like "1.2 mL/mmHg", and nothing else')
    values = {n: _number(str(v), declared[n].unit if n in declared else "1", f"{path}: {n}") for n, v in given.items()}
    return checked_patient(values, path.name)


def _number(text: str, unit: str, what: str) -> float:
    """ "5.5 kV" or "5500" in SI units; `what` is at the head of the error."""
    try:
        return quantity(text, unit)
    except UnitError as problem:
        raise UserError(f"{what}: {problem}") from None


def _beats(options: argparse.Namespace) -> np.ndarray | None:
    """Recorded R times [s], if any are given."""
    if options.ecg is not None and options.r_times is not None:
        raise UserError("--ecg and --r-times exclude each other; give one of them")
    if options.ecg is not None:
        return detect(read_ecg(options.ecg, options.lead))
    if options.r_times is None:
        return None
    return read_r_times(options.r_times)


def _stop(options: argparse.Namespace, values: Mapping[str, float], settings: Mapping[str, float],
          beats: np.ndarray | None) -> tuple[float, Protocol | None]:  # fmt: skip
    """End of the run [s], so that it holds the beats wanted; and the pace, if they are recorded ones."""
    if options.beats < 5:
        raise UserError(f"--beats: expected at least 5 (the scheduler learns for three) but was given {options.beats}")
    if beats is None:
        rate = settings.get("heart.heart_rate", values["heart_rate"])
        return (options.beats + 0.05) / rate, None
    if beats.size < options.beats + 2:
        raise UserError(
            f"--beats: expected at most {beats.size - 2}, which the recording has, but was given {options.beats}"
        )
    stop = float(beats[options.beats] - beats[0] + 0.05)
    return stop, pace(beats, stop)


def _simulate(system: System, stop: float, options: argparse.Namespace, name: str) -> Run:
    step = 10 * options.step if options.variable else options.step
    how = Options(
        scheme=options.scheme,
        step=step,
        variable=options.variable,
        tolerance=1e-4 if options.variable else 1e-6,
        order=1,
    )
    with tqdm(total=round(stop, 3), unit="s", desc=name, disable=None) as bar:

        def progress(time: float) -> None:
            bar.update(round(time - bar.n, 3))

        return simulate(system, stop, how, progress=progress)


def _report(options: argparse.Namespace, runs: Mapping[str, Run], settings: Mapping[str, float]) -> None:
    from ..report import assist as report

    figures = {name: measure(r) for name, r in runs.items()}
    table = compare(figures["without assist"], figures["with assist"])
    counted = {n: int(runs["with assist"][f"scheduler.{n}"][-1])
               for n in ("beats", "pulses", "premature_beats", "skipped_pulses", "vetoes", "dropouts")}  # fmt: skip
    notes = [
        f"Patient {options.patient}, pulses of {settings['scheduler.voltage_on'] / 1e3:g} kV in systole; "
        f"{options.scheme} coupling, communication step {options.step:g} s.",
        "The scheduler saw " + ", ".join(f"{n} {what.replace('_', ' ')}" for what, n in counted.items()) + ".",
    ]
    scheduler = models()["scheduler"].parameter_values()
    limits = {
        "electric_field": settings.get("scheduler.field_limit", scheduler["field_limit"]),
        "snap_through_margin": settings.get("scheduler.margin_limit", scheduler["margin_limit"]),
    }
    written = report.write(options.out, runs, table, "The assisted heart", notes, limits)
    summary = {"figures": figures, "scheduler": counted, "patient": options.patient, "settings": dict(settings)}
    write_atomically(options.out / "summary.json", (json.dumps(summary, indent=1) + "\n").encode())
    width = max(len(row[0]) for row in table)
    print(f"{'the last whole beat':{width}}  {'without':>10}  {'with':>10}  change")
    for label, without, with_, change in table:
        print(f"{label:{width}}  {without:>10}  {with_:>10}  {change}")
    print(notes[1])
    print(f"wrote {', '.join(str(p) for p in written)}")
