"""result.json: the verdict, the effects with their parameters, and the errors before and after."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from ..identify.fit import Fit, goodness, interval, rmse
from ..kernel import KernelError
from ..model.declare import Model
from ..model.effects import catalogue
from .compiled import Ids
from .engine import Discovery
from .parameters import switched_on

WHY = {
    "no_effect": "Nothing is missing at this noise",
    "effect_found": "The effects are told apart from every rival",
    "ambiguous": "The record cannot tell these effects apart",
    "unexplained": "A residual remains that no effect of the catalogue explains",
}
MOSTLY = 0.9  # of what is not noise
REPEAT = {
    "electrical": "with and without voltage at the same pressures",
    "mechanical": "at several rates without voltage",
    "pressure": "with a second pressure sensor at the tube",
    "sensor": "with a second displacement sensor",
}


def result(found: Discovery) -> dict[str, Any]:
    """The content of result.json (design.md section 3), numbers in SI units."""
    chosen, base = found.chosen, found.base
    published = {q: v for q, v in found.study.compiled.base.parameter_values().items() if q not in found.study.geometry}
    return {
        "verdict": found.verdict,
        "effects": [_effect(found, name) for name in chosen.ids],
        "error": {
            "published": errors(found, (), published),
            "recalibrated": errors(found, (), base.fitted.values),
            "after": errors(found, chosen.ids, chosen.fitted.values),
        },
        "noise_floor_m": found.study.noise.rms,
        "residual": {"channel": channel(found), "tests": _tests(found)},
        "next_experiment": advice(found),
        "base_parameters": {n: _parameter(chosen.fitted, n, _unit(found, n)) for n in base.fitted.names},
        "undetermined": chosen.fitted.undetermined(),
        "noise": {"sensor_rms_m": found.study.noise.rms, "sensor_correlation": found.study.noise.correlation,
                  "monitors": found.study.monitor_noise, "from_monitors_rms_m": found.coloured},
        "held_out": [p.name for p in found.study.held_out],
        "ranking": ranking(found),
    }  # fmt: skip


def channel(found: Discovery) -> str | None:
    """Where the residual arises: the first effect's channel, or the best latent input's; None without residual.

    The effect's too where it explains nearly all and only its form is not quite right.
    """
    if found.verdict == "no_effect":
        return None
    if _by_effect(found):
        return catalogue()[found.chosen.ids[0]].channel
    return found.located.channel if found.located else None


def _by_effect(found: Discovery) -> bool:
    """The first effect explains the residual, or nearly all of it."""
    explained = 1 - found.chosen.adequacy.excess / max(found.base.adequacy.excess, 1.0)
    return bool(found.chosen.ids) and (found.verdict != "unexplained" or explained > MOSTLY)


def final_model(found: Discovery) -> Model:
    """The model with the accepted effects and the identified values as its defaults."""
    values = found.study.geometry | found.chosen.fitted.values
    for name in found.chosen.ids:
        values = switched_on(catalogue()[name]) | values
    model = found.study.compiled.model(found.chosen.ids)
    names = set(model.parameter_values())
    return model.with_values({n: float(v) for n, v in values.items() if n in names})


def errors(found: Discovery, ids: Ids, values: Mapping[str, float]) -> dict[str, Any]:
    """Errors on training and held-out experiments, and for each experiment; None where the model has no answer."""
    try:
        outputs = found.study.response(ids, found.study.pieces).outputs(values)
    except KernelError:
        return {
            "rmse_m": None,
            "fit_percent": None,
            "held_out_rmse_m": None,
            "held_out_fit_percent": None,
            "per_experiment": {},
        }
    pairs = list(zip(found.study.pieces, outputs, strict=True))
    record = {
        p.name: {"rmse_m": rmse([p.record], [y]), "fit_percent": _finite(goodness([p.record], [y])),
                 "held_out": p.held_out}
        for p, y in pairs
    }  # fmt: skip
    train = [(p.record, y) for p, y in pairs if not p.held_out]
    held = [(p.record, y) for p, y in pairs if p.held_out]
    of = {"": train, "held_out_": held}
    summary: dict[str, Any] = {}
    for prefix, part in of.items():
        summary[f"{prefix}rmse_m"] = rmse(*zip(*part, strict=True)) if part else None
        summary[f"{prefix}fit_percent"] = _finite(goodness(*zip(*part, strict=True))) if part else None
    return summary | {"per_experiment": record}


def ranking(found: Discovery) -> list[dict[str, Any]]:
    """Every refitted option with its evidence over the base, best first."""
    options = {
        o.ids: o
        for o in [*(o for r in found.search.rounds for o in r.options), found.chosen, *found.search.rivals]
        if o.ids
    }
    ordered = sorted(options.values(), key=lambda o: -o.evidence)
    return [
        {"effects": list(o.ids), "evidence": o.evidence - found.base.evidence, "ratio": o.adequacy.ratio}
        for o in ordered
    ]


def advice(found: Discovery) -> str:
    """One sentence: what to measure next, and why."""
    why, proposal, where = WHY[found.verdict], found.proposal, channel(found)
    if found.verdict == "no_effect":
        return f"{why}: no further experiment is needed unless the tube will go beyond what was recorded."
    if found.verdict == "unexplained":
        because = "it is largest where this channel acts" if _nowhere(found) else f"the {where} channel explains most"
        return f"{why}: repeat an experiment {REPEAT[str(where)]}, because {because}."
    if proposal is None:
        return f"{why}: repeat the experiments on another tube to see whether the effect is the same."
    listed = [*found.chosen.ids, *(name for group in found.equivalent.values() for name in group)]
    names = " or ".join(dict.fromkeys(listed))
    apart = f"{proposal.discrimination:.0f} in log likelihood"
    if found.verdict == "ambiguous":
        return f"{why}: record {proposal.words}, on which {names} differ by {apart} where they are closest."
    return f"{why}: to confirm {names}, record {proposal.words}, on which it and the nearest rival differ by {apart}."


def _nowhere(found: Discovery) -> bool:
    """No effect explains nearly all of the residual, and no channel half of it."""
    return not _by_effect(found) and bool(found.located and found.located.disturbance)


def _effect(found: Discovery, name: str) -> dict[str, Any]:
    effect, fitted = catalogue()[name], found.chosen.fitted
    names = [q.name for q in effect.parameters if q.name in fitted.names]
    units = {q.name: q.unit for q in effect.parameters}
    return {
        "id": name,
        "channel": effect.channel,
        "equivalent": found.equivalent.get(name, []),
        "evidence": evidence(found, name),
        "parameters": {n: _parameter(fitted, n, units[n]) for n in names},
    }


def evidence(found: Discovery, name: str) -> float:
    """Log evidence of an effect: what the model with it has over the best without it."""
    without = [o for r in found.search.rounds for o in r.options if name not in o.ids]
    rest = set(found.chosen.ids) - {name}
    allowed = [found.base, *(o for o in without if set(o.ids) <= rest)]
    return float(found.chosen.evidence - max(o.evidence for o in allowed))


def _parameter(fitted: Fit, name: str, unit: str) -> dict[str, Any]:
    low, high = interval(fitted, name)
    return {"value": float(fitted.values[name]), "stderr": _finite(fitted.stderr[name]),
            "ci95": [_finite(low), _finite(high)], "unit": unit}  # fmt: skip


def _unit(found: Discovery, name: str) -> str:
    return found.study.compiled.base.quantity(name).unit


def _tests(found: Discovery) -> dict[str, Any]:
    sides = {"before": (found.tests_before, found.base.adequacy), "after": (found.tests_after, found.chosen.adequacy)}
    first = found.search.rounds[0]
    return {
        name: {k: _finite(v) for k, v in tests.items()}
        | {"z_slow": state.z_slow, "z_total": state.z_total, "structure_m": state.structure}
        for name, (tests, state) in sides.items()
    } | {
        "latent_evidence": {k: _finite(v) for k, v in found.located.evidence.items()} if found.located else {},
        "disturbance": bool(found.located and found.located.disturbance),
        "largest_score": float(first.scores[0].gain) if first.scores else 0.0,
        "threshold": float(first.threshold),
        "numeric_gain": found.numeric,
    }


def _finite(value: float) -> float | None:
    return float(value) if math.isfinite(value) and not isinstance(value, bool) and not np.isnan(value) else None
