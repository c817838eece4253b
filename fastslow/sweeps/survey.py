"""Attractors that the trajectories of an ensemble reach."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fastslow.errors import ArgumentError, ModelError
from fastslow.model.model import Model
from fastslow.orbits.find.finding import find_orbit
from fastslow.orbits.flow.shooting import sizes_of
from fastslow.results.angles import apart, periods_of
from fastslow.results.base.outcome import Outcome
from fastslow.results.orbits.orbit import Orbit
from fastslow.results.points import Equilibrium
from fastslow.results.trajectory.long_time.regimes import LARGEST_MULTIPLE
from fastslow.simulation.arguments import initial_state, initial_switches
from fastslow.simulation.many import final_states
from fastslow.simulation.one import integrated
from fastslow.simulation.prepared_runs import prepared_run
from fastslow.simulation.settings import EXECUTION, Integration, resolve
from fastslow.sweeps.batch_stores import BatchStores
from fastslow.sweeps.grid_sweep import sweep

Array = NDArray[np.float64]

#: Distance in units of the ranges within which a trajectory belongs to an attractor.
NEAR_ATTRACTOR = 1e-3

#: Change over the period of a repetition, in the same units, at which an orbit is solved for.
REPEATED_ORBIT = 1e-3

#: Lengths of the runs in which transients decay: periods of the forcing, without forcing periods
#: or relaxation times of the slowest known attractor.
RUN_LENGTHS = (50, 100, 200, 400, 800)

#: Largest number of trajectories from which an attractor is solved for without success.
FAILED_STARTS = 12

#: Equilibria are approached to `NEAR_ATTRACTOR` of the state, or of this fraction of the range of
#: all states.
RANGE_REACHED = 1e-6

#: Size of a state on an orbit, as a fraction of its range over all states, that is rounding.
ORBIT_ROUNDING = 1e-12

#: Fraction of the period of the forcing by which states are sampled after its instants.
AFTER = 1e-10

#: Chords between two samples of an orbit, to which the distance of a state is measured.
CHORDS = 4

#: Code of trajectories of a task that was lost, as its worker died twice; complete ones have 0.
LOST_TASK = -1


@dataclass(frozen=True)
class AttractionRuns:
    """Function that integrates trajectories over some periods, in this or another process.

    Parameters
    ----------
    model : Model
    integration : Integration
    length : float
        The period of the forcing or the relaxation time.
    periods : int
        Number of these in each trajectory.
    count : int
        Number of last periods at whose beginnings the states are kept.
    """

    model: Model
    integration: Integration
    length: float
    periods: int
    count: int

    def columns(self, states: Array) -> dict[str, Array]:
        """Return states, followed by those of switches, as columns."""
        model = self.model
        names = (*model.states, *model.slow_states, *model.switches)
        return {f"initial {name}": states[:, k].copy() for k, name in enumerate(names)}

    def __call__(self, **columns: Array) -> dict[str, NDArray[Any]]:
        final, codes, strobes = self.final(np.column_stack(list(columns.values())))
        return {"final": final, "code": codes, "strobes": strobes}

    def final(self, states: Array) -> tuple[Array, NDArray[np.int64], Array]:
        """Return final states, outcome codes, and states at the last periods, (m, count, n).

        Rows of ``states`` and of the final ones are followed by the states of switches.
        """
        model, length = self.model, self.length
        n = len((*model.states, *model.slow_states))
        until = self.periods * length
        # at an instant of a clock a sample is the state before it, the end is that after it
        times = until - length * (np.arange(self.count, 0, -1) - AFTER)
        ends, codes, strobes, changed = final_states(
            model,
            np.ascontiguousarray(states[:, :n]),
            {},
            np.tile([0.0, until], (len(states), 1)),
            resolve(self.integration, model, implicit=False),
            EXECUTION,
            np.tile(times, (len(states), 1)) if self.count else None,
            switches=states[:, n:] if model.switches else None,
        )
        return np.hstack([ends, changed]), codes, strobes.swapaxes(1, 2)


@dataclass(eq=False)
class Survey:
    """The attractors known so far of a model, and the ensembles by which others are detected.

    Parameters
    ----------
    model : Model
    integration : Integration
    extent : ndarray, shape (n,)
        Range of each state, see `extent_of`; with `assign(…, solve=True)` it is widened.
    report : callable
        Called with numbers of assigned initial states.
    known : list of Orbit or Equilibrium
    reasons : list of str
        Why no attractor was found from some states, in a word.
    explained : dict of str to str
        In a sentence, for the first trajectory that ended early for such a reason.
    scale : float
        Time scale if no attractor is known, 0 for none; then all runs have the first length.
    batches : BatchStores, optional
        How the ensembles are executed, by default at once in the calling task.
    """

    model: Model
    integration: Integration
    extent: Array
    report: Callable[[int], object] = lambda _: None
    known: list[Orbit | Equilibrium] = field(default_factory=list)
    reasons: list[str] = field(default_factory=list)
    explained: dict[str, str] = field(default_factory=dict)
    scale: float = 0.0
    batches: BatchStores | None = None

    @cached_property
    def forced(self) -> float | None:
        """Period of the forcing."""
        return self.model.period()

    @cached_property
    def lengths(self) -> Array:
        """Period of every state, 0 for those that are not periodic."""
        return periods_of((*self.model.states, *self.model.slow_states), self.model.periodic)

    def assign(
        self, starts: Array, *, solve: bool = False
    ) -> tuple[NDArray[np.int64], Array, NDArray[np.str_]]:
        """Assign initial states to the attractors that they reach.

        Parameters
        ----------
        starts : ndarray, shape (m, n + n_switches)
            States with those of switches, NaN where a relation decides.
        solve : bool
            Whether to solve for attractors that are not known.

        Returns
        -------
        assigned : ndarray of int, shape (m,)
            Index of the attractor, −1 for none.
        ends : ndarray, shape (m, n + n_switches)
        early : ndarray of str, shape (m,)
            Code of the outcome of each trajectory that ended early, empty for the others.
        """
        n = len(self.lengths)
        assigned, ends, left = np.full(len(starts), -1), starts.copy(), np.arange(len(starts))
        early = np.full(len(starts), "", dtype=object)
        if solve and self.forced is None:
            # the time scale is that of the first attractor
            for first in range(min(len(starts), FAILED_STARTS)):
                if self._solved(starts[first]) is not None:
                    break
                early[first] = self.reasons[-1] if self.reasons[-1] in self.explained else ""
        # after failures alone there is no time scale to integrate the others
        for periods in self._run_lengths if self.known or not solve or self.forced else ():
            begun = ends[left]
            ends[left], codes, strobes = self._integrated(begun, periods)
            early[left] = self._endings(begun, codes, periods)
            if solve:
                self.extent = np.maximum(self.extent, extent_of(ends[left, :n]))
            assigned[left] = self._matched(ends[left, :n], strobes)
            for k in np.flatnonzero((assigned[left] < 0) & (codes == 0)) if solve else ():
                (found,) = self._matched(ends[left[k : k + 1], :n], strobes[k : k + 1])
                if found < 0 and len(self.reasons) < FAILED_STARTS:
                    found = self._solved(ends[left[k]], strobes[k])
                assigned[left[k]] = -1 if found is None else found
            settled = (assigned[left] >= 0) | (codes != 0)
            self.report(int(settled.sum()))
            left = left[~settled]
            if not len(left):
                break
        early[assigned >= 0] = ""
        return assigned, ends, early.astype(str)

    def outcome(self, assigned: NDArray[np.int64]) -> Outcome:
        """Return whether every initial state reached an attractor."""
        left = int((assigned < 0).sum())
        if not left:
            return Outcome("settled", "every initial state reached an attractor.", True)
        alone = self.forced is None and not self.known and len(assigned) > FAILED_STARTS
        some = f"; without a time scale only the first {FAILED_STARTS} were integrated"
        return Outcome(
            "not settled",
            f"{left} of {len(assigned)} initial states reached no periodic orbit or equilibrium: "
            "chaotic or quasi-periodic motion, a slow transient, or a trajectory that ended early"
            f"{in_words(self.reasons, self.explained)}{some if alone else ''}.",
            False,
        )

    def _endings(
        self, states: Array, codes: NDArray[np.int64], periods: int
    ) -> NDArray[np.object_]:
        """Codes of the outcomes of trajectories that ended early, explained by the first of each.

        Parameters
        ----------
        states : ndarray, shape (m, n + n_switches)
            The initial states.
        codes : ndarray of int, shape (m,)
            From the ensemble.
        periods : int
        """
        names = (*self.model.states, *self.model.slow_states, *self.model.switches)
        early = np.full(len(codes), "", dtype=object)
        for code in sorted({*codes.tolist()} - {0, LOST_TASK}):
            ended = np.flatnonzero(codes == code)
            if code not in self._ended:
                given = zip(names, states[ended[0]].tolist(), strict=True)
                begin = {name: value for name, value in given if not np.isnan(value)}
                # `simulate` refuses a start beyond a wall, which is an ending here
                run = integrated(
                    prepared_run(self.model, self.integration),
                    initial_state(self.model, begin),
                    (0.0, periods * self._length),
                    switches=initial_switches(self.model, begin),
                )
                self._ended[code] = run.outcome
                if not run.outcome:
                    self._explain(run.outcome)
            early[ended] = self._ended[code].code
        return early

    @cached_property
    def _ended(self) -> dict[int, Outcome]:
        """Outcomes of the trajectories that ended early, by the codes of ensembles."""
        return {}

    def _explain(self, outcome: Outcome) -> None:
        """Keep the reason of a trajectory that ended early."""
        self.reasons.append(outcome.code)
        self.explained.setdefault(outcome.code, str(outcome))

    @property
    def _run_lengths(self) -> tuple[int, ...]:
        """Lengths of the runs, in units of the time scale; none if it is not known."""
        if self.forced or self.known:
            return RUN_LENGTHS
        return RUN_LENGTHS[:1] if self.scale > 0 else ()

    @property
    def _length(self) -> float:
        """The period of the forcing, or the longest time scale of the known attractors."""
        return self.forced or max(map(_time_scale, self.known), default=self.scale)

    def _integrated(self, states: Array, periods: int) -> tuple[Array, NDArray[np.int64], Array]:
        """Final states and codes of runs, and with forcing the states at the last periods.

        States are followed by those of switches.
        """
        length = self._length
        count = min(LARGEST_MULTIPLE, periods) if self.forced else 0
        runs = AttractionRuns(self.model, self.integration, length, periods, count)
        if self.batches is None:
            return runs.final(states)
        columns = runs.columns(states)
        execution = replace(self.batches.following(columns, runs), errors="raise")
        grid = sweep(runs, columns, paired=True, vectorized=True, execution=execution)
        self.reasons.extend(dict.fromkeys(grid.reasons))
        codes = np.full(len(states), LOST_TASK)
        if not grid.outputs:
            lost = np.full((len(states), count, len(self.lengths)), np.nan)
            return np.full_like(states, np.nan), codes, lost
        good = np.delete(np.arange(len(states)), grid.failed)
        codes[good] = grid["code"][good].astype(int)
        return grid["final"], codes, grid["strobes"]

    def _matched(self, states: Array, strobes: Array) -> NDArray[np.int64]:
        """Index of the known attractor that each state has reached, -1 for none."""
        found = np.full(len(states), -1)
        least = np.full(len(states), NEAR_ATTRACTOR)
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
            size = np.maximum(np.abs(one.state), RANGE_REACHED * self.extent)
            return np.asarray(np.abs(apart(states, one.state, self.lengths) / size).max(axis=1))
        samples = one.trajectory.t
        curve = one(samples).T
        # a state that decays to 0 on the orbit differs from 0 by rounding
        size = np.maximum(sizes_of(curve, curve), ORBIT_ROUNDING * self.extent)
        if one.multiple is not None:
            phases = one.period / one.multiple * np.arange(one.multiple)
            points = one(phases).T
            chords = np.zeros_like(points)
        else:
            share = np.arange(CHORDS * (len(samples) - 1) + 1) / CHORDS
            curve = one(np.interp(share, np.arange(len(samples)), samples)).T
            points, chords = curve[:-1], apart(curve[1:], curve[:-1], self.lengths) / size
        squares = np.maximum((chords**2).sum(axis=1), np.finfo(float).tiny)
        distances = np.empty(len(states))
        for k, state in enumerate(states):
            away = apart(state, points, self.lengths) / size
            along = np.clip((away * chords).sum(axis=1) / squares, 0.0, 1.0)
            distances[k] = np.abs(away - along[:, None] * chords).max(axis=1).min()
        return distances

    def _solved(self, state: Array, strobes: Array | None = None) -> int | None:
        """Solve for the attractor near a state with those of switches; return its index."""
        multiple, n = 1, len(self.lengths)
        state, switches = state[:n], state[n:]
        if strobes is not None and self.forced is not None:
            scale = np.maximum(np.ptp(strobes, axis=0), np.abs(state))
            # a state that is 0 at every strobe is only rounding
            scale = np.maximum(scale, REPEATED_ORBIT * scale.max(initial=np.finfo(float).tiny))
            back = np.abs(apart(strobes[::-1], state, self.lengths) / scale).max(axis=1)
            repeats = np.flatnonzero(back < REPEATED_ORBIT)
            if not len(repeats):
                return None
            multiple = int(repeats[0]) + 1
        # at the end of a run an orbit near an equilibrium would be one of rounding errors
        still = strobes is not None and self.forced is None
        found: Orbit | Equilibrium | None = self._equilibrium(state) if still else None
        if found is None:
            found = self._attracting(state, switches, multiple)
        if found is None:
            self.reasons.append("an equilibrium that is not isolated")
        elif isinstance(found, Orbit) and not found.outcome:
            self._explain(found.outcome)
            # other trajectories may end later than one that ended early
            sought = found.outcome.code == "not settled"
            self.scale = float(found.trajectory.end[0]) / (RUN_LENGTHS[0] if sought else 1)
        elif not found.stable:
            self.reasons.append(f"{found.stability} {_noun(found)}")
        else:
            for number, one in enumerate(self.known):
                if type(one) is type(found) and self.same(one, found):
                    return number
            self.known.append(found)
            return len(self.known) - 1
        return None

    def _attracting(
        self, state: Array, switches: Array, multiple: int
    ) -> Orbit | Equilibrium | None:
        """The orbit near a state, or the equilibrium on which a run from it settles."""
        model = self.model
        names = (*model.states, *model.slow_states, *model.switches)
        given = zip(names, (*state.tolist(), *switches.tolist()), strict=True)
        try:
            found = find_orbit(
                model, {n: v for n, v in given if not np.isnan(v)}, multiple=multiple
            )
        except ArgumentError:
            # the state is an equilibrium
            return self._equilibrium(state)
        if found.outcome.code == "equilibrium":
            return self._equilibrium(found.trajectory.end[1:])
        return found

    def scale_from(self, states: Iterable[Array]) -> float:
        """The largest time scale of the search for orbits from states with those of switches."""
        scales = []
        for state in states:
            self._solved(state)
            scales.append(max(map(_time_scale, self.known), default=self.scale))
        return max(scales, default=0.0)

    def same(self, one: Orbit | Equilibrium, other: Orbit | Equilibrium) -> bool:
        """Whether two attractors of one kind are one."""
        if isinstance(other, Equilibrium):
            point = other.state
        else:
            point = other(0.0 if other.multiple is not None else other.t0)
        return bool(self._distance(one, point[None, :])[0] < NEAR_ATTRACTOR)

    def _equilibrium(self, state: Array) -> Equilibrium | None:
        """The equilibrium at which a run has settled, None if it is not isolated."""
        isolated = [one for one in self._equilibria if not one.continuum]
        away = [float(self._distance(one, state[None, :])[0]) for one in isolated]
        return isolated[int(np.argmin(away))] if min(away, default=1.0) < NEAR_ATTRACTOR else None

    @cached_property
    def _equilibria(self) -> tuple[Equilibrium, ...]:
        from fastslow.diagrams.solve.solving import equilibria

        try:
            return tuple(equilibria(self.model.frozen()))
        except ModelError:
            # none is isolated
            return ()


def extent_of(states: Array) -> Array:
    """Range of each state over an ensemble with 0, shape (n,); 1 for states that are all 0."""
    finite_ones = states[np.isfinite(states).all(axis=1)]
    reach = np.ptp(np.vstack([finite_ones, np.zeros(states.shape[1])]), axis=0)
    return np.where(reach > 0, reach, 1.0)


def _time_scale(one: Orbit | Equilibrium) -> float:
    """Period of an orbit, or time in which the slowest perturbation of an equilibrium decays."""
    if isinstance(one, Orbit):
        return one.period
    decay = -one.eigenvalues.real
    return float(1.0 / decay[np.isfinite(decay)].min(initial=np.inf)) or 1.0


def in_words(reasons: Sequence[str], explained: Mapping[str, str]) -> str:
    """Reasons in brackets, each once, with the sentence of the first; empty without any."""
    why = (f"{one}: {explained[one]}" if one in explained else one for one in reasons)
    text = "; ".join(one.removesuffix(".") for one in dict.fromkeys(why))
    return f" ({text})" if text else ""


def _noun(one: Orbit | Equilibrium) -> str:
    return "orbit" if isinstance(one, Orbit) else "equilibrium"
