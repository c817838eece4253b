"""Comparison of a special point with the eigenvalues of the Jacobian at the point itself.

A defining system that is singular, or badly scaled, may converge beside the point, or to another
pair of eigenvalues.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fastslow.continuation.location import pair_with_sum_near_zero

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]

#: A test that vanishes at a point is below this fraction of its largest value at rows beside it.
FRACTION = 0.1

#: Error of a double eigenvalue, as a fraction of the largest one.
ERROR = 1e-6

#: Relative difference up to which two values of the product of a pair agree.
AGREEING_PRODUCTS = 1e-4


def without_zero(eigenvalues: Complex, around: Complex) -> str:
    """Return why a point is no fold or branch point, or an empty string.

    Parameters
    ----------
    eigenvalues : ndarray of complex
        Finite eigenvalues at the point.
    around : ndarray of complex, shape (k, n)
        Those at the rows around it.
    """
    if not len(eigenvalues) or not np.isfinite(eigenvalues).all():
        return ""
    least = float(np.abs(eigenvalues).min())
    beside = np.abs(around).min(axis=-1)
    error = ERROR * float(np.abs(eigenvalues).max())
    if least <= max(FRACTION * float(beside.max(initial=0.0)), error):
        return ""
    return f"none of its eigenvalues is zero, the least is {least:.3g} in modulus"


def own_pair(eigenvalues: Complex, solved: float, around: Array) -> tuple[float, str]:
    """Return the product of the pair at a Hopf point or neutral saddle, and what contradicts it.

    Parameters
    ----------
    eigenvalues : ndarray of complex
        Finite eigenvalues at the point.
    solved : float
        The product according to the defining system, or at a point nearby.
    around : ndarray, shape (k,)
        `pair_sums` at the rows around it.

    Returns
    -------
    float, str
        ``solved`` up to errors, otherwise the product of the eigenvalues; an empty string if
        their sum vanishes.
    """
    if not np.isfinite([*eigenvalues, solved]).all():
        return solved, ""
    one, other = (complex(eigenvalues[k]) for k in pair_with_sum_near_zero(eigenvalues, solved))
    size = max(abs(one) + abs(other), float(np.finfo(float).tiny))
    error = ERROR * float(np.abs(eigenvalues).max()) / size
    product = (one * other).real
    if abs(product - solved) <= max(AGREEING_PRODUCTS, error) * abs(product):
        product = solved
    beside = float(np.abs(around).max(initial=0.0))
    if abs(one + other) <= max(FRACTION * beside, error) * size:
        return product, ""
    return product, f"the sum of its eigenvalues {one:.4g} and {other:.4g} is not zero"
