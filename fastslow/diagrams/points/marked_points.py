"""Points that the user asks for, as a kind of special points of equilibria."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from fastslow.continuation.curve_points import Criterion, always
from fastslow.continuation.marks import ExpressionMark, Mark, Test, ValueMark, gradient
from fastslow.continuation.point_kinds import PointKind
from fastslow.diagrams.points.defining import DefiningSystem
from fastslow.results.point_types import POINT_TYPES, USER_VALUE, PointType

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class LevelSystem(DefiningSystem):
    """F = 0, g = 0 with an expression g; no extra unknowns."""

    code: ClassVar[str] = USER_VALUE
    mark: ExpressionMark

    def start(self, u: Array) -> Array:
        return u.copy()

    @cached_property
    def test(self) -> Test:
        """G at points (states, parameters)."""
        model = self.field.model
        return self.mark.test((*model.states, *self.field.varying), model.parameters)

    def residual(self, z: Array, guide: Array) -> Array:
        rates = self.at(z)[0]
        slopes = np.abs(gradient(self.test, guide, self.scales)) @ self.scales
        values = self.test(z) / (slopes if slopes > 0 else 1.0)
        return np.concatenate([rates, values[..., None]], axis=-1)


@dataclass(frozen=True)
class MarkedKind(PointKind):
    """Points of one mark.

    Parameters
    ----------
    mark : Mark
    """

    record: PointType
    mark: Mark

    @classmethod
    def given(cls, mark: Mark) -> MarkedKind:
        return cls(POINT_TYPES[USER_VALUE], mark)

    @property
    def words(self) -> str:
        return self.mark.words

    def form(self, system: Any, found: Any) -> dict[str, Any]:
        """Return the name and the expression."""
        if isinstance(self.mark, ExpressionMark):
            return {"mark": self.mark.name, "expression": self.mark.expression}
        return {}

    def criterion(self, system: DefiningSystem) -> Criterion:
        """Return the test of the mark along a curve of any kind."""
        if isinstance(self.mark, ValueMark):
            value, k = self.mark.value, system.field.varying.index(self.mark.parameter)
            place, span = system.n + k, system.span[k]
            return Criterion(
                self, lambda z: (float(z[place] - value) / span, 1.0), always, system.region
            )
        model, w = system.field.model, system.width
        test = self.mark.test((*model.states, *system.field.varying), model.parameters)

        def terms(z: Array) -> tuple[float, float]:
            u = z[:w]
            slopes = np.abs(gradient(test, u, system.scales))
            return float(test(u)), float(slopes @ np.maximum(np.abs(u), system.scales))

        return Criterion(self, terms, always, system.region, touching=True)
