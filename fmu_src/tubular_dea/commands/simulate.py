"""Drive the tube with pressure and voltage, and write its response as a table (CSV) and a picture (PNG).

Inputs are short specifications, or a CSV file whose header names quantity and unit:
  time [s],pressure [mmHg],voltage [kV]
A time listed twice is a jump; between rows the inputs run straight.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import numpy as np

from .. import tabular
from ..emit.tables import shown
from ..errors import UserError
from ..files import write_atomically
from ..identify.bench import TUBE
from ..identify.checks import mislabelled
from ..kernel import Kernel, Trajectory
from ..model.dea import tubular_dea
from ..model.declare import Model
from ..model.units import factor
from ..protocol import Protocol, from_specifications, read_csv
from .settings import parameter_values

EXAMPLE = """example:
  tubular-dea simulate --pressure "ramp 0 95 mmHg from 0 to 1" --voltage "step 0 5 kV at 2 until 3" --stop 4 --out run
  tubular-dea simulate --inputs bench.csv --set C_1=340kPa --out run"""
STOP = 5.0  # s
UNITS = {"pressure": "Pa", "voltage": "V"}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options of `tubular-dea simulate`; parameters are listed from the declaration."""
    parser.add_argument("--inputs", type=Path, help="CSV file with time, pressure and voltage")
    parser.add_argument("--pressure", help='for example "95 mmHg" or "ramp 0 95 mmHg from 0 to 1"')
    parser.add_argument("--voltage", help='for example "0 V" or "step 0 5 kV at 1 until 2"')
    parser.add_argument("--stop", type=float, help=f"end of the run [s] for specifications (default: {STOP:g})")
    parser.add_argument("--interval", type=float, default=0.01, help="time between rows of the table [s]")
    parser.add_argument("--tolerance", type=float, default=1e-6, help="error in lambda_2, about (default: 1e-6)")
    values = "; ".join(f"{p.quantity.name} = {shown(p.quantity)}" for p in tubular_dea().parameters)
    parser.add_argument(
        "--set", action="append", default=[], metavar="NAME=VALUE[UNIT]", help=f"change a parameter: {values}"
    )
    parser.add_argument("--out", type=Path, default=Path("run"), help="folder to write to (default: run)")


def run(options: argparse.Namespace) -> None:
    """Simulate and write response.csv and response.png."""
    model = tubular_dea()
    protocol = _protocol(options)
    parameters = parameter_values(model, options.set)
    times = _times(protocol, options.interval)
    if not 1e-12 <= options.tolerance <= 1e-2:
        raise UserError(f"--tolerance: expected 1e-12 to 1e-2 but was given {options.tolerance:g}")
    response = Kernel(model).simulate(protocol, times, parameters, options.tolerance, with_fold=True)
    table = options.out / "response.csv"
    picture = options.out / "response.png"
    write_atomically(table, _csv(model, response).encode())
    write_atomically(picture, _png(response))
    print(f"wrote {table} and {picture}")
    print(
        f"largest displacement {1e3 * response['radial_displacement'].max():.3f} mm, "
        f"largest field {1e-6 * np.abs(response['electric_field']).max():.1f} V/um, "
        f"smallest margin to snap-through {response['snap_through_margin'].min() / factor('mmHg', 'Pa'):.1f} mmHg"
    )
    beyond = response["snap_through_margin"] < 0
    if beyond.any():
        at = response.time[beyond][0]
        print(f"the pressure passes the snap-through fold at {at:.3g} s: the tube runs away there")


def _protocol(options: argparse.Namespace) -> Protocol:
    given = {name: getattr(options, name) for name in UNITS if getattr(options, name) is not None}
    if options.inputs is not None:
        if given or options.stop is not None:
            other = next(iter(given), "stop")
            raise UserError(f"--inputs and --{other} exclude each other; give one of them")
        protocol = read_csv(options.inputs, UNITS)
        for signal in TUBE.inputs:  # a warning alone: a small signal may be meant
            problem = mislabelled(protocol.inputs[signal.name], signal)
            if problem:
                print(f"warning: {options.inputs}: column {signal.name!r}: {problem}", file=sys.stderr)
        return protocol
    missing = [name for name in UNITS if name not in given]
    if missing:
        raise UserError(f"expected --inputs FILE, or --pressure and --voltage; --{missing[0]} is missing")
    return from_specifications(given, UNITS, STOP if options.stop is None else options.stop)


def _times(protocol: Protocol, interval: float) -> np.ndarray:
    start, stop = protocol.time[0], protocol.time[-1]
    if not (np.isfinite(interval) and 0 < interval <= stop - start):
        raise UserError(f"--interval: expected more than 0 and at most {stop - start:g} s but was given {interval:g}")
    rows = (stop - start) / interval
    if rows > 1e7:
        raise UserError(f"--interval: {interval:g} s makes {rows:.3g} rows; expected at most 1e7")
    grid = start + interval * np.arange(int(np.floor(rows + 1e-9)) + 1)
    return np.minimum(grid, stop)


def _csv(model: Model, response: Trajectory) -> str:
    inputs = [q.name for q in model.inputs]
    names = [*inputs, *(name for name in response.values if name not in inputs)]
    columns = {name: response[name] for name in names}
    return tabular.text(response.time, columns, {name: model.quantity(name).unit for name in names})


def _png(response: Trajectory) -> bytes:
    from ..report.figures import time_panels

    return time_panels(
        response.time,
        [
            ("pressure [mmHg]", {"": response["pressure"] / factor("mmHg", "Pa")}),
            ("voltage [kV]", {"": response["voltage"] / 1e3}),
            ("displacement [mm]", {"": response["radial_displacement"] * 1e3}),
            ("field [V/um]", {"": response["electric_field"] / 1e6}),
        ],
    )
