"""Computation of equilibria near given states by Newton's method."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import NDArray

from fastslow.continuation.polynomial_systems import FARTHEST
from fastslow.continuation.spaces import Limits
from fastslow.diagrams.field import FrozenField
from fastslow.results.points import Equilibrium
from fastslow.results.stored.model import StoredModel

Array = NDArray[np.float64]

#: Largest residual of a rate at an equilibrium, relative to its terms.
RESIDUAL = 1e-9

#: A state is on a pole if its rounding changes a rate by more than this fraction of its natural
#: size.
POLE = 1e-2

#: Largest displacement of an equilibrium by rounding in the rates, relative to its unit.
UNCERTAIN = 1e-3

#: Least size of the terms of a row, relative to those at the units of the states.
LEAST_ROW_SIZE = 1e-100

#: Largest correction of a proven solution by Newton's method, relative to its size.
PROVEN_CORRECTION = 1e-6

#: Fraction of the size of a state over which the rates of an equilibrium must exceed rounding, and
#: rounding errors of a rate in units of the last place.
RESOLVED_FRACTION, RATE_ROUNDINGS = 0.1, 8.0

#: Multiples of the units at which the size of rates is measured where the units are on a pole.
UNITS_BESIDE_POLE = (1.1, 1.3)

#: Criteria of a clear equilibrium; other solutions are examined further.
PLAIN = Limits(
    residual=RESIDUAL, correction=1e-6, pole=0.5 * POLE, moved=1e6, farthest=FARTHEST, beside=1e-12
)


@dataclass(frozen=True, eq=False)
class Corrections:
    """Newton's method for equilibria of one region or sliding motion, with its acceptance tests.

    Parameters
    ----------
    field : FrozenField
    region : int
        Number of the region.
    """

    field: FrozenField
    region: int

    def unit(self, value: float) -> Array:
        """Natural unit of each state at a parameter value."""
        return self.field.units_at(abs(value))[: self.field.n]

    @cached_property
    def _naturally(self) -> dict[float, Array]:
        return {}

    def _natural(self, value: float) -> Array:
        """Size of each rate at the natural units of the states, cached by value."""
        if value not in self._naturally:
            self._naturally[value] = self._size(value, self.unit(value))
        return self._naturally[value]

    def _parameter_unit(self, value: float) -> float:
        """Size of the parameter; its natural unit if it is zero."""
        return abs(value) or float(self.field.units[self.field.n])

    def _size(self, value: float, unit: Array) -> Array:
        """Size of each rate at the units of the states, beside them where they are on a pole."""
        for near in (1.0, np.linspace(*UNITS_BESIDE_POLE, len(unit))):
            u = np.append(near * unit, value)
            rates, slopes = self.field.residual_and_jacobian(self.region, u)
            with np.errstate(all="ignore"):
                size = np.abs(rates) + np.abs(slopes[:, :-1]) @ u[:-1]
            if np.isfinite(size).all():
                break
        return np.where(np.isfinite(size), size, 0.0)

    def corrected(self, state: Array, value: float, *, proved: bool = False) -> Array | None:
        """Return the equilibrium near a state at a parameter value, None without convergence.

        With ``proved`` the rates need not be small relative to their slopes: near a pole the
        terms of both cancel.
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
        # at a double root the corrections stay near the square root of rounding
        if not (np.isfinite(found.residual) and found.correction < PLAIN.correction):
            return None
        solved = found.u[:-1]
        rates, slopes = self.field.residual_and_jacobian(self.region, found.u)
        # not at the unit of a state far below it: a slope that is large because of another, large
        # state would permit any residual
        terms = np.abs(slopes[:, :-1]) @ np.abs(solved)
        small = np.abs(rates) <= RESIDUAL * (natural + terms)
        if np.any(np.abs(rates) > RESIDUAL * natural):
            # steep slopes permit a residual only if they determine the state
            small &= _determined(slopes[:, :-1], terms, scale[:-1])
        near = np.abs(solved - state) < PLAIN.moved * scale[:-1]
        within = np.abs(solved) <= PLAIN.farthest * scale[:-1]
        there = abs(found.u[-1] - value) <= PLAIN.beside * scale[-1]
        here = bool(np.all(np.abs(solved - state) <= PROVEN_CORRECTION * scale[:-1]))
        on_pole = np.any(np.finfo(float).eps * terms > POLE * natural)
        good = small.all()
        if proved:
            good = not on_pole and (good or here)
        return solved if there and good and near.all() and within.all() else None

    def corrected_many(self, states: Array, values: Array) -> Array:
        """Return equilibria near states (N, n) at values (N,), NaN without convergence.

        Unclear solutions are examined one by one.
        """
        n, field = self.field.n, self.field
        units = np.array([self.unit(v) for v in values.tolist()])
        sizes_of_values = [self._parameter_unit(v) for v in values.tolist()]
        scales = np.column_stack([np.maximum(units, np.abs(states)), sizes_of_values])
        natural, slopes, _, _ = field.evaluate(self.region, np.column_stack([units, values]))
        with np.errstate(all="ignore"):
            natural = np.abs(natural) + (np.abs(slopes[:, :, :n]) @ units[:, :, None])[:, :, 0]
        for k in np.flatnonzero(~np.isfinite(natural).all(axis=1)).tolist():
            natural[k] = self._natural(float(values[k]))
        starts = np.column_stack([states, values])
        points, plain = field.solved(self.region, starts, scales, natural, PLAIN)
        solved = points[:, :n]
        for k in np.flatnonzero(~plain).tolist():
            alone = self.corrected(states[k], float(values[k]))
            solved[k] = np.nan if alone is None else alone
        return solved

    def by_rounding(self, state: Array, value: float) -> bool:
        """Return whether rates vanish at a state by rounding alone, as on an asymptote.

        They are then below their rounding errors on at least one side, far along the direction
        in which they depend least on the states.
        """
        u = np.append(state, value)
        scale, natural = np.maximum(self.unit(value), np.abs(state)), self._natural(value)
        least = RATE_ROUNDINGS * np.finfo(float).eps * natural
        _, slopes = self.field.residual_and_jacobian(self.region, u)
        matrix = slopes[:, :-1] * scale / np.where(natural > 0, natural, 1.0)[:, None]
        if not np.isfinite(matrix).all():
            return False
        along = np.append(RESOLVED_FRACTION * scale * np.linalg.svd(matrix)[2][-1], 0.0)
        sides = (self.field.residual_and_jacobian(self.region, u + s * along)[0] for s in (-1, 1))
        return any(bool((np.abs(rates) <= least).all()) for rates in sides)

    def _at_two_fold(self, solved: Array, value: float) -> bool:
        """Return whether a pseudo-equilibrium is a two-fold, where the sliding field is 0/0."""
        if self.field.modes[self.region].sides is None:
            return False
        u = np.append(solved, value)
        _, _, h, slopes = self.field.evaluate(self.region, u)
        unit = np.append(self.unit(value), self._parameter_unit(value))
        size = np.abs(slopes) @ np.maximum(np.abs(u), unit)
        return bool(np.all(np.abs(h[-2:]) <= 1e-9 * size[-2:]))


def _determined(slopes: Array, terms: Array, scale: Array) -> bool:
    """Return whether the Newton equations determine the state in spite of rounding.

    The bound is |J⁻¹| |J| |x| times the rounding unit (Skeel 1979). If a factor such as exp(100)
    multiplies a difference that is zero to rounding, the slopes of all rates are numerically
    parallel, and the other states are undetermined.
    """
    # all terms of a row vanish where its states are zero
    least = np.maximum(LEAST_ROW_SIZE * (np.abs(slopes) @ scale), np.finfo(float).tiny)
    matrix = slopes * scale / np.maximum(terms, least)[:, None]
    try:
        inverse = np.linalg.inv(matrix)
    except np.linalg.LinAlgError:
        return False
    return bool(np.abs(inverse).sum(axis=1).max() * np.finfo(float).eps < UNCERTAIN)


@lru_cache(maxsize=64)
def corrections(field: FrozenField) -> tuple[Corrections, ...]:
    """Return the corrections of every region and sliding motion."""
    return tuple(Corrections(field, number) for number in range(len(field.regions)))


def point_at(
    field: FrozenField, region: int, u: Array, admissible: bool = True, continuum: bool = False
) -> Equilibrium:
    """Return the equilibrium at a point u, with its eigenvalues."""
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
        contact_forces=field.contact_forces(region, u),
        source=None if isinstance(field.model, StoredModel) else field.model,
    )
