"""Sensitivities of a run: the variational equations along it, across all events."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fastslow.errors import ArgumentError, ModelError, unknown_name
from fastslow.model.model import Model
from fastslow.orbits.flows import fields, flow
from fastslow.orbits.forcing import forcing_of
from fastslow.orbits.segments import OrbitError, functions_at
from fastslow.orbits.variations import Variations, variations_of
from fastslow.results.base.outcome import Outcome, with_notes
from fastslow.results.trajectory.sensitivity import Sensitivity
from fastslow.results.trajectory.trajectory import Trajectory

Array = NDArray[np.float64]
Integers = NDArray[np.int64]

#: Steps between two nodes, from which the derivatives begin anew at the state of the run.
NODES = 8

#: Speed relative to the moduli of its terms below which a contact is tangential: the root of a
#: quadratic is located to the square root of rounding.
TANGENTIAL = 1e-7


def sensitivity_of(run: Trajectory, names: Iterable[object]) -> Sensitivity:
    """Compute the derivatives of a run; see `Trajectory.sensitivity`."""
    given = tuple(map(str, names))
    model = run.symbolic_model
    if not isinstance(model, Model):
        raise ModelError(
            "the sensitivities of a run need the equations of its model, which are not in a file; "
            "build the Model and simulate it again"
        )
    _check_names(model, run, given)
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
    return _Differentiation(run, variations, parameters, given, chosen).result(period)


def _check_names(model: Model, run: Trajectory, given: Sequence[str]) -> None:
    """Raise unless every name is a parameter or a state, and none is given twice."""
    known = (*run.states, *model.parameters)
    if not given:
        raise ArgumentError(f"expected at least one name of {', '.join(known)}, received none")
    for k, name in enumerate(given):
        if name in model.forcing:
            free = sorted({str(s) for s in model.forcing[name].free_symbols} & set(known))
            raise ArgumentError(
                f"{name} is a slow quantity, given by its law {model.forcing[name]}; expected a "
                f"parameter of it: {', '.join(free) or 'it has none'}"
            )
        if name not in known:
            raise unknown_name("parameter or state", name, known)
        if name in given[:k]:
            raise ArgumentError(f"{name} is given twice")


@dataclass(eq=False)
class _Path:
    """Derivatives at ascending times of a run.

    Parameters
    ----------
    times : ndarray, shape (K,)
    values : ndarray, shape (K, n, p)
        NaN where they are not known. At an event those after it.
    rates : ndarray, shape (K, n)
        Rates of the states; at an event those after it.
    crossing_times : ndarray, shape (n_crossings, p)
    shifts : dict
        Time of an event to its derivatives, shape (p,).
    outcome : Outcome
    """

    times: Array
    values: Array
    rates: Array
    crossing_times: Array
    shifts: dict[float, Array]
    outcome: Outcome

    def rows(self, times: Array) -> Integers:
        """Rows of some of the times."""
        return np.searchsorted(self.times, times)

    def moving_with(self, time: float) -> Array:
        """Derivatives of the states at a time or, if it is an event, of the states at it."""
        row = int(self.rows(np.array([time]))[0])
        shift = self.shifts.get(time)
        moved = self.values[row]
        return moved if shift is None else moved + self.rates[row][:, None] * shift


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
        run, (first, last) = self.run, self.run.span
        length = None if np.isnan(period).any() else run.period
        strobes = np.empty(0) if length is None else run.stroboscopic().t
        turns = np.array([run.dense.extreme_times(name, run.span) for name in run.states])
        path = self._path(np.concatenate([run.t, strobes, turns.ravel()]))
        final, rows = path.values[-1].copy(), path.rows(strobes)
        moving = path.values[rows]
        if length is not None:
            counts = np.rint((strobes - first) / length)[:, None]
            moving = moving + path.rates[rows][:, :, None] * (counts * period)[:, None, :]
            if run.n_periods is not None:
                final += path.rates[-1][:, None] * (run.n_periods * period)
        extremes = {
            name: np.array([final[k] if t == last else path.moving_with(t)[k] for t in times])
            for k, (name, times) in enumerate(zip(run.states, turns.tolist(), strict=True))
        }
        return Sensitivity(
            run.states,
            self.given,
            run.t,
            np.moveaxis(path.values[path.rows(run.t)], 0, -1),
            final,
            path.crossing_times,
            period,
            np.moveaxis(moving, 0, -1),
            extremes,
            path.outcome,
            run.equations,
            run.settings,
        )

    def _path(self, wanted: Array) -> _Path:
        """Integrate the derivatives, with nodes at some times at least."""
        run, variations, parameters = self.run, self.variations, self.parameters
        n, p = variations.n, len(self.given)
        starts, mode = run.steps[:, 0], run.steps[:, 2].astype(np.int64)
        changes = np.flatnonzero(mode[1:] != mode[:-1]) + 1
        touches = self._touches()
        some = starts[::NODES], starts[changes], wanted, run.span, [*touches]
        times = np.unique(np.concatenate(some))
        states, lengths = run(times).T, np.diff(times)
        modes = mode[np.searchsorted(starts, times, side="right") - 1]
        flows = flow(variations, modes[:-1], states[:-1], times[:-1], lengths, parameters)
        path = _Path(
            times,
            np.full((len(times), n, p), np.nan),
            fields(variations, modes, states, times, parameters).f,
            np.full((len(run.crossing_table), p), np.nan),
            {},
            Outcome("complete", "derivatives along the whole run.", True),
        )
        columns = np.array([name not in run.states for name in self.given])
        now = (np.array(run.states)[:, None] == np.array(self.given)).astype(float)
        try:
            now = self._begun(now, columns, int(mode[0]), states[:1])
            for k, time in enumerate(times):
                if time in touches:
                    raise _NoDerivativeError(f"{touches[time]} is touched tangentially")
                for row in changes[starts[changes] == time]:
                    now = self._passed(path, now, columns, time, states[k], mode[row - 1 : row + 1])
                path.values[k] = now
                if k == len(lengths):
                    break
                if flows.reached[k] != lengths[k]:
                    raise _NoDerivativeError("the rates have no finite derivatives")
                now = flows.slopes[k, :, :n] @ now
                now[:, columns] += flows.slopes[k, :, n + 1 :]
        except (_NoDerivativeError, OrbitError) as error:
            message = f"no derivative from t = {time:.10g} on, NaN: {error}"
            path.outcome = Outcome("no derivative", message, False)
        return path

    def _touches(self) -> dict[float, str]:
        """Times at which the run touches an interface across which the rates jump."""
        found: dict[float, str] = {}
        for name in np.array(self.run.interfaces)[~self.variations.continuous].tolist():
            # an interface that is no polynomial is touched at no known time
            with suppress(ArgumentError):
                found |= dict.fromkeys(self.run.section(name, direction=0).t.tolist(), name)
        return found

    def _begun(self, now: Array, columns: NDArray[np.bool_], mode: int, state: Array) -> Array:
        """Derivatives just after the start: sliding reaches its interface at once."""
        variations, parameters = self.variations, self.parameters
        slides = np.flatnonzero(variations.signs[mode] == 0)
        if not len(slides):
            return now
        if len(slides) > 1:
            raise _NoDerivativeError("the run begins with sliding on several interfaces")
        sides = variations.signs.copy()
        sides[:, slides] = 1
        (side,) = np.flatnonzero((variations.signs == sides[mode]).all(axis=1))[:1]
        start = np.array([self.run.span[0]])
        old = fields(variations, np.array([side]), state, start, parameters)
        new = fields(variations, np.array([mode]), state, start, parameters)
        return self._across(now, columns, old.f[0], new.f[0], old.g_u[0, slides[0]])[0]

    def _passed(
        self,
        path: _Path,
        now: Array,
        columns: NDArray[np.bool_],
        time: float,
        state: Array,
        modes: Integers,
    ) -> Array:
        """Derivatives after a change of mode."""
        variations, run = self.variations, self.run
        when, place = np.array([time]), state[None, :]
        before, after = modes[:1], modes[1:]
        (end,) = functions_at(run, when, before, place, variations, self.parameters)
        old = fields(variations, before, place, when, self.parameters)
        new = fields(variations, after, place, when, self.parameters)
        slides = variations.signs[modes[0]] == 0
        # the rates are continuous where sliding ends
        same = end >= len(run.interfaces) or slides[end] or variations.continuous[end]
        moved, shift = self._across(
            now, columns, old.f[0], old.f[0] if same else new.f[0], old.g_u[0, end]
        )
        path.shifts[time] = shift
        here = run.crossing_table[:, 0] == time
        path.crossing_times[here] = shift
        if run.crossing_table[here, 5].any() and not same:
            note = (
                f"the crossing at t = {time:.10g} is nearly tangential: derivatives after it are "
                "large, and hold for changes by which it does not vanish."
            )
            path.outcome = with_notes(path.outcome, [note])
        return moved

    def _across(
        self, now: Array, columns: NDArray[np.bool_], before: Array, after: Array, slopes: Array
    ) -> tuple[Array, Array]:
        """Derivatives after an event, and those of its time."""
        n = self.variations.n
        speed = slopes[:n] @ before + slopes[n]
        scale = np.abs(slopes[:n]) @ np.abs(before) + abs(slopes[n])
        if abs(speed) <= TANGENTIAL * scale:
            if (before == after).all():
                return now, np.full(len(columns), np.nan)
            raise _NoDerivativeError("an interface is crossed tangentially")
        shift = -(slopes[:n] @ now)
        shift[columns] -= slopes[n + 1 :]
        shift /= speed
        return now + np.outer(before - after, shift), shift
