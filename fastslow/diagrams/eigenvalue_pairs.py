"""Sums of two eigenvalues, which vanish at Hopf points and neutral saddles."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from fastslow.continuation.loops import blocks, loop, writeable

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]

#: Rounding of an eigenvalue computed by LAPACK, in units of n times the largest modulus.
ROUNDING = 4.0 * float(np.finfo(float).eps)


def pair_sums(eigenvalues: Complex, rounding: float = ROUNDING, alike: float = 0.0) -> Array:
    """Smallest relative sum of two eigenvalues, with the sign of the product of all sums.

    The product of λᵢ + λⱼ over i < j vanishes at Hopf points and neutral saddles
    (Guckenheimer, Myers & Sturmfels 1997), but underflows for many eigenvalues and is
    inaccurate for small ones among large ones. Its sign is determined by the real sums, those
    of complex pairs and of two real eigenvalues, and it vanishes if one of them does. Here each
    is divided by |λᵢ| + |λⱼ|. Sums that are zero to rounding, as for a conservative oscillator,
    are left out.

    Parameters
    ----------
    eigenvalues : ndarray of complex, shape (..., n)
    rounding : float
        Sums below n times this fraction of the largest modulus are left out. With 0 the
        test includes all sums and is smooth at its zeros, as Newton's method requires.
    alike : float
        Sums below this fraction of the moduli of their pair are left out.

    Returns
    -------
    ndarray, shape (...)
        From −1 to 1; 0 if no sum remains or an eigenvalue is not finite.

    Examples
    --------
    >>> pair_sums(np.array([[-0.5, 1.0, 1e6], [-2.0, 1.0, 1e6]])).round(6).tolist()
    [0.333333, -0.333333]
    >>> float(pair_sums(np.array([3.0 + 4.0j, 3.0 - 4.0j])))
    0.6
    >>> float(pair_sums(np.array([1e-9 + 1.0j, 1e-9 - 1.0j, -1e9]), rounding=0.0))
    1e-09
    """
    values = np.asarray(eigenvalues, dtype=complex)
    n = values.shape[-1]
    if n < 2:
        return np.zeros(values.shape[:-1])
    rows = writeable(np.ascontiguousarray(values).reshape(-1, n))
    sums = np.empty(len(rows))
    for s in blocks(len(rows), 8 * n * n):
        loop("eigenvalue_pair_sums")(rows[s], rounding, alike, np.empty(n), sums[s])
    return sums.reshape(values.shape[:-1])


@lru_cache(maxsize=64)
def _pairs(n: int) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Indices of all pairs of n eigenvalues."""
    return np.triu_indices(n, 1)


def product_of_pair(eigenvalues: Complex, rounding: float = ROUNDING, alike: float = 0.0) -> float:
    """Product of the two eigenvalues that determine `pair_sums`, positive for a complex pair.

    NaN if no sum remains.

    Examples
    --------
    >>> product_of_pair(np.array([-0.1 + 2.0j, -0.1 - 2.0j, -1.0, 5.0])).__round__(12)
    4.01
    """
    values = np.asarray(eigenvalues, dtype=complex)
    if not np.all(np.isfinite(values)) or len(values) < 2:
        return np.nan
    first, second = _pairs(len(values))
    sums = values[first] + values[second]
    noise = rounding * len(values) * np.abs(values).max()
    size = np.maximum(np.abs(values[first]) + np.abs(values[second]), np.finfo(float).tiny)
    kept = (sums.imag == 0) & (np.abs(sums.real) >= np.maximum(noise, alike * size))
    if not kept.any():
        return np.nan
    first, second, sums, size = first[kept], second[kept], sums[kept], size[kept]
    k = int(np.argmin(np.abs(sums) / size))
    return float((values[first[k]] * values[second[k]]).real)


def vanishing_count(eigenvalues: Complex, within: float) -> int:
    """Return the number of pairs of eigenvalues whose sum is a small fraction of their moduli.

    Examples
    --------
    >>> vanishing_count(np.array([1.0j, -1.0j, -2.0, 2.0 + 1e-7]), 1e-5)
    2
    """
    values = np.asarray(eigenvalues)
    first, second = _pairs(len(values))
    size = np.abs(values[first]) + np.abs(values[second])
    return int(np.count_nonzero(np.abs(values[first] + values[second]) <= within * size))
