"""The equations of curves of special points of periodic orbits in two parameters."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from fastslow.continuation import curves
from fastslow.continuation.curve_points import TracedRows
from fastslow.diagrams.curves.point_curves import Plane
from fastslow.orbits.points.curve_tests import Start, Tests
from fastslow.orbits.points.location import Extended

Array = NDArray[np.float64]

#: Distance from the first point of a stretch, in units of the unknowns, beyond which an iterate of
#: Newton's method is given up.
FARTHEST_ITERATE = 5.0


@dataclass(eq=False)
class PointSystem(curves.ExactSystem):
    """Extended equations in their own units, as a system of `curves`."""

    extended: Callable[[Array], Extended]
    scale: Array
    first: Array
    key: bytes = b""
    known: tuple[Array, Array] = field(default_factory=lambda: (np.zeros(0), np.zeros(0)))

    def residual(self, z: Array, guide: Array) -> Array:
        if z.ndim > 1:
            return np.array([self.residual(one, guide) for one in z])
        return self._at(z)[0]

    def slopes(self, z: Array, guide: Array) -> Array:
        return self._at(z)[1]

    def _at(self, z: Array) -> tuple[Array, Array]:
        if z.tobytes() != self.key:
            size = len(z) - 1
            # a step that is too long
            values, jacobian = np.full(size, np.nan), np.full((size, len(z)), np.nan)
            if np.abs((z - self.first) / self.scale).max() < FARTHEST_ITERATE:
                with suppress(np.linalg.LinAlgError):
                    values, jacobian, _ = self.extended(z)
            self.known, self.key = (values, jacobian / self.scale), z.tobytes()
        return self.known


@dataclass(frozen=True, eq=False)
class PointEquations:
    """The equations of a stretch of a curve, with their frame and tests."""

    start: Start
    system: PointSystem
    frame: curves.Frame
    scale: Array

    def rows(self, z: Array, plane: Plane) -> TracedRows[PointSystem]:
        return TracedRows(self.system, np.atleast_2d(z), self.frame, plane.continuation)

    def tests(self, z: Array) -> Tests:
        return Tests(self.start, self.scale, np.atleast_2d(z))


def equations_of(start: Start, plane: Plane) -> tuple[PointEquations, Array]:
    """The extended equations with their frame, and the first point."""
    shooting, u = start.shooting, start.u
    segments, period = shooting.unpack(u)
    K, N = len(segments), shooting.size
    spans = plane.upper - plane.lower
    scale = np.concatenate([np.tile(start.sizes, K), np.full(K + 1, period), spans])
    extended, more = start.kind.equations(start, scale)
    z, units = np.append(u, more), np.append(scale, np.ones(len(more)))
    # the length of a step does not depend on the number of segments
    lengths = units.copy()
    lengths[:N] *= np.sqrt(K)
    lower, upper = np.full(N + 2, -np.inf), np.full(N + 2, np.inf)
    lower[-2:], upper[-2:] = plane.lower, plane.upper
    frame = curves.Frame(N + 2, lengths, lower, upper)
    return PointEquations(start, PointSystem(extended, units, z), frame, scale), z
