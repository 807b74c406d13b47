"""Rodas5P, declared once: its coefficients and the choice of its steps. C and Python are printed from here.

A stiffly accurate, L-stable Rosenbrock method of order 5 with an embedded order 4, in eight stages: G. Steinebach,
"Construction of Rosenbrock-Wanner method Rodas5P and numerical benchmarks within the Julia Differential Equations
package", BIT Numerical Mathematics 63:27, 2023. Of the family (RODAS, RODASP, Rodas4P2, Rodas5) it needs the fewest
stages for an error of 1e-6 in a state, in steps, ramps and jumps to another equilibrium alike: two thirds of RODAS,
with half as many steps.
"""

from __future__ import annotations

from typing import NamedTuple

GAMMA = 0.21193756319429014


class RosenbrockStage(NamedTuple):
    """One stage: its place in the step, and its weights of d(dx)/dt and of the stages before it. Where there is no `a`,
    it stands at the stage before plus that one's k."""

    alpha: float
    delta: float
    a: tuple[float, ...]
    c: tuple[float, ...]


STAGES = (
    RosenbrockStage(0.0, 0.21193756319429014, (), ()),
    RosenbrockStage(0.6358126895828704, -0.42387512638858027, (3.0,), (-14.155112264123755,)),
    RosenbrockStage(
        0.4095798393397535,
        -0.3384627126235924,
        (2.849394379747939, 0.45842242204463923),
        (-17.97296035885952, -2.859693295451294),
    ),
    RosenbrockStage(
        0.9769306725060716,
        1.8046452872882734,
        (-6.954028509809101, 2.489845061869568, -10.358996098473584),
        (147.12150275711716, -1.41221402718213, 71.68940251302358),
    ),
    RosenbrockStage(
        0.4288403609558664,
        2.325825639765069,
        (2.8029986275628964, 0.5072464736228206, -0.3988312541770524, -0.04721187230404641),
        (165.43517024871676, -0.4592823456491126, 42.90938336958603, -5.961986721573306),
    ),
    RosenbrockStage(
        1.0,
        0.0,
        (-7.502846399306121, 2.561846144803919, -11.627539656261098, -0.18268767659942256, 0.030198172008377946),
        (24.854864614690072, -3.0009227002832186, 47.4931110020768, 5.5814197821558125, -0.6610691825249471),
    ),
    RosenbrockStage(
        1.0,
        0.0,
        (),
        (
            30.91273214028599,
            -3.1208243349937974,
            77.79954646070892,
            34.28646028294783,
            -19.097331116725623,
            -28.087943162872662,
        ),
    ),
    RosenbrockStage(
        1.0,
        0.0,
        (),
        (
            37.80277123390563,
            -3.2571969029072276,
            112.26918849496327,
            66.9347231244047,
            -40.06618937091002,
            -54.66780262877968,
            -9.48861652309627,
        ),
    ),
)

# Off the straight line inside a step, by powers of the fraction of it: order 4.
DENSE = (
    (
        25.948786856663858,
        -2.5579724845846235,
        10.433815404888879,
        -2.3679251022685204,
        0.524948541321073,
        1.1241088310450404,
        0.4272876194431874,
        -0.17202221070155493,
    ),
    (
        -9.91568850695171,
        -0.9689944594115154,
        3.0438037242978453,
        -24.495224566215796,
        20.176138334709044,
        15.98066361424651,
        -6.789040303419874,
        -6.710236069923372,
    ),
    (
        11.419903575922262,
        2.8879645146136994,
        72.92137995996029,
        80.12511834622643,
        -52.072871366152654,
        -59.78993625266729,
        -0.15582684282751913,
        4.883087185713722,
    ),
)


# How steps are chosen. `python tests/benchmarks/step_control.py` counts the steps tried for an error of 1e-6 over
# neighbours of these: they are flat.
SAFETY = 0.8  # of the step that would just meet the tolerance
GROWTH_ROOT = 10  # of the error's square: twice the order
LEAST_GROWTH = 0.1  # of a step to the next
LARGEST_GROWTH = 10  # of a step to the next
LEAST_ERROR = 1e-12  # of the error's square over the tolerance: below it steps grow the most
LEAST_PIVOT = 1e-9  # beside the shift: a pivot smaller than that has lost its digits
RESOLVED = 1e-8  # of the reach's square: the error of a step that resolves it, over (speed h)^10
RESOLVING_ROOT = 10  # of that: twice the order
CRUMB = 1e-9  # of what is left of a piece: a last step shorter than that goes with the one before it
TIME_ROUNDING = 4e-15  # of the time: the same where the time is large
SHORTEST = 4e-16  # of the time: a step shorter than that does not move it
BELOW = -1.0  # in the place of an error, where a state leaves the range of the equations: no error is negative
LATELY = 10  # attempts: where one of the last ones came to a minimum, that is why there is no step

CONTROL = (
    "SAFETY",
    "GROWTH_ROOT",
    "LEAST_GROWTH",
    "LARGEST_GROWTH",
    "LEAST_ERROR",
    "LEAST_PIVOT",
    "RESOLVED",
    "RESOLVING_ROOT",
    "CRUMB",
    "TIME_ROUNDING",
    "SHORTEST",
    "BELOW",
    "LATELY",
)


def header() -> str:
    """`rodas5p.h`: the same for C."""
    n = len(STAGES)
    lines = [
        "/* Rodas5P: coefficients and step control, printed from emit/rodas5p.py, where they are explained. */",
        "#ifndef RODAS5P_H",
        "#define RODAS5P_H",
        "",
        f"#define STAGES {n}",
        f"#define GAMMA {GAMMA!r}",
        *(f"#define {name} ({globals()[name]!r})" for name in CONTROL),
        "",
        "/* RosenbrockStage positions, and gamma_i for the derivative along time. */",
        f"static const double ALPHA[STAGES] = {_row([s.alpha for s in STAGES])};",
        f"static const double DELTA[STAGES] = {_row([s.delta for s in STAGES])};",
        "",
        "/* A stage without a row of its own stands at the stage before plus that one's k. */",
        f"static const int OWN_PLACE[STAGES] = {_row([int(bool(s.a) or i == 0) for i, s in enumerate(STAGES)])};",
        *_table("A", [s.a for s in STAGES], n - 1),
        *_table("C", [s.c for s in STAGES], n - 1),
        *_table("DENSE", DENSE, n),
        "",
        "#endif",
        "",
    ]
    return "\n".join(lines)


def _table(name: str, rows: tuple[tuple[float, ...], ...] | list[tuple[float, ...]], width: int) -> list[str]:
    body = [f"    {_row(row or (0,))}," for row in rows]
    return [f"static const double {name}[{len(rows)}][{width}] = {{", *body, "};"]


def _row(values: tuple[float, ...] | list[float]) -> str:
    return "{" + ", ".join(map(repr, values)) + "}"
