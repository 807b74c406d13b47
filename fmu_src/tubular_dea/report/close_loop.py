"""The report of a discovery: from the residual to its cause, step by step, in one page that opens offline."""

from __future__ import annotations

from typing import Any

import plotly.graph_objects as go

from ..discover.engine import Discovery
from ..discover.law_doubt import LAW
from ..discover.rounds import Round
from ..identify.misfit import BLOCK
from ..kernel import KernelError
from ..model.effects import catalogue
from .latent_map import latent_map
from .page import Page
from .parts import POINTS, bars, parameter_row, record_and_residuals

WORDS = {
    "no_effect": "nothing is missing: the paper's model explains these recordings within their noise.",
    "effect_found": "the model lacked {names}.",
    "ambiguous": "the model lacks {names}, or what these recordings cannot tell from it: {others}.",
    "unexplained": "something is missing that no effect of the catalogue explains{nearest}.",
}
TESTS = {  # of the residual's averages over 0.1 s, each in standard deviations of the noise
    "whiteness": "whiteness (Ljung and Box, in standard deviations)",
    "hysteresis": "hysteresis (mean while stretching less mean while returning)",
    "asymmetry on/off": "asymmetry (mean square with voltage less without)",
}
SHOWN = 8  # scores of a round that are drawn


def report(found: Discovery, outcome: dict[str, Any]) -> Page:
    """The page for a discovery and its result.json."""
    page = Page("Closing the loop", f"{found.recordings.source}: {headline(found)}")
    _errors(page, found, outcome)
    _trace(page, found, outcome)
    _ranking(page, found, outcome)
    _parameters(page, found, outcome)
    page.heading("What to measure next")
    page.text(outcome["next_experiment"])
    if found.verdict == "unexplained":
        page.heading("Where the model fails")
        page.figure(latent_map(found), "The latent force: the residual as the pressure that would explain it, over "
                                       "stretch, rate and voltage.")  # fmt: skip
    page.heading("The recordings")
    for figure, caption in _records(found):
        page.figure(figure, caption)
    return page


def headline(found: Discovery) -> str:
    """The verdict in a sentence."""
    names = " and ".join(summary(i) for i in found.chosen.ids)
    others = ", ".join(dict.fromkeys(i for group in found.equivalent.values() for i in group))
    nearest = f" (nearest: {', '.join(found.chosen.ids)})" if found.chosen.ids else ""
    return WORDS[found.verdict].format(names=names, others=others, nearest=nearest)


def summary(effect: str) -> str:
    """An effect's id and what it is."""
    words = catalogue()[effect].summary
    return f"{effect} ({words[0].lower()}{words[1:]})"


def _errors(page: Page, found: Discovery, outcome: dict[str, Any]) -> None:
    page.heading("The error, before and after")
    effects = " and ".join(found.chosen.ids)
    labels = {
        "published": "as published (Table III)",
        "recalibrated": "before: its own parameters refitted",
        "after": f"after: with {effects}" if effects else "after: no effect added",
    }
    rows = []
    for name, label in labels.items():
        e = outcome["error"][name]
        rows.append([label, _um(e["rmse_m"]), _percent(e["fit_percent"]), _um(e["held_out_rmse_m"]),
                     _percent(e["held_out_fit_percent"])])  # fmt: skip
    page.table(["model", "error [um]", "fit [%]", "held-out error [um]", "held-out fit [%]"], rows)
    held = ", ".join(outcome["held_out"]) or "none"
    page.text(
        f"The sensor's noise is {outcome['noise_floor_m'] * 1e6:.1f} um: no model can do better. Held out of every "
        f"fit: {held}; the other errors are of the experiments that were fitted. Fits give less weight to samples "
        "which the monitors' noise moves far, near snap-through above all; an error counts all samples alike."
    )


def _trace(page: Page, found: Discovery, outcome: dict[str, Any]) -> None:
    page.heading("From the residual to its cause")
    noise, state, after = outcome["noise"], found.base.adequacy, found.chosen.adequacy
    page.text(
        f"1. The noise, from quiet stretches of the record and not from any misfit: {noise['sensor_rms_m'] * 1e6:.1f} "
        f"um, correlation {noise['sensor_correlation']:.2f} between samples; the noise of the pressure and voltage "
        f"monitors adds {noise['from_monitors_rms_m'] * 1e6:.1f} um through the model."
    )
    page.text(
        f"2. The model with its own parameters refitted: {state.structure * 1e6:.1f} um rms of its residual are not "
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
        shown = {s.id: s.gain for s in step.scores[:SHOWN]}
        page.figure(bars(shown, "score", step.threshold), "The best scores; what passes the line is hardly chance.")
    page.text(
        f"{len(found.search.rounds) + 4}. What is left: {after.structure * 1e6:.1f} um rms that is not noise, "
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
    if not found.located:
        page.text("3. No channel is searched for: the residual does not stand out of the noise.")
        return
    how = (
        "by where it is large, as no function of recorded signals explains half of it"
        if found.located.disturbance
        else "by an input of any form in each channel"
    )
    evidence = sorted(found.located.evidence.items(), key=lambda entry: -entry[1])
    page.text(f"3. The channel through which the residual comes, {how}: {found.located.channel}.")
    page.figure(bars(dict(evidence), "log evidence"), "The evidence for each channel.")


def _tests(found: Discovery) -> list[list[str]]:
    before, after = found.tests_before, found.tests_after
    limit = before["limit"]
    alone = {"whiteness": "-2 to 2"}
    names = [n for n in before if n in TESTS or n.startswith("correlation")]
    return [
        [TESTS.get(n, n), f"{before[n]:.3g}", f"{after.get(n, 0.0):.3g}",
         alone.get(n, f"-{limit:.2g} to {limit:.2g}" if n.startswith("correlation") else "about 0")]
        for n in names
    ]  # fmt: skip


def _ranking(page: Page, found: Discovery, outcome: dict[str, Any]) -> None:
    if not outcome["ranking"]:
        return
    page.heading("Ranking")
    rows = []
    for r in outcome["ranking"]:
        meaning = "; ".join(catalogue()[i].summary for i in r["effects"])
        rows.append([" + ".join(r["effects"]), meaning, f"{r['evidence']:.1f}", f"{r['ratio']:.3f}"])
    page.table(["refitted with", "what it means", "log evidence over the base", "residual over noise"], rows)
    for name, others in found.equivalent.items():
        page.text(
            f"Not told apart from {name}: {', '.join(others)}."
            if others
            else f"{name} is told apart from every rival: none explains these recordings as well."
        )


def _parameters(page: Page, found: Discovery, outcome: dict[str, Any]) -> None:
    page.heading("Parameters")
    published = found.study.compiled.base.parameter_values()
    rows = []
    for effect in outcome["effects"]:
        rows += [[*parameter_row(f"{effect['id']}: {name}", p), ""] for name, p in effect["parameters"].items()]
    rows += [parameter_row(name, p, published[name]) for name, p in outcome["base_parameters"].items()]
    page.table(["parameter", "value", "95 % interval", "unit", "published"], rows)
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
    study, figures = found.study, []
    before = study.response((), study.pieces).outputs(found.base.fitted.values)
    try:
        after = study.response(found.chosen.ids, study.pieces).outputs(found.chosen.fitted.values)
    except KernelError:
        after = before
    for piece, y0, y1 in zip(study.pieces, before, after, strict=True):
        models = {"before": y0 * 1e3} | ({"after": y1 * 1e3} if found.chosen.ids else {})
        drawn = record_and_residuals(piece.case.times, piece.record * 1e3, models, "displacement [mm]",
                                     ("residual [um]", 1e3))  # fmt: skip
        note = ", held out of every fit" if piece.held_out else ""
        figures.append((drawn, f"{piece.name}{note}; averages over {max(1, piece.record.size // POINTS)} samples."))
    return figures


def _um(value: float | None) -> str:
    return "no answer" if value is None else f"{value * 1e6:.2f}"


def _percent(value: float | None) -> str:
    return "-" if value is None else f"{value:.2f}"
