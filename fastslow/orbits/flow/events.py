"""Changes of the smooth motion of a run: crossings, resets, events, and instants of clocks."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fastslow.orbits.flow.flows import fields
from fastslow.orbits.flow.variations import Variations
from fastslow.results.base.outcome import Outcome
from fastslow.results.trajectory.events.jumps import assignments_of
from fastslow.results.trajectory.trajectory import Trajectory

Array = NDArray[np.float64]
Integers = NDArray[np.int64]

#: Height of a condition, in units of the ranges of the states, at which it becomes true.
AT_CONDITION = 1e-9

#: Distance from a step of a computed instant, in units of the length of the run.
INSTANT_ROUNDING = 1e-12


class OrbitError(Exception):
    """An orbit that could not be computed; carries the outcome."""

    def __init__(self, outcome: Outcome) -> None:
        super().__init__(str(outcome))
        self.outcome = outcome


@dataclass(frozen=True, eq=False)
class Events:
    """The m events of a run inside a time interval, in order.

    Parameters
    ----------
    times : ndarray, shape (m,)
    before, after : ndarray of int64, shape (m,)
        Modes.
    ends : ndarray of int64, shape (m,)
        The switching function that vanishes.
    jumps : ndarray of int64, shape (m,)
        The jump of the state, see `Jumps.number`; -1 for none.
    left, states : ndarray, shape (m, n)
        States before and after the jump.
    switches : ndarray, shape (m, n_switches)
        Values of the switches after the event.
    """

    times: Array
    before: Integers
    after: Integers
    ends: Integers
    jumps: Integers
    left: Array
    states: Array
    switches: Array

    def __len__(self) -> int:
        return len(self.times)


#: Distance from an interface up to which a motion follows it, in units of its range.
FOLLOWED_DISTANCE = 1e-9


def events_of(
    run: Trajectory, since: float, until: float, variations: Variations, parameters: Array
) -> Events:
    """Return the events of a run inside an open time interval.

    Raises
    ------
    OrbitError
        If several resets, events or interfaces coincide, or an end of the interval is a reset, an
        event or an instant.
    """
    starts, mode = run.steps[:, 0], run.steps[:, 2].astype(np.int64)
    changed = np.flatnonzero(mode[1:] != mode[:-1]) + 1
    allowed = INSTANT_ROUNDING * max(abs(since), abs(until), until - since)
    known = variations.instants_between(since - allowed, until + allowed, parameters)
    near = np.array([time for time, _ in known])
    table = assignments_of(run)
    changes = np.zeros((0, 3)) if run.switch_table is None else run.switch_table
    applied = np.append(table[:, 0], changes[:, 0])
    edges = np.abs(np.append(near, applied)[:, None] - [since, until])
    if (edges <= allowed).any():
        text = "the run begins or ends at a reset, an event or an instant: begin it elsewhere."
        raise OrbitError(Outcome("itinerary not closed", text, False))
    met = nearest_steps(starts, near, allowed)
    rows = np.unique(np.r_[changed, met, nearest_steps(starts, applied, 0.0)])
    rows = rows[(rows > 0) & (starts[rows] > since) & (starts[rows] < until)]
    times, before, after = starts[rows], mode[rows - 1], mode[rows]
    assert run.series is not None
    states = run.series[rows, : variations.n, 0]
    left, jumps = states.copy(), np.full(len(rows), -1)
    resets = np.full(len(rows), -1)
    for k in np.flatnonzero(np.isin(times, table[:, 0])).tolist():
        found = np.flatnonzero(table[:, 0] == times[k])
        if len(found) > 1:
            every = (*run.reset_names, *run.event_names)
            names = " and ".join(every[int(row)] for row in table[found, 1])
            what = "resets" if table[found, 1].max() < len(run.reset_names) else "events"
            raise _corner(f"several {what}, {names},", times[k])
        resets[k] = int(table[found[0], 1])
        left[k] = table[found[0], 2 : 2 + variations.n]
    for k in range(len(rows)):
        jumps[k] = variations.jumps.number(int(resets[k]), int(before[k]), int(after[k]))
    instants = np.full(len(rows), -1)
    for k in np.flatnonzero(np.isin(times, changes[:, 0])).tolist():
        found = np.unique(changes[changes[:, 0] == times[k], 1])
        if len(found) > 1:
            names = " and ".join(run.switch_names[int(row)] for row in found)
            raise _corner(f"changes of the switches {names}", times[k])
        instants[k] = variations.first_switch + int(found[0])
    for row, (_, function) in reversed(list(zip(met.tolist(), known, strict=True))):
        instants[rows == row] = function
    edges = np.append(since, times)
    middle = 0.5 * (edges[:-1] + edges[1:])
    constants = variations.constants_at(middle, parameters, variations.switches_at(run, middle))
    met_at = times, before, after, left, resets, instants
    ends = _functions_at(run, *met_at, variations, parameters, constants)
    return Events(
        *(times, before, after, ends, jumps, left, states),
        variations.switches_at(run, times),
    )


def nearest_steps(starts: Array, times: Array, allowed: float) -> Integers:
    """The steps that begin at some times."""
    if not len(starts):
        return np.zeros(0, dtype=np.int64)
    above = np.clip(np.searchsorted(starts, times), 1, max(len(starts) - 1, 1))
    below = above - 1
    above = np.minimum(above, len(starts) - 1)
    nearest = np.where(np.abs(starts[above] - times) <= np.abs(starts[below] - times), above, below)
    return np.asarray(nearest[np.abs(starts[nearest] - times) <= allowed])


def _corner(what: str, time: float) -> OrbitError:
    text = f"the orbit meets {what} at once, at t = {time:.10g}; perturb a parameter."
    return OrbitError(Outcome("corner", text, False))


def functions_at(
    run: Trajectory,
    when: Array,
    before: Integers,
    after: Integers,
    states: Array,
    variations: Variations,
    parameters: Array,
) -> Integers:
    """Return the switching function that vanishes at every change of mode without reset.

    Raises
    ------
    OrbitError
        If several interfaces are met at once.
    """
    none = np.full(len(when), -1)
    found = when, before, after, states, none, none
    return _functions_at(run, *found, variations, parameters, None)


def _functions_at(
    run: Trajectory,
    when: Array,
    before: Integers,
    after: Integers,
    states: Array,
    resets: Integers,
    instants: Integers,
    variations: Variations,
    parameters: Array,
    constants: Array | None,
) -> Integers:
    table = run.crossing_table
    count, walls = len(variations.continuous), variations.walls
    resets_alone = len(variations.jumps.resets)
    known = None
    ends = np.empty(len(when), dtype=np.int64)
    for k, (time, mode) in enumerate(zip(when, before, strict=True)):
        if 0 <= resets[k] < walls:
            if instants[k] >= 0:
                raise _corner("a wall and an instant", time)
            ends[k] = variations.interfaces + resets[k]
            continue
        if resets[k] >= resets_alone:
            row = slice(k, k + 1)
            given = None if constants is None else constants[row]
            event = int(resets[k]) - resets_alone, int(instants[k])
            here = before[row], states[row], when[row]
            ends[k] = condition_met(run, *event, variations, here, parameters, given)
            continue
        if instants[k] >= 0:
            ends[k] = instants[k]
            continue
        rows = np.flatnonzero((table[:, 0] == time) & (table[:, 3] != table[:, 4]))
        found = {int(j) for j in table[rows, 1]}
        slides = np.flatnonzero(variations.signs[mode] == 0)
        ending = slides[variations.signs[after[k], slides] != 0]
        if found and (ending >= variations.interfaces).any():
            # an interface of the velocity alone is met at rest all the time: the contact ends
            begun = run.span[0] if k == 0 else when[k - 1]
            halfway = 0.5 * (begun + time)
            given = None if constants is None else constants[k : k + 1]
            there = before[k : k + 1], run(halfway)[None], np.array([halfway])
            found &= _met_later(run, *there, variations, parameters, given)
        if found - set(slides.tolist()):
            # at a crossing of another one, as of an interface in time, sliding may end as well
            found -= set(slides.tolist())
        if len(found) > 1:
            raise _corner(" and ".join(run.interfaces[j] for j in sorted(found)), time)
        number = found.pop() if found else int((ending if len(ending) else slides)[0])
        if number not in slides:
            ends[k] = number
            continue
        if known is None:
            known = fields(variations, before, states, when, parameters, constants)
        bounds = count + 2 * int(np.flatnonzero(slides == number)[0]) + np.arange(2)
        slopes = known.g_u[k, bounds]
        speed = slopes[:, : variations.n] @ known.f[k] + slopes[:, variations.n]
        remaining = np.abs(known.g[k, bounds]) / np.maximum(np.abs(speed), np.finfo(float).tiny)
        ends[k] = bounds[np.argmin(remaining)]
    return ends


def condition_met(
    run: Trajectory,
    event: int,
    instant: int,
    variations: Variations,
    here: tuple[Integers, Array, Array],
    parameters: Array,
    constants: Array | None,
) -> int:
    """Return the switching function that vanishes where an event is triggered by the motion.

    Parameters
    ----------
    run : Trajectory
    event, instant : int
        Number of the event; switching function of an instant at the same time, -1 without one.
    variations : Variations
    here : tuple of ndarray
        Mode, state and time before the event, with one row each.
    parameters, constants
        As for `fields`.

    Raises
    ------
    OrbitError
        If several functions vanish there, or none.
    """
    what = f"the event {run.event_names[event]}"
    known, (_, (state,), (time,)) = fields(variations, *here, parameters, constants), here
    numbers = variations.first_trigger + np.array(variations.jumps.triggers_of[event], dtype=int)
    assert run.series is not None
    n = variations.n
    size = np.ptp(run.series[:, :n, 0], axis=0) + np.abs(state)
    reach = np.abs(known.g_u[0, numbers, : n + 1]) @ np.append(size, np.abs(run.span).max())
    met = numbers[(np.abs(known.g[0, numbers]) <= AT_CONDITION * reach) & (reach > 0.0)]
    slopes = known.g_u[0, met]
    met = met[slopes[:, :n] @ known.f[0] + slopes[:, n] > 0.0]
    if instant >= variations.first_switch:
        raise _corner(f"{what} and a change of a switch", time)
    if instant >= 0 and not len(met):
        return instant
    if instant >= 0:
        raise _corner(f"{what} and an instant of time", time)
    if len(met) > 1:
        raise _corner(f"several conditions of {what}", time)
    if not len(met):
        text = (
            f"{what} at t = {time:.10g} is not triggered by the motion through its condition: "
            "it is tangent to it, or something else changes the condition there."
        )
        raise OrbitError(Outcome("corner", text, False))
    return int(met[0])


def _met_later(
    run: Trajectory,
    mode: Integers,
    state: Array,
    time: Array,
    variations: Variations,
    parameters: Array,
    constants: Array | None,
) -> set[int]:
    """The interfaces that a motion does not follow at an earlier time, beyond rounding."""
    assert run.series is not None
    known = fields(variations, mode, state, time, parameters, constants)
    count = len(run.interfaces)
    size = np.append(np.ptp(run.series[:, : variations.n, 0], axis=0), np.abs(run.span).max())
    reach = np.abs(known.g_u[0, :count, : variations.n + 1]) @ size
    return set(np.flatnonzero(np.abs(known.g[0, :count]) > FOLLOWED_DISTANCE * reach).tolist())
