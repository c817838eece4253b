"""Elimination of states from the equilibrium equations."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache, cached_property, lru_cache, partial
from typing import Any

import sympy as sp
from sympy import QQ
from sympy.polys.matrices import DomainMatrix
from sympy.polys.matrices.exceptions import DMNonInvertibleMatrixError
from sympy.solvers.solveset import NonlinearError

from fastslow.errors import ArgumentError, unknown_name
from fastslow.model.differentiation import derivative
from fastslow.model.structure import real
from fastslow.results.base.named_mapping import NamedMapping
from fastslow.symbolic.algebra import (
    degree_bound,
    expanded_form,
    generators,
    growth,
    longer,
    numerator,
    rational_form,
    whole,
    within_budget,
)

#: Largest number of elimination orders that are compared.
ORDERS = 40

#: Number of nodes of a long equation, and largest number of these that the comparison forms.
LONG_EQUATION, MANY_LONG = 150, 16

#: Largest number of terms of an equation that is solved for a state.
EQUATION_TERMS = 400

#: Bound on the terms after a substitution.
SUBSTITUTED_TERMS = 120

#: Largest number of nodes of a longer, unexpanded equation that is not a polynomial.
UNEXPANDED_NODES = 400

#: Largest degree after a substitution, before common factors are cancelled: roots of polynomials
#: of higher degree are neither given in closed form nor isolated.
SUBSTITUTED_DEGREE = 72

#: Largest number of nonlinear terms of equations that are compared.
SHARED = 30

Nonzero = Callable[[sp.Expr], bool]

#: Slope of an equation in a symbol in which it is affine, and the solution for the symbol.
_Solution = tuple[sp.Expr, sp.Expr]


@dataclass(frozen=True)
class Elimination:
    """Remaining equations of rate = 0, and the states eliminated by the others.

    Parameters
    ----------
    remaining : tuple of sympy.Expr
        Equations in the unknowns and parameters, = 0; one without unknowns is a
        condition on the parameters.
    unknowns : tuple of sympy.Symbol
        States not eliminated, in the order of the state vector.
    solved : NamedMapping of sympy.Expr
        All other states in terms of unknowns and parameters.
    divisors : tuple of sympy.Expr
        Expressions divided by, assumed nonzero.

    Examples
    --------
    >>> x, v, w = map(real, "xvw")
    >>> result = eliminate({"x": v, "v": w - v - x**3}, ["x", "v"])
    >>> result.remaining, result.unknowns, result.solved
    ((w - x**3,), (x,), {v: 0})
    """

    remaining: tuple[sp.Expr, ...]
    unknowns: tuple[sp.Symbol, ...]
    solved: NamedMapping[sp.Expr]
    divisors: tuple[sp.Expr, ...] = ()

    @property
    def is_univariate(self) -> bool:
        """True if one equation in one unknown remains."""
        return len(self.remaining) == 1 and len(self.unknowns) == 1

    @property
    def is_polynomial(self) -> bool:
        """True if every remaining equation is a polynomial in the unknowns."""
        return all(e.is_polynomial(*self.unknowns) for e in self.remaining)

    def state(
        self, values: Mapping[sp.Symbol, sp.Expr], names: Sequence[str]
    ) -> tuple[sp.Expr, ...]:
        """Return the state vector, in the order of names, at values of the unknowns."""
        whole = {u: values.get(u, u) for u in self.unknowns}
        solved = {n: e.xreplace(whole) for n, e in self.solved.items()}
        return tuple(sp.sympify(solved.get(n, whole.get(real(n)))) for n in names)

    def at(self, values: Mapping[sp.Symbol, sp.Expr]) -> Elimination:
        """Substitute parameter values at which no divisor vanishes."""
        remaining = (sp.expand(e.subs(values)) for e in self.remaining)
        solved = {n: e.subs(values) for n, e in self.solved.items()}
        return Elimination(
            tuple(e for e in remaining if e != 0),
            self.unknowns,
            NamedMapping(self.solved.type, solved),
            tuple(d.subs(values) for d in self.divisors if d.free_symbols - set(values)),
        )


def eliminate(
    rates: Mapping[str, sp.Expr], states: Sequence[str], *, nonzero: Nonzero | None = None
) -> Elimination:
    """Solve the equations rate = 0 successively for states in which they are affine.

    A state is eliminated if its coefficient is known to be nonzero, so that no
    equilibrium is lost or added. Among the elimination orders (at most `ORDERS`),
    the one with the fewest remaining equations is chosen, then the lowest degree,
    the fewest terms, and the first-named states as unknowns.

    Parameters
    ----------
    rates : mapping
        State name to its smooth rate, in real symbols.
    states : sequence of str
        States to solve for; other symbols are parameters.
    nonzero : callable, optional
        Predicate for expressions known to be nonzero. Default: SymPy's assumptions
        on real symbols.

    Returns
    -------
    Elimination

    Raises
    ------
    UnknownNameError
        If a rate is missing for one of the states.
    ArgumentError
        If a rate is not smooth.

    Examples
    --------
    >>> x, y, z, rho = map(real, ["x", "y", "z", "rho"])
    >>> lorenz = {"x": 10 * (y - x), "y": x * (rho - z) - y, "z": x * y - 3 * z}
    >>> eliminate(lorenz, ["x", "y", "z"]).remaining
    (rho*x - x**3/3 - x,)
    """
    for name in states:
        if name not in rates:
            raise unknown_name("state", name, rates)
        if rates[name].has(sp.Piecewise):
            raise ArgumentError(f"rate of {name}: expected the smooth rate of one region")
    symbols = tuple(real(n) for n in states)
    known = nonzero or (lambda e: bool(e.is_nonzero))
    equations = _combined([_tidy(rates[n]) for n in states], symbols, known)
    start = _Step(equations, (), (), symbols)
    best = _best(start, known)
    solved: dict[sp.Symbol, sp.Expr] = {}
    for symbol, value in reversed(best.solved):
        solved[symbol] = _compact(value.xreplace(solved))
    return Elimination(
        tuple(e for e in best.equations if e != 0),
        tuple(s for s in symbols if s not in solved),
        NamedMapping("solved state", {s.name: solved[s] for s in symbols if s in solved}),
        tuple(dict.fromkeys(d for d in best.divisors if not d.is_number)),
    )


def eliminate_linear(rates: Mapping[str, sp.Expr]) -> Elimination | None:
    """Solve equations that are affine in all unknowns, with numbers as coefficients.

    Parameters
    ----------
    rates : mapping
        Unknown to its equation.

    Returns
    -------
    Elimination or None
        None for other equations, and if they are singular.

    Examples
    --------
    >>> x, y, p = map(real, "xyp")
    >>> eliminate_linear({"x": x + y - p, "y": x - y}).solved
    {x: p/2, y: p/2}
    """
    symbols = tuple(real(n) for n in rates)
    read = [_affine(rate, symbols) for rate in rates.values()]
    rows = [row for row, _ in read if row is not None]
    if len(rows) < len(read):
        return None
    others = [*dict.fromkeys(other for _, constant in read for other in constant)]
    right = [[constant.get(other, QQ(0)) for other in others] for _, constant in read]
    try:
        inverse = DomainMatrix(rows, (len(rows), len(rows)), QQ).inv()
    except DMNonInvertibleMatrixError:
        return None
    solved = (inverse * DomainMatrix(right, (len(rows), len(others)), QQ)).to_list()
    values = (
        sp.Add(*(QQ.to_sympy(c) * other for c, other in zip(row, others, strict=True)))
        for row in solved
    )
    return Elimination((), (), NamedMapping("solved state", zip(rates, values, strict=True)))


def is_affine(rates: Mapping[str, sp.Expr]) -> bool:
    """Return whether equations are affine in all unknowns, with rational coefficients."""
    symbols = tuple(real(n) for n in rates)
    return all(_affine(rate, symbols)[0] is not None for rate in rates.values())


@lru_cache(maxsize=4096)
def _affine(
    rate: sp.Expr, symbols: tuple[sp.Symbol, ...]
) -> tuple[list[Any] | None, Mapping[sp.Expr, Any]]:
    """Return rational coefficients in an affine expression, and those of the terms without them.

    The regions of a model share most of their rates. None for other expressions.
    """
    try:
        matrix, right = sp.linear_eq_to_matrix([rate], symbols)
    except NonlinearError:
        return None, {}
    if not all(entry.is_Rational for entry in matrix):
        return None, {}
    terms = sp.expand(right[0]).as_coefficients_dict()
    # an irrational number belongs to its term
    constant = {
        sp.Mul(one, 1 if c.is_Rational else c): QQ.from_sympy(c) if c.is_Rational else QQ(1)
        for one, c in terms.items()
        if c != 0
    }
    return [QQ.from_sympy(entry) for entry in matrix], constant


@dataclass(frozen=True)
class _Step:
    equations: tuple[sp.Expr, ...]
    solved: tuple[tuple[sp.Symbol, sp.Expr], ...]
    divisors: tuple[sp.Expr, ...]
    symbols: tuple[sp.Symbol, ...]

    @cached_property
    def left(self) -> tuple[sp.Symbol, ...]:
        done = {s for s, _ in self.solved}
        return tuple(s for s in self.symbols if s not in done)

    @cached_property
    def cost(self) -> tuple[int, ...]:
        """Numbers of unknowns, degrees, terms and divisors, and the unknowns' positions."""
        left = self.left
        degree = sum(_degree(e, left) for e in self.equations)
        length = sum(_length(e) for e in self.equations)
        place = sum(self.symbols.index(s) for s in left)
        divided = sum(1 for d in self.divisors if not d.is_number)
        return (len(left), degree, length, divided, place)


def _combined(
    equations: list[sp.Expr], symbols: Sequence[sp.Symbol], nonzero: Nonzero
) -> tuple[sp.Expr, ...]:
    """Cancel common nonlinear terms of pairs of equations in the second one."""
    bent = [_nonlinear(e, symbols) for e in equations]
    # a ratio is free of states only if both have the same states
    inside = [part.free_symbols & set(symbols) for part in bent]
    for row, part in enumerate(bent):
        for other in range(row + 1, len(bent)):
            if part == 0 or bent[other] == 0 or inside[row] != inside[other]:
                continue
            if max(_length(part), _length(bent[other])) > SHARED:
                continue
            if not (within_budget(part) and within_budget(bent[other])):
                continue
            ratio = sp.cancel(bent[other] / part)
            under = ratio.as_numer_denom()[1]
            if ratio.free_symbols & set(symbols) or not (under.is_number or nonzero(under)):
                continue
            equations[other] = expanded_form(equations[other] - ratio * equations[row])
            bent[other] = sp.Integer(0)
    return tuple(equations)


def _nonlinear(equation: sp.Expr, symbols: Sequence[sp.Symbol]) -> sp.Expr:
    """Sum of all terms that are nonlinear in the symbols."""
    terms = sp.Add.make_args(equation)
    bent = []
    for term in terms:
        inside = term.free_symbols.intersection(symbols)
        if any(not derivative(term, s).free_symbols.isdisjoint(inside) for s in inside):
            bent.append(term)
    return sp.Add(*bent)


def _best(start: _Step, nonzero: Nonzero) -> _Step:
    """Search the orders of elimination, in which the same equations appear again and again."""
    solved_for = cache(partial(_solved_for, nonzero))
    best, best_cost = start, start.cost
    waiting, seen, long = [start], {start.equations}, 0
    while waiting and len(seen) < ORDERS and long < MANY_LONG:
        step = waiting.pop()
        for further in sorted(_further(step, solved_for), key=lambda s: s.cost, reverse=True):
            if further.equations in seen:
                continue
            seen.add(further.equations)
            fresh = set(further.equations) - set(step.equations)
            long += sum(longer(e, LONG_EQUATION) for e in fresh)
            waiting.append(further)
            cost = further.cost
            if cost < best_cost:
                best, best_cost = further, cost
    return best


def _further(step: _Step, solved_for: Callable[..., _Solution | None]) -> list[_Step]:
    """All eliminations of one more state."""
    found = []
    left = step.left
    for row, equation in enumerate(step.equations):
        if _length(equation) > EQUATION_TERMS:
            continue
        inside = equation.free_symbols
        for symbol in [s for s in left if s in inside]:
            if (solution := solved_for(equation, symbol)) is None:
                continue
            slope, value = solution
            rest = [e for k, e in enumerate(step.equations) if k != row]
            others = tuple(_put(e, symbol, value, left) for e in rest)
            if None in others:
                continue
            found.append(
                _Step(
                    others,
                    (*step.solved, (symbol, value)),
                    (*step.divisors, slope),
                    step.symbols,
                )
            )
    return found


def _solved_for(nonzero: Nonzero, equation: sp.Expr, symbol: sp.Symbol) -> _Solution | None:
    """Return the slope of an affine equation in a symbol, and the solution; None for others."""
    slope = derivative(equation, symbol)
    if slope == 0 or symbol in slope.free_symbols or not nonzero(slope):
        return None
    return slope, _compact(-equation.subs(symbol, 0) / slope)


def _put(
    equation: sp.Expr, symbol: sp.Symbol, value: sp.Expr, unknowns: Sequence[sp.Symbol]
) -> sp.Expr | None:
    """Substitute and expand; past the budget, unexpanded if not a polynomial, else None.

    With transcendental functions the expanded form is past the budget if it is longer: powers of
    a steady gate α/(α + β) are short, and their expanded denominators are not.
    """
    if symbol not in equation.free_symbols:
        return equation
    inside = equation.subs(symbol, value)
    if degree_bound(inside) > SUBSTITUTED_DEGREE:
        return None
    expanded = _tidy(inside)
    bent = not value.is_polynomial(*[u for u in unknowns if u != symbol])
    kept = inside if bent and not longer(inside, UNEXPANDED_NODES) else None
    if growth(expanded) > SUBSTITUTED_TERMS:
        return kept
    if kept is not None and generators(kept) and sp.count_ops(kept) < sp.count_ops(expanded):
        return kept
    return expanded


def _compact(expression: sp.Expr) -> sp.Expr:
    """Expand, or extract common factors if transcendental functions make that shorter."""
    flat = _flat(expression)
    if not generators(expression):
        return flat
    return min(flat, sp.factor_terms(expression), key=sp.count_ops)


def _flat(expression: sp.Expr) -> sp.Expr:
    """Expand if no denominator is a sum, else write over one denominator."""
    expanded = expanded_form(expression)
    if whole(expanded) or not within_budget(expression):
        return expanded
    return rational_form(expression)


def _tidy(equation: sp.Expr) -> sp.Expr:
    """Expand an equation, after multiplication by denominators that are sums."""
    expanded = expanded_form(equation)
    return expanded if whole(expanded) else numerator(expanded)


def _length(expression: sp.Expr) -> int:
    return len(sp.Add.make_args(expression))


def _degree(equation: sp.Expr, symbols: Sequence[sp.Symbol]) -> int:
    """Total degree in the symbols; 99 if the equation is not a polynomial in them."""
    present = equation.free_symbols
    inside = [s for s in symbols if s in present]
    if not inside:
        return 0
    if not equation.is_polynomial(*inside):
        return 99
    # the equation is already expanded
    return max(
        sum(int(p) for b, p in term.as_powers_dict().items() if b in inside)
        for term in sp.Add.make_args(equation)
    )
