"""Detection of special points between two orbits of a branch, and their location."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fastslow.orbits.flow.flows import after_jumps, fields
from fastslow.orbits.flow.multipliers import Multipliers, orbit_multipliers
from fastslow.orbits.flow.shooting import Linearised, Shooting
from fastslow.orbits.points.special_points import (
    LocatedOrbit,
    locate_branch_point,
    locate_doubling,
    locate_fold,
    locate_torus,
    row_units,
)
from fastslow.results.orbits.orbit_arrays import OrbitArrays
from fastslow.results.point_types import (
    BRANCH_POINT_OF_CYCLES,
    FOLD_OF_CYCLES,
    PERIOD_DOUBLING,
    TORUS,
)

Array = NDArray[np.float64]

#: Bisections between two orbits before a location is given up.
BISECTIONS = 12

#: Newton steps of a correction in a normal plane.
STEPS = 12

#: Number of orbits, and logarithm of the critical multiplier, at which a fold is located by its
#: multiplier.
ORBITS, UNIT = 40, 1e-9

#: Residual of the equations of a fold that is located by its multiplier.
CLOSED = 1e-8

#: Distance beyond either orbit, as a fraction of their distance, at which a point still counts as
#: between them.
BEYOND = 0.05

#: A multiplier within this distance of the unit circle is on it.
ON_CIRCLE = 1e-9

#: A multiplier within this distance of 1 is that of a family of orbits, or of a point.
NEUTRAL = 1e-7

#: A slope of the parameter below this one is rounding: along a family at one value of the
#: parameter, as around a linear centre, or in a canard explosion.
LEVEL = 1e-9

#: Imaginary part of a real multiplier, as a fraction of its modulus.
REAL = 1e-9


class MultiplierSigns(NamedTuple):
    """What changes at special points: nontrivial multipliers and the parameter's direction.

    Of one orbit, or with an axis more of several.

    Parameters
    ----------
    slope : float or ndarray
        Component of the tangent of the branch along the parameter.
    values : ndarray of complex128
    logs : ndarray
        Logarithms of their moduli.
    """

    slope: Any
    values: NDArray[np.complex128]
    logs: Array

    @classmethod
    def of(cls, found: Multipliers | OrbitArrays, slope: float) -> MultiplierSigns:
        """The signs of multipliers, without that of the orbit's own tangent."""
        values, logs = (
            (found.multipliers, found.log_multipliers)
            if isinstance(found, OrbitArrays)
            else (found.values, found.logs)
        )
        if found.trivial is not None:
            values, logs = np.delete(values, found.trivial), np.delete(logs, found.trivial)
        return cls(slope, values, logs)

    @classmethod
    def of_rows(cls, rows: Sequence[tuple[OrbitArrays, float]]) -> MultiplierSigns:
        """The signs of several orbits, each as `of` returns it; zeros fill shorter rows."""
        count = max(len(found.multipliers) for found, _ in rows)
        slopes = np.array([slope for _, slope in rows])
        values = np.zeros((len(rows), count), dtype=complex)
        logs = np.full((len(rows), count), -np.inf)
        for k, row in enumerate(rows):
            one = cls.of(*row)
            values[k, : len(one.values)], logs[k, : len(one.logs)] = one.values, one.logs
        return cls(slopes, values, logs)

    @property
    def real(self) -> NDArray[np.bool_]:
        return np.asarray(np.abs(self.values.imag) <= REAL * np.abs(self.values))

    @property
    def outside(self) -> Any:
        """Number of multipliers outside the unit circle."""
        return (self.logs > ON_CIRCLE).sum(axis=-1)

    @property
    def neutral(self) -> NDArray[np.bool_]:
        """True for multipliers whose side of 1 is unknown."""
        return np.asarray(np.abs(self.values - 1.0) <= NEUTRAL)

    @property
    def grown(self) -> Any:
        """Number of real multipliers above 1."""
        above = self.real & (self.values.real > 0) & (self.logs > 0)
        return (above & ~self.neutral).sum(axis=-1)

    @property
    def flipped(self) -> Any:
        """Number of real multipliers below -1."""
        return (self.real & (self.values.real < 0) & (self.logs > 0)).sum(axis=-1)

    @property
    def pair(self) -> tuple[float, float] | None:
        """Logarithm of the modulus and angle of the complex pair nearest to the unit circle."""
        pairs = np.flatnonzero(~self.real & (self.values.imag > 0))
        if not len(pairs):
            return None
        nearest = pairs[np.argmin(np.abs(self.logs[pairs]))]
        return float(self.logs[nearest]), float(np.angle(self.values[nearest]))

    @property
    def nearest_unit(self) -> float:
        """Logarithm of the positive multiplier nearest to 1, NaN without one."""
        positive = self.logs[self.real & (self.values.real > 0)]
        return float(positive[np.argmin(np.abs(positive))]) if len(positive) else np.nan

    @property
    def nearest_flip(self) -> float:
        """Logarithm of the modulus of the negative multiplier nearest to -1, NaN without one."""
        negative = self.logs[self.real & (self.values.real < 0)]
        return float(negative[np.argmin(np.abs(negative))]) if len(negative) else np.nan


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


def multipliers_at(shooting: Shooting, u: Array, last: Linearised) -> Multipliers:
    """Multipliers of an orbit from its linearisation."""
    form, _ = shooting.unpack(u)
    points = np.vstack([form.states[1:], form.states[:1] + shooting.winding])
    following = fields(
        shooting.variations,
        np.roll(form.modes, -1),
        points,
        form.times[1:],
        shooting.parameters_at(u),
        np.roll(form.constants, -1, axis=0),
    )
    _, jumps = after_jumps(
        shooting.variations,
        form.jumps,
        last.flows.ends,
        form.times[1:],
        shooting.parameters_at(u),
        form.constants,
    )
    return orbit_multipliers(
        shooting.variations,
        form.modes,
        form.ends,
        last.flows,
        last.fields,
        following,
        jumps,
        autonomous=shooting.forcing is None,
    )


def changes(signs: MultiplierSigns) -> NDArray[np.bool_]:
    """Whether anything changes between rows next to each other, so that `codes_between` may.

    Parameters
    ----------
    signs : MultiplierSigns
        Of N rows.

    Returns
    -------
    ndarray of bool, shape (N - 1,)
    """
    turns = signs.slope[1:] * signs.slope[:-1] < 0
    counts = signs.outside, signs.grown, signs.flipped, signs.neutral.sum(axis=-1)
    return np.asarray(turns | np.any([np.diff(count) != 0 for count in counts], axis=0))


def codes_between(one: MultiplierSigns, two: MultiplierSigns) -> tuple[str, ...]:
    """Return the codes of the special points between two orbits next to each other.

    At a fold both the parameter's direction and the sign of det(M - I) change, at a branch
    point one of them. Two points of one code are not seen. In a family of neutral orbits, and in a
    canard explosion, the direction changes by rounding: then det(M - I) alone shows a fold.
    """
    codes = []
    flat = all(abs(row.slope) <= LEVEL for row in (one, two))
    family = flat and all(row.neutral.any() for row in (one, two))
    turns = one.slope * two.slope < 0 and not family
    known = one.neutral.sum() == two.neutral.sum()
    crosses = known and (one.grown - two.grown) % 2 == 1
    if (turns and not known) or (crosses and (turns or (flat and not family))):
        codes.append(FOLD_OF_CYCLES)
    elif crosses or (turns and not flat):
        codes.append(BRANCH_POINT_OF_CYCLES)
    doubles = (one.flipped - two.flipped) % 2 == 1
    if doubles:
        codes.append(PERIOD_DOUBLING)
    # a pair outside the circle may meet on the real axis and separate
    pairs = one.pair is not None or two.pair is not None
    if pairs and abs(one.outside - two.outside) >= 2 + crosses + doubles:
        codes.append(TORUS)
    return tuple(codes)


def located_between(
    shooting: Shooting, code: str, row: TangentPoint, following: TangentPoint, scale: Array
) -> LocatedOrbit:
    """Locate a special point between two orbits.

    Newton's method for the extended system starts from a cubic between both orbits. Without
    convergence to a point between them, an orbit is computed there and the interval is halved; a
    fold is located by its multiplier.

    Parameters
    ----------
    shooting : Shooting
    code : str
        One of `codes_between`.
    row, following : TangentPoint
    scale : ndarray, shape (N + 1,)

    Returns
    -------
    LocatedOrbit
        Its ``converged`` is False if no point between the orbits was found; it is then the last
        orbit of the bisection.
    """
    found = None
    for _ in range(BISECTIONS):
        share = _share(code, row, following)
        guess = _between(row, following, share, scale)
        pairs = [pair[1] for pair in (row.signs.pair, following.signs.pair) if pair is not None]
        angle = float(np.mean(pairs)) if pairs else 0.5 * np.pi
        found = located_from(shooting, code, guess, scale, angle)
        if found.converged and _is_between(found.u, row, following, scale):
            return found
        if code == FOLD_OF_CYCLES and row.signs.nearest_unit * following.signs.nearest_unit < 0:
            return _fold_by_multiplier(shooting, found, row, following, scale)
        middle = corrected(shooting, guess, row.tangent + following.tangent, scale)
        if middle is None:
            break
        inner = tangent_point(shooting, middle, scale, row.tangent)
        if code in codes_between(row.signs, inner.signs):
            following = inner
        else:
            row = inner
        found = LocatedOrbit(middle, found.vector, found.multiplier, np.nan, np.nan, False)
    assert found is not None
    return LocatedOrbit(found.u, found.vector, found.multiplier, np.nan, np.nan, False)


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
    return LocatedOrbit(inner.u, known.vector, 1.0 + 0j, residual, width, residual <= CLOSED)


def corrected(shooting: Shooting, guess: Array, normal: Array, scale: Array) -> Array | None:
    """Solve for the orbit of a branch in the plane through a guess; None without convergence."""
    u, before = guess.copy(), np.inf
    for _ in range(STEPS):
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


def _test(code: str, row: TangentPoint) -> float:
    """A function along the branch that vanishes at the point."""
    if code == FOLD_OF_CYCLES:
        return float(row.signs.slope)
    if code == PERIOD_DOUBLING:
        return row.signs.nearest_flip
    if code == TORUS and row.signs.pair is not None:
        return row.signs.pair[0]
    return np.nan


def _share(code: str, row: TangentPoint, following: TangentPoint) -> float:
    """Estimate of the place of the point, as a fraction of the distance."""
    before, after = _test(code, row), _test(code, following)
    if not before * after < 0:
        return 0.5
    return float(np.clip(before / (before - after), 0.05, 0.95))


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
    return -BEYOND <= along <= 1.0 + BEYOND and off <= float(np.linalg.norm(gap))


def located_from(
    shooting: Shooting, code: str, guess: Array, scale: Array, angle: float
) -> LocatedOrbit:
    """Solve for a special point from a guess; ``angle`` is an estimate for TR."""
    if code == FOLD_OF_CYCLES:
        return locate_fold(shooting, guess, scale)
    if code == PERIOD_DOUBLING:
        return locate_doubling(shooting, guess, scale)
    if code == BRANCH_POINT_OF_CYCLES:
        return locate_branch_point(shooting, guess, scale)
    return locate_torus(shooting, guess, scale, angle)
