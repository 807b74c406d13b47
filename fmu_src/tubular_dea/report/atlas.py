"""The atlas as a page: every effect with its equation, its usual size and its signature in the residual."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ..discover.experiments.atlas import Atlas, Signature
from ..model.effect import equations
from ..model.units import in_words
from .colours import COLOURS
from .page import Page
from .svg import GRID, Plot, thinned

ALIKE, NAMED = 0.9, 4  # cosine from which on two effects look alike, and how many of these are named at most
STRIP, PANEL = (800.0, 48.0), (260.0, 110.0)  # px
FAINT, CLOSEST, CLOSE_UP = 0.1, 10, 0.3  # of the largest value; samples of a close-up; share of a record it may be
TRACE = COLOURS[0]
READING = """Every picture is a residual: the record less the model, for a plant with this effect at its usual size and
a model without it. The part that the model's own parameters would absorb in a refit is removed, so this is what remains
after a fit. Compare its shape with that of your own residual: in which experiments something happens, and when (at a
switching, while an input rises, slowly over the record). Size, sign and time scale may differ from yours: a longer lag
leaves longer traces. Within a channel, neighbours look alike."""


def page(atlas: Atlas, command: str) -> Page:
    """The page of an atlas; `command` is what finds an effect in recordings."""
    plant = atlas.plant
    made = Page(
        f"Atlas of residuals: {plant.name}",
        f"What each of the {len(atlas.effects)} effects that this model may lack leaves in the residual.",
    )
    made.heading("How to read it")
    made.text(" ".join(READING.split()))
    made.text(f"To search your own recordings for all of them: {command}")
    _experiments(made, atlas)
    made.heading("Overview")
    made.text(
        "All experiments one after the other. Each effect has its own scale, and is turned upside down where that "
        "makes it more like the one above. The names link to the details."
    )
    for channel in plant.channels:
        _overview(made, atlas, channel)
    for channel in plant.channels:
        made.heading(f"Channel: {channel}")
        for number, one in enumerate(atlas.effects):
            if one.effect.channel == channel:
                _effect(made, atlas, number)
    return made


def _experiments(made: Page, atlas: Atlas) -> None:
    """Inputs and outputs of every experiment, each relative to its largest value."""
    made.heading("The experiments")
    inputs = [s.name for s in atlas.plant.inputs]
    colours = dict(zip([*inputs, *atlas.scale], COLOURS[1:], strict=False))
    top = {n: max(float(np.abs(c.protocol.inputs[n]).max()) for c in atlas.cases) or 1.0 for n in inputs}
    made.legend((name.replace("_", " "), colour) for name, colour in colours.items())
    drawn = []
    for name, case, reading, part in atlas.parts():
        curves = {n: (case.protocol.time, case.protocol.inputs[n] / top[n]) for n in inputs}
        thin = slice(None, None, 4)
        curves[reading.output] = (reading.times[thin], atlas.base[part][thin] / (atlas.scale[reading.output] or 1.0))
        low = min(0.0, *(float(y.min()) for _, y in curves.values()))
        plot = Plot(name, (float(reading.times[0]), float(reading.times[-1])), (low - 0.08, 1.08), size=PANEL)
        for signal, (x, y) in curves.items():
            plot.line(x, y, colours[signal])
        drawn.append((plot.svg(), f"{name}, {reading.times[-1] - reading.times[0]:.3g} s"))
    made.drawings(drawn, "panels")


def _overview(made: Page, atlas: Atlas, channel: str) -> None:
    """The strips of a channel, and its effects that are not visible."""
    made.heading(channel, level=3)
    here = [e for e in atlas.effects if e.effect.channel == channel]
    made.strips((e.effect.id, _strip(atlas, e, sign)) for e, sign in _upright(atlas, channel))
    for words, chosen in (
        (
            "Not visible, because the model's own parameters compensate for it:",
            [e for e in here if e.changed and not e.visible],
        ),
        ("Without any effect in these experiments:", [e for e in here if not e.changed]),
    ):
        if chosen:
            made.links(words, ((e.effect.id, e.effect.id) for e in chosen))


def _upright(atlas: Atlas, channel: str) -> Iterator[tuple[Signature, float]]:
    """The visible effects of a channel, and the sign at which each looks most like the one before it."""
    sign, before = 1.0, -1
    for number, one in enumerate(atlas.effects):
        if one.effect.channel == channel and one.visible:
            sign *= 1.0 if before < 0 or atlas.cosines[before, number] >= 0 else -1.0
            before = number
            yield one, sign


def _strip(atlas: Atlas, one: Signature, sign: float) -> str:
    """The residual over all experiments, one after the other."""
    assert one.residual is not None
    residual = sign * one.residual
    top = float(np.abs(residual).max())
    plot = Plot(one.effect.id, (0.0, residual.size), (-1.08 * top, 1.08 * top), size=STRIP)
    for _, _, _, part in atlas.parts()[1:]:
        plot.mark(part.start)
    plot.level(0.0, GRID)
    plot.solid(*thinned(np.arange(residual.size), residual, int(STRIP[0])), TRACE)
    return plot.svg()


def _effect(made: Page, atlas: Atlas, number: int) -> None:
    """An effect: what it is, its equation and size, what it leaves, and what looks like it."""
    one = atlas.effects[number]
    effect = one.effect
    made.heading(effect.id, effect.id, 3)
    made.text(f"{effect.summary}.")
    if effect.drawing:
        made.lines(effect.drawing, drawing=True)
    made.lines(equations(atlas.plant.model, effect))
    made.text(f"Usual size, as drawn: {', '.join(_sizes(one))}.")
    if one.residual is None:
        made.text("The model cannot be solved at this size.")
        return
    if not one.changed:
        made.text("In these experiments it does nothing: they do not reach the range in which it acts.")
        return
    made.text(" ".join(_amounts(atlas, one)))
    if one.visible:
        made.drawings(_panels(atlas, one), "panels")
        order = np.argsort(-np.abs(atlas.cosines[number]))
        alike = [i for i in order if i != number and abs(atlas.cosines[number, i]) > ALIKE][:NAMED]
        if alike:
            made.links("Looks like", ((atlas.effects[i].effect.id, _likeness(atlas, number, i)) for i in alike))


def _likeness(atlas: Atlas, number: int, other: int) -> str:
    return f"{atlas.effects[other].effect.id} ({abs(atlas.cosines[number, other]):.2f})"


def _sizes(one: Signature) -> Iterator[str]:
    """The parameters of an effect at their usual values, without those that are fixed at 1 or 0."""
    for q in one.effect.parameters:
        value = one.effect.typical[q.name]
        if q.name in one.effect.on or (q.name in one.effect.refine and value == one.effect.off.get(q.name, 0.0)):
            continue
        yield f"{q.name} = {in_words(value, q.unit)}"


def _amounts(atlas: Atlas, one: Signature) -> Iterator[str]:
    """How much of every output it changes, and how much of that a refit leaves."""
    assert one.residual is not None
    for output, full in atlas.scale.items():
        parts = [part for _, _, reading, part in atlas.parts() if reading.output == output]
        left = full * float(np.sqrt(np.mean(np.concatenate([one.residual[p] for p in parts]) ** 2)))
        unit, most = atlas.plant.quantity(output).unit, full * float(max(np.abs(one.residual[p]).max() for p in parts))
        yield (
            f"It leaves {in_words(left, unit)} rms of {output.replace('_', ' ')} ({in_words(most, unit)} at most), "
            f"{one.remains / one.changed:.0%} of the change it makes; the model's own parameters absorb the rest."
        )


def _panels(atlas: Atlas, one: Signature) -> Iterator[tuple[str, str]]:
    """The residual in every experiment, all of an output to one scale; last, a close-up of its largest value."""
    assert one.residual is not None
    parts, sizes = atlas.parts(), np.abs(one.residual)
    tops = {output: max(float(sizes[p].max()) for _, _, r, p in parts if r.output == output) for output in atlas.scale}
    for name, _, reading, part in parts:
        top = tops[reading.output]
        most = in_words(top * atlas.scale[reading.output], atlas.plant.quantity(reading.output).unit)
        yield (
            _panel(f"{one.effect.id}, {name}", reading.times, one.residual[part], top),
            f"{name}, \N{PLUS-MINUS SIGN}{most}",
        )
    name, _, reading, part = next(entry for entry in parts if sizes[entry[3]].max() == sizes.max())
    near = _surroundings(sizes[part])
    if near is not None:
        times = reading.times[near]
        words = f"close up: {name}, {times[0]:.4g} to {times[-1]:.4g} s"
        yield _panel(f"{one.effect.id}, {words}", times, one.residual[part][near], tops[reading.output]), words


def _surroundings(sizes: np.ndarray) -> slice | None:
    """The samples around the largest value; None where these are most of a record."""
    at = int(np.argmax(sizes))
    small = np.flatnonzero(sizes < FAINT * sizes[at])
    begin, end = small[small < at].max(initial=0), small[small > at].min(initial=sizes.size)
    long = max(int(end - begin), CLOSEST)
    return slice(max(0, int(begin) - long), int(end) + 2 * long) if 4 * long < CLOSE_UP * sizes.size else None


def _panel(name: str, times: np.ndarray, residual: np.ndarray, top: float) -> str:
    top = top or 1.0
    plot = Plot(name, (float(times[0]), float(times[-1])), (-1.05 * top, 1.05 * top), size=PANEL)
    plot.level(0.0, GRID)
    plot.solid(*thinned(times, residual, int(PANEL[0])), TRACE)
    return plot.svg()
