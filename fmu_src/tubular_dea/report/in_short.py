"""The summary of a report, in plain words, and what the recordings could not have shown."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ..discover.answer import between_files
from ..discover.answer.outcome import beyond_noise
from ..discover.answer.remarks import not_named
from ..discover.answer.reservations import compensating, forced, from_the_start, hidden_by_noise, loud
from ..discover.engine import Discovery
from ..discover.options.acceptance import far, noise_alone
from ..discover.options.residuals import FAR
from ..discover.search import equivalence
from ..model.effect import Effect
from ..model.units import in_units_of, in_words
from ..recordings.table import FEW, some
from .effects import size_words
from .page import Page
from .parts import AFTER, BEFORE, RECORD
from .svg import bars

CONFIDENCE = {
    "no_effect": "The residual is no larger than noise: no effect of the catalogue explains more of it than chance "
    "does in 999 of 1000 such sets of recordings.",
    "effect_found": "Everything that was tried in its place explains the recordings worse than chance allows.",
    "ambiguous": "It is certain that something of this kind is missing. These recordings cannot show which of "
    "the named effects it is.",
    "partly_explained": "Each named effect reduces what is left of experiments that took no part in the fits, weighted "
    "as in the fits. What remains is more than noise, in its slow part at least, so something else is missing too.",
    "unexplained": "It is certain that something is missing: the residual is larger than the noise. No effect of the "
    "catalogue, alone or with others, explains most of it and reduces the error on experiments that took no part in "
    "the fits.",
}
STRAINED = (
    "The named effects explain the recordings to within their noise, but only with what would be implausible: "
    "{strained}. So something else may be there."
)
HIDING = (
    "The model explains the recordings to within their noise, but only with parameters of the plant that are far from "
    "the declared ones. Something that is missing may hide in them."
)
DRIFTS = (
    "The residual is larger than noise, but no larger than that of a sensor whose zero drifts slowly, and no effect of "
    "the catalogue explains clearly more of it than such a drift. A slow effect of this size would look the same."
)
LOUDER = (
    "The residual is larger than the noise that could be estimated, but no part of the recordings is quiet: either "
    "something is missing, or the noise is larger and its errors last longer. Some rest in each file would "
    "tell, or its size under [noise] in bench.toml. No effect of the catalogue explains most of the residual."
)
FAR_ABOVE = (
    "Something is missing, or the noise is much larger than could be estimated: no part of the recordings is quiet, "
    "and the residual is {ratio:.0f} times what was estimated. Some rest in each file would make it certain, or the "
    "size of the noise under [noise] in bench.toml. No effect of the catalogue explains most of the residual."
)
DROWNED = (
    "The residual is no larger than what the noise of sensors and inputs may cause, but so is most of what the records "
    "show: a model is hardly tested by them. If an input is known better than that, state its noise under [noise] in "
    "bench.toml."
)
APART = (
    "The residual is no larger than slow noise may be, but a few files have most of it, as noise would not. Something "
    "may be missing that shows in these alone."
)
QUESTION = "Asked before the search: "  # begins a remark that repeats a question
TOLD = "Told before the search: "  # and one that repeats what was told
LEFT = "what noise and sampling allow"
NOTHING = "No effect of the catalogue is missing. The model with its own parameters refitted explains these recordings."
NOT_SEEN = "No effect of the catalogue is seen to be missing, but {but}."
UNKNOWN = "Something {is_} missing, but none of the effects that were tried explains it, so none is named."
NO_ONE_MODEL = "The files differ: no one model explains all of them, though nothing is missing in any of them alone."
NO_MONITOR = (
    "It is certain that something differs between the files: the residual is noise only with a gain for each file that "
    "no monitor has. What it is they do not tell; it may also be an effect that is no candidate."
)
MOST_OF = 0.5  # share of what an error is beyond the sensor's noise from which on a cause is said to be its reason
SLIGHTLY = 1.05  # times what an effect leaves from which on another one in its place explains the recordings less well
MORE = 1.1  # times the sensor's noise from which on an error is seen to be more
BETTER = 1.03  # times the error on held-out experiments as declared that it is refitted, to be said
WORSE = 1.1  # times the error on held-out experiments without effects that it is with them, to be said
WHITE = 3.0  # standard deviations of the whiteness of noise, of which noise has more in one of 700 recordings
SHOWN = 3  # effects that could not be seen, with their limits,
LISTED = 6  # and those listed that could not be at any usual size
ANY_SIZE = "any size"
MOST_USUAL = 10.0  # times its usual size up to which a detection limit is told: it assumes that the model is linear
STRONGEST = f"even {MOST_USUAL:.0f} times as strong as usual"


def asked_first(remarks: Sequence[str]) -> list[str]:
    """That an answer may be wrong, where something was asked before the search."""
    asked = [r.removeprefix(QUESTION) for r in remarks if r.startswith(QUESTION)]
    if not asked:
        return []
    more = f" (and {len(asked) - 1} more)" if len(asked) > 1 else ""
    return [f"all this may be wrong: first see to what was asked before the search: {asked[0]}{more}"]


def first_remark(remarks: Sequence[str], said: Sequence[str]) -> list[str]:
    """The first remark that has not been `said`, and how many more the report has."""
    left = [r for r in remarks if not r.startswith((QUESTION, TOLD)) and not any(r.rstrip(".") in s for s in said)]
    if not left:
        return []
    return [left[0], *([f"{counted(len(left) - 1, 'more remark')} in the report"] if len(left) > 1 else [])]


def in_short(page: Page, found: Discovery, outcome: dict[str, Any]) -> None:
    """What was found, how certain it is, the data behind it, what could not be seen, and what to do next."""
    page.heading("Summary")
    first = [f"{said[0].upper()}{said[1:]}" for said in asked_first(outcome["remarks"])]
    page.answers([("What was found?", [*_found(found, outcome), *first])])
    page.drawings(_errors(found, outcome))
    odd = between_files.in_few_files(found, outcome["error"]["after"])
    files = sorted({p.source for p in found.study.pieces})
    held = ", ".join(outcome["held_out"])
    apart = (
        f"Held out of every fit, to judge the result by: {held}." if held else "No experiment was held out of the fits."
    )
    questions = [
        (
            "How certain is it?",
            [
                APART if odd else _confidence(found),
                *forced(found),
                *from_the_start(found),
                *compensating(found),
                *_driven(found, outcome),
                *_left(found, outcome),
                *_rivals(outcome),
            ],
        ),
        ("Which data is it based on?", [f"{counted(len(files), 'recording')} with {_samples(found)}. {apart}"]),
        ("What else should be known?", outcome["remarks"]),
        ("How were the files read?", outcome["reading"]),
        ("Which effects could these recordings not have shown?", list(_hidden(found, outcome))),
        ("What should be measured next?", [outcome["next_experiment"]]),
    ]
    page.answers((question, texts) for question, texts in questions if texts)


def _unknown(found: Discovery) -> str:
    """That something is missing, or seems to be."""
    if between_files.disagree(found):
        return NO_ONE_MODEL
    return UNKNOWN.format(is_="seems to be" if may_be_louder(found) else "is")


def may_be_louder(found: Discovery) -> bool:
    """Whether what nothing explains may be noise that is larger than could be estimated."""
    return found.verdict == "unexplained" and not _noise_known(found) and found.named.lack_of_fit.ratio < FAR


def _confidence(found: Discovery) -> str:
    """How certain the verdict is."""
    if between_files.disagree(found):
        return NO_MONITOR
    if found.verdict == "unexplained" and not _noise_known(found):
        return LOUDER if may_be_louder(found) else FAR_ABOVE.format(ratio=found.named.lack_of_fit.ratio)
    if found.strained:
        return STRAINED.format(strained=" and ".join(found.strained)) if found.chosen.ids else HIDING
    if found.verdict == "no_effect" and found.wandering:
        return DRIFTS
    if found.verdict == "no_effect" and hidden_by_noise(found):
        return DROWNED
    return LOUDER if loud(found) else CONFIDENCE[found.verdict]


def _left(found: Discovery, outcome: dict[str, Any]) -> list[str]:
    """What is left where the verdict does not tell it: a small remainder, or noise that is slower than was known."""
    state, error, noise = found.named.lack_of_fit, outcome["error"], outcome["noise_floor"]
    if found.verdict in ("unexplained", "partly_explained") or found.wandering:
        return []
    if not noise_alone(found.named):
        after = beyond_noise(state, error["after"], noise)
        before = beyond_noise(found.base.lack_of_fit, error["recalibrated"], noise)
        small, of = (in_units_of(size, error["after"]) for size in (after, before))
        return [f"A small remainder is left: {small} rms beyond the noise, where {of} was before."]
    if found.tests_after["whiteness"] <= WHITE:
        return []
    wider, said = f"{found.tests_after['widening']:.1f}", "The residual is not white, though: its values"
    if wider == "1.0":
        return [f"{said} depend on those shortly before, so intervals may not be exact."]
    return [
        f"{said} resemble those shortly before, as in noise that is slower than was seen, or beside a law that is not "
        f"quite the plant's. The intervals of parameters may be too narrow: take them as about {wider} times as wide."
    ]


def _driven(found: Discovery, outcome: dict[str, Any]) -> list[str]:
    """Why the error is more than the sensor's noise where nothing else is missing."""
    noise, error = outcome["noise"]["sensors"][found.study.plant.outputs[0].name], outcome["error"]["after"]["rmse"]
    if found.verdict in ("unexplained", "partly_explained") or not noise_alone(found.named):
        return []
    noisy = [name for name, monitor in outcome["noise"]["monitors"].items() if monitor["rms"] > 0]
    if not noisy or error is None or min(error, noise["allowed"]) < MORE * noise["rms"]:
        return []
    if noise["from_monitors"] ** 2 < MOST_OF * (error**2 - noise["rms"] ** 2):
        return [
            "The error is larger than the sensor's noise because of samples where inputs change: what an input "
            "did between two samples is not known there, so these count less."
        ]
    return [
        f"The error is larger than the sensor's noise because the noise of {' and '.join(noisy)} drives the model too, "
        "and is counted as noise here."
    ]


def _samples(found: Discovery) -> str:
    """The samples of all recordings in words; a sample may hold several outputs."""
    outputs = {r.output for p in found.study.pieces for r in p.case.readings}
    samples = sum(p.case.instants.size for p in found.study.pieces)
    return f"{samples} samples" + (f" of {len(outputs)} outputs" if len(outputs) > 1 else "")


def counted(number: int, word: str) -> str:
    """A number of things in words."""
    return f"{number} {word}{'' if number == 1 else 's'}"


def not_seen(page: Page, found: Discovery, outcome: dict[str, Any]) -> None:
    """The table of the smallest sizes that these recordings would have shown."""
    if not outcome["invisible"]:
        return
    page.heading("What these recordings would not have shown", level=3)
    named = _named(outcome)
    values = [value for sizes in outcome["invisible"].values() for value in sizes.values()]
    page.text(
        "The detection limit of every effect: the smallest size that would have been seen with a probability of 80 %, "
        "whatever else of each record is fitted. Where an effect grows as its parameter falls (a rate limit), it is "
        "the largest value."
        + (f' "{ANY_SIZE}": the model\'s own parameters compensate for the effect.' if None in values else "")
        + _beside_misfit(found)
    )
    rows = [
        [
            name,
            f"{parameter}{_held_at(found, outcome, name)}",
            _shown_limit(found.study.catalogue[name], parameter, value),
        ]
        for name, sizes in sorted(outcome["invisible"].items())
        if name not in named
        for parameter, value in sizes.items()
    ]
    page.table(["effect", "parameter", "not visible"], rows)


def _found(found: Discovery, outcome: dict[str, Any]) -> list[str]:
    """What is missing in the model, effect by effect."""
    named = outcome["effects"]
    said = [] if named else [_nothing(found, outcome) if outcome["verdict"] == "no_effect" else _unknown(found)]
    for entry in named:
        effect = found.study.catalogue[entry["id"]]
        sizes = size_words(effect, entry, found.study.plant.model)
        said.append(f"{effect.id}: {effect.summary[0].lower()}{effect.summary[1:]}; {sizes}.")
        said += _in_its_place(found, entry)
    said += [
        f"An oscillation of {wave['hz']:.4g} Hz that no recorded input drives; see below."
        for wave in oscillating(outcome)
    ]
    return said


def _nothing(found: Discovery, outcome: Mapping[str, Any]) -> str:
    """That no effect is missing, or why something may hide: implausible parameters, noise that nothing tells, files
    that are unlike the others."""
    but = f"{' and '.join(found.strained)} would be implausible" if found.strained else loud(found)
    but = but or between_files.in_few_files(found, outcome["error"]["after"])
    return NOT_SEEN.format(but=but) if but else NOTHING


def _in_its_place(found: Discovery, entry: Mapping[str, Any]) -> list[str]:
    """The effects that may be there in place of one that was found, and how well they explain the recordings."""
    left = {other: _times_left(found, entry["id"], other) for other in entry["equivalent"]}
    near, said = [other for other, times in left.items() if times < SLIGHTLY], []
    nearly = [other for other in near if apart_by_form(found, entry["id"], other) and not found.repeated]
    alike = [other for other in near if other not in nearly]
    if alike:
        well = "nearly as well, or well enough that one operating point cannot tell" if found.repeated else "as well"
        said.append(f"It may equally be {_which_explain(alike)} {well}.")
    if nearly:
        said.append(
            f"It may {'also ' if alike else ''}be {_which_explain(nearly)} nearly as well: worse by more "
            "than chance, but by no more than a law that is not exact may be."
        )
    worse = [f"{other} ({times:.2f} times)" for other, times in left.items() if times >= SLIGHTLY]
    if worse:
        also = "also " if near else ""
        said.append(
            f"With a law that is slightly different, it may {also}be {some(worse, FEW)}: what {entry['id']} leaves is "
            "left so many times by that."
        )
    if len(left) > FEW:
        said.append("So these recordings hardly tell what it is.")
    return said


def _which_explain(effects: Sequence[str]) -> str:
    """Effects, and that they explain the recordings, to be continued by how well."""
    return f"{some(effects, FEW)}, which {'explains' if len(effects) == 1 else 'explain'} the recordings"


def apart_by_form(found: Discovery, name: str, other: str) -> bool:
    """Whether `other` in place of the effect `name` fits worse than by chance: equivalent as laws are inexact."""
    return equivalence.beyond_chance(found.chosen, found.search.rivals, name, other)


def _times_left(found: Discovery, name: str, other: str) -> float:
    """How many times the residual (rms) of the choice is left with `other` in place of the effect `name`."""
    squares = [r.squares for r in equivalence.in_its_place(found.chosen, found.search.rivals, name, other)]
    return float(np.sqrt(min(squares, default=found.chosen.squares) / found.chosen.squares))


def oscillating(outcome: Mapping[str, Any]) -> list[dict[str, Any]]:
    """The oscillations of the readings that no recorded input drives."""
    sensors = outcome["noise"]["sensors"].values()
    return [wave for sensor in sensors for wave in sensor["oscillations"] if not wave.get("recorded")]


def _errors(found: Discovery, outcome: dict[str, Any]) -> list[tuple[str, str]]:
    """The model's error before and after, next to the noise, as bars; of every output."""
    effects = " and ".join(e["id"] for e in outcome["effects"])
    first = found.study.plant.outputs[0]
    where = "on fitted and on held-out experiments" if outcome["held_out"] else "on the fitted recordings"
    after = f" (before) and with {effects} (after)" if effects else ""
    declared = " ".join(about_held_out(found, outcome["error"]))
    caption = (
        f"Root mean square error of the {first.headings[0]} {where}: with the model's own parameters refitted{after}. "
        f"{least(found)} {declared}".strip()
    )
    drawn = [(_error_bars(outcome, outcome["error"], outcome["noise_floor"]), caption)]
    sensors = outcome["noise"]["sensors"]  # those that take part in fits
    for name in [n for n in outcome["error"]["after"].get("outputs", {}) if n in sensors and n != first.name]:
        of_it = {kind: errors["outputs"][name] for kind, errors in outcome["error"].items()}
        drawn.append((_error_bars(outcome, of_it, sensors[name]["rms"]), f"The same of the {name}."))
    return drawn


def _error_bars(outcome: Mapping[str, Any], errors: Mapping[str, Any], noise: float) -> str:
    """The errors of one output before and after, and its noise (SI)."""
    kinds = {"": "rmse"} if not outcome["held_out"] else {", fitted": "rmse", ", held out": "held_out_rmse"}
    rows = []
    for kind, key in kinds.items():
        rows.append((f"{'before' if outcome['effects'] else 'the model'}{kind}", errors["recalibrated"][key], BEFORE))
        rows += [(f"after{kind}", errors["after"][key], AFTER)] if outcome["effects"] else []
    rows.append(("sensor's noise", noise, RECORD))
    entries = []
    for words, value, colour in rows:
        told = "no answer" if value is None else in_units_of(value, errors["after"])
        entries.append((words, value or 0.0, told, colour))
    return bars("errors", entries)


def about_held_out(found: Discovery, errors: dict[str, Any]) -> list[str]:
    """What is odd about the errors on held-out experiments: the model as declared predicts them better than refitted,
    or effects make them larger."""
    declared, refitted, after = (errors[n]["held_out_rmse"] for n in ("published", "recalibrated", "after"))
    said = []
    if declared is not None and refitted is not None and BETTER * declared < refitted:
        one, other = (in_units_of(v, errors["published"]) for v in (declared, refitted))
        said.append(
            f"On the held-out experiments the model without effects errs less as it was declared ({one}) than "
            f"refitted ({other}): the refit bends parameters to imitate something in the other experiments."
        )
    if after is not None and refitted is not None and after > WORSE * refitted:
        said.append(
            "The error on the held-out experiments is larger with the named effects than without: it is smaller only "
            "if samples at which the inputs' noise acts count less. Do not rely on these names."
        )
    return said


def _noise_known(found: Discovery) -> bool:
    """Whether the first output's noise is known from what is quiet, or from repetitions."""
    return found.study.noise[found.study.plant.outputs[0].name].quiet


def stated(found: Discovery) -> bool:
    """Whether bench.toml states the noise of the first output."""
    return any(name in found.recordings.noise for name in found.study.plant.outputs[0].headings)


def least(found: Discovery) -> str:
    """What the sensor's noise means for the error of a model."""
    if stated(found):
        return "The sensor's noise is as bench.toml states it."
    if not _noise_known(found):
        return "No part of the recordings is quiet, so the sensor's noise is not known well: it may be smaller."
    return "The error of a model can be about as small as the sensor's noise, which is itself an estimate."


def _rivals(outcome: dict[str, Any]) -> list[str]:
    """The nearest rival that can be as it was fitted, and its residual."""
    named = [e["id"] for e in outcome["effects"]]
    equal = {other for e in outcome["effects"] for other in e["equivalent"]}
    best = next((r for r in outcome["ranking"] if r["effects"] == named), None)
    rivals = [r for r in outcome["ranking"] if len(r["effects"]) <= len(named) and r["effects"] != named]
    told = [r for r in rivals if not equal & set(r["effects"])]
    rivals = [r for r in told if not r.get("implausible")]
    if best is None or not rivals:
        return []
    plausible = "" if rivals[0] is told[0] else " of plausible size"
    other, ratio = " and ".join(rivals[0]["effects"]), rivals[0]["ratio"]
    said = (
        f"The nearest explanation{plausible} that can be told from {'these' if equal else 'it'}, {other}, leaves a "
        f"residual on fitted recordings of {ratio:.2f} times {LEFT}"
    )
    alike = f"{ratio:.2f}" == f"{best['ratio']:.2f}"
    own = "this one as much" if alike else f"this one {best['ratio']:.2f} times"
    ahead = best["evidence"] - rivals[0]["evidence"]
    if ratio <= best["ratio"]:
        return [f"{said}, {own}. But that one predicts the held-out experiments worse."]
    weighed = f", which is better by {ahead:.0f} in log evidence (5 would be very strong)" if ahead > 0 else ""
    return [f"{said}, {own}{weighed}."]


def _hidden(found: Discovery, outcome: dict[str, Any]) -> list[str]:
    """The effects with the largest detection limits relative to their usual sizes, in a sentence."""
    known, none, strongest = [], [], []
    named = _named(outcome)
    for name, sizes in outcome["invisible"].items():
        if name in named:  # beside the base model some could not be told; here they were
            continue
        effect = found.study.catalogue[name]
        for parameter, value in sizes.items():
            if value is None:
                none.append(name)
            elif (share := _share(effect, parameter, value)) > MOST_USUAL:
                strongest.append(name)
            else:
                known.append((share, effect, parameter, value))
    known.sort(key=lambda entry: -entry[0])
    shown = [(e, name, value, _held_at(found, outcome, e.id)) for _, e, name, value in known[:SHOWN]]
    said = "; ".join(f"{e.id} ({_meaning(e, name)}{at}: {_limit(e, name, value)})" for e, name, value, at in shown)
    seen = "The table below lists all effects."
    if found.verdict not in ("unexplained", "partly_explained") and not not_named(found):  # what remains may hide more
        seen = "Stronger ones would have been seen; the table below lists all effects."
    texts = [f"{said}. {seen}{_beside_misfit(found)}"] if said else []
    if strongest:
        texts.append(f"{some(strongest, LISTED)}: not {STRONGEST}.")
    if none:
        texts.append(f"{some(none, LISTED)} at any size: the model's own parameters compensate for it.")
    return texts


def _named(outcome: dict[str, Any]) -> set[str]:
    """The named effects and their equals, none of which these recordings hide."""
    return {name for entry in outcome["effects"] for name in (entry["id"], *entry["equivalent"])}


def _held_at(found: Discovery, outcome: dict[str, Any], name: str) -> str:
    """At which values of its other parameters an effect's detection limit holds, behind a comma; or nothing."""
    units = {q.name: q.unit for q in found.study.catalogue[name].parameters}
    shape = outcome.get("invisible_at", {}).get(name, {})
    said = ", ".join(f"{n} = {in_words(v, units[n])}" for n, v in shape.items())
    return f", at {said}" if said else ""


def _beside_misfit(found: Discovery) -> str:
    """That detection limits hold beside what the base model leaves, where that is much more than noise; or nothing."""
    if not far(found.base):
        return ""
    return (
        f" All this holds beside the base model, whose residual is {found.base.lack_of_fit.ratio:.3g} times the noise: "
        "with a model that leaves less, less could be seen."
    )


def _meaning(effect: Effect, parameter: str) -> str:
    """What a parameter of an effect is, for the middle of a sentence."""
    words = next(q.description for q in effect.parameters if q.name == parameter) or parameter.replace("_", " ")
    return f"{words[0].lower()}{words[1:]}"


def _share(effect: Effect, parameter: str, value: float) -> float:
    """A size of an effect relative to its usual one."""
    usual = abs(effect.typical[parameter] - effect.off.get(parameter, 0.0)) or 1.0
    share = abs(value) / usual
    return 1 / share if _smaller_is_more(effect, parameter) else share


def _smaller_is_more(effect: Effect, parameter: str) -> bool:
    """Whether the effect grows as this parameter falls: a rate limit, the end of a range."""
    return parameter in effect.shapes and parameter not in effect.off and effect.trades.get(parameter, 0.0) <= 0


def _shown_limit(effect: Effect, parameter: str, value: float | None) -> str:
    if value is None:
        return ANY_SIZE
    return STRONGEST if _share(effect, parameter, value) > MOST_USUAL else _limit(effect, parameter, value)


def _limit(effect: Effect, parameter: str, value: float) -> str:
    unit = next(q.unit for q in effect.parameters if q.name == parameter)
    size, off = in_words(value, unit), effect.off.get(parameter, 0.0)
    if off:
        return f"within {size} of {off:g}"
    return f"above {size}" if _smaller_is_more(effect, parameter) else f"below {size}"
