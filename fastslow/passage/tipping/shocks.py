"""Shortest displacements of some states out of a basin of attraction."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fastslow.arguments import Name, formula, instance, items, mapping, positive, validated
from fastslow.diagrams.field import IDLE, FrozenField
from fastslow.errors import ArgumentError, refuse_switches, unknown_name
from fastslow.model.events import refuse_memory
from fastslow.model.functions import function_of
from fastslow.model.model import Model
from fastslow.passage.tipping.ends_of_shifts import FutureSystem
from fastslow.passage.tipping.landings import (
    Constraint,
    EdgeLanding,
    Target,
    landed,
    residual,
)
from fastslow.passage.tipping.moving_equilibria import leading_adjoint
from fastslow.results.base.outcome import Outcome
from fastslow.results.points import Equilibrium
from fastslow.results.shocks import MinimalShock, Shock
from fastslow.simulation.arguments import require_values
from fastslow.simulation.one import simulate
from fastslow.simulation.settings import Integration

Array = NDArray[np.float64]

#: Error control of the runs by which the boundary is bracketed.
SEARCHING = Integration(rtol=1e-10)

#: Directions that are searched in the plane of two states, and in more for each of them.
PLANE_DIRECTIONS, SPACE_DIRECTIONS = 48, 64

#: Lengths along a direction that are tried, and the longest in units of the range of equilibria.
TRIED_LENGTHS, LONGEST_SHOCK = 48, 3.0

#: Bisections of a length; the length is then known to 1e-9 of its first bracket.
LENGTH_BISECTIONS = 30

#: Steps of the search for the nearest point of the boundary, and the change relative to the length
#: at which it ends.
NEAREST_STEPS, NEAREST_CHANGE = 60, 1e-10

#: Times of decay of the equilibrium during which runs are compared with edges, and samples.
DECAY_TIMES, SAMPLED_TIMES = 60.0, 2001

#: Shortest optima from which the search begins at most.
LOCAL_OPTIMA = 6

#: Steps of the search for the shortest length at a corner, each to a neighbouring direction or with
#: half the angle.
CORNER_DIVISIONS = 40

#: Distance of a run from an edge, in units of the range of equilibria, at which it lands there.
SHOCK_NEAR_EDGE = 0.05


@dataclass(frozen=True, eq=False)
class ShockLanding(EdgeLanding):
    """The condition in a displacement of some states that its run lands on an edge.

    Parameters
    ----------
    system : Model
    origin : ndarray, shape (n,)
    axes : ndarray, shape (n, k)
        Displacement of all states by each unknown.
    edge : Equilibrium
    """

    system: Model
    origin: Array
    axes: Array
    edge: Equilibrium
    begin: float = 0.0

    @property
    def parameters(self) -> tuple[tuple[int, str], ...]:
        return ()

    def model(self, unknowns: Array) -> Model:
        return self.system

    def start(self, unknowns: Array) -> tuple[Array, Array] | None:
        return self.origin + self.axes @ unknowns, self.axes

    def target(self, unknowns: Array, end: float, state: Array) -> Target | None:
        growth, adjoint = self._adjoint
        return Target(self.edge.state, adjoint, growth, np.zeros(self.axes.shape))

    @cached_property
    def _adjoint(self) -> tuple[float, Array]:
        field = FrozenField(self.system, IDLE)
        number = field.regions.index(self.edge.region)
        slopes = field.residual_and_jacobian(number, np.append(self.edge.state, 0.0))[1]
        return leading_adjoint(slopes[:, :-1])


@validated(
    model=instance(Model), point=instance(Equilibrium), states=items(formula), weights=mapping
)
def minimal_shock(
    model: Model,
    point: Equilibrium,
    states: Sequence[Name],
    *,
    weights: Mapping[Any, float] | None = None,
) -> MinimalShock:
    """Compute the shortest displacement of some states from an equilibrium out of its basin.

    The boundary of the basin is bracketed along directions in the space of these states; from the
    shortest of them the nearest point of the boundary is computed by Newton's method for the
    landing of the run on the edge, whose gradient is normal to the boundary. At a corner of the
    boundary, where there is no such point, the shortest length is bisected over directions.

    Parameters
    ----------
    model : Model
        Autonomous, with all parameter values.
    point : Equilibrium
        A stable equilibrium of it.
    states : sequence of str or Symbol
        The states that are displaced.
    weights : mapping, optional
        State to its weight w, 1 by default: the length is sqrt(Σ (w dx)²), in the units of the
        states. With w = 1/σ it is in units of σ.

    Returns
    -------
    MinimalShock
        All local optima that were found, the shortest first.

    Raises
    ------
    UnknownNameError
        For a name that is no state.
    ArgumentError
        For an equilibrium that is not stable, no states or one given twice, or a weight that is
        not positive.

    See Also
    --------
    fastslow.edge_state, fastslow.critical_rate

    Examples
    --------
    >>> import sympy as sp, fastslow as fs
    >>> y = sp.Symbol("y")
    >>> model = fs.Model({y: sp.Abs(y) - 1})
    >>> stable = fs.equilibria(model)[1]
    >>> fs.minimal_shock(model, stable, ["y"])
    MinimalShock of y from y = -1: length 2
      y + 2, length 2: unbounded; lands on y = 1
      the shortest of the lengths along 2 directions; no shorter one was found.
    """
    require_values(model)
    refuse_memory(model.structure.events, model.assigned, "minimal_shock")
    refuse_switches(model.switches, "a shock")
    names = [str(name) for name in states]
    for name in names:
        if name not in model.states:
            raise unknown_name("state", name, model.states)
    if not names or len(set(names)) < len(names):
        raise ArgumentError(f"states = {names}; expected at least one, each once")
    given = {str(k): positive(f"weights[{k}]", v) for k, v in (weights or {}).items()}
    for name in given:
        if name not in names:
            raise unknown_name("displaced state", name, names)
    if not point.stable:
        raise ArgumentError(f"point: {point!r} is not stable, and has no basin")
    search = _ShockSearch(model, point, tuple(names), np.array([given.get(n, 1.0) for n in names]))
    return search.result()


@dataclass(frozen=True, eq=False)
class _ShockSearch:
    """Search for the nearest points of the boundary of a basin.

    Unknowns are displacements in units of the reciprocal weights, so that their norm is the length.
    """

    model: Model
    point: Equilibrium
    names: tuple[str, ...]
    weights: Array

    @cached_property
    def system(self) -> FutureSystem:
        return FutureSystem.of(self.model, SEARCHING)

    @cached_property
    def axes(self) -> Array:
        found = np.zeros((len(self.model.states), len(self.names)))
        for k, name in enumerate(self.names):
            found[self.model.states.index(name), k] = 1.0 / self.weights[k]
        return found

    @cached_property
    def home(self) -> int:
        found = self.system.index_of(self.point)
        if found is None:
            raise ArgumentError(f"point: {self.point!r} is no stable equilibrium of this model")
        return found

    @cached_property
    def directions(self) -> Array:
        """Unit vectors, shape (m, k)."""
        k = len(self.names)
        if k == 1:
            return np.array([[-1.0], [1.0]])
        if k == 2:
            angles = 2.0 * np.pi * np.arange(PLANE_DIRECTIONS) / PLANE_DIRECTIONS
            return np.column_stack([np.cos(angles), np.sin(angles)])
        random = np.random.default_rng(0).normal(size=(SPACE_DIRECTIONS * k, k))
        return np.asarray(random / np.linalg.norm(random, axis=1)[:, None])

    @cached_property
    def reach(self) -> float:
        """The longest shock that is tried."""
        size = self.system.size @ np.abs(self.axes > 0.0)
        return float(LONGEST_SHOCK * np.linalg.norm(size * self.weights))

    def ends(self, shocks: Array) -> NDArray[np.int64]:
        """Attractor that is reached from each displacement, home for those beyond a wall."""
        starts = self.point.state + shocks @ self.axes.T
        return self.system.reached(starts, np.zeros(len(starts), dtype=np.int64))

    def before_walls(self, direction: Array) -> float:
        """Length at which a direction meets the wall of a reset, infinite without one."""
        lengths = np.linspace(0.0, self.reach, 20 * TRIED_LENGTHS)
        states = self.point.state + np.outer(lengths, direction) @ self.axes.T
        known = {**self.model.parameters, **dict(zip(self.model.states, states.T, strict=True))}
        found = np.inf
        for reset in self.model.resets.values():
            if reset.clock is not None:
                continue
            symbols, function = function_of(reset.function)
            height = np.broadcast_to(function(*(known[s.name] for s in symbols)), lengths.shape)
            beyond = np.flatnonzero(height > 0.0)
            if len(beyond):
                found = min(found, float(lengths[beyond[0]]))
        return found

    def bracketed(self, directions: Array) -> Array:
        """Length at which each direction leaves the basin, infinite if it does not."""
        lengths = self.reach * np.arange(1, TRIED_LENGTHS + 1) / TRIED_LENGTHS
        table = directions[:, None, :] * lengths[None, :, None]
        inside = self.ends(table.reshape(-1, directions.shape[1])) == self.home
        inside = inside.reshape(len(directions), -1)
        walls = np.array([self.before_walls(one) for one in directions])
        inside |= lengths[None, :] >= walls[:, None]
        leaves = ~inside.all(axis=1)
        first = np.argmin(inside, axis=1)
        low, high = lengths[first] - lengths[0], lengths[first]
        for _ in range(LENGTH_BISECTIONS):
            middle = 0.5 * (low + high)
            kept = self.ends(directions[leaves] * middle[leaves, None]) == self.home
            low[leaves] = np.where(kept, middle[leaves], low[leaves])
            high[leaves] = np.where(kept, high[leaves], middle[leaves])
        return np.where(leaves, high, np.inf)

    def starts(self, lengths: Array) -> list[int]:
        """Directions whose length is a local minimum, the shortest first."""
        order = [int(k) for k in np.argsort(lengths, kind="stable") if np.isfinite(lengths[k])]
        if len(self.names) == 2:
            around = np.minimum(np.roll(lengths, 1), np.roll(lengths, -1))
            order = [k for k in order if lengths[k] <= around[k]]
        return order[:LOCAL_OPTIMA]

    def result(self) -> MinimalShock:
        lengths = self.bracketed(self.directions)
        found: list[Shock] = []
        for k in self.starts(lengths):
            shock = self.nearest(self.directions[k] * lengths[k])
            if shock is None:
                shock = self.corner(self.directions[k], float(lengths[k]))
            if not any(self._same(shock, one) for one in found):
                found.append(shock)
        found.sort(key=lambda one: one.length)
        count = len(self.directions)
        words = f"no direction of {count} leaves the basin within a length of {self.reach:.6g}."
        outcome = Outcome("no boundary", words, False)
        if found:
            words = (
                f"the shortest of the lengths along {count} directions; no shorter one was found."
            )
            outcome = Outcome("not proved", words, True)
        return MinimalShock(
            names=self.names,
            weights=dict(zip(self.names, self.weights.tolist(), strict=True)),
            origin=self.point,
            shocks=tuple(found),
            directions=self.directions,
            lengths=lengths,
            outcome=outcome,
        )

    def _same(self, one: Shock, other: Shock) -> bool:
        apart = (one.displacement - other.displacement) * self.weights
        return float(np.linalg.norm(apart)) < 1e-5 * one.length

    def _landing(self, shock: Array) -> tuple[ShockLanding, float] | None:
        """The condition for the edge that the run comes nearest to, with the time."""
        start = self.point.state + self.axes @ shock
        decay = -self.point.eigenvalues.real
        span = DECAY_TIMES / float(decay[np.isfinite(decay)].min(initial=1.0))
        run = simulate(self.model, start, t=(0.0, span), integration=SEARCHING)
        times = np.linspace(0.0, run.span[1], SAMPLED_TIMES)
        states = run(times).T
        best, time, nearest = SHOCK_NEAR_EDGE, 0.0, None
        for edge in self.system.edges:
            away = np.abs((states - edge.state) / self.system.size).max(axis=1)
            if away.min() < best:
                best, time, nearest = float(away.min()), float(times[away.argmin()]), edge
        if nearest is None:
            return None
        landing = ShockLanding(self.model, self.point.state, self.axes, nearest)
        return landing, max(time, float(times[1]))

    def nearest(self, shock: Array) -> Shock | None:
        """The nearest point of a smooth boundary near a displacement."""
        near = self._landing(shock)
        if near is None:
            return None
        landing, time = near
        z = shock
        for _ in range(NEAREST_STEPS):
            # the run through a multiple of z that lands, and the normal of the boundary there
            length = float(np.linalg.norm(z))
            ray = z / length
            along = replace(landing, axes=(landing.axes @ ray)[:, None])
            on = landed(along, np.array([length]), time, Constraint.of_one(length, 0.0, 2 * length))
            here = None if on is None else residual(landing, ray * on.unknowns[0], on.end)
            if on is None or here is None or not np.isfinite(here.slopes).all():
                return None
            z = ray * float(on.unknowns[0])
            normal = here.slopes / np.linalg.norm(here.slopes)
            foot = normal * float(normal @ z)
            change = float(np.linalg.norm(foot - z))
            if change <= NEAREST_CHANGE * np.linalg.norm(z):
                return self._made(z, landing.edge, "smooth", max(change, on.change))
            z = foot
        return None

    def corner(self, direction: Array, length: float) -> Shock:
        """The shortest of lengths, bisected over directions next to one."""
        best, shortest = direction, length
        spread = 2.0 * np.pi / PLANE_DIRECTIONS
        for _ in range(CORNER_DIVISIONS if len(self.names) > 1 else 0):
            near = np.vstack(
                [best + spread * step for step in np.eye(len(best))]
                + [best - spread * step for step in np.eye(len(best))]
            )
            near /= np.linalg.norm(near, axis=1)[:, None]
            lengths = self.near_length(near, shortest)
            k = int(np.argmin(lengths))
            if lengths[k] < shortest:
                best, shortest = near[k], float(lengths[k])
            else:
                spread *= 0.5
        return self._made(best * shortest, None, "bisection", 1e-9 * shortest)

    def near_length(self, directions: Array, length: float) -> Array:
        """Lengths at which directions leave the basin, if they do below a length, else infinite."""
        low, high = np.zeros(len(directions)), np.full(len(directions), length)
        left = self.ends(directions * length) != self.home
        for _ in range(LENGTH_BISECTIONS):
            middle = 0.5 * (low + high)
            kept = self.ends(directions * middle[:, None]) == self.home
            low, high = np.where(kept, middle, low), np.where(kept, high, middle)
        return np.where(left, high, np.inf)

    def _made(self, z: Array, edge: Equilibrium | None, method: str, error: float) -> Shock:
        beyond = int(self.ends(z[None] * (1.0 + 1e-6))[0])
        words = self.system.words(beyond, self.home).removeprefix("tips ").removeprefix("tips, ")
        return Shock(
            names=self.names,
            displacement=z / self.weights,
            length=float(np.linalg.norm(z)),
            beyond=words,
            edge=edge,
            method=method,
            error=error,
        )
