"""Computation of a periodic orbit from a guess."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fastslow.arguments import class_of, instance, mapping, positive, validated, whole
from fastslow.errors import ArgumentError
from fastslow.model.model import Model
from fastslow.orbits.canards.canard_cycles import canard_cycle
from fastslow.orbits.endings import NOT_CONFIRMED
from fastslow.orbits.find.candidates import Guess, candidates_of, changes_over
from fastslow.orbits.find.orbit_curve import states_along
from fastslow.orbits.find.starts import cycle_from, orbit_from
from fastslow.orbits.find.stiff_orbits import is_stiff, stiff_orbit
from fastslow.orbits.flow.events import OrbitError
from fastslow.orbits.flow.forcing import SAME_PERIOD
from fastslow.orbits.flow.forming import with_formed_motions
from fastslow.orbits.flow.problem import FINE, OrbitProblem
from fastslow.orbits.flow.segments import Segments, segments_of, winding_of
from fastslow.orbits.flow.shooting import sizes_of
from fastslow.orbits.points.kinds import SWITCHES
from fastslow.orbits.points.switching import without_segment
from fastslow.results.angles import apart, periods_of
from fastslow.results.base.outcome import Outcome, with_notes
from fastslow.results.orbits.canard import Canard
from fastslow.results.orbits.orbit import Orbit
from fastslow.results.orbits.special_orbit import SpecialOrbit
from fastslow.results.points import SpecialPoint
from fastslow.results.trajectory.events.jumps import assignments_of
from fastslow.results.trajectory.trajectory import Trajectory
from fastslow.simulation.arguments import initial_state, initial_switches, require_values
from fastslow.simulation.one import simulate
from fastslow.simulation.settings import Integration, integration_settings

Array = NDArray[np.float64]


#: Range of an orbit, in units of that of the guess, that is a point.
SHRUNK = 1e-6


#: Duration of a segment beyond an interface, as a fraction of the period, without which an orbit
#: is solved for, too.
GRAZING = 1e-3

#: Distance over one period up to which a guess is an orbit itself, in units of the ranges; that
#: from the orbit found from which it is another one, also in units of the former.
CLOSED_GUESS, OTHER_ORBIT, OTHER_ORBIT_RATIO = 1e-6, 1e-6, 1e3

#: Samples between two samples of an orbit, and number of such refinements.
REFINING_SAMPLES, REFINED = 17, 8

#: Of a model of very many regions: periods of a run whose motions are formed, largest change of
#: the states over its last one, in units of their ranges, and largest number of such runs.
SETTLING_PERIODS, SETTLED, MOST_SETTLING = 20, 1e-3, 10

#: Corrections of the time of a return.
SHIFTS = 4


@validated(
    model=instance(Model),
    multiple=whole(1, 10_000),
    period=positive,
    at=mapping,
    integration=integration_settings,
)
def find_orbit(
    model: Model,
    guess: Sequence[float]
    | Mapping[Any, float]
    | Trajectory
    | Orbit
    | SpecialOrbit
    | SpecialPoint
    | Canard,
    *,
    multiple: int = 1,
    period: float | None = None,
    at: Mapping[Any, float] | None = None,
    integration: Integration | None = None,
) -> Orbit:
    """Compute a periodic orbit near a guess, with its Floquet multipliers.

    The orbit is solved for by multiple shooting with Newton's method on the sequence of regions
    of a run, the times of the crossings being unknowns, and confirmed by a free run of one
    period. If the orbit is not near the guess, transients decay in a run first, so that
    any state is enough for an attracting orbit. Resets, rest on walls, clocks, periodic tables,
    switches and events without delay are events of the sequence.

    Parameters
    ----------
    model : Model
        With all parameter values; forced, or autonomous such as a frozen model.
    guess : sequence of float, mapping, Trajectory, Orbit, SpecialOrbit, SpecialPoint or Canard
        A state, in order or by name (with switches, if they are needed); a run, of which the
        end is used; an orbit, for instance at other parameter values; or a special point: HB
        of a diagram of this model, for the cycle
        of small amplitude; of a branch of orbits PD, for the orbit of twice the period, or BPC,
        for an orbit of the other branch (one of the two that a symmetry maps to each other).
        Parameter values are then those of the point, except that of the branch, which is a
        little beyond the point on the side where the orbit exists: `continue_orbits` traces
        the branch of this orbit. Or a canard, for a canard cycle of a planar model, whose
        parameter is solved for and is that of the returned orbit's trajectory.
    multiple : int
        Period of the orbit in periods of the forcing; without forcing in first returns.
    period : float, optional
        The period: a whole multiple of that of the forcing, or without forcing an estimate.
    at : mapping, optional
        With a canard, a point of the cycle: its extreme height as a value of the slow state, where
        the slow rate vanishes, ``at={"y": 0.2}``; or values of both states, for cycles with a
        head on the line of the other fold.
    integration : Integration, optional
        Settings of runs; by default ``rtol=1e-13``. Newton's method works to rounding.

    Returns
    -------
    Orbit
        Also if no orbit was found: then ``outcome`` gives the reason, the multipliers are NaN, and
        ``trajectory`` is the end of the run or the last iterate.

    Raises
    ------
    ArgumentError
        For an equilibrium as a guess, a period that is no multiple of the forcing's, or a
        frozen model without values.
    ModelError
        For functions without a Taylor recurrence.

    See Also
    --------
    fastslow.continue_orbits, fastslow.attractors, fastslow.lyapunov, fastslow.plot.multipliers

    Examples
    --------
    >>> import sympy as sp, fastslow as fs
    >>> x, y = sp.symbols("x y")
    >>> oscillator = fs.Model({x: y, y: (1 - x**2) * y - x})
    >>> orbit = fs.find_orbit(oscillator, [2, 0])
    >>> round(orbit.period, 11), orbit.stability
    (6.66328685932, 'stable')
    """
    if (at is not None) != isinstance(guess, Canard):
        words = "at= is a point of a canard cycle, and required with a canard as guess only"
        raise ArgumentError(f"{words}; received {class_of(guess)}{' and at=' if at else ''}")
    if isinstance(guess, SpecialOrbit | SpecialPoint | Canard):
        if multiple != 1 or period is not None:
            raise ArgumentError("multiple= and period= are those of the point, and cannot be given")
        if isinstance(guess, Canard):
            return canard_cycle(model, guess, at or {}, integration)
        if isinstance(guess, SpecialPoint):
            return _from_hopf(model, guess, integration)
        return _from_special_orbit(model, guess, integration)
    require_values(model)
    multiple = _multiple(model, multiple, period)
    start = _guess(model, guess)
    if model.partition.pieces is not None and not model.structure.formed:
        return _in_formed_motions(model, start, multiple, period, integration)
    problem = OrbitProblem.of(model, multiple, period, integration)
    if start.run is not None:
        problem.require_formed(start.run.modes)
    found: Orbit | None = None
    begun: tuple[Trajectory, float, float] | None = None
    for run, since, length, near in candidates_of(problem, start, period):
        begun = begun or (run, since, length)
        if not run.outcome:
            if found and found.outcome:
                return _moved(found, problem, *begun)
            notes = [f"Near the guess itself: {found.outcome.message}"] if found else []
            return _not_found(run, since, length, problem, with_notes(run.outcome, notes))
        try:
            found = _solved(problem, run, since, length)
        except OrbitError as error:
            last = _not_found(run, since, length, problem, error.outcome)
            if error.outcome.code == "corner" and near == np.inf:  # of a run that repeats
                return last
            found = found or last
            continue
        if found.outcome and (near == np.inf or _distance(problem, found, run, since) <= near):
            return _moved(_remarked(found, problem), problem, *begun)
    assert found is not None
    assert begun is not None
    return _moved(found, problem, *begun)


def _in_formed_motions(
    model: Model,
    start: Guess,
    multiple: int,
    period: float | None,
    integration: Integration | None,
) -> Orbit:
    """Compute an orbit of a model of very many regions with the motions of runs near it."""
    forced = model.period()
    length = period if forced is None else multiple * forced
    if length is None:
        raise ArgumentError(
            f"a model of {model.regions} needs an estimate of the period of its orbit: give period="
        )
    begin: Any = dict(zip((*model.states, *model.slow_states), start.state.tolist(), strict=True))
    time, settled = start.time, integration or FINE
    for _ in range(MOST_SETTLING):
        span = time, time + SETTLING_PERIODS * length
        run = simulate(model, begin, t=span, integration=settled)
        if not run.outcome or changes_over(run, length).max() <= SETTLED:
            break
        time, begin = span[1], run.final_state
    modes = np.unique(run.steps[run.steps[:, 0] >= run.span[1] - 2.0 * length, 2]).astype(int)
    names = [run.modes[k] for k in modes.tolist()]
    time, begin = run.span[1], run.final_state

    def found(restricted: Model) -> Orbit:
        near = simulate(restricted, begin, t=(time, time + length), integration=settled)
        return find_orbit(
            restricted, near, multiple=multiple, period=period, integration=integration
        )

    return with_formed_motions(model, names, found)


def _from_special_orbit(
    model: Model,
    point: SpecialOrbit,
    integration: Integration | None,
) -> Orbit:
    """Compute the orbit of the other branch near a special point."""
    if point.code not in SWITCHES:
        raise ArgumentError(
            f"guess: {point.label}, a {point.words}; expected a point from which another branch of "
            f"orbits emanates: {' or '.join(SWITCHES)}"
        )
    if not point.converged:
        raise ArgumentError(f"guess: {point.label} was not solved to rounding, converged = False")
    _require_model_of(model, point, point.orbit.states)
    at = model.with_parameters(dict(point.parameters))
    count = (point.orbit.multiple or 1) * SWITCHES[point.code].switches
    problem = OrbitProblem.of(at, count, None, integration, (point.parameter,))
    try:
        return orbit_from(problem, point)
    except OrbitError as error:
        run = point.orbit.trajectory
        return _not_found(run, run.span[0], point.orbit.period, problem, error.outcome)


def _from_hopf(model: Model, point: SpecialPoint, integration: Integration | None) -> Orbit:
    """Compute the cycle near a Hopf point."""
    if not point.kind.starts_cycles:
        raise ArgumentError(
            f"guess: {point.label}, a {point.words}; expected a Hopf point, HB, from which cycles "
            "emanate"
        )
    if not point.converged:
        raise ArgumentError(f"guess: {point.label} was not solved to rounding, converged = False")
    if point.source is None:
        raise ArgumentError(
            f"guess: {point.label} has no model (it was read from a file or another process); "
            "trace its diagram again and use its point"
        )
    _require_model_of(model, point, point.states)
    known = point.source.model
    (varied,) = (name for name in known.free if name not in known.parameters)
    at = model.with_parameters(dict(point.parameters))
    problem = OrbitProblem.of(at, 1, None, integration, (varied,))
    try:
        return cycle_from(problem, point)
    except OrbitError as error:
        assert point.frequency is not None
        length = 2 * np.pi / point.frequency
        run = problem.run(np.array(point.state, dtype=float), 0.0, length)
        return _not_found(run, 0.0, length, problem, error.outcome)


def _require_model_of(
    model: Model, point: SpecialOrbit | SpecialPoint, states: tuple[str, ...]
) -> None:
    """Raise if a point is not one of a model."""
    names = {*model.parameters, *model.free}
    if states != (*model.states, *model.slow_states) or set(point.parameters) != names:
        raise ArgumentError(
            f"guess: {point.label} is a point of a model with the states {', '.join(states)} and "
            f"the parameters {', '.join(point.parameters)}; this one has the states "
            f"{', '.join((*model.states, *model.slow_states))} and the parameters "
            f"{', '.join(sorted(names))}"
        )


def _multiple(model: Model, multiple: int, period: float | None) -> int:
    """Number of periods of the forcing, from ``multiple=`` and ``period=``."""
    forced = model.period()
    if forced is None or period is None:
        return multiple
    count = round(period / forced)
    if count < 1 or abs(period - count * forced) > SAME_PERIOD * period:
        raise ArgumentError(
            f"period = {period:.12g}; expected a whole multiple of the period of the forcing, "
            f"{forced:.12g}, or multiple="
        )
    if multiple not in (1, count):
        raise ArgumentError(
            f"period = {period:.12g} is {count} periods of the forcing, but multiple = {multiple}"
        )
    return count


def _guess(model: Model, guess: Any) -> Guess:
    """Validate a guess."""
    names = (*model.states, *model.slow_states, *model.assigned)
    if isinstance(guess, Trajectory | Orbit):
        if guess.states != names:
            raise ArgumentError(
                f"guess: {class_of(guess)} of {', '.join(guess.states)}; the model has the states "
                f"{', '.join(names)}"
            )
        if isinstance(guess, Orbit):
            run = guess.trajectory
            return Guess(run.span[0], run(run.span[0]), run, guess.period, run.end_switches)
        return Guess(float(guess.end[0]), guess.end[1:].copy(), guess, switches=guess.end_switches)
    return Guess(0.0, initial_state(model, guess), switches=initial_switches(model, guess))


def _solved(problem: OrbitProblem, run: Trajectory, since: float, period: float) -> Orbit:
    """Solve for the orbit of one period of a run; with the itinerary of the free run if needed."""
    begun, found = (run, since), None
    if is_stiff(problem, run, since, period):
        found = stiff_orbit(problem, run, since, period, winding_of(run, since, period))
        if found is not None:
            return found
    for _ in range(4):
        since = min(since, run.span[1] - period) if run.span[1] - period >= run.span[0] else since
        winding = winding_of(run, since, period)
        run, segments = _period_of(problem, run, since, period, winding)
        brief = _without_brief_ones(segments, problem)
        alone = None
        if brief is not segments:
            alone = _solved_as(problem, brief, period, winding, run)
        orbit = _solved_as(problem, segments, period, winding, run, raises=alone is None)
        both = [one for one in (alone, orbit) if one is not None]
        confirmed = [one for one in both if one.outcome.code != NOT_CONFIRMED.code]
        solved = [one for one in confirmed if one.outcome]
        if len(solved) > 1:
            # of an orbit that grazes an interface, the nearest solution
            return min(solved, key=lambda one: _distance(problem, one, *begun))
        if confirmed:
            return (solved or confirmed)[-1]
        found = both[-1]
        run, since, period = found.trajectory, found.t0, found.period
    assert found is not None
    return found


def _solved_as(
    problem: OrbitProblem,
    segments: Segments,
    period: float,
    winding: Array,
    run: Trajectory,
    *,
    raises: bool = False,
) -> Orbit | None:
    """Solve for the orbit with the itinerary of some segments; without one None, or an error."""
    try:
        shooting, solution = problem.solve(segments, period, winding, run)
        solved, length = shooting.unpack(solution.u)
        if length <= 0.0 or (solved.durations < 0).any():
            raise OrbitError(
                Outcome(
                    "itinerary not confirmed",
                    "the solution of the equations has a segment of negative duration, so it is no "
                    "orbit: give a guess nearer to an orbit.",
                    False,
                )
            )
        orbit = problem.orbit(solved, length, solution)
        if problem.forcing is None and _is_point(orbit.trajectory, run):
            text = (
                "Newton's method converges to an equilibrium: the orbit has shrunk to a point. "
                "Give a guess nearer to an orbit."
            )
            raise OrbitError(Outcome("equilibrium", text, False))
    except OrbitError:
        if raises:
            raise
        return None
    return orbit


def _without_brief_ones(segments: Segments, problem: OrbitProblem) -> Segments:
    """The segments without brief ones beyond an interface, where an orbit may graze it.

    Across the duration of such a segment the equations have a square root.
    """
    k = 1
    brief, longest = segments, GRAZING * segments.period
    while k < len(brief) - 1:
        around = slice(k - 1, k + 1)
        if (
            brief.durations[k] <= longest
            and brief.modes[k - 1] == brief.modes[k + 1]
            and (brief.jumps[around] < 0).all()
            and (brief.ends[around] < problem.variations.interfaces).all()
        ):
            brief = without_segment(brief, k)
        else:
            k += 1
    return brief


def _is_point(run: Trajectory, guess: Trajectory) -> bool:
    """Check whether the ranges of a run are rounding beside those of the guess."""
    n = len(run.states)
    reach, before = (np.ptp(one.sampled_columns[:n], axis=1) for one in (run, guess))
    return bool((reach <= SHRUNK * before).all())


def _period_of(
    problem: OrbitProblem, run: Trajectory, since: float, period: float, winding: Array
) -> tuple[Trajectory, Segments]:
    """Segments of one period of a run, which begins elsewhere if it began at an event."""
    known = period, winding, problem.variations, problem.parameters
    try:
        return run, segments_of(run, since, *known)
    except OrbitError as error:
        if error.outcome.code != "itinerary not closed":
            raise
    mode, starts = run.steps[:, 2], run.steps[:, 0]
    changes = np.append(
        starts[1:][mode[1:] != mode[:-1]],
        problem.jump_times(since, since + period, assignments_of(run), run.switch_table),
    )
    inside = np.sort(changes[(changes > since) & (changes < since + period)])
    edges = np.concatenate([[since], inside, [since + period]])
    longest = int(np.argmax(np.diff(edges)))
    middle = float(0.5 * (edges[longest] + edges[longest + 1]))
    (switches,) = problem.variations.switches_at(run, np.array([middle]))
    run = problem.run(run(middle), middle, middle + period, switches)
    return run, segments_of(run, middle, *known)


def _distance(problem: OrbitProblem, orbit: Orbit, run: Trajectory, since: float) -> float:
    """Distance of the state at the beginning of a run from an orbit, in units of its ranges."""
    state, path = run(since), orbit.trajectory
    lengths = periods_of(orbit.states, path.periods)
    if problem.forcing is not None:
        states = states_along(path, len(orbit.states))
        size = sizes_of(states, states)
        return float(np.abs(apart(orbit(since), state, lengths) / size).max())
    times, states = path.t, path.sampled_columns[: len(orbit.states)].T
    size = sizes_of(states, states)
    away = np.abs(apart(states, state, lengths) / size).max(axis=1)
    # between samples
    for _ in range(REFINED):
        nearest = int(np.argmin(away))
        around = times[max(nearest - 1, 0)], times[min(nearest + 1, len(times) - 1)]
        times = np.linspace(around[0], around[1], REFINING_SAMPLES)
        least, away = away[nearest], np.abs(apart(path(times).T, state, lengths) / size).max(axis=1)
        if away.min() >= least:
            return float(least)
    return float(away.min())


def _moved(
    orbit: Orbit, problem: OrbitProblem, run: Trajectory, since: float, period: float
) -> Orbit:
    """Return the orbit, with a note if the guess is an orbit itself to some digits, and another."""
    if not orbit.outcome:
        return orbit
    gap = _closing_gap(problem, run, since, period)
    if gap > CLOSED_GUESS:
        return orbit
    away = _distance(problem, orbit, run, since)
    if away <= max(OTHER_ORBIT, OTHER_ORBIT_RATIO * gap):
        return orbit
    note = (
        f"The guess repeats after {period:.6g} to {gap:.1g} of the ranges of the states, and is "
        f"{away:.2g} of them away from this orbit."
    )
    return replace(orbit, outcome=with_notes(orbit.outcome, [note]))


def _closing_gap(problem: OrbitProblem, run: Trajectory, since: float, period: float) -> float:
    """Distance of the state of a run from that one period later, in units of the ranges."""
    if not run.outcome or run.span[1] < since + period:
        return np.inf
    states, lengths = run.sampled_columns[: len(run.states)].T, periods_of(run.states, run.periods)
    size, until = sizes_of(states, states), since + period
    gap = apart(run(until), run(since), lengths) / size
    for _ in range(SHIFTS if problem.forcing is None else 0):
        # the time of the return is known to the distance of samples
        step = 1e-6 * period
        rate = apart(run(until), run(until - step), lengths) / size / step
        until = min(until - float(gap @ rate) / float(rate @ rate), run.span[1])
        gap = apart(run(until), run(since), lengths) / size
    return float(np.abs(gap).max())


def _remarked(orbit: Orbit, problem: OrbitProblem) -> Orbit:
    """Return the orbit, with a note if it repeats within its period."""
    for count in range(2, problem.multiple + 1):
        if problem.multiple % count:
            continue
        part = orbit.period / count
        gap = np.abs(orbit(orbit.t0 + part) - orbit(orbit.t0))
        states = orbit.trajectory.sampled_columns[: len(orbit.states)].T
        if (gap <= 1e-9 * sizes_of(states, states)).all():
            first = problem.multiple // count
            note = f"The orbit repeats after {first} of {problem.multiple} periods."
            return replace(orbit, outcome=with_notes(orbit.outcome, [note]))
    return orbit


def unsolved(
    model: Model, state: Array, outcome: Outcome, integration: Integration | None
) -> Orbit:
    """Return a short run from a state, with the reason why no orbit was sought."""
    problem = OrbitProblem.of(model, 1, None, integration)
    length = 1.0
    return _not_found(problem.run(state, 0.0, length), 0.0, length, problem, outcome)


def _not_found(
    run: Trajectory, since: float, period: float, problem: OrbitProblem, outcome: Outcome
) -> Orbit:
    """Return the end of a run, with the reason why no orbit was found."""
    n = problem.variations.n
    until = run.span[1]
    begin = max(until - period, run.span[0])
    if len(run.steps) and begin > run.span[0]:
        run = run.select(between=(begin, until))[0]
    multiple = None if problem.forcing is None else problem.multiple
    nothing, unknown = np.full(n, np.nan), float("nan")
    return Orbit(
        *(run, period, multiple, nothing.astype(complex), nothing, None),
        *(unknown, unknown, unknown, outcome),
    )
