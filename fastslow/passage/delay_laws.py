"""The law of delay that holds at a special point."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from fastslow.arguments import finite, formula, instance, mapping, takes
from fastslow.errors import ArgumentError
from fastslow.model.model import Model
from fastslow.passage.boundary_delays import boundary_delay, gap_transit
from fastslow.passage.fold_delays import fold_delay
from fastslow.results.delays import BoundaryDelay, FoldDelay, GapTransit
from fastslow.results.point_types import POINT_TYPES, point_name
from fastslow.results.points import SpecialPoint


@takes(
    point=instance(SpecialPoint),
    rate=finite,
    level=mapping,
    parameter=formula,
    model=instance(Model),
)
def predict_delay(
    point: SpecialPoint,
    rate: float,
    *,
    level: Mapping[Any, float] | None = None,
    parameter: object = None,
    model: Model | None = None,
) -> FoldDelay | BoundaryDelay | GapTransit:
    """How far past a special point a drifting parameter is when the trajectory changes sheet.

    At a fold see `fold_delay`, at a boundary equilibrium with persistence or a
    non-smooth fold `boundary_delay`, at the end of a continuum `gap_transit`. At a
    Hopf point the delay depends on where the trajectory came to the sheet: see
    `hopf_exit`.

    Parameters
    ----------
    point : SpecialPoint
        Code LP or BE.
    rate : float
        Of the parameter, with its sign.
    level : mapping, optional
        One state and its value at which the jump counts as done; not used for a gap.
    parameter : str or Symbol, optional
        What drifts, by default the parameter of the point's diagram.
    model : Model, optional
        For a point that was read from a file: its model.

    Returns
    -------
    FoldDelay, BoundaryDelay or GapTransit

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
    if law == "fold":
        return fold_delay(point, rate, level=level, parameter=parameter, model=model)
    if law == "boundary" and point.subtype == "degenerate":
        return gap_transit(point, rate, parameter=parameter, model=model)
    if law == "boundary":
        return boundary_delay(point, rate, level=level, parameter=parameter, model=model)
    hint = "; at a Hopf point see hopf_exit" if law == "entry-exit" else ""
    raise ArgumentError(
        f"expected a fold (LP) or a boundary equilibrium (BE), received {point.label}, a "
        f"{point_name(point.code)}{hint}"
    )
