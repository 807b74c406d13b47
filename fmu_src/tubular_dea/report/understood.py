"""What was understood of a folder of recordings, before anything is fitted: as text, and drawn."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ..identify.inputs.drive import Drive, drives
from ..identify.records.experiment import Experiment, Recordings, Source
from ..identify.records.growing_noise import with_growing_noise
from ..identify.signals.sampling import usual_step
from ..identify.study.study import sensor_noise
from ..model.declare import Quantity
from ..model.units import Amount, converted, readable
from ..plants.plant import Output, Plant
from ..recordings.table import some
from .colours import COLOURS
from .figures import png, sized
from .parts import shown_unit

FIRST = 5  # samples whose median is what a record begins with
SHORT = 0.01  # up to its inverse a number is short
SLOW = 0.1  # Hz below which the time between samples says more than the rate
DAY, MS = 86400.0, 1e-3  # s
DURATIONS = [(DAY, DAY, "d"), (3600.0, 3600.0, "h"), (1.0, 1.0, "s"), (0.0, MS, "ms")]  # from, size [s], name
EXPLAINED = (
    "edges: how often inputs switch; rise: how long the median one takes, as a ramp; start: rested, in equilibrium,\n"
    "after the file that it follows, unknown or estimated (by the fits); columns after it: what each signal begins with"
)


class Understanding:
    """The recordings with the edges and the noise that were found in them."""

    def __init__(self, recordings: Recordings) -> None:
        self.recordings = recordings = with_growing_noise(recordings)
        self.drives = drives(recordings.experiments, recordings.plant.inputs, recordings.noise)
        self.noise = sensor_noise(recordings, self.drives)

    def lines(self) -> list[str]:
        """A table, one line a file, below what all files have in common."""
        experiments = self.recordings.experiments
        samples = sum(e.time.size for e in experiments)
        name = self.recordings.plant.name
        counted = f"{len(experiments)} experiment{'s' * (len(experiments) > 1)}"
        head = f"{self.recordings.source}: {counted} of {name}, {samples} samples"
        common = [*self._formats(), *self._geometry(), *self._noises(), *self._slopes()]
        return [head, *common, "", *self._table(), *self._remarks()]

    def _formats(self) -> Iterator[str]:
        """Formats, columns and what was not used, where all files agree in one line each."""
        yield from self._common("format", lambda source: source.format)
        yield from self._common(
            "columns", lambda source: ", ".join(f"{name} = {column!r}" for name, column in source.columns.items())
        )
        yield from self._common("not used", lambda source: ", ".join(map(repr, source.unused)))
        if self.recordings.left_out:
            yield f"no table   {', '.join(self.recordings.left_out)}: left out"
        if self.recordings.still:
            yield f"at rest    {', '.join(self.recordings.still)}: nothing moves there, left out"

    def _common(self, label: str, says: Callable[[Source], str]) -> Iterator[str]:
        said = {e.name: says(e.source) for e in self.recordings.experiments if e.source}
        for text, count in Counter(said.values()).most_common():
            if text:
                files = [name for name, own in said.items() if own == text]
                where = "" if count == len(self.recordings.experiments) else f" ({some(files, 4)})"
                yield f"{label:10s} {text}{where}"

    def _read_as(self, name: str) -> str:
        """What the files call an output, where that is not its name."""
        headings = [h for o in self.recordings.plant.outputs if o.name == name for h in o.headings]
        sources = [e.source for e in self.recordings.experiments if e.source]
        found = [h for h in headings if h != name and any(h in s.columns for s in sources)]
        return f" (column {', '.join(found)})" if found else ""

    def _geometry(self) -> Iterator[str]:
        plant, given = self.recordings.plant, self.recordings.geometry
        if plant.geometry:
            known = plant.model.parameter_values() | given
            said = [
                f"{n} {_amount(known[n], plant.quantity(n))}{' (bench.toml)' if n in given else ''}"
                for n in plant.geometry
                if n in known
            ]
            yield f"geometry   {', '.join(said)}"

    def _noises(self) -> Iterator[str]:
        """Standard deviations of all monitors and sensors, and where they were taken from."""
        plant, stated = self.recordings.plant, self.recordings.noise
        said = []
        for signal in plant.inputs:
            level = float(np.median([d.noise[signal.name] for d in self.drives]))
            said.append(
                f"{signal.name} {self._noise_amount(level, signal.name)}"
                f"{' (bench.toml)' if signal.name in stated else ''}"
            )
        for name, noise in self.noise.items():
            headings = _output(plant.outputs, name).headings
            words = f"{headings[0]} {self._noise_amount(noise.rms, name)}"
            if not noise.quiet and stated.keys().isdisjoint(headings):
                words = f"{headings[0]} not known yet (no part of the recordings is quiet)"
            elif noise.neighbours:
                words += f" (correlation {noise.neighbours:.2f})"
            grows = [g for e in self.recordings.experiments if (g := e.relative_noise.get(name)) is not None]
            if grows:
                least, most = (noise.rms * float(end(np.concatenate(grows))) for end in (np.min, np.max))
                amounts = " to ".join(self._noise_amount(level, name) for level in (least, most))
                words += f" (rms; {amounts}, as it is not the same at all readings)"
            said.append(words)
        yield f"noise      {', '.join(said)}"

    def _slopes(self) -> Iterator[str]:
        """How fast inputs rise whose amplifier gives so much current and no more."""
        found = {name: how for d in self.drives for name, how in d.rises.items() if how.kind == "slew"}
        steep = {name: MS * how.height / how.value for name, how in found.items() if how.value > 0}
        said = [f"{name} {_amount(slope, self.recordings.plant.quantity(name))}" for name, slope in steep.items()]
        if said:
            yield f"slopes     {', '.join(said)} a millisecond, at most"

    def unit(self, name: str) -> str:
        """The unit in which a signal is shown: the plant's customary one, else that of the files if they agree."""
        plant = self.recordings.plant
        headings = next((o.headings for o in plant.outputs if o.name == name), (name,))
        sources = [e.source for e in self.recordings.experiments if e.source]
        there = {s.units[h] for s in sources for h in headings if h in s.units}
        quantity = plant.quantity(name)
        return quantity.display_unit or (there.pop() if len(there) == 1 else quantity.unit)

    def _noise_amount(self, level: float, name: str) -> str:
        """A noise (SI) in the unit of the files where that makes a short number, else in SI with a prefix."""
        quantity, unit = self.recordings.plant.quantity(name), self.unit(name)
        size = _shown(level, quantity, unit) - _shown(0.0, quantity, unit)
        short = SHORT <= abs(size) < 1 / SHORT and not quantity.display_unit
        return f"{size:.3g} {unit}" if short else _amount(level, quantity)

    def _table(self) -> Iterator[str]:
        """How each file was sampled, how it starts and what it reads then, how often a held input switches."""
        quantities = {name: self.recordings.plant.quantity(name) for name in self.signals}
        rows = [
            [
                "file",
                "samples",
                "length",
                "rate",
                "edges",
                "rise",
                "start",
                *(f"{name} [{self.unit(name)}]{self._read_as(name)}" for name in quantities),
            ]
        ]
        for experiment, driven in zip(self.recordings.experiments, self.drives, strict=True):
            first = (_first(experiment, q, self.unit(name), name) for name, q in quantities.items())
            rows.append([*_row(experiment, driven, self.recordings.plant), *first])
        widths = [max(len(row[i]) for row in rows) for i in range(len(rows[0]))]
        for row in rows:
            padded = [c.rjust(w) for c, w in zip(row, widths, strict=True)]
            yield "  ".join([row[0].ljust(widths[0]), *padded[1:]])
        yield EXPLAINED

    @property
    def signals(self) -> list[str]:
        """The inputs, and the outputs that any file has."""
        plant, experiments = self.recordings.plant, self.recordings.experiments
        there = [o.name for o in plant.outputs if any(o.name in e.outputs for e in experiments)]
        return [*(s.name for s in plant.inputs), *there]

    def _remarks(self) -> Iterator[str]:
        said = [(e.source.path.name, r) for e in self.recordings.experiments if e.source for r in _remarks_of(e.source)]
        for experiment, driven in zip(self.recordings.experiments, self.drives, strict=True):
            if left := int(np.count_nonzero(~driven.tells(experiment.time))):
                fast = " and ".join(driven.untold)
                words = f"{left} samples not fitted: {fast} moved too fast there for its samples to tell how"
                said.append((experiment.name, words))
        if said:
            yield ""
        for remark in dict.fromkeys(r for _, r in said):  # once for all files that it is said of
            yield f"{some([*dict.fromkeys(file for file, r in said if r == remark)], 4)}: {remark}"

    def picture(self) -> bytes:
        """`drawing` as PNG."""
        return png(self.drawing())

    def drawing(self, figure: Figure | None = None) -> Figure:
        """All signals of all files: one row a file, one column a signal, edges marked; in `figure` if it is given."""
        plant, experiments, names = self.recordings.plant, self.recordings.experiments, self.signals
        figure = sized(figure, 4.2 * len(names), 0.6 + 1.25 * len(experiments))
        axes = figure.subplots(len(experiments), len(names), squeeze=False)
        longest = max(float(np.ptp(e.time)) for e in experiments)
        size, clock = next((s, u) for least, s, u in DURATIONS if longest >= least)
        held = {s.name for s in plant.inputs if s.held}
        for number, (row, experiment, driven) in enumerate(zip(axes, experiments, self.drives, strict=True)):
            for column, (axis, name) in enumerate(zip(row, names, strict=True)):
                quantity, unit = plant.quantity(name), self.unit(name)
                values = experiment.inputs.get(name, experiment.outputs.get(name))
                if values is not None:
                    axis.plot(
                        experiment.time / size,
                        _shown(values, quantity, unit),
                        color=COLOURS[column % len(COLOURS)],
                        linewidth=0.8,
                        drawstyle="steps-post" if name in held else "default",
                    )
                edges = [edge.time / size for edge in driven.edges if edge.input == name]
                _dressed(axis, f"{name} [{unit}]" if number == 0 else "", edges)
            row[0].set_ylabel(experiment.name, rotation=0, ha="right", va="center", fontsize=8)
        for axis in axes[-1]:
            axis.set_xlabel(f"time [{clock}]", fontsize=8)
        return figure


def _dressed(axis: Axes, title: str, edges: Iterable[float]) -> None:
    axis.grid(alpha=0.3)
    axis.tick_params(labelsize=7)
    axis.spines[["top", "right"]].set_visible(False)
    axis.set_title(title, fontsize=9)
    for edge in edges:
        axis.axvline(edge, color="0.6", linewidth=0.5, zorder=0)


def _first(experiment: Experiment, quantity: Quantity, unit: str, name: str) -> str:
    """What a signal reads first; "" where the file has none."""
    values = experiment.inputs.get(name, experiment.outputs.get(name))
    if values is None:
        return ""
    read = values[np.isfinite(values)][:FIRST]  # a camera may be slower than what else is read
    return f"{_shown(float(np.median(read)), quantity, unit) + 0.0:.4g}" if read.size else ""


def _shown(value: Amount, quantity: Quantity, unit: str) -> Amount:
    """An SI value in the unit in which it is shown."""
    return converted(value, quantity.unit, unit)


def _row(experiment: Experiment, driven: Drive, plant: Plant) -> list[str]:
    steps = np.diff(experiment.time)
    uneven = "" if np.max(steps) < 1.5 * np.median(steps) else " with gaps"
    rises = [edge.rise for edge in driven.edges if edge.rise > 0]
    per_second = 1 / usual_step(experiment.time)
    estimated = any(p.start for p in plant.model.parameters)
    return [
        experiment.name,
        f"{experiment.time.size}",
        duration(float(np.ptp(experiment.time)), 4),
        (f"{per_second:.5g} Hz" if per_second >= SLOW else f"every {duration(1 / per_second, 4)}") + uneven,
        f"{len(driven.edges)}",
        duration(float(np.median(rises)), 2) if rises else "-",
        f"after {experiment.follows}" if experiment.follows else "estimated" if estimated else experiment.start,
    ]


def duration(seconds: float, digits: int) -> str:
    """A time in the unit that suits it, to some significant digits."""
    size, unit = next((s, u) for least, s, u in DURATIONS if seconds >= least)
    return f"{float(f'{seconds / size:.{digits}g}'):.{digits + 2}g} {unit}"


def _remarks_of(source: Source) -> Iterator[str]:
    yield from source.remarks
    if source.missing:
        yield "no number in " + ", ".join(f"{n} cells of {name}" for name, n in source.missing.items())


def _amount(value: float, quantity: Quantity) -> str:
    """A value with one to three digits before the point, or in the unit that its quantity is shown in."""
    scale, shown = readable(value, quantity.unit)
    if shown == quantity.unit and not 0.1 <= abs(value) < 1e3:
        scale, shown = shown_unit(quantity)
    return f"{value / scale:.3g} {shown}" if shown != "1" else f"{value:g}"


def _output(outputs: Sequence[Output], name: str) -> Output:
    return next(o for o in outputs if o.name == name)
