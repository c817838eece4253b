"""Two-folds: both fields are tangent to an interface at a pseudo-equilibrium."""

from __future__ import annotations

from collections.abc import Callable
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from fastslow.continuation.curves import BOUND
from fastslow.diagrams.endings import TWO_FOLD_LEFT_REGION
from fastslow.diagrams.points.defining import ON_INTERFACE, CurveKind, DefiningSystem
from fastslow.diagrams.two_folds import weight_of
from fastslow.results.base.outcome import Outcome
from fastslow.results.point_types import POINT_TYPES, TWO_FOLD

Array = NDArray[np.float64]


class TwoFoldSystem(DefiningSystem):
    """(1 − α) f₁ + α f₂ = 0, h = 0, a = b: a pseudo-equilibrium at which both drifts vanish.

    The first equation implies that the drifts a = ∇h·f₁ and b = ∇h·f₂ vanish if they are equal.
    The extra unknown is α; for 0 ≤ α ≤ 1 the fields point in opposite directions, and the point
    is on the boundary of sliding. Its region is the sliding motion, whose field is 0/0 there.
    """

    code: ClassVar[str] = TWO_FOLD
    on_interface: ClassVar[bool] = True

    def bounds(self, bounded: bool) -> Callable[[Array], Array] | None:
        return self.edges if bounded else None

    def end(self, status: str, z: Array, where: str) -> Outcome | None:
        if status != BOUND:
            return None
        share, sides = float(z[self.width]), self.field.sides(self.region)
        reason = f"beyond it the points leave {self.field.regions[self.region]}"
        for side, weight in ((sides.above, share), (sides.below, 1.0 - share)):
            if abs(weight) <= ON_INTERFACE:
                reason = (
                    f"it is an equilibrium of region {self.field.regions[side]} there, and "
                    "beyond it both fields point to the same side"
                )
        return TWO_FOLD_LEFT_REGION.at(where=where, why=reason)

    def start(self, u: Array) -> Array:
        return np.append(u, weight_of(self.field, self.region, u))

    def residual(self, z: Array, guide: Array) -> Array:
        rows = z.reshape(-1, self.width + 1)
        u, share = rows[:, : self.width], rows[:, self.width :]
        sides = self.field.sides(self.region)
        above, _, h, gradients = self.field.evaluate(sides.above, u)
        below = self.field.evaluate(sides.below, u)[0]
        interface, n = sides.interface, self.n
        # the gradient is normalized, for independence of the unit of h
        edge = gradients[:, interface] * self.scales
        size = np.linalg.norm(edge[:, :n], axis=1, keepdims=True)
        size = np.where(size > 0, size, 1.0)
        first, second = above / self.unit, below / self.unit
        drifts = np.einsum("ij,ij->i", edge[:, :n] / size, first - second)
        both = np.column_stack(
            [(1.0 - share) * first + share * second, h[:, interface] / size[:, 0], drifts]
        )
        return both.reshape(*z.shape[:-1], self.n + 2)

    def edges(self, z: Array) -> Array:
        """α, 1 − α and the bounds by interfaces, positive at points of sliding."""
        share = z[self.width]
        return np.append([share, 1.0 - share], self.heights(z)[: len(self.field.interfaces)])

    def inside(self, z: Array, but: int | None = None) -> bool:
        """Return whether the fields point in opposite directions, within all other interfaces."""
        return bool(np.all(self.edges(z) >= -ON_INTERFACE))


class TwoFoldKind(CurveKind):
    """Two-folds: both fields are tangent to an interface."""

    system = TwoFoldSystem


TWO_FOLDS = TwoFoldKind(POINT_TYPES[TWO_FOLD])
