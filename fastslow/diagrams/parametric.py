"""Equilibrium equations of a region, eliminated once for all values of the other parameters.

Which states can be solved for depends on what vanishes. Where the answers to all such questions
are the same, what remains is the same polynomial in unknowns and parameters, and for other
values only its coefficients are computed, exactly.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from typing import Any

import sympy as sp

from fastslow.continuation.polynomial_systems import Terms
from fastslow.model.derived import once, partition_of
from fastslow.model.model import Model
from fastslow.symbolic.elimination import Elimination

#: States up to which equations are eliminated with symbols for the parameters.
STATES = 8

#: Sets of answers for which the equations of one region are kept.
KEPT = 16

#: Exponents of the kept symbols, those of the parameters, and a coefficient, for every term.
Parts = tuple[tuple[tuple[int, ...], tuple[int, ...], Fraction], ...]


@dataclass(frozen=True, eq=False)
class ParametricElimination:
    """An elimination with polynomials in at most one unknown, for all values of parameters.

    Parameters
    ----------
    general : Elimination
        With symbols for the parameters.
    parameters : tuple of Symbol
    remaining, bounds : tuple of Parts
        What remains, and what vanishes where an equilibrium leaves its region, in the
        unknowns and the varying parameter.
    solved : tuple of (Parts, Parts)
        Numerator and denominator of every state, in the same.
    """

    general: Elimination
    parameters: tuple[sp.Symbol, ...]
    remaining: tuple[Parts, ...]
    bounds: tuple[Parts, ...]
    solved: tuple[tuple[Parts, Parts], ...]


class Answers:
    """Whether expressions vanish at values of the parameters, and what these answers rest on."""

    def __init__(self, values: Mapping[sp.Symbol, sp.Rational]) -> None:
        self.values = values
        self.signs: dict[Parts, int] = {}
        self.known = True

    def __call__(self, expression: sp.Expr) -> bool:
        """Whether an expression is known not to vanish."""
        inside = expression.free_symbols & set(self.values)
        if inside:
            others = sorted(expression.free_symbols - inside, key=str)
            for part in sp.fraction(sp.together(expression)):
                read = parts_of(part, others, tuple(self.values))
                if read is None:
                    self.known = False
                else:
                    self._note(read)
        return bool(expression.subs(self.values).is_nonzero)

    def _note(self, parts: Parts) -> None:
        """Keep the sign of every coefficient, which is a polynomial in the parameters."""
        numbers = [Fraction(int(v.p), int(v.q)) for v in self.values.values()]
        coefficients: dict[tuple[int, ...], list[Any]] = {}
        for kept, powers, number in parts:
            coefficients.setdefault(kept, []).append(((), powers, number))
        for terms in coefficients.values():
            self.signs[tuple(terms)] = _sign(tuple(terms), numbers)


@dataclass
class Eliminations:
    """What is known of the equations of one region, by the answers on which it rests."""

    found: list[tuple[dict[Parts, int], ParametricElimination | None]] = field(default_factory=list)
    lock: threading.Lock = field(default_factory=threading.Lock)

    def at(
        self,
        values: Mapping[sp.Symbol, sp.Rational],
        derive: Callable[[Answers], ParametricElimination | None],
    ) -> ParametricElimination | None:
        """The elimination for some values; None where it has to be made for each of them."""
        numbers = [Fraction(int(v.p), int(v.q)) for v in values.values()]
        with self.lock:
            for signs, known in self.found:
                if all(_sign(parts, numbers) == sign for parts, sign in signs.items()):
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


def parts_of(
    expression: sp.Expr, kept: Sequence[sp.Symbol], parameters: Sequence[sp.Symbol]
) -> Parts | None:
    """A polynomial in kept symbols and parameters; None if it is none with rational numbers."""
    symbols = [*kept, *parameters]
    if not symbols:
        return ((((), (), _fraction(expression)),)) if expression.is_Rational else None
    if not expression.is_polynomial(*symbols):
        return None
    found = []
    for powers, number in sp.Poly(expression, *symbols).terms():
        if not number.is_Rational:
            return None
        if number != 0:
            found.append((powers[: len(kept)], powers[len(kept) :], _fraction(number)))
    return tuple(found)


def specialised(parts: Parts, numbers: Sequence[Fraction]) -> Terms:
    """The polynomial in the kept symbols at values of the parameters.

    Examples
    --------
    >>> specialised((((1,), (2,), Fraction(3)), ((0,), (0,), Fraction(1))), [Fraction(2)])
    {(1,): Fraction(12, 1), (0,): Fraction(1, 1)}
    """
    found: dict[tuple[int, ...], Fraction] = {}
    for kept, powers, number in parts:
        for value, power in zip(numbers, powers, strict=True):
            if power:
                number = number * value**power
        found[kept] = found[kept] + number if kept in found else number
    return {kept: number for kept, number in found.items() if number}


def _sign(parts: Parts, numbers: Sequence[Fraction]) -> int:
    value = sum(specialised(parts, numbers).values(), Fraction(0))
    return (value > 0) - (value < 0)


def _fraction(number: sp.Rational) -> Fraction:
    return Fraction(int(number.p), int(number.q))
