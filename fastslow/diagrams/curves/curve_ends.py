"""Outcomes of curves of special points."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fastslow.continuation import curves
from fastslow.diagrams.points.defining import DefiningSystem
from fastslow.results.base.outcome import Outcome
from fastslow.results.branch.windows import StateWindow, left_window

Array = NDArray[np.float64]


def outcome_of(
    status: str, system: DefiningSystem, z: Array, names: tuple[str, str], window: StateWindow
) -> Outcome:
    """Return the outcome for the status of a trace."""
    plane = z[system.width - 2 : system.width]
    where = ", ".join(f"{n} = {v:.6g}" for n, v in zip(names, plane, strict=True))
    if status == curves.RANGE:
        return Outcome("end of range", f"reached the end of the range at {where}.", True)
    if status == curves.CLOSED:
        return Outcome("closed loop", "the curve returned to its start: a closed loop.", True)
    own = system.end(status, z, where)
    if own is not None:
        return own
    if status == curves.BOUND:
        return Outcome(
            "interfaces meet",
            f"another interface of region {_region(system)} is reached at {where}; "
            "beyond it other regions are adjacent.",
            True,
        )
    if status == curves.STOPPED:
        return Outcome(
            "left the region", f"the points leave region {_region(system)} at {where}.", True
        )
    if status == curves.WINDOW:
        return left_window(window, z[: system.n], system.unit, where)
    if status == curves.FULL:
        return Outcome(
            "too many points",
            f"the curve continues beyond {where}; increase Continuation(max_points=…) or max_step.",
            False,
        )
    return Outcome(
        "step too small",
        f"no next point was found from {where}: the curve is singular there, or the rates are not "
        "defined beyond.",
        False,
    )


def _region(system: DefiningSystem) -> str:
    return system.field.regions[system.region]
