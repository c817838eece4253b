"""A model whose periodic orbits are computed: its compiled flow, forcing and free runs."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property, partial

import numpy as np
from numpy.typing import NDArray

from fastslow.errors import ModelError
from fastslow.model.continued_runs import continuing
from fastslow.model.model import Model
from fastslow.model.tabulated import TableValue
from fastslow.orbits.flow.equations import NODE
from fastslow.orbits.flow.flows import after_jumps, fields, flow
from fastslow.orbits.flow.forcing import Forcing, forcing_of
from fastslow.orbits.flow.forming import UnformedMotionsError
from fastslow.orbits.flow.multipliers import orbit_multipliers
from fastslow.orbits.flow.segments import (
    GROWTH_OF_GUESS,
    SEGMENT_GROWTH,
    Segments,
    divided,
    segments_of,
    without_some_nodes,
)
from fastslow.orbits.flow.shooting import (
    Linearised,
    Shooting,
    ShootingSolution,
    approach_speeds,
    at_rest,
    changes_by_rates,
    projected,
    sizes_beside_rest,
    sizes_of,
    solved,
)
from fastslow.orbits.flow.variations import Variations, variations_of
from fastslow.results.base.outcome import Outcome, with_notes
from fastslow.results.orbits.orbit import Orbit
from fastslow.results.trajectory.events.jumps import assignments_of
from fastslow.results.trajectory.trajectory import Trajectory
from fastslow.simulation.one import integrated
from fastslow.simulation.prepared_runs import Prepared, RunArrays, prepared_run, run_arrays
from fastslow.simulation.settings import Integration
from fastslow.simulation.stepper.phases import REACHED_END

Array = NDArray[np.float64]

#: Settings of the free runs if none are given: orbits are accurate to rounding.
FINE = Integration(rtol=1e-13)

#: Difference of the times of events, as a fraction of the period, between the solved orbit and
#: a free run with the same itinerary.
SAME_TIME = 1e-5

#: Duration beyond an interface, as a fraction of the period, of a touch: the square root of
#: rounding, with a margin.
GRAZED = 1e-6

#: Largest residual and last Newton correction of an orbit that is solved to rounding.
ORBIT_SOLVED = 1e-7

_NO_TIMES = np.empty(0)

#: Largest number of times that nodes are inserted.
REFINEMENTS = 12

#: Largest square of the growth without growth, which would be the number of states.
UNGROWN = 9

#: Growth up to which segments beside a node of a solved orbit are joined. It is less than
#: `SEGMENT_GROWTH`, so that the nodes suffice for a while along a branch.
GROWTH_OF_JOINED = 50.0


@dataclass(frozen=True, eq=False)
class OrbitProblem:
    """A model with its derivatives, its forcing and the settings of its runs.

    Parameters
    ----------
    model : Model
        With all parameter values; those of the chosen parameters are in ``parameters``.
    variations : Variations
    forcing : Forcing or None
    multiple : int
        Number of periods of the forcing, or of first returns.
    prepared : Prepared
        Runs of the model.
    parameters : ndarray
        The parameter array.
    """

    model: Model
    variations: Variations
    forcing: Forcing | None
    multiple: int
    prepared: Prepared
    parameters: Array

    @classmethod
    def of(
        cls,
        model: Model,
        multiple: int,
        period: float | None,
        integration: Integration | None,
        chosen: tuple[str, ...] = (),
    ) -> OrbitProblem:
        """Compile what the orbits of a model need."""
        tables = {value.table for law in model.forcing.values() for value in law.atoms(TableValue)}
        if not all(table.periodic for table in tables):
            raise ModelError(
                "a table of values in time (Tabulated) has a period only with periodic=True: one "
                "period of the load, with equal first and last values"
            )
        model = continuing(model)
        variations = variations_of(model, chosen)
        forcing = forcing_of(model, variations, period)
        prepared = prepared_run(model, integration or FINE)
        values = variations.parameter_array(model)
        return cls(model, variations, forcing, multiple, prepared, values)

    def at(self, parameters: Array) -> OrbitProblem:
        """The problem at other values of the chosen parameters."""
        return replace(self, parameters=parameters)

    @cached_property
    def _prepared(self) -> Prepared:
        """Runs of the model with the chosen parameters."""
        chosen, places = self.variations.chosen, self.variations.places
        if not chosen:
            return self.prepared
        values = dict(zip(chosen, self.parameters[places].tolist(), strict=True))
        return replace(self.prepared, model=self.model.with_parameters(values))

    def forced_period(self) -> float | None:
        """The multiple of the period of the forcing, None without forcing."""
        if self.forcing is None:
            return None
        return self.multiple * self.forcing.period(self.parameters)[0]

    def run(
        self, state: Array, since: float, until: float, switches: Array | None = None
    ) -> Trajectory:
        """Integrate from a state, with given states of switches."""
        period = None if self.forcing is None else self.forcing.period(self.parameters)[0]
        begin = np.ascontiguousarray(state)
        run = integrated(self._prepared, begin, (since, until), period, switches=switches)
        self.require_formed(run.modes)
        return run

    def require_formed(self, modes: tuple[str, ...]) -> None:
        """Raise UnformedMotionsError for a run to motions whose derivatives are not compiled."""
        if self.prepared.series is not None and modes != self.variations.modes:
            raise UnformedMotionsError(modes)

    def shooting(self, segments: Segments, winding: Array, ranges: Array | None = None) -> Shooting:
        """The equations of an orbit near a closed curve, with the ranges of the states."""
        nothing = np.zeros(self.variations.n)
        known = self.variations, self.parameters, segments, self.forcing, self.multiple
        shooting = Shooting(*known, winding, nothing, ranges)
        return shooting.with_phase(shooting.pack(segments, 0.0))

    def solve(
        self,
        segments: Segments,
        period: float,
        winding: Array,
        run: Trajectory | None = None,
    ) -> tuple[Shooting, ShootingSolution]:
        """Solve for an orbit near a closed curve, with nodes where perturbations grow.

        Parameters
        ----------
        segments : Segments
        period : float
        winding : ndarray, shape (n,)
        run : Trajectory, optional
            A run along the curve, for its states at nodes.

        Raises
        ------
        OrbitError
            Without convergence.
        """
        segments = segments.without_nodes()
        ranges = self.ranges_with_rest(segments)
        shooting = self.shooting(segments, winding, ranges)
        guess = shooting.on_interfaces(shooting.pack(segments, period))
        segments, period = shooting.unpack(guess)
        if run is not None:
            along = partial(_states_along, run, period, winding)
            for _ in range(REFINEMENTS):
                shooting = self.shooting(segments, winding, ranges)
                first = shooting.linearised(shooting.pack(segments, period))
                growth = growth_of(first, segments, ranges)
                much = np.log(growth).sum() > np.log(SEGMENT_GROWTH)
                limit = GROWTH_OF_GUESS if much else SEGMENT_GROWTH
                finer = divided(segments, growth, along, limit)
                if finer is segments:
                    break
                segments = finer
        coarse, smooth = False, len(segments.without_nodes()) == 1
        smooth = smooth and not self.variations.deficiency[segments.modes].any()
        for _ in range(REFINEMENTS):
            shooting = self.shooting(segments, winding, ranges)
            scale = shooting.scales(segments, period)
            solution = solved(shooting, shooting.pack(segments, period), scale)
            segments, period = shooting.unpack(solution.u)
            if not coarse:
                ranges = self.ranges_with_rest(segments)
            growth = growth_of(solution.last, segments, ranges)
            finer = divided(segments, growth, self.states_at)
            if finer is segments and not coarse and smooth:
                # those of fewer nodes would be too small
                ranges = sizes_of(segments.states, segments.states)
                finer, coarse = joined_at_nodes(segments, solution.last, ranges), True
                ranges = None if finer is segments else ranges
            if finer is segments:
                break
            segments = finer
        return shooting, solution

    def ranges_with_rest(self, segments: Segments) -> Array | None:
        """Ranges of the states if some of them are at rest, to rounding; None without these."""
        here = segments.modes, segments.states, segments.times[:-1], self.parameters
        moved = changes_by_rates(self.variations, *here, segments.constants, segments.period)
        states = segments.states
        return sizes_beside_rest(states, moved) if at_rest(states, moved).any() else None

    def with_other_nodes(
        self, segments: Segments, period: float, winding: Array, ranges: Array
    ) -> tuple[Shooting, Array]:
        """Equations and unknowns of a solved orbit, with nodes where perturbations grow.

        The orbit is not solved for again: in a canard explosion the parameter does not determine
        it. At new nodes its states are known to rounding times `SEGMENT_GROWTH`.
        """
        for _ in range(REFINEMENTS):
            shooting = self.shooting(segments, winding, ranges)
            last = shooting.linearised(shooting.pack(segments, period))
            finer = divided(segments, growth_of(last, segments, ranges), self.states_at)
            if finer is segments:
                segments = joined_at_nodes(segments, last, ranges)
                break
            segments = finer
        shooting = self.shooting(segments, winding, ranges)
        return shooting, shooting.pack(segments, period)

    def closed(self, run: Trajectory, accuracy: float) -> Orbit:
        """Return the orbit of a run that closes to rounding, with nodes where perturbations grow.

        It is not solved for again: of canard cycles the parameter does not determine the height.

        Parameters
        ----------
        run : Trajectory
            One period of an autonomous model.
        accuracy : float
            In units of the ranges.
        """
        since, period = run.span[0], run.span[1] - run.span[0]
        winding = np.zeros(self.variations.n)
        segments = segments_of(run, since, period, winding, self.variations, self.parameters)
        along = partial(_states_along, run, period, winding)
        for _ in range(REFINEMENTS):
            shooting = self.shooting(segments, winding)
            u = shooting.pack(segments, period)
            last = shooting.linearised(u)
            finer = divided(segments, growth_of(last, segments), along)
            if finer is segments:
                break
            segments = finer
        ranges = sizes_of(segments.states, segments.states)
        residual = float(np.abs(last.residual).max() / ranges.max())
        return self.orbit(segments, period, ShootingSolution(u, last, residual, accuracy))

    def states_at(
        self,
        modes: NDArray[np.int64],
        states: Array,
        times: Array,
        offsets: Array,
        constants: Array,
    ) -> Array:
        """States at offsets into segments, by the flow."""
        known = modes, states, times, offsets, self.parameters, constants
        return flow(self.variations, *known).ends

    def stretches(
        self, segments: Segments, period: float
    ) -> Iterator[tuple[Array, tuple[float, float], Array]]:
        """First states, time spans and switches of the runs of one period, anew at every node."""
        switches = segments.constants[:, len(self.variations.instants.symbols) :]
        if not (segments.ends == NODE).any():
            span = segments.start, segments.start + period
            yield self.on_interfaces(segments, 0), span, switches[0]
            return
        times = segments.times
        fresh = [0, *(np.flatnonzero(segments.ends[:-1] == NODE) + 1).tolist()]
        until = [*times[fresh[1:]].tolist(), float(times[0]) + period]
        for row, end in zip(fresh, until, strict=True):
            yield self.on_interfaces(segments, row), (float(times[row]), end), switches[row]

    def on_interfaces(self, segments: Segments, row: int) -> Array:
        """First state of a segment, exactly on the interfaces on which it slides.

        Beside them by rounding a run would begin in a region.
        """
        mode, state = segments.modes[[row]], segments.states[row]
        on = np.flatnonzero(self.variations.signs[mode[0]] == 0)
        if not len(on):
            return state
        place = segments.times[[row]], self.parameters, segments.constants[[row]]
        known = fields(self.variations, mode, state[None], *place)
        normals = known.g_u[0, on, : self.variations.n]
        return projected(state, normals, known.g[0, on], np.ones(len(state)))

    def free_run(self, segments: Segments, period: float) -> Trajectory:
        """Integrate one period freely, begun anew at every node."""
        runs: list[Trajectory] = []
        for state, span, switches in self.stretches(segments, period):
            runs.append(self.run(state, *span, switches))
            if not runs[-1].outcome:
                break
        return joined(runs)

    def confirmed(
        self, segments: Segments, period: float, values: Mapping[str, float]
    ) -> RunArrays | None:
        """Arrays of a free run at values of some parameters.

        None if it ends early, or has other events than the solved segments.
        """
        runs, parameters = [], self.parameters.copy()
        for name, value in values.items():
            parameters[self.variations.parameters.index(name)] = value
        here = self.at(parameters)
        for state, span, switches in here.stretches(segments, period):
            begin = self.prepared.run(state, span, values, switches)
            run = run_arrays(self.prepared, begin, _NO_TIMES)
            self.require_formed(run.modes)
            if run.code != REACHED_END:
                return None
            runs.append(run)
        if len(runs) > 1:
            tables = zip(*((*run[2:5], run.resets) for run in runs), strict=True)
            steps, crossings, series, resets = map(np.concatenate, tables)
            last = runs[-1]
            runs = [last._replace(steps=steps, crossings=crossings, series=series, resets=resets)]
        run, since = runs[0], segments.start
        times = here.jump_times(since, since + period, run.resets)
        steps = self.without_touches(run.steps, period)
        return run if same_itinerary(steps, segments, period, times) else None

    def without_touches(self, steps: Array, period: float) -> Array:
        """The steps of a run, without those beyond an interface that it touches to rounding.

        At such a touch rounding decides whether it crosses. The rates are continuous there.
        """
        mode = steps[:, 2].astype(np.int64)
        first = np.flatnonzero(np.append(True, mode[1:] != mode[:-1]))
        if len(first) < 3:
            return steps
        modes, starts = mode[first], steps[first, 0]
        brief = starts[2:] - starts[1:-1] <= GRAZED * period
        brief &= modes[2:] == modes[:-2]
        kept = np.ones(len(steps), dtype=bool)
        for k in (np.flatnonzero(brief) + 1).tolist():
            crossed = self.variations.signs[modes[k]] != self.variations.signs[modes[k - 1]]
            if not self.variations.jumping[crossed[: len(self.variations.jumping)]].any():
                kept[first[k] : first[k + 1]] = False
        return steps[kept]

    def jump_times(self, since: float, until: float, *tables: Array | None) -> Array:
        """Times of the resets, events and changes of switches of a run, and of the instants."""
        known = self.variations.instants_between(since, until, self.parameters)
        applied = [table[:, 0] for table in tables if table is not None]
        return np.concatenate([*applied, [time for time, _ in known]])

    def orbit(
        self, segments: Segments, period: float, solution: ShootingSolution, *, confirm: bool = True
    ) -> Orbit:
        """Return the orbit of solved segments, by default confirmed by a free run."""
        run = self.free_run(segments, period)
        after = np.roll(segments.modes, -1)
        points = np.vstack([segments.states[1:], segments.states[:1]])
        here, constants = (segments.times[1:], self.parameters), segments.constants
        following = fields(self.variations, after, points, *here, np.roll(constants, -1, axis=0))
        left = segments.jumps, solution.last.flows.ends
        _, jumps = after_jumps(self.variations, *left, *here, constants)
        found = orbit_multipliers(
            self.variations,
            segments.modes,
            segments.ends,
            solution.last.flows,
            solution.last.fields,
            following,
            jumps,
            autonomous=self.forcing is None,
        )
        speeds = approach_speeds(segments, solution.last.fields, self.variations)
        outcome = Outcome("periodic", f"periodic with T = {period:.9g}.", True)
        steps = self.without_touches(run.steps, period)
        if len(steps) < len(run.steps):
            words = "The orbit touches an interface: rounding decides whether it crosses it there."
            outcome = with_notes(outcome, [words])
        if not run.outcome:
            outcome = run.outcome
        elif confirm and (
            (speeds <= 0).any()
            or not same_itinerary(
                steps,
                segments,
                period,
                self.jump_times(*run.span, assignments_of(run), run.switch_table),
            )
        ):
            outcome = Outcome(
                "itinerary not confirmed",
                "a free run has another itinerary than the solved orbit, which grazes an interface "
                "or leaves one of its regions.",
                False,
            )
        elif max(solution.residual, solution.accuracy) > ORBIT_SOLVED:
            outcome = Outcome(
                "inaccurate",
                f"the orbit is known to {solution.accuracy:.2g} of its range alone.",
                False,
            )
        elif not solution.isolated:
            outcome = with_notes(
                outcome, ["The orbit is one of a family, as in a conservative system."]
            )
        event, segment = 1.0, -1
        if found.events:
            columns = run.sampled_columns[: self.variations.n].T
            event, segment = found.largest_event(sizes_of(columns, columns))
        # after a completed chatter its last impacts are of no consequence
        if outcome and event > SEGMENT_GROWTH and found.logs.max() > -np.inf:
            outcome = with_notes(
                outcome,
                [
                    f"The event at t = {segments.times[segment + 1]:.6g} amplifies perturbations "
                    f"{event:.2g} times, in units of the ranges of the states; nodes, which keep "
                    f"the growth along a segment below {SEGMENT_GROWTH:g}, do not reduce it."
                ],
            )
        multiple = None if self.forcing is None else self.multiple
        return Orbit(
            trajectory=run,
            period=period,
            multiple=multiple,
            multipliers=found.values,
            log_multipliers=found.logs,
            trivial=found.trivial,
            defect=found.defect,
            residual=solution.residual,
            accuracy=solution.accuracy,
            outcome=outcome,
        )


def _states_along(
    run: Trajectory,
    period: float,
    winding: Array,
    modes: NDArray[np.int64],
    states: Array,
    times: Array,
    offsets: Array,
    constants: Array,
) -> Array:
    """States of a run at times of the period that it covers, or of the next one."""
    when = times + offsets
    later = when > run.span[1]
    inside = np.clip(when - later * period, *run.span)
    return np.where((offsets == 0.0)[:, None], states, run(inside).T + later[:, None] * winding)


def growth_of(last: Linearised, segments: Segments, ranges: Array | None = None) -> Array:
    """Largest growth of a perturbation along every segment, in units of the states' ranges.

    Between any two times of the segment: along a canard perturbations grow and decay again. The
    ranges are by default those of the first states of the segments.
    """
    factors = _factors_in_units(last, segments, ranges)
    return np.array([max(_growths(own), default=0.0) for own in factors])


def joined_at_nodes(segments: Segments, last: Linearised, ranges: Array | None) -> Segments:
    """The segments of a solved orbit, joined at nodes as long as perturbations grow little."""
    factors = _factors_in_units(last, segments, ranges)
    first = [0]
    together = factors[0]
    for k in range(1, len(segments)):
        longer = np.concatenate([together, factors[k]])
        if segments.ends[k - 1] == NODE and max(_growths(longer)) <= GROWTH_OF_JOINED:
            together = longer
        else:
            first.append(k)
            together = factors[k]
    if len(first) == len(segments):
        return segments
    return without_some_nodes(segments, np.array(first))


def _factors_in_units(last: Linearised, segments: Segments, ranges: Array | None) -> list[Array]:
    """The matrices along every segment, in units of the states' ranges."""
    size = sizes_of(segments.states, segments.states) if ranges is None else ranges
    return [last.flows.factors_of(k) * size / size[:, None] for k in range(len(segments))]


def _growths(factors: Array) -> Iterator[float]:
    """Norms of the products of consecutive matrices, the largest of those that end with each."""
    n = factors.shape[1]
    ahead, excess = np.zeros((0, n, n)), max(n - UNGROWN, 0)
    with np.errstate(all="ignore"):
        for factor in factors:
            ahead = factor @ np.concatenate([ahead, np.eye(n)[None]])
            square = (ahead**2).sum(axis=(1, 2)).max() - excess
            largest = float(np.sqrt(np.maximum(square, 1.0) if excess else square))
            # beyond the range of numbers, or with rates that are not finite
            yield largest if np.isfinite(largest) else SEGMENT_GROWTH**8


def same_itinerary(
    steps: Array, segments: Segments, period: float, jumps: Array | None = None
) -> bool:
    """Check that the steps of a free run of one period have the events of the solved orbit.

    Parameters
    ----------
    steps : ndarray
    segments : Segments
    period : float
    jumps : ndarray, optional
        Times of resets and instants.
    """
    mode, whole = steps[:, 2], segments.without_nodes()
    last = (mode[1:] != mode[:-1]).nonzero()[0]
    if jumps is not None and len(jumps):
        return _same_events(steps, np.append(steps[last + 1, 0], jumps), whole, period)
    if len(last) + 1 != len(whole) or mode[-1] != whole.modes[-1]:
        return False
    if not len(last):
        return True
    same = (mode[last] == whole.modes[:-1]).all()
    late = np.abs(steps[last + 1, 0] - whole.event_times)
    return bool(same and (late <= SAME_TIME * period).all())


def _same_events(steps: Array, times: Array, segments: Segments, period: float) -> bool:
    """Check the times of all events, and the modes between them.

    Of a completed chatter, impacts that follow each other within the tolerance are not compared.
    """
    near = SAME_TIME * period
    if not len(segments.event_times):
        return False
    found, wanted = (
        every[np.append(True, np.diff(every) > near)]
        for every in (np.sort(times), segments.event_times)
    )
    if len(found) != len(wanted) or (np.abs(found - wanted) > near).any():
        return False
    edges = np.concatenate([[segments.start], wanted, [segments.start + period]])
    middle = 0.5 * (edges[:-1] + edges[1:])
    one = steps[np.searchsorted(steps[:, 0], middle, side="right") - 1, 2]
    two = segments.modes[np.searchsorted(segments.times[:-1], middle, side="right") - 1]
    return np.array_equal(one, two)


def _concatenated(tables: list[Array | None]) -> Array | None:
    known = [table for table in tables if table is not None]
    return np.concatenate(known) if known else None


def joined(runs: list[Trajectory]) -> Trajectory:
    """Return consecutive runs as one trajectory."""
    if len(runs) == 1:
        return runs[0]
    last = runs[-1]
    return replace(
        last,
        span=(runs[0].span[0], last.span[1]),
        steps=np.concatenate([run.steps for run in runs]),
        crossing_table=np.concatenate([run.crossing_table for run in runs]),
        reset_table=_concatenated([run.reset_table for run in runs]),
        switch_table=_concatenated([run.switch_table for run in runs]),
        event_table=_concatenated([run.event_table for run in runs]),
        series=np.concatenate([run.series for run in runs]),
    )
