"""Sums of two eigenvalues, which vanish at Hopf points and neutral saddles."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fastslow.continuation.loops import loop, writeable

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
    if n == 2 and alike == 0.0:
        pairs = writeable(np.ascontiguousarray(values).reshape(-1, 2))
        sums = np.empty(len(pairs))
        loop("eigenvalue_pair_sums")(pairs, rounding, sums)
        return sums.reshape(values.shape[:-1])
    finite = np.isfinite(values).all(axis=-1)
    values = np.where(finite[..., None], values, 1.0)
    modulus = np.abs(values)
    noise = rounding * n * modulus.max(axis=-1, keepdims=True)

    # complex pairs, represented by the eigenvalue with positive imaginary part
    pair = (values.imag > 0) & (np.abs(values.real) >= np.maximum(noise, alike * modulus))
    relative = np.where(pair, np.abs(values.real) / np.where(pair, modulus, 1.0), 1.0)
    negative = (pair & (values.real < 0)).sum(axis=-1)

    # two real eigenvalues: in order of modulus the sum has the sign of the second
    size = np.where(values.imag == 0, modulus, np.inf)
    order = np.argsort(size, axis=-1, kind="stable")
    size = np.take_along_axis(size, order, axis=-1)
    below = np.take_along_axis(values.real < 0, order, axis=-1)
    real = np.isfinite(size)
    negative = negative + np.where(real & below, np.arange(n), 0).sum(axis=-1)
    # the smallest relative sum is one of neighbours of opposite signs
    one, other = np.where(real, size, 0.0)[..., :-1], np.where(real, size, 0.0)[..., 1:]
    both = real[..., 1:]
    opposite = both & (below[..., 1:] != below[..., :-1])
    least_gap = np.maximum(noise, alike * (one + other))
    left_out = (opposite & (other - one < least_gap)) | (both & (other < noise))
    negative = negative - (left_out & below[..., 1:]).sum(axis=-1)
    opposite &= ~left_out
    apart = np.where(opposite, (other - one) / np.where(opposite, other + one, 1.0), 1.0)

    least = np.minimum(relative.min(axis=-1), apart.min(axis=-1))
    count = real.sum(axis=-1)
    known = pair.sum(axis=-1) + count * (count - 1) // 2 - left_out.sum(axis=-1) > 0
    return np.where(known & finite, np.where(negative % 2 == 1, -least, least), 0.0)


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
    first, second = np.triu_indices(len(values), 1)
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
    first, second = np.triu_indices(len(values), 1)
    size = np.abs(values[first]) + np.abs(values[second])
    return int(np.count_nonzero(np.abs(values[first] + values[second]) <= within * size))
