"""Elimination in the equilibrium equations of a region, with symbolic other parameters.

The elimination depends on which coefficients vanish. For equal decisions the remaining polynomials
in unknowns and parameters are the same, and for other values only their coefficients are
computed, exactly.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from typing import Any

import sympy as sp

from fastslow.diagrams.solve.exact_polynomials import ParametricPolynomials, exactly, polynomials_of
from fastslow.model.derived import cached_by_partition
from fastslow.model.model import Model
from fastslow.symbolic.solving.elimination import Elimination

#: Largest number of states for elimination with symbolic parameters.
ELIMINATED_STATES = 8

#: Largest number of cached eliminations of a region, for different signs.
ELIMINATIONS_KEPT = 16


@dataclass(frozen=True, eq=False)
class ParametricElimination:
    """An elimination to polynomials in at most one unknown, with symbolic parameters.

    Parameters
    ----------
    elimination : Elimination
        Elimination with symbols for the parameters.
    parameters : tuple of Symbol
    remaining, bounds : ParametricPolynomials
        Remaining equations, and bounds of the region at equilibria, in the unknowns and the
        varying parameter.
    solved : tuple of ParametricPolynomials
        Numerator and denominator of every state, in the same variables.
    """

    elimination: Elimination
    parameters: tuple[sp.Symbol, ...]
    remaining: ParametricPolynomials
    bounds: ParametricPolynomials
    solved: tuple[ParametricPolynomials, ...]


#: Signs of polynomials in the parameters.
Signs = dict[ParametricPolynomials, int]


class Decisions:
    """Decisions whether expressions vanish at parameter values, with the signs used."""

    def __init__(self, values: Mapping[sp.Symbol, sp.Rational]) -> None:
        self.values = values
        self._numbers = exactly(values)
        self.signs: Signs = {}
        self.known = True

    def __call__(self, expression: sp.Expr) -> bool:
        """Return whether an expression is known not to vanish."""
        inside = expression.free_symbols & set(self.values)
        if inside:
            others = sorted(expression.free_symbols - inside, key=str)
            for part in sp.fraction(sp.together(expression)):
                # one polynomial in the parameters for each monomial of the others
                whole = polynomials_of([part], others, tuple(self.values))
                if whole is None:
                    self.known = False
                else:
                    self._note(whole)
        return bool(expression.subs(self.values).is_nonzero)

    def _note(self, polynomial: ParametricPolynomials) -> None:
        """Record the sign of every coefficient, a polynomial in the parameters."""
        coefficients: dict[tuple[int, ...], list[Any]] = {}
        for kept, powers, number in polynomial.parts[0]:
            coefficients.setdefault(kept, []).append(((), powers, number))
        for terms in coefficients.values():
            alone = ParametricPolynomials((tuple(terms),), polynomial.degrees)
            self.signs[alone] = _sign(alone, self._numbers)


@dataclass
class Eliminations:
    """Eliminations of the equations of one region, each with the signs it depends on."""

    found: list[tuple[Signs, ParametricElimination | None]] = field(default_factory=list)
    lock: threading.Lock = field(default_factory=threading.Lock)

    def at(
        self,
        values: Mapping[sp.Symbol, sp.Rational],
        derive: Callable[[Decisions], ParametricElimination | None],
    ) -> ParametricElimination | None:
        """Return the elimination for some values; None if it is needed for each value anew."""
        numbers = exactly(values)
        with self.lock:
            for signs, known in self.found:
                if all(_sign(one, numbers) == sign for one, sign in signs.items()):
                    return known
            decisions = Decisions(values)
            result = derive(decisions)
            if not decisions.known:
                return None
            self.found = [*self.found[1 - ELIMINATIONS_KEPT :], (decisions.signs, result)]
            return result


@cached_by_partition
def eliminations_of(model: Model, *key: Hashable) -> Eliminations:
    """Return the cached eliminations for the equations of a model and further keys."""
    return Eliminations()


def _sign(polynomial: ParametricPolynomials, numbers: Sequence[Fraction]) -> int:
    """Return the sign of a polynomial in the parameters alone."""
    (terms,) = polynomial.at(numbers)
    value = terms.get((), 0)
    return (value > 0) - (value < 0)
