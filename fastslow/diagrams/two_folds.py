"""Two-folds, at which branches of pseudo-equilibria end: both fields are tangent.

The sliding vector field is 0/0 at a = b = 0. The system (1 − α) f₁ + α f₂ = 0, h = 0, a = b for
(states, α, parameter) has no division and is regular; over two parameters it defines a curve
(`defining.TwoFold`).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fastslow.continuation.location import newton
from fastslow.diagrams.field import FrozenField

Array = NDArray[np.float64]

#: Largest distance, in scaled units, of a two-fold from the point where steps became too small.
TWO_FOLD_REACH = 1e-3

#: Rows closer to the two-fold are inaccurate because of 0/0.
TWO_FOLD_DISTANCE = 1e-6


def two_fold_ahead(field: FrozenField, region: int, u: Array, scale: Array) -> Array | None:
    """Locate a two-fold reached or passed by the last step of a branch of a sliding motion.

    Parameters
    ----------
    region : int
        Number of the sliding motion; a region has no two-fold.
    u : ndarray, shape (N, n + 1)
        Points of the branch.
    scale : ndarray, shape (n + 1,)
        Unit of each state and of the parameter.

    Returns
    -------
    ndarray or None
        The point u, to rounding.
    """
    sides = field.modes[region].sides
    if sides is None or len(u) < 2:
        return None
    signs = field.signs[region][-2:]
    first, second = signs * field.evaluate(region, u[-2:])[2][:, -2:]
    passed = bool(np.all(second < 0))
    if not passed and np.any(second < 0):
        return None
    reach = 2.0 * float(np.linalg.norm((u[-1] - u[-2]) / scale)) if passed else TWO_FOLD_REACH
    part = float(np.clip(first.sum() / max((first - second).sum(), 1e-300), 0.0, 1.0))
    near = u[-2] + part * (u[-1] - u[-2]) if passed else u[-1]
    share = float(first[0] / first.sum()) if first.sum() else 0.5

    def equations(z: Array) -> Array:
        return _regular(field, region, np.delete(z, -2), float(z[-2]))

    z, _, converged, _ = newton(equations, np.insert(near, -1, share), np.insert(scale, -1, 1.0))
    found = np.delete(z, -2)
    apart = np.linalg.norm((found - (u[-2] if passed else u[-1])) / scale)
    return found if converged and apart <= reach else None


def cut_at_two_fold(u: Array, tangents: Array, end: Array, scale: Array) -> tuple[Array, Array]:
    """Replace the rows after a two-fold by the two-fold itself."""
    apart = np.linalg.norm((u - end) / scale, axis=1)
    ahead = ((end - u) / scale**2 * tangents).sum(axis=1)
    keep = (apart > TWO_FOLD_DISTANCE) & (ahead > 0)
    keep[:-2] |= apart[:-2] > 10 * TWO_FOLD_DISTANCE
    keep[0] = True
    u, tangents = u[keep], tangents[keep]
    chord = (end - u[-1]) / scale
    length = float(np.linalg.norm(chord))
    last = tangents[-1] / scale
    if length > 0:
        # the direction at the other end of a circular arc
        chord = chord / length
        last = 2.0 * (last @ chord) * chord - last
    return np.vstack([u, end]), np.vstack([tangents, last * scale])


def on_two_fold(field: FrozenField, region: int, u: Array, scale: Array) -> NDArray[np.bool_]:
    """Check which points of a branch are on a two-fold, where the sliding vector field is 0/0.

    Parameters
    ----------
    region : int
    u : ndarray, shape (N, n + 1)
    scale : ndarray, shape (n + 1,)

    Returns
    -------
    ndarray of bool, shape (N,)
        Whether a and b vanish within `TWO_FOLD_DISTANCE` scaled units.
    """
    if field.modes[region].sides is None:
        return np.zeros(len(u), dtype=bool)
    _, _, h, gradients = field.evaluate(region, u)
    reach = TWO_FOLD_DISTANCE * np.abs(gradients[:, -2:] * scale).sum(axis=-1)
    return np.asarray((np.abs(h[:, -2:]) <= reach).all(axis=-1))


def two_fold_residual(field: FrozenField, region: int, u: Array) -> float:
    """Residual of the equations of a two-fold at a point, with the best weight α."""
    return float(np.abs(_regular(field, region, u, weight_of(field, region, u))).max())


def weight_of(field: FrozenField, region: int, u: Array) -> float:
    """Weight α that minimizes (1 − α) f₁ + α f₂ at a point."""
    sides = field.sides(region)
    above, below = (
        field.residual_and_jacobian(sides.above, u)[0],
        field.residual_and_jacobian(sides.below, u)[0],
    )
    jump = below - above
    return -float(above @ jump) / float(jump @ jump) if jump.any() else 0.5


def _regular(field: FrozenField, region: int, u: Array, share: float) -> Array:
    """(1 − α) f₁ + α f₂, h and a − b at a point."""
    sides = field.sides(region)
    above, _, h, gradients = field.evaluate(sides.above, u)
    below, _ = field.residual_and_jacobian(sides.below, u)
    normal = gradients[sides.interface, : field.n]
    weighted = (1.0 - share) * above + share * below
    return np.concatenate([weighted, [h[sides.interface], normal @ (above - below)]])
