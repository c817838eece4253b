"""Outcomes of curves of special points."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fastslow.continuation import curves
from fastslow.continuation.endings import (
    CLOSED_LOOP,
    END_OF_RANGE,
    SINGULAR_CURVE,
    STEP_TOO_SMALL,
    TOO_MANY_POINTS,
)
from fastslow.continuation.settings import Continuation
from fastslow.diagrams.curves.arcs import EndedSystem
from fastslow.diagrams.endings import LEFT_REGION, SECOND_INTERFACE
from fastslow.results.base.outcome import Outcome
from fastslow.results.branch.windows import StateWindow, left_window

Array = NDArray[np.float64]


def outcome_of(
    status: str,
    system: EndedSystem,
    z: Array,
    names: tuple[str, ...],
    window: StateWindow,
    settings: Continuation,
) -> Outcome:
    """Return the outcome for the status of a trace."""
    plane = z[system.n : system.width]
    where = ", ".join(f"{n} = {v:.6g}" for n, v in zip(names, plane, strict=True))
    if status == curves.RANGE:
        return END_OF_RANGE.at(where=where)
    if status == curves.CLOSED:
        return CLOSED_LOOP.at(curve="curve")
    own = system.end(status, z, where)
    if own is not None:
        return own
    if status == curves.BOUND:
        return SECOND_INTERFACE.at(region=system.region_name, where=where)
    if status == curves.STOPPED:
        return LEFT_REGION.at(region=system.region_name, where=where)
    if status == curves.WINDOW:
        return left_window(window, z[: system.n], system.unit, where)
    if status == curves.FULL:
        return TOO_MANY_POINTS.at(curve="curve", count=settings.max_points, where=where)
    return STEP_TOO_SMALL.at(where=where, step=settings.min_step, why=SINGULAR_CURVE)
