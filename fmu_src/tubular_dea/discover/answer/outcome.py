"""result.json: the verdict, the effects with their parameters, and the errors before and after."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ...identify.fitting.compiled import Ids
from ...identify.fitting.fit import Fit, goodness, rmse
from ...identify.fitting.intervals import interval
from ...identify.records.unused import not_used
from ...identify.study.nuisances import with_nuisances, zero_spread
from ...identify.study.remembered import NOISE_OF
from ...identify.study.study import Piece, Study
from ...kernel import KernelError
from ...model.declare import Model, Quantity
from ...model.effect import with_effects
from ...recordings.table import either
from ..alternatives.input_noise import allowed_rms
from ..alternatives.unlike_files import Unlike
from ..alternatives.zeros import Shift
from ..engine import Discovery
from ..experiments.next_experiment import DIFFER, Proposal, at_channel, kind
from ..options import residuals
from ..options.acceptance import noise_alone, size_interval
from ..options.options import Option
from ..options.residuals import LackOfFit
from ..scores.channels import Isolation
from ..scores.parameters import implausible, switched_on
from ..search import equivalence, second_output
from ..search.second_output import Missed
from . import between_files, remarks, reservations
from .determined import determined
from .oscillations import Oscillation, oscillations
from .own_records import own_records

WHY = {
    "no_effect": "At this level of noise nothing is missing",
    "effect_found": "The effects are distinguished from every rival",
    "ambiguous": "The recordings cannot distinguish these effects",
    "partly_explained": "The named effects improve the prediction of held-out data, and a significant residual remains",
    "unexplained": "No effect of the catalogue explains the residual",
}
IMPLAUSIBLE = "Only with implausible values is the residual no more than noise"
# Set by judgement: an error is by a few percent smaller than the noise, as parameters are fitted.
# Check: `pytest tests/test_discover.py -k floor`
TOO_NOISY = 1.2  # [1] times the error of a model that noise is at most

# Set by judgement: nobody repeats an experiment ten times. Check: `pytest tests/test_next_experiment.py`
OFTEN = 4  # [1] times that an experiment is proposed at most

# Set by measurement: two names of one equation came to 2e-6, what is alike in all experiments that may be done to 0.2.
# Check: `pytest tests/test_plants.py -k tells_nothing_apart`
ONE_THING = 1e-3  # [1] discrimination of the best experiment, below which names are those of one thing

# Set by judgement. Check: `python -m blind.score --external 12 --seed 1000`
NEARLY_AS_MUCH = 0.9  # [1] share of the evidence for a channel from which on another explains nearly as much
MOSTLY = 0.9  # [1] share of what is not noise that an effect explains whose channel is told though it is not named

# Set by measurement: C_3 alone, which hardly matters below a stretch of 1.2, was six and twelve times the declared one
# where a permittivity fell, a laser swung and a monitor drifted. Check: `pytest tests/test_report_words.py -k channel`
TELL_CHANNEL = 2  # [1] implausible parameters of one channel that tell that what is missing belongs there


def result(found: Discovery) -> dict[str, Any]:
    """The content of result.json (design.md section 3), numbers in SI units."""
    study, chosen, waves = found.study, found.named, oscillations(found)
    published = {q: v for q, v in study.plant.model.parameter_values().items() if q not in study.geometry}
    after = errors(found.named_study, chosen.ids, chosen.fitted.values)
    named = [_effect(found, name) for name in chosen.ids]
    return {
        "verdict": found.verdict,
        "plant": study.plant.name,
        "effects": named,
        "error": {
            "published": errors(found.search.base_study, (), published),
            "recalibrated": errors(found.search.base_study, (), found.base.fitted.values),
            "after": after,
        },
        "noise_floor": floor(study, after["rmse"]),
        "residual": {"channel": channel(found), "tests": _tests(found), "remainder": remainder(found)},
        "invisible": found.limits,
        "invisible_at": _shapes(found),
        "remarks": [*remarks.remarks(found, waves), *between_files.odd_files(found, after)],
        "next_experiment": advice(found, between_files.in_few_files(found, after)),
        "base_parameters": {n: _parameter(chosen.fitted, n, _unit(found, n)) for n in found.base.fitted.names},
        "undetermined": _undetermined(found, named),
        "noise": _noise(found, waves),
        "held_out": [p.name for p in study.held_out],
        "reading": not_used(found.recordings),
        "records": own_records(found),
        "ranking": ranking(found),
    }


def _undetermined(found: Discovery, named: Sequence[Mapping[str, Any]]) -> list[str]:
    """The parameters of the plant and of its `named` effects that the recordings do not determine."""
    told = {
        name: determined(found.study.catalogue[entry["id"]], name, p["ci95"])
        for entry in named
        for name, p in entry["parameters"].items()
    }
    return [*(n for n in found.named.fitted.undetermined() if n not in told), *(n for n, ok in told.items() if not ok)]


def _shapes(found: Discovery) -> dict[str, dict[str, float]]:
    """The other parameters (SI) of effects with a detection limit, which it holds at."""
    guessed = found.search.rounds[0].guessed if found.search.rounds else []
    shapes = {g.effect.id: {n: v for n, v in g.shape.items() if n != g.name} for g in guessed}
    return {name: shape for name, shape in shapes.items() if shape}


def floor(study: Study, error: float | None) -> float:
    """The noise of the first output (SI, rms). What is slower than any quiet stretch is not told by these: no more than
    the error of the model."""
    noise = study.noise[study.plant.outputs[0].name]
    sure = error is None or np.isinf(noise.freedom) or noise.rms < TOO_NOISY * error
    return noise.rms if sure or error is None else error


def _noise(found: Discovery, waves: Sequence[Oscillation]) -> dict[str, Any]:
    """The noise of every sensor and monitor, oscillations, and the spread of zeros between files."""
    study = found.study
    allowed = allowed_rms(found.study)
    sensors = {
        name: {
            "rms": noise.rms,
            "correlation": noise.neighbours,
            "hum_hz": list(noise.hum),
            "oscillations": [
                {"hz": w.frequency, "amplitude": w.largest[1], "largest_in": w.largest[0], "recorded": list(w.recorded)}
                for w in waves
                if w.output == name
            ],
            "from_monitors": found.caused[name],
            "allowed": allowed.get(name, noise.rms),
            "unit": _unit(found, name),
        }
        for name, noise in study.noise.items()
    }
    monitors = {name: {"rms": level, "unit": _unit(found, name)} for name, level in study.monitor_noise.items()}
    known = [name for name in study.spread if study.zero(name) > 0]
    zeros = {name: {"spread": zero_spread(study, name), "unit": _unit(found, name)} for name in known}
    return {"sensors": sensors, "monitors": monitors, "zeros": zeros}


def remainder(found: Discovery) -> dict[str, Any] | None:
    """The significant residual where not everything is explained: its size, share and channel, and whether it is that
    of the held-out experiments alone."""
    if found.verdict not in ("partly_explained", "unexplained") or found.strained:
        return None
    state = found.named.lack_of_fit
    alone = noise_alone(found.named)
    if whole := _all_of(found, alone):
        return _left(found, whole.output, abs(whole.value), 1.0)
    if found.hidden:
        return _of_alike_samples(found, "rmse", held_out=False)
    if found.named.ids and alone:
        return _of_alike_samples(found, "held_out_rmse", held_out=True)
    error = errors(found.named_study, found.named.ids, found.named.fitted.values)
    left = beyond_noise(state, error, floor(found.study, error["rmse"]))
    share = _unexplained(found.named_study, found.named) / _at_first(found)
    return _left(found, found.study.plant.outputs[0].name, left, share)


def _all_of(found: Discovery, alone: bool) -> Shift | Missed | Unlike | None:
    """What alone is left, if it is one thing that no effect does; `alone`: beside it there is noise alone."""
    if found.shifted and alone:
        return found.shifted
    if found.missed and alone and not found.named.ids:
        return found.missed
    return found.unlike if between_files.disagree(found) else None


def _left(found: Discovery, output: str, rms: float, share: float, held_out: bool = False) -> dict[str, Any]:
    """What is left of an output (SI, rms), and its share of what was not noise."""
    told = {"output": output, "rms": rms, "unit": _unit(found, output)}
    return told | {"share": min(1.0, share), "channel": channel(found), "held_out": held_out}


def beyond_noise(state: LackOfFit, error: Mapping[str, Any], noise: float) -> float:
    """What a model leaves beyond noise (SI, rms): of samples weighted as in fits, at most what the `noise` (SI, rms)
    does not explain of the error of all of them; where the error is below the noise, at most the error."""
    if error["rmse"] is None:
        return state.structure
    squares = float(error["rmse"]) ** 2
    return min(state.structure, (squares - noise**2 if noise**2 < squares else squares) ** 0.5)


def _of_alike_samples(found: Discovery, kind: str, held_out: bool) -> dict[str, Any]:
    """What is left of samples that all weigh alike (an error's `kind`): of the output of which that is most beside its
    noise, and the share of what was not noise, over all outputs in units of theirs."""
    noise = {n: one.total**2 + (0.0 if held_out else found.caused[n] ** 2) for n, one in found.study.noise.items()}

    def beyond(study: Study, option: Option) -> dict[str, float]:
        error = errors(study, option.ids, option.fitted.values)
        outputs = error.get("outputs", {found.study.plant.outputs[0].name: error})
        return {n: max((outputs[n][kind] or 0.0) ** 2 / level - 1, 0.0) for n, level in noise.items() if level > 0}

    left, before = beyond(found.named_study, found.named), beyond(found.search.base_study, found.base)
    most = max(left, key=lambda n: left[n])
    share = sum(left.values()) / max(sum(before.values()), 1e-300)
    return _left(found, most, (left[most] * noise[most]) ** 0.5, share, held_out)


def channel(found: Discovery) -> str | None:
    """The channel in which the residual arises; None without a residual."""
    return None if found.verdict == "no_effect" else _told_channel(found)[0]


def _told_channel(found: Discovery) -> tuple[str | None, str]:
    """The channel in which a residual arises, and why it is that one.

    That of the first effect, also where the effect explains nearly all and only its form is not quite right, but where
    others explain as much that of the isolation, if one of them acts there; else that of the isolation, unless a zero
    or a parameter that cannot be right tells another.
    """
    if _by_effect(found):
        alike = {found.study.catalogue[name].channel for name in found.equivalent.get(found.chosen.ids[0], [])}
        if found.isolated and found.isolated.channel in alike:
            return found.isolated.channel, isolated_words(found.isolated)
        first = found.study.catalogue[found.chosen.ids[0]].channel
        return first, f"the {first} channel explains most of it"
    if (impossible := _in_a_file(found)) is not None:
        return impossible
    known = found.study.plant.own_channels
    moved = [n for n in implausible(found.study.plant, found.base.fitted) if n in known]
    for own in dict.fromkeys(known[n] for n in moved):
        names = [n for n in moved if known[n] == own]
        if len(names) >= TELL_CHANNEL:  # far from where they belong, they have taken up what their own part lacks
            return own, f"the fit needs implausible values of {' and '.join(names)}, which belong to it"
    return (found.isolated.channel, isolated_words(found.isolated)) if found.isolated else (None, "")


def _in_a_file(found: Discovery) -> tuple[str, str] | None:
    """The channel of what cannot be right in one file, and what that is."""
    if found.shifted:
        own = _own_channel(found, found.shifted.output)
        return own, f"in {found.shifted.piece} the zero of {found.shifted.output} would have to be far too large"
    if found.missed and noise_alone(found.base):
        own = _own_channel(found, found.missed.output)
        return own, f"in {found.missed.piece} {found.missed.output} shows what the model does not have"
    if found.unlike and noise_alone(found.base):
        own = next(s.channel or s.name for s in found.study.plant.inputs if s.name == found.unlike.input)
        return own, f"in {found.unlike.piece} the gain of {found.unlike.input} would have to be far off"
    return None


def _own_channel(found: Discovery, output: str) -> str:
    """The channel of an output."""
    return next(o.channel for o in found.study.plant.outputs if o.name == output)


def isolated_words(isolation: Isolation) -> str:
    """Why the isolation tells its channel, and which others it hardly tells from that."""
    best = isolation.evidence.get(isolation.channel, 0.0)
    near = [c for c, e in isolation.evidence.items() if c != isolation.channel and e > NEARLY_AS_MUCH * best]
    if isolation.disturbance:
        nearly = f", and nearly as large where the {' or the '.join(near)} channel does" if near else ""
        return f"the residual is largest where the {isolation.channel} channel acts{nearly}"
    nearly = f", and the {' or the '.join(near)} channel nearly as much" if near else ""
    return f"the {isolation.channel} channel explains most of it{nearly}"


def contested(found: Discovery) -> str:
    """Why the summary names another channel than the isolation does; "" where it is the same, or that of an effect."""
    told, why = _told_channel(found)
    if _by_effect(found) or found.isolated is None or told == found.isolated.channel:
        return ""
    return why


def _by_effect(found: Discovery) -> bool:
    """Whether the first effect explains the residual, or nearly all of it."""
    explained = 1 - found.chosen.lack_of_fit.excess / max(found.base.lack_of_fit.excess, 1.0)
    return bool(found.chosen.ids) and (found.verdict != "unexplained" or explained > MOSTLY)


def final_model(found: Discovery) -> Model:
    """The plant's model with the effects that are named and the identified values as its defaults: as another plant
    starts, wherever these recordings did."""
    chosen, catalogue = found.named, found.study.catalogue
    values = found.study.geometry | chosen.fitted.values
    for name in chosen.ids:
        values = switched_on(catalogue[name]) | values
    model = with_effects(found.recordings.plant.model, chosen.ids, catalogue)
    names = set(model.parameter_values())
    return model.with_values({n: float(v) for n, v in values.items() if n in names})


def errors(study: Study, ids: Ids, values: Mapping[str, float]) -> dict[str, Any]:
    """Errors of every output on training and held-out experiments, and for each experiment; None without an answer.

    A record's own zeros and switching instants are taken at their most likely values.
    """
    names = list(dict.fromkeys([*study.noise, *(r.output for p in study.pieces for r, _ in p.beside)]))
    try:
        answers = study.response(ids, study.pieces).outputs(values)
        corrected = [with_nuisances(study, p, y, without=NOISE_OF) for p, y in zip(study.pieces, answers, strict=True)]
        rows = [row for p, y in zip(study.pieces, corrected, strict=True) for row in _rows(p, y)]
        rows += [(r.piece, r.output, r.record, r.answer) for r in second_output.predicted(study, ids, values)]
    except KernelError:
        return _by_output(study, {name: None for name in names})
    return _by_output(study, {name: [(p, r, y) for p, n, r, y in rows if n == name] for name in names})


def _rows(piece: Piece, answer: np.ndarray) -> list[tuple[Piece, str, np.ndarray, np.ndarray]]:
    """Each output of a piece that takes part in fits: its name, the record and the answer."""
    parts = zip(piece.case.readings, piece.case.parts, strict=True)
    return [(piece, reading.output, piece.record[part], answer[part]) for reading, part in parts]


def _by_output(
    study: Study, rows: Mapping[str, Sequence[tuple[Piece, np.ndarray, np.ndarray]] | None]
) -> dict[str, Any]:
    """The errors of the first output, and of all where there are several."""
    outputs = {name: _output_errors(study.plant.quantity(name), pairs) for name, pairs in rows.items()}
    return outputs[study.plant.outputs[0].name] | ({"outputs": outputs} if len(outputs) > 1 else {})


def _output_errors(q: Quantity, pairs: Sequence[tuple[Piece, np.ndarray, np.ndarray]] | None) -> dict[str, Any]:
    """The errors of one output, given the record and the answer of every piece; None without an answer."""
    summary: dict[str, Any] = {"rmse": None, "fit_percent": None, "held_out_rmse": None, "held_out_fit_percent": None}
    if pairs is None:
        return summary | q.units | {"per_experiment": {}}
    each = {
        p.name: {"rmse": rmse([r], [y]), "fit_percent": _finite(goodness([r], [y])), "held_out": p.held_out}
        for p, r, y in pairs
    }
    for prefix, held in (("", False), ("held_out_", True)):
        part = [(r, y) for p, r, y in pairs if p.held_out == held]
        if part:
            summary[f"{prefix}rmse"] = rmse(*zip(*part, strict=True))
            summary[f"{prefix}fit_percent"] = _finite(goodness(*zip(*part, strict=True)))
    return summary | q.units | {"per_experiment": each}


def ranking(found: Discovery) -> list[dict[str, Any]]:
    """Every refitted option with its evidence over the base, best first; `implausible` are effects that cannot be as
    they were fitted."""
    options = {
        o.ids: o
        for o in [*(o for r in found.search.rounds for o in r.options), found.chosen, *found.search.rivals]
        if o.ids
    }
    ordered = sorted(options.values(), key=lambda o: -o.evidence)
    return [
        {
            "effects": list(o.ids),
            "evidence": _finite(o.evidence - found.base.evidence),
            "ratio": o.lack_of_fit.ratio,
            "implausible": list(o.impossible),
        }
        for o in ordered
    ]


def advice(found: Discovery, odd: str = "") -> str:
    """One sentence: what to measure next, and why; `odd` says which files have most of a residual."""
    why, proposal = IMPLAUSIBLE if found.strained else WHY[found.verdict], found.proposal
    little = found.verdict == "no_effect" and (reservations.thin(found) or reservations.still(found))
    if little:
        words = proposal.words if proposal else "an experiment of another kind"
        return f"{why}, but {little}: record {words}, to see what these recordings cannot show."
    unsure, rest = reservations.loud(found), "record some rest in each file, or state the noise under [noise]"
    if unsure or odd:
        do = f"{rest} in bench.toml" if unsure else "record again what is in it, to see whether that shows again"
        return f"{why}, but {unsure or odd}: {do}."
    if found.verdict == "no_effect" and found.strained:
        return f"{why}: look at the geometry and at the units, and record an experiment of another kind."
    if found.verdict == "no_effect":
        return f"{why}: no further experiment is needed unless the {_plant(found)} is used beyond the recorded range."
    if found.verdict in ("unexplained", "partly_explained"):
        return f"{why}: {_beside(found)}."
    return f"{why}: {_apart(found)}."


def _apart(found: Discovery) -> str:
    """Which experiment tells the named effects from others, or that there is none."""
    proposal = found.proposal
    alike = [f"{name} from {either(others)}" for name, others in found.equivalent.items() if others]
    names = " and ".join(alike or found.chosen.ids)
    if proposal is None or proposal.deviations < DIFFER or _times(found, proposal) > OFTEN:
        if found.verdict == "ambiguous" and proposal is not None and proposal.discrimination < ONE_THING:
            return f"nothing distinguishes {names}: in the {_plant(found)} they are one thing under several names"
        if found.verdict == "ambiguous":
            return f"no experiment {kind(found.study.plant)} distinguishes {names}; a second sensor may"
        sensors = {o.channel for o in found.study.plant.outputs}
        recorded = all(found.study.catalogue[name].channel in sensors for name in found.chosen.ids)
        other = "with another sensor" if recorded else "on another specimen"
        return f"repeat the experiments {other} to see whether the effect is the same"
    apart = f"by {proposal.deviations:.0f} standard deviations of the noise"
    if found.verdict == "ambiguous":
        times = _times(found, proposal)
        often = f" {times} times, each of" if times > 1 else ","
        return f"record {proposal.words}{often} which distinguishes {names} {apart} or more"
    return f"to confirm {names}, record {proposal.words}, for which it differs from the nearest rival {apart}"


def _times(found: Discovery, proposal: Proposal) -> int:
    """How often to record what is proposed, so that no set of equivalent effects is left."""
    form = equivalence.form_share(found.chosen, found.repeated)
    gains = [found.chosen_gains[name] for name, others in found.equivalent.items() if others]
    least = max((equivalence.told_apart(found.chosen, gain, form) for gain in gains), default=0.0)
    return math.ceil(least / (2 * proposal.discrimination))


def _beside(found: Discovery) -> str:
    """What to record where a residual remains, and why."""
    alike = [f"{name} and {len(others)} others" for name, others in found.equivalent.items() if others]
    if found.repeated and found.verdict == "partly_explained" and alike:
        moved = " and ".join(s.name for s in found.study.plant.inputs)
        return f"record other levels of {moved}, because at one level {' and '.join(alike)} look alike"
    if between_files.disagree(found):
        return (
            "find out what differs between the files (another specimen, other dimensions, a part that was lost, a "
            "monitor's scale), and analyse those that are alike on their own"
        )
    told, why = _told_channel(found)
    said = f"{at_channel(found.study.plant, told or '')}, because {why}"
    if not contested(found) or found.isolated is None:
        return said
    other = isolated_words(found.isolated)
    return f"{said}; the channel is uncertain, as {other}"


def _effect(found: Discovery, name: str) -> dict[str, Any]:
    effect, fitted = found.study.catalogue[name], found.chosen.fitted
    names = [q.name for q in effect.parameters if q.name in fitted.names]
    units = {q.name: q.unit for q in effect.parameters}
    return {
        "id": name,
        "channel": effect.channel,
        "equivalent": found.equivalent.get(name, []),
        "evidence": _finite(evidence(found, name)),
        "explained": _explained(found, name),
        "parameters": {n: _parameter(fitted, n, units[n], size_interval(effect, fitted, n)) for n in names},
    }


def _explained(found: Discovery, name: str) -> float:
    """The share of the misfit beyond noise that an effect explains, given the other named effects."""
    gained = found.chosen_gains.get(name, 0.0)
    return float(np.clip(gained / _at_first(found), 0.0, 1.0))


def _unexplained(study: Study, option: Option) -> float:
    """The misfit of all recordings, held-out ones too, beyond what noise leaves; in training alone where the option has
    no answer in one that is held out."""
    everywhere = math.isfinite(option.squares)
    squares, pieces = (option.squares, study.pieces) if everywhere else (option.fitted.cost, study.training)
    return max(squares - residuals.expected_squares(study, pieces), 0.0)


def _at_first(found: Discovery) -> float:
    """That of the base model, not less than 1."""
    return max(_unexplained(found.search.base_study, found.base), 1.0)


def evidence(found: Discovery, name: str) -> float:
    """Log evidence of an effect: that of the model with it less that of the best model without it."""
    without = [o for r in found.search.rounds for o in r.options if name not in o.ids]
    rest = set(found.chosen.ids) - {name}
    allowed = [found.base, *(o for o in without if set(o.ids) <= rest)]
    return float(found.chosen.evidence - max(o.evidence for o in allowed))


def _parameter(fitted: Fit, name: str, unit: str, ends: tuple[float, float] | None = None) -> dict[str, Any]:
    low, high = ends or interval(fitted, name)
    return {
        "value": float(fitted.values[name]),
        "stderr": _finite(fitted.stderr[name]),
        "ci95": [_finite(low), _finite(high)],
        "unit": unit,
    }


def _plant(found: Discovery) -> str:
    return found.study.plant.name


def _unit(found: Discovery, name: str) -> str:
    return found.study.plant.quantity(name).unit


def _tests(found: Discovery) -> dict[str, Any]:
    sides = {
        "before": (found.tests_before, found.base.lack_of_fit),
        "after": (found.tests_after, found.chosen.lack_of_fit),
    }
    first = found.search.rounds[0]
    return {
        name: {k: _finite(v) for k, v in tests.items()}
        | {"z_slow": state.z_slow, "z_total": state.z_total, "structure": state.structure}
        for name, (tests, state) in sides.items()
    } | {
        "latent_evidence": {k: _finite(v) for k, v in found.isolated.evidence.items()} if found.isolated else {},
        "disturbance": bool(found.isolated and found.isolated.disturbance),
        "largest_score": float(first.scores[0].statistic) if first.scores else 0.0,
        "threshold": float(first.threshold),
        "numeric_gain": found.numeric,
    }


def _finite(value: float) -> float | None:
    return float(value) if math.isfinite(value) and not isinstance(value, bool) and not np.isnan(value) else None
