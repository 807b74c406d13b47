"""Closing the loop on measured aortic flow and pressure: what a windkessel of three elements lacks.

There is no noise floor to reach here: every windkessel leaves a residual that is the arteries' own (waves), far above
the sensors' noise. A candidate is accepted if in every record it takes a tenth of the squared residual away, also
from the last quarter of the record, which takes no part in any fit, and with positive evidence. Evidence counts
independent samples: the residual's correlation is taken into account by its effective number.

Between samples flow and pressure are straight lines, for which the windkessel is solved exactly.
"""

from __future__ import annotations

import dataclasses
import json
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import plotly.graph_objects as go
from scipy.optimize import least_squares
from tqdm import tqdm

from ..export.compile import write_atomically
from ..export.package import native_fmu
from ..identify.bench import AORTA
from ..identify.data import Experiment, read_folder
from ..identify.monitors import noise_level
from ..model.afterload import aortic_afterload
from ..model.patients import ML, MMHG
from ..model.saved import as_json
from ..report.page import Page

HELD_SHARE = 0.25  # of every record, at its end
LEAST_SHARE = 0.1  # of the squared residual that an effect has to take away, in every record
LEAST_EVIDENCE = 2.0  # log evidence in every record
TOLD_APART = 3.0  # log evidence, all records together, by which a rival has to be worse
PRESSURE, FLOW = MMHG, ML  # units the fits work in: mmHg and mL/s
SI = {"R": PRESSURE / FLOW, "C": FLOW / PRESSURE, "Z_c": PRESSURE / FLOW, "p_C_start": PRESSURE}


@dataclass(frozen=True)
class Candidate:
    """An effect: parameters with their start, bounds, size and factor to SI, and what it does to flow or pressure."""

    id: str
    channel: str
    summary: str
    parameters: dict[str, tuple[float, float, float, float]]
    units: dict[str, tuple[str, float]]
    flow: Callable[[np.ndarray, np.ndarray, Mapping[str, float]], np.ndarray] | None = None
    pressure: Callable[[np.ndarray, np.ndarray, np.ndarray, Mapping[str, float]], np.ndarray] | None = None
    outflow: str | None = None


def _shifted(t: np.ndarray, q: np.ndarray, v: Mapping[str, float]) -> np.ndarray:
    return np.interp(t + v["flow_delay"], t, q)


def _lagging_pressure(t: np.ndarray, q: np.ndarray, p: np.ndarray, v: Mapping[str, float]) -> np.ndarray:
    return relaxed(t, p, v["tau_sensor"], p[0])


def _behind_inertance(t: np.ndarray, q: np.ndarray, p: np.ndarray, v: Mapping[str, float]) -> np.ndarray:
    """What an inertance beside Z_c takes away: the flow that has gone over to it, times Z_c."""
    return p - v["Z_c"] * relaxed(t, q, v["tau_L"], float(q.mean()))


CANDIDATES = (
    Candidate("flow_delay", "sensor", "The recorded flow is late against the pressure",
              {"flow_delay": (0.02, 0.0, 0.2, 0.01)}, {"flow_delay": ("s", 1.0)}, flow=_shifted),
    Candidate("pressure_delay", "sensor", "The recorded pressure is late against the flow",
              {"pressure_delay": (0.01, 0.0, 0.2, 0.01)}, {"pressure_delay": ("s", 1.0)},
              flow=lambda t, q, v: np.interp(t - v["pressure_delay"], t, q)),
    Candidate("inertance", "mechanical", "The blood's inertia, in series",
              {"inertance": (0.001, -0.1, 0.1, 0.001)}, {"inertance": ("Pa.s2/m3", PRESSURE / FLOW)},
              pressure=lambda t, q, p, v: p + v["inertance"] * np.gradient(q, t)),
    Candidate("parallel_inertance", "mechanical", "The blood's inertia beside Z_c (four elements)",
              {"tau_L": (0.1, 1e-3, 10.0, 0.1)}, {"tau_L": ("s", 1.0)}, pressure=_behind_inertance),
    Candidate("outflow_pressure", "pressure", "The outflow stops at a pressure of its own",
              {"outflow_pressure": (20.0, -50.0, 120.0, 20.0)}, {"outflow_pressure": ("Pa", PRESSURE)},
              outflow="outflow_pressure"),
    Candidate("sensor_lag", "sensor", "The pressure sensor smooths",
              {"tau_sensor": (0.01, 1e-4, 0.5, 0.01)}, {"tau_sensor": ("s", 1.0)}, pressure=_lagging_pressure),
)  # fmt: skip
BASE = {"R": (1.0, 0.01, 50.0, 1.0), "C": (1.0, 0.01, 50.0, 1.0), "Z_c": (0.05, 0.0, 5.0, 0.05)}


@dataclass(frozen=True)
class Record:
    """A record in mmHg and mL/s; `training` (n,) marks what takes part in fits."""

    name: str
    time: np.ndarray
    flow: np.ndarray
    pressure: np.ndarray
    training: np.ndarray

    @staticmethod
    def of(experiment: Experiment) -> Record:
        """An experiment, without the samples whose pressure is missing."""
        seen = experiment.seen
        time = experiment.time[seen] - experiment.time[seen][0]
        training = time <= (1 - HELD_SHARE) * time[-1]
        return Record(experiment.name, time, experiment.inputs["flow"][seen] / FLOW,
                      experiment.output[seen] / PRESSURE, training)  # fmt: skip


@dataclass(frozen=True)
class Fitted:
    """A model on one record: parameters (mmHg, mL/s), standard errors, the residual (n,)."""

    record: Record
    values: dict[str, float]
    stderr: dict[str, float]
    residual: np.ndarray

    def squares(self, training: bool) -> float:
        """Sum of squares over the training part, or the held-out one."""
        part = self.record.training if training else ~self.record.training
        return float(np.sum(self.residual[part] ** 2))

    def independent(self) -> float:
        """How many independent samples the training residual is worth: by the integral of its correlation to zero."""
        r = self.residual[self.record.training]
        power = np.abs(np.fft.rfft(r - r.mean(), 2 * r.size)) ** 2
        correlation = np.fft.irfft(power)[: r.size]
        correlation /= correlation[0]
        until = int(np.argmax(correlation <= 0)) or r.size
        return float(r.size / (1 + 2 * np.sum(correlation[1:until])))

    def fit_percent(self, part: np.ndarray) -> float:
        """The paper's goodness of fit over the samples of `part`."""
        p = self.record.pressure[part]
        return float(100 * (1 - np.linalg.norm(self.residual[part]) / np.linalg.norm(p - p.mean())))


@dataclass
class Loop:
    """The search on all records: base fits, every candidate's, the accepted ones, and what is as good."""

    base: list[Fitted]
    tried: dict[tuple[str, ...], list[Fitted]] = field(default_factory=dict)
    chosen: tuple[str, ...] = ()
    equivalent: dict[str, list[str]] = field(default_factory=dict)

    @property
    def after(self) -> list[Fitted]:
        """The fits with the accepted effects."""
        return self.tried[self.chosen] if self.chosen else self.base

    def evidence(self, ids: tuple[str, ...], before: tuple[str, ...] = ()) -> list[float]:
        """Log evidence of `ids` over `before` on every record."""
        first = self.tried[before] if before else self.base
        return [_evidence(a, b) for a, b in zip(first, self.tried[ids], strict=True)]


def relaxed(t: np.ndarray, u: np.ndarray, tau: float, start: float) -> np.ndarray:
    """x of tau dx/dt = u - x for u (n,) that runs straight between samples at t (n,), exactly."""
    x = np.empty_like(u)
    x[0] = start
    step = np.diff(t)
    keep = np.exp(-step / tau)
    slope = np.diff(u) / step
    for i in range(step.size):
        x[i + 1] = u[i + 1] - slope[i] * tau + (x[i] - u[i] + slope[i] * tau) * keep[i]
    return x


def modelled(record: Record, effects: tuple[str, ...], v: Mapping[str, float]) -> np.ndarray:
    """The pressure (n,) of the windkessel with `effects` under the recorded flow."""
    used = [c for c in CANDIDATES if c.id in effects]
    t, q = record.time, record.flow
    for c in used:
        q = c.flow(t, q, v) if c.flow else q
    out = sum(v[c.outflow] for c in used if c.outflow)
    p = out + relaxed(t, v["R"] * q, v["R"] * v["C"], v["p_C_start"] - out) + v["Z_c"] * q
    for c in used:
        p = c.pressure(t, q, p, v) if c.pressure else p
    return np.asarray(p)


def fit_record(record: Record, effects: tuple[str, ...], start: Mapping[str, float] | None = None) -> Fitted:
    """Least squares on the training part, bounded; the compliance's first pressure is free."""
    spec = BASE | {"p_C_start": (float(record.pressure[0]), 0.0, 400.0, 10.0)}
    for c in CANDIDATES:
        spec |= c.parameters if c.id in effects else {}
    names = list(spec)
    first, low, high, size = (np.array(column) for column in zip(*spec.values(), strict=True))
    if start:
        first = np.array([start.get(n, f) for n, f in zip(names, first, strict=True)])

    def residual(x: np.ndarray) -> np.ndarray:
        values = dict(zip(names, x, strict=True))
        return (modelled(record, effects, values) - record.pressure)[record.training]

    inside = np.clip(first, low + 1e-6 * size, high - 1e-6 * size)
    found = least_squares(residual, inside, bounds=(low, high), x_scale=size)
    values = {n: float(x) for n, x in zip(names, found.x, strict=True)}
    whole = record.pressure - modelled(record, effects, values)
    fitted = Fitted(record, values, {}, whole)
    scale = found.jac * size
    covariance = np.linalg.pinv(scale.T @ scale) * (2 * found.cost / max(fitted.independent(), 1.0))
    errors = np.sqrt(np.diag(covariance)) * size
    return Fitted(record, values, {n: float(e) for n, e in zip(names, errors, strict=True)}, whole)


def on_all(fits: list[Fitted], effects: tuple[str, ...]) -> list[Fitted]:
    """The same models fitted to whole records: what is reported beside the held-out figures, and exported."""
    whole = [dataclasses.replace(f.record, training=np.full(f.residual.size, True)) for f in fits]
    return [fit_record(r, effects, f.values) for r, f in zip(whole, fits, strict=True)]


def search(records: list[Record], tell: Callable[[str], None]) -> Loop:
    """Accept effects while one convinces on every record."""
    tell("windkessel of three elements")
    loop = Loop([fit_record(r, ()) for r in records])
    for _ in range(2):
        options = [(*loop.chosen, c.id) for c in CANDIDATES if c.id not in loop.chosen]
        for ids in options:
            tell(f"with {ids[-1]}")
            loop.tried[ids] = [fit_record(f.record, ids, f.values) for f in loop.after]
        convincing = [ids for ids in options if _convinces(loop, ids)]
        if not convincing:
            break
        best = max(convincing, key=lambda ids: sum(loop.evidence(ids, loop.chosen)))
        near = sum(loop.evidence(best, loop.chosen)) - TOLD_APART
        rivals = [i for i in convincing if i != best and sum(loop.evidence(i, loop.chosen)) > near]
        loop.equivalent[best[-1]] = [i[-1] for i in sorted(rivals, key=lambda i: -sum(loop.evidence(i, loop.chosen)))]
        loop.chosen = best
    return loop


def _evidence(before: Fitted, after: Fitted) -> float:
    independent = before.independent()
    more = len(after.values) - len(before.values)
    return float(0.5 * independent * math.log(before.squares(True) / after.squares(True))
                 - 0.5 * more * math.log(max(independent, 2.0)))  # fmt: skip


def _convinces(loop: Loop, ids: tuple[str, ...]) -> bool:
    evidence = loop.evidence(ids, loop.chosen)
    pairs = list(zip(loop.after, loop.tried[ids], strict=True))
    enough = all(b.squares(part) <= (1 - LEAST_SHARE) * a.squares(part) for a, b in pairs for part in (True, False))
    return enough and min(evidence) > LEAST_EVIDENCE


def close_loop(data: Path, out: Path) -> None:
    """Read, search, and write result.json, report.html, model.json and the FMU."""
    recordings = read_folder(data, AORTA)
    records = [Record.of(e) for e in recordings.experiments]
    with tqdm(total=1 + 2 * len(CANDIDATES), unit="step", disable=None) as bar:

        def tell(what: str) -> None:
            bar.set_postfix_str(what)
            bar.update()

        loop = search(records, tell)
        outcome = result(loop)
        final = on_all(loop.after, loop.chosen)
        model = aortic_afterload(_si(final[0].values))
    fmu = out / "fmi2" / f"{model.name}.fmu"
    native_fmu(model, 2, fmu)
    names = ", ".join(loop.chosen) or "none"
    note = f"identified from {recordings.source}, record {final[0].record.name}; effects: {names}"
    write_atomically(out / "model.json", as_json(model, note).encode())
    _page(loop, outcome, recordings.source).write(out / "report.html")
    write_atomically(out / "result.json", (json.dumps(outcome, indent=2, allow_nan=False) + "\n").encode())
    before, after = outcome["error"]["recalibrated"]["fit_percent"], outcome["error"]["after"]["fit_percent"]
    print(
        f"{outcome['verdict']}: {', '.join(loop.chosen) or 'nothing'}; fit {before:.1f} -> {after:.1f} %; wrote {out}"
    )


def result(loop: Loop) -> dict[str, Any]:
    """The content of result.json: as for a tube, with pressures in Pa."""
    effects = []
    for name in loop.chosen:
        candidate = next(c for c in CANDIDATES if c.id == name)
        place = loop.chosen.index(name)
        evidence = loop.evidence(loop.chosen[: place + 1], loop.chosen[:place])
        effects.append({"id": name, "channel": candidate.channel, "equivalent": loop.equivalent[name],
                        "evidence": sum(evidence), "evidence_per_record": evidence,
                        "parameters": _parameters(loop, candidate)})  # fmt: skip
    verdict = "no_effect" if not effects else "ambiguous" if any(e["equivalent"] for e in effects) else "effect_found"
    noise = float(np.median([noise_level(f.record.pressure) for f in loop.base])) * PRESSURE
    after = _errors(loop.after, loop.chosen)
    errors = {"published": None, "recalibrated": _errors(loop.base, ()), "after": after}
    tests = {
        "residual_over_noise": after["rmse_pa"] / noise if noise > 0 else 0.0,
        "independent_samples": [f.independent() for f in loop.after],
    }
    return {
        "verdict": verdict, "effects": effects, "error": errors, "noise_floor_pa": noise,
        "residual": {"channel": effects[0]["channel"] if effects else None, "tests": tests},
        "ranking": _ranking(loop),
        "next_experiment": _advice(loop),
    }  # fmt: skip


def _ranking(loop: Loop) -> list[dict[str, Any]]:
    """Everything that was tried, the largest evidence over three elements first."""
    listed = [
        {
            "effects": list(ids),
            "evidence": sum(loop.evidence(ids)),
            "evidence_per_record": loop.evidence(ids),
            "fit_percent": [f.fit_percent(np.full(f.residual.size, True)) for f in fits],
        }
        for ids, fits in loop.tried.items()
    ]
    return sorted(listed, key=lambda entry: -float(np.sum(entry["evidence"])))


def _parameters(loop: Loop, candidate: Candidate) -> dict[str, Any]:
    """Mean over the records, with the larger of its standard error and the records' spread."""
    found = {}
    for name, (unit, factor) in candidate.units.items():
        values = [f.values[name] * factor for f in loop.after]
        errors = [f.stderr[name] * factor for f in loop.after]
        value = float(np.mean(values))
        error = max(
            float(np.sqrt(np.mean(np.square(errors)) / len(errors))), float(np.std(values) / math.sqrt(len(values)))
        )
        found[name] = {"value": value, "stderr": error, "ci95": [value - 1.96 * error, value + 1.96 * error],
                       "unit": unit, "per_record": values}  # fmt: skip
    return found


def _errors(fits: list[Fitted], effects: tuple[str, ...]) -> dict[str, Any]:
    """Error [Pa] and goodness of fit [%] of fits to whole records, and on the held-out ends of fits without them."""
    whole, each, summary = on_all(fits, effects), {}, {}
    for prefix, used, parts in (
        ("", whole, [w.record.training for w in whole]),
        ("held_out_", fits, [~f.record.training for f in fits]),
    ):
        left = np.concatenate([f.residual[p] for f, p in zip(used, parts, strict=True)])
        summary[f"{prefix}rmse_pa"] = float(np.sqrt(np.mean(left**2))) * PRESSURE
        summary[f"{prefix}fit_percent"] = float(np.mean([f.fit_percent(p) for f, p in zip(used, parts, strict=True)]))
    for f, w in zip(fits, whole, strict=True):
        each[f.record.name] = {
            "rmse_pa": float(np.sqrt(np.mean(w.residual**2))) * PRESSURE,
            "fit_percent": w.fit_percent(w.record.training),
            "held_out_fit_percent": f.fit_percent(~f.record.training),
            "parameters": _si(w.values),
        }
    return summary | {"per_experiment": each}


def _si(values: Mapping[str, float]) -> dict[str, float]:
    """Parameters of the declared model in SI units; what it has no name for is left out."""
    factors = SI | {n: f for c in CANDIDATES for n, (_, f) in c.units.items()}
    return {n: v * factors[n] for n, v in values.items() if n not in ("pressure_delay", "tau_L", "tau_sensor")}


def _advice(loop: Loop) -> str:
    if not loop.chosen:
        return "No candidate convinces on every record: record more beats at other loads before adding elements."
    if "flow_delay" in loop.chosen:
        return (
            "Measure the flow probe's own delay (a step of flow on the bench, or the probe's filter setting), because "
            "the recorded flow is late against the pressure."
        )
    names = " or ".join(dict.fromkeys([*loop.chosen, *(n for ns in loop.equivalent.values() for n in ns)]))
    return f"Record at another heart rate, because {names} act differently over frequency."


def _page(loop: Loop, outcome: dict[str, Any], source: str) -> Page:
    names = ", ".join(loop.chosen) or "nothing"
    page = Page("Closing the loop on the aorta", f"{source}: what a windkessel of three elements lacks is {names}.")
    page.heading("Error, before and after")
    rows = []
    for label, key in (("three elements", "recalibrated"), ("after", "after")):
        for name, e in outcome["error"][key]["per_experiment"].items():
            rows.append([label, name, f"{e['rmse_pa'] / PRESSURE:.2f}", f"{e['fit_percent']:.1f}",
                         f"{e['held_out_fit_percent']:.1f}"])  # fmt: skip
    page.table(["model", "record", "error [mmHg]", "fit [%]", "fit of the held-out end [%]"], rows)
    page.heading("Ranking")
    page.table(["effects", "log evidence", "fit in each record [%]"],
               [[" + ".join(r["effects"]), f"{r['evidence']:.1f}", ", ".join(f"{x:.1f}" for x in r["fit_percent"])]
                for r in outcome["ranking"]])  # fmt: skip
    page.text(outcome["next_experiment"])
    page.heading("The records")
    for before, after in zip(loop.base, loop.after, strict=True):
        r = before.record
        drawn = go.Figure()
        for label, values in (("record", r.pressure), ("three elements", r.pressure - before.residual),
                              ("after", r.pressure - after.residual)):  # fmt: skip
            drawn.add_trace(go.Scatter(x=r.time, y=values, name=label))
        drawn.update_xaxes(title="time [s]").update_yaxes(title="pressure [mmHg]")
        page.figure(drawn, f"{r.name}: the last quarter took no part in the fit.")
    return page
