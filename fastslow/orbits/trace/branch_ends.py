"""Ends of branches of periodic orbits that are seen at their rows."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from fastslow.continuation import curves
from fastslow.orbits.find.orbit_curve import OrbitCurve, Row, states_along
from fastslow.orbits.flow.shooting import Shooting
from fastslow.orbits.points.contacts import two_fold_near
from fastslow.results.base.outcome import Outcome

Array = NDArray[np.float64]

#: Growth of the states, from the first orbit, at which a branch ends.
LARGEST_GROWTH = 1e8

CLOSED_LOOP = Outcome("closed loop", "the branch is a closed curve.", True)


def ended(status: str, name: str, value: float, count: int) -> Outcome:
    """The outcome of a trace that ends with a status of `curves`, after a number of rows."""
    at = f"{name} = {value:.6g}"
    if status == curves.CLOSED:
        return CLOSED_LOOP
    if status == curves.RANGE:
        return Outcome("end of range", f"reached {at}, the end of the range.", True)
    if status == curves.SMALL_STEP:
        return Outcome(
            "step too small",
            f"the step became smaller than min_step at {at}, where Newton's method does not "
            "converge.",
            False,
        )
    return Outcome(
        "too many points",
        f"stopped at {at} after {count} points; raise max_points= of Continuation.",
        False,
    )


def two_fold(curve: OrbitCurve, shooting: Shooting, row: Row) -> Outcome | None:
    """The outcome where the orbits reach a two-fold while they slide, else None."""
    interface = two_fold_near(shooting, row.u)
    if interface is None:
        return None
    name = row.orbit.trajectory.interfaces[interface]
    return Outcome(
        "two-fold",
        f"at {curve.name} = {row.value:.7g} the orbit slides past a two-fold on {name}, "
        "at which the rates of sliding are unbounded: a candidate for the end of the branch, "
        "which was not located.",
        False,
    )


def unbounded(curve: OrbitCurve, rows: Sequence[Row]) -> Outcome | None:
    """The outcome where the orbits have become far larger than the first, else None."""
    first_row, row = rows[0], rows[-1]
    n = curve.problem.variations.n
    first = np.abs(states_along(first_row.arrays, n)).max(axis=0)
    last = np.abs(states_along(row.arrays, n)).max(axis=0)
    if not last.max() > LARGEST_GROWTH * first.max():
        return None
    return Outcome(
        "amplitude unbounded",
        f"the states have grown to 10⁸ times those of the first orbit at {curve.name} = "
        f"{row.value:.6g}: a candidate for a bifurcation from infinity.",
        False,
    )
