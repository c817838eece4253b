"""Equilibria from which the branches of a diagram are traced."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import cached_property, lru_cache
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from fastslow.diagrams.critical import critical_values
from fastslow.diagrams.equations import region_equations
from fastslow.diagrams.fields import FrozenField
from fastslow.diagrams.solving import solve_at
from fastslow.results.branches import Branch
from fastslow.results.points import Equilibrium

Array = NDArray[np.float64]


class Starts:
    """Equilibria from which branches are traced, solved for once at each value."""

    def __init__(self, field: FrozenField, lower: float, upper: float, inside: int) -> None:
        self._field = field
        self._over = (lower, upper)
        # the golden ratio keeps the values clear of each other and of round numbers
        parts = [(0.5 + k * 0.6180339887498949) % 1.0 for k in range(inside)]
        spread = [lower + p * (upper - lower) for p in parts]
        equations = dict.fromkeys(region_equations(field))
        between = [critical_values(e, lower, upper) for e in equations]
        self.complete = all(b is not None for b in between)
        self._continua = [
            (equation.region, value)
            for equation in equations
            for value in equation.continua()
            if lower <= value <= upper
        ]
        levels = sorted({lower, upper, *(v for b in between for v in b or ())})
        middles = [0.5 * (a + b) for a, b in pairwise(levels)]
        self._first = [lower, upper, *(middles if self.complete else [*middles, *spread])]
        self._found: dict[float, list[Equilibrium]] = {}
        self._scale: Array | None = None

    def at(self, value: float, admissible: bool) -> list[Equilibrium]:
        if value not in self._found:
            self._found[value] = solve_at(self._field, value, virtual=True)
        return [e for e in self._found[value] if e.admissible == admissible and not e.continuum]

    def values(self, branches: Sequence[Branch]) -> Iterable[float]:
        """The first values, then one between each two special points found so far."""
        yield from self._first
        done: set[float] = set()
        while True:
            special = {p[b.parameter_name] for b in branches for p in b.special}
            levels = sorted({*self._over, *special})
            gap = 1e-6 * (self._over[1] - self._over[0])
            middles = {0.5 * (a + b) for a, b in pairwise(levels) if b - a > gap}
            fresh = sorted(middles - done)
            if not fresh or len(done) > 200:
                return
            done |= set(fresh)
            yield from fresh

    def missed(self, branches: Sequence[Branch]) -> list[tuple[str, float]]:
        """Regions and values at which a continuum of equilibria is part of no branch."""
        near = 1e-9 * (self._over[1] - self._over[0])
        return [
            (self._field.regions[region], value)
            for region, value in self._within
            if not any(_upright(b, value, near, self.scale()) for b in branches)
        ]

    @cached_property
    def _within(self) -> list[tuple[int, float]]:
        """Those continua that lie in their region, at least in part."""
        bounded = bool(self._field.interfaces)
        return [
            (region, value)
            for region, value in self._continua
            if not bounded
            or any(
                e.continuum and e.admissible and e.region == self._field.regions[region]
                for e in solve_at(self._field, value, virtual=True)
            )
        ]

    def scale(self) -> Array:
        """Unit of each state, the size of its equilibria, and the length of the range."""
        if self._scale is not None:
            return self._scale
        states = [e.state for v in self._first for e in (*self.at(v, True), *self.at(v, False))]
        n = self._field.n
        size = np.abs(states).max(axis=0) if states else np.zeros(n)
        spread = np.ptp(states, axis=0) if states else np.zeros(n)
        # far from zero it is the differences that count
        moved = np.where(spread > 1e-9 * size, np.maximum(spread, 1e-3 * size), size)
        size = np.where(size > 1e-14 * max(size.max(initial=0.0), 1e-300), moved, 1.0)
        self._scale = np.append(size, self._over[1] - self._over[0])
        return self._scale


def _upright(branch: Branch, value: float, near: float, scale: Array) -> bool:
    """Whether a branch has a vertical piece at a parameter value."""
    step = np.abs(np.diff(branch.state, axis=0) / scale[:-1]).max(axis=1)
    there = np.abs(branch.parameter - value) < near
    return bool(np.any(there[1:] & there[:-1] & (step > 1e-6)))


@lru_cache(maxsize=64)
def starts_of(field: FrozenField, lower: float, upper: float, inside: int) -> Starts:
    """Where tracing starts, searched for once."""
    return Starts(field, lower, upper, inside)
