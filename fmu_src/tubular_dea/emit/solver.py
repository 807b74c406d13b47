"""What the integrator calls at every stage of every step: the same equations, arranged to cost little.

`functions.py` prints the equations as the paper has them. Here they are rewritten by rules that keep the names:

* a product of powers goes into the products that use it, so that powers cancel (`A_2` becomes `h_o*l_o/lambda_2`);
* a root also has its square by name, so that even powers do not wait for the root (`lambda_1_squared`);
* what is divided by more than a parameter is multiplied by a named inverse (`inverse_lambda_2`);
* what depends on parameters alone is computed once, ahead of all steps (`model_prepare` fills `prepared`).

The linear systems (shift I - J) k = b of a Rosenbrock method are solved by elimination along the diagonal, in an
order that is chosen here from the places where J is not zero; zeros cost nothing.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field

import sympy

from ..model.declare import DeclarationError, Model
from .functions import Function, layout
from .jacobian import ZERO, Assignment, assignments, forward, needed, real

Place = tuple[int, int]
Rule = Callable[[sympy.Expr], sympy.Expr]


@dataclass(frozen=True)
class SolverFunctions:
    """The functions in the order they are printed, and the sizes of the arrays `prepared`, `J` and `L`."""

    functions: list[Function]
    sizes: dict[str, int]


def solver_functions(model: Model) -> SolverFunctions:
    """prepare, slopes, linearise, multiply, factorise and solve of a model."""
    body, rates = arranged_rates(model)
    columns, along_time = rate_tangents(model, body, rates)
    n = len(rates)
    places = [(i, j) for i in range(n) for j in range(n) if columns[j].values[i] != ZERO]
    entries = [columns[j].values[i] for i, j in places]
    added = [a for part in [*columns, along_time] for a in part.added]

    hoisted = Hoisted(set(layout(model).p), set(model.quantities()))
    arguments = {k: v for k, v in layout(model).arrays().items() if k not in ("p", "fold")}
    plain = Function("slopes", "State derivatives.", arguments, body, {"dx": rates})
    full = Function("linearise", "State derivatives, the non-zero entries of d(dx)/dx, and d(dx)/dt at fixed states.",
                    arguments, [*body, *added], {"dx": rates, "J": entries, "dx_dt": along_time.values})  # fmt: skip
    x = [s.name for s in layout(model).x]
    names = {
        "dx": [f"der_{a}" for a in x],
        "J": [f"d_der_{x[i]}_d_{x[j]}" for i, j in places],
        "dx_dt": [f"d_der_{a}_d_time" for a in x],
    }
    frequent = [cheapened(f, names, hoisted) for f in (plain, full)]
    q = hoisted.symbols()
    frequent = [Function(f.name, f.description, f.arguments | {"prepared": q}, f.body, f.results) for f in frequent]
    linear, size = linear_algebra(n, places)
    return SolverFunctions(
        [hoisted.prepare(layout(model).p), *frequent, *linear],
        {"NQ": len(q), "NJ": len(places), "NL": size},
    )


# The equations ------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Tangent:
    """Derivatives of the rates along something: the assignments that are `added` to get them, and their values."""

    added: list[Assignment]
    values: list[sympy.Expr]


def arranged_rates(model: Model) -> tuple[list[Assignment], list[sympy.Expr]]:
    """The assignments that lead to the state derivatives, with products folded and roots squared."""
    rates = [sympy.sympify(s.derivative) for s in model.states]
    arranged = _Arranged()
    for name, expression in assignments(needed(model, rates)):
        arranged.add(name, sympy.sympify(expression))
    folded = [arranged.fold(rate) for rate in rates]
    if model.curve and model.curve.fold.symbol in Function.free([*folded, *(e for _, e in arranged.body)]):
        raise DeclarationError(
            f"{model.name}: a state derivative uses {model.curve.fold.name}; expected it in outputs only"
        )
    return arranged.body, folded


@dataclass
class _Arranged:
    """Assignments so far, the products to fold into later products, and the roots by their squares."""

    body: list[Assignment] = field(default_factory=list)
    products: dict[sympy.Symbol, sympy.Expr] = field(default_factory=dict)
    squares: dict[sympy.Symbol, sympy.Symbol] = field(default_factory=dict)

    def add(self, name: str, expression: sympy.Expr) -> None:
        folded = self.fold(expression)
        if folded.is_Pow and folded.exp == sympy.Rational(1, 2) and not folded.base.is_Symbol:
            square = real(f"{name}_squared")
            self.body.append((square.name, folded.base))
            self.squares[real(name)] = square
            folded = sympy.sqrt(square)
        elif _is_product(folded):
            self.products[real(name)] = folded
        self.body.append((name, folded))

    def fold(self, expression: sympy.Expr) -> sympy.Expr:
        """Products put into products; a product that stands alone or in a sum keeps its name."""
        factors = [factor for factor in sympy.Mul.make_args(expression) if not factor.is_number]
        if len(factors) == 1 and factors[0].is_Symbol:
            return expression
        if expression.is_Mul or (expression.is_Pow and expression.exp.is_Integer):
            folded = sympy.Mul(*(self._factor(factor) for factor in sympy.Mul.make_args(expression)))
            return _with_squares(folded, self.squares)
        return _through(expression, self.fold)

    def _factor(self, factor: sympy.Expr) -> sympy.Expr:
        base, exponent = factor.as_base_exp()
        if not exponent.is_Integer:
            return _through(factor, self.fold)
        return self.products.get(base, self.fold(base) if not base.is_Atom else base) ** exponent


def _is_product(expression: sympy.Expr) -> bool:
    """A product of integer powers of symbols and of sums as simple as `lambda_2 - 1`."""
    return all(
        factor.is_number or (factor.as_base_exp()[1].is_Integer and _is_simple(factor.as_base_exp()[0]))
        for factor in sympy.Mul.make_args(expression)
    )


def _is_simple(base: sympy.Expr) -> bool:
    """A symbol, or a sum of symbols and numbers."""
    return base.is_Symbol or (base.is_Add and all(term.is_Symbol or term.is_Number for term in base.args))


def _with_squares(expression: sympy.Expr, squares: dict[sympy.Symbol, sympy.Symbol]) -> sympy.Expr:
    """Powers of a root by its square: one factor of the root at most."""

    def rule(factor: sympy.Expr) -> sympy.Expr:
        base, exponent = factor.as_base_exp()
        if base not in squares or not exponent.is_Integer:
            return factor
        return base ** (exponent % 2) * squares[base] ** ((exponent - exponent % 2) / 2)

    return sympy.Mul(*(rule(factor) for factor in sympy.Mul.make_args(expression)))


def rate_tangents(
    model: Model, body: Sequence[Assignment], rates: Sequence[sympy.Expr]
) -> tuple[list[Tangent], Tangent]:
    """The columns of d(dx)/dx, and d(dx)/dt; roots in them by name."""
    arrays = layout(model)
    one = sympy.Integer(1)
    roots = {e.base: real(name) for name, e in body if e.is_Pow and e.exp == sympy.Rational(1, 2)}

    def along(seeds: dict[sympy.Symbol, sympy.Expr], name: str) -> Tangent:
        added, values = forward(body, rates, seeds, name)
        return Tangent([(n, _by_root(e, roots)) for n, e in added], [_by_root(e, roots) for e in values])

    time = dict(zip(arrays.u, arrays.du, strict=True)) | {arrays.arrays()["time"][0]: one}
    return [along({s: one}, f"d_{{}}_d_{s}") for s in arrays.x], along(time, "d_{}_d_time")


def _by_root(expression: sympy.Expr, roots: dict[sympy.Symbol, sympy.Symbol]) -> sympy.Expr:
    """Half powers of a square as powers of its named root."""
    squares = {root: square for square, root in roots.items()}

    def rule(e: sympy.Expr) -> sympy.Expr:
        if e.is_Pow and e.base in roots and e.exp.is_Rational and e.exp.q == 2:
            return _with_squares(roots[e.base] ** e.exp.p, squares)
        return _through(e, rule)

    return rule(expression)


def cheapened(function: Function, names: dict[str, list[str]], hoisted: Hoisted) -> Function:
    """`function` with named inverses, and with what depends on parameters alone taken out; `names` of results."""
    body, results = _with_inverses(function, hoisted.parameters, hoisted.names)
    body = [(name, hoisted.take(expression, name)) for name, expression in body]
    taken = {
        array: [hoisted.take(e, name) for name, e in zip(names[array], expressions, strict=True)]
        for array, expressions in results.items()
    }
    return Function(function.name, function.description, function.arguments, body, taken)


def _with_inverses(
    function: Function, parameters: set[sympy.Symbol], names: set[str]
) -> tuple[list[Assignment], dict[str, list[sympy.Expr]]]:
    """Divisions by anything but parameters as products with `inverse_...`, computed as early as possible."""
    inverses: dict[sympy.Symbol, sympy.Symbol] = {}

    def rule(e: sympy.Expr) -> sympy.Expr:
        if e.is_Pow and e.base.is_Symbol and e.base not in parameters and e.exp.is_Integer and e.exp < 0:
            inverse = inverses.setdefault(e.base, real(_free(f"inverse_{e.base}", names)))
            return inverse ** (-e.exp)
        return _through(e, rule)

    body = [(name, rule(expression)) for name, expression in function.live()]
    results = {array: [rule(e) for e in expressions] for array, expressions in function.results.items()}
    defined = {name for name, _ in body}
    placed = [(i.name, 1 / s) for s, i in inverses.items() if s.name not in defined]
    for name, expression in body:
        placed.append((name, expression))
        if real(name) in inverses:
            placed.append((inverses[real(name)].name, 1 / real(name)))
    return placed, results


@dataclass
class Hoisted:
    """What depends on parameters alone, by name: the array `prepared`."""

    parameters: set[sympy.Symbol]
    names: set[str]
    taken: dict[sympy.Expr, sympy.Symbol] = field(default_factory=dict)

    def take(self, e: sympy.Expr, target: str) -> sympy.Expr:
        """`e` with its largest parts in parameters alone replaced by names made from `target`."""
        if e.is_number:
            return e
        if self._is_constant(e):
            return self._name(e, f"{target}_constant")  # `target` itself may be the name of what uses it
        if e.is_Mul:
            return self._split(e, target, "factor")
        if e.is_Add:
            return self._split(e, target, "offset")
        if e.is_Pow and e.base.is_Symbol and e.exp.is_number:
            return e
        return _through(e, lambda part: self.take(part, target))

    def _split(self, e: sympy.Expr, target: str, kind: str) -> sympy.Expr:
        constant = e.func(*(a for a in e.args if self._is_constant(a) or a.is_number))
        others = [a for a in e.args if not (self._is_constant(a) or a.is_number)]
        if kind == "factor" and not constant.is_number and len(others) == 1 and self._varies(others[0]):
            return self.take(sympy.Add(*(constant * term for term in others[0].args)), target)
        if not constant.is_number:
            constant = self._name(constant, f"{target}_{kind}")
        return e.func(constant, *(self.take(other, target) for other in others))

    def _is_constant(self, e: sympy.Expr) -> bool:
        return isinstance(e, sympy.Expr) and bool(e.free_symbols) and e.free_symbols <= self.parameters

    def _varies(self, e: sympy.Expr) -> bool:
        """A sum without a constant term: a factor goes to its terms without a loss of digits."""
        return e.is_Add and not any(term.is_number or self._is_constant(term) for term in e.args)

    def _name(self, e: sympy.Expr, name: str) -> sympy.Symbol:
        if e not in self.taken:
            symbol = e if e.is_Symbol else real(_free(name, self.names | {s.name for s in self.taken.values()}))
            self.taken[e] = symbol
        return self.taken[e]

    def symbols(self) -> list[sympy.Symbol]:
        """The entries of `prepared`, in order."""
        return list(self.taken.values())

    def prepare(self, p: list[sympy.Symbol]) -> Function:
        """The function that fills `prepared`."""
        body = [(symbol.name, e) for e, symbol in self.taken.items() if not e.is_Symbol]
        return Function("prepare", "What depends on parameters alone.", {"p": p}, body, {"prepared": self.symbols()})


def _free(name: str, names: Iterable[str]) -> str:
    """`name`, or the first of name_2, name_3, ... that is not taken."""
    taken = set(names)
    candidates = [name, *(f"{name}_{i}" for i in range(2, len(taken) + 3))]
    return next(candidate for candidate in candidates if candidate not in taken)


def _through(e: sympy.Expr, rule: Rule) -> sympy.Expr:
    """`rule` applied to the arguments of an expression."""
    return e if e.is_Atom or not e.args else e.func(*(rule(argument) for argument in e.args))


# The linear systems -------------------------------------------------------------------------------------------


def linear_algebra(n: int, places: Sequence[Place]) -> tuple[list[Function], int]:
    """multiply, factorise and solve for J with entries at `places`; and the size of the array `L`."""
    entries = {place: real(f"J_{place[0]}_{place[1]}") for place in places}
    order = elimination_order(n, places)
    factors = _factors(n, entries, order)
    return [_multiply(n, entries), factors.function, _solve(n, factors, order)], len(factors.stored)


def elimination_order(n: int, places: Iterable[Place]) -> list[int]:
    """Pivots along the diagonal: the one that can make the fewest new entries first (Markowitz).

    Among equals, those go last that are nothing but the shift: where steps are long the shift is small.
    """
    filled = set(places)
    left, order = list(range(n)), []
    while left:
        k = min((_elimination_cost(k, left, filled), k) for k in left)[1]
        left.remove(k)
        order.append(k)
        filled |= {(i, j) for i in left for j in left if (i, k) in filled and (k, j) in filled}
    return order


def _elimination_cost(k: int, left: Sequence[int], filled: set[Place]) -> tuple[int, bool]:
    """How many entries the pivot k can change, and whether it is nothing but the shift."""
    right = sum((k, j) in filled for j in left if j != k)
    below = sum((i, k) in filled for i in left if i != k)
    return right * below, (k, k) not in filled


@dataclass(frozen=True)
class _Factors:
    function: Function
    stored: dict[Place, sympy.Symbol]  # multipliers, inverse pivots and what is right of them


def _factors(n: int, entries: dict[Place, sympy.Symbol], order: Sequence[int]) -> _Factors:
    """Gaussian elimination of shift I - J without exchanges. `pivot` lets the caller judge it."""
    shift = real("shift")
    now: dict[Place, sympy.Expr] = {place: -symbol for place, symbol in entries.items()}
    for i in range(n):
        now[i, i] = shift + now.get((i, i), ZERO)
    body: list[Assignment] = []
    stored: dict[Place, sympy.Symbol] = {}
    pivots: dict[int, sympy.Symbol] = {}

    def name(text: str, value: sympy.Expr) -> sympy.Symbol:
        body.append((text, value))
        return real(text)

    for position, k in enumerate(order):
        later = order[position + 1 :]
        pivots[k] = name(f"pivot_{k}", now[k, k])
        stored[k, k] = name(f"inverse_{k}", 1 / pivots[k])
        for j in later:
            if (k, j) in now:
                stored[k, j] = name(f"U_{k}_{j}", now[k, j])
        for i in later:
            if (i, k) not in now:
                continue
            stored[i, k] = name(f"L_{i}_{k}", now[i, k] * stored[k, k])
            for j in later:
                if (k, j) in now:
                    now[i, j] = now.get((i, j), ZERO) - stored[i, k] * stored[k, j]
    function = Function(
        "factorise", "Factors of shift I - J along the diagonal, and the pivots.",
        {"shift": [shift], "J": list(entries.values())}, body,
        {"L": list(stored.values()), "pivot": [pivots[k] for k in range(n)]},
    )  # fmt: skip
    return _Factors(function, stored)


def _solve(n: int, factors: _Factors, order: Sequence[int]) -> Function:
    """(shift I - J) k = b by the factors: forward, then back."""
    b = [real(f"b_{i}") for i in range(n)]
    stored = factors.stored
    reached: dict[int, sympy.Expr] = dict(enumerate(b))
    body: list[Assignment] = []
    for position, i in enumerate(order):
        terms = [stored[i, k] * reached[k] for k in order[:position] if (i, k) in stored]
        if terms:
            body.append((f"c_{i}", b[i] - sympy.Add(*terms)))
            reached[i] = real(f"c_{i}")
    for position in reversed(range(n)):
        k = order[position]
        known = sympy.Add(*(stored[k, j] * real(f"k_{j}") for j in order[position + 1 :] if (k, j) in stored))
        body.append((f"k_{k}", stored[k, k] * (reached[k] - known)))
    return Function("solve", "k with (shift I - J) k = b.", {"L": list(stored.values()), "b": b}, body,
                    {"k": [real(f"k_{i}") for i in range(n)]})  # fmt: skip


def _multiply(n: int, entries: dict[Place, sympy.Symbol]) -> Function:
    v = [real(f"v_{i}") for i in range(n)]
    rows = [sympy.Add(*(symbol * v[j] for (row, j), symbol in entries.items() if row == i)) for i in range(n)]
    return Function("multiply", "J v.", {"J": list(entries.values()), "v": v}, [], {"Jv": rows})
