"""Options as the search compares them, and searches that ended with them, made up by their numbers alone."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np

from tubular_dea.discover.options.options import Option
from tubular_dea.discover.options.residuals import LackOfFit
from tubular_dea.discover.search.revision import Search
from tubular_dea.identify.fitting.fit import Fit
from tubular_dea.identify.fitting.problem import Free

SAMPLES = 10_000


def lack_of_fit(excess: float, z_slow: float | None = None) -> LackOfFit:
    """A residual with `excess` over SAMPLES of noise; its slow parts stand out in proportion unless `z_slow` says."""
    z_total = excess / float(np.sqrt(2 * SAMPLES))
    ratio = float(np.sqrt(1 + max(excess, 0.0) / SAMPLES))
    return LackOfFit(excess, SAMPLES, 3 * z_total if z_slow is None else z_slow, z_total, 0.0, ratio)


def option(
    *ids: str,
    excess: float = 0.0,
    held_out: float = 2000.0,
    cross: float | None = None,
    across: float | None = None,
    turned: float = 0.0,
    z_slow: float | None = None,
    exact: bool = False,
    refined: tuple[str, ...] = (),
    parameters: int | None = None,
    pinned: tuple[str, ...] = (),
    widths: tuple[float, float] = (0.0, 0.0),
) -> Option:
    """Effects `ids` whose fit leaves `excess` over the noise of SAMPLES; one parameter each beside a base with one.

    `turned` [rad] is by how much what it leaves of the held-out experiments looks other than that of the base.
    """
    names = ["base", *ids] if parameters is None else [f"p{i}" for i in range(parameters)]
    cost = SAMPLES + excess
    fitted = Fit(
        dict.fromkeys(names, 1.0),
        np.zeros(len(names)),
        cost,
        np.zeros(SAMPLES),
        np.zeros((SAMPLES, len(names))),
        np.eye(len(names)),
        [Free(n, 1.0) for n in names],
        dict.fromkeys(names, 0.1),
        True,
    )
    unseen = np.sqrt(held_out) * np.array([np.cos(turned), np.sin(turned)])
    return Option(
        ids,
        fitted,
        cost if cross is None else cross,
        cost if across is None else across,
        unseen,
        lack_of_fit(excess, z_slow),
        refined,
        exact,
        pinned,
        widths=widths,
    )


LARGE = 40_000.0  # what a large effect leaves unexplained
BASE = option(excess=LARGE, held_out=12_000.0)
STUDY = SimpleNamespace(
    pieces=(),
    catalogue={
        name: SimpleNamespace(
            typical={name: 1.0},
            off={name: 0.0},
            fit=(name,),
            trades={},
            hard=(),
            parameters=[SimpleNamespace(name=name)],
            refine=refine,
            delicate=name == "set",
        )
        for name, refine in (("lag", ("finer",)), ("slew", ()), ("creep", ()), ("set", ("shape",)))
    },
)


def found(base: Option, chosen: Option, **more: object) -> Search:
    """A search that ended so."""
    return Search(base, chosen, more.pop("study", STUDY), None, **more)
