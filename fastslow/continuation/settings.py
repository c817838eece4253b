"""Settings of a continuation."""

from __future__ import annotations

from dataclasses import dataclass, fields

from fastslow.arguments import positive, settings, whole
from fastslow.errors import ArgumentError

#: Integer settings; all others are positive numbers.
COUNTS = {
    "iterations": whole(1, 10**6),
    "points": whole(2, 10**9),
    "starts": whole(0, 10**6),
    "branches": whole(1, 10**6),
}


@settings
@dataclass(frozen=True)
class Continuation:
    """Settings of pseudo-arclength continuation.

    Lengths are in scaled units: the range of the parameter is 1.

    Parameters
    ----------
    step : float
        Initial arclength step.
    smallest_step : float
        Minimum step; below it a branch ends with the outcome "step too small".
    largest_step : float
        Maximum step, for smooth curves in figures.
    largest_turn : float
        Maximum angle in radians between the tangents of consecutive points.
    tolerance : float
        Newton correction, in scaled units, at which a point is accepted; convergence is
        quadratic, so that the point is accurate to rounding.
    iterations : int
        Maximum Newton iterations in one step.
    points : int
        Maximum number of points of a branch.
    starts : int
        Interior values of the parameter at which equilibria are computed as starting points,
        in addition to both ends.
    branches : int
        Maximum number of branches of a diagram; reaching it is reported in its outcome.

    Raises
    ------
    ArgumentError
        If a value is not positive or smallest_step ≤ step ≤ largest_step is violated.
    """

    step: float = 1e-2
    smallest_step: float = 1e-9
    largest_step: float = 2e-2
    largest_turn: float = 0.15
    tolerance: float = 1e-10
    iterations: int = 8
    points: int = 20_000
    starts: int = 7
    branches: int = 100

    def __post_init__(self) -> None:
        for entry in fields(self):
            check = COUNTS.get(entry.name, positive)
            object.__setattr__(self, entry.name, check(entry.name, getattr(self, entry.name)))
        if not self.smallest_step <= self.step <= self.largest_step:
            raise ArgumentError(
                "Continuation: expected smallest_step ≤ step ≤ largest_step, received "
                f"{self.smallest_step:g}, {self.step:g}, {self.largest_step:g}"
            )
