"""Fit a patient to a recorded arterial pressure: ventricle and windkessel, with intervals; a file for assist --patient.

Writes the patient (TOML) and a picture of the beat beside it (PNG). Recordings: a table with the columns
time, pressure and optionally flow and ecg (or a headless table of time [s] and pressure [mmHg]), or a WFDB record.
Without a flow, the pressure does not determine the size of the heart: the cardiac output is assumed.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import tubular_dea as td

from ..model.patients import PATIENTS

EXAMPLE = """example:
  tubular-dea patient record.hea --out patient.toml
  tubular-dea patient pressure.csv --flow flow.csv --out patient.toml
  tubular-dea assist --patient patient.toml --optimise --out best"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options of `tubular-dea patient`."""
    parser.add_argument("recording", type=Path, help="a table, or a WFDB record (.hea)")
    parser.add_argument("--flow", type=Path, help="a second table, with the aortic flow over the same time")
    parser.add_argument("--cardiac-output", help="assumed where there is no flow (default: 5 L/min, +- 20 %%)")
    parser.add_argument("--based-on", default="healthy", help=f"for what cannot be identified: {', '.join(PATIENTS)}")
    parser.add_argument("--out", type=Path, default=Path("patient.toml"), help="file to write (default: patient.toml)")


def run(options: argparse.Namespace) -> None:
    """Average, fit, write, print."""
    found = td.fit_patient(
        options.recording, options.flow, cardiac_output=options.cardiac_output, based_on=options.based_on, progress=True
    )
    written = found.report(options.out)
    for line in found.lines():
        print(line)
    print(f"wrote {' and '.join(map(str, written))}")
