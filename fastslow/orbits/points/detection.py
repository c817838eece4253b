"""Detection of special points between two orbits of a branch, and their location."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fastslow.continuation.zeros import Bracket, solved
from fastslow.orbits.flow.shooting import BlockInverse, Shooting
from fastslow.orbits.points.kinds import BIFURCATIONS, BifurcationKind
from fastslow.orbits.points.location import LocatedOrbit, row_units
from fastslow.orbits.points.multiplier_signs import (
    MultiplierChange,
    MultiplierSigns,
    multipliers_at,
)

Array = NDArray[np.float64]

#: Orbits computed between two others before a location is given up; Newton's method is tried from
#: the last of them.
ORBIT_NARROWINGS = 17

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
    inverse = None if last.blocks is None else BlockInverse.of(last, scale)
    if inverse is None:
        matrix = last.jacobian * scale / row_units(shooting, last, scale)[:, None]
        tangent = np.linalg.svd(matrix)[2][-1]
    else:
        tangent = inverse.condensed.tangent()
        tangent /= np.linalg.norm(tangent)
    ahead = tangent[-1] if before is None else tangent @ before
    tangent = np.asarray(-tangent if ahead < 0 else tangent)
    signs = MultiplierSigns.of(multipliers_at(shooting, u, last), float(tangent[-1]))
    return TangentPoint(u, tangent, signs)


def kinds_between(one: MultiplierSigns, two: MultiplierSigns) -> tuple[BifurcationKind, ...]:
    """Return the kinds of the special points between two orbits next to each other."""
    change = MultiplierChange(one, two)
    return tuple(kind for kind in BIFURCATIONS if kind.occurs(change))


def located_between(
    shooting: Shooting,
    kind: BifurcationKind,
    row: TangentPoint,
    following: TangentPoint,
    scale: Array,
) -> LocatedOrbit:
    """Locate a special point between two orbits of a branch.

    Newton's method for the extended system starts from a cubic between both orbits. Without
    convergence to a point between them, an orbit is computed there and the interval is narrowed; a
    fold is located by its multiplier.

    Parameters
    ----------
    shooting : Shooting
    kind : BifurcationKind
        One of `kinds_between`.
    row, following : TangentPoint
    scale : ndarray, shape (N + 1,)

    Returns
    -------
    LocatedOrbit
        Its ``converged`` is False if no point between the orbits was found; it is then the last
        one that was tried.
    """
    line, tried = _OnBranch(shooting, scale, row, following), list[LocatedOrbit]()

    def between(a: Array, b: Array, part: float) -> tuple[Array, float] | None:
        middle = line.between(a, b, part)
        if middle is None:
            return None
        # a value with the sign of the end on the other side of the point
        size = abs(kind.test(middle.signs))
        before = kind in kinds_between(line.at(a).signs, middle.signs)
        return middle.u, (1.0 if before else -1.0) * (size if size > 0 else 1.0)

    def locate(_: Array, a: Array, b: Array) -> LocatedOrbit | None:
        ends = line.at(a), line.at(b)
        pairs = [one.signs.pair[1] for one in ends if one.signs.pair is not None]
        angle = float(np.mean(pairs)) if pairs else 0.5 * np.pi
        tests = [kind.test(one.signs) for one in ends]
        share = 0.5
        if tests[0] * tests[1] < 0:
            share = float(np.clip(tests[0] / (tests[0] - tests[1]), 0.05, 0.95))
        tried.append(kind.located(shooting, _between(*ends, share, scale), scale, angle))
        if tried[-1].converged and _is_between(tried[-1].u, *ends, scale):
            return tried[-1]
        units = [one.signs.nearest_unit for one in ends]
        if kind.by_multiplier and units[0] * units[1] < 0:
            return _fold_by_multiplier(shooting, tried[-1], *ends, scale)
        return None

    ends = -1.0, 1.0
    tests = kind.test(row.signs), kind.test(following.signs)
    if tests[0] * tests[1] < 0:
        ends = -abs(tests[0]), abs(tests[1])
    bracket = Bracket(0, (row.u, following.u), ends)
    found = solved(bracket, between, locate, most=ORBIT_NARROWINGS)
    if isinstance(found, LocatedOrbit):
        return found
    return replace(tried[-1], residual=np.nan, accuracy=np.nan, converged=False)


@dataclass(eq=False)
class _OnBranch:
    """Orbits of a branch by their unknowns, between two of them."""

    shooting: Shooting
    scale: Array
    row: TangentPoint
    following: TangentPoint

    def __post_init__(self) -> None:
        self.known = {id(one.u): one for one in (self.row, self.following)}

    def at(self, u: Array) -> TangentPoint:
        return self.known[id(u)]

    def between(self, a: Array, b: Array, part: float) -> TangentPoint | None:
        """The orbit at a fraction of the way between two others; None without convergence."""
        one, two = self.at(a), self.at(b)
        guess = _between(one, two, part, self.scale)
        u = corrected(self.shooting, guess, one.tangent + two.tangent, self.scale)
        if u is None:
            return None
        found = tangent_point(self.shooting, u, self.scale, one.tangent)
        self.known[id(found.u)] = found
        return found


def _fold_by_multiplier(
    shooting: Shooting,
    known: LocatedOrbit,
    row: TangentPoint,
    following: TangentPoint,
    scale: Array,
) -> LocatedOrbit:
    """Locate a fold as the orbit with the multiplier 1.

    In a canard explosion the equations are singular to rounding along the branch, and determine
    the parameter alone; the multiplier, an integral along the orbit, is accurate.
    """
    line, widths = _OnBranch(shooting, scale, row, following), [np.inf]

    def between(a: Array, b: Array, part: float) -> tuple[Array, float] | None:
        middle = line.between(a, b, part)
        if middle is None:
            return None
        widths.append(min(float(np.abs((middle.u - end) / scale).max()) for end in (a, b)))
        log = middle.signs.nearest_unit
        return middle.u, 0.0 if abs(log) <= UNIT else log

    bracket = Bracket(
        0, (row.u, following.u), (row.signs.nearest_unit, following.signs.nearest_unit)
    )
    found = solved(bracket, between, lambda *_: None, first=ORBITS, most=ORBITS)
    assert found is not None
    nearest = int(abs(found.values[1]) < abs(found.values[0]))
    inner = line.at(found.points[nearest])
    last = shooting.linearised(inner.u)
    left = float(np.abs(last.residual / row_units(shooting, last, scale)).max())
    residual = max(left, abs(inner.signs.nearest_unit))
    converged = residual <= FOLD_RESIDUAL
    return LocatedOrbit(inner.u, known.vector, 1.0 + 0j, residual, widths[-1], converged)


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
