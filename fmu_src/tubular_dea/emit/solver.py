"""What the integrator calls at every stage of every step: the same equations, arranged to cost little.

`functions.py` prints the equations as the paper has them. Here they are rewritten by rules that keep the names:

* a product of powers goes into the products that use it, so that powers cancel (`(a/x)*(x*b)` becomes `a*b`);
* a root also has its square by name, so that even powers do not wait for the root (`x_squared`);
* what is divided by more than a parameter is multiplied by a named inverse (`inverse_x`);
* what depends on parameters alone is computed once, ahead of all steps (`model_prepare` fills `prepared`).

Then come the functions of the linear systems, from elimination.py.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field

import sympy

from ..model.declare import DeclarationError, Model
from .elimination import linear_algebra
from .functions import Function, layout
from .jacobian import ZERO, Assignment, assignments, forward, needed, real

Rule = Callable[[sympy.Expr], sympy.Expr]


@dataclass(frozen=True)
class SolverFunctions:
    """The functions in the order they are printed, and the sizes of the arrays `prepared`, `J` and `L`."""

    functions: list[Function]
    sizes: dict[str, int]


def solver_functions(model: Model) -> SolverFunctions:
    """prepare, right_hand_side, linearise, multiply, factorise and solve of a model."""
    body, rates = arranged_rates(model)
    columns, along_time = rate_tangents(model, body, rates)
    n = len(rates)
    places = [(i, j) for i in range(n) for j in range(n) if columns[j].values[i] != ZERO]
    entries = [columns[j].values[i] for i, j in places]
    added = [a for part in [*columns, along_time] for a in part.added]

    hoisted = Hoisted(set(layout(model).p), set(model.quantities()))
    arguments = {k: v for k, v in layout(model).arrays().items() if k not in ("p", "fold")}
    plain = Function("right_hand_side", "State derivatives.", arguments, body, {"dx": rates})
    full = Function(
        "linearise",
        "State derivatives, the non-zero entries of d(dx)/dx, and d(dx)/dt at fixed states.",
        arguments,
        [*body, *added],
        {"dx": rates, "J": entries, "dx_dt": along_time.values},
    )
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
        [hoisted.prepare(layout(model).p), *frequent, *linear], {"NQ": len(q), "NJ": len(places), "NL": size}
    )


# The equations ------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class DirectionalDerivative:
    """Derivatives of the rates along something: the assignments that are `added` to get them, and their values."""

    added: list[Assignment]
    values: list[sympy.Expr]


def arranged_rates(model: Model) -> tuple[list[Assignment], list[sympy.Expr]]:
    """The assignments that lead to the state derivatives, with products put into each other and roots squared."""
    rates = [sympy.sympify(s.derivative) for s in model.states]
    arranged = _Arranged()
    for name, expression in assignments(needed(model, rates)):
        arranged.add(name, sympy.sympify(expression))
    inlined = [arranged.inline(rate) for rate in rates]
    if model.curve and model.curve.fold.symbol in Function.free([*inlined, *(e for _, e in arranged.body)]):
        raise DeclarationError(
            f"{model.name}: a state derivative uses {model.curve.fold.name}; expected it in outputs only"
        )
    return arranged.body, inlined


@dataclass
class _Arranged:
    """Assignments so far, the products that go into later products, and the roots by their squares."""

    body: list[Assignment] = field(default_factory=list)
    products: dict[sympy.Symbol, sympy.Expr] = field(default_factory=dict)
    squares: dict[sympy.Symbol, sympy.Symbol] = field(default_factory=dict)

    def add(self, name: str, expression: sympy.Expr) -> None:
        inlined = self.inline(expression)
        if inlined.is_Pow and inlined.exp == sympy.Rational(1, 2) and not inlined.base.is_Symbol:
            square = real(f"{name}_squared")
            self.body.append((square.name, inlined.base))
            self.squares[real(name)] = square
            inlined = sympy.sqrt(square)
        elif _is_product(inlined):
            self.products[real(name)] = inlined
        self.body.append((name, inlined))

    def inline(self, expression: sympy.Expr) -> sympy.Expr:
        """Products put into products; a product that stands alone or in a sum keeps its name."""
        factors = [factor for factor in sympy.Mul.make_args(expression) if not factor.is_number]
        if len(factors) == 1 and factors[0].is_Symbol:
            return expression
        if expression.is_Mul or (expression.is_Pow and expression.exp.is_Integer):
            inlined = sympy.Mul(*(self._factor(factor) for factor in sympy.Mul.make_args(expression)))
            return _with_squares(inlined, self.squares)
        return _through(expression, self.inline)

    def _factor(self, factor: sympy.Expr) -> sympy.Expr:
        base, exponent = factor.as_base_exp()
        if not exponent.is_Integer:
            return _through(factor, self.inline)
        return self.products.get(base, self.inline(base) if not base.is_Atom else base) ** exponent


def _is_product(expression: sympy.Expr) -> bool:
    """A product of integer powers of symbols and of sums as simple as `x - 1`."""
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
) -> tuple[list[DirectionalDerivative], DirectionalDerivative]:
    """The columns of d(dx)/dx, and d(dx)/dt; roots in them by name."""
    arrays = layout(model)
    one = sympy.Integer(1)
    roots = {e.base: real(name) for name, e in body if e.is_Pow and e.exp == sympy.Rational(1, 2)}

    def along(seeds: dict[sympy.Symbol, sympy.Expr], name: str) -> DirectionalDerivative:
        added, values = forward(body, rates, seeds, name)
        return DirectionalDerivative([(n, _by_root(e, roots)) for n, e in added], [_by_root(e, roots) for e in values])

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
    constant: dict[sympy.Basic, bool] = field(default_factory=dict, repr=False)

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
        if e not in self.constant:
            symbols = e.free_symbols if isinstance(e, sympy.Expr) else set()
            self.constant[e] = bool(symbols) and symbols <= self.parameters
        return self.constant[e]

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
