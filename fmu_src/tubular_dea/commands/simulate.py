"""Drive the tube (or any plant) by its inputs, and write the response as a table (CSV) and a picture (PNG).

Inputs are short specifications, or a file of any kind that close-loop reads, whose header names quantity and unit:
  time [s],pressure [mmHg],voltage [kV]
Other columns are left alone. Between rows an input that the plant declares held (the tube's voltage) keeps its value,
and the others are straight. A time listed twice is a jump; up to it all are straight.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import tubular_dea as td

from ..emit.tables import shown
from ..errors import MissingError, UserError
from ..model.dea import tubular_dea
from ..protocol import STOP
from .settings import add_plant, settings

EXAMPLE = """example:
  tubular-dea simulate --pressure "ramp 0 95 mmHg from 0 to 1" --voltage "step 0 5 kV at 2 until 3" --stop 4 --out run
  tubular-dea simulate --inputs bench.csv --set C_1=340kPa --out run
  tubular-dea simulate --model closed/model.json --pressure "95 mmHg" --voltage "step 0 5 kV at 1" --out found
  tubular-dea simulate --plant cosim_examples/plants/mock_loop.py --input "flow=step 0 90 mL/s at 1" --out loop"""

OPTIONS = ("pressure", "voltage")  # inputs that have an option of their own


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options of `tubular-dea simulate`; parameters are listed from the declaration."""
    parser.add_argument("--model", type=Path, help="a model.json of close-loop, instead of the plant's own model")
    add_plant(parser)
    parser.add_argument("--inputs", type=Path, help="file of all inputs over time, as described above")
    parser.add_argument(
        "--columns",
        nargs="+",
        default=[],
        metavar="SIGNAL=COLUMN",
        help="columns of that file by heading or number, as in voltage=AI3[kV]",
    )
    parser.add_argument(
        "--input",
        action="extend",
        nargs="+",
        default=[],
        metavar="NAME=SPECIFICATION",
        help='an input of any plant, for example "flow=step 0 90 mL/s at 1"',
    )
    parser.add_argument("--pressure", help='for example "95 mmHg" or "ramp 0 95 mmHg from 0 to 1"')
    parser.add_argument(
        "--voltage", help='for example "step 0 5 kV at 1 until 2" or "pulses 0 5 kV every 0.8 from 0.1 for 0.3"'
    )
    parser.add_argument("--stop", help=f"end of the run for specifications, as in 2min (default: {STOP:g} s)")
    parser.add_argument(
        "--interval",
        help="time between rows of the table (default: 10 ms, or the rows of a file that has them as close)",
    )
    parser.add_argument("--tolerance", type=float, default=1e-6, help="approximate relative error (default: 1e-6)")
    values = "; ".join(f"{p.quantity.name} = {shown(p.quantity)}" for p in tubular_dea().parameters)
    parser.add_argument(
        "--set",
        action="extend",
        nargs="+",
        default=[],
        metavar="NAME=VALUE[UNIT]",
        help=f"change a parameter; of the tube these are {values}",
    )
    parser.add_argument("--out", type=Path, default=Path("run"), help="folder to write to (default: run)")


def run(options: argparse.Namespace) -> None:
    """Simulate and write response.csv and response.png."""
    _check_together(options)
    _check_kept(options)
    try:
        response = _response(options, _given(options))
    except MissingError as problem:
        name, own = problem.argument, problem.argument in OPTIONS
        example = f'--{name} "{problem.example}"' if own else f'--input "{name}={problem.example}"'
        raise UserError(f"{'--' if own else ''}{name}{problem.text}, as in {example}") from None
    for remark in response.remarks:  # only a warning: a small signal may be intended
        print(f"warning: {remark}", file=sys.stderr)
    print(f"wrote {' and '.join(map(str, response.report(options.out)))}")
    for line in response.lines():
        print(line)


def _check_together(options: argparse.Namespace) -> None:
    """`UserError` for a file of inputs beside what it holds itself."""
    for name in (*OPTIONS, "input", "stop"):
        if options.inputs is not None and getattr(options, name) not in (None, []):
            raise UserError(
                f"--inputs and --{name} exclude each other: the file has all inputs, and the times; give one of the two"
            )


def _check_kept(options: argparse.Namespace) -> None:
    """`UserError` where the table would be written over the file of inputs."""
    written = options.out / "response.csv"
    if options.inputs is not None and written.exists() and options.inputs.exists() and written.samefile(options.inputs):
        raise UserError(f"--out {options.out}: {written} is the file of inputs; expected another folder")


def _given(options: argparse.Namespace) -> dict[str, str]:
    """The specifications by input; `UserError` for an input that is given twice."""
    given = {name: getattr(options, name) for name in OPTIONS if getattr(options, name) is not None}
    for text in options.input:
        name, _, specification = (part.strip() for part in text.partition("="))
        if name in given:
            also = f"--{name}" if getattr(options, name, None) is not None else f"another --input {name}=..."
            raise UserError(f"--input {text} and {also} give the same input; give it once")
        given[name] = specification
    return given


def _response(options: argparse.Namespace, given: dict[str, str]) -> td.SimulationResult:
    return td.simulate(
        options.model or td.load_plant(options.plant),
        options.inputs or given,
        stop=options.stop,
        interval=options.interval,
        parameters=settings(options.set, "parameters"),
        tolerance=options.tolerance,
        plant=options.plant,
        columns=options.columns,
    )
