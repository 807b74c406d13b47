"""The report of a loop on the aorta: from the residual of the windkessel to what it lacks, in one page."""

from __future__ import annotations

from typing import Any

from ..discover.aorta.candidates import CANDIDATES
from ..discover.aorta.records import PRESSURE
from ..discover.aorta.search import LEAST_EVIDENCE, LEAST_SHARE, Loop, Option, Round
from .page import Page
from .parts import parameter_row, record_and_residuals

WORDS = {
    "no_effect": "nothing that was tried makes a windkessel of three elements better in every record.",
    "effect_found": "what a windkessel of three elements lacks is {names}.",
    "ambiguous": "a windkessel of three elements lacks {names}, or what these records cannot tell from it: {others}.",
}


def report(loop: Loop, outcome: dict[str, Any], source: str) -> Page:
    """The page for a loop and its result.json."""
    page = Page("Closing the loop on the aorta", f"{source}: {headline(outcome)}")
    _errors(page, outcome)
    page.heading("From the residual to its cause")
    for number, step in enumerate(loop.rounds, start=1):
        _round(page, number, step)
    page.text(left_over(outcome))
    _parameters(page, outcome)
    page.heading("What to measure next")
    page.text(outcome["next_experiment"])
    page.heading("The records")
    for before, after in zip(loop.base, loop.after, strict=True):
        r = before.record
        models = {"three elements": r.pressure - before.residual, "after": r.pressure - after.residual}
        drawn = record_and_residuals(r.time, r.pressure, dict(list(models.items())[: 1 + bool(loop.chosen)]),
                                     "pressure [mmHg]", ("residual [mmHg]", 1.0))  # fmt: skip
        held = float(r.time[~r.training][0])
        drawn.add_vrect(x0=held, x1=float(r.time[-1]), fillcolor="#5b6b7a", opacity=0.12, line_width=0)
        page.figure(drawn, f"{r.name}: the shaded end took no part in the fits drawn here.")
    return page


def headline(outcome: dict[str, Any]) -> str:
    """The verdict in a sentence."""
    effects = outcome["effects"]
    names = " and ".join(f"{e['id']} ({CANDIDATES[e['id']].summary.lower()})" for e in effects)
    others = ", ".join(dict.fromkeys(i for e in effects for i in e["equivalent"]))
    return WORDS[outcome["verdict"]].format(names=names, others=others)


def left_over(outcome: dict[str, Any]) -> str:
    """How far what is left stands out of the sensor's noise."""
    after, noise = outcome["error"]["after"]["rmse_pa"] / PRESSURE, outcome["noise_floor_pa"] / PRESSURE
    return (
        f"What is left is {after:.2f} mmHg rms, the pressure sensor's noise {noise:.2f} mmHg: "
        + ("noise, nothing more." if after < 1.1 * noise else "not explained; a windkessel has no travelling waves.")
    )


def _errors(page: Page, outcome: dict[str, Any]) -> None:
    page.heading("The error, before and after")
    rows = []
    for label, key in (("three elements", "recalibrated"), ("after", "after")):
        for name, e in outcome["error"][key]["per_experiment"].items():
            rows.append([label, name, *(f"{e[k] / PRESSURE:.2f}" for k in ("rmse_pa", "held_out_rmse_pa")),
                         *(f"{e[k]:.1f}" for k in ("fit_percent", "held_out_fit_percent"))])  # fmt: skip
    page.table(["model", "record", "error [mmHg]", "held-out error [mmHg]", "fit [%]", "held-out fit [%]"], rows)
    page.text("Held out is the last quarter of every record, under parameters found without it; the other figures are "
              "of fits to whole records.")  # fmt: skip


def _round(page: Page, number: int, step: Round) -> None:
    beside = f" beside {', '.join(step.present)}" if step.present else ""
    found = f"{step.accepted.ids[-1]} convinces" if step.accepted else "none convinces"
    page.text(
        f"{number}. Every candidate fitted{beside}: {found}. Asked for in every record: {100 * LEAST_SHARE:.0f} % less "
        f"squared residual, less at the held-out end too, and log evidence above {LEAST_EVIDENCE:g}."
    )
    page.table(["candidate", "what it means", "log evidence in each record", "squared residual taken away [%]",
                "at the held-out end [%]", ""], [_option(o, step) for o in step.options])  # fmt: skip
    if step.equivalent:
        page.text(f"Not told apart from {step.options[0].ids[-1]}: {', '.join(step.equivalent)}.")


def _option(option: Option, step: Round) -> list[str]:
    name = option.ids[-1]
    said = "accepted" if option is step.accepted else "as good" if name in step.equivalent else ""
    return [name, CANDIDATES[name].summary, ", ".join(f"{e:.1f}" for e in option.evidence),
            f"{100 * option.taken:.1f}", f"{100 * option.taken_held_out:.1f}", said]  # fmt: skip


def _parameters(page: Page, outcome: dict[str, Any]) -> None:
    page.heading("Parameters")
    rows = [parameter_row(f"{e['id']}: {n}", p) for e in outcome["effects"] for n, p in e["parameters"].items()]
    if rows:
        page.table(["parameter", "mean over the records", "95 % interval", "unit"], rows)
    each = outcome["error"]["after"]["per_experiment"]
    names = list(next(iter(each.values()))["parameters"])
    page.table(["record", *names], [[r, *(f"{e['parameters'][n]:.5g}" for n in names)] for r, e in each.items()])
    page.text(f"In SI units. The exported model has those of {next(iter(each))}.")
