"""Starting points given by the user."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fastslow.arguments import finite, shown
from fastslow.continuation.settings import Continuation
from fastslow.diagrams.correcting import corrections, point_at
from fastslow.diagrams.field import FrozenField
from fastslow.diagrams.segments import Window
from fastslow.diagrams.trace.across_regions import trace_across_regions
from fastslow.diagrams.windows import known, size_of
from fastslow.errors import ArgumentError, unknown_name
from fastslow.results.angles import apart
from fastslow.results.branch.branch import Branch
from fastslow.results.branch.windows import DISTANCE_ROUNDING, StateWindow, typical
from fastslow.results.points import Equilibrium, SpecialPoint

Array = NDArray[np.float64]

#: Step from a special point onto the branches through it, in units of the window.
SEED_STEP = 1e-3

#: Largest number of rows of a branch that estimate its size, and states sampled from a segment.
SIZE_ESTIMATE_ROWS, SEGMENT_STATES = 2000, 25

#: Largest distance of a given equilibrium from the computed one, relative to its size.
GIVEN_DISTANCE = 1e-3


class Seeds:
    """Equilibria given by the user, with the interface of `Starts`.

    Parameters
    ----------
    field : FrozenField
    over : (float, float)
        Range of the parameter.
    points : sequence
        Equilibrium, SpecialPoint, or a mapping of every state and the parameter to values from
        which Newton's method converges to an equilibrium.
    window : StateWindow
        The requested window.
    virtual : bool
        Whether virtual equilibria are accepted.

    Raises
    ------
    ArgumentError
        For a point that is not an equilibrium, or is outside the range or the window.
    UnknownNameError
        For a name that is neither a state nor the parameter.
    """

    def __init__(
        self,
        field: FrozenField,
        over: tuple[float, float],
        points: Sequence[Any],
        window: StateWindow,
        virtual: bool,
    ) -> None:
        self._field = field
        self._over = over
        if not points:
            raise ArgumentError("from_points = (); expected at least one point of a branch")
        self._given = [self._read(f"from_points[{k}]", p, window) for k, p in enumerate(points)]
        for k, found in enumerate(self._given):
            if not virtual and not any(e.admissible for e in found):
                raise ArgumentError(
                    f"from_points[{k}] is virtual, outside its region {found[0].region}; "
                    "virtual=True traces virtual branches"
                )
        self._points = [e for found in self._given for e in found]
        table = np.array([e.state for e in self._points])
        self._around = window.around(table, known(field, self._points))

    def values(self, branches: Sequence[Branch]) -> Iterable[float]:
        """Return the values of the parameter at the given points."""
        return list(dict.fromkeys(e.parameters[self._field.parameter] for e in self._points))

    def at(self, value: float, admissible: bool) -> list[Equilibrium]:
        name = self._field.parameter
        return [
            e for e in self._points if e.parameters[name] == value and e.admissible == admissible
        ]

    def prove(self, branches: Sequence[Branch]) -> bool:
        """Return False: branches through other points may exist."""
        return False

    @property
    def outside(self) -> tuple[StateWindow, list[tuple[Equilibrium, float]]]:
        """Return no equilibria: there is no search outside the window."""
        return self._around, []

    @property
    def shifts(self) -> Array:
        """Return no periods of the rates."""
        return np.zeros(len(self._around.states))

    def missed(self, branches: Sequence[Branch]) -> list[tuple[str, float]]:
        return []

    @property
    def window(self) -> StateWindow:
        return self._measured[0]

    @property
    def scale(self) -> Array:
        return self._measured[1]

    @cached_property
    def _measured(self) -> tuple[StateWindow, Array]:
        """Window and units, from the branches themselves, traced once for this purpose."""
        least = size_of(self._field, self._points)
        length = self._over[1] - self._over[0]
        first = Window(*self._over, np.append(self._unit(least), length), self._around)
        rows = np.concatenate([self._rows(e, first) for e in self._points])
        wide = typical(rows, DISTANCE_ROUNDING * np.abs(rows).max(axis=0))
        middle = np.median(rows, axis=0)
        low = np.maximum(rows.min(axis=0), middle - wide)
        high = np.minimum(rows.max(axis=0), middle + wide)
        size = np.maximum(np.abs(low), np.abs(high))
        unit = np.where(
            high - low > DISTANCE_ROUNDING * size, np.maximum(high - low, 1e-3 * size), size
        )
        core = tuple(
            (float(a), float(b)) if b > a else None for a, b in zip(low, high, strict=True)
        )
        return replace(self._around, core=core), np.append(
            self._unit(np.where(unit > 0, unit, least)), length
        )

    def _unit(self, size: Array) -> Array:
        """Return the size of each state; one radian for angles."""
        periods = self._field.periods
        return np.where(periods > 0, periods / (2.0 * np.pi), size)

    def _rows(self, point: Equilibrium, window: Window) -> Array:
        """Sample states of the branch through a point over the parameter; 0 for rounding errors."""
        field = self._field
        region = field.regions.index(point.region)
        state = self._around.shifted(point.state)
        u = np.append(state, point.parameters[field.parameter])
        tangent, _ = field.tangent(region, u, window.weight)
        samples = []
        for side in (1, -1):
            coarse = Continuation(max_points=SIZE_ESTIMATE_ROWS)
            traced = trace_across_regions(
                field, region, u, side * tangent, window, coarse, bounded=point.admissible
            )
            for segment in traced.segments:
                moved = np.append(0.0, np.cumsum(np.abs(np.diff(segment.u[:, -1]))))
                if moved[-1] == 0:
                    moved = np.arange(len(segment.u), dtype=float)
                places = np.searchsorted(moved, np.linspace(0, moved[-1], SEGMENT_STATES))
                rows = segment.u[places]
                certain = field.certain([(segment.region, row) for row in rows])
                samples += [*np.where(certain, rows[:, :-1], 0.0)]
        return np.array(samples)

    def _read(self, name: str, given: Any, window: StateWindow) -> list[Equilibrium]:
        """Return the equilibria of one given point; for a branch point one on each branch."""
        if isinstance(given, SpecialPoint | Equilibrium):
            known_names = (*given.states, *given.parameters)
            if given.states != self._field.model.states or self._field.parameter not in known_names:
                raise ArgumentError(
                    f"{name} is a point of another model (states {', '.join(given.states)}); "
                    f"expected states {', '.join(self._field.model.states)} and the parameter "
                    f"{self._field.parameter}"
                )
            value = float(given.parameters[self._field.parameter])
            state = np.asarray(given.state, dtype=float)
            regions = given.regions if isinstance(given, SpecialPoint) else (given.region,)
        elif isinstance(given, Mapping):
            state, value = self._values(name, given)
            regions = ()
        else:
            raise ArgumentError(
                f"{name} = {shown(given)}; expected an Equilibrium, a SpecialPoint or a mapping of "
                "every state and the parameter to its value"
            )
        if not self._over[0] <= value <= self._over[1]:
            raise ArgumentError(
                f"{name}: {self._field.parameter} = {value:g} is outside the range "
                f"[{self._over[0]:g}, {self._over[1]:g}]"
            )
        found = (
            self._beside(given, state, value)
            if isinstance(given, SpecialPoint)
            else self._solved(regions, state, value, isinstance(given, Mapping))
        )
        where = ", ".join(f"{n} = {v:g}" for n, v in zip(window.states, state, strict=True))
        if not found:
            raise ArgumentError(
                f"{name}: no equilibrium of the model was found from {where} at "
                f"{self._field.parameter} = {value:g}"
            )
        inside = [e for e in found if window.contains(window.shifted(e.state), np.abs(state))]
        if not inside:
            raise ArgumentError(f"{name}: {where} is outside the window {window}")
        return inside

    def _values(self, name: str, given: Mapping[Any, Any]) -> tuple[Array, float]:
        values = {str(k): v for k, v in given.items()}
        names = (*self._field.model.states, self._field.parameter)
        for key in values:
            if key not in names:
                raise unknown_name(f"state or parameter of {name}", key, names)
        lacking = [n for n in names if n not in values]
        if lacking:
            raise ArgumentError(f"{name} has no value of {', '.join(lacking)}")
        numbers = [finite(f"{name}[{n!r}]", values[n]) for n in names]
        return np.array(numbers[:-1]), numbers[-1]

    def _solved(
        self, regions: Sequence[str], state: Array, value: float, far: bool
    ) -> list[Equilibrium]:
        """Return the equilibrium at a value nearest to a state, among the regions."""
        best: tuple[bool, float, Equilibrium] | None = None
        for number, equations in enumerate(corrections(self._field)):
            if regions and self._field.regions[number] not in regions:
                continue
            solved = equations.corrected(state, value)
            if solved is None:
                continue
            size = np.maximum(np.maximum(np.abs(state), np.abs(solved)), self._natural(value))
            moved = float((np.abs(apart(solved, state, self._field.periods)) / size).max())
            if moved > GIVEN_DISTANCE and not far:
                continue
            u = np.append(solved, value)
            point = point_at(self._field, number, u, self._field.admissible(number, u))
            rank = (not point.admissible, moved)
            if best is None or rank < best[:2]:
                best = (*rank, point)
        return [] if best is None else [best[2]]

    def _natural(self, value: float) -> Array:
        """Return the natural unit of each state at a value of the parameter."""
        return self._field.units_at(abs(value))[: self._field.n]

    def _beside(self, point: SpecialPoint, state: Array, value: float) -> list[Equilibrium]:
        """Return equilibria near a special point, one on each branch through it."""
        unit = np.maximum(np.abs(state), self._natural(value))
        if point.source is not None:
            unit = np.maximum(np.abs(state), point.source.unit)
        scale = np.append(unit, self._over[1] - self._over[0])
        u = np.append(state, value)
        found: list[Equilibrium] = []
        for along in (point.tangent, point.switch):
            if along is None:
                continue
            step = along / max(float(np.linalg.norm(along / scale)), 1e-300)
            near = (self._off(point, u, step * side, scale) for side in (SEED_STEP, -SEED_STEP))
            found += [e for e in near if e is not None][:1]
        return found

    def _off(self, point: SpecialPoint, u: Array, step: Array, scale: Array) -> Equilibrium | None:
        field, guess = self._field, u + step
        for region in (field.regions.index(r) for r in point.regions if r in field.regions):
            found = field.refined(region, guess, scale, normal=step / scale**2, point=guess)
            value = float(found.u[-1])
            near = np.abs((found.u - guess) / scale).max() < 0.5 * SEED_STEP
            if not (found.converged and near and self._over[0] <= value <= self._over[1]):
                continue
            admissible = field.admissible(region, found.u)
            if admissible == point.admissible:
                return point_at(field, region, found.u, admissible)
        return None
