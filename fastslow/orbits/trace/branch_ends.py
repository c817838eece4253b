"""Ends of branches of periodic orbits that are seen at their rows."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from fastslow.continuation import curves
from fastslow.continuation.endings import (
    CLOSED_LOOP,
    END_OF_RANGE,
    STEP_TOO_SMALL,
    TOO_MANY_POINTS,
)
from fastslow.continuation.settings import Continuation
from fastslow.orbits.endings import NEWTON_FAILS, TWO_FOLD, UNBOUNDED
from fastslow.orbits.find.orbit_curve import OrbitCurve, Row
from fastslow.orbits.flow.shooting import Shooting
from fastslow.orbits.points.contacts import two_fold_near
from fastslow.results.base.outcome import Outcome

Array = NDArray[np.float64]

#: Growth of the states, from the first orbit, at which a branch ends.
LARGEST_GROWTH = 1e8

#: Size of the last correction, relative to the tolerance, from which rounding may prevent others.
NEAR_TOLERANCE = 0.1


def ended(status: str, curve: OrbitCurve, row: Row, count: int, settings: Continuation) -> Outcome:
    """The outcome of a trace that ends with a status of `curves`, after a number of rows."""
    where = place(curve, row.value)
    if status == curves.CLOSED:
        return CLOSED_LOOP.at(curve="branch")
    if status == curves.RANGE:
        return END_OF_RANGE.at(where=where)
    if status == curves.SMALL_STEP:
        accuracy, why = row.arrays.errors[2], NEWTON_FAILS
        if accuracy > NEAR_TOLERANCE * settings.tolerance:
            why += (
                f"; the last correction of the last orbit is {accuracy:.1g}; if rounding limits "
                f"it, a tolerance of Continuation above {settings.tolerance:.2g} leads further"
            )
        return STEP_TOO_SMALL.at(where=where, step=settings.min_step, why=why)
    return TOO_MANY_POINTS.at(curve="branch", count=count, where=where)


def place(curve: OrbitCurve, value: float, digits: int = 6) -> str:
    """A value of the parameter in a sentence."""
    return f"{curve.name} = {value:.{digits}g}"


def two_fold(curve: OrbitCurve, shooting: Shooting, row: Row) -> Outcome | None:
    """The outcome where the orbits reach a two-fold while they slide, else None."""
    interface = two_fold_near(shooting, row.u)
    if interface is None:
        return None
    name = row.orbit.trajectory.interfaces[interface]
    return TWO_FOLD.at(where=place(curve, row.value, 7), interface=name)


def unbounded(curve: OrbitCurve, rows: Sequence[Row]) -> Outcome | None:
    """The outcome where the orbits have become far larger than the first, else None."""
    first_row, row = rows[0], rows[-1]
    if not np.abs(row.extremes).max() > LARGEST_GROWTH * np.abs(first_row.extremes).max():
        return None
    return UNBOUNDED.at(where=place(curve, row.value))
