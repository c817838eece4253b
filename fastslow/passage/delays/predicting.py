"""Prediction of delays at special points of every type."""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import cache
from typing import Any

from fastslow.arguments import Name, finite, formula, instance, positive, validated
from fastslow.errors import ArgumentError
from fastslow.model.model import Model
from fastslow.passage.delays import laws
from fastslow.passage.delays.delay_law import DelayLaw
from fastslow.passage.delays.local_field import level_argument, rate_argument
from fastslow.results.base.named_mapping import NamedMapping
from fastslow.results.base.registration import registered
from fastslow.results.branch.diagram import Diagram
from fastslow.results.overlay.delays import Delay
from fastslow.results.overlay.drifts import Drift
from fastslow.results.point_types import POINT_TYPES
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
) -> Delay:
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
    Delay
        A `FoldDelay`, `BoundaryDelay`, `GapCrossing`, `HopfExit` or `BranchPointExit`.

    Raises
    ------
    ArgumentError
        For a point without a law of delay, a degenerate point, a rate of zero or towards the
        stable branch, or an entry that is not on the branch before the point.

    See Also
    --------
    fastslow.overlay, fastslow.delay_scaling

    Examples
    --------
    >>> import fastslow as fs
    >>> fast = fs.systems.cusp().frozen()
    >>> diagram = fs.continue_equilibria(fast, "p", over=(-1, 1))
    >>> round(predict_delay(diagram.folds[0], 1e-3).leading, 9)
    0.019469027
    """
    law = law_at(point)
    if law is None:
        known_laws = ", ".join(known.title for known in POINT_TYPES.values() if known.law)
        raise ArgumentError(
            f"expected a point with a delay law ({known_laws}), received {point.label} "
            f"({point.kind.name})"
        )
    return law.predict(
        point,
        rate,
        level=level,
        parameter=parameter,
        model=model,
        diagram=diagram,
        entry=entry,
        gain=gain,
    )


@cache
def registered_laws() -> tuple[DelayLaw, ...]:
    """The laws of all modules of `fastslow.passage.delays.laws`.

    Examples
    --------
    >>> {"fold", "hopf"} <= {law.name for law in registered_laws()}
    True
    """
    return registered(laws, "LAW")


def law_at(point: SpecialPoint) -> DelayLaw | None:
    """The law of a special point, None without one."""
    return next(
        (one for one in registered_laws() if one.name == point.kind.law and one.applies(point)),
        None,
    )


def gradient_of_delay(delay: Delay, name: Name) -> NamedMapping[float]:
    """Compute the derivatives of a predicted delay; see `Delay.gradient`."""
    law = law_at(delay.point)
    if law is None or math.isnan(delay.delay):
        raise ArgumentError(f"there is no predicted delay, and no derivative: {delay.validity}")
    return law.gradient(delay, str(name))
