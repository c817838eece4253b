"""Coexisting attractors from an ensemble of initial states."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fastslow.arguments import (
    finite,
    instance,
    interval,
    mapping,
    real_number,
    validated,
    whole,
)
from fastslow.errors import ArgumentError, unknown_name
from fastslow.model.model import Model
from fastslow.orbits.finding import find_orbit
from fastslow.orbits.shooting import sizes_of
from fastslow.results.angles import apart, periods_of
from fastslow.results.base.outcome import Outcome
from fastslow.results.orbits.attractors import Attractors
from fastslow.results.orbits.orbit import Orbit
from fastslow.results.points import Equilibrium
from fastslow.simulation.arguments import require_values
from fastslow.simulation.many import final_states
from fastslow.simulation.settings import (
    EXECUTION,
    Execution,
    Integration,
    execution_settings,
    integration_settings,
    progress_bar,
    resolve,
)

Array = NDArray[np.float64]

#: Distance in units of the ranges within which a trajectory belongs to an attractor.
NEAR = 1e-3

#: Change over the period of a repetition, in the same units, at which an orbit is solved for.
SETTLED = 1e-3

#: Largest number of periods after which a repetition is detected.
MULTIPLES = 16

#: Lengths of the runs in which transients decay: periods of the forcing, and without forcing of
#: the slowest known attractor.
RUNS = (50, 100, 200, 400, 800)

#: Largest number of trajectories from which an attractor is solved for without success.
FAILURES = 12

#: Number of samples over which the distance from an autonomous orbit is measured.
SAMPLES = 2000

#: Trajectories are integrated to this tolerance unless another one is given.
COARSE = Integration(rtol=1e-9)


@validated(
    model=instance(Model),
    over=mapping,
    n=whole(1, 10_000_000),
    seed=whole(0, 2**63),
    integration=integration_settings,
    execution=execution_settings,
)
def attractors(
    model: Model,
    over: Mapping[Any, tuple[float, float]],
    n: int = 200,
    seed: int = 0,
    *,
    integration: Integration = COARSE,
    execution: Execution = EXECUTION,
) -> Attractors:
    """Compute the attractors that random initial states reach, and the fraction of each.

    Transients decay in an ensemble of trajectories; their repetition after up to 16 periods of
    the forcing is detected, and each candidate is confirmed by `find_orbit`. Trajectories
    are assigned to the attractor that they come within 0.1 % of its range to, so that an
    attractor with a thin basin is missed with probability (1 − p)ⁿ, where p is the fraction of
    the basin.

    Parameters
    ----------
    model : Model
        With all parameter values; forced or autonomous.
    over : mapping
        Every state and slow state to the range (low, high) of its initial values, uniform; equal
        bounds fix a state.
    n : int
        Number of initial states.
    seed : int
        Of the random numbers.
    integration : Integration
        Settings of the trajectories.
    execution : Execution
        Number of threads, and progress bar.

    Returns
    -------
    Attractors

    Raises
    ------
    ArgumentError
        For a state without a range, or a range that is reversed or not finite.
    UnknownNameError
        For a name that is not a state.

    Examples
    --------
    >>> import sympy as sp, fastslow as fs
    >>> x, y = sp.symbols("x y")
    >>> oscillator = fs.Model({x: y, y: (1 - x**2) * y - x})
    >>> found = fs.attractors(oscillator, {x: (-1, 1), y: (-1, 1)}, 20)
    >>> found
    Attractors: 1 from 20 initial states
      A1 orbit of period 6.66329, 0 crossings: 100.0% ± 0.0%
    """
    require_values(model)
    ranges = _box(model, over)
    low, high = np.array(list(ranges.values())).T
    random = np.random.default_rng(seed)
    starts = low + (high - low) * random.random((n, len(ranges)))
    with progress_bar(execution, "initial state", n) as bar:
        survey = Survey(model, integration, execution, bar.update)
        assigned, ends = survey.discover(starts)
    counts = np.bincount(assigned[assigned >= 0], minlength=len(survey.known))
    order = np.argsort(-counts, kind="stable")
    place = np.append(np.argsort(order), -1)
    return Attractors(
        tuple(survey.known[k] for k in order),
        (*model.states, *model.slow_states),
        ranges,
        starts,
        ends,
        place[assigned],
        seed,
        survey.outcome(assigned),
    )


def _box(model: Model, over: Mapping[Any, tuple[float, float]]) -> dict[str, tuple[float, float]]:
    """Validate the ranges of initial states, in the order of the states."""
    names = (*model.states, *model.slow_states)
    given = {str(key): value for key, value in over.items()}
    for name in given:
        if name not in names:
            raise unknown_name("state", name, names)
    missing = [name for name in names if name not in given]
    if missing:
        raise ArgumentError(
            f"over: no range of the initial values of {', '.join(missing)}; expected one for every "
            "state, for instance (0, 0) for a fixed value"
        )
    return {name: _range(name, given[name]) for name in names}


def _range(name: str, value: Any) -> tuple[float, float]:
    if isinstance(value, tuple | list):
        ends = [real_number(end) for end in value]
        if len(ends) == 2 and ends[0] is not None and ends[0] == ends[1]:
            return finite(f"over[{name}]", ends[0]), ends[0]
    return interval(f"over[{name}]", value)


@dataclass(eq=False)
class Survey:
    """The attractors known so far of a model, and the ensembles by which others are detected."""

    model: Model
    integration: Integration
    execution: Execution
    report: Callable[[int], object] = lambda _: None
    known: list[Orbit | Equilibrium] = field(default_factory=list)
    reasons: list[str] = field(default_factory=list)

    @cached_property
    def forced(self) -> float | None:
        """Period of the forcing."""
        return self.model.period()

    @cached_property
    def lengths(self) -> Array:
        """Period of every state, 0 for those that are not periodic."""
        return periods_of((*self.model.states, *self.model.slow_states), self.model.periodic)

    def discover(self, starts: Array) -> tuple[NDArray[np.int64], Array]:
        """Assign initial states to attractors, which are computed as they are reached."""
        assigned = np.full(len(starts), -1)
        ends = starts.copy()
        open_ = np.arange(len(starts))
        failures = 0
        for periods in RUNS:
            if not len(open_):
                break
            before = len(self.known)
            ends[open_], codes, strobes = self._integrated(ends[open_], periods)
            assigned[open_] = self._matched(ends[open_], strobes)
            for k in np.flatnonzero((assigned[open_] < 0) & (codes == 0)):
                row = open_[k]
                assigned[row] = self._matched(ends[row : row + 1], strobes[k : k + 1])[0]
                if assigned[row] >= 0 or failures >= FAILURES:
                    continue
                found = self._solved(ends[row], strobes[k])
                if found is None:
                    failures += self.forced is None
                else:
                    assigned[row] = found
            done = (assigned[open_] >= 0) | (codes != 0)
            self.report(int(done.sum()))
            open_ = open_[~done]
            if self.forced is None and failures >= FAILURES and len(self.known) == before:
                break
        return assigned, ends

    def assign(self, starts: Array) -> tuple[NDArray[np.int64], Array]:
        """Assign initial states to the known attractors alone."""
        assigned = np.full(len(starts), -1)
        ends = starts.copy()
        open_ = np.arange(len(starts))
        for periods in RUNS:
            if not len(open_):
                break
            ends[open_], codes, strobes = self._integrated(ends[open_], periods)
            assigned[open_] = self._matched(ends[open_], strobes)
            open_ = open_[(assigned[open_] < 0) & (codes == 0)]
        return assigned, ends

    def outcome(self, assigned: NDArray[np.int64]) -> Outcome:
        """Return whether every initial state reached an attractor."""
        left = int((assigned < 0).sum())
        if not left:
            return Outcome("settled", "every initial state reached an attractor.", True)
        why = "; ".join(dict.fromkeys(self.reasons))
        return Outcome(
            "not settled",
            f"{left} of {len(assigned)} initial states reached no periodic orbit or equilibrium: "
            "chaotic or quasi-periodic motion, a slow transient, or a trajectory that ended early"
            + (f" ({why})." if why else "."),
            False,
        )

    def _integrated(self, states: Array, periods: int) -> tuple[Array, NDArray[np.int64], Array]:
        """Final states and codes of runs, and with forcing the states at the last periods."""
        length = self.forced or self._length()
        count = min(MULTIPLES, periods) if self.forced else 0
        until = periods * length
        spans = np.tile([0.0, until], (len(states), 1))
        times = np.tile(until - length * np.arange(count, 0, -1), (len(states), 1))
        resolved = resolve(self.integration, self.model, implicit=False)
        ends, codes, strobes = final_states(
            self.model, states, {}, spans, resolved, self.execution, times if count else None
        )
        return ends, codes, strobes.swapaxes(1, 2)

    def _length(self) -> float:
        """Unit of time without forcing: the longest period or relaxation time known."""
        scales = [1.0]
        for one in self.known:
            if isinstance(one, Orbit):
                scales.append(one.period)
            else:
                scales.append(1.0 / max(-float(one.eigenvalues.real.max()), 1e-3))
        return max(scales)

    def _matched(self, states: Array, strobes: Array) -> NDArray[np.int64]:
        """Index of the known attractor that each state has reached, -1 for none."""
        found = np.full(len(states), -1)
        least = np.full(len(states), NEAR)
        for number, one in enumerate(self.known):
            distance = self._distance(one, states)
            if self.forced is not None:
                # one passage near an orbit is no arrival
                distance = np.maximum(distance, self._distance(one, strobes[:, -1]))
            nearer = distance < least
            found[nearer], least[nearer] = number, distance[nearer]
        return found

    def _distance(self, one: Orbit | Equilibrium, states: Array) -> Array:
        """Distance of states from an attractor, at phase 0 of the forcing, in units of its size."""
        if isinstance(one, Equilibrium):
            points = one.state[None, :]
            size = np.maximum(np.abs(one.state), 1.0)
        else:
            curve = one.trajectory.sampled_columns[: len(one.states)].T
            size = sizes_of(curve, curve)
            if one.multiple is not None:
                points = one(self.forced * np.arange(one.multiple)).T  # type: ignore[operator]
            else:
                points = one(one.t0 + one.period * np.arange(SAMPLES) / SAMPLES).T
        distances = np.full(len(states), np.inf)
        for first in range(0, len(states), 256):
            some = states[first : first + 256, None, :]
            away = np.abs(apart(some, points[None], self.lengths) / size).max(axis=2)
            distances[first : first + 256] = away.min(axis=1)
        if isinstance(one, Orbit) and one.multiple is None:
            # between two samples of the curve
            distances = np.maximum(distances - self._spacing(points, size), 0.0)
        return distances

    def _spacing(self, points: Array, size: Array) -> float:
        """Half of the largest distance between consecutive points of a closed curve."""
        step = np.abs(apart(np.roll(points, -1, axis=0), points, self.lengths) / size)
        return 0.5 * float(step.max())

    def _solved(self, state: Array, strobes: Array) -> int | None:
        """Solve for the attractor near a state; return its index, new or known."""
        multiple = 1
        if self.forced is not None:
            size = sizes_of(strobes, np.vstack([strobes, state]))
            size = np.maximum(size, 1e-9 * (1.0 + np.abs(state)))
            whole_ = np.maximum(np.ptp(strobes, axis=0), np.abs(state))
            # a state that is 0 at every strobe is only rounding
            whole_ = np.maximum(whole_, SETTLED * whole_.max())
            scale = np.where(whole_ > 0, whole_, size)
            back = np.abs(apart(strobes[::-1], state, self.lengths) / scale).max(axis=1)
            repeats = np.flatnonzero(back < SETTLED)
            if not len(repeats):
                return None
            multiple = int(repeats[0]) + 1
        found: Orbit | Equilibrium | None
        try:
            found = find_orbit(self.model, state.tolist(), multiple=multiple)
        except ArgumentError:
            # the state is an equilibrium
            found = self._equilibrium(state)
        else:
            if found.outcome.code == "equilibrium":
                found = self._equilibrium(found.trajectory.end[1:])
            elif not found.outcome:
                self.reasons.append(found.outcome.code)
                return None
        if found is None or found.stability == "unstable":
            return None
        for number, one in enumerate(self.known):
            if type(one) is type(found) and self._same(one, found):
                return number
        self.known.append(found)
        return len(self.known) - 1

    def _same(self, one: Orbit | Equilibrium, other: Orbit | Equilibrium) -> bool:
        if isinstance(other, Equilibrium):
            point = other.state
        else:
            point = other(0.0 if other.multiple is not None else other.t0)
        return bool(self._distance(one, point[None, :])[0] < NEAR)

    def _equilibrium(self, state: Array) -> Equilibrium | None:
        """The equilibrium nearest to a state at which a run has settled."""
        near = [
            one
            for one in self._equilibria
            if not one.continuum and self._distance(one, state[None, :])[0] < NEAR
        ]
        if not near:
            self.reasons.append("equilibrium, but none is isolated there")
            return None
        return min(near, key=lambda one: float(self._distance(one, state[None, :])[0]))

    @cached_property
    def _equilibria(self) -> tuple[Equilibrium, ...]:
        from fastslow.diagrams.solve.solving import equilibria

        return tuple(equilibria(self.model.frozen()))
