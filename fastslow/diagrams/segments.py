"""Segments of branches in one region, and the window in which branches are traced."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fastslow.continuation.location import Located
from fastslow.diagrams.field import FrozenField
from fastslow.results.branch.windows import ON_EDGE, StateWindow

Array = NDArray[np.float64]

#: Component along a coordinate of a tangent that is within an edge of the window, in its unit.
ALONG_EDGE = 1e-6


@dataclass(frozen=True)
class Window:
    """Ranges of parameter and states in which branches are traced, with units.

    Parameters
    ----------
    lower, upper : float
        Range of the parameter.
    scale : ndarray, shape (n + 1,)
        Unit of each state and of the parameter.
    states : StateWindow
        Range of every state.
    """

    lower: float
    upper: float
    scale: Array
    states: StateWindow

    @property
    def weight(self) -> Array:
        return self.scale**-2.0

    def contains(self, u: Array) -> bool:
        """Return whether the states of a point u are in their window."""
        return bool(self.states.contains(u[:-1], self.scale[:-1]))

    def at_bounds(self, u: Array) -> NDArray[np.bool_]:
        """Return which states of a point u are at a bound of their window, shape (n,)."""
        at_lower = u[:-1] == np.array(self.states.lower)
        return np.asarray(at_lower | (u[:-1] == np.array(self.states.upper)))

    def leads_out(self, u: Array, tangent: Array) -> bool:
        """Return whether a direction from a point on an edge of the window leaves it."""
        low, high = np.array(self.states.lower), np.array(self.states.upper)
        slack = ON_EDGE * self.scale[:-1]
        moved = tangent[:-1] / self.scale[:-1]
        # of a direction within the edge the component across it is a rounding error
        out = (u[:-1] <= low + slack) & (moved < -ALONG_EDGE)
        return bool(np.any(out | (u[:-1] >= high - slack) & (moved > ALONG_EDGE)))

    def distance(self, one: Array, other: Array) -> float:
        """Distance of two points in units of the window."""
        return float(np.linalg.norm((one - other) / self.scale))

    def size(self, u: Array) -> Array:
        """Size of each component of a point: its modulus, or its unit where that is larger."""
        return np.maximum(np.abs(u), self.scale)


@dataclass(frozen=True, eq=False)
class BranchSegment:
    """A segment of a branch in one region: points u and unit tangents, shape (N, n + 1)."""

    region: int
    u: Array
    tangents: Array

    def chords(self, scale: Array) -> Array:
        """Return the lengths of the steps in units of the scale."""
        # reduction over a short last axis is slow in NumPy
        columns = np.ascontiguousarray(self.u.T)
        steps = np.diff(columns) / scale[:, None]
        return np.asarray(np.sqrt((steps * steps).sum(axis=0)))

    def reversed(self) -> BranchSegment:
        return BranchSegment(self.region, self.u[::-1].copy(), -self.tangents[::-1])


def on_normal_plane(
    field: FrozenField, region: int, point: Array, normal: Array, guess: Array, window: Window
) -> Located:
    """Solve for the intersection of the curve with the plane through a point with a normal."""
    return field.refined(region, guess, window.scale, normal=normal, point=point)


def oriented_tangent(
    field: FrozenField, region: int, u: Array, along: Array, window: Window
) -> Array:
    """Return the unit tangent of the curve at a point, oriented along a direction."""
    tangent, _ = field.tangent(region, u, window.weight)
    return tangent if (tangent * window.weight) @ along >= 0 else -tangent
