"""Find the model's parameters from bench recordings: the paper's staged procedure, then all of them jointly.

DATA is a folder of CSV files, one experiment each, starting from a rested tube:
  time [s],pressure [Pa],voltage [V],radius [m]
Written are parameters.json (verdict: adequate, or misfit where more than noise is left; values, standard errors, 95 %
intervals, goodness of fit), model.json (for `tubular-dea build --model`) and fit.png.
"""

from __future__ import annotations

import argparse
import json
import math
from pathlib import Path
from typing import Any

from tqdm import tqdm

from ..errors import UserError
from ..files import write_atomically
from ..identify import procedure
from ..identify.data import read_folder
from ..identify.fit import Fit, goodness, interval, profile_interval, rmse, uncertainty
from ..identify.misfit import misfit
from ..identify.problem import Problem
from ..model.dea import tubular_dea
from ..model.declare import Model

EXAMPLE = """example:
  tubular-dea identify cosim_examples/data/bench --out identified
  tubular-dea identify bench --start table-2 --profile --out identified"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options of `tubular-dea identify`."""
    parser.add_argument("data", type=Path, metavar="DATA", help="folder of CSV files, one experiment each")
    parser.add_argument("--out", type=Path, required=True, help="folder to write to")
    parser.add_argument(
        "--start", choices=("table-2", "table-3"), default="table-3", help="starting values (default: table-3)"
    )
    parser.add_argument(
        "--staged", action="store_true", help="begin with the paper's stages (always done from table-2)"
    )
    parser.add_argument(
        "--free", nargs="+", default=None, metavar="NAME", help="identify these only (default: all nine)"
    )
    parser.add_argument(
        "--starts", type=int, default=3, help="searches of the joint fit, from places around (default: 3)"
    )
    parser.add_argument("--seed", type=int, default=0, help="of the places to start from")
    parser.add_argument("--profile", action="store_true", help="intervals from the profile of the likelihood (minutes)")


def run(options: argparse.Namespace) -> None:
    """Identify, then write all files at the end."""
    for name, value, least in (("starts", options.starts, 1), ("seed", options.seed, 0)):
        if value < least:
            raise UserError(f"--{name}: expected at least {least} but was given {value}")
    model = tubular_dea()
    recordings = read_folder(options.data)
    with tqdm(total=6, unit="step", disable=None) as bar:

        def tell(what: str) -> None:
            bar.set_postfix_str(what)
            bar.update()

        tell("monitors and noise")
        ready = procedure.prepare(recordings, model)
        start = model.parameter_values() | (procedure.TABLE_II if options.start == "table-2" else {})
        if options.staged or options.start == "table-2":
            start = procedure.staged(ready, model, start, tell)
        tell("all parameters jointly")
        problem, best = procedure.joint(ready, model, start, options.starts, options.seed, options.free)
        content = _content(ready, problem, best, options.profile)
    _write(options.out, ready, model, problem, best, content)
    for name, p in content["parameters"].items():
        print(f"{name:8s} {p['value']:.6g} +- {p['stderr']:.2g} {p['unit']}")
    for line in _remarks(content, options):
        print(line)
    print(f"fit {content['fit_percent']:.2f} %, error {content['rmse_m'] * 1e6:.1f} um; wrote {options.out}")


def _remarks(content: dict[str, Any], options: argparse.Namespace) -> list[str]:
    """What has to be known of the values above."""
    remarks = []
    if not content["converged"]:
        remarks.append("the search has not converged: give more --starts, or other starting values with --start")
    if content["undetermined"]:
        remarks.append(f"not determined by these recordings: {', '.join(content['undetermined'])}")
    if content["verdict"] == "misfit":
        mend = (
            "free all parameters (leave out --free)"
            if options.free
            else f"to find what it is, run tubular-dea close-loop {options.data} --out closed"
        )
        remarks.append(
            f"the model lacks something: the misfit is {content['residual_over_noise']:.2f} times the noise of "
            f"{content['noise_floor_m'] * 1e6:.1f} um, so the intervals are too narrow; {mend}"
        )
    return remarks


def _content(ready: procedure.Prepared, problem: Problem, best: Fit, profile: bool) -> dict[str, Any]:
    """What parameters.json says, in SI units."""
    model = ready.kernel.model
    outputs, left = problem.response.outputs(best.values), misfit(problem, best)
    parameters = {}
    for name in best.names:
        ends = profile_interval(problem, best, name) if profile else interval(best, name)
        parameters[name] = {"value": best.values[name], "stderr": best.stderr[name], "unit": model.quantity(name).unit,
                            "ci95": [e if math.isfinite(e) else None for e in ends]}  # fmt: skip
    each = {e.name: {"rmse_m": rmse([r], [y]), "fit_percent": goodness([r], [y])}
            for e, r, y in zip(ready.experiments, problem.records, outputs, strict=True)}  # fmt: skip
    return {
        "verdict": "misfit" if left.significant else "adequate",
        "residual_over_noise": left.ratio, "residual_slow_z": left.slow,
        "parameters": parameters, "undetermined": best.undetermined(), "converged": best.converged,
        "intervals": "profile likelihood" if profile else "covariance",
        "rmse_m": rmse(problem.records, outputs), "fit_percent": goodness(problem.records, outputs),
        "noise_floor_m": ready.noise.rms, "noise_correlation": ready.noise.correlation, "per_experiment": each,
    }  # fmt: skip


def _write(
    out: Path, ready: procedure.Prepared, model: Model, problem: Problem, best: Fit, content: dict[str, Any]
) -> None:
    from ..model.saved import as_json
    from ..report.figures import time_panels

    values = {n: v for n, v in (ready.geometry | best.values).items() if n in model.parameter_values()}
    outputs = problem.response.outputs(best.values)
    longest = max(range(len(outputs)), key=lambda i: float(problem.records[i].max()))
    panels = [("displacement [mm]", {"record": problem.records[longest] * 1e3, "model": outputs[longest] * 1e3}),
              ("residual [um]", {"": (problem.records[longest] - outputs[longest]) * 1e6})]  # fmt: skip
    picture = time_panels(problem.response.cases[longest].times, panels, ready.experiments[longest].name)
    write_atomically(out / "fit.png", picture)
    saved = as_json(model.with_values(values), "identified", uncertainty(best, model))
    write_atomically(out / "model.json", saved.encode())
    write_atomically(out / "parameters.json", (json.dumps(content, indent=2, allow_nan=False) + "\n").encode())
