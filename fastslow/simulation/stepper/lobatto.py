"""Lobatto points and the collocation matrices at them, for every degree."""

from __future__ import annotations

import numpy as np
from numpy.polynomial import legendre
from numpy.typing import NDArray

from fastslow.kernels.taylor.modes import COLLOCATION

Array = NDArray[np.float64]

#: Lowest and highest degree.
LOWEST, HIGHEST = 4, COLLOCATION


def lobatto_points(n: int) -> Array:
    """The n Lobatto points on [0, 1]: the ends and the extrema of a Legendre polynomial.

    Examples
    --------
    >>> lobatto_points(3)
    array([0. , 0.5, 1. ])
    """
    roots = np.sort(legendre.legroots(legendre.legder([0.0] * (n - 1) + [1.0])))
    inside = 0.5 + (roots - roots[::-1]) / 4.0
    return np.array([0.0, *inside, 1.0])


def _in_order(points: Array) -> Array:
    """Leja ordering of points, stable for divided differences; the first point stays first."""
    left, chosen = list(points[1:]), [points[0]]
    while left:
        chosen.append(max(left, key=lambda x: abs(np.prod([x - c for c in chosen]))))
        left.remove(chosen[-1])
    return np.array(chosen)


def _matrix(points: Array, at: Array, integrals: bool) -> Array:
    """Matrix of interpolated values at given places, or of integrals from 0 to them."""
    n = len(points)
    wanted = legendre.legvander(2.0 * at - 1.0, n)
    if integrals:
        # (2 k + 1) P_k is the derivative of P_{k+1} - P_{k-1}, which vanishes at the left end
        whole = (wanted[:, 2:] - wanted[:, :-2]) / (4.0 * np.arange(1, n) + 2.0)
        wanted = np.column_stack([at, whole])
    basis = legendre.legvander(2.0 * points - 1.0, n - 1)
    wanted = wanted[:, :n]
    return np.asarray(np.linalg.solve(basis.T, wanted.T).T)


def _tables() -> tuple[Array, ...]:
    """Points and matrices, one row of each array for every degree."""
    size, count = HIGHEST + 1, HIGHEST - LOWEST + 1
    points, finer = np.zeros((count, size)), np.zeros((count, size))
    to_points, to_finer, slopes, errors = (np.zeros((count, size, size)) for _ in range(4))
    between = np.zeros(count)
    for row, n in enumerate(range(LOWEST, HIGHEST + 1)):
        c, f = _in_order(lobatto_points(n)), _in_order(lobatto_points(n + 1))
        points[row, :n], finer[row, : n + 1] = c, f
        to_points[row, :n, :n] = _matrix(c, c, True)
        to_finer[row, : n + 1, :n] = _matrix(c, f, True)
        slopes[row, : n + 1, :n] = _matrix(c, f, False)
        errors[row, : n + 1, : n + 1] = _matrix(f, f, True)
        fine = np.linspace(0.0, 1.0, 2001)
        between[row] = fine[np.abs(np.prod(fine[:, None] - f, axis=1)).argmax()]
    return points, finer, to_points, to_finer, slopes, errors, between


#: Collocation points c_j and check points f_j in Leja order, one row for each degree from the
#: lowest; integrals from 0 to c and to f of the interpolants of rates at c, and their values at
#: f; integrals of the interpolants of values at f; and the place of their largest error.
C, F, TO_C, TO_F, AT_F, INTEGRALS, WORST = _tables()
