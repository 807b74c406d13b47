"""The windkessel of three elements and what it may lack, as closed formulas for recorded flow.

Between samples flow and pressure are straight lines, for which the windkessel is solved exactly. The same effects
stand as equations in `model.afterload`, which the exported model is made from.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from .records import FLOW, PRESSURE, Record

Values = Mapping[str, float]


@dataclass(frozen=True)
class Unknown:
    """A parameter that is fitted: where it starts, its bounds and size in the units here, and `si` of one of them."""

    name: str
    start: float
    low: float
    high: float
    size: float
    unit: str
    si: float = 1.0


@dataclass(frozen=True)
class Candidate:
    """An effect: its unknown, and what it does to the recorded flow, to the pressure, or to where the outflow ends.

    `on` are parameters of the exported model that are not fitted but belong to the effect.
    """

    id: str
    channel: str
    summary: str
    unknown: Unknown
    flow: Callable[[np.ndarray, np.ndarray, Values], np.ndarray] | None = None
    pressure: Callable[[np.ndarray, np.ndarray, np.ndarray, Values], np.ndarray] | None = None
    outflow: str = ""
    on: Callable[[Record], Values] = lambda record: {}


def relaxed(t: np.ndarray, u: np.ndarray, tau: float, start: float) -> np.ndarray:
    """x of tau dx/dt = u - x for u (n,) that runs straight between samples at t (n,), exactly."""
    step = np.diff(t)
    slope = np.diff(u) / step * tau  # by how much x lags behind once settled
    keep = np.append(0.0, np.exp(-step / tau))
    new = np.append(start, (u[1:] - slope) - (u[:-1] - slope) * keep[1:])
    reach = 1
    while reach < u.size:  # x_i = keep_i x_(i-1) + new_i, by doubling the reach of each sample
        new[reach:] += keep[reach:] * new[:-reach]
        keep[reach:] *= keep[:-reach].copy()
        reach *= 2
    return new


def modelled(record: Record, effects: tuple[str, ...], v: Values) -> np.ndarray:
    """The pressure (n,) [mmHg] of the windkessel with `effects` under the recorded flow."""
    used = [CANDIDATES[i] for i in effects]
    t, q = record.time, record.flow
    for c in used:
        q = c.flow(t, q, v) if c.flow else q
    out = sum(v[c.outflow] for c in used if c.outflow)
    p = out + relaxed(t, v["R"] * q, v["R"] * v["C"], v["p_C_start"] - out) + v["Z_c"] * q
    for c in used:
        p = c.pressure(t, q, p, v) if c.pressure else p
    return np.asarray(p)


def unknowns(record: Record, effects: tuple[str, ...]) -> list[Unknown]:
    """What is fitted: the three elements, the compliance's first pressure, and one unknown for each effect."""
    first = Unknown("p_C_start", float(record.pressure[0]), 0.0, 400.0, 10.0, "Pa", PRESSURE)
    return [*BASE, first, *(CANDIDATES[i].unknown for i in effects)]


def _shifted(t: np.ndarray, q: np.ndarray, v: Values) -> np.ndarray:
    return np.interp(t + v["flow_delay"], t, q)


def _behind(t: np.ndarray, q: np.ndarray, p: np.ndarray, v: Values) -> np.ndarray:
    return np.interp(t - v["pressure_delay"], t, p)


def _inert(t: np.ndarray, q: np.ndarray, p: np.ndarray, v: Values) -> np.ndarray:
    return p + v["inertance"] * np.gradient(q, t)


def _beside_inertance(t: np.ndarray, q: np.ndarray, p: np.ndarray, v: Values) -> np.ndarray:
    """The flow that has gone over to the inertance, times Z_c, is missing."""
    return p - v["Z_c"] * relaxed(t, q, 1 / v["parallel_rate"], float(q.mean()))


def _smoothed(t: np.ndarray, q: np.ndarray, p: np.ndarray, v: Values) -> np.ndarray:
    return relaxed(t, p, v["tau_sensor"], p[0])


BASE = (
    Unknown("R", 1.0, 0.01, 50.0, 1.0, "Pa.s/m3", PRESSURE / FLOW),
    Unknown("C", 1.0, 0.01, 50.0, 1.0, "m3/Pa", FLOW / PRESSURE),
    Unknown("Z_c", 0.05, 0.0, 5.0, 0.05, "Pa.s/m3", PRESSURE / FLOW),
)
CANDIDATES = {c.id: c for c in (
    Candidate("flow_delay", "sensor", "The recorded flow is late against the pressure",
              Unknown("flow_delay", 0.02, 0.0, 0.2, 0.01, "s"), flow=_shifted),
    Candidate("pressure_delay", "sensor", "The recorded pressure is late against the flow",
              Unknown("pressure_delay", 0.01, 0.0, 0.2, 0.01, "s"), pressure=_behind),
    Candidate("inertance", "mechanical", "The blood's inertia, in series",
              Unknown("inertance", 0.001, 0.0, 0.1, 0.001, "Pa.s2/m3", PRESSURE / FLOW), pressure=_inert),
    Candidate("parallel_inertance", "mechanical", "The blood's inertia beside Z_c (four elements)",
              Unknown("parallel_rate", 10.0, 0.05, 500.0, 10.0, "1/s"), pressure=_beside_inertance,
              on=lambda record: {"Q_b_start": float(record.flow.mean()) * FLOW}),
    Candidate("outflow_pressure", "pressure", "The outflow stops at a pressure of its own",
              Unknown("outflow_pressure", 20.0, -50.0, 120.0, 20.0, "Pa", PRESSURE), outflow="outflow_pressure"),
    Candidate("sensor_lag", "sensor", "The pressure sensor smooths",
              Unknown("tau_sensor", 0.01, 1e-4, 0.5, 0.01, "s"), pressure=_smoothed,
              on=lambda record: {"sensor_share": 1.0}),
)}  # fmt: skip
