"""What sweeps cost: against LSODA and CVODE, over cores, over points, over Dask, and of assisted beats.

    python tests/benchmarks/sweep.py                 # everything, some minutes
    python tests/benchmarks/sweep.py peers beats     # some of: peers cores points dask beats

`peers`: the protocols of `peers.py` (steps, ramps, the snap-through, the paper's pre-stretched step), solved one after
another by LSODA and CVODE and all at once by the batch kernel on one core; each at the tolerance at which its largest
error in lambda_2 over the protocol is 1e-5. The rows of a batch differ a little in pressure, so that none is a copy.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import subprocess
import sys
import tempfile
from collections.abc import Callable
from functools import partial
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
import psutil

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import peers
from peers import tube
from tubular_dea.kernel import Kernel
from tubular_dea.kernel.batch import Batch, Breakpoints, Probe
from tubular_dea.model.dea import tubular_dea
from tubular_dea.protocol import Protocol
from tubular_dea.sweep.backends import Cluster, Threads, backend
from tubular_dea.sweep.plan import Plan, make_plan, read_plan
from tubular_dea.sweep.run import carry_out

ERROR = 1e-5
Seconds = tuple[float, float]  # on the clock, and of the processors
CASES = ("prestretched_4kV", "step_4kV", "step_6kV", "ramp_4kV", "ramp_7kV_snap_through")
ROWS = 256  # a call of a few ms: short enough to be timed on a busy machine
TOLERANCES = [10.0 ** -(k / 4) for k in range(8, 22)]


def best(run: Callable[[], object], repeats: int = 5) -> float:
    """The shortest of some runs [s]."""
    return peers.best_seconds(run, repeats)


def against_peers() -> dict[str, object]:
    """Trajectories a second of LSODA, CVODE and the batch kernel, over the protocols and over all of them."""
    seconds: dict[str, dict[str, float]] = {}
    batch, kernel = Batch(tubular_dea(), [Probe("final", "lambda_2")]), Kernel(tubular_dea())
    print(f"{'us a trajectory':24}{'LSODA':>10}{'CVODE':>10}{'batch':>10}{'/LSODA':>10}{'/CVODE':>10}")
    for name in CASES:
        protocol, times = peers.experiment(name)
        reference = tube.trajectory(protocol, times, x0=peers.start_of(protocol))["lambda_2"]
        row = {n: _peer(solve, protocol, times, reference) for n, solve in peers.PEERS.items()}
        row["batch"] = _batch(batch, kernel, protocol, times, reference)
        seconds[name] = row
        _line(name, *row.values())
    total = [sum(s[n] for s in seconds.values()) for n in ("SciPy LSODA", "CVODE in C", "batch")]
    _line("all of them", *total)
    return {"seconds": seconds, "over LSODA": total[0] / total[2], "over CVODE": total[1] / total[2]}


def _line(name: str, lsoda: float, cvode: float, batch: float) -> None:
    numbers = (1e6 * lsoda, 1e6 * cvode, 1e6 * batch, lsoda / batch, cvode / batch)
    print(f"{name:24}" + "".join(f"{n:10.1f}" for n in numbers), flush=True)


def _peer(solve: peers.Solve, protocol: tube.Protocol, times: np.ndarray, reference: np.ndarray) -> float:
    """Seconds for the final lambda_2 at the tolerance that keeps the whole trajectory within ERROR."""
    points = []
    for rtol in TOLERANCES:
        error = float(np.abs(solve(protocol, times, rtol) - reference).max())
        points.append((error, best(lambda rtol=rtol: solve(protocol, times[-1:], rtol), 3)))
    return _cheapest(points)


def _cheapest(points: list[tuple[float, float]]) -> float:
    """Seconds of the cheapest point within ERROR."""
    return min(seconds for error, seconds in points if error <= ERROR)


def _batch(batch: Batch, kernel: Kernel, protocol: tube.Protocol, times: np.ndarray, reference: np.ndarray) -> float:
    """Seconds a row of the batch kernel at the same error; the scalar kernel, same method, tells the error."""
    inputs, start = _breakpoints(protocol), {"lambda_2_start": float(peers.start_of(protocol)[0])}
    given = Protocol.of(protocol["time"], pressure=protocol["pressure"], voltage=protocol["voltage"])
    points = []
    for tolerance in TOLERANCES:
        dense = kernel.simulate(given, times, start, tolerance)["lambda_2"]
        error = float(np.abs(dense - reference).max())
        if error <= ERROR:
            seconds = best(lambda t=tolerance: batch.trajectories(ROWS, start, inputs, protocol["time"][-1], t), 25)
            points.append((error, seconds / ROWS))
        if len(points) == 3:
            break
    return _cheapest(points)


def _breakpoints(protocol: tube.Protocol) -> dict[str, Breakpoints]:
    spread = 1 + 0.01 * np.linspace(-1, 1, ROWS)[:, None]
    time = np.array([protocol["time"]])
    return {
        "pressure": Breakpoints(time, spread * np.array([protocol["pressure"]])),
        "voltage": Breakpoints(time, np.array([protocol["voltage"]])),
    }


def steps(points: int, kind: str = "random") -> Plan:
    """Voltage steps of a pre-stretched tube, 15 s each."""
    return make_plan(
        {
            "name": f"{points} steps",
            "outputs": ["final radial_displacement", "final electric_field"],
            "design": {"kind": kind, "points": points},
            "run": {"stop": "15 s", "tolerance": 1e-4},
            "set": {"lambda_2_start": 1.188},
            "inputs": {"pressure": "{level}", "voltage": "step 0 {amplitude} at 1 until 11"},
            "vary": {"level": {"from": "80 mmHg", "to": "100 mmHg"}, "amplitude": {"from": "0 kV", "to": "5 kV"}},
        }
    )


def rest(points: int) -> Plan:
    """Rest states over pressure and thickness."""
    return make_plan(
        {
            "name": f"{points} rest states",
            "study": "rest",
            "outputs": ["radial_displacement", "snap_through_margin"],
            "design": {"kind": "random", "points": points},
            "set": {},
            "inputs": {"voltage": "4 kV"},
            "vary": {"pressure": {"from": "0 mmHg", "to": "120 mmHg"}, "h_o": {"from": "0.9 mm", "to": "1.1 mm"}},
        }
    )


def mixed(points: int) -> Plan:
    """Protocols like those of CASES and between them: pressure and voltage raised at any speed, up to snap-through."""
    return make_plan(
        {
            "name": f"{points} protocols",
            "outputs": ["final lambda_2", "final electric_field"],
            "design": {"kind": "random", "points": points},
            "run": {"stop": "16 s", "tolerance": 1e-5},
            "inputs": {
                "pressure": "ramp 0 {level} from 0 to {rise}",
                "voltage": "ramp 0 {amplitude} from {on} to {on + slope}",
            },
            "vary": {
                "level": {"from": "80 mmHg", "to": "122 mmHg"},
                "rise": {"from": "1 s", "to": "13 s"},
                "amplitude": {"from": "4 kV", "to": "7 kV"},
                "on": {"from": "1 s", "to": "4 s"},
                "slope": {"from": "1 ms", "to": "6 s"},
            },
        }
    )


def over_cores(points: int = 100_000) -> dict[str, object]:
    """Rows a second of whole sweeps, Parquet written, on one processor and on two."""
    if not hasattr(os, "sched_setaffinity"):
        raise SystemExit("cores: this system cannot keep a process on one processor")
    processors = sorted(os.sched_getaffinity(0))[:2]
    plan = mixed(points)
    found = _interleaved({n: partial(_pinned, processors[:n], plan) for n in (1, 2)})
    (one_, work), (two, work_of_two) = found.values()
    print(
        f"cores: {plan.name}: {points / one_:.0f} rows/s on one, {points / two:.0f} on two: {one_ / two:.2f} times; "
        f"by processor time {2 * work / work_of_two:.2f}",
        flush=True,
    )
    return {"seconds": found, "ratio": one_ / two}


def _pinned(processors: list[int], plan: Plan) -> Seconds:
    """A sweep on these processors, a thread each."""
    before = os.sched_getaffinity(0)
    os.sched_setaffinity(0, processors)  # threads begun from here on inherit it
    try:
        return _sweep(Threads(len(processors)), plan)
    finally:
        os.sched_setaffinity(0, before)


def _interleaved(runs: dict[Any, Callable[[], Seconds]], rounds: int = 9) -> dict[Any, Seconds]:
    """The fewest seconds of each run, taken in turns: what else the machine does then disturbs all of them alike."""
    found = [{name: run() for name, run in runs.items()} for _ in range(rounds)]
    return {name: (min(r[name][0] for r in found), min(r[name][1] for r in found)) for name in runs}


def _sweep(workers: Threads | Cluster, plan: Plan) -> Seconds:
    """A whole sweep into an empty folder."""
    with tempfile.TemporaryDirectory() as folder:
        before = _processor_seconds()
        seconds = _timed(lambda: carry_out(plan, Path(folder) / "out", workers))
        return seconds, _processor_seconds() - before


def _processor_seconds() -> float:
    """What this process and those it has started have used of the processors."""
    mine = psutil.Process()
    return sum(sum(p.cpu_times()[:2]) for p in [mine, *mine.children(recursive=True)])


def _timed(run: Callable[[], object]) -> float:
    begin = perf_counter()
    run()
    return perf_counter() - begin


def over_points() -> dict[str, object]:
    """Seconds and resident memory of whole sweeps, each in a process of its own; Parquet written."""
    found: dict[str, object] = {}
    for kind in ("rest", "steps"):
        for points in (100, 1000, 10_000, 100_000, 1_000_000):
            command = [sys.executable, __file__, "one", "--kind", kind, "--points", str(points)]
            text = subprocess.run(command, capture_output=True, text=True, check=True).stdout
            seconds, memory = json.loads(text.strip().splitlines()[-1])
            found[f"{kind} {points}"] = (seconds, memory)
            each = 1e6 * seconds / points
            print(f"points: {points:8d} {kind:6}{seconds:9.3f} s{each:9.2f} us/row{memory:7.0f} MB", flush=True)
    return found


def one(kind: str, points: int) -> None:
    """One sweep in this process: prints seconds (without compiling) and the largest resident memory [MB]."""
    plan = rest(points) if kind == "rest" else steps(points)
    with tempfile.TemporaryDirectory() as folder:
        carry_out(rest(64) if kind == "rest" else steps(64), Path(folder) / "warm")
        seconds = _timed(lambda: carry_out(plan, Path(folder) / "out"))
    print(json.dumps([seconds, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024]))


def over_dask(points: int = 100_000) -> dict[str, object]:
    """The same whole sweeps by two threads and by two Dask worker processes that are up already."""
    found = {}
    with backend(None, 2, None) as cluster:
        for plan, rounds in ((mixed(points), 9), (steps(points), 9), (_beats(points // 64), 3)):
            _sweep(cluster, plan)  # compiled in both workers
            runs = {"threads": partial(_sweep, Threads(2), plan), "dask": partial(_sweep, cluster, plan)}
            seconds = _interleaved(runs, rounds)
            overhead, work = (seconds["dask"][i] / seconds["threads"][i] - 1 for i in (0, 1))
            (in_threads, _), (on_dask, _) = seconds.values()
            print(
                f"dask: {plan.name}: {in_threads:.3f} s in threads, {on_dask:.3f} s on Dask: "
                f"{100 * overhead:+.1f} %; processor time {100 * work:+.1f} %",
                flush=True,
            )
            found[plan.name] = seconds | {"overhead": overhead}
    return found


def _beats(rows: int) -> Plan:
    """The plan of the example, with as many rows of 16 beats."""
    import tomllib

    path = Path(__file__).resolve().parents[2] / "cosim_examples" / "sweep_assist.toml"
    content = tomllib.loads(path.read_text(encoding="utf-8"))
    content |= {"name": f"{rows} x 16 assisted beats", "design": {"kind": "random", "points": rows}}
    assert read_plan(path).design.rows > 0
    return make_plan(content, path.parent)


def assisted_beats() -> dict[str, object]:
    """Seconds for 100 000 assisted beats at the default tolerance, on two threads."""
    plan = _beats(6250)
    _sweep(Threads(2), _beats(64))  # compiled
    seconds, _ = _sweep(Threads(2), plan)
    print(f"beats: 100 000 assisted beats in {seconds:.1f} s on two threads")
    return {"seconds": seconds}


BENCHMARKS: dict[str, Callable[[], dict[str, object]]] = {
    "peers": against_peers,
    "cores": over_cores,
    "points": over_points,
    "dask": over_dask,
    "beats": assisted_beats,
}


def main() -> None:
    """Run what is asked for."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", nargs="*", help=f"some of {', '.join(BENCHMARKS)} (default: all)")
    parser.add_argument("--kind", default="rest", help=argparse.SUPPRESS)
    parser.add_argument("--points", type=int, default=100, help=argparse.SUPPRESS)
    parser.add_argument("--json", type=Path, help="write all numbers to this file")
    options = parser.parse_args()
    if options.what == ["one"]:
        one(options.kind, options.points)
        return
    unknown = [name for name in options.what if name not in BENCHMARKS]
    if unknown:
        parser.error(f"expected some of {', '.join(BENCHMARKS)} but was given {unknown[0]}")
    found = {name: BENCHMARKS[name]() for name in options.what or BENCHMARKS}
    if options.json:
        options.json.write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
