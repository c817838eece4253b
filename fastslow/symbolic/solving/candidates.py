"""Choice of the symbols for which equations are solved."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import sympy as sp

from fastslow.model.differentiation import derivative
from fastslow.symbolic.algebra import within_budget
from fastslow.symbolic.signs.signs import Signs
from fastslow.symbolic.solving.isolation import isolate
from fastslow.symbolic.solving.univariate import Root, factors_in, roots, solved_for


@dataclass(frozen=True)
class Candidates(Sequence[sp.Symbol]):
    """Parameters to solve for, best first.

    Parameters
    ----------
    first : tuple of Symbol
        The frozen slow quantities, or a given parameter: solved for wherever a closed
        form exists.
    others : tuple of Symbol
        The first of these that occurs affinely with a coefficient of known sign is chosen.

    Examples
    --------
    >>> w, a, b = sp.symbols("w a b")
    >>> both = Candidates((w,), (a, b))
    >>> list(both), list(both.without(w)), len(both)
    ([w, a, b], [a, b], 3)
    """

    first: tuple[sp.Symbol, ...] = ()
    others: tuple[sp.Symbol, ...] = ()

    def __iter__(self) -> Iterator[sp.Symbol]:
        return iter((*self.first, *self.others))

    def __len__(self) -> int:
        return len(self.first) + len(self.others)

    def __getitem__(self, index: Any) -> Any:
        return (*self.first, *self.others)[index]

    @classmethod
    def of(cls, symbols: Iterable[sp.Symbol]) -> Candidates:
        """Return candidates unchanged, other symbols as candidates of equal rank."""
        return symbols if isinstance(symbols, Candidates) else cls((), tuple(symbols))

    def without(self, *symbols: sp.Symbol | None) -> Candidates:
        """Return the candidates without some symbols."""
        return Candidates(
            tuple(s for s in self.first if s not in symbols),
            tuple(s for s in self.others if s not in symbols),
        )


@dataclass(frozen=True)
class Choice:
    """The symbol chosen, with its values.

    Parameters
    ----------
    symbol : Symbol
    values : tuple of Root
        Empty if no real value has the assumed sign of the symbol.
    slope : sympy.Expr or None
        Coefficient divided by, if the symbol occurs affinely.
    """

    symbol: sp.Symbol
    values: tuple[Root, ...]
    slope: sp.Expr | None


def choose_symbol(equation: sp.Expr, candidates: Candidates, signs: Signs) -> Choice | None:
    """Solve an irreducible equation for the best candidate.

    Examples
    --------
    >>> from fastslow.model.structure import real
    >>> w, a, b = map(real, "wab")
    >>> found = choose_symbol(a * b - w**2, Candidates((w,), (a, b)), Signs({a: 1, b: 1}))
    >>> found.symbol, [r.value for r in found.values]
    (w, [sqrt(a*b), -sqrt(a*b)])
    >>> choose_symbol(a * b - w**2, Candidates((), (w, a, b)), Signs({a: 1, b: 1})).symbol
    a
    """
    for symbol in candidates.first:
        values = isolate(equation, symbol, signs)
        if values is not None:
            slope = derivative(equation, symbol)
            affine = symbol not in slope.free_symbols
            return Choice(symbol, tuple(values), slope if affine else None)
    # for the others a coefficient known to be nonzero is preferred
    affinely = solved_for(equation, candidates, signs)
    if affinely is not None:
        return Choice(affinely[0], (Root(affinely[1]),), affinely[2])
    for symbol in candidates if within_budget(equation) else ():
        if symbol in equation.free_symbols:
            closed = roots(equation, symbol, signs)
            if closed is not None:
                return Choice(symbol, tuple(closed), None)
    return None


def solve_conditions(
    equations: Sequence[sp.Expr], candidates: Candidates, signs: Signs
) -> list[tuple[dict[sp.Symbol, sp.Expr], tuple[sp.Expr, ...], tuple[sp.Expr, ...]]]:
    """Solve conditions on parameters successively.

    Returns
    -------
    list of (place, radicands, left)
        All solutions: values of parameters, nonnegative radicands, and remaining
        equations. Empty if the conditions contradict one another or the assumed
        signs.

    Examples
    --------
    >>> from fastslow.model.structure import real
    >>> w, T = real("w"), real("T")
    >>> solve_conditions([w, w - T], Candidates((w,), (T,)), Signs({T: 1}))
    []
    >>> solve_conditions([w, w - T], Candidates((w,), (T,)), Signs({}))
    [({w: 0, T: 0}, (), ())]
    """
    Way = tuple[dict[sp.Symbol, sp.Expr], tuple[sp.Expr, ...], tuple[sp.Expr, ...]]
    ways: list[Way] = [({}, (), ())]
    for equation in equations:
        further: list[Way] = []
        for place, radicands, left in ways:
            here = sp.sympify(equation.subs(place))
            if signs.sign(here) == 0:
                further.append((place, radicands, left))
                continue
            if signs.sign(here) is not None:
                continue
            for part, _ in factors_in(here, tuple(here.free_symbols)) or [(here, 1)]:
                if signs.nonzero(part):
                    continue
                choice = choose_symbol(part, candidates.without(*place), signs)
                if choice is None:
                    further.append((place, radicands, (*left, part)))
                    continue
                for root in choice.values:
                    value = {choice.symbol: root.value}
                    side = signs.known.get(choice.symbol)
                    if side is not None and signs.sign(side * root.value) in (0, -1):
                        continue
                    moved = {s: sp.sympify(e.subs(value)) for s, e in place.items()}
                    under = (*(r.subs(value) for r in radicands), *root.radicands)
                    rest = tuple(e.subs(value) for e in left)
                    further.append(({**moved, **value}, under, rest))
        ways = further
    return ways
