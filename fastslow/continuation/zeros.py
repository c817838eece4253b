"""Zeros of a test function along a sampled curve, including pairs within one step.

A change of sign between two points of the curve encloses a zero. Between two points with equal
signs a smooth test may vanish twice: its modulus has a minimum there, which is computed where the
steps around allow it to be near zero. A bracket is narrowed until Newton's method stays inside.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from fastslow.continuation.loops import loop, writeable

Array = NDArray[np.float64]

#: Values below this fraction of the size of the test are rounding and count as zero.
TEST_ROUNDING = 1e-12

#: Narrowings after which a bracket is at rounding.
NARROWINGS = 80

#: Narrowings before a trial of Newton's method, doubled after each trial because of its cost.
NARROWINGS_PER_TRIAL = 4

#: A minimum is computed if it may be below this fraction of the smallest value.
MINIMUM_RATIO = 0.5

#: Evaluations for one minimum of a test function.
TEST_EVALUATIONS = 40

#: A minimum below this fraction of the values beside it is zero to rounding.
TOUCH = 1e-11

#: Tolerance of a minimum as a fraction of the step; the error of the test is its square.
MINIMUM_TOLERANCE = 1e-8

#: Fractions of a step with a change of sign that are sampled to separate three zeros from one.
QUARTERS = (0.25, 0.5, 0.75)

#: Golden section, for bracketing a minimum where parabolic interpolation fails.
GOLDEN = 0.5 * (np.sqrt(5.0) - 1.0)

#: Fraction of a chord by which a point may be outside of it.
OUTSIDE = 1e-9

T = TypeVar("T")

#: The point of the curve at a fraction of the chord of two others, with its test; None where the
#: curve cannot be evaluated.
Between = Callable[[Array, Array, float], tuple[Array, float] | None]


@dataclass(frozen=True, eq=False)
class Bracket:
    """Two points of a curve between which a test changes its sign, after row ``row``."""

    row: int
    points: tuple[Array, Array]
    values: tuple[float, float]


def brackets(
    points: Array,
    test: Array,
    lengths: Array,
    between: Between,
    *,
    quartered: bool = False,
    touches: list[Bracket] | None = None,
) -> Iterator[Bracket]:
    """Yield changes of sign between neighbouring points (or across a zero), and around minima.

    Parameters
    ----------
    points : ndarray, shape (N, k)
        Points of the curve, in order.
    test : ndarray, shape (N,)
        The test at these points; NaN where it is not defined.
    lengths : ndarray, shape (N - 1,)
        Lengths of the steps between them.
    between : callable
    quartered : bool
        Whether steps with a change of sign are divided, to separate three zeros from one.
    touches : list of Bracket, optional
        Receives the minima that are zero to rounding, each as a bracket of one point.

    Examples
    --------
    >>> def between(a, b, part):
    ...     u = a + part * (b - a)
    ...     return u, float((u[0] - 1.5) ** 2 - 0.01)
    >>> u = np.arange(4.0)[:, None]
    >>> test = np.array([between(p, p, 0.0)[1] for p in u])
    >>> [[float(p[0]) for p in b.points] for b in brackets(u, test, np.ones(3), between)]
    [[1.0, 1.5], [1.5, 2.0]]
    """
    rows = np.arange(len(points))
    if quartered:
        points, test, lengths, rows = _quartered(points, test, lengths, between)
    for before, after in sign_changes(test):
        ends = (points[before], points[after])
        yield Bracket(int(rows[before]), ends, (test[before], test[after]))
    for k in minima(test, lengths):
        a, b, row, sign = points[k], points[k + 1], int(rows[k]), float(np.sign(test[k]))
        beside = abs(test[k]), abs(test[k + 1])
        lowest = _lowest(a, b, sign, between, *beside)
        if lowest is None:
            continue
        point, value = lowest
        if value * sign < 0:
            yield Bracket(row, (a, point), (test[k], value))
            yield Bracket(row, (point, b), (value, test[k + 1]))
        elif touches is not None and abs(value) <= TOUCH * max(beside):
            touches.append(Bracket(row, (point, point), (value, value)))


def _quartered(
    points: Array, test: Array, lengths: Array, between: Between
) -> tuple[Array, Array, Array, NDArray[np.intp]]:
    """Add points in every step with a change of sign; return also the row before each point."""
    rows = np.arange(len(points))
    places = np.append(0.0, np.cumsum(lengths))
    for before, after in reversed(sign_changes(test)):
        if after == before + 1:
            tried = [(part, between(points[before], points[after], part)) for part in QUARTERS]
            kept = [(part, *found) for part, found in tried if found is not None and found[1] != 0]
            inner = np.reshape([point for _, point, _ in kept], (-1, points.shape[1]))
            step = places[after] - places[before]
            points = np.insert(points, after, inner, axis=0)
            test = np.insert(test, after, [value for *_, value in kept])
            places = np.insert(places, after, [places[before] + p * step for p, *_ in kept])
            rows = np.insert(rows, after, [before] * len(kept))
    return points, test, np.diff(places), rows


def solved(
    bracket: Bracket,
    between: Between,
    locate: Callable[[Array, Array, Array], T | None],
    *,
    first: int = 0,
    most: int = NARROWINGS,
) -> T | Bracket:
    """Locate the zero in a bracket, narrowed until Newton's method stays inside.

    Parameters
    ----------
    bracket : Bracket
    between : callable
    locate : callable
        Newton's method from a starting point, given the ends of the bracket; None if its solution
        is not between them.
    first, most : int
        Narrowings before the first trial, and in all.

    Returns
    -------
    The solution of ``locate``; if there is none, the bracket, narrowed to rounding or as far as
    the curve was computed.
    """
    (a, b), (f, g) = bracket.points, bracket.values
    # weights of the ends by the Illinois variant of regula falsi (Dowell & Jarratt 1971)
    weight_a = weight_b = 1.0
    side = 0
    for count in range(most):
        part = weight_a * f / (weight_a * f - weight_b * g)
        tried = count - first
        if tried >= 0:
            if tried < NARROWINGS_PER_TRIAL or tried.bit_count() == 1:
                located = locate(a + part * (b - a), a, b)
                if located is not None:
                    return located
            # regula falsi may retain one end
            part = 0.5 if count % 2 else part
        found = between(a, b, part)
        if found is None or not np.isfinite(found[1]):
            break
        if found[1] == 0:
            located = locate(found[0], a, b)
            zero = Bracket(bracket.row, (found[0], found[0]), (0.0, 0.0))
            return zero if located is None else located
        if np.all(found[0] == a) or np.all(found[0] == b):
            break
        if found[1] * f > 0:
            (a, f), weight_a = found, 1.0
            weight_b = weight_b * 0.5 if side == 1 else 1.0
            side = 1
        else:
            (b, g), weight_b = found, 1.0
            weight_a = weight_a * 0.5 if side == -1 else 1.0
            side = -1
    return Bracket(bracket.row, (a, b), (f, g))


def is_between(u: Array, a: Array, b: Array, scale: Array) -> bool:
    """Return whether a point is beside the chord of two points, in units of a scale."""
    chord = (b - a) / scale
    length = float(chord @ chord)
    gap = (u - a) / scale
    if length == 0 or not np.all(np.isfinite(gap)):
        return False
    part = float(gap @ chord) / length
    aside = float(np.linalg.norm(gap - part * chord))
    return -OUTSIDE <= part <= 1.0 + OUTSIDE and aside <= 0.5 * np.sqrt(length) + OUTSIDE


def sign_changes(test: Array) -> list[tuple[int, int]]:
    """Return the rows before and after every change of sign, with at most one zero between.

    Examples
    --------
    >>> sign_changes(np.array([1.0, -2.0, -1.0, 0.0, 3.0]))
    [(0, 1), (2, 4)]
    """
    known = np.flatnonzero(test != 0)
    signs = np.sign(test[known])
    changes = np.flatnonzero(signs[:-1] * signs[1:] < 0)
    pairs = [(int(known[k]), int(known[k + 1])) for k in changes]
    return [(before, after) for before, after in pairs if after - before <= 2]


def minima(test: Array, lengths: Array) -> list[int]:
    """Return rows after which a test without a change of sign may touch zero."""
    found = np.empty(len(lengths), dtype=np.int64)
    count = loop("possible_double_zeros")(writeable(test), lengths, MINIMUM_RATIO, found)
    rows: list[int] = found[:count].tolist()
    return rows


def _lowest(
    a: Array, b: Array, sign: float, between: Between, left: float, right: float
) -> tuple[Array, float] | None:
    """Minimize a test of one sign at two points between them; None where it is not computed.

    Brent's minimization of the modulus (1973, chapter 5), stopped as soon as the sign changes or
    the minimum is known not to be zero.
    """
    low, high = 0.0, 1.0
    # best, second and third best argument so far, with their values
    second, third = ((low, left), (high, right))[:: 1 if left <= right else -1]
    best = (float("nan"), np.inf)
    point = a
    step = earlier = np.inf
    place = 0.5
    for count in range(TEST_EVALUATIONS):
        found = between(a, b, place)
        if found is None or found[1] * sign < 0:
            return found
        here = (place, found[1] * sign)
        if count == 0:
            best, point = here, found[0]
        elif here[1] <= best[1]:
            low, high = (best[0], high) if place > best[0] else (low, best[0])
            best, second, third = here, best, second
            point = found[0]
        else:
            low, high = (low, place) if place > best[0] else (place, high)
            if here[1] <= second[1]:
                second, third = here, second
            elif here[1] <= third[1]:
                third = here
        x, f = best
        vertex, least = _parabola(best, second, third)
        if (count > 0 and abs(vertex - x) < MINIMUM_TOLERANCE) or (
            count > 2 and least > MINIMUM_RATIO * f
        ):
            break
        aimed = vertex - x
        if not low < vertex < high or abs(aimed) > 0.5 * earlier:
            aimed = (1.0 - GOLDEN) * ((high if high - x > x - low else low) - x)
            earlier = np.inf
        else:
            earlier = step
        step = max(abs(aimed), MINIMUM_TOLERANCE)
        place = x + float(np.copysign(step, aimed))
    return point, sign * best[1]


def _parabola(*points: tuple[float, float]) -> tuple[float, float]:
    """Vertex of the parabola through three points and its value; (∞, −∞) if degenerate."""
    (x, f), (y, g), (z, h) = points
    if len({x, y, z}) < 3:
        return np.inf, -np.inf
    first, second = (g - f) / (y - x), (h - f) / (z - x)
    bend = (second - first) / (z - y)
    if not bend > 0:
        return np.inf, -np.inf
    slope = first - bend * (y - x)
    return x - 0.5 * slope / bend, f - 0.25 * slope**2 / bend
