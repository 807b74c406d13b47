"""Blind trials of the loop on the aorta: `python -m blind.aorta` from `tests/` counts what is found, by effect.

The generator knows nothing of the package: beats of a drawn shape, a windkessel integrated by Runge and Kutta in steps
of half a millisecond, one effect (or none) in a form of its own, waves of the arteries as noise of 20 to 80 ms, and a
pressure sensor. `write` makes folders of CSV files; the package sees those alone.
"""

from __future__ import annotations

import argparse
import tempfile
from collections import Counter
from pathlib import Path

import numpy as np

STEP, EVERY = 0.5e-3, 10  # s of the integration, and steps to a sample (200 Hz)
EFFECTS = {  # id: the range its parameter is drawn from; mmHg, mL, s
    "flow_delay": (0.02, 0.05), "pressure_delay": (0.02, 0.05), "inertance": (2e-3, 5e-3),
    "parallel_inertance": (3.0, 12.0), "outflow_pressure": (20.0, 60.0), "sensor_lag": (0.03, 0.08),
}  # fmt: skip


def write(folder: Path, seed: int, effect: str = "none", records: int = 2, waves: float = 0.15) -> float:
    """Records of one heart; returns the effect's parameter. `waves`: what no windkessel explains, over the pulse."""
    random = np.random.default_rng([seed, sorted([*EFFECTS, "none"]).index(effect)])
    size = float(random.uniform(*EFFECTS.get(effect, (0.0, 0.0))))
    values = {"R": random.uniform(0.8, 3.5), "C": random.uniform(0.8, 1.6), "Z_c": random.uniform(0.04, 0.1)}
    period, height = random.uniform(0.6, 1.0), random.uniform(60, 110) / values["R"]
    memory = random.uniform(0.02, 0.08)
    folder.mkdir(parents=True, exist_ok=True)
    for number in range(records):
        t = np.arange(round(4.4 / STEP)) * STEP
        flow = height * _beats(t, period, random)
        pressure, probed = _probes(t, flow, values, effect, size)
        table = np.column_stack([t, probed, pressure])[::EVERY]
        noise = _coloured(table.shape[0], STEP * EVERY, memory, random)
        table[:, 2] += waves * table[:, 2].std() * noise + 0.06 * random.standard_normal(noise.size)
        table[:, 1] = table[:, 1] * 0.06 + 0.02 * random.standard_normal(noise.size)
        np.savetxt(folder / f"record{number + 1}.csv", table, delimiter=",", fmt="%.5g", comments="",
                   header="time [s],flow [L/min],pressure [mmHg]")  # fmt: skip
    return size


def _beats(t: np.ndarray, period: float, random: np.random.Generator) -> np.ndarray:
    """Ejections of 38 % of a beat with a notch of backflow; beats differ in length and height; mean about 1."""
    starts = np.cumsum(period * (1 + 0.05 * random.standard_normal(40))) - 2 * period
    found = np.zeros(t.size)
    for start in starts:
        x = (t - start) / (0.38 * period)
        tall = 4.2 * (1 + 0.08 * random.standard_normal())
        found += tall * np.where((x > 0) & (x < 1), np.sin(np.pi * np.clip(x, 0, 1) ** 0.8), 0.0)
        found -= 0.12 * tall * np.exp(-(((x - 1.06) / 0.05) ** 2))
    return found


def _probes(
    t: np.ndarray, flow: np.ndarray, v: dict[str, float], effect: str, size: float
) -> tuple[np.ndarray, np.ndarray]:
    """What the probes of pressure [mmHg] and flow [mL/s] report."""
    out = size if effect == "outflow_pressure" else 0.0

    def stored(p: float, q: float) -> float:
        return (q - (p - out) / v["R"]) / v["C"]

    p = np.empty(t.size)
    p[0] = out + v["R"] * flow.mean() * 0.95
    for i in range(t.size - 1):
        middle = 0.5 * (flow[i] + flow[i + 1])
        k1 = stored(p[i], flow[i])
        k2 = stored(p[i] + STEP / 2 * k1, middle)
        k3 = stored(p[i] + STEP / 2 * k2, middle)
        k4 = stored(p[i] + STEP * k3, flow[i + 1])
        p[i + 1] = p[i] + STEP / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
    through = flow
    if effect == "parallel_inertance":  # size: Z_c over the inertance
        gone = _follow(flow, STEP * size, flow.mean())
        through = flow - gone
    pressure = p + v["Z_c"] * through
    if effect == "inertance":
        pressure = pressure + size * np.gradient(flow, t)
    if effect == "sensor_lag":
        pressure = _follow(pressure, STEP / size, pressure[0])
    late = round(size / STEP)
    if effect == "pressure_delay":
        pressure = np.concatenate([np.full(late, pressure[0]), pressure])[: t.size]
    if effect == "flow_delay":
        flow = np.concatenate([np.full(late, flow[0]), flow])[: t.size]
    return pressure, flow


def _follow(signal: np.ndarray, share: float, start: float) -> np.ndarray:
    """A first-order lag in steps: `share` of what is missing each."""
    found = np.empty(signal.size)
    now = start
    for i, target in enumerate(signal):
        now += share * (target - now)
        found[i] = now
    return found


def _coloured(n: int, step: float, memory: float, random: np.random.Generator) -> np.ndarray:
    """Noise of unit rms that oscillates and forgets within about `memory` [s], as reflections do."""
    found = np.zeros(n + 200)
    keep, turn = np.exp(-step / memory), np.cos(2 * np.pi * step * 4.0)
    for i in range(2, found.size):
        found[i] = 2 * keep * turn * found[i - 1] - keep**2 * found[i - 2] + random.standard_normal()
    return found[200:] / found.std()


def trial(seed: int, effect: str, records: int = 2, waves: float = 0.15) -> tuple[str, str, bool]:
    """The verdict, what is named with its equivalents, and whether the parameter's 95 % interval has the truth."""
    from tubular_dea.discover.aorta import outcome
    from tubular_dea.discover.aorta.records import records as read
    from tubular_dea.discover.aorta.search import search
    from tubular_dea.identify.bench import AORTA
    from tubular_dea.identify.data import read_folder

    with tempfile.TemporaryDirectory() as place:
        size = write(Path(place) / "data", seed, effect, records, waves)
        result = outcome.result(search(read(read_folder(Path(place) / "data", AORTA))))
    found = [e["id"] + "".join(f"/{i}" for i in e["equivalent"]) for e in result["effects"]]
    covered = False
    if result["effects"] and result["effects"][0]["id"] == effect:
        low, high = next(iter(result["effects"][0]["parameters"].values()))["ci95"]
        scale = {"inertance": 133.322e6, "outflow_pressure": 133.322}.get(effect, 1.0)
        covered = low <= size * scale <= high
    return result["verdict"], " + ".join(found), covered


def main() -> None:
    """Run trials and print one line an effect."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--trials", type=int, default=20, help="of each effect")
    parser.add_argument("--nulls", type=int, default=300)
    parser.add_argument("--records", type=int, default=2, help="of one heart in each trial")
    parser.add_argument("--waves", type=float, default=0.15, help="what no windkessel explains, over the pulse's rms")
    options = parser.parse_args()
    for effect, count in {"none": options.nulls, **dict.fromkeys(EFFECTS, options.trials)}.items():
        done = [trial(seed, effect, options.records, options.waves) for seed in range(count)]
        named = Counter(found or "nothing" for _, found, _ in done)
        first = [found for _, found, _ in done if found.split("/")[0].split(" ")[0] == effect]
        covered = sum(c for _, _, c in done)
        intervals = f"; interval holds {covered} of {len(first)}" if first else ""
        print(f"{effect:20s} {dict(named.most_common(4))}{intervals}", flush=True)


if __name__ == "__main__":
    main()
