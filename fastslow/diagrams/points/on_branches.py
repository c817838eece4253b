"""What the kinds of special points that are found along a branch have in common.

A kind has a test function, dimensionless and zero at its points, which is evaluated at the rows of
a segment and between them. It locates the point in a bracket, confirms it and adds its normal form.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from fastslow.continuation import zeros
from fastslow.continuation.location import Located
from fastslow.continuation.point_kinds import PointKind
from fastslow.continuation.zeros import Between, Bracket, brackets, is_between
from fastslow.diagrams.field import FrozenField
from fastslow.diagrams.segments import BranchSegment, Window, on_normal_plane, oriented_tangent
from fastslow.diagrams.two_folds import on_two_fold
from fastslow.results.branch.unexplained import unstable_range

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]
Counts = NDArray[np.intp]

#: A test function at a point u, given the direction along the segment.
Test = Callable[[Array, Array], float]

#: A bracket at rounding is not longer than this, in units of the window, and the test there is
#: below this fraction of its values at the first ends, unless it is discontinuous.
SHORTEST_BRACKET, CONTINUOUS_TEST = 1e-9, 1e-3

#: Number of points of a segment whose eigenvalues are kept.
SPECTRA_KEPT = 64


def mostly(rows: NDArray[np.bool_]) -> bool:
    """Return whether more than half of some rows are true."""
    return bool(2 * np.count_nonzero(rows) > len(rows))


@dataclass(frozen=True, eq=False)
class SurveyedRows:
    """What the tests at rows are computed from.

    Parameters
    ----------
    turning : ndarray, shape (N,)
        Parameter component of the tangent.
    branching : ndarray, shape (N,)
        Distance of [F_x F_p; tangent] from singularity with the sign of its determinant, relative
        to its rows.
    eigenvalues : ndarray of complex, shape (N, n)
        Finite eigenvalues.
    undefined : ndarray of bool, shape (N,)
        Rows on a two-fold, where there are no tests.
    """

    turning: Array
    branching: Array
    eigenvalues: Complex
    undefined: NDArray[np.bool_]

    def inserted(self, place: int, other: SurveyedRows) -> SurveyedRows:
        """Insert other rows before a row."""
        return SurveyedRows(
            np.insert(self.turning, place, other.turning),
            np.insert(self.branching, place, other.branching),
            np.insert(self.eigenvalues, place, other.eigenvalues, axis=0),
            np.insert(self.undefined, place, other.undefined),
        )


@dataclass(frozen=True, eq=False)
class SegmentSurvey:
    """A segment with the tests of some kinds at its rows.

    Parameters
    ----------
    field : FrozenField
    segment : BranchSegment
    window : Window
    rows : SurveyedRows
    vanishing : mapping
        Whether the test of each kind is zero to rounding at most rows of the segment.
    tests : mapping
        The test of each kind at the rows, 0 where it is zero to rounding or undefined.
    unstable : tuple of ndarray
        The smallest and largest number of unstable eigenvalues at the rows.
    """

    field: FrozenField
    segment: BranchSegment
    window: Window
    rows: SurveyedRows
    vanishing: Mapping[OnBranches, bool]
    tests: Mapping[OnBranches, Array]
    unstable: tuple[Counts, Counts]

    @classmethod
    def of(
        cls,
        frozen: FrozenField,
        segment: BranchSegment,
        window: Window,
        kinds: Sequence[OnBranches],
    ) -> SegmentSurvey:
        """Evaluate the tests of some kinds at the rows of a segment."""
        rows = surveyed(frozen, segment, window)
        vanishing = {kind: kind.vanishes(rows) for kind in kinds}
        tests = {kind: kind.at_rows(rows, vanishing[kind]) for kind in kinds}
        unstable = unstable_range(rows.eigenvalues)
        return cls(frozen, segment, window, rows, vanishing, tests, unstable)

    def with_row(self, place: int, extra: BranchSegment, whole: BranchSegment) -> SegmentSurvey:
        """Insert a row, itself a segment, before another one; ``whole`` is the segment with it."""
        new = surveyed(self.field, extra, self.window)
        low, high = unstable_range(new.eigenvalues)
        return replace(
            self,
            segment=whole,
            rows=self.rows.inserted(place, new),
            tests={
                kind: np.insert(test, place, kind.at_rows(new, self.vanishing[kind]))
                for kind, test in self.tests.items()
            },
            unstable=(
                np.insert(self.unstable[0], place, low),
                np.insert(self.unstable[1], place, high),
            ),
        )

    @cached_property
    def steps(self) -> Array:
        """Lengths of the steps between the rows, in units of the window."""
        return self.segment.chords(self.window.scale)

    def curve(self, u: Array) -> tuple[Array, Array]:
        """F and its Jacobian at a point."""
        return self.field.residual_and_jacobian(self.segment.region, u)

    def tangent(self, u: Array, along: Array) -> Array:
        """The unit tangent at a point, oriented along a direction."""
        return oriented_tangent(self.field, self.segment.region, u, along, self.window)

    def eigenvalues(self, u: Array) -> Complex:
        """The finite eigenvalues at a point."""
        return self._spectrum(u.tobytes())

    @cached_property
    def _spectrum(self) -> Callable[[bytes], Complex]:
        """The finite eigenvalues at a point; several kinds of points need them at the same ones."""
        field, region = self.field, self.segment.region
        return lru_cache(SPECTRA_KEPT)(lambda u: field.finite_eigenvalues(region, np.frombuffer(u)))

    def between(self, test: Test) -> Between:
        """Return the function that computes a point on a chord, with its test."""

        def point(a: Array, b: Array, part: float) -> tuple[Array, float] | None:
            chord = b - a
            guess, normal = a + part * chord, chord * self.window.weight
            found = on_normal_plane(
                self.field, self.segment.region, guess, normal, guess, self.window
            )
            return (found.u, test(found.u, chord)) if found.converged else None

        return point

    def brackets(self, values: Array, test: Test) -> Iterator[Bracket]:
        """Yield the brackets of the zeros of a test, given its values at the rows."""
        return brackets(self.segment.u, values, self.steps, self.between(test))

    def solved(
        self,
        bracket: Bracket,
        test: Test,
        locate: Callable[[Array], Located],
        *,
        first: int = 0,
    ) -> Located | None:
        """Locate the special point in a bracket; None if the test is discontinuous there.

        If Newton's method always fails, the bracket is narrowed to rounding.

        Parameters
        ----------
        bracket : Bracket
        test : callable
        locate : callable
            Newton's method for the point, from a starting point u.
        first : int
            Narrowings before the first trial.
        """
        scale = self.window.scale

        def inside(guess: Array, a: Array, b: Array) -> Located | None:
            found = locate(guess)
            return found if found.converged and is_between(found.u, a, b, scale) else None

        found = zeros.solved(bracket, self.between(test), inside, first=first)
        if isinstance(found, Located):
            return found
        (a, b), (f, g) = found.points, found.values
        length, size = float(np.abs((b - a) / scale).max()), min(map(abs, bracket.values))
        if length > SHORTEST_BRACKET or min(abs(f), abs(g)) > CONTINUOUS_TEST * size:
            return None
        return self.at_rounding(a + f / (f - g) * (b - a) if f != g else a, length)

    def at_rounding(self, u: Array, length: float = 0.0) -> Located:
        """Return a point known to the length of a bracket."""
        return Located(u, float(np.abs(self.curve(u)[0]).max()), True, np.empty(0), length)


def surveyed(frozen: FrozenField, segment: BranchSegment, window: Window) -> SurveyedRows:
    """Compute what the tests at the rows of a segment need."""
    turning, branching, eigenvalues = frozen.survey(
        segment.region, segment.u, segment.tangents, window.scale
    )
    undefined = on_two_fold(frozen, segment.region, segment.u, window.scale)
    eigenvalues = np.where(undefined[:, None], np.nan, eigenvalues)
    return SurveyedRows(turning, branching, eigenvalues, undefined)


@dataclass(frozen=True, eq=False)
class Detected:
    """A special point after row ``row`` of a segment, or at it.

    Parameters
    ----------
    row : int
    kind : PointKind
    located : Located
    at_row : bool
    type : str, optional
    note : str
    form : mapping
        Its normal form, by entries of a special point.
    """

    row: int
    kind: PointKind
    located: Located
    at_row: bool = False
    type: str | None = None
    note: str = ""
    form: Mapping[str, Any] = field(default_factory=dict)


class OnBranches(PointKind, ABC):
    """Base class: special points that are found along a branch by a test function."""

    #: Changes of the number of unstable eigenvalues that a zero of the test can make.
    changes: ClassVar[tuple[int, ...]]

    #: What is said of a branch along which the test vanishes.
    identical: ClassVar[str] = ""

    def vanishes(self, rows: SurveyedRows) -> bool:
        """Return whether the test is zero to rounding at most rows: it then has no zeros."""
        return False

    @abstractmethod
    def at_rows(self, rows: SurveyedRows, vanishing: bool) -> Array:
        """Return the test at rows, 0 where it is zero to rounding or undefined."""

    @abstractmethod
    def test(self, survey: SegmentSurvey) -> Test:
        """Return the test between the rows of a segment."""

    @abstractmethod
    def located(self, survey: SegmentSurvey, bracket: Bracket) -> Iterator[Detected]:
        """Locate and confirm the point in a bracket, if there is one."""

    def detected(self, survey: SegmentSurvey) -> Iterator[Detected]:
        """Locate all points of a segment."""
        for bracket in survey.brackets(survey.tests[self], self.test(survey)):
            yield from self.located(survey, bracket)
