"""result.json of a loop on the aorta: as for a tube, with pressures in Pa."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ...identify.monitors import noise_level
from ...model.afterload import aortic_afterload
from ...model.declare import Model
from .candidates import CANDIDATES
from .fits import Fitted, on_whole_records
from .records import PRESSURE
from .search import Loop, Round


def result(loop: Loop) -> dict[str, Any]:
    """The content of result.json (design.md section 3), numbers in SI units."""
    effects = [_effect(loop, r) for r in loop.accepted]
    noise = float(np.median([noise_level(f.record.pressure) for f in loop.base])) * PRESSURE
    after = _errors(loop.after)
    return {
        "verdict": "ambiguous" if any(e["equivalent"] for e in effects) else "effect_found" if effects else "no_effect",
        "effects": effects,
        "error": {"published": None, "recalibrated": _errors(loop.base), "after": after},
        "noise_floor_pa": noise,
        "residual": {
            "channel": effects[0]["channel"] if effects else None,
            "tests": {"residual_over_noise": after["rmse_pa"] / noise if noise > 0 else None,
                      "independent_samples": [f.independent() for f in loop.after]},
        },
        "ranking": _ranking(loop),
        "next_experiment": _advice(loop),
    }  # fmt: skip


def final_model(loop: Loop) -> Model:
    """The declared model with the accepted effects, as the first record has them."""
    return aortic_afterload(on_whole_records(loop.after[:1])[0].si())


def _effect(loop: Loop, step: Round) -> dict[str, Any]:
    """An accepted effect; its parameter is the mean over the records, as certain as they agree or as each says."""
    assert step.accepted is not None
    candidate = CANDIDATES[step.accepted.ids[-1]]
    unknown = candidate.unknown
    values = [f.values[unknown.name] * unknown.si for f in loop.after]
    errors = [f.stderr[unknown.name] * unknown.si for f in loop.after]
    value = float(np.mean(values))
    error = max(float(np.linalg.norm(errors)) / len(errors), float(np.std(values)) / math.sqrt(len(values)))
    parameter = {"value": value, "stderr": error, "ci95": [value - 1.96 * error, value + 1.96 * error],
                 "unit": unknown.unit, "per_record": values}  # fmt: skip
    return {
        "id": candidate.id, "channel": candidate.channel, "equivalent": step.equivalent,
        "evidence": sum(step.accepted.evidence), "evidence_per_record": step.accepted.evidence,
        "parameters": {unknown.name: parameter},
    }  # fmt: skip


def _ranking(loop: Loop) -> list[dict[str, Any]]:
    """Everything that was tried, round by round; evidence and shares are over the model before."""
    return [
        {"effects": list(o.ids), "evidence": sum(o.evidence), "evidence_per_record": o.evidence,
         "taken_share": o.taken, "held_out_taken_share": o.taken_held_out, "accepted": o is step.accepted}
        for step in loop.rounds for o in step.options
    ]  # fmt: skip


def _errors(fits: list[Fitted]) -> dict[str, Any]:
    """Error [Pa] and goodness of fit [%] of fits to whole records, and on the held-out ends of fits without them."""
    whole = on_whole_records(fits)
    each = {
        f.record.name: {"rmse_pa": w.rmse(), "fit_percent": w.goodness(), "held_out_rmse_pa": f.rmse(True),
                        "held_out_fit_percent": f.goodness(True), "parameters": w.si()}
        for f, w in zip(fits, whole, strict=True)
    }  # fmt: skip
    return {
        "rmse_pa": _root_mean_square([w.rmse() for w in whole]),
        "fit_percent": float(np.mean([w.goodness() for w in whole])),
        "held_out_rmse_pa": _root_mean_square([f.rmse(True) for f in fits]),
        "held_out_fit_percent": float(np.mean([f.goodness(True) for f in fits])),
        "per_experiment": each,
    }


def _root_mean_square(values: list[float]) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


def _advice(loop: Loop) -> str:
    """One sentence: what to measure next, and why."""
    if not loop.chosen:
        return "Record more beats at other loads before adding elements: no candidate convinces on every record."
    if loop.chosen[0] == "flow_delay" and not loop.accepted[0].equivalent:
        return (
            "Measure the flow probe's own delay (a step of flow on the bench, or the probe's filter setting), because "
            "the recorded flow is late against the pressure."
        )
    names = " or ".join(dict.fromkeys([*loop.chosen, *(n for r in loop.accepted for n in r.equivalent)]))
    return f"Record at another heart rate, because {names} act differently over frequency."
