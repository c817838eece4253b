"""Equilibrium equations with as many unknowns as possible solved for and left out."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import sympy as sp

from fastslow.errors import ArgumentError, unknown_name
from fastslow.model.structure import real
from fastslow.results.base.named_mapping import NamedMapping
from fastslow.symbolic.solving.algebra import (
    generators,
    growth,
    light,
    longer,
    numerator,
    spread,
    tidy,
    whole,
)

#: Orders of elimination that are compared before the best so far is taken.
ORDERS = 40

#: An equation longer than this is not substituted into any further.
TERMS = 400

#: A substitution that may give more terms than this is not made.
LONGEST = 120

#: Parts of a longer equation up to which it is kept unexpanded where it is no polynomial.
PARTS = 400

#: Longer nonlinear parts of two equations, in terms, are not compared.
SHARED = 30

Nonzero = Callable[[sp.Expr], bool]


@dataclass(frozen=True)
class Elimination:
    """What is left of the equations rate = 0, and the states expressed by what is left.

    Parameters
    ----------
    remaining : tuple of sympy.Expr
        Equations remaining = 0 in the unknowns and parameters; one without any
        unknown is a condition on the parameters.
    unknowns : tuple of sympy.Symbol
        States that were not solved for, in the order of the state vector.
    solved : NamedMapping of sympy.Expr
        Every other state in terms of unknowns and parameters.
    divisors : tuple of sympy.Expr
        What was divided by, taken to be nonzero.

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
        """Whether one equation in one unknown is left."""
        return len(self.remaining) == 1 and len(self.unknowns) == 1

    @property
    def is_polynomial(self) -> bool:
        """Whether every remaining equation is a polynomial in the unknowns."""
        return all(e.is_polynomial(*self.unknowns) for e in self.remaining)

    def state(
        self, values: Mapping[sp.Symbol, sp.Expr], names: Sequence[str]
    ) -> tuple[sp.Expr, ...]:
        """Give the full state vector, in the order of names, at values of the unknowns."""
        whole = {u: values.get(u, u) for u in self.unknowns}
        solved = {n: e.xreplace(whole) for n, e in self.solved.items()}
        return tuple(sp.sympify(solved.get(n, whole.get(real(n)))) for n in names)

    def at(self, values: Mapping[sp.Symbol, sp.Expr]) -> Elimination:
        """With values of parameters at which no divisor vanishes."""
        remaining = (sp.expand(e.subs(values)) for e in self.remaining)
        solved = {n: e.subs(values) for n, e in self.solved.items()}
        return Elimination(
            tuple(e for e in remaining if e != 0),
            self.unknowns,
            NamedMapping(self.solved.kind, solved),
            tuple(d.subs(values) for d in self.divisors if d.free_symbols - set(values)),
        )


def eliminate(
    rates: Mapping[str, sp.Expr], states: Sequence[str], *, nonzero: Nonzero | None = None
) -> Elimination:
    """Solve the equations rate = 0 one after another for states they are affine in.

    A state is solved for where its coefficient is known not to vanish, so that
    no equilibrium is lost and none is added. Among all orders (as many as
    `ORDERS`) the one is taken that leaves the fewest equations, then the
    lowest degree, the fewest terms, and the first-named states as unknowns.

    Parameters
    ----------
    rates : mapping
        State name to its smooth rate, in real symbols.
    states : sequence of str
        The states to solve for; other symbols count as parameters.
    nonzero : callable, optional
        Whether an expression in parameters and states is known not to vanish.
        Default: what SymPy knows of real symbols.

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


@dataclass(frozen=True)
class _Step:
    equations: tuple[sp.Expr, ...]
    solved: tuple[tuple[sp.Symbol, sp.Expr], ...]
    divisors: tuple[sp.Expr, ...]
    symbols: tuple[sp.Symbol, ...]

    @property
    def left(self) -> tuple[sp.Symbol, ...]:
        done = {s for s, _ in self.solved}
        return tuple(s for s in self.symbols if s not in done)

    @property
    def cost(self) -> tuple[int, ...]:
        """Equations, their degree and length, divisors, and where the solved states stood."""
        left = self.left
        degree = sum(_degree(e, left) for e in self.equations)
        length = sum(_length(e) for e in self.equations)
        place = sum(self.symbols.index(s) for s in left)
        divided = sum(1 for d in self.divisors if not d.is_number)
        return (len(left), degree, length, divided, place)


def _combined(
    equations: list[sp.Expr], symbols: Sequence[sp.Symbol], nonzero: Nonzero
) -> tuple[sp.Expr, ...]:
    """Give the equations with nonlinear terms shared by two of them taken out of the second."""
    bent = [_nonlinear(e, symbols) for e in equations]
    # a ratio without states needs the same states above and below
    inside = [part.free_symbols & set(symbols) for part in bent]
    for row, part in enumerate(bent):
        for other in range(row + 1, len(bent)):
            if part == 0 or bent[other] == 0 or inside[row] != inside[other]:
                continue
            if max(_length(part), _length(bent[other])) > SHARED:
                continue
            if not (light(part) and light(bent[other])):
                continue
            ratio = sp.cancel(bent[other] / part)
            under = ratio.as_numer_denom()[1]
            if ratio.free_symbols & set(symbols) or not (under.is_number or nonzero(under)):
                continue
            equations[other] = spread(equations[other] - ratio * equations[row])
            bent[other] = sp.Integer(0)
    return tuple(equations)


def _nonlinear(equation: sp.Expr, symbols: Sequence[sp.Symbol]) -> sp.Expr:
    """Give the sum of all terms that are not affine in the symbols taken together."""
    terms = sp.Add.make_args(equation)
    bent = []
    for term in terms:
        inside = term.free_symbols.intersection(symbols)
        if any(not term.diff(s).free_symbols.isdisjoint(inside) for s in inside):
            bent.append(term)
    return sp.Add(*bent)


def _best(start: _Step, nonzero: Nonzero) -> _Step:
    best, best_cost = start, start.cost
    waiting, seen = [start], {start.equations}
    while waiting and len(seen) < ORDERS:
        step = waiting.pop()
        for further in sorted(_further(step, nonzero), key=lambda s: s.cost, reverse=True):
            if further.equations in seen:
                continue
            seen.add(further.equations)
            waiting.append(further)
            cost = further.cost
            if cost < best_cost:
                best, best_cost = further, cost
    return best


def _further(step: _Step, nonzero: Nonzero) -> list[_Step]:
    """Every way to solve one more equation for one more state."""
    found = []
    left = step.left
    for row, equation in enumerate(step.equations):
        if _length(equation) > TERMS:
            continue
        inside = equation.free_symbols
        for symbol in [s for s in left if s in inside]:
            slope = equation.diff(symbol)
            if slope == 0 or symbol in slope.free_symbols or not nonzero(slope):
                continue
            value = _compact(-equation.subs(symbol, 0) / slope)
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


def _put(
    equation: sp.Expr, symbol: sp.Symbol, value: sp.Expr, unknowns: Sequence[sp.Symbol]
) -> sp.Expr | None:
    """Substitute and expand; past the budget as it stands if that is no polynomial, else None."""
    if symbol not in equation.free_symbols:
        return equation
    inside = equation.subs(symbol, value)
    expanded = _tidy(inside)
    if growth(expanded) <= LONGEST:
        return expanded
    bent = not value.is_polynomial(*[u for u in unknowns if u != symbol])
    return inside if bent and not longer(inside, PARTS) else None


def _compact(expression: sp.Expr) -> sp.Expr:
    """Flat, or with common factors taken out where transcendental functions make that shorter."""
    flat = _flat(expression)
    if not generators(expression):
        return flat
    return min(flat, sp.factor_terms(expression), key=sp.count_ops)


def _flat(expression: sp.Expr) -> sp.Expr:
    """Expand where the denominator allows it, else put over one denominator."""
    expanded = spread(expression)
    if whole(expanded) or not light(expression):
        return expanded
    return tidy(expression)


def _tidy(equation: sp.Expr) -> sp.Expr:
    """Give the equation expanded, multiplied by its denominators where they hold a sum."""
    expanded = spread(equation)
    return expanded if whole(expanded) else numerator(expanded)


def _length(expression: sp.Expr) -> int:
    return len(sp.Add.make_args(expression))


def _degree(equation: sp.Expr, symbols: Sequence[sp.Symbol]) -> int:
    """Total degree in the symbols; 99 where the equation is no polynomial in them."""
    present = equation.free_symbols
    inside = [s for s in symbols if s in present]
    if not inside:
        return 0
    if not equation.is_polynomial(*inside):
        return 99
    # the equation is expanded already, so its terms show their degrees
    return max(
        sum(int(p) for b, p in term.as_powers_dict().items() if b in inside)
        for term in sp.Add.make_args(equation)
    )
