"""Peers on the same sets in the same run: `python -m blind.peers --nulls 4 --singles 1 --seed 1000` in tests/.

Beside `close-loop` stand what people do by hand: forward selection by BIC, every candidate of the same catalogue fitted
by SciPy's least squares on the package's compiled kernel; and pysindy on the residual of the refitted base model. Both
are given more than a user has: tables in SI, and whether a file begins at rest. Both thin long records.
"""

from __future__ import annotations

import sys
import tempfile
import time
import warnings
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path

import numpy as np
import pysindy
from scipy.optimize import least_squares
from tqdm import tqdm

from blind import score
from blind.effects import channel
from blind.laboratory import Laboratory, laboratory
from blind.recordings import recorded
from blind.trials import Trial, trial
from tubular_dea.kernel import Kernel, KernelError
from tubular_dea.model.dea import tubular_dea
from tubular_dea.plants.effects import catalogue, with_effects
from tubular_dea.protocol import Protocol

NAMES = ("C_1", "C_2", "C_3", "eps_r", "eta_o", "k_1", "eta_1", "k_2", "eta_2")
POINTS = 2000  # of a file, at most
MOST = 3  # effects
LITTLE = 0.2  # of its typical size: where a candidate's fit begins
ROUNDS, LAST_ROUNDS = 6, 20  # of the least squares: of a candidate, and of the one that is chosen
UNIT = 1e-5  # m: residuals of about 1, as SciPy's criteria expect
OPEN = 0.5e-3  # m: below, the tube rings undamped, and least squares end anywhere
PRESSED = 2500.0  # Pa: a file that begins above it begins loaded
THRESHOLDS = np.geomspace(3e3, 0.3, 9)  # of pysindy's STLSQ: from no term to all
GAIN = 1e-3  # on the held-out file's rates: a denser model is taken from here on


@dataclass
class Record:
    """A file as the peers have it."""

    protocol: Protocol
    times: np.ndarray
    displacement: np.ndarray
    start: dict[str, float]


@dataclass
class Answer:
    """What a peer says, and how long it took."""

    names: list[str] = field(default_factory=list)
    channels: list[str] = field(default_factory=list)
    seconds: float = 0.0


def records(lab: Laboratory) -> list[Record]:
    """The set's tables, thinned."""
    geometry = dict(lab.conventions.geometry)
    found = []
    for number in range(len(lab.files)):
        columns, _ = recorded(lab, number)
        good = np.isfinite(columns["radius"])
        thin = max(1, int(np.ceil(good.sum() / POINTS)))
        t, p, v, r = (columns[n][good][::thin] for n in ("time", "pressure", "voltage", "radius"))
        start = {"start_at_equilibrium": 1.0} if p[0] > PRESSED else {}
        moved = r if lab.conventions.displacement else r - geometry["r_o"]
        found.append(Record(Protocol(t, {"pressure": p, "voltage": v}), t, moved, geometry | start))
    return found


@cache
def kernel(ids: tuple[str, ...]) -> Kernel:
    """The tube with effects, compiled."""
    return Kernel(with_effects(tubular_dea(), ids))


@dataclass
class Fit:
    """A least-squares fit of the nine parameters and the effects' own."""

    ids: tuple[str, ...]
    values: dict[str, float]
    residual: np.ndarray

    @property
    def bic(self) -> float:
        """Bayes' criterion for white noise of unknown size."""
        n = self.residual.size
        return float(n * np.log(np.mean(self.residual**2)) + len(self.values) * np.log(n))


def fitted(data: Sequence[Record], ids: tuple[str, ...], start: dict[str, float], rounds: int) -> Fit:
    """SciPy's least squares from `start`, with the kernel's own derivatives."""
    run, names = kernel(ids), list(start)
    size = np.array([abs(v) if v else 1.0 for v in start.values()])

    def whole(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        values = dict(zip(names, (x * size).tolist(), strict=True))
        residuals, slopes = [], []
        for r in data:
            try:
                found = run.simulate(r.protocol, r.times, values | r.start, 1e-5, sensitivities=names)
            except KernelError:
                return np.full(total, 1e3), np.zeros((total, len(names)))
            counted = (r.displacement > OPEN) / UNIT
            residuals.append((found["measured_displacement"] - r.displacement) * counted)
            slopes.append(found.sensitivities["measured_displacement"] * size * counted[:, None])
        return np.concatenate(residuals), np.vstack(slopes)

    total = sum(r.times.size for r in data)
    latest: dict[bytes, tuple[np.ndarray, np.ndarray]] = {}

    def at(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        if x.tobytes() not in latest:
            latest.clear()
            latest[x.tobytes()] = whole(x)
        return latest[x.tobytes()]

    first = np.array(list(start.values())) / size
    allowed = {n: (run.model.quantity(n).minimum, run.model.quantity(n).maximum) for n in names}
    low, high = (
        np.array([infinite if allowed[n][end] is None else allowed[n][end] for n in names]) / size
        for end, infinite in ((0, -np.inf), (1, np.inf))
    )
    found = least_squares(
        lambda x: at(x)[0], first, jac=lambda x: at(x)[1], bounds=(low, high), x_scale="jac", max_nfev=rounds
    )
    return Fit(ids, dict(zip(names, (found.x * size).tolist(), strict=True)), UNIT * found.fun)


def forward(data: Sequence[Record], base: Fit) -> Answer:
    """Effects of the catalogue, the best one after the other as long as BIC falls."""
    started, best = time.perf_counter(), base
    listed = catalogue()
    while len(best.ids) < MOST:
        tried = []
        for name, effect in listed.items():
            if name in best.ids:
                continue
            tunable = {n: float(effect.typical[n]) for n in effect.shapes}
            tunable |= {n: float(off + LITTLE * (effect.typical[n] - off)) for n, off in effect.off.items()}
            try:
                tried.append(fitted(data, (*best.ids, name), best.values | tunable, ROUNDS))
            except (KernelError, ValueError):  # not to be had from here
                continue
        leader = min(tried, key=lambda fit: fit.bic)
        leader = fitted(data, leader.ids, leader.values, LAST_ROUNDS)
        if leader.bic >= best.bic:
            break
        best = leader
    return Answer(list(best.ids), [listed[n].channel for n in best.ids], time.perf_counter() - started)


def sindy(data: Sequence[Record], base: Fit) -> Answer:
    """Terms that pysindy finds in the residual's rate: of pressure, voltage squared, stretch, and the residual.

    The threshold is the one that predicts the last file's rates best, of models learnt from the others.
    """
    started = time.perf_counter()
    ends = np.cumsum([r.times.size for r in data])[:-1]
    residuals, drives, clocks = [], [], []
    size = base.residual.std()
    for r, left in zip(data, np.split(base.residual, ends), strict=True):
        p, v = (r.protocol.inputs[n] for n in ("pressure", "voltage"))
        residuals.append(left[:, None] / size)
        drives.append(np.column_stack([p / 1e4, (v / 4e3) ** 2, r.displacement / 3e-3]))
        clocks.append(r.times)
    held = len(residuals) - 1  # decides on the threshold, where there is another
    learnt = slice(0, held or 1)
    best, terms = np.inf, []
    for threshold in THRESHOLDS:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # that a threshold leaves no term
            model = pysindy.SINDy(
                optimizer=pysindy.STLSQ(threshold=threshold, normalize_columns=True),
                feature_library=pysindy.PolynomialLibrary(degree=2),
            )
            model.fit(
                residuals[learnt],
                t=clocks[learnt],
                u=drives[learnt],
                feature_names=["residual", "pressure", "voltage", "stretch"],
            )
        rate = pysindy.FiniteDifference()._differentiate(residuals[held], clocks[held])
        missed = float(np.mean((rate - model.predict(residuals[held], u=drives[held])) ** 2))
        if missed <= best * (1 - GAIN):
            names = np.array(model.get_feature_names())
            best, terms = missed, names[np.abs(model.coefficients()[0]) > 0].tolist()
    words = {"pressure": "pressure", "voltage": "electrical", "stretch": "mechanical"}
    channels = [c for word, c in words.items() if any(word in term for term in terms)]
    # a residual that decays by itself is what noise does: only terms of something else are a finding
    return Answer([t for t in terms if t not in ("1", "residual")], channels, time.perf_counter() - started)


def compared(seed: int, kind: str, only: Sequence[str] | None) -> tuple[Trial, Answer, Answer]:
    """Ours and theirs on one set."""
    ours = trial(seed, kind, only, False, Path(tempfile.gettempdir()) / "blind-peers")
    data = records(laboratory(seed, kind, only))
    default = tubular_dea().parameter_values()
    base = fitted(data, (), {n: default[n] for n in NAMES}, LAST_ROUNDS)
    return ours, forward(data, base), sindy(data, base)


def table(rows: list[tuple[Trial, Answer, Answer]]) -> str:
    """A line a method, beside one another."""
    g = {name: {id(t) for t in ts} for name, ts in score.groups(t for t, _, _ in rows).items()}

    def line(what: str, answers: list[tuple[Trial, Sequence[str], Sequence[str], float]]) -> str:
        nulls = [bool(names) for t, names, _, _ in answers if id(t) in g["nulls"]]
        singles = [t.hidden[0] in names for t, names, _, _ in answers if id(t) in g["singles"]]
        extra = [bool(set(names) - {*t.hidden, *t.named}) for t, names, _, _ in answers if id(t) in g["singles"]]
        places = [channel(t.hidden[0]) in channels for t, _, channels, _ in answers if id(t) in g["singles"]]
        pairs = [set(t.hidden) <= set(names) for t, names, _, _ in answers if id(t) in g["pairs"]]
        external = [bool(names) for t, names, _, _ in answers if id(t) in g["external"]]
        seconds = np.median([s for *_, s in answers]) if answers else np.nan
        cells = (nulls, singles, places, extra, pairs, external)
        return f"{what:34s}" + "".join(f"{score.counted(c):>20s}" for c in cells) + f"{seconds:9.0f}"

    heads = ("nulls: named", "single: hit", "its channel", "single: others", "pairs: both", "external: named")
    return "\n".join(
        [
            f"{'':34s}" + "".join(f"{h:>20s}" for h in heads) + f"{'seconds':>9s}",
            line(
                "close-loop",
                [(t, sorted(t.named), [c for c in [score.first_channel(t)] if c], t.seconds) for t, _, _ in rows],
            ),
            line("forward selection by BIC, SciPy", [(t, a.names, a.channels, a.seconds) for t, a, _ in rows]),
            line("pysindy on the residual", [(t, a.names, a.channels, a.seconds) for t, _, a in rows]),
        ]
    )


def main() -> None:
    """Run all three on drawn sets and print the table."""
    options = score.parsed(description=__doc__)
    only = score.conventions_of(options)
    rows = []
    for seed, kind in tqdm(score.planned(options), unit="set"):
        rows.append(compared(seed, kind, only))
        ours, bic, found = rows[-1]
        tqdm.write(
            f"{ours.name}: close-loop {ours.verdict} {ours.found}; BIC {bic.names} ({bic.seconds:.0f} s); "
            f"pysindy {found.names}",
            file=sys.stderr,
        )
    print(table(rows))


if __name__ == "__main__":
    main()
