"""Run the assisted heart: ventricle and windkessel, tube and scheduler, strongly coupled; with and without assist.

Writes report.html (figures to zoom), lab.html (the same, live in any browser), PNGs, the values over time (CSV) and the
indices over the assisted beats (JSON).
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import tubular_dea as td

from ..api.given import amount
from ..control.optimum import OBJECTIVES
from ..cosim.master import SCHEMES
from ..errors import ArgumentError, UserError
from ..model.patients import PATIENTS
from .settings import settings

EXAMPLE = """example:
  tubular-dea assist --patient failing --voltage 5.5kV --out assisted
  tubular-dea assist --patient stiff --voltage 5kV --set scheduler.off_fraction=0.35 --out stiff
  tubular-dea assist --patient failing --ecg record.hea --beats 30 --out recorded
  tubular-dea assist --patient failing --model closed/model.json --out found
  tubular-dea assist --patient failing --compare "voltage=5kV" "scheduler.on_time=-70ms" --out compared
  tubular-dea assist --patient failing --controller 18.5mm --out held
  tubular-dea assist --patient healthy --optimise --set scheduler.field_limit=75V/um --out best"""

VOLTAGE = "5.5 kV"  # of a pulse, where none is asked for
OPTIMISED = ("objective", "largest_voltage")  # options of --optimise alone
NEEDS = {**dict.fromkeys(OPTIMISED, "optimise"), "lead": "ecg"}  # options, each with the one it belongs to
STEADY = "the best pulse is sought in a steady beat"
PULSES = "a controller chooses the voltage of its pulses itself"
EXCLUDED = (  # options that contradict each other, and why
    ("ecg", "r_times", "each of them says when the heart beats"),
    ("optimise", "ecg", STEADY),
    ("optimise", "r_times", STEADY),
    ("optimise", "compare", "one seeks the best pulse, the other runs given ones"),
    ("optimise", "controller", "a pulse is sought by its voltage, not by a radius to hold"),
    ("compare", "controller", "the cases compared are pulses of a voltage"),
    ("controller", "voltage", PULSES),
    ("controller", "set scheduler.voltage_on", PULSES),
    ("voltage", "set scheduler.voltage_on", "both are the voltage of a pulse"),
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options of `tubular-dea assist`."""
    parser.add_argument(
        "--patient",
        default="failing",
        help=f"one of {', '.join(PATIENTS)}, or a TOML file with a parameter set (default: failing)",
    )
    parser.add_argument("--model", type=Path, help="a tube of close-loop (model.json), instead of the paper's")
    parser.add_argument("--voltage", help=f"voltage of a pulse (default: {VOLTAGE})")
    parser.add_argument("--beats", type=int, default=15, help="beats to run (default: 15)")
    parser.add_argument(
        "--set",
        action="extend",
        nargs="+",
        default=[],
        metavar="PART.NAME=VALUE[UNIT]",
        help="change a parameter of heart, tube or scheduler, as in heart.C=0.6mL/mmHg",
    )
    parser.add_argument("--ecg", type=Path, help="follow the beats of a recorded ECG: CSV (time [s],ecg [mV]) or WFDB")
    parser.add_argument("--lead", help="column or signal of the ECG (default: the first)")
    parser.add_argument("--r-times", type=Path, help="follow beats at the R times [s] in this file, one per line")
    parser.add_argument("--scheme", default="implicit", choices=SCHEMES, help="coupling (default: implicit)")
    parser.add_argument("--step", default=1e-3, help="communication step (default: 1 ms)")
    parser.add_argument(
        "--variable", action="store_true", help="let the error estimate choose the step, up to 10 times --step"
    )
    parser.add_argument(
        "--compare",
        nargs="+",
        metavar="SETTINGS",
        help="more runs, each with settings of its own (commas between them), in one table and one figure",
    )
    parser.add_argument(
        "--optimise",
        action="store_true",
        help="find the best begin, end and voltage of a pulse within the limits of field, margin and amplifier",
    )
    parser.add_argument(
        "--objective",
        choices=OBJECTIVES,
        help="what --optimise lowers (work) or raises (volume, pressure; default: stroke_work_per_stroke_volume)",
    )
    parser.add_argument("--largest-voltage", help="of the amplifier, for --optimise (default: 10 kV)")
    parser.add_argument(
        "--controller", metavar="RADIUS", help="hold this radius during pulses (TubeController), as in 19mm"
    )
    parser.add_argument("--out", type=Path, default=Path("assisted"), help="folder to write to (default: assisted)")


def run(options: argparse.Namespace) -> None:
    """Run, write and print what was asked for."""
    result = _result(options)
    written = result.report(options.out)
    for line in result.lines():
        print(line)
    if isinstance(result, td.PulseResult):
        print(f"to run the optimum:\n  {result.command(options.out)}")
    print(f"wrote {', '.join(map(str, written))}")


def _result(options: argparse.Namespace) -> td.AssistResult | td.ComparisonResult | td.PulseResult:
    """The heart with and without assist, several settings of it, or its best pulse."""
    given = settings(options.set)
    _check_together(options, given)
    common: dict[str, Any] = {
        "patient": options.patient,
        "voltage": VOLTAGE if options.voltage is None else options.voltage,
        "beats": options.beats,
        "tube": options.model or "tube",
        "settings": given,
        "scheme": options.scheme,
        "step": amount(options.step, "s", "step"),
        "variable": options.variable,
        "progress": True,
    }
    if options.optimise:
        own = {name: getattr(options, name) for name in OPTIMISED if getattr(options, name) is not None}
        return td.best_pulse(**own, **common)
    common |= {"ecg": options.ecg, "lead": options.lead, "r_times": options.r_times}
    if not options.compare:
        return td.assist(controller=options.controller, **common)
    asked = amount(given.get("scheduler.voltage_on", common["voltage"]), "V", "voltage")
    cases: dict[str, dict[str, str]] = {f"{asked / 1e3:g} kV": {}}
    return td.compare(cases | {text: _case(text) for text in options.compare}, **common)


def _check_together(options: argparse.Namespace, given: Mapping[str, str]) -> None:
    """`UserError` for options that contradict each other, and for those of another one that is not there."""
    there = {name for name, value in vars(options).items() if value not in (None, False)}
    there |= {"set scheduler.voltage_on"} & {f"set {name}" for name in given}
    for one, other, reason in EXCLUDED:
        if {one, other} <= there:
            raise UserError(f"{_option(one)} and {_option(other)} exclude each other: {reason}; give one of them")
    for name, needed in NEEDS.items():
        if name in there and needed not in there:
            raise UserError(f"{_option(name)} belongs to {_option(needed)}; give both, or leave it out")


def _option(name: str) -> str:
    return "--" + (name if "." in name else name.replace("_", "-"))


def _case(text: str) -> dict[str, str]:
    """The settings in "voltage=5kV,scheduler.on_time=-70ms"."""
    for part in text.split(","):
        if not part.partition("=")[2].strip():
            raise ArgumentError("cases", f" {text}: expected NAME=VALUE, as in voltage=5kV, but found {part.strip()!r}")
    return settings(text.split(","), "cases")
