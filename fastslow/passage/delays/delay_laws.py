"""The law of delay that holds at a special point."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from fastslow.arguments import finite, formula, instance, positive, validated
from fastslow.errors import ArgumentError
from fastslow.model.model import Model
from fastslow.passage.delays.boundary_delays import boundary_delay, gap_transit
from fastslow.passage.delays.branch_exits import branch_exit
from fastslow.passage.delays.fold_delays import fold_delay
from fastslow.passage.delays.hopf_delays import hopf_exit
from fastslow.passage.delays.local_field import level_argument, rate_argument
from fastslow.results.branch.diagram import Diagram
from fastslow.results.overlay.delays import (
    BoundaryDelay,
    BranchPointExit,
    FoldDelay,
    GapTransit,
    HopfExit,
)
from fastslow.results.overlay.drifts import Drift
from fastslow.results.point_types import POINT_TYPES, point_name
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
    parameter: object = None,
    model: Model | None = None,
    diagram: Diagram | None = None,
    entry: float | None = None,
    gain: float = 1.0,
) -> FoldDelay | BoundaryDelay | GapTransit | HopfExit | BranchPointExit:
    """How far past a special point a drifting parameter is when the trajectory changes sheet.

    At a fold see `fold_delay`, at a boundary equilibrium with persistence or a
    non-smooth fold `boundary_delay`, at the end of a continuum `gap_transit`. At a
    Hopf point, and at a branch point where an invariant branch is left, the delay
    depends on where the trajectory came to the branch: ``diagram`` and ``entry`` are
    needed, and the integral of the eigenvalue from the entry to the exit is zero
    (see `hopf_exit`). At other branch points, where the branch moves with the
    parameter, the passage is algebraic and no such law is offered.

    Parameters
    ----------
    point : SpecialPoint
        Code LP, BE, HB or BP.
    rate : float or Drift
        Of the parameter, with its sign; as a `Drift` with its change in time and its feedback
        from the states, as that of a slow state has it.
    level : mapping or "turn", optional
        One state and its value at which the jump counts as done, or ``"turn"``: that the
        parameter itself turns round, as in a relaxation oscillation. Not used for a gap.
    parameter : str or Symbol, optional
        What drifts, by default the parameter of the point's diagram.
    model : Model, optional
        For a point that was read from a file: its model.
    diagram : Diagram, optional
        At HB and BP: with the branch on both sides of the point.
    entry : float, optional
        At HB and BP: the parameter where the trajectory comes to the branch.
    gain : float
        At HB and BP: distance from the branch at the exit by that at the entry.

    Returns
    -------
    FoldDelay, BoundaryDelay, GapTransit, HopfExit or BranchPointExit

    Raises
    ------
    ArgumentError
        For a point without such a law, or where its law raises one.

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
    if law == "boundary" and point.subtype == "degenerate":
        return gap_transit(point, rate, parameter=parameter, model=model)
    if law == "boundary":
        return boundary_delay(point, rate, level=level, parameter=parameter, model=model)
    if law == "entry-exit":
        if diagram is None or entry is None:
            raise ArgumentError(
                f"the exit past {point.label}, a {point_name(point.code)}, depends on where the "
                "trajectory came to the branch; give diagram= and entry="
            )
        if level is not None:
            raise ArgumentError(
                f"level= goes with a fold (LP) or boundary equilibrium (BE), not {point.label}; "
                "the distance at the exit is gain="
            )
        speed = rate.rate if isinstance(rate, Drift) else rate
        exits: HopfExit | BranchPointExit
        if point.code == "HB":
            exits = hopf_exit(diagram, point, entry, speed, gain=gain)
        else:
            exits = branch_exit(diagram, point, entry, speed, gain=gain, model=model)
        if not isinstance(rate, Drift) or rate.constant:
            return exits
        words = "; at the rate at the point, the change of the drift left aside: no error is stated"
        return replace(exits, error=math.nan, validity=exits.validity + words)
    raise ArgumentError(
        "expected a fold (LP), a boundary equilibrium (BE), a Hopf (HB) or branch point (BP), "
        f"received {point.label}, a {point_name(point.code)}"
    )
