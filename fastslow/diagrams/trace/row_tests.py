"""Test functions of special points at the rows of a segment, and division of steps.

All tests are dimensionless: a pair sum is relative to its pair, the distance of a matrix from
singularity to its rows.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from fastslow.diagrams.eigenvalue_pairs import pair_sums
from fastslow.diagrams.field import FrozenField
from fastslow.diagrams.trace.across_regions import Segment, Window, on_normal_plane
from fastslow.diagrams.trace.brackets import sign_changes
from fastslow.diagrams.two_folds import on_two_fold
from fastslow.results.branch.unexplained import unstable_range

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]

#: Distance from singularity below which a matrix with unit rows is singular to rounding.
SINGULAR_DISTANCE = 1e-14

#: Relative sum of two eigenvalues, and distance from singularity, that are zero to rounding where
#: most rows of a segment are below: the eigenvalues of a pair differ by rounding of the rates.
ALIKE, PAIR_ROUNDING = 1e-9, 1e-11

#: Largest number of rows added to a segment, and shortest step divided, in scaled units.
ADDED, SHORTEST_DIVIDED = 400, 1e-10


@dataclass(frozen=True, eq=False)
class RowTests:
    """Test functions at the rows of a segment, each of shape (N,).

    Parameters
    ----------
    turning : ndarray
        Parameter component of the tangent, zero at folds.
    branching : ndarray
        Distance of [F_x F_p; tangent] from singularity with the sign of its determinant, zero
        at branch points.
    pairs : ndarray
        `pair_sums`, zero at Hopf points and neutral saddles.
    eigenvalues : ndarray of complex, shape (N, n)
        Finite eigenvalues.
    alike : float
        Relative sum below which a pair is left out, positive if one vanishes along the segment.
    """

    turning: Array
    branching: Array
    pairs: Array
    eigenvalues: Complex
    alike: float

    @cached_property
    def unstable(self) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """Return the smallest and largest number of unstable eigenvalues at the rows."""
        return unstable_range(self.eigenvalues)

    def inserted(self, place: int, other: RowTests) -> RowTests:
        """Insert the rows of another table before a row."""
        return RowTests(
            np.insert(self.turning, place, other.turning),
            np.insert(self.branching, place, other.branching),
            np.insert(self.pairs, place, other.pairs),
            np.insert(self.eigenvalues, place, other.eigenvalues, axis=0),
            self.alike,
        )


def mostly(rows: NDArray[np.bool_]) -> bool:
    """Return whether more than half of some rows are true."""
    return bool(2 * np.count_nonzero(rows) > len(rows))


def vanishing_sums(eigenvalues: Complex) -> NDArray[np.bool_]:
    """Return at which rows the sum of two finite eigenvalues is zero to rounding."""
    sums = pair_sums(eigenvalues, rounding=0.0)
    finite = np.isfinite(eigenvalues).all(axis=-1) & (np.shape(eigenvalues)[-1] > 1)
    return np.asarray(finite & (np.abs(sums) < ALIKE))


def tests_at(
    field: FrozenField, segment: Segment, window: Window, whole: RowTests | None
) -> RowTests:
    """Evaluate the tests at every row of a segment; there are none on a two-fold.

    A test that is zero to rounding at most rows has no zeros to be located. For rows added to
    a segment, ``whole`` are its tests, otherwise None.
    """
    turning, branching, eigenvalues = field.survey(
        segment.region, segment.u, segment.tangents, window.scale
    )
    undefined = on_two_fold(field, segment.region, segment.u, window.scale)
    eigenvalues = np.where(undefined[:, None], np.nan, eigenvalues)
    if whole is None:
        alike = ALIKE if mostly(vanishing_sums(eigenvalues)) else 0.0
        least = np.inf if mostly(np.abs(branching) < PAIR_ROUNDING) else SINGULAR_DISTANCE
    else:
        alike = whole.alike
        least = SINGULAR_DISTANCE if whole.branching.any() else np.inf
    return RowTests(
        turning,
        np.where((np.abs(branching) < least) | undefined, 0.0, branching),
        pair_sums(eigenvalues, alike=alike),
        eigenvalues,
        alike,
    )


def resolved(field: FrozenField, segment: Segment, window: Window) -> tuple[Segment, RowTests]:
    """Divide steps until the tests explain the number of unstable eigenvalues.

    Between two rows this number changes by one at a fold or branch point and by two at a Hopf
    point. If the changes of sign do not add up, some of them cancel within the step.
    """
    tests = tests_at(field, segment, window, None)
    low, high = tests.unstable
    known = np.flatnonzero(low == high)
    # nothing to explain without changes and without folds
    turning = np.isin(
        np.arange(len(low)), [k for pair in sign_changes(tests.turning) for k in pair]
    )
    turned = np.append(0, np.cumsum(turning))
    first, last = known[:-1], known[1:]
    open_steps = (low[first] != low[last]) | (turned[last + 1] - turned[first] > 1)
    waiting = list(zip(first[open_steps].tolist(), last[open_steps].tolist(), strict=True))[::-1]
    added = 0
    while waiting:
        first, last = waiting.pop()
        change = int(low[last]) - int(low[first])
        if added >= ADDED or _explains(tests, slice(first, last + 1), change):
            continue
        place, extra = _middle(field, segment, window, first, last)
        if extra is None:
            continue
        added += 1
        new = tests_at(field, extra, window, tests)
        tests = tests.inserted(place, new)
        low, high = np.insert(low, place, new.unstable[0]), np.insert(high, place, new.unstable[1])
        segment = _inserted(segment, place, extra)
        # the remaining pairs are after this one
        waiting = [(a + 1, b + 1) for a, b in waiting]
        if low[place] == high[place]:
            waiting += [(place, last + 1), (first, place)]
        else:
            waiting.append((first, last + 1))
    return segment, tests


def _explains(tests: RowTests, rows: slice, change: int) -> bool:
    """Return whether the changes of sign among rows can add up to a change of the number."""
    possible = {0}
    for test, steps in ((tests.turning, (-1, 1)), (tests.branching, (-1, 0, 1))):
        for _ in sign_changes(test[rows]):
            possible = {p + s for p in possible for s in steps}
    for _ in sign_changes(tests.pairs[rows]):
        possible = {p + s for p in possible for s in (-2, 0, 2)}
    return change in possible


def divided(field: FrozenField, segment: Segment, window: Window, first: int, last: int) -> Segment:
    """Insert a row in the middle of the longest step between two rows, if one is found."""
    place, extra = _middle(field, segment, window, first, last)
    return segment if extra is None else _inserted(segment, place, extra)


def _inserted(segment: Segment, place: int, extra: Segment) -> Segment:
    return replace(
        segment,
        u=np.insert(segment.u, place, extra.u, axis=0),
        tangents=np.insert(segment.tangents, place, extra.tangents, axis=0),
    )


def _middle(
    field: FrozenField, segment: Segment, window: Window, first: int, last: int
) -> tuple[int, Segment | None]:
    """Return a row in the middle of the longest step between two, and its index.

    None if the step is too short or no point of the curve is found.
    """
    chords = np.linalg.norm(np.diff(segment.u[first : last + 1], axis=0) / window.scale, axis=1)
    before = first + int(np.argmax(chords))
    if not chords.max() > SHORTEST_DIVIDED:
        return before + 1, None
    a, b = segment.u[before], segment.u[before + 1]
    guess, chord = 0.5 * (a + b), (b - a) * window.weight
    found = on_normal_plane(field, segment.region, guess, chord, guess, window)
    if not found.converged:
        return before + 1, None
    tangent, single = field.tangent(segment.region, found.u, window.weight)
    if not single:
        tangent = segment.tangents[before]
    elif tangent @ chord < 0:
        tangent = -tangent
    return before + 1, Segment(segment.region, found.u[None], tangent[None])
