"""Equilibrium equations of every motion of a field: of regions, sliding, and held against walls."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache

import sympy as sp

from fastslow.diagrams.field import FrozenField
from fastslow.diagrams.modes import Sides
from fastslow.diagrams.solve.equations import FactorEquations, RegionEquations
from fastslow.diagrams.solve.many_regions import solved_one_by_one
from fastslow.model.structure import real
from fastslow.symbolic.solving.elimination import Elimination, eliminate

#: Name of the weight of the field below in a sliding vector field.
SHARE = "(alpha)"

#: Names of the accelerations that the contact forces of held motions compensate.
PULL = "(h'' {})"


@dataclass(frozen=True, eq=False)
class SlidingEquations(RegionEquations):
    """Equations of pseudo-equilibria, zeros of the sliding vector field on its interface.

    Without division they are (1 − α) f₁ + α f₂ = 0 and h = 0 with the additional unknown α, or,
    if that leaves more than one polynomial, b f₁ − a f₂ = 0 and h = 0, of which one equation is
    redundant (a, b are the drifts of h).
    """

    def _eliminated(self) -> Elimination:
        whole = self._with_share
        if len(whole.unknowns) <= 1 and whole.is_polynomial:
            return whole
        crossed = self._without_share
        return crossed if crossed is not None and crossed.is_univariate else whole

    @cached_property
    def equations(self) -> dict[str, sp.Expr]:
        states, alpha = self.field.model.states, real(SHARE)
        rates = [f + alpha * (g - f) for f, g in self._fields]
        return {**dict(zip(states, rates, strict=True)), SHARE: self._height}

    @property
    def _sides(self) -> Sides:
        return self.field.sides(self.region)

    @property
    def _height(self) -> sp.Expr:
        """Switching function h of the interface of the sliding motion."""
        return self._number(self.field.modes[self.region].rows[self._sides.interface])

    @property
    def _drifts(self) -> tuple[sp.Expr, sp.Expr]:
        """Drifts a and b of h on both sides."""
        a, b = self._sides.drifts
        return self._number(a), self._number(b)

    @property
    def _fields(self) -> list[tuple[sp.Expr, sp.Expr]]:
        """Rates on both sides, state by state."""
        modes, sides = self.field.modes, self._sides
        both = zip(modes[sides.above].rates, modes[sides.below].rates, strict=True)
        return [(self._number(f), self._number(g)) for f, g in both]

    @cached_property
    def _with_share(self) -> Elimination:
        return eliminate(self.equations, tuple(self.equations), nonzero=self.decisions)

    @cached_property
    def _without_share(self) -> Elimination | None:
        states, h = self.field.model.states, self._height
        a, b = self._drifts
        crossed = [b * f - a * g for f, g in self._fields]
        for k, name in enumerate(states):
            # the sum of ∂h/∂x times these vanishes: one with ∂h/∂x ≠ 0 is redundant
            slope = h.diff(real(name))
            if slope.is_nonzero if self.decisions is None else self.decisions(slope):
                crossed[k] = h
                rates = dict(zip(states, crossed, strict=True))
                return eliminate(rates, states, nonzero=self.decisions)
        return None

    @cached_property
    def factors(self) -> tuple[FactorEquations, ...]:
        return ()

    @property
    def bounds(self) -> list[sp.Expr]:
        functions = super().bounds
        del functions[self._sides.interface]
        return [*functions, *self._drifts]


@dataclass(frozen=True, eq=False)
class HeldEquations(RegionEquations):
    """Equations of equilibria held against walls, f − Σ P a = 0 and h = 0 on every wall.

    The additional unknowns a are the accelerations h'' without contact forces.
    """

    @cached_property
    def equations(self) -> dict[str, sp.Expr]:
        mode = self.field.modes[self.region]
        pulls = [PULL.format(k) for k in mode.held]
        rates = [
            self._number(f - sum(p[i] * real(a) for p, a in zip(mode.pushes, pulls, strict=True)))
            for i, f in enumerate(self.field.modes[mode.free].rates)
        ]
        heights = [self._number(mode.rows[k]) for k in mode.held]
        names = (*self.field.model.states, *pulls)
        return dict(zip(names, (*rates, *heights), strict=True))

    @cached_property
    def factors(self) -> tuple[FactorEquations, ...]:
        return ()

    @property
    def bounds(self) -> list[sp.Expr]:
        mode, functions = self.field.modes[self.region], super().bounds
        forces = (mode.rows[k] for k in self.field.contact_rows(self.region))
        others = (h for k, h in enumerate(functions) if k not in mode.held)
        return [*others, *map(self._number, forces)]


@lru_cache(maxsize=64)
def region_equations(field: FrozenField) -> tuple[RegionEquations, ...]:
    """Return the eliminated equations of every motion, cached with the field; none of too many."""
    if not solved_one_by_one(field):
        return ()
    found: list[RegionEquations] = []
    for number, mode in enumerate(field.modes):
        if mode.held:
            found.append(HeldEquations(field, number))
        elif mode.sides is None:
            found.append(RegionEquations(field, number))
        elif mode.sides.escaping:
            # the same equations as for sliding, the preceding mode
            found.append(found[-1])
        else:
            found.append(SlidingEquations(field, number))
    return tuple(found)
