"""Where test functions vanish between the rows of a piece, pairs within one step included."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fastslow.continuation.location import Located
from fastslow.diagrams.fields import FrozenField
from fastslow.diagrams.walking import Piece, Window, beside

Array = NDArray[np.float64]

#: Halvings of a bracket before the solution outside of it is taken.
HALVINGS = 50

#: A dip is looked into where its parabola leaves less than this part of the smallest value.
DIP = 0.3


@dataclass(frozen=True, eq=False)
class Bracket:
    """Two points of a piece between which a test changes sign, after row ``row``."""

    row: int
    u: tuple[Array, Array]
    values: tuple[float, float]


@dataclass(frozen=True, eq=False)
class Search:
    """A test function on a piece.

    Parameters
    ----------
    field : FrozenField
    piece : Piece
    window : Window
    at : callable
        A point u and the direction along the piece to the test there.
    """

    field: FrozenField
    piece: Piece
    window: Window
    at: Callable[[Array, Array], float]

    def between(self, a: Array, b: Array, part: float) -> tuple[Array, float] | None:
        """The point of the curve above a part of a chord, with its test."""
        chord = b - a
        guess = a + part * chord
        found = beside(
            self.field, self.piece.region, guess, chord * self.window.weight, guess, self.window
        )
        return (found.u, self.at(found.u, chord)) if found.converged else None

    def brackets(self, test: Array) -> Iterator[Bracket]:
        """Changes of sign between rows next to each other but for one zero, and within dips."""
        u = self.piece.u
        known = np.flatnonzero(test != 0)
        signs = np.sign(test[known])
        for k in np.flatnonzero(signs[:-1] * signs[1:] < 0):
            before, after = int(known[k]), int(known[k + 1])
            if after - before <= 2:
                yield Bracket(before, (u[before], u[after]), (test[before], test[after]))
        for row in _dips(test):
            yield from self._dip(row, test)

    def _dip(self, row: int, test: Array) -> Iterator[Bracket]:
        """Two changes of sign beside a row at which the test is smallest, if there are."""
        u, sign = self.piece.u, np.sign(test[row])
        for a, b in ((row - 1, row), (row, row + 1)):
            inner = self._lowest(u[a], u[b], float(test[a]), float(test[b]), sign)
            if inner is not None:
                yield Bracket(a, (u[a], inner[0]), (test[a], inner[1]))
                yield Bracket(a, (inner[0], u[b]), (inner[1], test[b]))
                return

    def _lowest(
        self, a: Array, b: Array, at_a: float, at_b: float, sign: float
    ) -> tuple[Array, float] | None:
        """A point between two at which the test has the other sign, None if none is found."""
        low, high, f_low, f_high = 0.0, 1.0, at_a * sign, at_b * sign
        middle = self.between(a, b, 0.5)
        for _ in range(12):
            if middle is None:
                return None
            if middle[1] * sign < 0:
                return middle
            part = 0.5 * (low + high)
            f = middle[1] * sign
            if f >= max(f_low, f_high):
                return None
            # the parabola through both ends and the middle
            bend = 2.0 * (f_low + f_high - 2.0 * f)
            slope = f_high - f_low
            least = f - slope**2 / (8.0 * bend) * 2.0 if bend > 0 else min(f_low, f_high)
            if bend <= 0 or least > DIP * f:
                return None
            best = float(np.clip(0.5 - slope / (2.0 * bend), 0.02, 0.98))
            place = low + best * (high - low)
            found = self.between(a, b, place)
            if found is None or found[1] * sign < 0:
                return found
            if place < part:
                high, f_high = part, f
            else:
                low, f_low = part, f
            middle = self.between(a, b, 0.5 * (low + high))
        return None

    def solve(self, bracket: Bracket, locate: Callable[[Array], Located]) -> Located:
        """The special point within a bracket, which is halved until Newton's method stays in it."""
        (a, b), (f, g) = bracket.u, bracket.values
        first: Located | None = None
        for _ in range(HALVINGS):
            located = locate(a + f / (f - g) * (b - a))
            if first is None:
                first = located
            if located.converged and self._inside(located.u, a, b):
                return located
            middle = self.between(a, b, 0.5)
            if middle is None or middle[1] == 0:
                break
            if middle[1] * f > 0:
                a, f = middle
            else:
                b, g = middle
        assert first is not None
        return first

    def _inside(self, u: Array, a: Array, b: Array) -> bool:
        chord = (b - a) / self.window.scale
        length = float(chord @ chord)
        gap = (u - a) / self.window.scale
        if length == 0 or not np.all(np.isfinite(gap)):
            return False
        part = float(gap @ chord) / length
        aside = float(np.linalg.norm(gap - part * chord))
        return -0.05 <= part <= 1.05 and aside <= 0.5 * np.sqrt(length) + 1e-9


def _dips(test: Array) -> list[int]:
    """Rows at which a test comes near to zero and turns: the parabola through three says so."""
    if len(test) < 3:
        return []
    size = np.abs(test)
    before, here, after = size[:-2], size[1:-1], size[2:]
    alike = (test[:-2] * test[1:-1] > 0) & (test[1:-1] * test[2:] > 0)
    bend, slope = before + after - 2.0 * here, 0.5 * (after - before)
    low: NDArray[np.bool_] = alike & (here <= before) & (here <= after) & (bend > 0)
    least = here - slope**2 / np.where(bend > 0, 2.0 * bend, 1.0)
    return [int(k) + 1 for k in np.flatnonzero(low & (least < 0.5 * here))]
