"""Jacobians, characteristic polynomials and the Routh-Hurwitz conditions."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache

import sympy as sp
from sympy.logic.boolalg import Boolean
from sympy.polys.domains import ZZ
from sympy.polys.rings import PolyElement, PolyRing
from sympy.utilities.iterables import strongly_connected_components

from fastslow.model.differentiation import derivative
from fastslow.model.recurrences import CODES_KEPT
from fastslow.model.structure import real
from fastslow.model.work import cached
from fastslow.results.base.display import Displayed
from fastslow.symbolic.algebra import (
    characteristic_coefficients,
    compressed,
    expanded_form,
    growth,
    rational_form,
)

#: Variable of characteristic polynomials.
EIGENVALUE = sp.Symbol("lambda")

#: Bound on the terms of a Hurwitz determinant that is expanded.
HURWITZ = 400

#: Bound on products times nodes, beyond which a Hurwitz determinant is not evaluated.
HURWITZ_WORK = 20_000

SignOf = Callable[[sp.Expr], "int | None"]
ConditionOf = Callable[[sp.Expr], Boolean]


@dataclass(frozen=True)
class HopfTest(Displayed):
    """Test for a pair of eigenvalues with zero sum in one irreducible block of the Jacobian.

    Parameters
    ----------
    test : sympy.Expr
        The last but one Hurwitz determinant, which vanishes there (Orlando 1911).
    position : int
        Index of the test among the Routh-Hurwitz expressions.
    block : tuple of sympy.Expr
        Coefficients of the characteristic polynomial of the block.
    """

    test: sp.Expr
    position: int
    block: tuple[sp.Expr, ...]

    @property
    def size(self) -> int:
        """Number of states in the block."""
        return len(self.block) - 1

    @property
    def frequency_squared(self) -> sp.Expr:
        """Squared frequency ω² of the pair, if it is the only one.

        Positive at a Hopf point, negative at a neutral saddle.
        """
        return frequency_squared(self.block)


@dataclass(frozen=True)
class Stability(Displayed):
    """The characteristic polynomial and its Routh-Hurwitz conditions.

    Parameters
    ----------
    blocks : tuple of tuple of sympy.Expr
        1, a1, …, an of λⁿ + a1 λⁿ⁻¹ + … + an for each irreducible diagonal block of the
        Jacobian; their product is the characteristic polynomial.
    routh_hurwitz : tuple of sympy.Expr
        Expressions block by block, all positive iff the equilibrium is asymptotically
        stable (Liénard and Chipart 1914: every coefficient and every second Hurwitz
        determinant, counted down from the last but one). A determinant past the
        budget is given as products of coefficients, or unevaluated.
    signs : tuple of int or None
        Sign of each in the region under the assumptions; None if undecided.
    conditions : tuple of Boolean
        Inequalities that the assumptions do not decide.
    """

    blocks: tuple[tuple[sp.Expr, ...], ...]
    routh_hurwitz: tuple[sp.Expr, ...]
    signs: tuple[int | None, ...]
    conditions: tuple[Boolean, ...] = ()

    @property
    def dimension(self) -> int:
        """Number of states."""
        return sum(len(b) - 1 for b in self.blocks)

    @cached_property
    def coefficients(self) -> tuple[sp.Expr, ...]:
        """Expanded coefficients 1, a1, …, an of the characteristic polynomial."""
        whole: tuple[sp.Expr, ...] = (sp.S.One,)
        for block in self.blocks:
            total = [sp.S.Zero] * (len(whole) + len(block) - 1)
            for (j, a), (k, b) in itertools.product(enumerate(whole), enumerate(block)):
                total[j + k] += a * b
            whole = tuple(map(rational_form, total))
        return whole

    @property
    def trace(self) -> sp.Expr:
        """Trace of the Jacobian."""
        return expanded_form(-sp.Add(*(b[1] for b in self.blocks)))

    @property
    def determinant(self) -> sp.Expr:
        """Determinant of the Jacobian."""
        return expanded_form((-1) ** self.dimension * sp.Mul(*(b[-1] for b in self.blocks)))

    @property
    def characteristic_polynomial(self) -> sp.Expr:
        """Characteristic polynomial in λ (``EIGENVALUE``), with one factor for each block."""
        return sp.Mul(
            *(
                sp.Add(*(a * EIGENVALUE ** (len(b) - 1 - k) for k, a in enumerate(b)))
                for b in self.blocks
            )
        )

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
        """Remark on the number of Routh-Hurwitz expressions that are not expanded."""
        left = [e for e in self.routh_hurwitz if e.has(sp.Determinant) or compressed(e)]
        if not left:
            return ()
        whole = len(self.routh_hurwitz)
        kept = "determinants" if any(e.has(sp.Determinant) for e in left) else "products"
        return (
            f"{len(left)} of the {whole} Routh-Hurwitz expressions are past the budget of "
            f"expansion; stability.routh_hurwitz gives them as {kept} of coefficients",
        )

    @cached_property
    def hopf_tests(self) -> tuple[HopfTest, ...]:
        """One test for each block of two or more states."""
        found = []
        position = 0
        for block in self.blocks:
            size = len(block) - 1
            place = position if size == 2 else position + size
            if size > 1:
                found.append(HopfTest(self.routh_hurwitz[place], place, block))
            position += _count(size)
        return tuple(found)

    @property
    def focus_test(self) -> sp.Expr | None:
        """4 det − trace² of a planar system, positive for complex eigenvalues; else None."""
        if self.dimension != 2:
            return None
        return expanded_form(4 * self.coefficients[2] - self.coefficients[1] ** 2)


def jacobian(rates: Mapping[str, sp.Expr], states: Sequence[str]) -> sp.ImmutableDenseMatrix:
    """Return the Jacobian of the rates, shape (n, n), in the order of the states.

    Examples
    --------
    >>> x, v = real("x"), real("v")
    >>> jacobian({"x": v, "v": -x**3}, ["x", "v"])
    Matrix([
    [      0, 1],
    [-3*x**2, 0]])
    """
    columns = tuple(real(n) for n in states)
    return sp.ImmutableDenseMatrix([_gradient((rates[n], columns)) for n in states])


@cached(CODES_KEPT)
def _gradient(given: tuple[sp.Expr, tuple[sp.Symbol, ...]]) -> tuple[sp.Expr, ...]:
    """Return the derivatives of a rate by some symbols; many regions share it."""
    rate, columns = given
    return tuple(expanded_form(derivative(rate, c)) for c in columns)


def irreducible_blocks(matrix: sp.MatrixBase) -> list[tuple[int, ...]]:
    """Return the rows of the irreducible diagonal blocks of a matrix, up to permutation.

    Examples
    --------
    >>> irreducible_blocks(sp.Matrix([[1, 0, 2], [3, 4, 5], [6, 0, 7]]))
    [(0, 2), (1,)]
    """
    rows = list(range(matrix.rows))
    edges = [(i, j) for i in rows for j in rows if i != j and matrix[i, j] != 0]
    return sorted(tuple(sorted(b)) for b in strongly_connected_components((rows, edges)))


def stability_of_matrix(matrix: sp.MatrixBase, sign: SignOf, positive: ConditionOf) -> Stability:
    """Return the characteristic polynomial and Routh-Hurwitz conditions of a matrix.

    Parameters
    ----------
    matrix : sympy.Matrix, shape (n, n)
    sign : callable
        Expression to its sign +1, 0 or −1, None if undecided.
    positive : callable
        Expression to the condition for it to be positive.

    Examples
    --------
    >>> a = real("a")
    >>> matrix = sp.Matrix([[-1, 0], [0, -a]])
    >>> stability_of_matrix(matrix, lambda e: None, lambda e: e > 0).conditions
    (a > 0,)
    """
    blocks, tests = expressions_of_matrix(matrix)
    return stability_of_tests(blocks, tests, sign, positive)


def expressions_of_matrix(
    matrix: sp.MatrixBase,
) -> tuple[tuple[tuple[sp.Expr, ...], ...], tuple[sp.Expr, ...]]:
    """Return the coefficients of the blocks of a matrix and the Routh-Hurwitz expressions."""
    each = [
        _of_block(sp.ImmutableDenseMatrix(matrix.extract(list(rows), list(rows))))
        for rows in irreducible_blocks(matrix)
    ]
    return tuple(b for b, _ in each), tuple(t for _, tests in each for t in tests)


def _count(size: int) -> int:
    """Number of Routh-Hurwitz expressions of a block."""
    return size + len(range(size - 1, 1, -2))


@cached(256)
def _of_block(
    matrix: sp.ImmutableDenseMatrix,
) -> tuple[tuple[sp.Expr, ...], tuple[sp.Expr, ...]]:
    coefficients = tuple(rational_form(a) for a in characteristic_coefficients(matrix))
    n = len(coefficients) - 1
    tests = list(coefficients[1:])
    sizes = [growth(a) for a in coefficients]
    for order in range(n - 1, 1, -2):
        # the product of the longest coefficients bounds the length of the determinant
        short = math.prod(sorted(sizes)[-order:]) <= HURWITZ
        test = hurwitz(coefficients, order)
        tests.append(rational_form(test) if short else test)
    return coefficients, tuple(tests)


def stability_of_tests(
    blocks: tuple[tuple[sp.Expr, ...], ...],
    tests: tuple[sp.Expr, ...],
    sign: SignOf,
    positive: ConditionOf,
) -> Stability:
    """Return the stability for given Routh-Hurwitz expressions."""
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
    return Stability(blocks, tests, tuple(signs), tuple(dict.fromkeys(open_ones)))


def frequency_squared(coefficients: Sequence[sp.Expr]) -> sp.Expr:
    """Return ω² of the eigenvalue pair with zero sum, on the zeros of the Hurwitz test.

    With λ² = z the characteristic polynomial is E(z) + λ O(z), and such a pair is a common
    root z = −ω² of both: the root of their first subresultant, where there is just one pair
    (Gantmacher 1959, ch. XV; Guckenheimer, Myers and Sturmfels 1997). It is positive for an
    imaginary pair and negative for two real eigenvalues.

    Parameters
    ----------
    coefficients : sequence of sympy.Expr
        1, a1, …, an, n at least 2.

    Examples
    --------
    >>> a = sp.symbols("a1:6")
    >>> frequency_squared((1, *a[:3])), frequency_squared((1, *a[:4]))
    (a2, a3/a1)
    >>> frequency_squared((1, *a))
    (a1*a4 - a5)/(a1*a2 - a3)
    """
    n = len(coefficients) - 1
    if n < 4:
        return sp.sympify(coefficients[2])
    above, below = (_in_coefficients(rows, coefficients) for rows in _first_subresultant(n))
    return above / below


def _first_subresultant(size: int) -> list[list[list[int | None]]]:
    """Matrices (indices of coefficients) of the constant and slope of the subresultant."""
    one, two = range(size % 2, size + 1, 2), range(1 - size % 2, size + 1, 2)
    width = len(one) + len(two) - 3
    rows: list[list[int | None]] = []
    for numbers, other in ((one, two), (two, one)):
        # a subresultant of degree one takes one row less of each than the resultant
        for k in range(len(other) - 2):
            row: list[int | None] = [None] * width
            row[k : k + len(numbers)] = numbers
            rows.append(row)
    return [[[*row[: width - 2], row[last]] for row in rows] for last in (width - 1, width - 2)]


def _in_coefficients(
    rows: Sequence[Sequence[int | None]], coefficients: Sequence[sp.Expr]
) -> sp.Expr:
    """Determinant of a matrix of polynomial coefficients, given by their indices."""
    names, expanded = _determinant_of(tuple(map(tuple, rows)))
    if not rows:
        return expanded
    nodes = max(sum(1 for _ in sp.preorder_traversal(coefficients[k])) for k in names)
    if len(sp.Add.make_args(expanded)) * nodes > HURWITZ_WORK:
        entries = [[sp.S.Zero if k is None else coefficients[k] for k in row] for row in rows]
        return sp.Determinant(sp.ImmutableDenseMatrix(entries))
    return expanded.xreplace({s: coefficients[k] for k, s in names.items()})


@lru_cache(maxsize=64)
def _determinant_of(
    rows: tuple[tuple[int | None, ...], ...],
) -> tuple[dict[int, sp.Symbol], sp.Expr]:
    """Symbols for the indices in a matrix, where 0 denotes one, and its determinant."""
    numbers = sorted({k for row in rows for k in row if k})
    names = {k: sp.Dummy(f"a{k}", real=True) for k in numbers}
    ring = PolyRing(list(names.values()), ZZ)
    entries: dict[int | None, PolyElement] = {None: ring.zero, 0: ring.one}
    entries.update(zip(numbers, ring.gens, strict=True))
    known: dict[tuple[int, ...], PolyElement] = {(): ring.one}

    def minor(columns: tuple[int, ...]) -> PolyElement:
        if columns not in known:
            row = rows[len(rows) - len(columns)]
            total = ring.zero
            for k, column in enumerate(columns):
                if row[column] is not None:
                    rest = minor((*columns[:k], *columns[k + 1 :]))
                    total += (-1) ** k * entries[row[column]] * rest
            known[columns] = total
        return known[columns]

    return names, minor(tuple(range(len(rows)))).as_expr()


def hurwitz(coefficients: Sequence[sp.Expr], order: int) -> sp.Expr:
    """Return the leading Hurwitz determinant of an order, from 1, a1, …, an.

    Examples
    --------
    >>> hurwitz((1, *sp.symbols("a b c")), 2)
    a*b - c
    """
    n = len(coefficients) - 1
    rows = [
        [k if 0 <= (k := 2 * j - i + 1) <= n else None for j in range(order)] for i in range(order)
    ]
    return _in_coefficients(rows, coefficients)
