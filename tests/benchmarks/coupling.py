"""What the coupling costs, and what it is worth: run it as a script.

    python tests/benchmarks/coupling.py

Prints seconds for ten assisted beats at 1 ms through FMPy-loaded native FMUs, explicit and implicit; the ratio to the
same loop of tube and heart with pythonfmu slaves; errors and energy gaps against the monolithic solution over the step,
with the orders they show; and the variable step.
"""

from __future__ import annotations

import sys
import tempfile
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from coupled import CASES, PERIOD, case, driven_tube, pulses, reference, slaves, stretch, tube_work
from told import parser
from tubular_dea.cosim.heart_assist import heart_assist
from tubular_dea.cosim.master import Options, Run, Simulation
from tubular_dea.cosim.system import System
from tubular_dea.export.python_fmu import python_fmu
from tubular_dea.model.dea import tubular_dea
from tubular_dea.model.windkessel import aortic_windkessel, patient

BEATS = 3
PLAIN = {"cubic": False, "restart": 1.0, "refine": 0.0, "slave_tolerance": 1e-8, "tolerance": 1e-7}


def seconds(system: System, stop: float, options: Options, repeat: int = 3) -> tuple[float, float, Run]:
    """Least seconds of the run, and of loading and initialising; the last run."""
    run_times, load_times = [], []
    for _ in range(repeat):
        begin = time.perf_counter()
        with Simulation(system, 0.0, stop, options) as simulation:
            ready = time.perf_counter()
            run = simulation.run().completed()
            run_times.append(time.perf_counter() - ready)
        load_times.append(ready - begin)
    return min(run_times), min(load_times), run


def timings() -> None:
    """Ten assisted beats."""
    print("ten assisted beats (failing heart, three native FMUs) at 1 ms:")
    system = heart_assist(slaves(), patient("failing"))
    for scheme, order in (("jacobi", 0), ("gauss-seidel", 1), ("implicit", 0)):
        run_time, load_time, run = seconds(system, 10 * PERIOD, Options(scheme, order=order))
        print(
            f"  {scheme:13} {run_time:.3f} s  "
            f"(loading {load_time:.3f} s, {run.iterations[1:].mean():.2f} iterations a step)"
        )


def against_python(beats: int = 2) -> None:
    """Tube and heart alone, so that both can be Python; the scheduler is native only."""
    values, drive = patient("failing"), pulses(beats, 5500.0)
    start = {"tube.lambda_2_start": stretch(values["aortic_pressure_start"]), "tube.start_at_equilibrium": 0.0}
    with tempfile.TemporaryDirectory() as folder:
        python = {
            "tube": python_fmu(tubular_dea(), Path(folder) / "TubularDEA.fmu"),
            "heart": python_fmu(aortic_windkessel(), Path(folder) / "AorticWindkessel.fmu"),
        }
        for scheme in ("jacobi", "implicit"):
            times = []
            for parts in (slaves(), python):
                system = driven_tube(parts, values, drive, start)
                times.append(seconds(system, beats * PERIOD, Options(scheme), 1)[0])
            print(
                f"  {scheme:13} native {times[0]:.3f} s, pythonfmu {times[1]:.3f} s: "
                f"{times[1] / times[0]:.0f} times as long"
            )


def coupled(name: str, how: Mapping[str, Any]) -> tuple[Run, float, float]:
    """A run, its error over the pressure's amplitude, and its energy gap."""
    values = case(name)
    start = {"tube.lambda_2_start": stretch(values["aortic_pressure_start"]), "tube.start_at_equilibrium": 0.0}
    drive = pulses(BEATS, 6000.0)
    system = driven_tube(slaves(), values, drive, start)
    with Simulation(system, 0.0, BEATS * PERIOD, Options(**how)) as simulation:
        run = simulation.run()
    if run.reason:
        return run, np.nan, np.nan
    expected = reference(values, drive, run.time)["heart_aortic_pressure"]
    given, received = tube_work(run)
    error = np.abs(run["heart.aortic_pressure"] - expected).max() / np.ptp(expected)
    return run, float(error), abs(given - received) / max(abs(given), abs(received))


def orders() -> None:
    """Error and energy gap over the step, straight interpolation; then the default."""
    steps = (4e-3, 2e-3, 1e-3, 5e-4)
    for name in CASES:
        print(
            f"{name}, 6 kV, smallest margin "
            f"{coupled(name, {})[0]['tube.snap_through_margin'].min() / 133.322:.0f} mmHg; "
            f"steps {steps} s:"
        )
        for scheme, order in (("jacobi", 0), ("jacobi", 1), ("gauss-seidel", 0), ("gauss-seidel", 1), ("implicit", 0)):
            results = [coupled(name, {"scheme": scheme, "order": order, "step": h, **PLAIN}) for h in steps]
            if any(run.reason for run, _, _ in results):
                print(f"  {scheme:13} order {order}: refused at {results[2][0].time[-1]:.3f} s")
                continue
            errors, gaps = ([r[i] for r in results] for i in (1, 2))
            print(f"  {scheme:13} order {order}: error {_list(errors)}; energy gap {_list(gaps)}")
        results = [coupled(name, {"step": h, "slave_tolerance": 1e-8, "tolerance": 1e-7}) for h in steps]
        print(
            f"  {'implicit':13} cubic  : error {_list([r[1] for r in results])}; "
            f"energy gap {_list([r[2] for r in results])}"
        )
        for tolerance in (1e-3, 1e-4, 1e-5):
            run, error, gap = coupled(
                name, {"step": 0.02, "variable": True, "tolerance": tolerance, "slave_tolerance": 1e-8}
            )
            print(
                f"  variable step, tolerance {tolerance:g}: {run.time.size - 1} steps of "
                f"{1e3 * np.diff(run.time).min():.3f} to {1e3 * np.diff(run.time).max():.1f} ms, "
                f"error {error:.1e}, energy gap {gap:.1e}"
            )


def _list(values: list[float]) -> str:
    order = np.log2(values[1] / values[-1]) / 2
    return ", ".join(f"{v:.1e}" for v in values) + f" (order {order:.1f})"


if __name__ == "__main__":
    parser(__doc__).parse_args()
    timings()
    print("the same loop of tube and heart in pythonfmu slaves (two beats):")
    against_python()
    orders()
