"""A stop below a displacement: a body on a seat, a spring that can only push.

::

    force       level
          -------.--------- displacement
                /|
    stiffness  / |

Equation: der(velocity) += stiffness d^2 / (d + corner), d = [level - displacement]+, [ ]+ the positive part.

Source: P. Wriggers, "Computational Contact Mechanics", 2nd ed., Springer 2006 (penalty contact).

Typical: at half the nominal displacement below zero.
"""

from ..model.effect import Effect
from . import stop
from ._site import BalanceSite
from .places import Balance
from .stop import one_sided

KINDS = (Balance,)
NEEDS = stop.NEEDS


def law(at: BalanceSite) -> Effect | None:
    """A spring that acts below a level."""
    return None if at.displaced is None or at.model.curve else one_sided(at, -1, "below")
