"""Special points of a curve F(u) = 0, u = (states, parameter), by extended systems.

Each is a regular square system at a generic point (Kuznetsov 2004, chapter 10).
The Jacobian of F is analytic; second derivatives in the extended systems are
difference quotients along one or two directions, which slows down Newton's method
slightly but does not affect the accuracy of the solution.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: F and its Jacobian, shapes (n,) and (n, n + 1), at u.
Curve = Callable[[Array], tuple[Array, Array]]


#: Number of unknowns beyond which elimination, about thirty times as fast, replaces the singular
#: value decomposition.
LARGE = 60

#: Components below this fraction of the scale are remainders of Newton's method at a zero
#: solution, since each step only reduces them by a factor.
FLUSH_THRESHOLD = 1e-20

#: Rounding of a residual, in units of the sum of the moduli of its terms.
RESIDUAL_ROUNDING = 2.3e-16

#: Relative change of the unknowns by which the rounding of an expression is measured.
JITTER = 2.0**-51

#: Multiple of a measured rounding up to which a value is zero to rounding: the largest of a few
#: changes is below the bound of all of them, and constants of a model are rounded as well.
ROUNDINGS = 20.0

#: Offset from a point, as a fraction of the scale, at which the slopes of a rate are evaluated as
#: well, for their size where they vanish.
SLOPE_OFFSET = 0.1

#: Relative distance of a vector from the multiples of another one, below which both are parallel.
PARALLEL = 1e-4


@dataclass(frozen=True)
class Located:
    """A solved extended system.

    Parameters
    ----------
    u : ndarray, shape (n + 1,)
    residual : float
        Largest component of the residual of the extended system.
    converged : bool
    extra : ndarray
        The remaining unknowns (null vectors and the like).
    correction : float
        Size of Newton's last correction, in units of the scale.
    """

    u: Array
    residual: float
    converged: bool
    extra: Array
    correction: float = 0.0


@np.errstate(all="ignore")
def newton(
    equations: Callable[[Array], Array],
    start: Array,
    scale: Array,
    slopes: Callable[[Array], Array] | None = None,
    *,
    iterations: int = 30,
) -> tuple[Array, float, bool, float]:
    """Newton's method until the correction reaches rounding.

    Parameters
    ----------
    equations : callable
    start, scale : ndarray
    slopes : callable, optional
        Derivative of the equations; by default by difference quotients.

    Returns
    -------
    solution, residual, converged, size of the last correction
    """
    z = start.copy()
    value = equations(z)
    size, least = np.inf, np.inf
    for _ in range(iterations):
        if not np.all(np.isfinite(value)):
            return z, float("inf"), False, float("inf")
        matrix = differenced(equations, z, scale, len(z)) if slopes is None else slopes(z)
        if not np.all(np.isfinite(matrix)):
            return z, float("inf"), False, float("inf")
        correction = _solved(matrix * scale, -value)
        z = z + correction * scale
        value = equations(z)
        size = float(np.abs(correction).max())
        if size < 1e-15 or (size < 1e-9 and size >= 0.5 * least):
            break
        least = size
    flushed = flush_to_zero(z, scale)
    value, known = equations(flushed), value
    if grown(value, known, np.abs(matrix) @ np.abs(z)):
        value = known
    else:
        z = flushed
    residual = float(np.abs(value).max()) if np.all(np.isfinite(value)) else float("inf")
    return z, residual, bool(size < 1e-8 and _balanced(value, matrix, z, scale)), size


def _balanced(value: Array, slopes: Array, u: Array, scale: Array) -> bool:
    """Check whether the residual is rounding, relative to the terms of each equation."""
    terms = np.abs(slopes) @ np.maximum(np.abs(u), scale)
    return bool(np.all(np.abs(value) <= 1e-9 * terms + 1e-300))


def flush_to_zero(u: Array, scale: Array) -> Array:
    """Set components far below rounding of the scale to zero.

    The scale may be wrong: `grown` checks that the residual permits it.

    Examples
    --------
    >>> flush_to_zero(np.array([1.0, -3e-38]), np.ones(2)).tolist()
    [1.0, 0.0]
    """
    return np.where(np.abs(u) < FLUSH_THRESHOLD * scale, 0.0, u)


def grown(after: Array, before: Array, terms: Array) -> bool:
    """Check whether a residual has grown by more than rounding of its terms, or is NaN.

    Examples
    --------
    >>> one = np.ones(2)
    >>> grown(np.array([0.0, -1e-9]), 0 * one, one), grown(1e-30 * one, 0 * one, one)
    (True, False)
    """
    allowed = np.abs(before) + RESIDUAL_ROUNDING * terms
    return bool(np.any(~(np.abs(after) <= allowed)))


def _solved(matrix: Array, right: Array) -> Array:
    """Least-norm solution of the equations, each normalised to size one.

    Large systems are solved by elimination unless they are singular.
    """
    size = np.abs(matrix).max(axis=1)
    size[size == 0] = 1.0
    if len(matrix) > LARGE:
        try:
            found = np.linalg.solve(matrix / size[:, None], right / size)
        except np.linalg.LinAlgError:
            found = np.full(len(right), np.inf)
        if np.abs(found).max() < np.inf:
            return np.asarray(found)
    return np.asarray(np.linalg.lstsq(matrix / size[:, None], right / size, rcond=1e-14)[0])


def differenced(
    function: Callable[[Array], Array | float], z: Array, scale: Array, count: int
) -> Array:
    """Derivative of a function with respect to the first unknowns, by central differences."""
    columns = []
    for k in range(count):
        step = np.zeros_like(z)
        step[k] = 6e-6 * max(abs(z[k]), scale[k])
        columns.append((function(z + step) - function(z - step)) / (2.0 * step[k]))
    return np.array(columns).T


@np.errstate(all="ignore")
def with_condition(
    curve: Curve,
    condition: Callable[[Array], tuple[float, Array]],
    start: Array,
    scale: Array,
    iterations: int = 40,
) -> Located:
    """Locate the point of the curve at which a function with a known gradient vanishes.

    Parameters
    ----------
    condition : callable
        Maps u to its value and gradient, shape (n + 1,).
    """
    u = start.copy()
    size, least = np.inf, np.inf
    for _ in range(iterations):
        value, slopes = curve(u)
        extra, gradient = condition(u)
        right = np.append(value, extra)
        matrix = np.vstack([slopes, gradient]) * scale
        if not (np.all(np.isfinite(right)) and np.all(np.isfinite(matrix))):
            return Located(u, float("inf"), False, np.empty(0), float("inf"))
        correction = _solved(matrix, -right)
        u = u + correction * scale
        size = float(np.abs(correction).max())
        if size < 1e-16 or (size < 1e-10 and size >= 0.5 * least):
            break
        least = size
    right = np.append(curve(u)[0], condition(u)[0])
    flushed = flush_to_zero(u, scale)
    known, right = right, np.append(curve(flushed)[0], condition(flushed)[0])
    if grown(right, known, np.abs(matrix / scale) @ np.abs(u)):
        right = known
    else:
        u = flushed
    converged = bool(size < 1e-8 and _balanced(right, matrix / scale, u, scale))
    return Located(u, float(np.abs(right).max()), converged, np.empty(0), size)


def _bending(curve: Curve, u: Array, along: Array, scale: Array) -> Array:
    """Derivative of F_x v with respect to u, shape (n, n + 1), for a direction v of the states."""
    n = len(along)
    length = float(np.abs(along / scale[:n]).max())
    if length == 0.0:
        return np.zeros((n, n + 1))
    step = 6e-6 / length
    move = np.append(along, 0.0) * step
    return np.asarray((curve(u + move)[1] - curve(u - move)[1]) / (2.0 * step))


def fold(curve: Curve, start: Array, scale: Array) -> Located:
    """Locate a fold (saddle-node): F = 0, F_x q = 0, |q| = 1; ``extra`` is the null vector q."""
    n = len(start) - 1
    units = scale[:n]
    _, _, right = np.linalg.svd(curve(start)[1][:, :n] * units)
    guide = right[-1]

    def equations(z: Array) -> Array:
        value, slopes = curve(z[: n + 1])
        q = z[n + 1 :]
        return np.concatenate([value, slopes[:, :n] @ (units * q), [guide @ q - 1.0]])

    def derivative(z: Array) -> Array:
        u, q = z[: n + 1], z[n + 1 :]
        matrix = np.zeros((2 * n + 1, 2 * n + 1))
        _, matrix[:n, : n + 1] = curve(u)
        matrix[n : 2 * n, : n + 1] = _bending(curve, u, units * q, scale)
        matrix[n : 2 * n, n + 1 :] = matrix[:n, :n] * units
        matrix[2 * n, n + 1 :] = guide
        return matrix

    z, residual, converged, size = newton(
        equations, np.append(start, guide), np.append(scale, np.ones(n)), derivative
    )
    return Located(z[: n + 1], residual, converged, units * z[n + 1 :], size)


def hopf_or_neutral_saddle(curve: Curve, start: Array, scale: Array, squared: float) -> Located:
    """Locate two eigenvalues of opposite sign.

    The system is F = 0, J a = σb, J b = −(κ/σ) a, |a| = 1, ⟨l, a⟩ = 0.

    κ = ω² > 0 is a Hopf point, κ < 0 a neutral saddle; ``extra`` is (κ,). The two
    first-order equations, in place of (J² + κ) a = 0, resolve slow pairs beside fast
    eigenvalues, whose squares would dominate. The constant σ is of the size of κ^½.

    Parameters
    ----------
    squared : float
        Approximate product of the two eigenvalues, by which the pair is selected.
    """
    n = len(start) - 1
    units = scale[:n]

    def jacobian(u: Array) -> tuple[Array, Array]:
        value, slopes = curve(u)
        return value, slopes[:, :n] * units / units[:, None]

    _, matrix = jacobian(start)
    if not (np.all(np.isfinite(matrix)) and np.isfinite(squared)):
        return Located(start, float("inf"), False, np.empty(0), float("inf"))
    guide, across, squared = _pair_near(matrix, squared)
    size = float(np.sqrt(abs(squared))) or float(np.abs(matrix).max()) or 1.0

    def equations(z: Array) -> Array:
        value, matrix = jacobian(z[: n + 1])
        a, b, kappa = z[n + 1 : 2 * n + 1], z[2 * n + 1 : -1], z[-1]
        first, second = matrix @ a / size - b, matrix @ b / size + kappa * a
        return np.concatenate([value, first, second, [guide @ a - 1.0, across @ a]])

    def derivative(z: Array) -> Array:
        u, a, b, kappa = z[: n + 1], z[n + 1 : 2 * n + 1], z[2 * n + 1 : -1], z[-1]
        result = np.zeros((3 * n + 2, 3 * n + 2))
        _, result[:n, : n + 1] = curve(u)
        inner = result[:n, :n] * units / units[:, None] / size
        in_a, in_b = slice(n + 1, 2 * n + 1), slice(2 * n + 1, 3 * n + 1)
        first, second = slice(n, 2 * n), slice(2 * n, 3 * n)
        result[first, : n + 1] = _bending(curve, u, units * a, scale) / units[:, None] / size
        result[first, in_a], result[first, in_b] = inner, -np.eye(n)
        result[second, : n + 1] = _bending(curve, u, units * b, scale) / units[:, None] / size
        result[second, in_a], result[second, in_b] = kappa * np.eye(n), inner
        result[second, -1] = a
        result[3 * n, in_a] = guide
        result[3 * n + 1, in_a] = across
        return result

    z, residual, converged, correction = newton(
        equations,
        np.concatenate([start, guide, matrix @ guide / size, [squared / size**2]]),
        np.concatenate([scale, np.ones(2 * n + 1)]),
        derivative,
    )
    # a single eigenvector a, with b a multiple of it, also solves the system
    a, b = z[n + 1 : 2 * n + 1], z[2 * n + 1 : -1]
    across_a = np.linalg.norm(b - (a @ b) / (a @ a) * a)
    converged = bool(converged and across_a > PARALLEL * np.linalg.norm(b))
    return Located(z[: n + 1], residual, converged, z[-1:] * size**2, correction)


def _pair_near(matrix: Array, squared: float) -> tuple[Array, Array, float]:
    """Orthonormal basis of the eigenspace of a pair with sum near zero, and the product."""
    values, vectors = np.linalg.eig(matrix)
    first, second = pair_with_sum_near_zero(values, squared)
    one, other = vectors[:, first], vectors[:, second]
    if values[first].imag == 0:
        plane = np.column_stack([one.real, other.real])
    else:
        plane = np.column_stack([one.real, one.imag])
    basis, _, _ = np.linalg.svd(plane, full_matrices=False)
    return basis[:, 0], basis[:, 1], float((values[first] * values[second]).real)


def pair_with_sum_near_zero(values: NDArray[np.complex128], squared: float) -> tuple[int, int]:
    """Return which two eigenvalues have a small real sum and a product near a given one.

    Both are relative to the size of the pair.

    Examples
    --------
    >>> pair_with_sum_near_zero(np.array([-1.0, 0.9, 2.0j, -2.0j]), 4.0)
    (2, 3)
    """
    first, second = np.triu_indices(len(values), 1)
    sums, products = values[first] + values[second], (values[first] * values[second]).real
    size = np.abs(values[first]) + np.abs(values[second])
    tiny = np.finfo(float).tiny
    with np.errstate(divide="ignore"):
        apart = np.abs(np.log(np.maximum(np.abs(products), tiny) / max(abs(squared), tiny)))
    cost = np.abs(sums) / np.maximum(size, tiny) + apart + (products * squared < 0)
    cost = np.where(np.abs(sums.imag) <= 1e-12 * size, cost, np.inf)
    k = int(np.argmin(cost))
    return int(first[k]), int(second[k])


def branch_point(curve: Curve, start: Array, scale: Array) -> Located:
    """Locate a branch point: F + βψ = 0, [F_x F_p]ᵀψ = 0, |ψ| = 1.

    Each rate is in units of its largest slope around the start (`slope_sizes`). β is the
    parameter of the unfolding (Kuznetsov 2004, section 10.2.3): if it is not zero, two curves
    pass the point without an intersection. ``extra`` is their `passing_distance`, zero where β
    vanishes to rounding, and the distance below which it does.
    """
    n = len(start) - 1
    sizes = slope_sizes(curve, start, scale)
    slopes = curve(start)[1] * scale / sizes[:, None]
    if not np.isfinite(slopes).all():
        # the motion is not defined there, as sliding at a two-fold
        return Located(start, np.inf, False, np.full(2, np.nan), np.inf)
    left, _, _ = np.linalg.svd(slopes)
    guide = left[:, -1]

    def equations(z: Array) -> Array:
        value, slopes = curve(z[: n + 1])
        psi, beta = z[n + 1 : 2 * n + 1], z[-1]
        across = scale * ((slopes / sizes[:, None]).T @ psi)
        return np.concatenate([value / sizes + beta * psi, across, [guide @ psi - 1.0]])

    z, residual, converged, size = newton(
        equations,
        np.concatenate([start, guide, [0.0]]),
        np.concatenate([scale, np.ones(n), [1.0]]),
    )
    u, psi = z[: n + 1], z[n + 1 : 2 * n + 1]
    converged = converged and abs(z[-1]) < 1e-9

    def projected(u: Array) -> float:
        return float(psi @ (curve(u)[0] / sizes) / (psi @ psi))

    distance = resolution = 0.0
    if converged:
        # ψᵀF is stationary, so that it varies by rounding alone
        eps = float(np.finfo(float).eps)
        move = JITTER * np.abs(u) + max(size, eps) * scale
        even = np.where(np.arange(n + 1) % 2, -1.0, 1.0)
        moves = [side * k * move for k in (1, 2) for side in (even, -even, 1.0, -1.0)]
        beta = -projected(u)
        rounding = ROUNDINGS * max(abs(beta + projected(u + move)) for move in moves)
        # round numbers may leave no rounding at all, yet those of the model are rounded
        rounding = max(rounding, eps * float(np.abs(u / scale).max()))
        resolution = passing_distance(curve, u, scale, sizes, np.copysign(rounding, beta) * psi)
        if abs(beta) > rounding:
            distance = passing_distance(curve, u, scale, sizes, beta * psi)
    return Located(u, residual, converged, np.array([distance, resolution]), size)


def slope_sizes(curve: Curve, u: Array, scale: Array) -> Array:
    """Largest slope of each rate at a point and `SLOPE_OFFSET` of the scale beside it, shape (n,).

    At a branch point in an invariant plane all slopes of one rate vanish.
    """
    moves = np.vstack(
        [np.zeros(len(u)), SLOPE_OFFSET * np.diag(scale), -SLOPE_OFFSET * np.diag(scale)]
    )
    slopes = np.array([np.abs(curve(u + move)[1] * scale).max(axis=1) for move in moves])
    size = np.where(np.isfinite(slopes), slopes, 0.0).max(axis=0)
    return np.where(size > 0, size, 1.0)


def _crossing_form(
    curve: Curve, u: Array, scale: Array, sizes: Array
) -> tuple[Array, Array, Array]:
    """Return the form ψᵀB(φ, φ) in the null plane of [F_x F_p], this plane, and ψ.

    The form is of shape (2, 2); the plane of shape (2, n + 1), in units of the scale; the rates
    are in units of given sizes.
    """
    units = scale / sizes[:, None]
    left, _, right = np.linalg.svd(curve(u)[1] * units)
    psi, plane = left[:, -1], right[-2:]
    step = 1e-4

    def bent(along: Array) -> Array:
        ahead, back = (curve(u + k * step * scale * along)[1] * units for k in (1, -1))
        return np.asarray(psi @ (ahead - back) / (2.0 * step))

    form = np.array([bent(along) for along in plane]) @ plane.T
    return form, plane, psi


def passing_distance(curve: Curve, u: Array, scale: Array, sizes: Array, unfolding: Array) -> float:
    """Distance of two curves that avoid an intersection, in units of the scale.

    The curves are ½ ψᵀB(φ, φ) = β to leading order, and nearest to each other along an
    eigenvector of the form.

    Parameters
    ----------
    sizes : ndarray, shape (n,)
        Units of the rates.
    unfolding : ndarray, shape (n,)
        βψ of `branch_point`, in these units.
    """
    form, _, psi = _crossing_form(curve, u, scale, sizes)
    beta = float(psi @ unfolding)
    values = np.linalg.eigvalsh(0.5 * (form + form.T)) * np.sign(beta)
    if beta == 0:
        return 0.0
    # without a curve on either side, of the other sign
    curvature = values.max() if values.max() > 0 else -values.min()
    return float(2.0 * np.sqrt(2.0 * abs(beta) / curvature)) if curvature > 0 else np.inf


def crossing_tangents(curve: Curve, u: Array, scale: Array) -> Array | None:
    """Tangents of the two curves that cross at a branch point, shape (2, n + 1).

    Solutions of ψᵀB(φ, φ) = 0 in the null plane of [F_x F_p] (Kuznetsov 2004,
    section 10.2.3), of length one in units of the scale; None unless the two
    cross transversally.
    """
    form, plane, _ = _crossing_form(curve, u, scale, slope_sizes(curve, u, scale))
    a, b, c = form[0, 0], form[0, 1], form[1, 1]
    size = max(abs(a), abs(b), abs(c))
    inside = b * b - a * c
    if size == 0 or inside <= 1e-6 * size * size:
        return None
    # roots of a α² + 2 b αβ + c β² without cancellation
    q = -(b + np.copysign(np.sqrt(inside), b))
    pairs = np.array([[q, a], [c, q]])
    tangents = pairs @ plane
    return np.asarray(scale * tangents / np.linalg.norm(tangents, axis=1)[:, None])
