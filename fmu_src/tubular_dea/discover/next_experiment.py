"""Which experiment to make next: of feasible protocols, the one on which the competing models differ most.

Expected discrimination is half the squared distance of the models' answers in units of the sensor's noise. Feasible
are protocols within the pressures and voltages that were recorded, at most 30 s long.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ..kernel import KernelError
from ..protocol import Protocol
from .compiled import Ids
from .options import Option
from .study import Study

WITHIN = 0.85  # of the largest pressure and voltage recorded


@dataclass(frozen=True)
class Proposal:
    """A protocol in words, and how far the two closest models are apart on it (log likelihood)."""

    words: str
    discrimination: float


def propose(study: Study, options: Sequence[Option]) -> Proposal | None:
    """The protocol that separates the two closest of `options` best; None where fewer than two are given."""
    best: Proposal | None = None
    for words, protocol in feasible(study).items():
        times = np.arange(protocol.time[0], protocol.time[-1], 0.004)
        try:
            answers = [_answer(study, o.ids, o.fitted.values, protocol, times) for o in options]
        except KernelError:
            continue
        apart = [float(np.sum(study.noise.whiten(times, a - b) ** 2)) / 2
                 for i, a in enumerate(answers) for b in answers[:i]]  # fmt: skip
        if apart and (best is None or min(apart) > best.discrimination):
            best = Proposal(words, min(apart))
    return best


def feasible(study: Study) -> dict[str, Protocol]:
    """Protocols in words, within what was recorded."""
    inputs = study.pieces[0].case.protocol.inputs
    if not {"pressure", "voltage"} <= set(inputs):
        return {}
    recorded = {n: np.concatenate([p.case.protocol.inputs[n] for p in study.pieces]) for n in ("pressure", "voltage")}
    p, v = (WITHIN * float(r[np.argmax(np.abs(r))]) for r in recorded.values())  # with the polarity that was recorded
    mmhg, kv = p / 133.322, v / 1e3
    return {
        f"voltage steps of 10 ms to 1 s up to {kv:.1f} kV at {0.6 * mmhg:.0f} mmHg": _pulses(0.6 * p, v),
        f"a sweep of the pressure from 0.1 to 10 Hz between {0.4 * mmhg:.0f} and {mmhg:.0f} mmHg without voltage":
            _sweep(p, 0.0),
        f"a sweep of the pressure from 0.1 to 10 Hz between {0.4 * mmhg:.0f} and {mmhg:.0f} mmHg at {0.6 * kv:.1f} kV":
            _sweep(p, 0.6 * v),
        f"slow pressure triangles of growing height up to {mmhg:.0f} mmHg without voltage": _triangles(p, 0.0),
        f"slow pressure triangles of growing height up to {mmhg:.0f} mmHg at {0.6 * kv:.1f} kV": _triangles(p, 0.6 * v),
        f"{kv:.1f} kV held for 15 s at {0.6 * mmhg:.0f} mmHg and then taken off for 10 s": _hold(0.6 * p, v),
        f"voltage triangles up to {kv:.1f} kV of 1 s and of 6 s at {0.6 * mmhg:.0f} mmHg":
            _voltage_triangles(0.6 * p, v),
    }  # fmt: skip


def _answer(study: Study, ids: Ids, values: Mapping[str, float], protocol: Protocol, times: np.ndarray) -> np.ndarray:
    run = study.compiled.kernel(ids).simulate(protocol, times, study.geometry | dict(values))
    return run[study.measured]


def _pulses(pressure: float, voltage: float) -> Protocol:
    time, volts = [0.0, 2.0], [0.0, 0.0]
    for length in (0.01, 0.03, 0.1, 0.3, 1.0) * 3:
        start = time[-1]
        time += [start, start + length, start + length, start + 2 * length + 0.1]
        volts += [voltage, voltage, 0.0, 0.0]
    grid = np.array(time)
    return Protocol(grid, {"pressure": pressure * np.minimum(grid / 1.0, 1.0), "voltage": np.array(volts)})


def _sweep(pressure: float, voltage: float) -> Protocol:
    duration, lowest, span = 20.0, 0.1, np.log(100)  # s, Hz, log of the largest over the lowest
    time = np.arange(0, duration, 0.01)
    phase = 2 * np.pi * lowest * duration / span * (np.exp(span * time / duration) - 1)
    wave = pressure * np.minimum(time, 1.0) * (0.7 + 0.3 * np.sin(phase))
    return Protocol(time, {"pressure": wave, "voltage": np.full(time.size, voltage) * (time > 1.5)})


def _triangles(pressure: float, voltage: float) -> Protocol:
    time = np.arange(0, 27, 3.0)
    heights = pressure * np.array([0.0, 0.4, 0.05, 0.7, 0.05, 1.0, 0.05, 1.0, 0.3])
    return Protocol(time, {"pressure": heights, "voltage": np.full(time.size, voltage)})


def _hold(pressure: float, voltage: float) -> Protocol:
    time = np.array([0.0, 1.0, 2.0, 2.0, 17.0, 17.0, 27.0])
    return Protocol(time, {"pressure": pressure * np.minimum(time, 1.0),
                           "voltage": voltage * np.array([0, 0, 0, 1.0, 1.0, 0, 0])})  # fmt: skip


def _voltage_triangles(pressure: float, voltage: float) -> Protocol:
    time = np.array([0.0, 1.0, 2.0, 2.5, 3.0, 3.5, 4.0, 7.0, 10.0, 13.0, 16.0])
    return Protocol(time, {"pressure": pressure * np.minimum(time, 1.0),
                           "voltage": voltage * np.array([0, 0, 0, 1.0, 0, 1.0, 0, 1.0, 0, 1.0, 0])})  # fmt: skip
