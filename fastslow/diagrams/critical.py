"""Parameter values at which the number of equilibria of a region can change."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import sympy as sp

from fastslow.diagrams.equations import RegionEquations, real_roots
from fastslow.model.structure import real

#: Degree in the unknown up to which discriminants and resultants are formed.
DEGREE = 8


def critical_values(
    equations: RegionEquations, lower: float, upper: float, edges: Sequence[sp.Expr] = ()
) -> list[float] | None:
    """Values between which a region's admissible equilibria move without meeting or leaving.

    These are the real roots in the parameter of the discriminant and leading
    coefficient of the eliminated polynomial and of its resultant with every
    interface function (for sliding also with both drifts, which vanish at
    boundary equilibria and two-folds). A start in every interval between them is therefore a
    start on every branch.

    Parameters
    ----------
    equations : RegionEquations
    lower, upper : float
        Range of the parameter.
    edges : sequence of Expr
        Further functions of the states at whose zeros a start is wanted on both sides.

    Returns
    -------
    list of float or None
        None where the region's equations are no polynomial of moderate degree
        in unknown and parameter, so that nothing is proved.
    """
    conditions = _conditions(equations, edges)
    if conditions is None:
        return None
    p = real(equations.field.parameter)
    values: set[float] = set()
    for condition in conditions:
        polynomial = sp.Poly(condition, p)
        if polynomial.is_zero:
            return None
        size = max(abs(c) for c in polynomial.all_coeffs())
        coefficients = np.array([float(c / size) for c in polynomial.all_coeffs()])
        values |= {v for v in real_roots(coefficients) if lower < v < upper}
    return sorted(values)


def _conditions(equations: RegionEquations, more: Sequence[sp.Expr]) -> list[sp.Expr] | None:
    """Polynomials in the parameter whose roots are the critical values."""
    left = equations.elimination
    p = real(equations.field.parameter)
    if equations.impossible:
        return []
    if left.divisors or len(left.unknowns) > 1:
        return None
    alone = [e for e in left.remaining if not e.has(*left.unknowns)] if left.unknowns else []
    alone = list(left.remaining) if not left.unknowns else alone
    if not all(e.is_polynomial(p) for e in alone):
        return None
    if len(alone) == len(left.remaining) and (alone or left.unknowns):
        return alone
    edges = _edges(equations, more)
    if edges is None or not left.unknowns:
        return edges
    (x,) = left.unknowns
    equation = left.remaining[0]
    if not equation.is_polynomial(x, p) or sp.degree(equation, x) > DEGREE:
        return None
    polynomial = sp.Poly(equation, x)
    found = [polynomial.LC()]
    if polynomial.degree() > 1:
        found.append(sp.discriminant(equation, x))
    for edge in edges:
        found.append(sp.resultant(equation, edge, x) if edge.has(x) else edge)
    return [sp.expand(f) for f in found]


def _edges(equations: RegionEquations, more: Sequence[sp.Expr]) -> list[sp.Expr] | None:
    """What bounds the region, along its equilibria; None unless polynomial in both."""
    left = equations.elimination
    p = real(equations.field.parameter)
    solved = {real(n): e for n, e in left.solved.items()}
    edges = []
    for bound in (*equations.bounds, *more):
        h = bound.subs(solved)
        if not h.is_polynomial(p, *left.unknowns):
            return None
        edges.append(sp.expand(h))
    return edges
