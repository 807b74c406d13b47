"""Rate-independent hysteresis: backlash of a signal, a Bouc-Wen force in a balance.

::

    signal' |     .----.'          force |    .----->
            |   .'   .'                  |   /     /
            | .'____.'                   |  <-----'
            +------------ signal         +------------ displacement

Equations: of a signal, d(follower)/dt = ([signal - follower - width]+ - [follower - signal - width]+) / follows,
signal' = signal - part (signal - follower): play of half width `width` in a part of it, which comes later; one that
is negative comes first, as friction does in the force of what is moved. In a balance, der(velocity) -=
force z, travel dz/dt = v - (z^2 + SMALL)^((sharpness - 1) / 2) (|v| z + skew v |z|) / 2. With a skew of 1 the force
ends at its largest value, as dry friction does (with another one, at (2 / (1 + skew))^(1 / sharpness) times `force`);
below -1 it stiffens, and its loop is narrow near zero.

Source: M. A. Krasnosel'skii, A. V. Pokrovskii, "Systems with Hysteresis", Springer 1989 (play); Y. K. Wen, "Method for
random vibration of hysteretic systems", J. Eng. Mech. Div. 102 (1976) 249-263; the skew is delta over gamma of
J.-P. Noel, M. Schoukens, "Hysteretic benchmark with a dynamic nonlinearity", Workshop on Nonlinear System
Identification Benchmarks, 2016.

Typical: 5 % of the signal with a width of 2 % of its nominal value; 5 % of the balance within a fifth of the
displacement.
"""

import sympy

from ..model.declare import Model
from ..model.effect import Effect
from ..model.smooth import magnitude, positive_part
from ._site import BalanceSite, SignalSite
from .places import Balance, Path

KINDS = (Path, Balance)
NEEDS = "a `displacement` in a balance; not the load of an equilibrium curve"
FOLLOWS = 0.01  # of the usual time: how fast the follower is dragged along
SKEWS = (-1.2, 1.0)  # of loops that stiffen, and that close as those of dry friction do
SMALL = 1e-6  # keeps the power of |z| differentiable at 0


def law(at: SignalSite | BalanceSite) -> Effect | None:
    """Backlash of a signal, or a hysteretic force."""
    if isinstance(at, BalanceSite):
        return _force(at) if at.displaced else None
    return None if at.is_load else _play(at)


def _play(at: SignalSite) -> Effect:
    n = at.nominal
    part = at.knob(
        "part", "1", f"Part of {at.words} that has play (negative: as of friction)", 0.05, -1.0, 1.0, off=0.0
    )
    width = at.knob(
        "width",
        at.unit,
        "Half the width of the play",
        0.02 * n,
        1e-5 * n,
        0.1 * n,
        shapes=[w * n for w in (0.005, 0.02, 0.08)],
    )

    def rate(signal: sympy.Symbol, z: sympy.Symbol, follows: sympy.Symbol) -> sympy.Expr:
        return (positive_part(signal - z - width.symbol) - positive_part(z - signal - width.symbol)) / follows

    def apply(model: Model) -> Model:
        follower, quick = f"What follows {at.words} with play", "How fast the follower is dragged"
        model, signal, z = at.chased(model, ("follower", follower), ("follows", FOLLOWS, quick), rate)
        return at.put(model, signal - part.symbol * (signal - z))

    return at.effect(f"Backlash or friction acts on {at.words}", "Krasnosel'skii 1989", apply, part, width)


def _force(at: BalanceSite) -> Effect:
    x, v, size = at.coordinate, at.quantity.symbol, at.coordinate.nominal
    force = at.knob(
        "force",
        at.rate_unit,
        f"Size of the hysteretic term on {at.words}; it yields at (2 / (1 + skew))^(1 / sharpness) times that",
        0.05 * at.rate_size,
        0.0,
        20 * at.rate_size,
        off=0.0,
    )
    travel = at.knob(
        "travel",
        x.unit,
        "Displacement within which it builds up",
        0.2 * size,
        1e-4 * size,
        100 * size,
        shapes=[t * size for t in (0.03, 0.2, 1.0)],
    )
    sharp = at.knob("sharpness", "1", "How suddenly it yields", 1.0, 0.5, 10.0, refine=True)
    skew = at.knob("skew", "1", "Whether it yields as it builds up (1) or stiffens (-1)", 1.0, -2.0, 1.1, shapes=SKEWS)

    def yielding(z: sympy.Symbol) -> sympy.Expr:
        slip = magnitude(v) * z + skew.symbol * v * magnitude(z)
        return (v - (z**2 + SMALL) ** ((sharp.symbol - 1) / 2) * slip / 2) / travel.symbol

    def apply(model: Model) -> Model:
        model, z = at.state(model, "state", "1", "Hysteretic term over its size", yielding, x.symbol * 0)
        return at.added(model, -force.symbol * z)

    return at.effect(f"A hysteretic force acts on {at.words}", "Wen 1976", apply, force, travel, sharp, skew)
