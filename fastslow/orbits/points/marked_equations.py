"""The equations of orbits at which an expression in their numbers vanishes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fastslow.orbits.flow.problem import OrbitProblem
from fastslow.orbits.flow.shooting import Linearised, Shooting, ShootingSolution
from fastslow.orbits.points.marks import OrbitMark
from fastslow.orbits.points.special_points import Extended, row_units

Array = NDArray[np.float64]

#: Step of a difference of the expression along the surface of orbits, in units of the scales: the
#: cube root of rounding.
SURFACE_DIFFERENCE = 1e-5


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
    """

    problem: OrbitProblem
    shooting: Shooting
    scale: Array
    mark: OrbitMark
    unit: float = 0.0

    def __call__(self, u: Array) -> Extended:
        last = self.shooting.linearised(u)
        rows = row_units(self.shooting, last, self.scale)
        every = last.jacobian * self.scale / rows[:, None]
        surface = np.linalg.svd(every)[2][-2:]
        ends = np.array(
            [
                [
                    self.value(u + sign * SURFACE_DIFFERENCE * along * self.scale)
                    for sign in (1.0, -1.0)
                ]
                for along in surface
            ]
        )
        slopes = (ends[:, 0] - ends[:, 1]) / (2.0 * SURFACE_DIFFERENCE)
        self.unit = self.unit or float(np.abs(slopes).max()) or 1.0
        residual = np.append(last.residual / rows, self.value(u, last) / self.unit)
        jacobian = np.vstack([every, slopes @ surface / self.unit])
        return residual, jacobian, np.zeros(0, dtype=complex)

    def value(self, u: Array, last: Linearised | None = None) -> float:
        """The expression at unknowns, along a free run from their first state."""
        segments, period = self.shooting.unpack(u)
        here = self.problem.at(self.shooting.parameters_at(u))
        solution = ShootingSolution(u, last or self.shooting.linearised(u), 0.0, 0.0)
        return self.mark.value(here.orbit(segments, period, solution, confirm=False))
