"""Equilibria of the frozen model that move with the slow quantity, with their derivatives."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from fastslow.diagrams.correcting import corrections, point_at
from fastslow.diagrams.field import FrozenField
from fastslow.model.model import Model
from fastslow.passage.tipping.shifts import Shift
from fastslow.results.points import Equilibrium

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class MovingEquilibrium:
    """An equilibrium of the frozen model near a known one, at values of the slow quantity.

    Parameters
    ----------
    frozen : Model
        The frozen model, with values of all parameters.
    name : str
        The slow quantity.
    region : str
    near : ndarray, shape (n,)
        The known equilibrium.
    """

    frozen: Model
    name: str
    region: str
    near: Array

    @cached_property
    def field(self) -> FrozenField:
        return FrozenField(self.frozen, self.name)

    @cached_property
    def number(self) -> int:
        """Number of its region."""
        return self.field.regions.index(self.region)

    def state(self, value: float) -> Array | None:
        """The equilibrium at a value of the slow quantity, None without convergence."""
        return corrections(self.field)[self.number].corrected(self.near, value)

    def point(self, value: float) -> Equilibrium | None:
        state = self.state(value)
        return None if state is None else point_at(self.field, self.number, np.append(state, value))

    def slopes(self, state: Array, value: float) -> tuple[Array, Array]:
        """Jacobian (n, n) and derivative by the slow quantity (n,) of the rates."""
        found = self.field.residual_and_jacobian(self.number, np.append(state, value))[1]
        return found[:, :-1], found[:, -1]

    def adjoint(self, state: Array, value: float) -> tuple[float, Array]:
        """The eigenvalue of largest real part, and its left eigenvector ψ of length one."""
        return leading_adjoint(self.slopes(state, value)[0])

    def late(self, state: Array, value: float, speed: float) -> Array:
        """First-order correction x₁ = f_x⁻¹ (dx/dw) w' of a slowly moving equilibrium."""
        jacobian, by_value = self.slopes(state, value)
        moved = -np.linalg.solve(jacobian, by_value * speed)
        return np.asarray(np.linalg.solve(jacobian, moved))

    def by(self, shift: Shift, state: Array, time: float, name: str, side: int) -> Array:
        """Derivative of the equilibrium at a fixed time by a parameter of shift or rates, (n,)."""
        value = float(shift.at(time))
        jacobian, by_value = self.slopes(state, value)
        changed = by_value * shift.by(time, name, side)
        if name in self.frozen.parameters and name != self.name:
            changed = changed + self.by_parameter(state, value, name)
        return np.asarray(-np.linalg.solve(jacobian, changed))

    def by_parameter(self, state: Array, value: float, name: str) -> Array:
        """Derivative of the rates with respect to a parameter, shape (n,)."""
        field = FrozenField(self.frozen, self.name, name)
        u = np.append(state, [value, self.frozen.parameters[name]])
        return np.asarray(field.residual_and_jacobian(self.number, u)[1][:, -1])


def leading_adjoint(jacobian: Array) -> tuple[float, Array]:
    """The eigenvalue of largest real part of a matrix, and its left eigenvector of length one."""
    values, left = np.linalg.eig(jacobian.T)
    leading = int(np.argmax(values.real))
    vector = left[:, leading].real
    return float(values[leading].real), vector / np.linalg.norm(vector)
