"""Prediction of delays at special points of every type."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from fastslow.arguments import Name, finite, formula, instance, positive, validated
from fastslow.errors import ArgumentError
from fastslow.model.model import Model
from fastslow.passage.delays.boundary_delays import boundary_delay, gap_crossing
from fastslow.passage.delays.branch_exits import branch_exit
from fastslow.passage.delays.fold_delays import fold_delay
from fastslow.passage.delays.hopf_delays import hopf_exit
from fastslow.passage.delays.local_field import level_argument, rate_argument
from fastslow.results.branch.diagram import Diagram
from fastslow.results.overlay.delays import (
    BoundaryDelay,
    BranchPointExit,
    FoldDelay,
    GapCrossing,
    HopfExit,
)
from fastslow.results.overlay.drifts import Drift
from fastslow.results.point_types import HOPF, POINT_TYPES, point_name
from fastslow.results.points import SpecialPoint


@validated(
    point=instance(SpecialPoint),
    rate=rate_argument,
    level=level_argument,
    parameter=formula,
    model=instance(Model),
    diagram=instance(Diagram),
    entry=finite,
    gain=positive,
)
def predict_delay(
    point: SpecialPoint,
    rate: float | Drift,
    *,
    level: Mapping[Any, float] | str | None = None,
    parameter: Name | None = None,
    model: Model | None = None,
    diagram: Diagram | None = None,
    entry: float | None = None,
    gain: float = 1.0,
) -> FoldDelay | BoundaryDelay | GapCrossing | HopfExit | BranchPointExit:
    """Predict the delay of a slow passage through a special point.

    The law follows from the type of the point: `fold_delay` at a fold (saddle-node),
    `boundary_delay` at a boundary equilibrium with persistence or a non-smooth fold,
    `gap_crossing` at the end of a continuum of equilibria. At a Hopf point, and at a
    branch point of an invariant branch, the loss of stability is delayed: the integral of the
    critical eigenvalue from the entry to the exit is zero (entry-exit relation), which
    requires ``diagram`` and ``entry``. At other branch points the passage is algebraic in the
    rate, and no delay is predicted.

    Parameters
    ----------
    point : SpecialPoint
        Code LP, BE, HB or BP.
    rate : float or Drift
        Signed rate of the parameter, or a `Drift` that also contains its change in time and
        the feedback from the states, as for a slow state.
    level : mapping or "turn", optional
        One state and its value that mark the end of the jump, e.g. ``{"x": 1.0}``, or
        ``"turn"`` for the extremum of the parameter, as in a relaxation oscillation. Not used
        for a gap.
    parameter : str or Symbol, optional
        The drifting parameter, by default that of the point's diagram.
    model : Model, optional
        The model of a point that was read from a file.
    diagram : Diagram, optional
        At HB and BP: diagram with the branch on both sides of the point.
    entry : float, optional
        At HB and BP: value of the parameter at which the trajectory enters the vicinity of
        the branch.
    gain : float
        At HB and BP: ratio of the distances from the branch at exit and entry.

    Returns
    -------
    FoldDelay, BoundaryDelay, GapCrossing, HopfExit or BranchPointExit

    Raises
    ------
    ArgumentError
        For a point without a law of delay, a degenerate point, a rate of zero or towards the
        stable branch, or an entry that is not on the branch before the point.

    Examples
    --------
    >>> import fastslow as fs
    >>> fast = fs.systems.cusp().frozen()
    >>> diagram = fs.continue_equilibria(fast, "p", over=(-1, 1))
    >>> round(predict_delay(diagram.folds[0], 1e-3).leading, 9)
    0.019469027
    """
    known = POINT_TYPES.get(point.code)
    law = known.law if known else ""
    if law in ("fold", "boundary") and not (diagram is None and entry is None):
        raise ArgumentError(
            "diagram= and entry= go with a Hopf (HB) or branch point (BP); the delay past "
            f"{point.label} does not depend on the entry"
        )
    if law == "fold":
        return fold_delay(point, rate, level=level, parameter=parameter, model=model)
    if law == "boundary" and point.type == "degenerate":
        return gap_crossing(point, rate, parameter=parameter, model=model)
    if law == "boundary":
        return boundary_delay(point, rate, level=level, parameter=parameter, model=model)
    if law == "entry-exit":
        if diagram is None or entry is None:
            raise ArgumentError(
                f"the exit past {point.label}, a {point_name(point.code)}, depends on the entry to "
                "the branch; give diagram= and entry="
            )
        if level is not None:
            raise ArgumentError(
                f"level= goes with a fold (LP) or boundary equilibrium (BE), not {point.label}; "
                "the distance at the exit is gain="
            )
        speed = rate.rate if isinstance(rate, Drift) else rate
        exits: HopfExit | BranchPointExit
        if point.code == HOPF:
            exits = hopf_exit(diagram, point, entry, speed, gain=gain)
        else:
            exits = branch_exit(diagram, point, entry, speed, gain=gain, model=model)
        if not isinstance(rate, Drift) or rate.constant:
            return exits
        words = "; with the rate at the point, the change of the drift is neglected: no error bound"
        return replace(exits, error=math.nan, validity=exits.validity + words)
    known_laws = ", ".join(known.title for known in POINT_TYPES.values() if known.law)
    raise ArgumentError(
        f"expected a point with a delay law ({known_laws}), received {point.label} "
        f"({point_name(point.code)})"
    )
