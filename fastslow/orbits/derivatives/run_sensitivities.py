"""Sensitivities of a run: the variational equations along it, across all events."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from fastslow.errors import ArgumentError, ModelError, unknown_name
from fastslow.kernels.saltations import saltation
from fastslow.model.model import Model
from fastslow.orbits.flow.events import INSTANT_ROUNDING, Events, OrbitError, events_of
from fastslow.orbits.flow.flows import after_jumps, fields, flow
from fastslow.orbits.flow.forcing import forcing_of
from fastslow.orbits.flow.variations import Variations, variations_of
from fastslow.results.base.outcome import Outcome, stopped_early, with_notes
from fastslow.results.trajectory.events.jumps import assignments_of
from fastslow.results.trajectory.sensitivity import Sensitivity
from fastslow.results.trajectory.trajectory import Trajectory

Array = NDArray[np.float64]
Integers = NDArray[np.int64]

#: Steps between two nodes, from which the derivatives begin anew at the state of the run.
STEPS_BETWEEN_NODES = 8

#: Speed relative to the moduli of its terms below which a contact is tangential: the root of a
#: quadratic is located to the square root of rounding.
TANGENTIAL_SPEED = 1e-7

#: Distance, in units of the relative tolerance of the run and of the range of a function, within
#: which an interface is touched to the error of the run.
TOUCHING_DISTANCE = 100.0

#: Places in a step at which the rates of such functions are compared, and bisections between two.
COMPARED_PLACES, RATE_BISECTIONS = 4, 50


def sensitivity_of(run: Trajectory, names: Iterable[object]) -> Sensitivity:
    """Compute the derivatives of a run; see `Trajectory.sensitivity`."""
    found, period = _differentiation(run, names)
    return found.result(period)


def path_through(run: Trajectory, names: Iterable[object], times: Array) -> Path:
    """Compute the derivatives of a run at times; see `Trajectory.sensitivity` for the names."""
    found, _ = _differentiation(run, names)
    events, reason = found.events()
    return found.path(_snapped(times, events.times), events, reason)


def _differentiation(run: Trajectory, names: Iterable[object]) -> tuple[_Differentiation, Array]:
    """Check run and names; return the derivatives of the period too, NaN without forcing."""
    given = tuple(map(str, names))
    model = run.symbolic_model
    if not isinstance(model, Model):
        raise ModelError(
            "the sensitivities of a run need the equations of its model, which are not in a file; "
            "build the Model and simulate it again"
        )
    _check_names(model, run, given)
    if run.backwards:
        raise ArgumentError(
            "this run was integrated backwards in time, and sensitivities begin at the first "
            f"time; simulate from the state at t = {run.span[0]:.6g}"
        )
    if not run.is_dense:
        raise ArgumentError("sensitivities need dense output; simulate with dense=True")
    chosen = tuple(name for name in given if name not in run.states)
    variations = variations_of(model, chosen)
    parameters = variations.parameter_array(model)
    period = np.full(len(given), np.nan)
    forcing = None if run.period is None else forcing_of(model, variations, run.period)
    if forcing is not None:
        period[:] = 0.0
        period[[given.index(name) for name in chosen]] = forcing.period(parameters)[1]
    return _Differentiation(run, variations, parameters, given, chosen), period


def _check_names(model: Model, run: Trajectory, given: Sequence[str]) -> None:
    """Raise unless every name is a parameter or a state, and none is given twice."""
    known = (*run.states, *model.parameters)
    if not given:
        raise ArgumentError(f"expected at least one name of {', '.join(known)}, received none")
    for k, name in enumerate(given):
        require_no_forcing(model, name)
        if name not in known:
            raise unknown_name("parameter or state", name, known)
        if name in given[:k]:
            raise ArgumentError(f"{name} is given twice")


def require_no_forcing(model: Model, name: str) -> None:
    """Raise if a name is a slow quantity that is given as a function of time."""
    if name in model.forcing:
        law = model.forcing[name]
        known = {s.name for s in law.free_symbols} & {*model.states, *model.parameters}
        raise ArgumentError(
            f"{name} is a slow quantity, given by its law {law}; expected a parameter of it: "
            f"{', '.join(sorted(known)) or 'it has none'}"
        )


@dataclass(eq=False)
class Path:
    """Derivatives at ascending times of a run.

    Parameters
    ----------
    times : ndarray, shape (K,)
    states : ndarray, shape (K, n)
        At an event those after it.
    values : ndarray, shape (K, n, p)
        NaN where they are not known. At an event those after it.
    rates : ndarray, shape (K, n)
        Rates of the states; at an event those after it.
    crossing_times : ndarray, shape (n_crossings, p)
    reset_times : ndarray, shape (n_resets, p)
    switch_times : ndarray, shape (n_changes, p)
    event_times : ndarray, shape (n_executions, p)
    events : dict
        Time of an event to its derivatives, shape (p,), the state before it, and the
        derivatives of this state, shape (n, p).
    outcome : Outcome
    """

    times: Array
    states: Array
    values: Array
    rates: Array
    crossing_times: Array
    reset_times: Array
    switch_times: Array
    event_times: Array
    events: dict[float, tuple[Array, Array, Array]]
    outcome: Outcome

    def rows(self, times: Array) -> Integers:
        """Rows of some of the times."""
        return np.searchsorted(self.times, times)


class _NoDerivativeError(Exception):
    """An event at which the flow has no derivative, with the reason."""


@dataclass(frozen=True, eq=False)
class _Differentiation:
    """Derivatives of the states of a run along its steps.

    Parameters
    ----------
    run : Trajectory
    variations : Variations
        With the chosen parameters.
    parameters : ndarray
    given : tuple of str
        All names of derivatives: parameters and states.
    chosen : tuple of str
        Those that are parameters.
    """

    run: Trajectory
    variations: Variations
    parameters: Array
    given: tuple[str, ...]
    chosen: tuple[str, ...]

    def result(self, period: Array) -> Sensitivity:
        """Differentiate the run; ``period`` contains the derivatives of its period."""
        run, first = self.run, self.run.span[0]
        length = None if np.isnan(period).any() else run.period
        strobes = np.empty(0) if length is None else run.stroboscopic().t
        turns = np.array([run.dense.extreme_points(name, run.span) for name in run.states])
        events, reason = self.events()
        strobes = _snapped(strobes, events.times)
        turns[:, :, 1] = _snapped(turns[:, :, 1], events.times)
        path = self.path(np.concatenate([run.t, strobes, turns[:, :, 1].ravel()]), events, reason)
        late = np.zeros(len(self.given))
        if length is not None and run.n_periods is not None:
            late = run.n_periods * period
        final = self._final(path, late)
        moving = path.values[path.rows(strobes)]
        if length is not None:
            counts = np.rint((strobes - first) / length)[:, None]
            moved = (counts * period)[:, None, :]
            moving = moving + path.rates[path.rows(strobes)][:, :, None] * moved
            moving[strobes == run.span[1]] = final
        extremes = {
            name: np.array([self._turning(path, k, value, time, late) for value, time in points])
            for k, (name, points) in enumerate(zip(run.states, turns.tolist(), strict=True))
        }
        return Sensitivity(
            states=run.states,
            parameters=self.given,
            t=run.t,
            values=np.moveaxis(path.values[path.rows(run.t)], 0, -1),
            final=final,
            final_rate=path.rates[-1],
            crossing_times=path.crossing_times,
            reset_times=path.reset_times,
            switch_times=path.switch_times,
            event_times=path.event_times,
            period=period,
            stroboscopic=np.moveaxis(moving, 0, -1),
            extremes=extremes,
            outcome=path.outcome,
            equations=run.equations,
            settings=run.settings,
        )

    @cached_property
    def _fixed(self) -> Array:
        """Derivatives of time and of the chosen parameters by those given, shape (1 + P, p)."""
        chosen = np.array([("", *self.chosen)]).T
        return (chosen == np.array([self.given])).astype(float)

    def _with_parameters(self, now: Array) -> Array:
        """Derivatives of the unknowns (states, time, parameters), shape (n + 1 + P, p)."""
        return np.vstack([now, self._fixed])

    def path(self, wanted: Array, events: Events, reason: str) -> Path:
        """Integrate the derivatives, with nodes at some times at least.

        After the last event there are no derivatives if ``reason`` is not empty.
        """
        run, variations, parameters = self.run, self.variations, self.parameters
        touches = self._touches(events)
        some = run.step_starts[::STEPS_BETWEEN_NODES], events.times, wanted, [*touches], run.span
        times = np.unique(np.concatenate(some))
        states, lengths = run(times).T.copy(), np.diff(times)
        met = np.searchsorted(times, events.times)
        states[met] = events.states
        steps = np.searchsorted(run.step_starts, times, side="right") - 1
        modes = run.steps[steps, 2].astype(np.int64)
        # they change at events alone
        edges = np.concatenate([run.span[:1], events.times, run.span[1:]])
        middle = 0.5 * (edges[1:] + edges[:-1])
        switches = variations.switches_at(run, middle)
        between = variations.constants_at(middle, parameters, switches)
        constants = between[np.searchsorted(events.times, times, side="right")]
        here = modes[:-1], states[:-1], times[:-1]
        flows = flow(variations, *here, lengths, parameters, constants[:-1])
        whole = f"derivatives along the whole run.{stopped_early(run.outcome)}"
        path = Path(
            times=times,
            states=states,
            values=np.full((len(times), variations.n, len(self.given)), np.nan),
            rates=fields(variations, modes, states, times, parameters, constants).f,
            crossing_times=np.full((len(run.crossing_table), len(self.given)), np.nan),
            reset_times=np.full((len(run.resets), len(self.given)), np.nan),
            switch_times=np.full((len(run.switches), len(self.given)), np.nan),
            event_times=np.full((len(run.events), len(self.given)), np.nan),
            events={},
            outcome=with_notes(Outcome("complete", whole, True), self._approaches(events, between)),
        )
        crossed = _Crossed.of(self, events, between)
        number = dict(zip(events.times.tolist(), range(len(events)), strict=True))
        now = (np.array([self.given]) == np.array([run.states]).T).astype(float)
        last = float(events.times[-1]) if len(events) else run.span[0]
        try:
            now = self._begun(now, constants[:1])
            for k, time in enumerate(times.tolist()):
                if time in touches:
                    raise _NoDerivativeError(f"{touches[time]} is touched tangentially")
                if time in number:
                    now = self._passed(path, now, time, crossed, number[time])
                path.values[k] = now
                if reason and time >= last:
                    raise _NoDerivativeError(reason)
                if k < len(lengths):
                    if flows.reached[k] != lengths[k]:
                        raise _NoDerivativeError("the rates have no finite derivatives")
                    now = flows.slopes[k] @ self._with_parameters(now)
        except _NoDerivativeError as error:
            message = f"no derivative from t = {time:.10g} on, NaN: {error}"
            path.outcome = Outcome("no derivative", message, False)
        return path

    def events(self) -> tuple[Events, str]:
        """The events inside the run, up to the first that has no derivative, with the reason."""
        run = self.run
        begin, end = run.span
        inside = 8.0 * INSTANT_ROUNDING * max(abs(begin), abs(end), end - begin)

        def until(time: float) -> Events:
            return events_of(run, begin + inside, time, self.variations, self.parameters)

        try:
            return until(end - inside), ""
        except OrbitError as error:
            reason = error.outcome.message
        # between two steps there is no event
        middles = run.steps[:, 0] + 0.5 * run.steps[:, 1]
        low, high = 0, len(middles) - 1
        while low < high:
            middle = (low + high + 1) // 2
            try:
                until(float(middles[middle]))
                low = middle
            except OrbitError:
                high = middle - 1
        return until(float(middles[low])), reason

    def _contacts(self) -> dict[str, tuple[str, int]]:
        """Function of each wall, condition, and interface across which the rates jump.

        With its name and its number among the functions of `fields`.
        """
        variations, count = self.variations, self.variations.interfaces
        jumping = np.flatnonzero(~variations.continuous[:count]).tolist()
        walls = enumerate(variations.jumps.walls)
        triggers = enumerate(variations.jumps.triggers, start=variations.first_trigger)
        return {
            **{str(self.run.interfaces[k]): (str(self.run.interfaces[k]), k) for k in jumping},
            **{str(wall.function): (wall.wall, count + k) for k, wall in walls},
            **{str(h): (f"{h} = 0 (event)", k) for k, h in triggers},
        }

    def _touches(self, events: Events) -> dict[float, str]:
        """Times at which the run touches a wall, a condition, or an interface of jumping rates."""
        run = self.run
        found: dict[float, str] = {}
        for function, (name, number) in self._contacts().items():
            # a function that is no polynomial vanishes at no known time
            with suppress(ArgumentError):
                times = run.section(function, direction=0).t
                if number >= self.variations.interfaces:
                    times = times[~np.isin(_snapped(times, events.times), events.times)]
                    times = times[~self._held(times, number)]
                times = times[self._deciding(times, number)]
                found |= dict.fromkeys(times.tolist(), name)
        return found

    def _approaches(self, events: Events, between: Array) -> list[str]:
        """Sentences on functions that vanish, or turn, within the error of the run.

        Their rates change sign between two places of one step, without an event there.
        """
        run, variations = self.run, self.variations
        contacts, table = [*self._contacts().values()], run.series
        if not contacts or table is None:
            return []
        numbers = [number for _, number in contacts]
        starts, lengths = run.steps[:, :1], run.steps[:, 1:2]
        modes = run.steps[:, 2].astype(np.int64)
        constants = between[np.searchsorted(events.times, starts[:, 0], side="right")]

        def heights(rows: Integers, parts: Array) -> tuple[Array, Array]:
            """The functions and their rates at fractions of steps, one row for each place."""
            times = np.minimum(starts[rows, 0] + parts * lengths[rows, 0], run.span[1])
            series = table[rows, : variations.n]
            powers = (times - starts[rows, 0])[:, None, None] ** np.arange(series.shape[2])
            states = (series * powers).sum(axis=2)
            known = modes[rows], states, times, self.parameters, constants[rows]
            found = fields(variations, *known)
            slopes = found.g_u[:, numbers]
            rates = (slopes[:, :, : variations.n] @ found.f[:, :, None])[:, :, 0]
            return found.g[:, numbers], rates + slopes[:, :, variations.n]

        count = len(run.steps)
        rows = np.repeat(np.arange(count), COMPARED_PLACES + 1)
        values, rates = heights(
            rows, np.tile(np.arange(COMPARED_PLACES + 1) / COMPARED_PLACES, count)
        )
        shape = count, COMPARED_PLACES + 1, len(numbers)
        values, rates = values.reshape(shape), rates.reshape(shape)
        within = (
            TOUCHING_DISTANCE
            * float(run.settings.get("rtol", 0.0))
            * np.abs(values).max(axis=(0, 1))
        )
        held = variations.signs[modes][:, numbers] == 0
        sides = np.sign(values[:, :-1])
        turning = (sides == np.sign(values[:, 1:])) & ~held[:, None, :]
        turning &= (sides * rates[:, :-1] < 0.0) & (sides * rates[:, 1:] > 0.0)
        sentences = []
        for k, (name, _) in enumerate(contacts):
            begins = abs(values[0, 0, k]) <= within[k] and not held[0, k]
            if begins and self._deciding(starts[0], numbers[k])[0]:
                sentences.append(
                    f"The run begins at {name}: derivatives are those on the side that it enters."
                )
            steps, places = np.nonzero(turning[:, :, k])
            low, high = places / COMPARED_PLACES, (places + 1) / COMPARED_PLACES
            for _ in range(RATE_BISECTIONS if len(steps) else 0):
                middle = 0.5 * (low + high)
                ahead = heights(steps, middle)[1][:, k] * sides[steps, places, k] > 0.0
                low, high = np.where(ahead, low, middle), np.where(ahead, middle, high)
            close = np.zeros(len(steps), dtype=bool)
            if len(steps):
                close = np.abs(heights(steps, low)[0][:, k]) <= within[k]
                close &= self._deciding(starts[steps, 0] + low * lengths[steps, 0], numbers[k])
            sentences += [
                f"{name} is met within the error of the run at t = {time:.6g}: derivatives after "
                "it are those without contact."
                for time in (starts[steps, 0] + low * lengths[steps, 0])[close].tolist()
            ]
        return sentences

    def _deciding(self, times: Array, number: int) -> NDArray[np.bool_]:
        """Whether something changes at times at which a function passes zero."""
        found, place = np.ones(len(times), dtype=bool), number - self.variations.first_trigger
        if place >= 0:
            for k, time in enumerate(times.tolist()):
                found[k] = self.variations.jumps.decides(place, time, self.run(time))
        return found

    def _held(self, times: Array, number: int) -> NDArray[np.bool_]:
        """Whether the run slides on an interface, or is at rest on a wall, at times."""
        rows = np.searchsorted(self.run.step_starts, times, side="right") - 1
        modes = self.run.steps[rows, 2].astype(np.int64)
        return self.variations.signs[modes, number] == 0

    def _begun(self, now: Array, constants: Array) -> Array:
        """Derivatives just after the start: sliding reaches its interface at once."""
        variations, parameters, run = self.variations, self.parameters, self.run
        mode, start = int(run.steps[0, 2]), np.array([run.span[0]])
        held = np.flatnonzero(variations.signs[mode] == 0)
        if not len(held):
            return now
        state = run(start).T
        sides = variations.signs[mode].copy()
        sides[held] = np.where(held < variations.interfaces, 1, -1)
        (side,) = np.flatnonzero((variations.signs == sides).all(axis=1))[:1]
        jump = variations.jumps.number(-1, int(side), mode)
        if jump >= 0:
            slopes = after_jumps(variations, np.array([jump]), state, start, parameters, constants)[
                1
            ]
            return slopes[0] @ self._with_parameters(now)
        if len(held) > 1:
            raise _NoDerivativeError("the run begins with sliding on several interfaces")
        known = state, start, parameters, constants
        old = fields(variations, np.array([side]), *known)
        new = fields(variations, np.array([mode]), *known)
        matrix = saltation(old.f[0], new.f[0], old.g_u[0, held[0]])
        return matrix @ self._with_parameters(now)

    def _passed(self, path: Path, now: Array, time: float, crossed: _Crossed, k: int) -> Array:
        """Derivatives after an event."""
        n, table = self.variations.n, self.run.crossing_table
        before, slopes = crossed.before[k], crossed.slopes[k]
        speed = slopes[:n] @ before + slopes[n]
        scale = np.abs(slopes[:n]) @ np.abs(before) + abs(slopes[n])
        whole = self._with_parameters(now)
        if abs(speed) <= TANGENTIAL_SPEED * scale:
            if not crossed.smooth[k]:
                raise _NoDerivativeError("an interface or a wall is met tangentially")
            return now
        shift = -(slopes @ whole) / speed
        here = table[:, 0] == time
        path.crossing_times[here] = shift
        path.events[time] = shift, crossed.left[k], now + np.outer(before, shift)
        if self.run.reset_table is not None:
            path.reset_times[self.run.reset_table[:, 0] == time] = shift
        if self.run.switch_table is not None:
            path.switch_times[self.run.switch_table[:, 0] == time] = shift
        if self.run.event_table is not None:
            path.event_times[self.run.event_table[:, 0] == time] = shift
        if crossed.smooth[k]:
            return now
        if table[here, 5].any():
            note = (
                f"The crossing at t = {time:.10g} is nearly tangential: derivatives after it are "
                "large, and hold for changes by which it does not vanish."
            )
            path.outcome = with_notes(path.outcome, [note])
        return crossed.matrices[k] @ whole

    def _final(self, path: Path, late: Array) -> Array:
        """Derivatives of the final state, with those of its time, after a jump at it."""
        run, variations, parameters = self.run, self.variations, self.parameters
        moved = path.values[-1] + path.rates[-1][:, None] * late
        table, end = assignments_of(run), run.span[1]
        if end not in table[-1:, 0]:
            return moved
        n, mode = variations.n, int(run.steps[-1, 2])
        row, when = table[-1], np.array([end])
        jump = variations.jumps.number(int(row[1]), mode, mode)
        middle = when - 0.5 * run.steps[-1:, 1]
        switches = variations.switches_at(run, middle)
        constants = variations.constants_at(middle, parameters, switches)
        slopes = after_jumps(
            variations, np.array([jump]), row[None, 2 : 2 + n], when, parameters, constants
        )[1]
        whole = self._with_parameters(moved)
        whole[n] = late
        return slopes[0] @ whole

    def _turning(self, path: Path, k: int, value: float, time: float, late: Array) -> Array:
        """Derivatives of the extreme of a state, given by its value and time."""
        (row,) = path.rows(np.array([time]))
        after = path.values[row, k]
        if time not in path.events:
            return after + path.rates[row, k] * late * (time == self.run.span[1])
        shift, left, before = path.events[time]
        # at a jump the extreme is the state before or after it
        if abs(left[k] - value) <= abs(path.states[row, k] - value):
            return before[k]
        return after + path.rates[row, k] * shift


def _snapped(times: Array, events: Array) -> Array:
    """Times with those that are an event to rounding replaced by it."""
    if not len(events):
        return times
    above = np.clip(np.searchsorted(events, times), 0, len(events) - 1)
    below = np.maximum(above - 1, 0)
    nearer = np.abs(events[above] - times) < np.abs(events[below] - times)
    nearest = events[np.where(nearer, above, below)]
    return np.where(np.abs(nearest - times) <= INSTANT_ROUNDING * np.abs(times), nearest, times)


@dataclass(frozen=True, eq=False)
class _Crossed:
    """Derivatives at the m events of a run.

    Parameters
    ----------
    left, before : ndarray, shape (m, n)
        States and rates before.
    slopes : ndarray, shape (m, n + 1 + P)
        Derivatives of the functions that vanish.
    matrices : ndarray, shape (m, n, n + 1 + P)
        Derivatives of the states after.
    smooth : ndarray of bool, shape (m,)
        Whether neither state nor rates jump.
    """

    left: Array
    before: Array
    slopes: Array
    matrices: Array
    smooth: NDArray[np.bool_]

    @classmethod
    def of(cls, run: _Differentiation, events: Events, constants: Array) -> _Crossed:
        """Evaluate the events, with the constants of the intervals between them."""
        variations, parameters, times = run.variations, run.parameters, events.times
        old = fields(variations, events.before, events.left, times, parameters, constants[:-1])
        new = fields(variations, events.after, events.states, times, parameters, constants[1:])
        left = events.jumps, events.left, times, parameters, constants[:-1]
        resets = after_jumps(variations, *left)[1]
        slopes = old.g_u[np.arange(len(times)), events.ends]
        matrices = [saltation(*parts) for parts in zip(old.f, new.f, slopes, resets, strict=True)]
        switching = len(variations.continuous)
        inside = np.minimum(events.ends, switching - 1)
        slid = variations.signs[events.before, inside] == 0
        # the rates are continuous where sliding and rest end
        smooth = (events.ends >= switching) | slid | variations.continuous[inside]
        return cls(
            events.left,
            old.f,
            slopes,
            np.array(matrices).reshape(resets.shape),
            smooth & (events.jumps < 0),
        )
