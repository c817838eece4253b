"""Location of zeros of test functions on a segment, including pairs within one step."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fastslow.continuation.location import Located
from fastslow.continuation.loops import loop, writeable
from fastslow.diagrams.field import FrozenField
from fastslow.diagrams.trace.across_regions import Segment, Window, on_normal_plane

Array = NDArray[np.float64]

#: Narrowings after which a bracket is at rounding.
NARROWINGS = 80

#: Narrowings before a trial of Newton's method, doubled after each trial because of its cost.
NARROWINGS_PER_TRIAL = 4

#: A minimum is computed if it may be below this fraction of the smallest value.
MINIMUM_RATIO = 0.5

#: Evaluations for one minimum of a test function.
TEST_EVALUATIONS = 40

#: Tolerance of a minimum as a fraction of the step; the error of the test is its square.
MINIMUM_TOLERANCE = 1e-8

#: Golden section, for bracketing a minimum where parabolic interpolation fails.
GOLDEN = 0.5 * (np.sqrt(5.0) - 1.0)


@dataclass(frozen=True, eq=False)
class Bracket:
    """Two points of a segment between which a test changes sign, after row ``row``."""

    row: int
    u: tuple[Array, Array]
    values: tuple[float, float]


@dataclass(frozen=True, eq=False)
class Search:
    """A test function on a segment.

    Parameters
    ----------
    field : FrozenField
    segment : Segment
    window : Window
    steps : ndarray, shape (N - 1,)
        Lengths of the steps between the rows, in units of the window.
    at : callable
        Function of a point u and the direction along the segment that returns the test.
    """

    field: FrozenField
    segment: Segment
    window: Window
    steps: Array
    at: Callable[[Array, Array], float]

    def between(self, a: Array, b: Array, part: float) -> tuple[Array, float] | None:
        """Return the point of the curve at a fraction of a chord, with its test."""
        chord = b - a
        guess = a + part * chord
        found = on_normal_plane(
            self.field, self.segment.region, guess, chord * self.window.weight, guess, self.window
        )
        return (found.u, self.at(found.u, chord)) if found.converged else None

    def brackets(self, test: Array) -> Iterator[Bracket]:
        """Yield changes of sign between neighbouring rows (or across a zero), and around minima."""
        u = self.segment.u
        for before, after in sign_changes(test):
            yield Bracket(before, (u[before], u[after]), (test[before], test[after]))
        for row in minima(test, self.steps):
            yield from self._around_minimum(row, test)

    def _around_minimum(self, row: int, test: Array) -> Iterator[Bracket]:
        """Yield two changes of sign around a minimum of the modulus after a row, if any."""
        a, b, sign = self.segment.u[row], self.segment.u[row + 1], float(np.sign(test[row]))

        def value(part: float) -> tuple[Array, float] | None:
            found = self.between(a, b, part)
            return None if found is None else (found[0], found[1] * sign)

        lowest = _negative(value, float(abs(test[row])), float(abs(test[row + 1])))
        if lowest is not None:
            point, at = lowest
            yield Bracket(row, (a, point), (test[row], at * sign))
            yield Bracket(row, (point, b), (at * sign, test[row + 1]))

    def solve(
        self, bracket: Bracket, locate: Callable[[Array], Located], *, narrowings: int = 0
    ) -> Located | None:
        """Locate the special point in a bracket, narrowed until Newton's method stays inside.

        If Newton's method always fails, the bracket is narrowed to rounding.

        Parameters
        ----------
        bracket : Bracket
        locate : callable
            Newton's method for the point, from a starting point u.
        narrowings : int
            Narrowings before the first attempt.

        Returns
        -------
        Located or None
            None if the test changes sign by a discontinuity.
        """
        (a, b), (f, g) = bracket.u, bracket.values
        size = min(abs(f), abs(g))
        # weights of the ends by the Illinois variant of regula falsi (Dowell & Jarratt 1971)
        weight_a = weight_b = 1.0
        side = 0
        for count in range(NARROWINGS):
            part = weight_a * f / (weight_a * f - weight_b * g)
            tried = count - narrowings
            if tried >= 0:
                if tried < NARROWINGS_PER_TRIAL or tried.bit_count() == 1:
                    located = locate(a + part * (b - a))
                    if located.converged and self._inside(located.u, a, b):
                        return located
                # regula falsi may retain one end
                part = 0.5 if count % 2 else part
            found = self.between(a, b, part)
            if found is None:
                break
            if found[1] == 0:
                located = locate(found[0])
                good = located.converged and self._inside(located.u, a, b)
                return located if good else self._at_rounding(found[0], 0.0)
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
        return self._narrowed(a, b, f, g, size)

    def _narrowed(self, a: Array, b: Array, f: float, g: float, size: float) -> Located | None:
        """Return the middle of a bracket at rounding; None if the test is discontinuous in it."""
        length = float(np.abs((b - a) / self.window.scale).max())
        if length > 1e-9 or min(abs(f), abs(g)) > 1e-3 * size:
            return None
        return self._at_rounding(a + f / (f - g) * (b - a), length)

    def _at_rounding(self, u: Array, length: float) -> Located:
        rates, _ = self.field.residual_and_jacobian(self.segment.region, u)
        return Located(u, float(np.abs(rates).max()), True, np.empty(0), length)

    def _inside(self, u: Array, a: Array, b: Array) -> bool:
        chord = (b - a) / self.window.scale
        length = float(chord @ chord)
        gap = (u - a) / self.window.scale
        if length == 0 or not np.all(np.isfinite(gap)):
            return False
        part = float(gap @ chord) / length
        aside = float(np.linalg.norm(gap - part * chord))
        return -1e-9 <= part <= 1.0 + 1e-9 and aside <= 0.5 * np.sqrt(length) + 1e-9


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


def minima(test: Array, steps: Array) -> list[int]:
    """Return rows after which a test without a change of sign may touch zero."""
    found = np.empty(len(steps), dtype=np.int64)
    count = loop("possible_double_zeros")(writeable(test), steps, MINIMUM_RATIO, found)
    rows: list[int] = found[:count].tolist()
    return rows


def _negative(
    value: Callable[[float], tuple[Array, float] | None], left: float, right: float
) -> tuple[Array, float] | None:
    """Find a point between 0 and 1 at which a function with positive end values is negative.

    Brent's minimization (1973, chapter 5), stopped as soon as the function is negative or its
    minimum is known to be positive.
    """
    low, high = 0.0, 1.0
    # best, second and third best argument so far, with their values
    second, third = ((low, left), (high, right))[:: 1 if left <= right else -1]
    best = (float("nan"), np.inf)
    step = earlier = np.inf
    place = 0.5
    for count in range(TEST_EVALUATIONS):
        found = value(place)
        if found is None or found[1] < 0:
            return found
        here = (place, found[1])
        if count == 0:
            best = here
        elif here[1] <= best[1]:
            low, high = (best[0], high) if place > best[0] else (low, best[0])
            best, second, third = here, best, second
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
            return None
        aimed = vertex - x
        if not low < vertex < high or abs(aimed) > 0.5 * earlier:
            aimed = (1.0 - GOLDEN) * ((high if high - x > x - low else low) - x)
            earlier = np.inf
        else:
            earlier = step
        step = max(abs(aimed), MINIMUM_TOLERANCE)
        place = x + float(np.copysign(step, aimed))
    return None


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
