"""Bounds of the eigenvalues of matrices along curves, by Gershgorin's discs.

Everything is computed to nearest for many matrices at once, with bounds of the rounding errors
that do not depend on the order of summation (Higham 2002, section 3.5).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

Array = NDArray[np.float64]
Whole = NDArray[np.int64]

#: Relative error of sums of up to `PRODUCTS_SUMMED` products, each of some factors, and a bound of
#: underflow of products with units of at least `LEAST_UNIT`, and at most its inverse.
PRODUCT_ROUNDING, PRODUCT_UNDERFLOW = 1e-13, 1e-290
PRODUCTS_SUMMED, LEAST_UNIT = 100, 1e-30

#: Condition of eigenvectors, in units of the unknowns, from which on Schur's form is tried.
SCHUR_CONDITION = 30.0

#: Largest rotation of eigenvectors over an arc that is followed.
EIGENVECTOR_ROTATION = 0.2

#: Share of the distance of eigenvalues from the imaginary axis that is left to the elements above
#: the diagonal of Schur's form, and smallest scale of its vectors.
SCHUR_SHARE, SCHUR_SCALE = 0.25, 1e-10


@dataclass(frozen=True, eq=False)
class Balls:
    """Matrices with bounds of their distances from the middle, elements separately."""

    middle: NDArray[Any]
    radius: Array

    def rows(self, rows: Any) -> Balls:
        """Return some of the matrices."""
        return Balls(self.middle[rows], self.radius[rows])

    @property
    def size(self) -> Array:
        """Upper bounds of the moduli."""
        return (np.abs(self.middle) + self.radius) * (1.0 + PRODUCT_ROUNDING)


@dataclass(frozen=True, eq=False)
class Spectra:
    """What is proved of the eigenvalues of matrices on pieces of curves.

    Parameters
    ----------
    unstable : ndarray of int, shape (m,)
        Number of eigenvalues with positive real part, if none is on the imaginary axis; else −1.
    kind : ndarray of int, shape (m,)
        Where that is not decided: 1 if at most one simple real eigenvalue meets the axis, 2 if at
        most one simple pair of imaginary ones does, and its real part is strictly monotone along
        the piece; else 0.
    sign : ndarray of int, shape (m,)
        Sign of the derivative of this real part by the free unknown.
    """

    unstable: Whole
    kind: Whole
    sign: Whole

    def replaced(self, rows: Whole, other: Spectra) -> Spectra:
        """Return the spectra with other ones in some rows."""
        unstable, kind, sign = self.unstable.copy(), self.kind.copy(), self.sign.copy()
        unstable[rows], kind[rows], sign[rows] = other.unstable, other.kind, other.sign
        return Spectra(unstable, kind, sign)


def balls_of(low: Array, high: Array) -> Balls:
    """Return balls that contain intervals."""
    middle = 0.5 * low + 0.5 * high
    radius = np.maximum(high - middle, middle - low)
    return Balls(middle, radius * (1.0 + PRODUCT_ROUNDING) + PRODUCT_UNDERFLOW)


def spectra_of(centre: Balls, slope: Balls, reach: Array, unit: Array) -> Spectra:
    """Bound the eigenvalues of matrices J(s) with |s − s₀| ≤ reach.

    With eigenvectors T of the middle of J(s₀) and S near T⁻¹, C = T⁻¹ J T is S J T up to
    ‖I − S T‖, and C(s) is in C(s₀) + C' [−reach, reach]. Its eigenvalues are in Gershgorin's
    discs. Where eigenvectors are nearly parallel, T is from Schur's form. Nothing is decided for
    matrices and units to which the bounds of rounding do not apply.

    Parameters
    ----------
    centre, slope : Balls, shape (m, n, n)
        J(s₀), and J' for all s.
    reach : ndarray, shape (m,)
    unit : ndarray, shape (n,)
        Units of the states.
    """
    if len(unit) > PRODUCTS_SUMMED or not np.all((unit >= LEAST_UNIT) & (unit <= 1.0 / LEAST_UNIT)):
        open_ = np.full(len(reach), -1)
        return Spectra(open_, np.zeros_like(open_), np.zeros_like(open_))
    basis, inverse, condition = _eigenvectors(centre.middle, unit)
    found = _bounded(centre, slope, reach, basis, inverse)
    again = np.flatnonzero(
        (found.unstable < 0) & (found.kind == 0) & ~(condition < SCHUR_CONDITION)
    )
    if not len(again):
        return found
    pairs = [_schur_vectors(matrix, unit) for matrix in centre.middle[again]]
    basis, inverse = (np.array(p) for p in zip(*pairs, strict=True))
    other = _bounded(centre.rows(again), slope.rows(again), reach[again], basis, inverse)
    return found.replaced(again, other)


def _eigenvectors(matrices: Array, unit: Array) -> tuple[NDArray[Any], NDArray[Any], Array]:
    """Approximate eigenvectors, their inverses and conditions in units of the states."""
    _, vectors = np.linalg.eig(matrices * unit / unit[:, None])
    try:
        inverse = np.linalg.inv(vectors)
    except np.linalg.LinAlgError:
        inverse = np.linalg.pinv(vectors)
    condition = np.linalg.norm(vectors, axis=(1, 2)) * np.linalg.norm(inverse, axis=(1, 2))
    return vectors * unit[:, None], inverse / unit, condition


def _schur_vectors(matrix: Array, unit: Array) -> tuple[NDArray[Any], NDArray[Any]]:
    """Vectors in which a matrix is nearly triangular with small elements above the diagonal."""
    form, vectors = scipy.linalg.schur(matrix * unit / unit[:, None], output="complex")
    n = len(matrix)
    scale = np.ones(n)
    room = SCHUR_SHARE / n * np.abs(form.diagonal().real)
    for j in range(1, n):
        above = np.abs(form[:j, j]) + PRODUCT_UNDERFLOW
        scale[j] = max(min(scale[j - 1], float((scale[:j] * room[:j] / above).min())), SCHUR_SCALE)
    return vectors * scale * unit[:, None], vectors.conj().T / scale[:, None] / unit


def transformed(matrices: Balls, basis: NDArray[Any], inverse: NDArray[Any]) -> Balls:
    """Enclose T⁻¹ J T, infinite where S T is not near the identity."""
    left, right = np.abs(inverse), np.abs(basis)
    error = left @ right * PRODUCT_ROUNDING + np.abs(inverse @ basis - np.eye(basis.shape[-1]))
    norm = error.sum(axis=-1).max(axis=-1) * (1.0 + PRODUCT_ROUNDING) + PRODUCT_UNDERFLOW
    more = np.where(norm < 0.5, norm / (1.0 - norm), np.inf)[:, None, None]
    middle = inverse @ (matrices.middle @ basis)
    radius = left @ ((matrices.radius + 3.0 * PRODUCT_ROUNDING * np.abs(matrices.middle)) @ right)
    found = Balls(middle, radius * (1.0 + PRODUCT_ROUNDING) + PRODUCT_UNDERFLOW)
    radius = found.radius + more * found.size.max(axis=-2, keepdims=True) * (1.0 + PRODUCT_ROUNDING)
    return Balls(middle, radius * (1.0 + PRODUCT_ROUNDING))


def _bounded(
    centre: Balls, slope: Balls, reach: Array, basis: NDArray[Any], inverse: NDArray[Any]
) -> Spectra:
    """Bound the eigenvalues in given coordinates."""
    with np.errstate(all="ignore"):
        here = transformed(centre, basis, inverse)
        along = transformed(slope, basis, inverse)
        moved = reach[:, None, None] * along.size
        matrix = Balls(
            here.middle, (here.radius + moved) * (1.0 + PRODUCT_ROUNDING) + PRODUCT_UNDERFLOW
        )
        discs = _Discs.of(matrix)
        right = discs.centre.real - discs.radius > 0.0
        left = discs.centre.real + discs.radius < 0.0
        axis = ~(right | left)
        count, kinds = right.sum(axis=1), axis.sum(axis=1)
        unstable = np.where(kinds == 0, count, _moving_with(here, along, reach))
        sign = np.zeros(len(count), dtype=np.int64)
        for kind in (1, 2):
            rows = np.flatnonzero(kinds == kind)
            if len(rows):
                places = np.nonzero(axis[rows])[1].reshape(-1, kind)
                sign[rows] = discs.rows(rows).crossing(matrix.rows(rows), along.rows(rows), places)
    sign = np.where(unstable < 0, sign, 0)
    return Spectra(unstable, np.where(sign != 0, kinds, 0), sign)


def _moving_with(here: Balls, along: Balls, reach: Array) -> Whole:
    """Numbers of eigenvalues with positive real part by discs that move along the curve, or −1.

    With D the diagonal of C(s₀), Δ that of C' and X_ij = C'_ij/(d_j − d_i), the matrix
    (1 + σX)⁻¹ C(s₀ + σ) (1 + σX) is D + σΔ up to (1 + σX)⁻¹ [σ² (C'X − XΔ) + E (1 + σX)] with the
    errors E of C(s₀) and σC'. Real parts change by σ Re Δ, and by the square of σ: for a weakly
    damped oscillation much less than the frequency. X is zero where its denominator is small.
    """
    n = here.middle.shape[-1]
    other, step = ~np.eye(n, dtype=bool), reach[:, None, None]
    centre = np.diagonal(here.middle, axis1=1, axis2=2)
    slope = np.diagonal(along.middle, axis1=1, axis2=2)
    gap = centre[:, None, :] - centre[:, :, None]
    change = np.abs(along.middle)
    small = other & (step * change < EIGENVECTOR_ROTATION * np.abs(gap))
    turn = np.where(small, along.middle / np.where(small, gap, 1.0), 0.0)
    size = np.abs(turn)
    kept = np.where(other & ~small, change, 0.0)
    terms = change + (np.abs(centre)[:, :, None] + np.abs(centre)[:, None, :]) * size
    error = step * (along.radius + kept + 4.0 * PRODUCT_ROUNDING * terms)
    error += here.radius + np.where(other, np.abs(here.middle), 0.0)
    second = np.abs(along.middle @ turn - turn * slope[:, None, :])
    second += 4.0 * PRODUCT_ROUNDING * (change @ size + size * np.abs(slope)[:, None, :])
    rest = step**2 * second + error + step * (error @ size)
    norm = (reach * size.sum(axis=2).max(axis=1) * (1.0 + PRODUCT_ROUNDING))[:, None, None]
    more = np.where(norm < 0.5, norm / (1.0 - norm), np.inf)
    rest = (rest + more * rest.max(axis=1, keepdims=True)).sum(axis=2)
    away = (rest + reach[:, None] * np.abs(slope.real)) * (
        1.0 + 20.0 * PRODUCT_ROUNDING
    ) + PRODUCT_UNDERFLOW
    right, left = centre.real > away, centre.real < -away
    return np.where((right | left).all(axis=1), right.sum(axis=1), -1)


@dataclass(frozen=True, eq=False)
class _Discs:
    """Gershgorin's discs of matrices: centres and radii, shapes (m, n)."""

    centre: NDArray[Any]
    radius: Array

    @classmethod
    def of(cls, matrix: Balls) -> _Discs:
        centre = np.diagonal(matrix.middle, axis1=1, axis2=2)
        own = np.diagonal(matrix.size, axis1=1, axis2=2)
        radius = np.diagonal(matrix.radius, axis1=1, axis2=2)
        others = np.maximum(matrix.size.sum(axis=2) - own, 0.0)
        # the sum without the diagonal element, whose rounding is relative to all of them
        rest = others + PRODUCT_ROUNDING * matrix.size.sum(axis=2)
        return cls(centre, (rest + radius) * (1.0 + PRODUCT_ROUNDING) + PRODUCT_UNDERFLOW)

    def rows(self, rows: Any) -> _Discs:
        return _Discs(self.centre[rows], self.radius[rows])

    def crossing(self, matrix: Balls, slope: Balls, places: Whole) -> Whole:
        """Signs of the derivatives of the real parts of isolated real eigenvalues or pairs.

        An eigenvalue in an isolated disc is simple. With C = [[c, l], [r, D]] in the order of the
        discs its eigenvectors are (1, y), y = (λ − D)⁻¹ r and (1, z), z = l (λ − D)⁻¹, and its
        derivative is (1, z) C' (1, y)/(1 + z y). Bounds of y and z are from the dominant diagonal
        of λ − D.

        Parameters
        ----------
        places : ndarray of int, shape (m, 1) or (m, 2)
            The discs that meet the imaginary axis.
        """
        m, n = self.centre.shape
        each = np.arange(m)
        first, last = places[:, 0], places[:, -1]
        gap = np.full((m, n), np.inf)
        for place, partner in ((first, last), (last, first)):
            at, radius = self.centre[each, place, None], self.radius[each, place, None]
            apart = np.abs(self.centre - at) * (1.0 - PRODUCT_ROUNDING) - radius - self.radius
            mirrored = (
                np.abs(self.centre - at.conj()) * (1.0 - PRODUCT_ROUNDING) - radius - self.radius
            )
            apart[each, place] = mirrored[each, partner] = np.inf
            gap = np.minimum(gap, np.minimum(apart, mirrored))
        isolated = gap.min(axis=1) > 0.0
        others = np.ones((m, n), dtype=bool)
        others[each, first] = False
        beside, below = matrix.size[each, first], matrix.size[each, :, first]
        inverse = 1.0 / gap.min(axis=1)
        y = inverse * np.where(others, below, 0.0).max(axis=1)
        z = inverse * np.where(others, beside, 0.0).sum(axis=1)
        row, column = slope.size[each, first], slope.size[each, :, first]
        inner = np.where(others[:, :, None] & others[:, None, :], slope.size, 0.0)
        error = y * np.where(others, row, 0.0).sum(axis=1)
        error += z * np.where(others, column, 0.0).max(axis=1)
        error += y * z * inner.sum(axis=2).max(axis=1)
        error = error * (1.0 + PRODUCT_ROUNDING) + slope.radius[each, first, first]
        small = y * z * (1.0 + PRODUCT_ROUNDING)
        whole = slope.size[each, first, first] + error
        error = (error + np.where(small < 0.5, whole * small / (1.0 - small), np.inf)) * (
            1.0 + 10.0 * PRODUCT_ROUNDING
        )
        middle = slope.middle[each, first, first].real
        decided = isolated & (np.abs(middle) > error)
        return np.where(decided, np.sign(middle), 0.0).astype(np.int64)
