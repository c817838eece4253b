"""Pieces of equations, each of which the signs of its own conditions choose.

Of k independent conditions 2^k regions follow. Where these are too many to form them all, every
``Piecewise`` is kept as a piece with the interfaces that decide it and its values on both sides of
them, and the equations of a region, or of sliding along several interfaces at once, are formed from
the pieces when they are needed.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import product
from math import prod

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from fastslow.model.expansion import expanded
from fastslow.model.interfaces import Interface, vanishes_on
from fastslow.model.reading import factorise, signs_of_factors, smooth, switching_expressions
from fastslow.results.stored.sign_patterns import Pattern, possible_patterns

#: Number of interfaces that decide one piece up to which its values on all sides are listed at
#: once; the values of others are added as they are met.
MOST_DECIDING = 8


@dataclass(frozen=True)
class Piece:
    """A ``Piecewise`` that no other contains.

    Parameters
    ----------
    expression : sympy.Piecewise
    deciding : tuple of int
        Numbers of the interfaces on whose signs it depends.
    patterns : tuple of tuple of int
        Their signs that are possible together; empty if they are too many.
    """

    expression: sp.Expr
    deciding: tuple[int, ...]
    patterns: tuple[Pattern, ...]

    def own(self, signs: Sequence[int]) -> Pattern:
        """Return the signs of the deciding interfaces among those of all."""
        return tuple(signs[j] for j in self.deciding)


@dataclass(frozen=True, eq=False)
class Pieces:
    """The pieces of all rates and laws.

    Parameters
    ----------
    interfaces : tuple of Interface
    moving : tuple of Symbol
        As for `fastslow.model.reading.factorise`.
    pieces : tuple of Piece
    values : mapping
        Parameter values, used only for the signs of factors in parameters alone.
    """

    interfaces: tuple[Interface, ...]
    moving: tuple[sp.Symbol, ...]
    pieces: tuple[Piece, ...]
    values: Mapping[sp.Symbol, float]
    _values: dict[tuple[int, Pattern], sp.Expr] = field(default_factory=dict)

    @classmethod
    def of(
        cls,
        expressions: Iterable[sp.Expr],
        interfaces: tuple[Interface, ...],
        moving: tuple[sp.Symbol, ...],
        rows: Sequence[NDArray[np.float64] | None],
        values: Mapping[sp.Symbol, float],
    ) -> Pieces:
        """Find the pieces of some expressions.

        ``rows`` are the affine functions of the interfaces, as for
        `fastslow.results.stored.sign_patterns.possible_patterns`.
        """
        numbers = _numbers(interfaces, moving)
        found = []
        for written in dict.fromkeys(p for e in expressions for p in outermost(e)):
            deciding = _deciding(written, numbers, moving)
            few = len(deciding) <= MOST_DECIDING
            possible = possible_patterns([rows[j] for j in deciding]) if few else []
            found.append(Piece(written, deciding, tuple(possible)))
        return cls(interfaces, moving, tuple(found), values)

    @cached_property
    def numbers(self) -> dict[sp.Expr, int]:
        """The number of each piece by its expression."""
        return {piece.expression: k for k, piece in enumerate(self.pieces)}

    @cached_property
    def deciding(self) -> tuple[tuple[int, ...], ...]:
        """For every interface the numbers of the pieces that it decides."""
        return tuple(
            tuple(k for k, piece in enumerate(self.pieces) if j in piece.deciding)
            for j in range(len(self.interfaces))
        )

    def possible(self, signs: Sequence[int]) -> bool:
        """Return False for signs of which some that decide one piece exclude each other.

        An interface whose sign is zero may have either sign.
        """
        if len(signs) != len(self.interfaces):
            return False
        for piece in self.pieces:
            own = piece.own(signs)
            if piece.patterns and not any(
                all(s in (0, p) for s, p in zip(own, pattern, strict=True))
                for pattern in piece.patterns
            ):
                return False
        return True

    def value(self, number: int, own: Pattern) -> sp.Expr:
        """Return the value of a piece where its deciding interfaces have given signs."""
        key = number, own
        if key not in self._values:
            piece = self.pieces[number]
            functions = [self.interfaces[j].function for j in piece.deciding]
            sides = zip(functions, own, strict=True)
            known = signs_of_factors(sides, self.moving, self.values)
            self._values[key] = smooth(piece.expression, known, self.moving, self.values)
        return self._values[key]

    def in_region(self, expression: sp.Expr, signs: Sequence[int]) -> sp.Expr:
        """Return an expression where the interfaces have given signs."""
        values = {
            written: self.value(k := self.numbers[written], self.pieces[k].own(signs))
            for written in outermost(expression)
        }
        return expression.xreplace(values) if values else expression

    def continuous(self, number: int) -> bool:
        """Check whether no piece jumps across an interface, decided symbolically."""
        function = self.interfaces[number].function
        for k in self.deciding[number]:
            piece = self.pieces[k]
            if not piece.patterns:
                return False
            place = piece.deciding.index(number)
            for above in piece.patterns:
                below = (*above[:place], -1, *above[place + 1 :])
                if above[place] > 0 and below in piece.patterns:
                    jump = self.value(k, above) - self.value(k, below)
                    if not vanishes_on(jump, function):
                        return False
        return True

    def parts(self, number: int, own: Pattern) -> dict[int | None, sp.Expr] | None:
        """Return the mean of a piece on its interfaces of sign zero, and its jump across each.

        By the number of the interface; the mean is that of None. With weights from −1 to 1 in
        place of the signs, the piece is the mean with the sum of the jumps times these weights.
        None if it is not such a sum.
        """
        piece = self.pieces[number]
        zeros = [k for k, sign in enumerate(own) if sign == 0]
        if not zeros:
            return {None: self.value(number, own)}
        values: dict[Pattern, sp.Expr] = {}
        for side in product((1, -1), repeat=len(zeros)):
            corner = list(own)
            for k, s in zip(zeros, side, strict=True):
                corner[k] = s
            values[side] = self.value(number, tuple(corner))
        found: dict[int | None, sp.Expr] = {}
        for used in product((0, 1), repeat=len(zeros)):
            part = expanded(_mean(used, values))
            if sum(used) > 1 and part != 0:
                return None
            if sum(used) <= 1:
                found[piece.deciding[zeros[used.index(1)]] if any(used) else None] = part
        return found


def outermost(expression: sp.Expr) -> list[sp.Expr]:
    """Return every Piecewise that no other contains, in order of appearance."""
    if not expression.has(sp.Piecewise):
        return []
    if isinstance(expression, sp.Piecewise):
        return [expression]
    return list(dict.fromkeys(p for a in expression.args for p in outermost(a)))


def _numbers(interfaces: Sequence[Interface], moving: tuple[sp.Symbol, ...]) -> dict[sp.Expr, int]:
    """The number of the interface by its function, and by the factors of its function."""
    found: dict[sp.Expr, int] = {}
    for number, interface in enumerate(interfaces):
        found.setdefault(interface.function, number)
        for factor, _ in factorise(interface.function, moving).factors:
            found.setdefault(factor, number)
    return found


def _deciding(
    written: sp.Expr, numbers: Mapping[sp.Expr, int], moving: tuple[sp.Symbol, ...]
) -> tuple[int, ...]:
    """Numbers of the interfaces on which the branch of an expression depends."""
    found = set()
    for switching in switching_expressions(written):
        whole = numbers.get(switching, numbers.get(-switching))
        if whole is not None:
            found.add(whole)
            continue
        factors = (factor for factor, _ in factorise(switching, moving).factors)
        found |= {numbers[factor] for factor in factors if factor in numbers}
    return tuple(sorted(found))


def _mean(used: Sequence[int], values: Mapping[Pattern, sp.Expr]) -> sp.Expr:
    """The part of values at corners that is proportional to the signs of some interfaces."""
    terms = (
        prod(s for s, u in zip(side, used, strict=True) if u) * value
        for side, value in values.items()
    )
    return sp.Add(*terms) / len(values)
