"""Lag at persistence, and delay of a non-smooth fold."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from fastslow.arguments import Name
from fastslow.errors import ArgumentError
from fastslow.model.model import Model
from fastslow.passage.delays.delay_law import LocalLaw
from fastslow.passage.delays.interface_passages import (
    approach_of,
    judged,
    passage_behind,
    settling_before,
)
from fastslow.passage.delays.local_field import (
    LocalField,
    delay_fields,
    level_of,
    named_level,
    passage_at,
    require_law,
)
from fastslow.passage.delays.local_passages import EndOfPassage
from fastslow.results.overlay.delays import BoundaryDelay, Delay
from fastslow.results.overlay.drifts import Drift
from fastslow.results.point_types import NON_SMOOTH_FOLD
from fastslow.results.points import SpecialPoint


def boundary_delay(
    point: SpecialPoint,
    rate: float | Drift,
    *,
    level: Mapping[Any, float] | str | None = None,
    parameter: Name | None = None,
    model: Model | None = None,
) -> BoundaryDelay:
    """Lag or delay of a slow passage through a boundary equilibrium.

    Before the interface the rates are linearised, y' = J₁ y + b₁ μ with μ' linear as well: the
    motion on the slow manifold, y = −J₁⁻¹ b₁ μ − J₁⁻² b₁ rate at a constant drift, crosses
    with a lag of the order of the rate, which is the result for persistence. At a non-smooth
    fold the motion behind the interface, y' = J₂ y + b₂ μ + …, grows along the unstable
    direction of J₂ until the level is reached, at

        delay = (rate/λ₂) ln(1/rate) + O(rate)

    with a term of order rate that depends on the level; this is not a power of the rate. The
    passage is solved in closed form, region by region, if the rates and the drift are linear,
    and integrated from the crossing otherwise. For x' = p + |x|, p = εt, it gives
    p = ε (1 + ln((x + p + ε)/(2ε))).

    Parameters
    ----------
    point : SpecialPoint
        A boundary equilibrium of a continuous field, code BE, of subtype
        ``"persistence"`` or ``"non-smooth fold"``.
    rate : float or Drift
        Signed rate of the parameter.
    level : mapping or "turn"
        One state and its value, e.g. ``{"x": 1.0}``, or the extremum of the parameter;
        required at a non-smooth fold.
    parameter : str or Symbol, optional
        The drifting parameter, by default that of the point's diagram.
    model : Model, optional
        The model of a point that was read from a file.

    Returns
    -------
    BoundaryDelay
        Exact if the rates and the drift are linear. ``delay`` is the lag
        for persistence, and nan if the level is never reached.

    Raises
    ------
    ArgumentError
        For a point of another code or subtype, a rate of zero or towards the
        stable branch, or a missing level.

    Examples
    --------
    >>> import sympy as sp, fastslow as fs
    >>> x, p = sp.symbols("x p")
    >>> corner = fs.Model({x: p + sp.Abs(x)}, parameters={p: -1})
    >>> diagram = fs.continue_equilibria(corner, "p", over=(-1, 1))
    >>> law = boundary_delay(diagram.boundary_equilibria[0], 0.01, level={"x": 1})
    >>> round(law.delay, 10)
    0.0497000894
    """
    require_law(point, LAW.name, "the delay at a boundary equilibrium")
    if point.clarke is None or point.type not in ("persistence", NON_SMOOTH_FOLD):
        kind = "a degenerate one" if point.type == "degenerate" else "one of a Filippov field"
        if point.at_switch:
            kind = "one at the threshold of a switch, where its branch ends"
        elif point.at_wall:
            kind = "one at a wall, which a state leaves as soon as the contact force vanishes"
        hint = "; see gap_crossing" if point.type == "degenerate" else ""
        raise ArgumentError(
            f"expected a boundary equilibrium of a continuous field with persistence or a "
            f"non-smooth fold, received {point.label}, {kind}{hint}"
        )
    local, drift = passage_at(point, rate, parameter, model)
    height = level_of(local, level, drift)
    way = approach_of(local, drift)
    jacobian, _ = local.slopes(way.behind)
    unstable = float(np.linalg.eigvals(jacobian).real.max())
    stop = EndOfPassage(interface=way.interface)
    sense, delay, time, words, error = drift.way, drift.way * way.mu, way.time, "", math.nan
    if point.type == "persistence":
        words, error = judged(local, drift, way, stop, delay, linear=local.affine(way.before))
        words = f"no delay but a lag, {words}"
        if unstable >= 0:
            words += "; the branch behind the interface is not stable"
    elif height is None:
        raise ArgumentError(
            "the delay of a non-smooth fold depends on the level that ends it; "
            "give level={state: value}"
        )
    else:
        stop = EndOfPassage(height)
        place, reason, linear = passage_behind(
            local, drift, way, stop, 40.0 / max(unstable, -way.stable)
        )
        delay, time = sense * float(place.z[-1]), place.time
        if reason:
            delay = time = math.nan
            words = f"none: {reason}"
        else:
            linear &= local.affine(way.before)
            words, error = judged(local, drift, way, stop, delay, linear=linear)
    return BoundaryDelay(
        **delay_fields(local, drift),
        delay=delay,
        validity=words,
        error=error,
        delay_time=time,
        lag=sense * way.mu,
        stable=way.stable,
        unstable=unstable,
        level=named_level(local, height),
    )


class BoundaryLaw(LocalLaw):
    """The lag or delay at a boundary equilibrium of a continuous field."""

    name = "boundary"

    def applies(self, point: SpecialPoint) -> bool:
        return point.type != "degenerate"

    def at_point(
        self,
        point: SpecialPoint,
        rate: float | Drift,
        *,
        level: Mapping[Any, float] | str | None,
        parameter: Name | None,
        model: Model | None,
    ) -> Delay:
        return boundary_delay(point, rate, level=level, parameter=parameter, model=model)

    def settling_distance(self, local: LocalField, delay: Delay) -> float:
        return settling_before(local, delay)


LAW = BoundaryLaw()
