"""The first page of a report, for somebody who is no statistician; and what the recordings could not have shown."""

from __future__ import annotations

from typing import Any

from ..discover.engine import Discovery
from ..model.effect import Effect
from .effects import size_words
from .page import Page
from .parts import AFTER, BEFORE, RECORD, readable
from .svg import bars

SURE = {
    "no_effect": "What the model leaves looks like noise: no effect of the catalogue stands out of it more than one "
    "does by chance once in a thousand such sets.",
    "effect_found": "Every other explanation that was tried leaves more than noise.",
    "ambiguous": "Sure is that something of this kind is missing; which of the names it is, these recordings cannot "
    "tell.",
    "partly_explained": "Each effect that is named makes the model better on experiments that no fit has seen. What "
    "remains is more than noise, so that something else is missing too.",
    "unexplained": "Sure is that something is missing: what the model leaves is more than noise. Nothing in the "
    "catalogue makes it better on experiments that no fit has seen.",
}
NOTHING = "Nothing that the catalogue knows. The model as it is, its parameters refitted, explains these recordings."
UNKNOWN = "Something is missing, but none of the effects that were tried explains it. None is named."
TOLD = 3  # of what could not be seen


def in_short(page: Page, found: Discovery, outcome: dict[str, Any]) -> None:
    """What was found, how sure that is, what it rests on, what could not be seen, and what to do next."""
    page.heading("In short")
    page.answers([("What was found?", list(_found(found, outcome)))])
    page.drawings([_errors(found, outcome)])
    files = sorted({p.source for p in found.study.pieces})
    samples = sum(p.record.size for p in found.study.pieces)
    held = ", ".join(outcome["held_out"])
    apart = (
        f"Kept apart from every fit, to judge by: {held}." if held else "No experiment was kept apart from the fits."
    )
    questions = [
        ("How sure is that?", [SURE[outcome["verdict"]], *_rivals(outcome)]),
        ("What does it rest on?", [f"On {len(files)} recordings with {samples} samples. {apart}"]),
        ("What else has to be known?", outcome["remarks"]),
        ("What could these recordings not have shown?", list(_hidden(found, outcome))),
        ("What to do next?", [outcome["next_experiment"]]),
    ]
    page.answers((question, texts) for question, texts in questions if texts)


def not_seen(page: Page, found: Discovery, outcome: dict[str, Any]) -> None:
    """The table of the smallest sizes that these recordings would have shown."""
    if not outcome["invisible"]:
        return
    page.heading("What these recordings would not have shown", level=3)
    page.text(
        "The smallest size of every effect that would have been seen (four times in five, with a false alarm in "
        "twenty records); of what acts the more the smaller it is, a rate limit say, the largest. Where there is none, "
        "the model's own parameters take the effect up."
    )
    rows = [
        [name, parameter, "none" if value is None else _limit(found.study.catalogue[name], parameter, value)]
        for name, sizes in sorted(outcome["invisible"].items())
        for parameter, value in sizes.items()
    ]
    page.table(["effect", "parameter", "not seen"], rows)


def _found(found: Discovery, outcome: dict[str, Any]) -> list[str]:
    """What is missing in the model, effect by effect."""
    said = [] if outcome["effects"] else [NOTHING if outcome["verdict"] == "no_effect" else UNKNOWN]
    for entry in outcome["effects"]:
        effect = found.study.catalogue[entry["id"]]
        said.append(f"{effect.id}: {effect.summary[0].lower()}{effect.summary[1:]}; {size_words(effect, entry)}.")
        if entry["equivalent"]:
            others = ", ".join(entry["equivalent"])
            said.append(f"It may as well be {others}: these explain the recordings no worse.")
    waves = [wave for sensor in outcome["noise"]["sensors"].values() for wave in sensor["oscillations"]]
    said += [f"An oscillation of {wave['hz']:.4g} Hz that no recorded input drives; see below." for wave in waves]
    return said


def _errors(found: Discovery, outcome: dict[str, Any]) -> tuple[str, str]:
    """How far the model is off before and after, beside the noise, as bars."""
    seen = "" if outcome["held_out"] else "on the recordings that were fitted"
    key = "rmse" if seen else "held_out_rmse"
    effects = " and ".join(e["id"] for e in outcome["effects"])
    unit = outcome["error"]["after"]["unit"]
    rows = [("model before" if effects else "the model", outcome["error"]["recalibrated"][key], BEFORE)]
    rows += [("model after", outcome["error"]["after"][key], AFTER)] if effects else []
    rows += [("sensor's noise", outcome["noise_floor"], RECORD)]
    entries = []
    for words, value, colour in rows:
        scale, shown = readable(value or 0.0, unit)
        entries.append((words, value or 0.0, "no answer" if value is None else f"{value / scale:.3g} {shown}", colour))
    first = found.study.plant.outputs[0].headings[0].replace("_", " ")
    where = seen or "on experiments that no fit has seen"
    after = f" (before) and with {effects} (after)" if effects else ""
    return bars("errors", entries), (
        f"How far the {first} is off, root mean square, {where}: with the model's own parameters refitted{after}. No "
        "model can do better than the sensor's noise."
    )


def _rivals(outcome: dict[str, Any]) -> list[str]:
    """The nearest other explanation, and what it leaves."""
    named = [e["id"] for e in outcome["effects"]]
    equal = {other for e in outcome["effects"] for other in e["equivalent"]}
    best = next((r for r in outcome["ranking"] if r["effects"] == named), None)
    rivals = [r for r in outcome["ranking"] if not set(named) <= set(r["effects"]) and not equal & set(r["effects"])]
    if best is None or not rivals:
        return []
    return [
        f"The nearest other explanation, {' and '.join(rivals[0]['effects'])}, leaves {rivals[0]['ratio']:.2f} times "
        f"the noise, this one {best['ratio']:.2f} times."
    ]


def _hidden(found: Discovery, outcome: dict[str, Any]) -> list[str]:
    """The effects that could have hidden most, beside their usual sizes, in a sentence."""
    known, none = [], []
    for name, sizes in outcome["invisible"].items():
        effect = found.study.catalogue[name]
        for parameter, value in sizes.items():
            if value is None:
                none.append(name)
                continue
            usual = abs(effect.typical[parameter] - effect.off.get(parameter, 0.0)) or 1.0
            share = abs(value) / usual
            known.append((1 / share if _smaller_is_more(effect, parameter) else share, effect, parameter, value))
    known.sort(key=lambda entry: -entry[0])
    said = "; ".join(f"{e.id} {_limit(e, parameter, value)} ({parameter})" for _, e, parameter, value in known[:TOLD])
    texts = [f"{said}. What is larger would have been seen; the table below has every effect."] if said else []
    if none:
        texts.append(f"{', '.join(none)} at any size: the model's own parameters take it up.")
    return texts


def _smaller_is_more(effect: Effect, parameter: str) -> bool:
    """Whether an effect acts the more the smaller this parameter is: a rate limit, the end of a range."""
    return parameter in effect.shapes and parameter not in effect.off and effect.trades.get(parameter, 0.0) <= 0


def _limit(effect: Effect, parameter: str, value: float) -> str:
    unit = next(q.unit for q in effect.parameters if q.name == parameter)
    scale, shown = readable(value, unit)
    size, off = f"{value / scale:.3g} {shown}".removesuffix(" 1"), effect.off.get(parameter, 0.0)
    if off:
        return f"by less than {size} off {off:g}"
    return f"above {size}" if _smaller_is_more(effect, parameter) else f"below {size}"
