"""Equilibrium equations of a region, eliminated once for all values of the other parameters.

Which states can be solved for depends on what vanishes. Where all such decisions are the same,
what remains is the same polynomial in unknowns and parameters, and for other values only its
coefficients are computed, exactly.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from typing import Any

import sympy as sp

from fastslow.diagrams.solve.exact_polynomials import ParametricPolynomials, exactly, polynomials_of
from fastslow.model.derived import once, partition_of
from fastslow.model.model import Model
from fastslow.symbolic.solving.elimination import Elimination

#: States up to which equations are eliminated with symbols for the parameters.
STATES = 8

#: Eliminations of one region that are kept, for different signs.
KEPT = 16


@dataclass(frozen=True, eq=False)
class ParametricElimination:
    """An elimination with polynomials in at most one unknown, for all values of parameters.

    Parameters
    ----------
    elimination : Elimination
        With symbols for the parameters.
    parameters : tuple of Symbol
    remaining, bounds : ParametricPolynomials
        What remains, and what vanishes where an equilibrium leaves its region, in the
        unknowns and the varying parameter.
    solved : tuple of ParametricPolynomials
        Numerator and denominator of every state, in the same.
    """

    elimination: Elimination
    parameters: tuple[sp.Symbol, ...]
    remaining: ParametricPolynomials
    bounds: ParametricPolynomials
    solved: tuple[ParametricPolynomials, ...]


#: The sign of polynomials in the parameters.
Signs = dict[ParametricPolynomials, int]


class Decisions:
    """Whether expressions vanish at values of the parameters, and the signs that decide it."""

    def __init__(self, values: Mapping[sp.Symbol, sp.Rational]) -> None:
        self.values = values
        self._numbers = exactly(values)
        self.signs: Signs = {}
        self.known = True

    def __call__(self, expression: sp.Expr) -> bool:
        """Whether an expression is known not to vanish."""
        inside = expression.free_symbols & set(self.values)
        if inside:
            others = sorted(expression.free_symbols - inside, key=str)
            for part in sp.fraction(sp.together(expression)):
                # one polynomial in the parameters for every product of the others
                whole = polynomials_of([part], others, tuple(self.values))
                if whole is None:
                    self.known = False
                else:
                    self._note(whole)
        return bool(expression.subs(self.values).is_nonzero)

    def _note(self, polynomial: ParametricPolynomials) -> None:
        """Keep the sign of every coefficient, which is a polynomial in the parameters."""
        coefficients: dict[tuple[int, ...], list[Any]] = {}
        for kept, powers, number in polynomial.parts[0]:
            coefficients.setdefault(kept, []).append(((), powers, number))
        for terms in coefficients.values():
            alone = ParametricPolynomials((tuple(terms),), polynomial.degrees)
            self.signs[alone] = _sign(alone, self._numbers)


@dataclass
class Eliminations:
    """Eliminations of the equations of one region, each with the signs that decided its steps."""

    found: list[tuple[Signs, ParametricElimination | None]] = field(default_factory=list)
    lock: threading.Lock = field(default_factory=threading.Lock)

    def at(
        self,
        values: Mapping[sp.Symbol, sp.Rational],
        derive: Callable[[Decisions], ParametricElimination | None],
    ) -> ParametricElimination | None:
        """The elimination for some values; None where it has to be made for each of them."""
        numbers = exactly(values)
        with self.lock:
            for signs, known in self.found:
                if all(_sign(one, numbers) == sign for one, sign in signs.items()):
                    return known
            decisions = Decisions(values)
            result = derive(decisions)
            if not decisions.known:
                return None
            self.found = [*self.found[1 - KEPT :], (decisions.signs, result)]
            return result


@once(partition_of)
def eliminations_of(model: Model, *key: Hashable) -> Eliminations:
    """What is known for a model's equations and further things that it depends on."""
    return Eliminations()


def _sign(polynomial: ParametricPolynomials, numbers: Sequence[Fraction]) -> int:
    """Sign of a polynomial in the parameters alone."""
    (terms,) = polynomial.at(numbers)
    value = terms.get((), 0)
    return (value > 0) - (value < 0)
