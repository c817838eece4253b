"""Equilibrium equations of a region, eliminated once for all values of the other parameters.

Which states can be solved for depends on what vanishes. Where the answers to all such questions
are the same, what remains is the same polynomial in unknowns and parameters, and for other
values only its coefficients are computed, exactly.
"""

from __future__ import annotations

import math
import threading
from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from typing import Any

import sympy as sp

from fastslow.continuation.polynomial_systems import WholeTerms
from fastslow.model.derived import once, partition_of
from fastslow.model.model import Model
from fastslow.symbolic.elimination import Elimination

#: States up to which equations are eliminated with symbols for the parameters.
STATES = 8

#: Sets of answers for which the equations of one region are kept.
KEPT = 16

#: Exponents of the kept symbols, those of the parameters, and a coefficient, for every term.
Parts = tuple[tuple[tuple[int, ...], tuple[int, ...], int], ...]


@dataclass(frozen=True)
class ParametricPolynomials:
    """Polynomials in some symbols, with coefficients that are polynomials in the parameters.

    Parameters
    ----------
    parts : tuple of Parts
    degrees : tuple of int
        The largest exponent of each parameter.
    """

    parts: tuple[Parts, ...]
    degrees: tuple[int, ...]

    def at(self, values: Sequence[Fraction]) -> list[WholeTerms]:
        """At values of the parameters, all times the same positive number that makes them whole.

        Examples
        --------
        >>> x, a, b = sp.symbols("x a b")
        >>> polynomials_of([a * x**2 + b * x, a], [x], [a, b]).at([Fraction(1, 2), Fraction(3)])
        [{(2,): 1, (1,): 6}, {(0,): 1}]
        """
        powers = [
            [v.numerator**k * v.denominator ** (most - k) for k in range(most + 1)]
            for v, most in zip(values, self.degrees, strict=True)
        ]
        return [_specialised(parts, powers) for parts in self.parts]


def polynomials_of(
    expressions: Sequence[sp.Expr], kept: Sequence[sp.Symbol], parameters: Sequence[sp.Symbol]
) -> ParametricPolynomials | None:
    """Polynomials in kept symbols and parameters; None if one is none with rational numbers."""
    symbols = [*kept, *parameters]
    read: list[list[tuple[tuple[int, ...], Fraction]]] = []
    for expression in expressions:
        if not expression.is_polynomial(*symbols):
            return None
        terms = sp.Poly(expression, *symbols).terms() if symbols else [((), expression)]
        if not all(number.is_Rational for _, number in terms):
            return None
        read.append([(e, Fraction(int(c.p), int(c.q))) for e, c in terms if c != 0])
    common = math.lcm(1, *(c.denominator for terms in read for _, c in terms))
    first = len(kept)
    parts = tuple(
        tuple((e[:first], e[first:], int(c * common)) for e, c in terms) for terms in read
    )
    every = [e for one in parts for _, e, _ in one]
    degrees = tuple(max((e[k] for e in every), default=0) for k in range(len(parameters)))
    return ParametricPolynomials(parts, degrees)


def _specialised(parts: Parts, powers: Sequence[Sequence[int]]) -> dict[tuple[int, ...], int]:
    found: dict[tuple[int, ...], int] = {}
    for kept, exponents, number in parts:
        for table, exponent in zip(powers, exponents, strict=True):
            number *= table[exponent]
        found[kept] = found[kept] + number if kept in found else number
    return {kept: number for kept, number in found.items() if number}


@dataclass(frozen=True, eq=False)
class ParametricElimination:
    """An elimination with polynomials in at most one unknown, for all values of parameters.

    Parameters
    ----------
    general : Elimination
        With symbols for the parameters.
    parameters : tuple of Symbol
    remaining, bounds : ParametricPolynomials
        What remains, and what vanishes where an equilibrium leaves its region, in the
        unknowns and the varying parameter.
    solved : tuple of ParametricPolynomials
        Numerator and denominator of every state, in the same.
    """

    general: Elimination
    parameters: tuple[sp.Symbol, ...]
    remaining: ParametricPolynomials
    bounds: ParametricPolynomials
    solved: tuple[ParametricPolynomials, ...]


#: The sign of polynomials in the parameters.
Signs = dict[ParametricPolynomials, int]


class Answers:
    """Whether expressions vanish at values of the parameters, and what these answers rest on."""

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
    """What is known of the equations of one region, by the answers on which it rests."""

    found: list[tuple[Signs, ParametricElimination | None]] = field(default_factory=list)
    lock: threading.Lock = field(default_factory=threading.Lock)

    def at(
        self,
        values: Mapping[sp.Symbol, sp.Rational],
        derive: Callable[[Answers], ParametricElimination | None],
    ) -> ParametricElimination | None:
        """The elimination for some values; None where it has to be made for each of them."""
        numbers = exactly(values)
        with self.lock:
            for signs, known in self.found:
                if all(_sign(one, numbers) == sign for one, sign in signs.items()):
                    return known
            answers = Answers(values)
            result = derive(answers)
            if not answers.known:
                return None
            self.found = [*self.found[1 - KEPT :], (answers.signs, result)]
            return result


@once(partition_of)
def eliminations_of(model: Model, *key: Hashable) -> Eliminations:
    """What is known for a model's equations and further things that it depends on."""
    return Eliminations()


def exactly(values: Mapping[sp.Symbol, sp.Rational]) -> list[Fraction]:
    """Rational numbers of SymPy as those of Python."""
    return [Fraction(int(v.p), int(v.q)) for v in values.values()]


def _sign(polynomial: ParametricPolynomials, numbers: Sequence[Fraction]) -> int:
    """Sign of a polynomial in the parameters alone."""
    (terms,) = polynomial.at(numbers)
    value = terms.get((), 0)
    return (value > 0) - (value < 0)
