"""Detection of special points between two orbits of a branch, and their location."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fastslow.orbits.flow.shooting import Shooting
from fastslow.orbits.points.kinds import BIFURCATIONS, BifurcationKind
from fastslow.orbits.points.multiplier_signs import (
    MultiplierChange,
    MultiplierSigns,
    multipliers_at,
)
from fastslow.orbits.points.special_points import LocatedOrbit, row_units

Array = NDArray[np.float64]

#: Bisections between two orbits before a location is given up.
ORBIT_BISECTIONS = 12

#: Newton steps of a correction in a normal plane.
PLANE_NEWTON_STEPS = 12

#: Number of orbits, and logarithm of the critical multiplier, at which a fold is located by its
#: multiplier.
ORBITS, UNIT = 40, 1e-9

#: Residual of the equations of a fold that is located by its multiplier.
FOLD_RESIDUAL = 1e-8

#: Distance beyond either orbit, as a fraction of their distance, at which a point still counts as
#: between them.
LOCATION_OVERSHOOT = 0.05


@dataclass(frozen=True, eq=False)
class TangentPoint:
    """A point of a branch with its tangent.

    Parameters
    ----------
    u : ndarray, shape (N + 1,)
        Unknowns of the shooting equations, with the parameter.
    tangent : ndarray, shape (N + 1,)
        Unit tangent of the branch in units of the scales.
    signs : MultiplierSigns
    """

    u: Array
    tangent: Array
    signs: MultiplierSigns


def tangent_point(
    shooting: Shooting, u: Array, scale: Array, before: Array | None = None
) -> TangentPoint:
    """Linearise the branch at an orbit.

    Parameters
    ----------
    shooting : Shooting
        With one chosen parameter.
    u, scale : ndarray, shape (N + 1,)
    before : ndarray, shape (N + 1,), optional
        The tangent is oriented along this one, else towards increasing parameters.
    """
    last = shooting.linearised(u)
    matrix = last.jacobian * scale / row_units(shooting, last, scale)[:, None]
    tangent = np.linalg.svd(matrix)[2][-1]
    ahead = tangent[-1] if before is None else tangent @ before
    tangent = np.asarray(-tangent if ahead < 0 else tangent)
    signs = MultiplierSigns.of(multipliers_at(shooting, u, last), float(tangent[-1]))
    return TangentPoint(u, tangent, signs)


def kinds_between(one: MultiplierSigns, two: MultiplierSigns) -> tuple[BifurcationKind, ...]:
    """Return the kinds of the special points between two orbits next to each other."""
    change = MultiplierChange(one, two)
    return tuple(kind for kind in BIFURCATIONS if kind.occurs(change))


@dataclass(eq=False)
class OrbitInterval:
    """Two orbits of a branch with a special point between them, which are moved towards it.

    Newton's method for the extended system starts from a cubic between both orbits. Without
    convergence to a point between them, an orbit is computed there and the interval is halved; a
    fold is located by its multiplier.

    Parameters
    ----------
    shooting : Shooting
    kind : BifurcationKind
        One of `kinds_between`.
    row, following : TangentPoint
    scale : ndarray, shape (N + 1,)
    last : LocatedOrbit, optional
        The orbit between both that was computed last.
    """

    shooting: Shooting
    kind: BifurcationKind
    row: TangentPoint
    following: TangentPoint
    scale: Array
    last: LocatedOrbit | None = None

    def located(self) -> LocatedOrbit:
        """Locate the point.

        Its ``converged`` is False if no point between the orbits was found; it is then the last
        orbit of the bisection.
        """
        for _ in range(ORBIT_BISECTIONS):
            found = self._solved()
            if found is not None:
                return found
            if not self._halved():
                break
        assert self.last is not None
        return replace(self.last, residual=np.nan, accuracy=np.nan, converged=False)

    def _solved(self) -> LocatedOrbit | None:
        row, following = self.row, self.following
        pairs = [pair[1] for pair in (row.signs.pair, following.signs.pair) if pair is not None]
        angle = float(np.mean(pairs)) if pairs else 0.5 * np.pi
        self.last = self.kind.located(self.shooting, self._guess(), self.scale, angle)
        if self.last.converged and _is_between(self.last.u, row, following, self.scale):
            return self.last
        if self.kind.by_multiplier and row.signs.nearest_unit * following.signs.nearest_unit < 0:
            return _fold_by_multiplier(self.shooting, self.last, row, following, self.scale)
        return None

    def _guess(self) -> Array:
        """The cubic between both orbits, at an estimate of the place of the point."""
        before, after = (self.kind.test(one.signs) for one in (self.row, self.following))
        share = 0.5
        if before * after < 0:
            share = float(np.clip(before / (before - after), 0.05, 0.95))
        return _between(self.row, self.following, share, self.scale)

    def _halved(self) -> bool:
        """Keep the part with the point; False without an orbit between both."""
        normal = self.row.tangent + self.following.tangent
        middle = corrected(self.shooting, self._guess(), normal, self.scale)
        if middle is None:
            return False
        inner = tangent_point(self.shooting, middle, self.scale, self.row.tangent)
        if self.kind in kinds_between(self.row.signs, inner.signs):
            self.following = inner
        else:
            self.row = inner
        assert self.last is not None
        self.last = replace(self.last, u=middle)
        return True


def _fold_by_multiplier(
    shooting: Shooting,
    known: LocatedOrbit,
    row: TangentPoint,
    following: TangentPoint,
    scale: Array,
) -> LocatedOrbit:
    """Locate a fold as the orbit with the multiplier 1, by the secant method with bisection.

    In a canard explosion the equations are singular to rounding along the branch, and determine
    the parameter alone; the multiplier, an integral along the orbit, is accurate.
    """
    inner, width = row, np.inf
    for count in range(ORBITS):
        before, after = row.signs.nearest_unit, following.signs.nearest_unit
        share = 0.5 if count % 3 == 2 else float(np.clip(before / (before - after), 0.01, 0.99))
        guess = _between(row, following, share, scale)
        middle = corrected(shooting, guess, row.tangent + following.tangent, scale)
        if middle is None:
            break
        width = float(np.abs((middle - inner.u) / scale).max())
        inner = tangent_point(shooting, middle, scale, row.tangent)
        log = inner.signs.nearest_unit
        if abs(log) <= UNIT:
            break
        row, following = (inner, following) if log * after < 0 else (row, inner)
    last = shooting.linearised(inner.u)
    left = float(np.abs(last.residual / row_units(shooting, last, scale)).max())
    residual = max(left, abs(inner.signs.nearest_unit))
    return LocatedOrbit(inner.u, known.vector, 1.0 + 0j, residual, width, residual <= FOLD_RESIDUAL)


def corrected(shooting: Shooting, guess: Array, normal: Array, scale: Array) -> Array | None:
    """Solve for the orbit of a branch in the plane through a guess; None without convergence."""
    u, before = guess.copy(), np.inf
    for _ in range(PLANE_NEWTON_STEPS):
        last = shooting.linearised(u)
        rows = row_units(shooting, last, scale)
        matrix = np.vstack([last.jacobian * scale / rows[:, None], normal])
        right = np.append(-last.residual / rows, ((guess - u) / scale) @ normal)
        try:
            step = np.linalg.solve(matrix, right)
        except np.linalg.LinAlgError:
            return None
        size = float(np.abs(step).max())
        if not size < 10.0:
            return None
        u = u + step * scale
        if size <= 1e-14 or (size <= 1e-8 and size >= 0.25 * before):
            return np.asarray(u)
        before = size
    return None


def _between(row: TangentPoint, following: TangentPoint, share: float, scale: Array) -> Array:
    """Cubic between two orbits with their tangents."""
    gap = (following.u - row.u) / scale
    length, s = float(np.linalg.norm(gap)), share
    start, end = row.tangent * length, following.tangent * length
    cubic = s**2 * (3 - 2 * s) * gap + s * (1 - s) ** 2 * start - s**2 * (1 - s) * end
    return np.asarray(row.u + cubic * scale)


def _is_between(u: Array, row: TangentPoint, following: TangentPoint, scale: Array) -> bool:
    """Check that a point is between two orbits, measured along the line through both."""
    gap = (following.u - row.u) / scale
    along = float(((u - row.u) / scale) @ gap) / float(gap @ gap)
    off = float(np.linalg.norm((u - row.u) / scale - along * gap))
    return -LOCATION_OVERSHOOT <= along <= 1.0 + LOCATION_OVERSHOOT and off <= float(
        np.linalg.norm(gap)
    )
