"""Rows of a branch of orbits that repeat earlier ones.

A branch that turns back without a fold, because the sign of its tangent was decided by rounding,
returns through its own orbits. In the space of the parameter, the period and the extremes of the
states its rows then lie on the polyline of earlier rows, one after another. What lies there is
compared with an orbit solved for between the earlier rows: two sheets of a branch may be close.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from fastslow.continuation.settings import Continuation
from fastslow.orbits.find.orbit_curve import CurveSystem, OrbitCurve, Row

Array = NDArray[np.float64]

#: Distance of a repeated row from the polyline of earlier rows, and from the orbit that is solved
#: for there, as fractions of the distance of the earlier rows.
ON_LINE, RETRACED_DISTANCE = 0.05, 1e-3

#: Orbits solved for in turn at places nearer to the row.
RETRACING_TRIALS = 4

#: Cosine of the angle between two steps of the same curve.
SAME_DIRECTION = 0.9

#: Rows before one of which it is no repetition, and number of successive repetitions.
BEHIND, REPEATED_ROWS = 3, 3


@dataclass(eq=False)
class Retracing:
    """The rows of a branch, in which repetitions are found.

    Parameters
    ----------
    curve : OrbitCurve
    settings : Continuation
    before : sequence of Row
        Rows of the other direction, in order along the branch.
    """

    curve: OrbitCurve
    settings: Continuation
    before: Sequence[Row] = ()
    places: Array = field(default_factory=lambda: np.empty((0, 0)))
    repeated: int = 0

    def first_repeated(self, rows: Sequence[Row]) -> int | None:
        """Number of the first row that repeats earlier ones, None without repetition.

        Parameters
        ----------
        rows : sequence of Row
            All rows of this direction; called after each of them.
        """
        known, first = [*self.before, *rows], len(self.before)
        kept = self.places[: len(known) - 1]
        new = np.array([self._place(row) for row in known[len(kept) :]])
        self.places = np.concatenate([kept, new]) if len(kept) else new
        points = self.places / self._units(rows[-1])
        last = len(points) - 1
        met = _on_line(points, last, last - BEHIND)
        self.repeated = 0 if met is None else self.repeated + 1
        if met is None or self.repeated < REPEATED_ROWS or not self._is_same(known, points, *met):
            return None
        turned = last - REPEATED_ROWS + 1
        while turned > first + 1 and _on_line(points, turned - 1, turned - 2) is not None:
            turned -= 1
        return turned - first

    def _place(self, row: Row) -> Array:
        """Parameter, period, and the extremes of the states of an orbit."""
        # infinite for a homoclinic orbit
        period = min(row.arrays.period, np.finfo(float).max ** 0.25)
        return np.concatenate([[row.value, period], *row.extremes])

    def _units(self, row: Row) -> Array:
        width = self.curve.over[1] - self.curve.over[0]
        return np.concatenate([[width, row.arrays.period], row.sizes, row.sizes])

    def _is_same(self, rows: Sequence[Row], points: Array, number: int, share: float) -> bool:
        """Check whether the last row is the orbit at a fraction of the way between two rows."""
        one, two, last = rows[number], rows[number + 1], rows[-1]
        if not one.continues(two):
            return False
        gap = two.u - one.u
        frame = self.curve.frame(one.shooting, one.u, one.arrays)
        along, units = gap / np.sqrt(gap**2 @ frame.weight), self._units(last)
        system = CurveSystem(one.shooting)
        chord, step = points[number + 1] - points[number], points[-1] - points[-2]
        square = float(chord @ chord)
        near = RETRACED_DISTANCE * min(np.sqrt(square), float(np.linalg.norm(step)))
        for _ in range(RETRACING_TRIALS):
            system.solved(one.u + share * gap, along, frame, self.settings)
            found = system.point
            row = None if found is None else self.curve.confirmed(one.shooting, found)
            if row is None:
                return False
            off = points[-1] - self._place(row) / units
            ahead = float(off @ chord) / square
            if np.linalg.norm(off) <= near:
                return self._has_state_of(row, last)
            if np.linalg.norm(off - ahead * chord) > np.sqrt(near * np.sqrt(square)):
                return False
            share += ahead
        return False

    def _has_state_of(self, one: Row, two: Row) -> bool:
        """Check two orbits that a symmetry may map to each other: the phase of the forcing."""
        if self.curve.problem.forcing is None:
            return True
        gap = np.abs(one.orbit(0.0) - two.orbit(0.0))
        return bool((gap <= RETRACED_DISTANCE * two.sizes).all())


def _on_line(points: Array, number: int, count: int) -> tuple[int, float] | None:
    """Place of a point on the polyline of the first points, if it is there and moves along it.

    Parameters
    ----------
    points : ndarray, shape (N, d)
    number : int
        Of the point.
    count : int
        Number of the points of the polyline.

    Returns
    -------
    tuple of (int, float), optional
        Number of the segment, and fraction of its length.
    """
    if count < 2:
        return None
    step = points[number] - points[number - 1]
    chords = np.diff(points[:count], axis=0)
    lengths = np.linalg.norm(chords, axis=1)
    safe = np.where(lengths > 0.0, lengths, 1.0)
    gaps = points[number] - points[: count - 1]
    shares = np.clip((gaps * chords).sum(axis=1) / safe**2, 0.0, 1.0)
    off = np.linalg.norm(gaps - shares[:, None] * chords, axis=1)
    aligned = np.abs(chords @ step) >= SAME_DIRECTION * lengths * np.linalg.norm(step)
    near = (lengths > 0.0) & aligned & (off <= ON_LINE * lengths)
    if not near.any():
        return None
    found = int(np.argmin(np.where(near, off / safe, np.inf)))
    return found, float(shares[found])
