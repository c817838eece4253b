"""Jacobians, characteristic polynomials and the Routh-Hurwitz conditions."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import sympy as sp
from sympy.logic.boolalg import Boolean

from fastslow.model.structure import real
from fastslow.symbolic.algebra import (
    characteristic_coefficients,
    compressed,
    determinant,
    growth,
    spread,
    tidy,
)

#: The variable of characteristic polynomials.
EIGENVALUE = sp.Symbol("lambda")

#: A Hurwitz determinant that may have more terms than this is not expanded.
HURWITZ = 400

SignOf = Callable[[sp.Expr], "int | None"]
ConditionOf = Callable[[sp.Expr], Boolean]


@dataclass(frozen=True)
class Stability:
    """The characteristic polynomial and when all its roots lie in the left half plane.

    Parameters
    ----------
    coefficients : tuple of sympy.Expr
        1, a1, …, an of λⁿ + a1 λⁿ⁻¹ + … + an.
    routh_hurwitz : tuple of sympy.Expr
        All of them are positive iff the equilibrium is asymptotically stable
        (Liénard and Chipart 1914: every coefficient and every second Hurwitz
        determinant, counted down from the last but one). A determinant past the
        budget is left as products of coefficients.
    signs : tuple of int or None
        Sign of each under the assumptions and in the region; None where open.
    conditions : tuple of Boolean
        The inequalities among them that the assumptions leave open.
    """

    coefficients: tuple[sp.Expr, ...]
    routh_hurwitz: tuple[sp.Expr, ...]
    signs: tuple[int | None, ...]
    conditions: tuple[Boolean, ...] = ()

    @property
    def dimension(self) -> int:
        return len(self.coefficients) - 1

    @property
    def trace(self) -> sp.Expr:
        return -self.coefficients[1]

    @property
    def determinant(self) -> sp.Expr:
        return spread((-1) ** self.dimension * self.coefficients[-1])

    @property
    def characteristic_polynomial(self) -> sp.Expr:
        """In λ (``EIGENVALUE``)."""
        n = self.dimension
        return sp.Add(*(a * EIGENVALUE ** (n - k) for k, a in enumerate(self.coefficients)))

    @property
    def verdict(self) -> str:
        """``"stable"``, ``"unstable"``, ``"neutral"``, or ``"depends"`` (see ``conditions``)."""
        if all(s == 1 for s in self.signs):
            return "stable"
        if -1 in self.signs:
            return "unstable"
        if 0 in self.signs and None not in self.signs:
            return "neutral"
        return "depends"

    @property
    def notes(self) -> tuple[str, ...]:
        """Which of the Routh-Hurwitz expressions are not expanded, past the budget."""
        return tuple(
            f"Routh-Hurwitz expression {k} is past the budget of expansion; given as products"
            for k, e in enumerate(self.routh_hurwitz, 1)
            if compressed(e)
        )

    @property
    def hopf_test(self) -> sp.Expr | None:
        """Vanishes where a pair of eigenvalues has sum zero; None in one dimension."""
        if self.dimension < 2:
            return None
        return self.routh_hurwitz[0] if self.dimension == 2 else self.routh_hurwitz[self.dimension]

    @property
    def focus_test(self) -> sp.Expr | None:
        """Planar: positive where the eigenvalues are complex, 4 det − trace²; else None."""
        if self.dimension != 2:
            return None
        return spread(4 * self.coefficients[2] - self.coefficients[1] ** 2)


def jacobian(rates: Mapping[str, sp.Expr], states: Sequence[str]) -> sp.ImmutableDenseMatrix:
    """Give derivatives of the rates, shape (n, n), in the order of the states.

    Examples
    --------
    >>> x, v = real("x"), real("v")
    >>> jacobian({"x": v, "v": -x**3}, ["x", "v"])
    Matrix([
    [      0, 1],
    [-3*x**2, 0]])
    """
    columns = [real(n) for n in states]
    return sp.ImmutableDenseMatrix([[spread(rates[n].diff(c)) for c in columns] for n in states])


def stability_of_matrix(matrix: sp.MatrixBase, sign: SignOf, positive: ConditionOf) -> Stability:
    """Characteristic polynomial and Routh-Hurwitz conditions of a matrix.

    Parameters
    ----------
    matrix : sympy.Matrix, shape (n, n)
    sign : callable
        Expression to +1, 0, −1, or None where its sign is open.
    positive : callable
        Expression to the condition for its being positive.

    Examples
    --------
    >>> a = real("a")
    >>> matrix = sp.Matrix([[-1, 0], [0, -a]])
    >>> stability_of_matrix(matrix, lambda e: None, lambda e: e > 0).conditions
    (a + 1 > 0, a > 0)
    """
    coefficients = tuple(tidy(a) for a in characteristic_coefficients(matrix))
    n = len(coefficients) - 1
    tests = list(coefficients[1:])
    sizes = [growth(a) for a in coefficients]
    names = [sp.S.One, *(sp.Dummy(f"a{k}", real=True) for k in range(1, n + 1))]
    place = dict(zip(names, coefficients, strict=True))
    for order in range(n - 1, 1, -2):
        # the product of the longest coefficients bounds the length of the determinant
        short = math.prod(sorted(sizes)[-order:]) <= HURWITZ
        test = hurwitz(coefficients if short else names, order)
        tests.append(tidy(test) if short else test.xreplace(place))
    return stability_of_tests(coefficients, tuple(tests), sign, positive)


def stability_of_tests(
    coefficients: tuple[sp.Expr, ...],
    tests: tuple[sp.Expr, ...],
    sign: SignOf,
    positive: ConditionOf,
) -> Stability:
    """Stability from given Routh-Hurwitz expressions."""
    signs: list[int | None] = []
    open_ones: list[Boolean] = []
    for test in tests:
        side = sign(test)
        condition = positive(test) if side is None else None
        if condition in (sp.true, sp.false):
            side = 1 if condition else -1
        elif condition is not None:
            open_ones.append(condition)
        signs.append(side)
    return Stability(coefficients, tests, tuple(signs), tuple(dict.fromkeys(open_ones)))


def hurwitz(coefficients: Sequence[sp.Expr], order: int) -> sp.Expr:
    """Leading Hurwitz determinant of an order, from 1, a1, …, an.

    Examples
    --------
    >>> hurwitz(sp.symbols("one a b c"), 2)
    a*b - c*one
    """
    n = len(coefficients) - 1
    entry = [
        [coefficients[k] if 0 <= (k := 2 * j - i + 1) <= n else sp.S.Zero for j in range(order)]
        for i in range(order)
    ]
    return determinant(sp.Matrix(entry))
