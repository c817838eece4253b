"""Settings of a continuation."""

from __future__ import annotations

from dataclasses import dataclass

from fastslow.arguments import positive, settings, whole
from fastslow.errors import ArgumentError
from fastslow.results.base.display import Displayed


@settings(
    step=positive,
    min_step=positive,
    max_step=positive,
    max_turn=positive,
    tolerance=positive,
    max_iterations=whole(1, 10**6),
    max_points=whole(2, 10**9),
    starts=whole(0, 10**6),
    max_branches=whole(1, 10**6),
)
@dataclass(frozen=True, kw_only=True)
class Continuation(Displayed):
    """Settings of pseudo-arclength continuation.

    Lengths are in scaled units: the range of the parameter is 1.

    Parameters
    ----------
    step : float
        Initial arclength step.
    min_step : float
        Minimum step; below it a branch ends with the outcome "step too small".
    max_step : float
        Maximum step, for smooth curves in figures.
    max_turn : float
        Maximum angle in radians between the tangents of consecutive points.
    tolerance : float
        Newton correction, in scaled units, at which a point is accepted; convergence is
        quadratic, so that the point is accurate to rounding.
    max_iterations : int
        Maximum Newton iterations in one step.
    max_points : int
        Maximum number of points of a branch.
    starts : int
        Interior values of the parameter at which equilibria are computed as starting points,
        in addition to both ends.
    max_branches : int
        Maximum number of branches of a diagram; reaching it is reported in its outcome.

    Raises
    ------
    ArgumentError
        If a value is not positive or min_step ≤ step ≤ max_step is violated.
    """

    step: float = 1e-2
    min_step: float = 1e-9
    max_step: float = 2e-2
    max_turn: float = 0.15
    tolerance: float = 1e-10
    max_iterations: int = 8
    max_points: int = 20_000
    starts: int = 7
    max_branches: int = 100

    def __post_init__(self) -> None:
        if not self.min_step <= self.step <= self.max_step:
            raise ArgumentError(
                "Continuation: expected min_step ≤ step ≤ max_step, received "
                f"{self.min_step:g}, {self.step:g}, {self.max_step:g}"
            )
