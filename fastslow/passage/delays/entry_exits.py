"""Entry-exit integral of a slow passage along the branch through a special point."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

from fastslow.errors import ArgumentError
from fastslow.passage.delays.critical_modes import CriticalMode
from fastslow.passage.delays.growth_rates import BranchSide
from fastslow.passage.delays.local_field import same_point
from fastslow.results.branch.branch import Branch
from fastslow.results.branch.diagram import Diagram
from fastslow.results.points import SpecialPoint

#: Decay exponent above which rounding and noise, exp(−30) = 1e−13, determine the exit.
MEMORY_EXPONENT = 30.0

#: Decay exponent beyond which a state that is a factor of its rate falls below 1e-300.
UNDERFLOW = 690.0

#: Relative error of the integral along a branch.
INTEGRAL_ERROR = 1e-9

#: Safety factor of the error bound from the terms of first order.
FIRST_ORDER_SAFETY = 1.25


def entry_exit(
    mode: CriticalMode,
    *,
    entry: float,
    rate: float,
    gain: float,
    memory: float,
    remembered: str,
    lost: str,
) -> dict[str, Any]:
    """Exit at which growth balances the decay since the entry, as fields of its `Delay`.

    Parameters
    ----------
    mode : CriticalMode
        Critical mode with the two sides of the point.
    entry, rate, gain : float
        As in `fastslow.predict_delay`.
    memory : float
        Decay exponent above which the exit no longer depends on the entry.
    remembered, lost : str
        Validity below and above that decay; ``{decay}`` is its value.
    """
    before, behind, point = mode.before, mode.behind, mode.point
    require_entry(before, point, entry)
    decay = -before.integral(entry) / abs(rate)
    needed = decay + math.log(gain)
    exit_at = behind.where(abs(rate) * needed)
    error = math.nan
    words = remembered
    if math.isnan(exit_at):
        words = "none: the branch ends or reverses before growth balances the decay"
    elif decay > memory:
        words = lost.format(decay=f"{decay:.0f}")
    elif before.diagram.corrector is None:
        words += "; eigenvalues interpolated, as the diagram was read from a file"
    else:
        off = mode.exponent_error(entry, exit_at, rate)
        around = [behind.where(abs(rate) * max(needed + s * off, 0.0)) for s in (-1, 1)]
        if not needed > off:
            around[0] = behind.here
        error = FIRST_ORDER_SAFETY * max(abs(exit_at - other) for other in around)
        error += INTEGRAL_ERROR * abs(exit_at - entry)
        words += bound_in_words(error)
    name = before.diagram.parameter
    return {
        "point": point,
        "parameter": name,
        "rate": rate,
        "delay": abs(exit_at - point[name]),
        "validity": words,
        "error": error,
        "entry": float(entry),
        "decay": decay,
        "gain": float(gain),
        "forgotten": decay > memory,
        "source": mode,
    }


def bound_in_words(error: float, of: str = "") -> str:
    """Statement of the error bound of an exit."""
    if math.isnan(error):
        return "; no error bound"
    words = of or " at small amplitude"
    return f"; error below {error:.2g}{words}, from the terms of first order in the rate"


def require_entry(before: BranchSide, point: SpecialPoint, entry: float) -> None:
    """Raise unless an entry is on the branch before a point."""
    name = before.diagram.parameter
    here = point[name]
    reached = before.end
    low, high = sorted((reached, here))
    if not low <= entry <= high or entry == here:
        raise ArgumentError(
            f"entry = {entry:g}; expected a value of {name} on the branch before {point.label}, "
            f"from {reached:g} to {here:g}"
        )


def places(diagram: Diagram, point: SpecialPoint) -> Iterator[tuple[Branch, int]]:
    """Branches of a diagram through a special point, each with the row of the point."""
    found = False
    length = diagram.over[1] - diagram.over[0]
    for branch in diagram.branches:
        for other, row in zip(branch.special, branch.special_rows, strict=True):
            if diagram.parameters.items() <= point.parameters.items() and same_point(
                point, other, diagram.parameter, length
            ):
                found = True
                yield branch, row
    if not found:
        raise ArgumentError(
            f"{point.label} is not a point of this diagram over {diagram.parameter}"
        )
