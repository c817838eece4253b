"""Regions with linear rates, solved by Cramer's rule within a budget."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cache

import sympy as sp

from fastslow.model.differentiation import derivative
from fastslow.model.structure import real
from fastslow.symbolic.algebra import adjugate, determinant, expanded_form, growth

#: Terms of a determinant up to which elimination is used, which gives shorter forms.
SPARSE = 8

#: Bound on the terms of a determinant that is formed.
DENSE = 400

#: Mean number of entries per row up to which a system is sparse.
SPARSE_ENTRIES = 3

NOTE = "linear system with a determinant past the budget, solved numerically"


def cramer(
    rates: Mapping[str, sp.Expr], states: Sequence[str]
) -> tuple[dict[str, sp.Expr], sp.Expr] | str | None:
    """Solve a dense linear system of rates for the states.

    Parameters
    ----------
    rates : mapping
        State to smooth rate.
    states : sequence of str

    Returns
    -------
    tuple, None or str
        Values of the states, with the determinant; None if the rates are not
        linear, singular, or sparse enough for elimination; a note if the
        determinant is past the budget.

    Examples
    --------
    >>> x, a = real("x"), real("a")
    >>> cramer({"x": a * x - 1}, ["x"]) is None
    True
    """
    columns = [real(n) for n in states]
    rows = [expanded_form(rates[n]) for n in states]
    if not all(e.is_polynomial(*columns) for e in rows):
        return None
    matrix = sp.Matrix([[derivative(e, c) for c in columns] for e in rows])
    if matrix.free_symbols & set(columns):
        return None
    terms = _terms(matrix)
    if terms <= SPARSE:
        return None
    if terms > DENSE:
        # sparse systems are solved by elimination
        entries = sum(1 for e in matrix if e != 0)
        return None if entries <= SPARSE_ENTRIES * matrix.rows else NOTE
    below = determinant(matrix)
    if below == 0:
        return None
    rest = sp.Matrix([e.xreplace(dict.fromkeys(columns, sp.S.Zero)) for e in rows])
    above = adjugate(matrix) * rest
    return {n: -expanded_form(e) / below for n, e in zip(states, above, strict=True)}, below


def _terms(matrix: sp.MatrixBase) -> float:
    """Upper bound on the number of terms of a determinant."""
    sizes = [[0.0 if e == 0 else growth(e) for e in matrix.row(k)] for k in range(matrix.rows)]

    @cache
    def below(row: int, columns: frozenset[int]) -> float:
        if row == len(sizes):
            return 1.0
        return sum(sizes[row][c] * below(row + 1, columns - {c}) for c in columns if sizes[row][c])

    return below(0, frozenset(range(matrix.cols)))
