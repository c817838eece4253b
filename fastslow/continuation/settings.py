"""Settings of a continuation."""

from __future__ import annotations

from dataclasses import dataclass, fields

from fastslow.arguments import positive, settings, whole
from fastslow.errors import ArgumentError

#: What is counted; everything else is measured.
COUNTS = {
    "iterations": whole(1, 10**6),
    "points": whole(2, 10**9),
    "starts": whole(0, 10**6),
    "branches": whole(1, 10**6),
}


@settings
@dataclass(frozen=True)
class Continuation:
    """How a branch is traced. Lengths are in scaled units: the parameter's range is 1.

    Parameters
    ----------
    step : float
        First step along the arclength.
    smallest_step : float
        Below it a branch ends with the outcome "step too small".
    largest_step : float
        Bound on the step, for a smooth curve in figures.
    largest_turn : float
        Angle in radians that the tangent may turn in one step.
    tolerance : float
        Newton correction, in scaled units, at which a point is accepted; the
        convergence is quadratic, so the point itself is known to rounding.
    iterations : int
        Newton iterations allowed in one step.
    points : int
        Rows that one branch may have.
    starts : int
        Values of the parameter, beside both ends, at which branches are looked for.
    branches : int
        Branches that one diagram may have; beyond it the search ends and says so.

    Raises
    ------
    ArgumentError
        If a value is not positive or the steps are not in order.
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
