"""The equations of orbits at which an expression in their numbers vanishes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fastslow.continuation.curve_points import Criterion, always
from fastslow.continuation.marks import ValueMark
from fastslow.continuation.point_kinds import PointKind
from fastslow.continuation.zeros import TEST_ROUNDING
from fastslow.orbits.flow.problem import OrbitProblem
from fastslow.orbits.flow.shooting import Linearised, Shooting, ShootingSolution
from fastslow.orbits.points.curve_tests import Start
from fastslow.orbits.points.location import Extended, row_units
from fastslow.orbits.points.marks import OrbitMark
from fastslow.results.orbits.orbit import Orbit
from fastslow.results.point_types import USER_VALUE, PointType, kind_of

Array = NDArray[np.float64]

#: Step of a difference of the expression along the surface of orbits, in units of the scales: the
#: cube root of rounding.
SURFACE_DIFFERENCE = 1e-5

#: Distance, in units of the scales, up to which these derivatives are used again: the last steps
#: of Newton's method begin nearer to the point.
SAME_DERIVATIVES = 0.01


@dataclass(eq=False)
class MarkEquations:
    """The equations of orbits over two parameters with a vanishing expression.

    The derivatives of the expression are differences along the surface of orbits alone: Newton's
    method satisfies the equations of the orbits to second order.

    Parameters
    ----------
    problem : OrbitProblem
    shooting : Shooting
        With two chosen parameters.
    scale : ndarray, shape (N + 2,)
    mark : OrbitMark
    unit : float
        Of the expression; by default its slope where the equations are first called.
    place, gradient : ndarray, shape (N + 2,)
        Where the derivatives of the expression were last computed, and they, in units of the
        scales.
    """

    problem: OrbitProblem
    shooting: Shooting
    scale: Array
    mark: OrbitMark
    unit: float = 0.0
    place: Array | None = None
    gradient: Array = field(default_factory=lambda: np.zeros(0))

    def __call__(self, u: Array) -> Extended:
        last = self.shooting.linearised(u)
        rows = row_units(self.shooting, last, self.scale)
        every = last.jacobian * self.scale / rows[:, None]
        surface = np.linalg.svd(every)[2][-2:]
        if self.place is None or np.abs((u - self.place) / self.scale).max() > SAME_DERIVATIVES:
            slopes = np.array([self._slope(u, along) for along in surface])
            self.unit = self.unit or float(np.abs(slopes).max()) or 1.0
            self.place, self.gradient = u.copy(), slopes @ surface
        along = surface.T @ (surface @ self.gradient)
        residual = np.append(last.residual / rows, self.value(u, last) / self.unit)
        return residual, np.vstack([every, along / self.unit]), np.zeros(0, dtype=complex)

    def _slope(self, u: Array, along: Array) -> float:
        """Derivative of the expression along a direction of the surface."""
        move = SURFACE_DIFFERENCE * along * self.scale
        return (self.value(u + move) - self.value(u - move)) / (2.0 * SURFACE_DIFFERENCE)

    def value(self, u: Array, last: Linearised | None = None) -> float:
        """The expression at unknowns."""
        return self.mark.value(orbit_at(self.problem, self.shooting, u, last))


def orbit_at(
    problem: OrbitProblem, shooting: Shooting, u: Array, last: Linearised | None = None
) -> Orbit:
    """The free run of one period from the first state of unknowns."""
    segments, period = shooting.unpack(u)
    solution = ShootingSolution(u, last or shooting.linearised(u), 0.0, 0.0)
    here = problem.at(shooting.parameters_at(u))
    return here.orbit(segments, period, solution, confirm=False)


@dataclass(frozen=True)
class MarkOnCurve(PointKind):
    """Points of a mark on a curve of special points of orbits.

    Parameters
    ----------
    mark : ValueMark or OrbitMark
    """

    record: PointType
    mark: ValueMark | OrbitMark

    @classmethod
    def given(cls, mark: ValueMark | OrbitMark) -> MarkOnCurve:
        return cls(kind_of(USER_VALUE), mark)

    @property
    def words(self) -> str:
        return self.mark.words

    def form(self, system: Any, found: Any) -> dict[str, Any]:
        """Return the name and the expression."""
        if isinstance(self.mark, OrbitMark):
            return {"mark": self.mark.name, "expression": self.mark.expression}
        return {}

    def criterion(self, start: Start, names: Sequence[str], spans: Array) -> Criterion:
        """Return the test of the mark along a curve.

        Parameters
        ----------
        start : Start
        names : sequence of str
            Both parameters.
        spans : ndarray, shape (2,)
            Lengths of their ranges.
        """
        mark = self.mark
        if isinstance(mark, ValueMark):
            k = list(names).index(mark.parameter)
            place, value, span = start.width - 2 + k, mark.value, float(spans[k])
            return Criterion(
                self, lambda z: (float(z[place] - value) / span, 1.0), always, touching=True
            )
        assert start.problem is not None
        problem, shooting, width = start.problem, start.shooting, start.width

        def terms(z: Array) -> tuple[float, float]:
            orbit = orbit_at(problem, shooting, z[:width])
            return mark.value(orbit), mark.rounding(orbit) / TEST_ROUNDING

        return Criterion(self, terms, always, touching=True)
