"""Equilibria on interfaces without a closed form: at two-folds and along several interfaces."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from fastslow.diagrams.solve.equilibrium_sets import SEARCHED_REACH, XTOL, ZERO_FUNCTION, Family
from fastslow.model.functions import numpy_function
from fastslow.results.branch.equilibrium_sets import EquilibriumSet

Array = NDArray[np.float64]

#: Number of points, over all unknowns, from which solutions are searched.
SET_STARTS = 729

#: Newton steps from each of them.
SET_NEWTON_STEPS = 40

#: Full steps of a single unknown after which a search ends: others started where it leads.
FULL_STEPS = 6

#: Singular value, relative to the largest, below which solutions are not isolated.
NOT_ISOLATED = 1e-9

#: Relative distance of two copies of a solution.
COPY_DISTANCE = 1e-7


@dataclass(frozen=True, eq=False)
class ImplicitFamily(Family):
    """Isolated equilibria of one sliding motion, roots of equations in the free coordinates.

    They are searched by Newton's method within `SEARCHED_REACH` natural units, or one period of an
    angle.

    Parameters
    ----------
    equations : tuple of sympy.Expr
        At least as many as free coordinates.
    """

    equations: tuple[sp.Expr, ...]

    @property
    def dimension(self) -> int:
        return 0

    @property
    def exact(self) -> bool:
        return False

    @cached_property
    def _system(self) -> Callable[..., Any]:
        rows = sp.Matrix(self.equations)
        return numpy_function(
            self._symbols, [list(rows), rows.jacobian(self.free).tolist()], cse=True
        )

    def _evaluated(self, value: float, places: Array) -> tuple[Array, Array]:
        """Return residuals, shape (N, m), and their derivatives, shape (N, m, d)."""
        with np.errstate(all="ignore"):
            left, slopes = self._system(np.float64(value), *places.T)
        flat = [e for row in slopes for e in row]
        whole = np.array(np.broadcast_arrays(*left, *flat, places[:, 0])[:-1], dtype=float).T
        m, d = len(self.equations), len(self.free)
        return whole[:, :m], whole[:, m:].reshape(-1, m, d)

    def _roots(self, value: float) -> list[Array]:
        """Return the solutions found, in ascending order."""
        names, periods = self.field.model.states, self.field.periods
        turns = periods[[names.index(c.name) for c in self.free]]
        units = self._units(value)
        reach = np.where(turns > 0, 0.5 * turns * (1.0 + COPY_DISTANCE), SEARCHED_REACH * units)
        d = len(self.free)
        count = int(np.ceil(SET_STARTS ** (1.0 / d)))
        axes = [np.linspace(-r, r, count) for r in reach]
        places = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, d)
        most = 2.0 * reach / (count - 1)
        moving = np.ones(len(places), dtype=bool)
        for step in range(SET_NEWTON_STEPS):
            left, slopes = self._evaluated(value, places[moving])
            sound = np.isfinite(left).all(axis=1) & np.isfinite(slopes).all(axis=(1, 2))
            scaled = np.where(np.reshape(sound, (-1, 1, 1)), slopes * units, 0.0)
            left = np.where(np.reshape(sound, (-1, 1)), left, 0.0)
            if scaled.shape[1:] == (1, 1):
                inverses = 1.0 / np.where(scaled == 0.0, np.inf, scaled)
            else:
                inverses = np.linalg.pinv(scaled, rcond=NOT_ISOLATED)
            steps = (inverses @ left[..., None])[..., 0] * units
            # steps of at most the distance of the starting points, so that no root is passed
            places[moving] -= np.clip(steps, -most, most)
            still = (np.abs(steps) <= XTOL * reach).all(axis=1)
            outside = (np.abs(places[moving]) > 2.0 * reach).any(axis=1)
            if d == 1 and step >= FULL_STEPS:
                outside |= np.abs(steps[:, 0]) > most
            moving[moving] = ~(still | outside)
            if not moving.any():
                break
        left, slopes = self._evaluated(value, places)
        sizes = np.abs(slopes) @ np.maximum(np.abs(places), units)[..., None]
        solved = (np.abs(left) <= ZERO_FUNCTION * sizes[..., 0]).all(axis=1)
        near = np.logical_and(solved, (np.abs(places) <= reach * (1.0 + COPY_DISTANCE)).all(axis=1))
        found: list[Array] = []
        for place, slope in zip(places[near], slopes[near], strict=True):
            singular = np.linalg.svd(slope * units, compute_uv=False)
            if len(singular) < d or singular[-1] <= NOT_ISOLATED * singular[0]:
                # of a continuum, or not determined
                continue
            same = (
                np.abs(place - o) <= COPY_DISTANCE * np.maximum(np.abs(o), units) for o in found
            )
            if not any(s.all() for s in same):
                found.append(np.where(np.abs(place) <= XTOL * reach, 0.0, place))
        return sorted(found, key=lambda place: place.tolist())

    def _sets(self, value: float) -> list[EquilibriumSet]:
        found = []
        for place in self._roots(value):
            free = tuple(place.tolist())
            if (self.values(value, *free) >= -ZERO_FUNCTION).all():
                state = self.state(value, *free)
                found.append(self._made(value, free, state, state, state[None]))
        return found

    def contains(self, u: Array, unit: Array | float) -> bool:
        if not super().contains(u, unit):
            return False
        names = self.field.model.states
        place = np.array([[float(u[names.index(c.name)]) for c in self.free]])
        left, slopes = self._evaluated(float(u[-1]), place)
        sizes = np.abs(slopes) @ np.maximum(np.abs(place), np.max(unit))[..., None]
        return bool((np.abs(left) <= 10.0 * ZERO_FUNCTION * sizes[..., 0]).all())
