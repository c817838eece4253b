"""Points that the user asks for, as kinds of special points of equilibria."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from fastslow.continuation.curve_points import Criterion, always
from fastslow.continuation.location import Located
from fastslow.continuation.marks import ExpressionMark, Mark, Test, ValueMark, gradient
from fastslow.continuation.point_kinds import PointKind
from fastslow.diagrams.points.defining import CurveKind, DefiningSystem, PointInPlane
from fastslow.diagrams.points.marked_zeros import MarkSearch
from fastslow.diagrams.points.on_branches import Detected, SegmentSurvey
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

    def detected(self, survey: SegmentSurvey, *, opening: bool) -> Iterator[Detected]:
        """Locate all points of a segment.

        Parameters
        ----------
        survey : SegmentSurvey
        opening : bool
            Whether the first row belongs to no other segment.
        """
        if isinstance(self.mark, ExpressionMark):
            form = self.form()
            for one in MarkSearch(survey, self.mark).zeros(first=opening, last=True):
                yield Detected(
                    one.row, self, one.located, at_row=one.at_row, note=one.note, form=form
                )
        elif isinstance(self.mark, ValueMark):
            yield from self._at_value(survey, self.mark.value)

    def _at_value(self, survey: SegmentSurvey, value: float) -> Iterator[Detected]:
        segment, scale = survey.segment, survey.window.scale
        along = np.zeros(len(scale))
        along[-1] = 1.0

        def test(u: Array, _: Array) -> float:
            return float(u[-1] - value)

        def locate(u: Array) -> Located:
            return survey.field.refined(segment.region, u, scale, normal=along, point=value * along)

        for bracket in survey.brackets(segment.u[:, -1] - value, test):
            found = survey.solved(bracket, test, locate)
            if found is not None:
                yield Detected(bracket.row, self, found)

    def form(self, system: Any = None, found: Any = None) -> dict[str, Any]:
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


class MarkedCurveKind(CurveKind):
    """Zeros of an expression."""

    system = LevelSystem

    def start(self, place: PointInPlane) -> tuple[DefiningSystem, Array]:
        mark = ExpressionMark(place.point.mark, place.point.expression)
        region = self.region(place)
        system = LevelSystem(place.field, region, place.unit, place.span, mark)
        return system, system.start(place.u)

    def traced(self, system: DefiningSystem, place: PointInPlane) -> bool:
        same = isinstance(system, LevelSystem) and (
            system.mark.expression == place.point.expression
        )
        return same and super().traced(system, place)


MARKED = MarkedCurveKind(POINT_TYPES[USER_VALUE])
