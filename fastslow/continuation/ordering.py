"""Ordering of points."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

#: Relative difference of components, by size or unit, below which they are equal.
EQUAL_COMPONENTS = 1e-8


def in_order(points: ArrayLike, unit: ArrayLike) -> NDArray[np.intp]:
    """Indices that sort points by their components, first to last.

    Components that differ by rounding count as equal, so that the order does not depend
    on the units.

    Parameters
    ----------
    points : array_like, shape (m, n)
    unit : array_like, shape (n,)
        Unit of every component, for values that are zero up to rounding.

    Returns
    -------
    ndarray of int, shape (m,)

    Examples
    --------
    >>> in_order([[1.0, 2.0], [1.0 + 1e-15, 1.0], [0.0, 3.0]], 1.0).tolist()
    [2, 1, 0]
    """
    table = np.asarray(points, dtype=float)
    if table.size == 0 or len(table) == 1:
        return np.arange(len(table))
    least = np.broadcast_to(np.asarray(unit, dtype=float), table.shape[1:])
    ranks = np.empty(table.shape, dtype=np.intp)
    for k, column in enumerate(table.T):
        order = np.argsort(column, kind="stable")
        low, high = column[order[:-1]], column[order[1:]]
        size = np.maximum(np.maximum(np.abs(low), np.abs(high)), least[k])
        ranks[order, k] = np.append(0, np.cumsum(high - low > EQUAL_COMPONENTS * size))
    # ties in all components are broken by the values themselves
    return np.lexsort((*table.T[::-1], *ranks.T[::-1]))
