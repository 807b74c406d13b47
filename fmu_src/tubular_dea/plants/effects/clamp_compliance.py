"""The clamps give way: part of the generatrix's elongation goes into them instead of the wall.

::

    ===|/\\/\\/|---------|/\\/\\/|===     springs of the clamps in series with the wall

Equation: lambda_1 = 1 + (g - 1) / (1 + clamp_compliance), g = sqrt(1 + (r_o/l_o)^2 (lambda_2 - 1)^2);
clamp_compliance is the wall's axial stiffness over the clamps'. Length and angle are those of g.

Source: two springs in series; the paper takes the ends as fixed (Section II).

Typical: 0.02 to 0.2 (soft glue, silicone collars).
"""

from ...model.declare import Definition, Model, Quantity
from ...model.effect import Effect

PARAMETERS = (
    Quantity(
        "clamp_compliance",
        "1",
        "Axial stiffness of the wall over that of the clamps",
        0.0,
        "Springs in series",
        -0.5,
        10.0,
        0.1,
    ),
)


def _apply(model: Model) -> Model:
    geometric = Quantity("generatrix_stretch", "1", "Generatrix between the clamps over l_o", source="Eq. (3)")
    spread = 1 + model["clamp_compliance"]
    model = model.extend(definitions=[Definition(geometric, model.expression("lambda_1"))], before="lambda_1")
    model = model.replace("lambda_1", 1 + (geometric.symbol - 1) / spread)
    slope = model.expression("dlambda_1_dlambda_2").subs(model["lambda_1"], geometric.symbol)
    model = model.replace("dlambda_1_dlambda_2", slope / spread)
    return model.replace("l", model.expression("l").subs(model["lambda_1"], geometric.symbol))


EFFECT = Effect(
    "clamp_compliance",
    "mechanical",
    "The clamps give way along the tube",
    _apply,
    PARAMETERS,
    off={"clamp_compliance": 0.0},
    typical={"clamp_compliance": 0.1},
)
