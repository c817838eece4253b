"""Special points of curves in two parameters: tests, and the search for their zeros.

A test function changes its sign at a point. The point is located as a solution of the equations
of the curve together with the test (Kuznetsov 2004, sections 8.7 and 10.3).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

from fastslow.continuation import curves
from fastslow.continuation.curves import Frame
from fastslow.continuation.location import differenced, newton
from fastslow.continuation.point_kinds import PointKind
from fastslow.continuation.settings import Continuation
from fastslow.continuation.zeros import (
    TEST_ROUNDING,
    TOUCH,
    Between,
    Bracket,
    brackets,
    is_between,
    solved,
)

Array = NDArray[np.float64]

#: A test that is below this fraction of its terms at most of at least so many rows vanishes along
#: the curve.
IDENTICAL, VANISHING_ROWS = 1e-10, 8

#: A test that exceeds this after the last bisection is discontinuous, without a zero.
JUMP = 1e-3

#: What is said of a zero without a change of sign.
NO_CHANGE = "no change of sign there, to rounding"

#: Points at a smaller distance, in scaled units, are identical.
SAME_POINT_OF_CURVE = 1e-6

#: Step of the difference of a test along a curve, in units of arclength.
ARC_DIFFERENCE = 1e-5


@dataclass(frozen=True, eq=False)
class Criterion:
    """A test function along a curve.

    Parameters
    ----------
    kind : PointKind
        Kind of the point at its zero.
    value : callable
        Function of z that returns the test, smooth near its zeros, and the size of its terms,
        by which rounding errors are judged.
    genuine : callable
        Function of z, whether a zero is a point of that code.
    region : int
        Region of the test; for periodic orbits 0.
    interface : int, optional
        Interface of the test.
    beyond : int, optional
        The region, or sliding motion, on the other side.
    note : str
        Note on the point.
    touching : bool
        Whether zeros without a change of sign are points as well.
    """

    kind: PointKind
    value: Callable[[Array], tuple[float, float]]
    genuine: Callable[[Array], bool]
    region: int = 0
    interface: int | None = None
    beyond: int | None = None
    note: str = ""
    touching: bool = False

    @property
    def code(self) -> str:
        return self.kind.code


@dataclass(frozen=True, eq=False)
class CurvePoint:
    """A special point after a row of a curve, of the kind of its criterion."""

    row: int
    criterion: Criterion
    z: Array
    residual: float
    converged: bool
    correction: float


#: The equations of a curve.
Equations = TypeVar("Equations", bound=curves.System, covariant=True)


@dataclass(frozen=True, eq=False)
class TracedRows(Generic[Equations]):
    """A traced curve: defining system, rows, and computation of points between them."""

    system: Equations
    z: Array
    frame: Frame
    continuation: Continuation

    def between(self, a: Array, b: Array, part: float) -> Array | None:
        """Solve for the point of the curve at a fraction of the chord of two of its points."""
        chord = b - a
        length = float(np.sqrt((chord**2) @ self.frame.weight))
        if length == 0.0:
            return None
        guess = a + part * chord
        found = curves.corrected(self.system, guess, chord / length, self.frame, self.continuation)
        return None if found is None else found[0]

    def tested(self, value: Callable[[Array], float]) -> Between:
        """Return the function that computes a point on a chord, with a test."""

        def point(a: Array, b: Array, part: float) -> tuple[Array, float] | None:
            z = self.between(a, b, part)
            test = np.nan if z is None else value(z)
            return (z, test) if z is not None and np.isfinite(test) else None

        return point

    def solved(self, row: int, part: float, entry: int, value: float) -> Array | None:
        """Solve for the point near a fraction of a step at which an entry of z has a value."""
        guess = self.z[row]
        if part > 0:
            guess = guess + part * (self.z[row + 1] - guess)
        guide = self.system.renewed(guess)

        def equations(z: Array) -> Array:
            return np.append(self.system.residual(z, guide), z[entry] - value)

        def derivative(z: Array) -> Array:
            last = np.zeros(len(z))
            last[entry] = 1.0
            return np.vstack([curves.slopes(self.system, z, guide, self.frame.scale), last])

        z, _, converged, _ = newton(equations, guess, self.frame.scale, derivative)
        near = np.abs((z - guess) / self.frame.scale)[: self.frame.size].max()
        if not converged or near > 2.0 * self.continuation.max_step:
            return None
        z[entry] = value
        return self.system.renewed(z)

    def passes(self, u: Array) -> bool:
        """Return whether the curve contains a point (states, parameters)."""
        scale = self.frame.scale[: self.frame.size]
        line, target = self.z[:, : self.frame.size] / scale, u / scale
        if len(line) < 2:
            return bool(np.abs(line - target).max() < SAME_POINT_OF_CURVE)
        chords = np.diff(line, axis=0)
        lengths = np.maximum((chords**2).sum(axis=1), 1e-300)
        part = np.clip(((target - line[:-1]) * chords).sum(axis=1) / lengths, 0.0, 1.0)
        apart = np.linalg.norm(line[:-1] + part[:, None] * chords - target, axis=1)
        # the distance of a chord from the curve is less than its length times the turning angle
        for row in np.flatnonzero(apart < 0.2 * np.sqrt(lengths) + SAME_POINT_OF_CURVE):
            z = self.between(self.z[row], self.z[row + 1], float(part[row]))
            if (
                z is not None
                and np.abs(z[: self.frame.size] / scale - target).max() < SAME_POINT_OF_CURVE
            ):
                return True
        return False


def search(
    rows: TracedRows[curves.System], watched: list[Criterion], identical: list[str] | None = None
) -> Iterator[CurvePoint]:
    """Locate all points at which a test vanishes, with a change of sign or as its criterion says.

    Parameters
    ----------
    rows : TracedRows
    watched : list of Criterion
    identical : list of str, optional
        Receives the words for points whose test vanishes along the curve, to rounding.
    """
    for criterion in watched:
        tests, sizes = np.array([criterion.value(z) for z in rows.z]).T
        unit = _unit(tests, sizes)
        if unit == 0.0:
            # the signs of a test that vanishes identically are those of rounding errors
            if identical is not None and criterion.interface is None:
                identical.append(criterion.kind.words)
            continue
        values = np.where(np.abs(tests) <= TEST_ROUNDING * sizes, 0.0, tests / unit)

        def value(z: Array, criterion: Criterion = criterion, unit: float = unit) -> float:
            test, size = criterion.value(z)
            return 0.0 if abs(test) <= TEST_ROUNDING * size else test / unit

        between, touches = rows.tested(value), list[Bracket]()
        known = np.where(np.abs(values) <= TEST_ROUNDING, 0.0, values)
        lengths = np.sqrt((np.diff(rows.z, axis=0) ** 2) @ rows.frame.weight)
        on = rows.z, known, lengths, between
        for bracket in brackets(*on, quartered=True, touches=touches):
            point = _solved(rows, bracket, criterion, unit, between)
            if point is not None:
                yield point
        if criterion.touching:
            yield from _touches(rows, values, criterion, touches)


def _touches(
    rows: TracedRows[curves.System], values: Array, criterion: Criterion, between: list[Bracket]
) -> Iterator[CurvePoint]:
    """Yield zeros without a change of sign: at rows, and the minima between them."""
    found = []
    for row, value in enumerate(values):
        beside = values[max(row - 1, 0) : row + 2]
        signs = np.sign(beside[beside != 0])
        most = np.abs(beside).max()
        if most > 0 and abs(value) <= TOUCH * most and abs(signs.sum()) == len(signs):
            found.append((row, rows.z[row], 0 < row < len(values) - 1))
    at_rows = {row for row, *_ in found}
    found += [
        (one.row, one.points[0], True) for one in between if not {one.row, one.row + 1} & at_rows
    ]
    for row, z, inner in found:
        residual = float(np.abs(rows.system.residual(z, z)).max())
        touch = replace(criterion, note=NO_CHANGE if inner else "")
        yield CurvePoint(row, touch, z, residual, True, 0.0)


def _unit(tests: Array, sizes: Array) -> float:
    """Return the typical size of the terms of a test; 0 if the test is rounding errors only."""
    known = np.isfinite(tests) & np.isfinite(sizes)
    above = np.abs(tests[known]) > TEST_ROUNDING * sizes[known]
    small = np.abs(tests[known]) <= IDENTICAL * sizes[known]
    if not above.any() or (
        len(small) >= VANISHING_ROWS and 2 * np.count_nonzero(small) > len(small)
    ):
        return 0.0
    # the median, since some tests have poles
    return float(np.median(sizes[known])) or float(sizes[known].max())


def _solved(
    rows: TracedRows[curves.System],
    bracket: Bracket,
    criterion: Criterion,
    unit: float,
    between: Between,
) -> CurvePoint | None:
    """Locate the zero in a bracket; None for a pole, a discontinuity, or another point."""
    size, scale = rows.frame.size, rows.frame.scale[: rows.frame.size]
    first: CurvePoint | None = None

    def locate(guess: Array, a: Array, b: Array) -> CurvePoint | None:
        nonlocal first
        here = unit * abs(bracket.values[1] - bracket.values[0])
        point = solved_from(rows, guess, criterion, here, bracket.row)
        if not np.isfinite(point.residual) or not is_between(
            point.z[:size], a[:size], b[:size], scale
        ):
            return None
        first = first or point
        return point if point.converged else None

    found = solved(bracket, between, locate)
    if isinstance(found, Bracket):
        nearest = int(abs(found.values[1]) < abs(found.values[0]))
        if abs(found.values[nearest]) > JUMP:
            return None
        found = first or CurvePoint(
            bracket.row, criterion, found.points[nearest], np.nan, False, np.nan
        )
        found = replace(found, converged=False)
    return found if criterion.genuine(found.z) else None


def solved_from(
    rows: TracedRows[curves.System],
    guess: Array,
    criterion: Criterion,
    unit: float = 1.0,
    row: int = 0,
) -> CurvePoint:
    """Apply Newton's method to the defining system of a curve together with a test.

    Parameters
    ----------
    rows : TracedRows
    guess : ndarray
    criterion : Criterion
    unit : float
        Of the test.
    row : int
        Row after which the point is.
    """
    system, frame = rows.system, rows.frame
    guide = system.renewed(guess)

    def equations(z: Array) -> Array:
        return np.append(system.residual(z, guide), criterion.value(z)[0] / unit)

    def derivative(z: Array) -> Array:
        last = _test_slopes(system, criterion, z, frame) / unit
        return np.vstack([curves.slopes(system, z, guide, frame.scale), last])

    z, residual, converged, correction = newton(equations, guess, frame.scale, derivative)
    if not np.all(np.isfinite(z)):
        return CurvePoint(row, criterion, guess, np.inf, False, correction)
    return CurvePoint(row, criterion, system.renewed(z), residual, converged, correction)


def _test_slopes(system: curves.System, criterion: Criterion, z: Array, frame: Frame) -> Array:
    """Derivative of a test, whose evaluation is the expensive part.

    Where the system has exact slopes, the derivative along the curve alone: Newton's method
    satisfies the equations of the curve to second order.
    """
    if isinstance(system, curves.ExactSystem):
        along = curves.tangent(system, z, frame)
        ahead, back = (
            criterion.value(z + sign * ARC_DIFFERENCE * along)[0] for sign in (1.0, -1.0)
        )
        return (ahead - back) / (2.0 * ARC_DIFFERENCE) * along * frame.weight
    count = len(z) if system.tested is None else system.tested
    last = np.zeros(len(z))
    last[:count] = differenced(lambda z: criterion.value(z)[0], z, frame.scale, count)
    return last


def always(_: Array) -> bool:
    """Accept every zero as a point of the criterion's kind."""
    return True
