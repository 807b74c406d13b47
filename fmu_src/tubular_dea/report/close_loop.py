"""The report of a discovery: from the residual to its cause, step by step, in one page that opens offline."""

from __future__ import annotations

from typing import Any

import numpy as np
import plotly.graph_objects as go
from plotly.subplots import make_subplots

from ..discover.engine import Discovery
from ..kernel import KernelError
from ..model.effects import catalogue
from .page import COLOURS, Page

POINTS = 700  # drawn of each record: averages over as many blocks
WORDS = {
    "no_effect": "nothing is missing: the paper's model explains these recordings within their noise.",
    "effect_found": "the model lacked {names}.",
    "ambiguous": "the model lacks {names}, or what these recordings cannot tell from it: {others}.",
    "unexplained": "something is missing that no effect of the catalogue explains{nearest}.",
}


def report(found: Discovery, outcome: dict[str, Any]) -> Page:
    """The page for a discovery and its result.json."""
    page = Page("Closing the loop", f"{found.recordings.source}: {headline(found)}")
    _errors(page, outcome)
    _trace(page, found, outcome)
    _ranking(page, found, outcome)
    _parameters(page, outcome)
    page.heading("What to measure next")
    page.text(outcome["next_experiment"])
    if found.verdict == "unexplained":
        _map(page, found)
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
    return f"{effect} ({catalogue()[effect].summary.lower()})"


def _errors(page: Page, outcome: dict[str, Any]) -> None:
    page.heading("The error, before and after")
    rows = []
    for name in ("published", "recalibrated", "after"):
        e = outcome["error"][name]
        rows.append(
            [
                name,
                _um(e["rmse_m"]),
                _percent(e["fit_percent"]),
                _um(e["held_out_rmse_m"]),
                _percent(e["held_out_fit_percent"]),
            ]
        )
    page.table(["model", "error [um]", "fit [%]", "held-out error [um]", "held-out fit [%]"], rows)
    floor = outcome["noise_floor_m"] * 1e6
    held = ", ".join(outcome["held_out"]) or "none"
    page.text(f"The sensor's noise is {floor:.1f} um. Held out of every fit: {held}.")


def _trace(page: Page, found: Discovery, outcome: dict[str, Any]) -> None:
    page.heading("From the residual to its cause")
    noise, state = outcome["noise"], found.base.adequacy
    page.text(
        f"1. Noise, from quiet stretches of the record and not from any misfit: {noise['sensor_rms_m'] * 1e6:.1f} um, "
        f"correlation {noise['sensor_correlation']:.2f} between samples; the monitors' noise adds "
        f"{noise['from_monitors_rms_m'] * 1e6:.1f} um through the model."
    )
    page.text(
        f"2. Recalibrated base model: what is not noise in its residual has {state.structure * 1e6:.1f} um rms, "
        f"{state.z_slow:.0f} standard deviations out of the noise in slow parts. A halved tolerance changes "
        f"the cost by {found.numeric:.2g}."
    )
    if found.located:
        listed = sorted(found.located.evidence.items(), key=lambda entry: -entry[1])
        page.text(
            "3. Latent inputs, one in each channel: their evidence is "
            + ", ".join(f"{k} {v:.0f}" for k, v in listed)
            + "."
        )
    else:
        page.text("3. No channel is searched for: the residual does not stand out of the noise.")
    for number, step in enumerate(found.search.rounds, start=4):
        best = ", ".join(f"{s.id} {s.gain:.0f}" for s in step.scores[:5])
        page.text(
            f"{number}. Scores"
            + (f" beside {', '.join(step.present)}" if step.present else "")
            + f": {best}. A score above {step.threshold:.0f} is no chance. "
            f"{'Accepted' if step.accepted else 'Nothing accepted'}: {step.reason}."
        )
    after = found.chosen.adequacy
    page.text(
        f"{len(found.search.rounds) + 4}. What is left: {after.structure * 1e6:.1f} um rms that is not noise, "
        f"{after.z_slow:.1f} standard deviations; held-out residual {found.held_ratio:.3f} times the noise."
    )
    names = [
        n
        for n in found.tests_before
        if n.startswith("correlation") or n in ("whiteness", "hysteresis", "asymmetry on/off")
    ]
    page.table(
        ["residual", "before", "after"],
        [[n, f"{found.tests_before[n]:.3g}", f"{found.tests_after.get(n, 0.0):.3g}"] for n in names],
    )


def _ranking(page: Page, found: Discovery, outcome: dict[str, Any]) -> None:
    if not outcome["ranking"]:
        return
    page.heading("Ranking")
    page.table(
        ["effects", "log evidence over the base", "residual over noise"],
        [[" + ".join(r["effects"]), f"{r['evidence']:.1f}", f"{r['ratio']:.3f}"] for r in outcome["ranking"]],
    )
    for name, others in found.equivalent.items():
        if others:
            page.text(f"Not told apart from {name}: {', '.join(others)}.")


def _parameters(page: Page, outcome: dict[str, Any]) -> None:
    page.heading("Parameters")
    rows = []
    for effect in outcome["effects"]:
        rows += [_row(f"{effect['id']}: {name}", p) for name, p in effect["parameters"].items()]
    rows += [_row(name, p) for name, p in outcome["base_parameters"].items()]
    page.table(["parameter", "value", "95 % interval", "unit"], rows)
    if outcome["undetermined"]:
        page.text(f"Not determined by these recordings: {', '.join(outcome['undetermined'])}.")


def _row(name: str, p: dict[str, Any]) -> list[str]:
    low, high = p["ci95"]
    ends = " to ".join("open" if e is None else f"{e:.5g}" for e in (low, high))
    return [name, f"{p['value']:.6g}", ends, p["unit"]]


def _map(page: Page, found: Discovery) -> None:
    """The residual as a pressure over stretch and voltage, in colour; up and down strokes apart."""
    page.heading("Where the model fails")
    drawn = make_subplots(rows=1, cols=2, subplot_titles=("stretching", "returning"), shared_yaxes=True)
    runs = _runs(found)
    stretch, speed, voltage, left = (np.concatenate([r[k] for r in runs]) for k in range(4))
    limit = float(np.quantile(np.abs(left), 0.98)) or 1.0
    for column, rising in ((1, speed >= 0), (2, speed < 0)):
        drawn.add_trace(go.Scattergl(
            x=stretch[rising], y=voltage[rising] / 1e3, mode="markers",
            marker={"color": left[rising], "colorscale": "RdBu", "cmin": -limit, "cmax": limit, "size": 6,
                    "showscale": column == 2, "colorbar": {"title": "Pa"}},
            customdata=speed[rising], hovertemplate="%{x:.3f}, %{y:.2f} kV, rate %{customdata:.3f} 1/s<extra></extra>",
        ), row=1, col=column)  # fmt: skip
    drawn.update_xaxes(title="lambda_2").update_yaxes(title="voltage [kV]", col=1).update_layout(
        showlegend=False, height=420
    )
    page.figure(
        drawn, "The latent force: the residual as the pressure that would explain it, over stretch, rate and voltage."
    )


def _runs(found: Discovery) -> list[tuple[np.ndarray, ...]]:
    """Stretch, rate, voltage and latent pressure of every training piece, averaged over blocks."""
    from ..discover.inputs_noise import input_gains

    kernel, values = found.study.compiled.kernel(found.chosen.ids), found.chosen.fitted.values
    gains = input_gains(found.study, found.base.fitted.values)["pressure"]
    made = []
    for piece, gain in zip(found.study.pieces, gains, strict=True):
        run = kernel.simulate(piece.case.protocol, piece.case.times, found.study.geometry | values)
        left = (piece.record - run[found.study.measured]) / np.maximum(gain, 0.1 * float(np.max(gain)))
        made.append(tuple(_thin(v) for v in (run["lambda_2"], run["lambda_2_rate"], run["voltage"], left)))
    return made


def _records(found: Discovery) -> list[tuple[go.Figure, str]]:
    """One figure a piece: record and models above, residuals before and after below."""
    study, figures = found.study, []
    before = study.response((), study.pieces).outputs(found.base.fitted.values)
    try:
        after = study.response(found.chosen.ids, study.pieces).outputs(found.chosen.fitted.values)
    except KernelError:
        after = before
    for piece, y0, y1 in zip(study.pieces, before, after, strict=True):
        drawn = make_subplots(rows=2, cols=1, shared_xaxes=True, row_heights=[0.55, 0.45], vertical_spacing=0.06)
        t = _thin(piece.case.times)
        curves = [("record", piece.record, COLOURS[5]), ("recalibrated", y0, COLOURS[0]), ("after", y1, COLOURS[1])]
        for name, values, colour in curves:
            drawn.add_trace(go.Scatter(x=t, y=_thin(values) * 1e3, name=name, line={"color": colour}), row=1, col=1)
        for name, values, colour in curves[1:]:
            left = _thin(piece.record - values) * 1e6
            drawn.add_trace(go.Scatter(x=t, y=left, name=name, line={"color": colour}, showlegend=False), row=2, col=1)
        drawn.update_yaxes(title="displacement [mm]", row=1).update_yaxes(title="residual [um]", row=2)
        drawn.update_xaxes(title="time [s]", row=2).update_layout(height=460)
        note = ", held out of every fit" if piece.held_out else ""
        figures.append((drawn, f"{piece.name}{note}; averages over {max(1, piece.record.size // POINTS)} samples."))
    return figures


def _thin(values: np.ndarray) -> np.ndarray:
    size = max(1, values.size // POINTS)
    return values[: values.size // size * size].reshape(-1, size).mean(axis=1)


def _um(value: float | None) -> str:
    return "no answer" if value is None else f"{value * 1e6:.2f}"


def _percent(value: float | None) -> str:
    return "-" if value is None else f"{value:.2f}"
