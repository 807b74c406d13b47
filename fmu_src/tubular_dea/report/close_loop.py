"""The report of a discovery: from the residual to its cause, step by step, in one page that opens offline."""

from __future__ import annotations

from typing import Any

import plotly.graph_objects as go

from ..discover.engine import Discovery
from ..discover.law_uncertainty import LAW
from ..discover.outcome import remainder
from ..discover.rounds import Round
from ..identify.misfit import BLOCK
from .effects import effects
from .in_short import in_short, not_seen
from .latent_map import latent_map
from .page import Page
from .parts import POINTS, bars, parameter_row, readable, record_and_residuals
from .residuals import answered

WORDS = {
    "no_effect": "nothing is missing: the model explains these recordings within their noise.",
    "effect_found": "the model lacked {names}.",
    "ambiguous": "the model lacks {names}, or what these recordings cannot tell from it: {others}.",
    "partly_explained": "the model lacked {names}, and something else remains: {remainder}.",
    "unexplained": "something is missing that no effect of the catalogue explains{nearest}.",
}
TESTS = {  # of the residual's averages over 0.1 s, each in standard deviations of the noise
    "whiteness": "whiteness (Ljung and Box, in standard deviations)"
}
SHOWN = 8  # scores of a round that are drawn


def report(found: Discovery, outcome: dict[str, Any]) -> Page:
    """The page for a discovery and its result.json."""
    page = Page("Closing the loop", f"{found.recordings.source}: {headline(found)}")
    in_short(page, found, outcome)
    effects(page, found, outcome)
    page.heading("For the statistician")
    page.text("From here on: how that was found, step by step, and the statistics behind it by their usual names.")
    _errors(page, found, outcome)
    _trace(page, found, outcome)
    _ranking(page, found, outcome)
    _parameters(page, found, outcome)
    not_seen(page, found, outcome)
    if found.verdict in ("unexplained", "partly_explained"):
        page.heading("Where the model fails", level=3)
        page.figure(latent_map(found), "What the model leaves, over what it answers and over what drives it.")
    page.heading("The recordings", level=3)
    for figure, caption in _records(found):
        page.figure(figure, caption)
    return page


def headline(found: Discovery) -> str:
    """The verdict in a sentence."""
    names = " and ".join(summary(found, i) for i in found.chosen.ids)
    others = ", ".join(dict.fromkeys(i for group in found.equivalent.values() for i in group))
    nearest = f" (nearest: {', '.join(found.chosen.ids)})" if found.chosen.ids else ""
    left = remainder(found)
    what = "" if left is None else f"{_size(found, left['rms'])} rms, {left['share']:.0%} of what was not noise"
    return WORDS[found.verdict].format(names=names, others=others, nearest=nearest, remainder=what)


def error_lines(found: Discovery, errors: dict[str, Any]) -> list[str]:
    """The errors before and after in a line."""
    before, after = errors["recalibrated"], errors["after"]
    noise = found.study.noise[found.study.plant.outputs[0].name].rms
    held = ""
    if before["held_out_rmse"] is not None:
        held = f"held out {_size(found, before['held_out_rmse'])} -> {_size(found, after['held_out_rmse'])}, "
    return [f"error {_size(found, before['rmse'])} -> {_size(found, after['rmse'])}, {held}noise {_size(found, noise)}"]


def summary(found: Discovery, effect: str) -> str:
    """An effect's id and what it is."""
    words = found.study.catalogue[effect].summary
    return f"{effect} ({words[0].lower()}{words[1:]})"


def _errors(page: Page, found: Discovery, outcome: dict[str, Any]) -> None:
    page.heading("The error, before and after", level=3)
    effects = " and ".join(found.chosen.ids)
    labels = {
        "published": "as declared",
        "recalibrated": "before: its own parameters refitted",
        "after": f"after: with {effects}" if effects else "after: no effect added",
    }
    rows = []
    for name, label in labels.items():
        e = outcome["error"][name]
        rows.append(
            [
                label,
                _size(found, e["rmse"]),
                _percent(e["fit_percent"]),
                _size(found, e["held_out_rmse"]),
                _percent(e["held_out_fit_percent"]),
            ]
        )
    page.table(["model", "error", "fit [%]", "held-out error", "held-out fit [%]"], rows)
    held = ", ".join(outcome["held_out"]) or "none"
    page.text(
        f"The sensor's noise is {_size(found, outcome['noise_floor'])}: no model can do better. Held out of every "
        f"fit: {held}; the other errors are of the experiments that were fitted. Fits give less weight to samples "
        "which the monitors' noise moves far; an error counts all samples alike."
    )


def _trace(page: Page, found: Discovery, outcome: dict[str, Any]) -> None:
    page.heading("From the residual to its cause", level=3)
    state, after = found.base.lack_of_fit, found.chosen.lack_of_fit
    noise = outcome["noise"]["sensors"][found.study.plant.outputs[0].name]
    page.text(
        f"1. The noise, from quiet stretches of the record and not from any misfit: "
        f"{_size(found, noise['rms'])}, correlation {noise['correlation']:.2f} between samples; the noise of the "
        f"monitors adds {_size(found, noise['from_monitors'])} through the model."
    )
    page.text(
        f"2. The model with its own parameters refitted: {_size(found, state.structure)} rms of its residual are not "
        f"noise; slow parts stand {state.z_slow:.0f} standard deviations out of it. Numerics can feign a gain of "
        f"{found.numeric:.2g}, no more."
    )
    _channels(page, found)
    for number, step in enumerate(found.search.rounds, start=4):
        beside = f" beside {', '.join(step.present)}" if step.present else ""
        page.text(
            f"{number}. Every effect of the catalogue scored{beside}, by how much of the squared residual (in units of "
            f"the noise) it would explain. More than {step.threshold:.0f} is hardly chance. "
            f"{'Accepted' if step.accepted else 'Nothing accepted'}: {step.reason}.{_undone(found, step)}"
        )
        shown = {s.id: s.statistic for s in step.scores[:SHOWN]}
        page.figure(bars(shown, "score", step.threshold), "The best scores; what passes the line is hardly chance.")
    page.text(
        f"{len(found.search.rounds) + 4}. What is left: {_size(found, after.structure)} rms that is not noise, "
        f"{after.z_slow:.1f} standard deviations; the residual of the held-out experiments is {found.held_ratio:.3f} "
        "times the noise."
    )
    page.table([f"residual, averaged over {BLOCK} samples", "before", "after", "sensor noise alone"], _tests(found))


def _undone(found: Discovery, step: Round) -> str:
    """That what a round accepted is not in the final model, where that is so."""
    if not step.accepted or step.options[0].ids[-1] in found.chosen.ids:
        return ""
    return " It is not in the final model: later steps exchanged or dropped it, or the held-out experiments deny it."


def _channels(page: Page, found: Discovery) -> None:
    """Which channel the residual comes through."""
    if not found.isolated:
        page.text("3. No channel is searched for: the residual does not stand out of the noise.")
        return
    how = (
        "by where it is large, as no function of recorded signals explains half of it"
        if found.isolated.disturbance
        else "by an input of any form in each channel"
    )
    evidence = sorted(found.isolated.evidence.items(), key=lambda entry: -entry[1])
    page.text(f"3. The channel through which the residual comes, {how}: {found.isolated.channel}.")
    page.figure(bars(dict(evidence), "log evidence"), "The evidence for each channel.")


def _tests(found: Discovery) -> list[list[str]]:
    before, after = found.tests_before, found.tests_after
    limit = before["limit"]
    alone = {"whiteness": "-2 to 2"}
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
        meaning = "; ".join(found.study.catalogue[i].summary for i in r["effects"])
        rows.append([" + ".join(r["effects"]), meaning, f"{r['evidence']:.1f}", f"{r['ratio']:.3f}"])
    page.table(["refitted with", "what it means", "log evidence over the base", "residual over noise"], rows)
    for name, others in found.equivalent.items():
        page.text(
            f"Not told apart from {name}: {', '.join(others)}."
            if others
            else f"{name} is told apart from every rival: none explains these recordings as well."
        )


def _parameters(page: Page, found: Discovery, outcome: dict[str, Any]) -> None:
    page.heading("Parameters", level=3)
    published = found.study.plant.model.parameter_values()
    rows = []
    for effect in outcome["effects"]:
        rows += [[*parameter_row(f"{effect['id']}: {name}", p), ""] for name, p in effect["parameters"].items()]
    rows += [parameter_row(name, p, published[name]) for name, p in outcome["base_parameters"].items()]
    page.table(["parameter", "value", "95 % interval", "unit", "declared"], rows)
    page.text(
        "The intervals count the noise of the sensor and of the monitors"
        + (
            f", how far another law of the effects ({LAW:.0%} off here and there) would move the parameters, and the "
            "spread between effects that are not told apart."
            if found.chosen.ids
            else "."
        )
    )
    if outcome["undetermined"]:
        page.text(f"Not determined by these recordings: {', '.join(outcome['undetermined'])}.")


def _records(found: Discovery) -> list[tuple[go.Figure, str]]:
    """One figure a piece: record and models above, residuals before and after below."""
    figures = []
    for one in answered(found):
        label, left = f"{one.label} [{one.unit}]", (f"residual [{one.unit}]", 1.0)
        drawn = record_and_residuals(one.time, one.record, one.models, label, left)
        note = ", held out of every fit" if one.piece.held_out else ""
        figures.append((drawn, f"{one.piece.name}{note}; averages over {max(1, one.time.size // POINTS)} samples."))
    return figures


def _size(found: Discovery, value: float | None) -> str:
    """An error of the first output, in words."""
    if not value:
        return "no answer" if value is None else "none"
    scale, unit = readable(value, found.study.plant.quantity(found.study.plant.outputs[0].name).unit)
    return f"{value / scale:.3g} {unit}"


def _percent(value: float | None) -> str:
    return "-" if value is None else f"{value:.2f}"
