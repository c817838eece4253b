"""The rows of a branch of periodic orbits with its special points, as a result."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from fastslow.continuation.marks import ValueMark
from fastslow.continuation.settings import Continuation
from fastslow.orbits.find.finding import find_orbit
from fastslow.orbits.find.orbit_curve import OrbitCurve, Row
from fastslow.orbits.flow.problem import OrbitProblem
from fastslow.orbits.points.kinds import MARKED
from fastslow.orbits.points.marks import OrbitMark
from fastslow.orbits.points.multiplier_signs import MultiplierSigns, changes
from fastslow.orbits.trace.bifurcation_rows import bifurcations, place_of
from fastslow.orbits.trace.marked_rows import own_rows, row_at, rows_with_marks
from fastslow.results.base.intervals import runs_of
from fastslow.results.base.outcome import Outcome, with_notes
from fastslow.results.orbits.orbit import Orbit
from fastslow.results.orbits.orbit_arrays import OrbitArrays
from fastslow.results.orbits.orbit_branch import OrbitBranch, branch_of

#: Values of the parameter, and expressions.
Marks = tuple[ValueMark | OrbitMark, ...]


#: Relative change of the parameter from one orbit to the next that is rounding, and the least
#: number of such orbits of which a branch says so.
SAME_PARAMETER, ORBITS_OF_ONE_PARAMETER = 1e-12, 5


def assembled(
    curve: OrbitCurve,
    settings: Continuation,
    marks: Marks,
    rows: Sequence[Row],
    outcomes: tuple[Outcome, Outcome],
    closed: bool,
) -> OrbitBranch:
    """Return the branch of traced rows, with its special points."""
    notes = _limited_by_rounding(rows, settings.tolerance) + _constant_parameter(curve.name, rows)
    rows = rows_with_points(curve, settings, marks, rows, notes)
    return branch_of(
        [_with_known_multipliers(row) for row in rows],
        [row.point for row in rows],
        (outcomes[0], with_notes(outcomes[1], notes)),
        closed,
        partial(_orbit_at, curve.problem, curve.name),
    )


def _limited_by_rounding(rows: Sequence[Row], tolerance: float) -> list[str]:
    """A note on orbits, without chatter, whose last correction is above the tolerance."""
    errors = [row.arrays.errors[2] for row in rows if not row.shooting.chatters]
    larger = [error for error in errors if error > tolerance]
    if not larger:
        return []
    return [
        f"Rounding limits Newton's corrections of {len(larger)} orbits, to at most "
        f"{max(larger):.1g} of their units, above the tolerance {tolerance:.2g}."
    ]


def _constant_parameter(name: str, rows: Sequence[Row]) -> list[str]:
    """A note on consecutive orbits whose parameter is the same to rounding, as of canards."""
    values = np.array([row.value for row in rows])
    still = np.abs(np.diff(values)) <= SAME_PARAMETER * np.abs(values).max(initial=0.0)
    start, stop = max(runs_of(still), key=lambda ends: ends[1] - ends[0], default=(0, 0))
    if stop - start < ORBITS_OF_ONE_PARAMETER - 1:
        return []
    return [
        f"{name} = {values[start]:.12g} is constant to rounding along {stop - start + 1} orbits, "
        "which it does not determine."
    ]


def rows_with_points(
    curve: OrbitCurve, settings: Continuation, marks: Marks, rows: Sequence[Row], notes: list[str]
) -> list[Row]:
    """Insert the rows of bifurcations and of marks; add notes on marks without a point."""
    expressions = [mark for mark in marks if isinstance(mark, OrbitMark)]
    marked = rows_with_marks(curve, settings, expressions, rows, notes)
    found = own_rows(rows[0], marked[0])
    changed = changes(MultiplierSigns.of_rows([(row.arrays, row.slope) for row in rows]))
    for k, (differs, two) in enumerate(zip(changed.tolist(), rows[1:], strict=True)):
        one = rows[k]
        between = bifurcations(curve, one, two) if differs else []
        inside = [each.row for each in marked[k] if not each.at_row]
        if more := [*_at_values(curve, marks, one, two), *inside]:
            between = sorted([*between, *more], key=partial(place_of, curve, one, two))
        found += [*between, *own_rows(two, marked[k + 1])]
    return found


def _at_values(curve: OrbitCurve, marks: Marks, one: Row, two: Row) -> list[Row]:
    """Rows at given values of the parameter between two rows."""
    values = [mark.value for mark in marks if isinstance(mark, ValueMark)]
    inside = [m for m in values if min(one.value, two.value) < m < max(one.value, two.value)]
    found = []
    for mark in inside:
        row = row_at(curve, one, two, mark)
        if row is not None:
            found.append(replace(row, point=MARKED.point(curve.name, row.orbit, (0.0, 0.0))))
    return found


def _with_known_multipliers(row: Row) -> OrbitArrays:
    """The orbit of a row, without multipliers where its special point has none."""
    if row.point is None or not np.isnan(row.point.orbit.log_multipliers).all():
        return row.arrays
    unknown = row.point.orbit
    return row.arrays._replace(
        multipliers=unknown.multipliers, log_multipliers=unknown.log_multipliers
    )


def _orbit_at(problem: OrbitProblem, name: str, orbit: Orbit, value: float) -> Orbit:
    """Return the orbit at a value of the parameter, near another one."""
    model = problem.model.with_parameters({name: value})
    return find_orbit(model, orbit, multiple=orbit.multiple or 1)
