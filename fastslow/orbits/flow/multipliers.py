"""Floquet multipliers of a product of matrices that is never formed.

The product of the derivatives along an orbit under- or overflows, and loses the small multipliers
beside the large ones. QR sweeps over its factors A_1, …, A_m,

    A_i Q_{i-1} = Q_i R_i,    Q_0 of the next sweep = Q_m,

turn every factor into block triangular form, with one block for each cluster of multipliers of
similar modulus (Bojanczyk, Golub & Van Dooren 1992). The blocks of a cluster are multiplied with
a common scale, and their product is well conditioned.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from fastslow.kernels.saltations import saltation
from fastslow.orbits.flow.flows import Fields, Flows
from fastslow.orbits.flow.variations import Variations

Array = NDArray[np.float64]

#: Largest ratio of moduli within a cluster: as many digits are lost in the smallest of them.
CLUSTER_RATIO = 1000.0

#: Sine of the angle between the spaces before and after a sweep below which they are invariant.
INVARIANT = 1e-14

#: Largest number of sweeps; with 20 multipliers in a geometric sequence about 150 are needed.
SWEEPS = 400

#: Largest distance from 1 of the multiplier of perturbations along the orbit, from rates of which
#: a digit is left.
TRIVIAL_MULTIPLIER_ERROR = 0.1

#: Rows and columns are scaled by powers of 2 until their sums differ by less than this factor.
_BALANCED = 4.0


@dataclass(frozen=True, eq=False)
class Multipliers:
    """Multipliers of an orbit, by decreasing modulus.

    Parameters
    ----------
    values : ndarray of complex128, shape (n,)
        Zero where the modulus underflows. NaN, except where sliding makes them exactly 0, if they
        are not resolved: a saltation matrix is unbounded, or the multiplier along the orbit is not
        1 within `TRIVIAL_MULTIPLIER_ERROR`, as where a rate along the orbit is zero to rounding.
    logs : ndarray, shape (n,)
        Logarithms of the moduli; −inf for a multiplier that is exactly 0, NaN for an unknown one.
    trivial : int or None
        Index of the multiplier 1 of an autonomous model, None with forcing.
    defect : float
        Largest difference of a log determinant from Liouville's formula: of every segment, and
        of the orbit if it does not slide.
    events : mapping of int to ndarray, shape (n, n)
        Saltation matrices by the number of the segment that ends there.
    """

    values: NDArray[np.complex128]
    logs: Array
    trivial: int | None
    defect: float
    events: Mapping[int, Array] = field(default_factory=dict)

    @property
    def nontrivial(self) -> NDArray[np.complex128]:
        """All multipliers that decide on stability."""
        return self.values if self.trivial is None else np.delete(self.values, self.trivial)

    def largest_event(self, sizes: Array) -> tuple[float, int]:
        """The largest norm of a saltation matrix in units of the states, and its segment."""
        norms = {
            k: float(np.linalg.norm(matrix * sizes / sizes[:, None], 2))
            for k, matrix in self.events.items()
            if np.isfinite(matrix).all()
        }
        k = max(norms, key=norms.__getitem__, default=-1)
        return norms.get(k, 1.0), k

    @property
    def stable(self) -> bool:
        """Whether all of them are inside the unit circle."""
        inside = self.logs < 0
        if self.trivial is not None:
            inside = np.delete(inside, self.trivial)
        return bool(inside.all())


def orbit_multipliers(
    variations: Variations,
    modes: NDArray[np.int64],
    ends: NDArray[np.int64],
    flows: Flows,
    before: Fields,
    after: Fields,
    jumps: Array | None = None,
    *,
    autonomous: bool,
) -> Multipliers:
    """Multipliers of a periodic orbit of K segments.

    Parameters
    ----------
    variations : Variations
    modes : ndarray of int64, shape (K,)
    ends : ndarray of int64, shape (K,)
        Switching function that vanishes at the end of each segment, negative without one.
    flows : Flows
        Along the segments.
    before, after : Fields
        At the end of each segment, in its mode and in that of the next segment.
    jumps : ndarray, shape (K, n, n + 1 + P), optional
        Derivatives of the state after the reset at the end of each segment; the identity
        without one.
    autonomous : bool
        Whether the rate at the start is an eigenvector of the multiplier 1.
    """
    n, surfaces = variations.n, len(variations.jumping)
    zeros = int(variations.deficiency[modes].max(initial=0))
    events: dict[int, Array] = {}
    factors: list[Array] = []
    tangents = [after.f[-1]]
    expected = float(flows.traces.sum())
    sizes = np.log(np.abs(np.linalg.det(flows.factors)))
    errors = np.bincount(flows.owners, sizes, minlength=len(ends)) - flows.traces
    defect = float(np.abs(errors).max(initial=0.0))
    for k, end in enumerate(ends):
        along = flows.factors_of(k)
        factors += list(along)
        tangents += [np.full(n, np.nan)] * (len(along) - 1) + [before.f[k]] * (len(along) > 0)
        # at a bound of sliding, and across a continuous interface, both rates are equal
        crosses = 0 <= end < surfaces and variations.jumping[end]
        reset = None if jumps is None else jumps[k]
        resets = reset is not None and not np.array_equal(reset, np.eye(*reset.shape))
        if crosses or resets:
            matrix = saltation(before.f[k], after.f[k], before.g_u[k, end], reset)[:, :n]
            events[k] = matrix
            factors.append(matrix)
            tangents.append(after.f[k])
            normal, drift = before.g_u[k, end, :n], before.g_u[k, end, n]
            with np.errstate(divide="ignore", invalid="ignore"):
                ratio = (normal @ after.f[k] + drift) / (normal @ before.f[k] + drift)
                expected += float(np.log(abs(np.linalg.det(matrix) if resets else ratio)))
            if resets:
                zeros = max(zeros, rank_deficiency(matrix))
    held = variations.held_along(modes)
    if len(held):
        # no event takes a perturbation back to the interface on which the orbit slides
        normals = after.g_u[-1, held, :n]
        factors.append(np.eye(n) - np.linalg.pinv(normals) @ normals)
        tangents.append(after.f[-1])
    table = np.array(factors).reshape(-1, n, n)
    if not np.isfinite(table).all():
        # the saltation matrix of a contact is unbounded
        values, logs, first = _unresolved(n, zeros)
        return Multipliers(values, logs, first if autonomous else None, defect, events)
    values, logs, trivial = multipliers_of(table, zeros, np.array(tangents) if autonomous else None)
    if trivial is not None and not abs(values[trivial] - 1.0) <= TRIVIAL_MULTIPLIER_ERROR:
        values, logs, trivial = _unresolved(n, zeros)
    elif not zeros:
        defect = max(defect, abs(float(logs.sum()) - expected))
    return Multipliers(values, logs, trivial, defect, events)


def _unresolved(n: int, zeros: int) -> tuple[NDArray[np.complex128], Array, int]:
    """Multipliers, their logarithms and the trivial index, if only zeros by sliding are known."""
    logs = np.append(np.full(n - zeros, np.nan), np.full(zeros, -np.inf))
    return np.where(np.isnan(logs), np.nan, 0.0).astype(complex), logs, 0


def rank_deficiency(matrix: Array) -> int:
    """Number of singular values that are zero to rounding."""
    sizes = np.linalg.svd(matrix, compute_uv=False)
    return int((sizes <= len(sizes) * np.finfo(float).eps * sizes[0]).sum())


def multipliers_of_products(
    products: Array, scales: Array, liouville: Array, defects: Array
) -> list[Multipliers | None]:
    """Multipliers of orbits without sliding, from the products of their matrices.

    Parameters
    ----------
    products : ndarray, shape (N, n, n)
        Divided by exp(scales).
    scales : ndarray, shape (N,)
    liouville : ndarray, shape (N,)
        Logarithms of the determinants by Liouville's formula.
    defects : ndarray, shape (N,)
        Largest difference of a segment from it.

    Returns
    -------
    list of Multipliers or None
        None where the moduli differ so much that the factors are needed.
    """
    values = _eigenvalues(products)
    known = np.linalg.norm(products, axis=(1, 2)) <= CLUSTER_RATIO * np.abs(values).min(axis=1)
    values, logs = _with_logs(values, scales[:, None])
    order = _order(values, logs)
    values, logs = (
        np.take_along_axis(values, order, axis=1),
        np.take_along_axis(logs, order, axis=1),
    )
    errors = np.maximum(defects, np.abs(logs.sum(axis=1) - liouville)).tolist()
    return [
        Multipliers(values[k], logs[k], None, errors[k]) if known[k] else None
        for k in range(len(values))
    ]


def multipliers_of(
    factors: Array, zeros: int = 0, tangents: Array | None = None
) -> tuple[NDArray[np.complex128], Array, int | None]:
    """Eigenvalues of the product of matrices, by decreasing modulus.

    Parameters
    ----------
    factors : ndarray, shape (m, n, n)
        The first one acts first.
    zeros : int
        Rank deficiency of the product: that many eigenvalues are exactly 0.
    tangents : ndarray, shape (m + 1, n), optional
        A vector that every factor carries on to the next one, an eigenvector of the product; NaN
        except in the first row where it is not known. Its eigenvalue is separated from the
        others, so that a second one close to it is accurate. All eigenvalues are NaN if one of
        the vectors is zero.

    Returns
    -------
    values : ndarray of complex128, shape (n,)
    logs : ndarray, shape (n,)
        Logarithms of their moduli, −inf for zeros.
    trivial : int or None
        Index of the eigenvalue of the tangents.

    Examples
    --------
    >>> many = np.array([[[1e-3, 0], [1, 10]]] * 1000)
    >>> values, logs, _ = multipliers_of(many)
    >>> (logs / np.log(10)).round(9).tolist()
    [1000.0, -3000.0]
    """
    n = factors.shape[1]
    if not zeros and tangents is None:
        product, scale = _product(factors)
        values = _eigenvalues(product)
        if np.linalg.norm(product) <= CLUSTER_RATIO * np.abs(values).min():
            values, logs = _with_logs(values, scale)
            order = _order(values, logs)
            return values[order], logs[order], None
    units = _units(factors)
    factors = factors * units / units[:, None]
    values, logs = np.zeros(0, dtype=complex), np.zeros(0)
    own = None
    if tangents is not None:
        separated = _without(factors, tangents / units)
        if separated is None:
            unknown = np.full(n, np.nan)
            return unknown.astype(complex), unknown, 0
        factors, own = separated
    if factors.shape[1] > zeros:
        values, logs = _nonzero(factors, factors.shape[1] - zeros)
    values = np.append(values, np.zeros(zeros))
    logs = np.append(logs, np.full(zeros, -np.inf))
    if own is not None:
        values, logs = np.append(values, own), np.append(logs, np.log(abs(own)))
    order = _order(values, logs)
    trivial = None if own is None else int(np.flatnonzero(order == n - 1)[0])
    return values[order], logs[order], trivial


def _order(values: NDArray[np.complex128], logs: Array) -> NDArray[np.int64]:
    """Order by decreasing modulus, and of a pair the value with positive imaginary part first."""
    return np.lexsort((-values.imag, -logs.round(12)))


def _units(factors: Array) -> Array:
    """Units of the states in which rows and columns are of similar size."""
    n = factors.shape[1]
    total = np.abs(factors).max(axis=0, initial=0.0)
    np.fill_diagonal(total, 0.0)
    units = np.ones(n)
    for _ in range(20):
        changed = False
        for i in range(n):
            row, column = total[i].sum(), total[:, i].sum()
            if row > 0 and column > 0 and not 1 / _BALANCED < row / column < _BALANCED:
                unit = 2.0 ** np.round(np.log2(row / column) / 2)
                total[i] /= unit
                total[:, i] *= unit
                units[i] *= unit
                changed = True
        if not changed:
            break
    return units


def _without(factors: Array, tangents: Array) -> tuple[Array, float] | None:
    """Factors on the quotient by a vector that they carry along, and its multiplier.

    None if the vector vanishes.
    """
    if not tangents[0].any():
        return None
    directions, log, sign = [tangents[0] / np.linalg.norm(tangents[0])], 0.0, 1.0
    for factor, known in zip(factors, tangents[1:], strict=True):
        carried = factor @ directions[-1]
        given = known if np.isfinite(known).all() else carried
        if not carried.any() or not given.any():
            return None
        log += float(np.log(np.linalg.norm(carried)))
        directions.append(given / np.linalg.norm(given))
        sign *= np.sign(carried @ directions[-1])
    bases = _complements(np.array(directions))
    kept = bases[1:].transpose(0, 2, 1) @ factors @ bases[:-1]
    # in the basis of the start
    whole = np.concatenate([kept, (bases[0].T @ bases[-1])[None]])
    return whole, float(sign * np.exp(log))


def _complements(directions: Array) -> Array:
    """Orthonormal bases of the complements of unit vectors, from Householder reflections.

    Shapes (m, n) and (m, n, n - 1).
    """
    m, n = directions.shape
    largest, rows = np.abs(directions).argmax(axis=1), np.arange(m)
    mirrors = directions.copy()
    mirrors[rows, largest] += np.copysign(1.0, directions[rows, largest])
    outer = mirrors[:, :, None] * mirrors[:, None, :]
    whole = np.eye(n) - outer * (2.0 / (mirrors**2).sum(axis=1))[:, None, None]
    others = np.arange(n) != largest[:, None]
    return np.asarray(whole.transpose(0, 2, 1)[others].reshape(m, n - 1, n).transpose(0, 2, 1))


def _nonzero(factors: Array, d: int) -> tuple[NDArray[np.complex128], Array]:
    """The d largest eigenvalues of a product of factors."""
    n = factors.shape[1]
    if d == n:
        product, scale = _product(factors)
        values = _eigenvalues(product)
        if np.linalg.norm(product) <= CLUSTER_RATIO * np.abs(values).min():
            return _with_logs(values, scale)
    space = np.linalg.qr(np.random.default_rng(1).standard_normal((n, d)))[0]
    blocks: list[slice] = []
    for left in reversed(range(SWEEPS)):
        start, triangles = space, []
        for factor in factors:
            space, triangle = np.linalg.qr(factor @ space)
            triangles.append(triangle)
        turned = start.T @ space
        if left and np.abs(space - start @ turned).max() > INVARIANT * np.sqrt(n):
            # where a factor cancels, rounding errors may be larger until the last sweep
            continue
        sizes = np.abs(np.diagonal(triangles, axis1=1, axis2=2))
        with np.errstate(divide="ignore"):
            growth = np.log(sizes).sum(axis=0)
        lower = np.tril(np.abs(turned), -1)
        cuts = [j for j in range(1, d) if lower[j:, :j].max() <= INVARIANT * np.sqrt(n)]
        blocks = [slice(*pair) for pair in zip([0, *cuts], [*cuts, d], strict=True)]
        # a factor may be singular
        with np.errstate(invalid="ignore"):
            wide = any(np.ptp(growth[block]) > np.log(CLUSTER_RATIO) for block in blocks)
        if not wide:
            break
    parts = []
    for block in blocks:
        own = [triangle[block, block] for triangle in triangles]
        product, scale = _product(np.array([*own, turned[block, block]]))
        parts.append(_with_logs(_eigenvalues(product), scale))
    values, logs = (np.concatenate(both) for both in zip(*parts, strict=True))
    return values, logs


def _eigenvalues(matrix: Array) -> NDArray[np.complex128]:
    return np.linalg.eigvals(matrix).astype(complex)


def _with_logs(
    values: NDArray[np.complex128], scale: float | Array
) -> tuple[NDArray[np.complex128], Array]:
    """Eigenvalues and logarithms of their moduli, from scaled ones."""
    size = np.abs(values)
    with np.errstate(divide="ignore", over="ignore", invalid="ignore"):
        logs = np.log(size) + scale
        sizes, units = np.exp(logs), values / size
        # without the product of infinity and 0
        parts = [np.where(part == 0, 0.0, sizes * part) for part in (units.real, units.imag)]
    found = np.empty(values.shape, dtype=complex)
    found.real, found.imag = np.where(size == 0, 0.0, parts)
    return found, logs


def _product(factors: Array) -> tuple[Array, float]:
    """Product of factors divided by exp of the returned number."""
    product, scale = np.eye(factors.shape[1]), 0.0
    for factor in factors:
        product = factor @ product
        size = np.abs(product).max()
        if size > 0:
            product /= size
            scale += float(np.log(size))
    return product, scale
