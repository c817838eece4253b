"""Division of steps until the tests at the rows explain the number of unstable eigenvalues."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from fastslow.continuation.zeros import sign_changes
from fastslow.diagrams.field import FrozenField
from fastslow.diagrams.points.kinds import ON_BRANCHES
from fastslow.diagrams.points.on_branches import SegmentSurvey
from fastslow.diagrams.segments import BranchSegment, Window, on_normal_plane

Array = NDArray[np.float64]

#: Largest number of rows added to a segment, and shortest step divided, in scaled units.
ADDED, SHORTEST_DIVIDED = 400, 1e-10


def resolved(field: FrozenField, segment: BranchSegment, window: Window) -> SegmentSurvey:
    """Divide steps until the tests explain the number of unstable eigenvalues.

    Between two rows this number changes by one at a fold or branch point and by two at a Hopf
    point. If the changes of sign do not add up, some of them cancel within the step.
    """
    survey = SegmentSurvey.of(field, segment, window, ON_BRANCHES)
    low, high = survey.unstable
    known = np.flatnonzero(low == high)
    # nothing to explain without changes of the number and without points that always change it
    changing = [kind for kind in ON_BRANCHES if 0 not in kind.changes]
    beside = [k for kind in changing for pair in sign_changes(survey.tests[kind]) for k in pair]
    passed = np.append(0, np.cumsum(np.isin(np.arange(len(low)), beside)))
    first, last = known[:-1], known[1:]
    open_steps = (low[first] != low[last]) | (passed[last + 1] - passed[first] > 1)
    waiting = list(zip(first[open_steps].tolist(), last[open_steps].tolist(), strict=True))[::-1]
    added = 0
    while waiting:
        first, last = waiting.pop()
        change = int(survey.unstable[0][last]) - int(survey.unstable[0][first])
        if added >= ADDED or _explains(survey, slice(first, last + 1), change):
            continue
        place, extra = _middle(field, survey.segment, window, first, last)
        if extra is None:
            continue
        added += 1
        survey = survey.with_row(place, extra, _inserted(survey.segment, place, extra))
        # the remaining pairs are after this one
        waiting = [(a + 1, b + 1) for a, b in waiting]
        low, high = survey.unstable
        if low[place] == high[place]:
            waiting += [(place, last + 1), (first, place)]
        else:
            waiting.append((first, last + 1))
    return survey


def _explains(survey: SegmentSurvey, rows: slice, change: int) -> bool:
    """Return whether the changes of sign among rows can add up to a change of the number."""
    possible = {0}
    for kind, test in survey.tests.items():
        for _ in sign_changes(test[rows]):
            possible = {p + s for p in possible for s in kind.changes}
    return change in possible


def divided(
    field: FrozenField, segment: BranchSegment, window: Window, first: int, last: int
) -> BranchSegment:
    """Insert a row in the middle of the longest step between two rows, if one is found."""
    place, extra = _middle(field, segment, window, first, last)
    return segment if extra is None else _inserted(segment, place, extra)


def _inserted(segment: BranchSegment, place: int, extra: BranchSegment) -> BranchSegment:
    return replace(
        segment,
        u=np.insert(segment.u, place, extra.u, axis=0),
        tangents=np.insert(segment.tangents, place, extra.tangents, axis=0),
    )


def _middle(
    field: FrozenField, segment: BranchSegment, window: Window, first: int, last: int
) -> tuple[int, BranchSegment | None]:
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
    return before + 1, BranchSegment(segment.region, found.u[None], tangent[None])
