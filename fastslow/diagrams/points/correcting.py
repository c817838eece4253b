"""Equilibria solved for near given states, and what is known at them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import NDArray

from fastslow.continuation.polynomial_systems import FARTHEST
from fastslow.continuation.spaces import Limits
from fastslow.diagrams.field import FrozenField
from fastslow.results.points import Equilibrium

Array = NDArray[np.float64]

#: Residual of a rate at an equilibrium, relative to the size of its terms.
RESIDUAL = 1e-9

#: Where rounding of the state changes a rate by more than this part of its natural size, the state
#: is on a pole.
POLE = 1e-2

#: Relative to its unit, what rounding in the rates may move the state of an equilibrium by.
UNCERTAIN = 1e-3

#: Newton's method moves a solution that is proved by less, in units of its size.
MOVED = 1e-6

#: What plainly is an equilibrium; all else is looked at closely.
PLAIN = Limits(
    residual=RESIDUAL, correction=1e-6, pole=0.5 * POLE, moved=1e6, farthest=FARTHEST, beside=1e-12
)


@dataclass(frozen=True, eq=False)
class Corrections:
    """Newton's method for the equilibria of one region, or of sliding, and what it is judged by.

    Parameters
    ----------
    field : FrozenField
    region : int
        Number of the region.
    """

    field: FrozenField
    region: int

    def unit(self, value: float) -> Array:
        """Natural unit of each state where the parameter has a value."""
        return self.field.units_at(abs(value))[: self.field.n]

    @cached_property
    def _naturally(self) -> dict[float, Array]:
        return {}

    def _natural(self, value: float) -> Array:
        """Size of each rate where the states have their natural units, kept for every value."""
        if value not in self._naturally:
            self._naturally[value] = self._size(value, self.unit(value))
        return self._naturally[value]

    def _parameter_unit(self, value: float) -> float:
        """Size of the parameter, its natural unit where it is zero."""
        return abs(value) or float(self.field.units[self.field.n])

    def _size(self, value: float, unit: Array) -> Array:
        """Size of each rate where the states have their units."""
        rates, slopes = self.field.residual_and_jacobian(self.region, np.append(unit, value))
        with np.errstate(all="ignore"):
            size = np.abs(rates) + np.abs(slopes[:, :-1]) @ unit
        return np.where(np.isfinite(size), size, 0.0)

    def corrected(self, state: Array, value: float, *, proved: bool = False) -> Array | None:
        """The equilibrium near a state at a parameter value, None without convergence.

        Next to one that is proved the rates need not be small beside their slopes: near a pole
        the terms of both cancel.
        """
        solved = self._corrected(state, value, proved)
        return None if solved is None or self._at_two_fold(solved, value) else solved

    def _corrected(self, state: Array, value: float, proved: bool) -> Array | None:
        unit, natural, u = self.unit(value), self._natural(value), np.append(state, value)
        scale = np.append(np.maximum(unit, np.abs(state)), self._parameter_unit(value))
        points, plain = self.field.solved(self.region, u[None], scale[None], natural[None], PLAIN)
        if plain[0]:
            return np.asarray(points[0, :-1])
        target = np.append(np.zeros(len(state)), 1.0)
        found = self.field.refined(self.region, u, scale, normal=target, point=value * target)
        # at a double root Newton's last corrections stay near the root of the rounding
        if not (np.isfinite(found.residual) and found.correction < PLAIN.correction):
            return None
        solved = found.u[:-1]
        rates, slopes = self.field.residual_and_jacobian(self.region, found.u)
        # not of the unit where a state is far below it: a slope that is large because another
        # state is far away would forgive any residual
        terms = np.abs(slopes[:, :-1]) @ np.abs(solved)
        small = np.abs(rates) <= RESIDUAL * (natural + terms)
        if np.any(np.abs(rates) > RESIDUAL * natural):
            # steep slopes forgive a residual only where they determine the state
            small &= _determined(slopes[:, :-1], terms, scale[:-1])
        near = np.abs(solved - state) < PLAIN.moved * scale[:-1]
        within = np.abs(solved) <= PLAIN.farthest * scale[:-1]
        there = abs(found.u[-1] - value) <= PLAIN.beside * scale[-1]
        here = bool(np.all(np.abs(solved - state) <= MOVED * scale[:-1]))
        on_pole = np.any(np.finfo(float).eps * terms > POLE * natural)
        good = small.all()
        if proved:
            good = not on_pole and (good or here)
        return solved if there and good and near.all() and within.all() else None

    def corrected_many(self, states: Array, values: Array) -> Array:
        """As `corrected` at many states (N, n) and values (N,), NaN without convergence.

        What is not plainly a solution is judged by itself.
        """
        n, field = self.field.n, self.field
        units = np.array([self.unit(v) for v in values.tolist()])
        sizes_of_values = [self._parameter_unit(v) for v in values.tolist()]
        scales = np.column_stack([np.maximum(units, np.abs(states)), sizes_of_values])
        natural, slopes, _, _ = field.evaluate(self.region, np.column_stack([units, values]))
        with np.errstate(all="ignore"):
            natural = np.abs(natural) + (np.abs(slopes[:, :, :n]) @ units[:, :, None])[:, :, 0]
            natural = np.where(np.isfinite(natural), natural, 0.0)
        starts = np.column_stack([states, values])
        points, plain = field.solved(self.region, starts, scales, natural, PLAIN)
        solved = points[:, :n]
        for k in np.flatnonzero(~plain).tolist():
            alone = self.corrected(states[k], float(values[k]))
            solved[k] = np.nan if alone is None else alone
        return solved

    def _at_two_fold(self, solved: Array, value: float) -> bool:
        """Whether a pseudo-equilibrium is a two-fold, where the sliding field is 0/0."""
        if self.field.modes[self.region].sides is None:
            return False
        u = np.append(solved, value)
        _, _, h, slopes = self.field.evaluate(self.region, u)
        unit = np.append(self.unit(value), self._parameter_unit(value))
        size = np.abs(slopes) @ np.maximum(np.abs(u), unit)
        return bool(np.all(np.abs(h[-2:]) <= 1e-9 * size[-2:]))


def _determined(slopes: Array, terms: Array, scale: Array) -> bool:
    """Whether rounding in the terms of the rates leaves the solution of Newton's equations sure.

    The bound is |J⁻¹| |J| |x| times the rounding unit (Skeel 1979). Where a factor such as
    exp(100) multiplies a difference that rounding makes zero, the slopes of all rates are
    parallel to rounding, and the other states are free.
    """
    matrix = slopes * scale / np.maximum(terms, np.finfo(float).tiny)[:, None]
    try:
        inverse = np.linalg.inv(matrix)
    except np.linalg.LinAlgError:
        return False
    return bool(np.abs(inverse).sum(axis=1).max() * np.finfo(float).eps < UNCERTAIN)


@lru_cache(maxsize=64)
def corrections(field: FrozenField) -> tuple[Corrections, ...]:
    """Those of every region, and of the sliding motions."""
    return tuple(Corrections(field, number) for number in range(len(field.regions)))


def point_at(
    field: FrozenField, region: int, u: Array, admissible: bool = True, continuum: bool = False
) -> Equilibrium:
    """The equilibrium at a point u, with its eigenvalues."""
    rates, _ = field.residual_and_jacobian(region, u)
    return Equilibrium(
        field.model.states,
        field.wrapped(u[:-1]),
        {**field.model.parameters, field.parameter: float(u[-1])},
        field.regions[region],
        admissible,
        field.eigenvalues(region, u),
        float(np.abs(rates).max()),
        continuum,
    )
