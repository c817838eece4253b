"""Continua of equilibria in regions: lines, planes, … on which the rates of a region vanish.

A line is divided where the number of unstable eigenvalues may change along it: where the last
coefficient of the characteristic polynomial without the zeros along the line vanishes, or the
last but one Hurwitz determinant (Gantmacher 1959, chapter 15).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from itertools import pairwise

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from fastslow.diagrams.field import FrozenField
from fastslow.diagrams.modes import walls_of
from fastslow.diagrams.solve.equations import RegionEquations
from fastslow.diagrams.solve.equilibrium_sets import Family, numbers_of
from fastslow.diagrams.solve.exact_polynomials import (
    coefficient_function,
    numerator,
    ratios,
    real_roots,
)
from fastslow.diagrams.solve.motion_equations import region_equations
from fastslow.model.motions import regions_of
from fastslow.model.rational import exact
from fastslow.model.structure import real
from fastslow.results.branch.equilibrium_sets import EquilibriumSet

Array = NDArray[np.float64]

#: Number of states up to which stability along a line is decided.
STABILITY_STATES = 6

#: Place of the free states, in natural units, at which nothing vanishes by chance.
GENERIC = 0.6180339887498949


@dataclass(frozen=True, eq=False)
class RegionFamily(Family):
    """Equilibria of a region as functions of free states and the parameter.

    Parameters
    ----------
    sides : tuple of int
        Regions that contain the set: the own one, and those across an interface in which it is.
    """

    sides: tuple[int, ...]

    def _linear(self, u: Array) -> tuple[bool | None, NDArray[np.complex128], bool]:
        found = [self.field.finite_eigenvalues(k, u) for k in self.sides]
        decays = all(map(self._decays, found))
        # two linear flows that decay may grow together in three dimensions or more
        decided = len(found) == 1 or self.field.n - self.dimension <= 2
        decided &= self._changes is not None and (self.dimension == 1 or not self._changes)
        attracting = None if decays and not decided else True
        return attracting, found[0].astype(complex), decays and decided

    @cached_property
    def exact(self) -> bool:
        """Whether the computed sets are provably complete, and stability is known along them."""
        return super().exact and (self.dimension > 1 or self._changes is not None)

    def _sets(self, value: float) -> list[EquilibriumSet]:
        if not np.isfinite(self.state(value, *(GENERIC * self._units(value)))).all():
            # a state diverges at this value
            return []
        if self.dimension != 1:
            return super()._sets(value)
        return [self._interval(value, *segment) for segment in self._pieces(value)]

    def _pieces(self, value: float) -> list[tuple[float, float]]:
        places = sorted(
            root
            for change in self._changes or ()
            for root in real_roots(ratios([c(value) for c in change]))
        )
        found = []
        for low, high in super()._pieces(value):
            ends = [low, *(p for p in dict.fromkeys(places) if low < p < high), high]
            found += list(pairwise(ends))
        return found

    @cached_property
    def _changes(self) -> list[list[Callable[[float], Fraction]]] | None:
        """Polynomials in the free states at whose roots stability may change; None if unknown.

        By their coefficients in a single free state, without them for several.
        """
        if self.field.n > STABILITY_STATES:
            return None
        symbols = [real(n) for n in self.field.model.states]
        along = dict(zip(symbols, self.solved, strict=True))
        p, numbers = real(self.field.parameter), numbers_of(self.field)
        found = []
        for number in self.sides:
            rates = sp.Matrix([exact(r).subs(numbers) for r in self.field.modes[number].rates])
            matrix = rates.jacobian(symbols).subs(along, simultaneous=True)
            for form in _hurwitz(matrix, self.dimension):
                over = sp.expand(numerator(form))
                if not over.is_polynomial(*self.free):
                    return None
                if over.has(*self.free):
                    terms = sp.Poly(over, *self.free).all_coeffs() if self.dimension == 1 else []
                    found.append([coefficient_function(c, p) for c in terms])
        return found


def _hurwitz(matrix: sp.Matrix, zeros: int) -> list[sp.Expr]:
    """Return the last coefficient, and the last but one Hurwitz determinant, without zeros."""
    one = sp.Dummy()
    coefficients = [sp.cancel(c) for c in matrix.charpoly(one).all_coeffs()[:-zeros]]
    degree = len(coefficients) - 1
    if degree < 2:
        return coefficients[1:]
    padded = [sp.S.Zero] * degree + coefficients + [sp.S.Zero] * degree
    table = sp.Matrix(degree - 1, degree - 1, lambda i, j: padded[degree + 2 * j - i + 1])
    return [coefficients[-1], table.det(method="berkowitz")]


def region_families(field: FrozenField) -> tuple[RegionFamily, ...]:
    """Return the continua of equilibria in regions, in closed form."""
    found: list[RegionFamily] = []
    for equations in region_equations(field):
        mode = field.modes[equations.region]
        if mode.sides is not None or mode.held:
            continue
        parts = (equations,) if equations.free else equations.factors
        own = [_family(field, one) for one in parts if one.free and not one.impossible]
        # a choice of factors may contain another one
        largest = sorted((one for one in own if one is not None), key=lambda one: -one.dimension)
        for one in largest:
            if not any(_contains(other, one) for other in found):
                found.append(one)
    return tuple(found)


def _contains(one: RegionFamily, other: RegionFamily) -> bool:
    """Return whether a family contains another one of the same region."""
    if one.sides[0] != other.sides[0]:
        return False
    states = dict(zip(map(real, one.field.model.states), other.solved, strict=True))
    chosen = {c: states[c] for c in one.free}
    return all(
        sp.expand(mine.subs(chosen, simultaneous=True) - theirs) == 0
        for mine, theirs in zip(one.solved, other.solved, strict=True)
    )


def implicit_continua(field: FrozenField) -> list[str]:
    """Return sentences on regions with fewer equations than unknowns, which are not traced."""
    return [
        f"the equilibria of {field.regions[equations.region]} form a continuum that is not traced: "
        f"{len(equations.elimination.remaining)} equation"
        f"{'' if len(equations.elimination.remaining) == 1 else 's'} for "
        f"{', '.join(map(str, equations.unknowns))}"
        for equations in region_equations(field)
        if field.modes[equations.region].sides is None and equations.implicit
    ]


def _family(field: FrozenField, equations: RegionEquations) -> RegionFamily | None:
    """Return the family of a region; None if the region across an interface has it too."""
    numbers, number = numbers_of(field), equations.region
    motion = regions_of(field.model.partition)[number]
    names = field.model.states
    solved = equations.elimination.state({}, names)
    along = {real(n): s for n, s in zip(names, solved, strict=True)}
    sides, bounds = [number], []
    for interface, sign in enumerate(motion.signs):
        height = list(field.model.interfaces.values())[interface]
        function = sp.expand(exact(height.function).subs(numbers).subs(along, simultaneous=True))
        if function != 0:
            bounds.append(sign * function)
            continue
        beyond = field.neighbour(number, interface)
        if sign < 0 or beyond is None or not field.model.continuous[height.name]:
            # of the region across, or the edge of a set of sliding motions
            return None
        sides.append(beyond)
    for wall in walls_of(field.model):
        bounds.append(sp.expand(-exact(wall.function).subs(numbers).subs(along, simultaneous=True)))
    return RegionFamily(field, motion, equations.unknowns, solved, tuple(bounds), tuple(sides))
