"""Detection and location of special points on a segment."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from fastslow.continuation.marks import Mark
from fastslow.diagrams.field import FrozenField
from fastslow.diagrams.points.kinds import ON_BRANCHES
from fastslow.diagrams.points.marked_points import MarkedKind
from fastslow.diagrams.points.on_branches import Detected, SegmentSurvey
from fastslow.diagrams.segments import BranchSegment, Window
from fastslow.diagrams.trace.divided_steps import divided, resolved
from fastslow.results.branch.unexplained import unexplained_rows

Array = NDArray[np.float64]

#: Divisions of steps whose special points do not explain the change of the number of unstable
#: eigenvalues: neutral saddles may mask a Hopf point.
DIVISIONS = 12

#: Distance in units of the window from a branch point, below which an extremum of the parameter is
#: no fold.
NEAR_BRANCH_POINT = 1e-4


@np.errstate(all="ignore")
def special_points(
    field: FrozenField,
    segment: BranchSegment,
    window: Window,
    marks: Sequence[Mark],
    *,
    opening: bool = True,
) -> tuple[list[Detected], BranchSegment, NDArray[np.complex128]]:
    """Locate all special points of a segment, in order along it.

    Parameters
    ----------
    opening : bool
        Whether the first row belongs to no other segment.

    Returns
    -------
    found : list of Detected
    segment : BranchSegment
        The segment, with rows added in steps that contain several points.
    eigenvalues : ndarray of complex
        Finite eigenvalues at its rows.
    """
    survey = resolved(field, segment, window)
    found = _between_rows(survey, marks, opening)
    for _ in range(DIVISIONS):
        segment = survey.segment
        # backwards, so that the numbers of the preceding rows do not change
        for first, last in reversed(_unexplained(survey, found)):
            segment = divided(field, segment, window, first, last)
        if len(segment.u) == len(survey.segment.u):
            break
        survey = resolved(field, segment, window)
        found = _between_rows(survey, marks, opening)
    return found, survey.segment, survey.rows.eigenvalues


def _unexplained(survey: SegmentSurvey, found: Sequence[Detected]) -> list[tuple[int, int]]:
    """Return pairs of rows with an unexplained change of the number of unstable eigenvalues."""
    low, high = survey.unstable
    known = [d for d in found if d.kind.record.changes_stability]
    # a row for every point, at which the number is undetermined
    places = [d.row + 1 for d in known]
    row_of = np.insert(np.arange(len(low)), places, -1)
    points = np.flatnonzero(row_of < 0).tolist()
    steps = {k: [d.kind.record.unstable] for k, d in zip(points, known, strict=True)}
    rows = unexplained_rows(np.insert(low, places, 0), np.insert(high, places, high.max()), steps)
    return [(int(row_of[since]), int(row_of[row])) for since, row in rows]


def _between_rows(survey: SegmentSurvey, marks: Sequence[Mark], opening: bool) -> list[Detected]:
    """Locate all special points of a segment, in order along it."""
    segment, window = survey.segment, survey.window
    found = [
        *(point for kind in ON_BRANCHES for point in kind.detected(survey)),
        *(d for m in marks for d in MarkedKind.given(m).detected(survey, opening=opening)),
    ]
    found = [d for d in found if _between(d.located.u, segment, d.row, window)]
    # at a branch point the parameter may have an extremum without a fold
    crossings = [d.located.u for d in found if d.kind.record.branching]
    found = [
        d
        for d in found
        if not d.kind.record.turning
        or all(
            np.abs((d.located.u - c) / window.scale).max() > NEAR_BRANCH_POINT for c in crossings
        )
    ]
    return sorted(
        found,
        key=lambda d: (d.row, not d.at_row, _ahead(d.located.u, segment, d.row, window)),
    )


def _ahead(u: Array, segment: BranchSegment, row: int, window: Window) -> float:
    return float(((u - segment.u[row]) * window.weight) @ segment.tangents[row])


def _between(u: Array, segment: BranchSegment, row: int, window: Window) -> bool:
    """Return whether a solution is near the rows that bracket it."""
    if not np.all(np.isfinite(u)):
        return False
    here = segment.u[row]
    there = segment.u[min(row + 2, len(segment.u) - 1)]
    length = float(np.linalg.norm((there - here) / window.scale))
    return float(np.linalg.norm((u - here) / window.scale)) <= 2.0 * length
