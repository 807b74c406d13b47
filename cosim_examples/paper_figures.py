"""The model's side of the paper's Figs. 7 to 11: inputs, ramps and steps at 4 to 7 kV, and the pressure at the fold.

    python cosim_examples/paper_figures.py

Writes paper_figures.png. The paper draws its inputs without printing all of their numbers: here the ramps rise to
95 mmHg in 14 s (with 7 kV to 122 mmHg in 13 s, past the snap-through), the voltage between 4 and 9.56 s; the steps hold
95 mmHg from 1 s on and the voltage for 10 s. These are the inputs of tests/reference.

What the paper says of its curves can be read off: with Table II's C_2 and C_3 the answer to 7 kV leaves that with
Table III from 18.5 mm on (8a), which passes 24 mm and snaps through beyond 30 mm, 100 % of strain (8b, 9); after a
step the tube returns to where it was (10b, 11b). The oscillation that the paper sees about 0.7 s is not there: from
pressure that rises along a straight line the model's ringing stays below 2 um.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from tubular_dea.files import write_atomically
from tubular_dea.kernel import Kernel
from tubular_dea.model.dea import MMHG, tubular_dea
from tubular_dea.plants.tube import TABLE_II
from tubular_dea.protocol import Protocol
from tubular_dea.report.figures import COLOURS, png

R_O, FULL = 15.0, 9.56  # mm; s: from here on the ramp's voltage stays
VALIDATED = (5.0, 5.5, 6.0)  # kV
BEFORE = {name: TABLE_II[name] for name in ("C_2", "C_3")}  # of Fig. 8a: C_1 and eps_r are found already


def ramp(kilovolt: float) -> Protocol:
    """Pressure and voltage of Figs. 7, 8 and 11a."""
    if kilovolt < 7:
        time, pressure = [0, 4, 9, FULL, 14], np.interp([0, 4, 9, FULL, 14], [0, 9, 14], [0, 85.5, 95])
    else:
        time, pressure = [0, 4, 9, FULL, 13, 18], np.interp([0, 4, 9, FULL, 13, 18], [0, 9, FULL, 13], [0, 85, 90, 122])
    return Protocol.of(time, pressure=pressure * MMHG, voltage=np.interp(time, [4, FULL], [0, 1e3 * kilovolt]))


def step(kilovolt: float) -> Protocol:
    """Pressure and voltage of Figs. 10 and 11b."""
    pressure = np.array([0, 95, 95, 95, 95, 95, 95]) * MMHG
    return Protocol.of([0, 1, 2, 2, 12, 12, 16], pressure=pressure, voltage=1e3 * kilovolt * np.r_[0, 0, 0, 1, 1, 0, 0])


def main() -> None:
    """Nine panels, and what can be read off them."""
    kernel = Kernel(tubular_dea())
    figure = Figure(figsize=(14, 11), layout="constrained")
    figure.get_layout_engine().set(w_pad=0.15, wspace=0.02)  # the second axis of 7a beside that of 7b
    FigureCanvasAgg(figure)
    axes = dict(zip(("7a", "7b", "8a", "8b", "9", "10a", "10b", "11a", "11b"), figure.subplots(3, 3).flat, strict=True))
    inputs(axes["7a"], ramp(4), "inputs of the ramp with 4 kV")
    responses(axes["7b"], kernel, {"4 kV": ramp(4)}, "ramp with 4 kV")
    responses(axes["8a"], kernel, {"Table II": ramp(7)}, "7 kV, before C_2 and C_3 are found", BEFORE)
    responses(axes["8b"], kernel, {"Table III": ramp(7)}, "7 kV, snap-through")
    both(axes["8a"], axes["8b"])
    folds(axes["9"], kernel)
    inputs(axes["10a"], step(4), "inputs of the step with 4 kV")
    responses(axes["10b"], kernel, {"4 kV": step(4)}, "step with 4 kV")
    responses(axes["11a"], kernel, {f"{kv:g} kV": ramp(kv) for kv in VALIDATED}, "ramps")
    responses(axes["11b"], kernel, {f"{kv:g} kV": step(kv) for kv in VALIDATED}, "steps")
    for name, axis in axes.items():
        axis.set_title(f"Fig. {name}: {axis.get_title()}", fontsize=10)
        axis.grid(alpha=0.3)
        axis.spines["top"].set_visible(False)
    write_atomically(Path("paper_figures.png"), png(figure))
    print("wrote paper_figures.png")


def inputs(axis: Axes, protocol: Protocol, title: str) -> None:
    """Pressure, and voltage with an axis of its own on the right."""
    axis.plot(protocol.time, protocol.inputs["pressure"] / MMHG, color=COLOURS[1])
    axis.set(title=title, xlabel="time [s]", ylabel="pressure [mmHg]")
    axis.yaxis.label.set_color(COLOURS[1])
    other = axis.twinx()
    other.plot(protocol.time, protocol.inputs["voltage"] / 1e3, color=COLOURS[0])
    other.set_ylabel("voltage [kV]", color=COLOURS[0])
    other.spines["top"].set_visible(False)


def responses(
    axis: Axes, kernel: Kernel, protocols: dict[str, Protocol], title: str, values: dict[str, float] | None = None
) -> None:
    """The radius at the middle over time, by voltage."""
    for number, (name, protocol) in enumerate(protocols.items()):
        time = np.linspace(protocol.time[0], protocol.time[-1], 4001)
        radius = 1e3 * kernel.simulate(protocol, time, values)["radius"]
        axis.plot(time, radius, color=COLOURS[number], label=name)
        what = title if name in title else f"{title}, {name}"
        print(f"{what}: up to {radius.max():.2f} mm, {radius[-1]:.2f} mm at the end")
    axis.set(title=title, xlabel="time [s]", ylabel="radius [mm]")
    if len(protocols) > 1:
        axis.legend(frameon=False, loc="lower center")


def both(before: Axes, after: Axes) -> None:
    """What is found later dashed beside what was there before, up to 24 mm; where the strain is 100 %."""
    (found,) = after.get_lines()
    before.plot(*found.get_data(), "k--", linewidth=1, label=found.get_label())
    before.set_ylim(R_O, 24)
    before.legend(frameon=False, loc="upper left")
    after.axhline(2 * R_O, color="k", linestyle=":", linewidth=1)
    after.annotate("100 % strain", (0, 2 * R_O), (2, 3), textcoords="offset points")


def folds(axis: Axes, kernel: Kernel) -> None:
    """Pressure over stretch: at rest with the folds, and along the 7 kV ramp from where its voltage stays."""
    stretch = np.linspace(1, 2, 401)
    for number, kilovolt in enumerate((4, *VALIDATED, 7)):
        pressure, _, (at, fold) = kernel.curve(stretch, {"voltage": 1e3 * kilovolt})
        axis.plot(stretch, pressure / MMHG, color=COLOURS[number], label=f"{kilovolt:g} kV at rest")
        axis.plot(at, fold / MMHG, "o", color=COLOURS[number])
        print(f"fold at {kilovolt:g} kV: {R_O * at:.1f} mm, {fold / MMHG:.1f} mmHg")
    run = kernel.simulate(ramp(7), np.linspace(FULL, 18, 2001))
    axis.plot(run["lambda_2"], run["pressure"] / MMHG, "k--", label="the 7 kV ramp after 9.56 s")
    axis.set(title="pressure over stretch, with the fold", xlabel="lambda_2 [1]", ylabel="pressure [mmHg]")
    axis.set(xlim=(1, 2), ylim=(0, 160))
    axis.secondary_xaxis("top", functions=(lambda x: R_O * x, lambda r: r / R_O)).set_xlabel("radius [mm]")
    axis.legend(frameon=False, fontsize=8)


if __name__ == "__main__":
    main()
