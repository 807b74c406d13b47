"""The report of a discovery: from the residual to its cause, step by step, in one page that opens offline."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from ..discover.answer.between_files import disagree, implausible_zero, in_few_files
from ..discover.answer.determined import determined
from ..discover.answer.outcome import TOO_NOISY, beyond_noise, contested, floor, remainder
from ..discover.answer.remarks import counted_backwards, unexplained_output
from ..discover.answer.reservations import loud, still, thin
from ..discover.engine import Discovery
from ..discover.options.acceptance import clean
from ..discover.options.options import Option
from ..discover.search.equivalence import form_share, told_apart
from ..discover.search.law_uncertainty import LAW
from ..discover.search.rounds import Round
from ..identify.fitting.misfit import BLOCK, SLOW_CHANCE
from ..model.units import in_units_of
from ..recordings.table import FEW, either, some
from .effects import effects
from .in_short import (
    LEFT,
    WHITE,
    about_held_out,
    apart_by_form,
    in_short,
    least,
    may_be_louder,
    not_seen,
    oscillating,
    stated,
)
from .latent_map import latent_map
from .page import Drawing, Page
from .parts import POINTS, bars, parameter_row, percent, record_and_residuals
from .residuals import Answered, answered

UNLIKE = (
    "the files do not agree with one model, unless the gain of {input} changed from file to file as no monitor's does."
)
WORDS = {
    "no_effect": "nothing is missing: the model explains these recordings to within their noise.",
    "effect_found": "the model lacks {names}.",
    "ambiguous": "the model lacks {names}, or {others}: these recordings cannot distinguish them{exactly}.",
    "partly_explained": "the model lacks {names}; a significant residual remains: {remainder}.",
    "unexplained": "the model {lacks} something that no effect of the catalogue explains{nearest}.",
}
STRAINED = "the model lacks {names}, or something that is in no catalogue: {strained} would be implausible with that."
HIDING = "nothing is seen to be missing, but {strained} would be implausible: something may hide in it."
TESTS = {  # of the residual's averages over 0.1 s, each in standard deviations of the noise
    "whiteness": "whiteness (Ljung and Box, in standard deviations)",
    "widening": "factor by which this widens standard errors (Newey and West)",
}
NEGLIGIBLE = 1e-3  # of the sensor's noise: what monitors add is not told as a number
SHOWN = 8  # scores of a round that are drawn


def report(found: Discovery, outcome: dict[str, Any]) -> Page:
    """The page for a discovery and its result.json."""
    page = Page("Close-loop report", f"{found.recordings.source}: {headline(found, outcome)}")
    in_short(page, found, outcome)
    shown = list(answered(found))
    most = max(shown, key=_missed)  # people look at a record before they believe a number
    without = " without effects" if found.named.ids else ""
    page.figure(*_record(most, f"{most.piece.name}, the recording that the model{without} misses most"))
    effects(page, found, outcome)
    page.heading("Statistical details")
    page.text("The rest of this page shows step by step how this was found, with the statistics by their usual names.")
    _errors(page, found, outcome)
    _trace(page, found, outcome)
    _ranking(page, found, outcome)
    _parameters(page, found, outcome)
    not_seen(page, found, outcome)
    if found.verdict in ("unexplained", "partly_explained"):
        page.heading("Where the model fails", level=3)
    if found.study.plant.inputs:
        page.figure(latent_map(found), "The residual over the model's output and over an input.")
    page.heading("The recordings", level=3)
    for one in shown:
        page.figure(*_record(one, one.piece.name))
    return page


def _averaged(samples: int) -> str:
    """Over how many samples the points of a figure are averages."""
    each = samples // POINTS
    return f"; averages over {each} samples" if each > 1 else ""


def headline(found: Discovery, outcome: Mapping[str, Any]) -> str:
    """The verdict of a discovery and its result.json in a sentence."""
    named = _one_of if found.verdict == "partly_explained" else summary
    each = [named(found, i) for i in found.chosen.ids]
    if named is _one_of and len(each) > 1 and any(found.equivalent.values()):
        each = [f"({number}) {words}" for number, words in enumerate(each, 1)]
    names = " and ".join(each)
    alike = {name: either(group) for name, group in found.equivalent.items() if group}
    one = len(found.chosen.ids) == 1
    others = ", or ".join(f"{other} in place of {'it' if one else name}" for name, other in alike.items())
    left = remainder(found)
    what = "" if left is None else _left_words(found, left)
    if found.verdict == "no_effect" and (reserved := _reserved(found, outcome)):
        return reserved
    if found.strained:
        return (STRAINED if found.chosen.ids else HIDING).format(names=names, strained=" and ".join(found.strained))
    if disagree(found) and found.unlike:
        return UNLIKE.format(input=found.unlike.input)
    lacks = "seems to lack" if may_be_louder(found) else "lacks"
    words = WORDS[found.verdict]
    return words.format(
        names=names, others=others, nearest=_nearest(found), remainder=what, lacks=lacks, exactly=_inexact(found)
    )


def _inexact(found: Discovery) -> str:
    """Which effects are equivalent to another only because laws are inexact; "" where all are within chance."""
    worse = [o for name, group in found.equivalent.items() for o in group if apart_by_form(found, name, o)]
    fit = "fits" if len(worse) == 1 else "fit"
    words = (
        f" for certain: {some(worse, FEW)} {fit} less well, as even the right law may, because laws are seldom exact"
    )
    return words if worse else ""


def _reserved(found: Discovery, outcome: Mapping[str, Any]) -> str:
    """What is said in place of that nothing is missing, where that is not certain; "" where it is."""
    if found.wandering:
        return "no effect is certain: a slowly drifting zero of the sensor explains what the model does not."
    if waves := oscillating(outcome):
        lines = " and ".join(f"{wave['hz']:.4g} Hz" for wave in waves)
        return f"no effect of the catalogue is missing, but something that nobody recorded oscillates at {lines}."
    if little := thin(found) or loud(found):
        return f"nothing is seen to be missing, but these recordings prove little: {little}."
    odd = in_few_files(found, outcome["error"]["after"])
    return f"no effect of the catalogue is seen to be missing, but {odd}." if odd else ""


def _left_words(found: Discovery, left: Mapping[str, Any]) -> str:
    """A significant residual in words: its size, and its share."""
    where, there = (" on held-out experiments", " there") if left["held_out"] else ("", "")
    plant = found.study.plant
    of = "" if left["output"] == plant.outputs[0].name else f" of {left['output']}"
    size = _amount(left["rms"], plant.quantity(left["output"]).units)
    return f"{size} rms{of}{where}, {percent(left['share'])} of what was not noise{there}"


def _nearest(found: Discovery) -> str:
    """What comes nearest to an explanation, and how near, or why it is none; "" where nothing does."""
    if found.chosen.ids:
        return _how_near(found, found.chosen)
    for name, why in found.search.withdrawn.items():
        return f" (nearest: {name}, but {why})"
    tried = found.search.rounds[-1].options if found.search.rounds else []
    best = max(tried, key=lambda option: option.evidence, default=found.base)
    if best.evidence <= found.base.evidence:
        return ""
    return _how_near(found, best, f", with {best.wrong_with(best.impossible[0])}" if best.impossible else "")


def _how_near(found: Discovery, option: Option, strength: str = "") -> str:
    """The effects of an option, their `strength` in words, and how much they leave."""
    stays = max(option.lack_of_fit.excess, 0.0) / max(found.base.lack_of_fit.excess, 1.0)
    return f" (nearest: {' and '.join(option.ids)}{strength}; {percent(min(stays, 1.0))} of what is not noise stays)"


def error_lines(found: Discovery, errors: dict[str, Any]) -> list[str]:
    """The errors before and after, a zero that no sensor has, and whether the data are few, a line each."""
    before, after = errors["recalibrated"], errors["after"]
    little, unmoved = thin(found), still(found)
    quick = {o.name for o in found.study.plant.outputs if o.feels_rates}
    said = [_error_line(found, "", before, after, floor(found.study, after["rmse"])) + _moved_by_monitors(found, after)]
    for name in list(after.get("outputs", ()))[1:]:
        noise = found.study.noise[name].rms if name in found.study.noise else None
        line = _error_line(found, f"{name}: ", before["outputs"][name], after["outputs"][name], noise)
        said.append(line + "; it feels how fast inputs change, and takes no part in the fits" * (name in quick))
    few = [f"these recordings prove little: {little}"] if little and found.verdict != "no_effect" else []
    few += [f"{unmoved}: what it does is not tested"] if unmoved else []
    beside = [*counted_backwards(found), *implausible_zero(found), *unexplained_output(found)]
    return [*said, *about_held_out(found, errors), *beside, *few]


def _moved_by_monitors(found: Discovery, after: Mapping[str, Any]) -> str:
    """How an error beyond the sensor's noise compares with what the monitors may cause too."""
    noise, largest = floor(found.study, after["rmse"]), max(after["rmse"] or 0.0, after["held_out_rmse"] or 0.0)
    if largest < TOO_NOISY * noise:
        return ""
    ratio = found.named.lack_of_fit.ratio
    if (
        found.verdict in ("unexplained", "partly_explained") and ratio < 1
    ):  # by its size alone it may be noise, and what tells is its course
        return ""
    weighted = f"weighted as in the fit, that is {ratio:.2f} times what all noise makes together"
    inputs = ", that of the inputs and of their edges too" if found.study.plant.inputs else ""
    return f"; {weighted}{inputs}"


def _error_line(
    found: Discovery, name: str, before: Mapping[str, Any], after: Mapping[str, Any], noise: float | None
) -> str:
    """The errors of an output before and after, and its noise where it is known."""

    def change(error: str) -> str:
        return " -> ".join(_amount(e[error], e) for e in (before, after))

    said = f"{name}error {change('rmse')}"
    if before["held_out_rmse"] is not None:
        said += f", held out ({some([p.name for p in found.study.held_out])}) {change('held_out_rmse')}"
    return said if noise is None else f"{said}, noise {_amount(noise, after)}"


def _one_of(found: Discovery, effect: str) -> str:
    """An effect, or the set of those that cannot be distinguished from it."""
    others = found.equivalent.get(effect, [])
    return f"one of {summary(found, effect)}, {some(others, FEW)}" if others else summary(found, effect)


def summary(found: Discovery, effect: str) -> str:
    """An effect's id and what it is."""
    words = found.study.catalogue[effect].summary
    return f"{effect} ({words[0].lower()}{words[1:]})"


def _errors(page: Page, found: Discovery, outcome: dict[str, Any]) -> None:
    page.heading("The error, before and after", level=3)
    effects = " and ".join(found.named.ids)
    labels = {
        "published": "as declared, with zeros and gains of every record fitted",
        "recalibrated": "before: with its own parameters refitted",
        "after": f"after: with {effects}" if effects else "after: no effect added",
    }
    rows = []
    for name, label in labels.items():
        e = outcome["error"][name]
        for output, own in e.get("outputs", {"": e}).items():
            told = [
                text
                for prefix in ("", "held_out_")
                for text in (_amount(own[f"{prefix}rmse"], own), _percent(own[f"{prefix}fit_percent"]))
            ]
            rows.append([f"{output}, {label}" if output else label, *told])
    page.table(["model", "error", "fit [%]", "held-out error", "held-out fit [%]"], rows)
    held = ", ".join(outcome["held_out"]) or "none"
    page.text(
        f"The sensor's noise is {_size(found, outcome['noise_floor'])}. {least(found)} Held out of every fit: {held}. "
        "The other errors are those on the fitted experiments. Fits give less weight to samples "
        "that the monitors' noise disturbs strongly; the errors weight all samples equally. Each record's own "
        "numbers (zeros and gains of sensors and monitors, switching instants, start) are fitted before any error is "
        "computed, also for the model as declared."
    )


def _trace(page: Page, found: Discovery, outcome: dict[str, Any]) -> None:
    page.heading("From the residual to its cause", level=3)
    noise = outcome["noise"]["sensors"][found.study.plant.outputs[0].name]
    first = found.study.noise[found.study.plant.outputs[0].name]
    where = "in the quietest parts of the recordings" if first.quiet else "between the events, as no part is quiet"
    if first.by_residual:
        where = (
            "from what the model leaves while its answer stands still, or what one repetition (beat) of that does not "
            "share with the others, as no part is quiet"
        )
    counts = noise["from_monitors"] > NEGLIGIBLE * noise["rms"]
    told = "as bench.toml states it" if stated(found) else f"estimated {where}"
    page.text(
        f"1. The sensor's noise, {told}: {_size(found, noise['rms'])}, correlation "
        f"between samples {noise['correlation']:.2f}. The noise of the monitors passes through the model and adds "
        f"{_size(found, noise['from_monitors']) if counts else 'nothing that counts'}."
    )
    before, after = (option.lack_of_fit.ratio for option in (found.base, found.chosen))
    page.text(
        f"Residuals are compared, sample by sample, with {LEFT}, of three parts. "
        "The sensor's noise counts as it disturbs slow changes: more than its rms if neighbouring errors are alike. "
        "The noise of the monitors counts where the output follows the inputs. What an input may have done between "
        f"two samples counts near its edges. Refitted without effects, the residual is {before:.2f} times all that "
        f"(rms), with what is named {after:.2f} times."
    )
    page.text(
        f"2. The residual of the model with its own parameters refitted: {_left(found, outcome, 'recalibrated')}."
        + (f" Numerical errors account for a gain of at most {found.numeric:.2g}." if found.numeric else "")
    )
    _channels(page, found, outcome["residual"]["channel"])
    for number, step in enumerate(found.search.rounds, start=4):
        beside = f" added to {', '.join(step.present)}" if step.present else ""
        page.text(
            f"{number}. The score statistic of every effect of the catalogue{beside}: how much of the squared "
            "residual (in units of the noise) it would explain. Chance alone rarely gives more than "
            f"{step.threshold:.0f}. {'Accepted' if step.accepted else 'Nothing accepted'}: "
            f"{step.reason}.{_undone(found, step)}"
        )
        shown = {s.id: s.statistic for s in step.scores[:SHOWN]}
        page.figure(
            bars(shown, "score", step.threshold), "The largest score statistics; the line is the threshold for chance."
        )
    page.text(
        f"{len(found.search.rounds) + 4}. The final residual: {_left(found, outcome, 'after')}. On the held-out "
        f"experiments the residual is {found.held_ratio:.3f} times {LEFT}."
    )
    page.table([f"residual, averaged over {BLOCK} samples", "before", "after", "sensor noise alone"], _tests(found))


def _left(found: Discovery, outcome: dict[str, Any], name: str) -> str:
    """How a residual compares with the noise; `name` is that of the model among the errors."""
    option = found.base if name == "recalibrated" else found.chosen
    state, left = option.lack_of_fit, beyond_noise(option.lack_of_fit, outcome["error"][name], outcome["noise_floor"])
    if clean(state) and option.ids == found.chosen.ids:
        white = (found.tests_before if name == "recalibrated" else found.tests_after)["whiteness"] <= WHITE
        return "it is no larger than the noise" + ("" if white else ", but not white")
    if not left:
        return "by its size alone it may be noise"
    more = f", and its slow part exceeds that of the noise by {state.z_slow:.0f} standard deviations"
    return f"{_size(found, left)} rms of it is beyond the noise{more if state.z_slow > SLOW_CHANCE else ''}"


def _undone(found: Discovery, step: Round) -> str:
    """A sentence where an effect that a round accepted is not in the final model; else ""."""
    if not step.accepted or (name := step.options[0].ids[-1]) in found.named.ids:
        return ""
    left = "it leaves too much unexplained" if name in found.chosen.ids else "a later step replaced or removed it"
    return f" It is not in the final model: {found.search.withdrawn.get(name, left)}."


def _channels(page: Page, found: Discovery, told: str | None) -> None:
    """The fault isolation: the channel in which the residual arises; `told` is the one that result.json names."""
    if not found.isolated:
        page.text("3. No channel is sought: the residual is no larger than the noise.")
        return
    how = (
        "from where the residual is largest, as no function of the recorded signals explains half of what is not noise"
        if found.isolated.disturbance
        else "from a latent input of free form in each channel"
    )
    later = f" The effect that is named acts in the {told} channel and explains more, so that is the channel reported."
    if why := contested(found):
        later = f" The channel is uncertain: the one reported is the {told} channel, because {why}."
    evidence = sorted(found.isolated.evidence.items(), key=lambda entry: -entry[1])
    differs = told not in (None, found.isolated.channel)
    page.text(f"3. The channel in which the residual arises, {how}: {found.isolated.channel}.{later * differs}")
    page.figure(bars(dict(evidence), "log evidence"), "The evidence for each channel.")


def _tests(found: Discovery) -> list[list[str]]:
    before, after = found.tests_before, found.tests_after
    limit = before["limit"]
    alone = {"whiteness": f"-{WHITE:g} to {WHITE:g}", "widening": "about 1"}
    names = [n for n in before if n not in ("blocks", "limit")]
    return [
        [
            TESTS.get(n, n),
            f"{before[n]:.3g}",
            f"{after.get(n, 0.0):.3g}",
            alone.get(n, f"-{limit:.2g} to {limit:.2g}" if n.startswith("correlation") else "about 0"),
        ]
        for n in names
    ]


def _ranking(page: Page, found: Discovery, outcome: dict[str, Any]) -> None:
    if not outcome["ranking"]:
        return
    page.heading("Ranking", level=3)
    rows = []
    for r in outcome["ranking"]:
        if (r["evidence"] or 0.0) <= 0:  # one that gained too little at its first steps to be fitted to the end
            continue
        meaning = "; ".join(found.study.catalogue[i].summary for i in r["effects"])
        rows.append([" + ".join(r["effects"]), meaning, _number(r["evidence"]), f"{r['ratio']:.3f}"])
    if rows:
        page.table(["refitted with", "what it means", "log evidence over the base", "residual / noise"], rows)
    page.text("Effects that gain nothing at the first steps of their refit are left out.")
    for name, others in found.equivalent.items() if found.named.ids else ():
        page.text(
            f"Not distinguishable from {name}: {', '.join(others)}. No law is exactly that of a plant: another form "
            f"of this one may lose a log evidence of {_form_loss(found, name):.3g}, however many samples there are."
            if others
            else f"{name} is distinguished from every rival: none explains these recordings as well."
        )


def _form_loss(found: Discovery, name: str) -> float:
    """The log evidence that another form of a named effect's law may lose."""
    form = form_share(found.chosen, found.repeated)
    return told_apart(found.chosen, found.chosen_gains[name], form) / 2


def _parameters(page: Page, found: Discovery, outcome: dict[str, Any]) -> None:
    page.heading("Parameters", level=3)
    published = found.study.plant.model.parameter_values()
    rows = []
    for one in outcome["effects"]:
        effect = found.study.catalogue[one["id"]]
        for name, p in one["parameters"].items():
            row = parameter_row(f"{effect.id}: {name}", p, told=determined(effect, name, p["ci95"]))
            rows.append([*row, ""])
    for name, p in outcome["base_parameters"].items():
        rows.append(parameter_row(name, p, published[name], told=name not in outcome["undetermined"]))
    page.table(["parameter", "value", "95 % interval", "unit", "declared"], rows)
    page.text(
        "The intervals include the noise of the sensor and of the monitors"
        + (
            f", the change of the parameters under effects of slightly different form ({LAW:.0%} off in places), and "
            "the spread between effects that cannot be distinguished."
            if found.named.ids
            else "."
        )
    )
    if outcome["undetermined"]:
        page.text(f"Not determined by these recordings: {', '.join(outcome['undetermined'])}.")


def _record(one: Answered, named: str) -> tuple[Drawing, str]:
    """A recording: record and models above, residuals before and after below; and its caption."""
    label, left = f"{one.label} [{one.unit}]", (f"residual [{one.unit}]", 1.0)
    drawn = record_and_residuals(one.time, one.record, one.models, label, left)
    note = ", held out of every fit" if one.piece.held_out else ""
    return drawn, f"{named}{note}{_averaged(one.time.size)}."


def _missed(one: Answered) -> float:
    """The error of the model before, over what the record does; 0 where that model has no answer."""
    if "before" not in one.models:
        return 0.0
    return float(np.std(one.record - one.models["before"]) / max(np.std(one.record), 1e-300))


def _size(found: Discovery, value: float | None) -> str:
    """An error of the first output, in words."""
    return _amount(value, found.study.plant.quantity(found.study.plant.outputs[0].name).units)


def _amount(value: float | None, told: Mapping[str, Any]) -> str:
    """An error in words, in the unit that its result names."""
    if not value:
        return "no answer" if value is None else "none"
    return in_units_of(value, told)


def _number(value: float | None) -> str:
    return "no answer" if value is None else f"{value:.1f}"


def _percent(value: float | None) -> str:
    return "-" if value is None else f"{value:.2f}"
