"""Which stable sheet of a diagram a trajectory follows, and where it changes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from fastslow.arguments import finite, formula, instance, validated
from fastslow.errors import ArgumentError, unknown_name
from fastslow.passage.overlay.agreement import require_one_model
from fastslow.passage.overlay.attracting_branches import courses_of
from fastslow.passage.overlay.bursting import Burst, bursting_of
from fastslow.passage.overlay.cycle_ends import cycle_end, ending, slowly
from fastslow.passage.overlay.excursions import (
    Excursion,
    excursions_of,
    oscillation_of,
    phase_of,
)
from fastslow.passage.overlay.following import Measured, Stay, measured, products, rows_of, stays_of
from fastslow.passage.overlay.frozen_cycles import FrozenEnd
from fastslow.passage.overlay.predictions import with_laws
from fastslow.passage.overlay.slow_quantities import SlowQuantity, slow_quantity
from fastslow.passage.overlay.spikes import refined, turns_of
from fastslow.passage.overlay.sticking import along_edges, bands_at, with_sticking
from fastslow.passage.overlay.transitions import Passage, leaving, passages_within, steep_parts
from fastslow.results.angles import apart as apart_of
from fastslow.results.base.outcome import Outcome
from fastslow.results.branch.diagram import Diagram
from fastslow.results.overlay.overlay import MEASURED, Overlay
from fastslow.results.overlay.transitions import Phase, Transition
from fastslow.results.trajectory.state_at import StatePoint
from fastslow.results.trajectory.trajectory import Trajectory

Array = NDArray[np.float64]

#: A quantity that varies by less than this part of its size is held.
HELD = 1e-9

#: A turn of the slow quantity by less than this part of its range is none.
WIGGLE = 0.02

#: A sheet stands still that changes by less than this part of the extent over the slow range.
FLAT = 1e-9

#: A lag accounts for a deviation, and a constant drift for the change in that time, of which
#: no more than this part is left.
REST = 0.5

#: A drift leaves a state behind by its relaxation time; by so many it has not settled yet.
LONG = 2.0

#: The slow quantity stands still where it drifts slower than this part of its mean speed.
STILL = 1e-3


@validated(diagram=instance(Diagram), run=instance(Trajectory), radius=finite, observed=formula)
def overlay(
    diagram: Diagram, run: Trajectory, *, radius: float = 0.1, observed: object = None
) -> Overlay:
    """Lay a trajectory over the equilibrium diagram of its frozen model.

    A stable sheet is followed from where the motion comes near it and stays for
    half its relaxation time or more, to where it is no longer near, or has done two
    thirds of the way to another stable sheet. Near means near the sheet as a curve
    over the slow quantity, as the eye sees it in the figure, so that to lag behind a
    steep sheet is not to leave it. Sheets that join at a boundary
    equilibrium count as one here, so that a persistent equilibrium is followed
    across; past a Hopf point the branch is still followed while the state stays
    near it (the delay), past a fold the fold. What happens between two such stays
    is a jump, or with two oscillations or more an oscillating phase.

    Parameters
    ----------
    diagram : Diagram
        Over the slow quantity of the run, or over the parameter of a path along
        which the model was frozen.
    run : Trajectory
        Of the full model.
    radius : float
        What counts as near, with each state in units of its extent.
    observed : str or Symbol, optional
        The state whose maxima are counted, by default the first that is not
        periodic; of a periodic one those of its sine.

    Returns
    -------
    Overlay

    Raises
    ------
    UnknownNameError
        If the diagram's parameter is no slow quantity of the run, or a state is missing.
    ArgumentError
        If the two are of different models, their other parameters differ, the run
        leaves the path along which the model was frozen, the run has no samples, or
        the radius is not between 0 and 1.

    Examples
    --------
    >>> import fastslow as fs
    >>> model = fs.systems.cusp(omega=0.002)
    >>> diagram = fs.continue_equilibria(model.frozen(), "p", over=(-1.2, 1.2))
    >>> lay = fs.overlay(diagram, fs.simulate(model, [-1.0], periods=2))
    >>> [(t.kind, t.from_sheet, t.to_sheet) for t in lay.transitions[:2]]
    [('jump', 'S1.1', 'S1.2'), ('jump', 'S1.2', 'S1.1')]
    >>> print(lay.bursting)
    relaxation oscillation (symmetric fold/fold)
    """
    state_number = _checked(diagram, run, radius, observed)
    compared = require_one_model(diagram, run)
    slow = slow_quantity(diagram, run)
    sheets, courses = courses_of(diagram)
    m = measured(slow, courses, diagram.over, radius)
    stays = stays_of(m)
    p = Passage(diagram, slow, m, sheets, _followed(m, stays), _drift(m))
    swing = oscillation_of(m, state_number)
    phases: list[Phase] = []
    transitions: list[Transition] = []
    bursts: list[Burst] = []
    ends: dict[tuple[str, str], FrozenEnd | None] = {}
    excursions = {id(e.old): e for e in excursions_of(m, stays, swing)}
    if id(None) in excursions:
        phases.append(_between(p, excursions[id(None)], transitions, bursts, ends))
    followed = p.followed.copy()
    for stay in stays:
        transitions += sorted(
            [*passages_within(p, stay), *steep_parts(p, stay)], key=lambda t: t.time
        )
        start = phases[-1].end if phases else float(m.time[0])
        after = excursions.get(id(stay))
        before = len(transitions)
        nxt = None if after is None else _between(p, after, transitions, bursts, ends)
        numbers, rows = np.unique(p.followed[stay.start : stay.stop], return_index=True)
        labels = [sheets[k].label for k in numbers[np.argsort(rows)]]
        end = float(m.time[-1]) if nxt is None else nxt.start
        phases.append(Phase(start, end, "quasi-static", tuple(dict.fromkeys(labels))))
        if nxt is not None:
            phases.append(nxt)
            _hand_over(p, after, transitions[before:], followed)
    held = _held(diagram, run)
    distance, lag, relaxation = _distances(p, followed, _jumping(p, phases))
    rests = bands_at(diagram, run, m.slow, m.extent)
    band, away = along_edges(diagram, run, m.slow, rests, m.extent, radius)
    band[(rests < 0) & (followed >= 0)] = -1
    followed[rests >= 0], lag[rests >= 0] = -1, np.nan
    distance = np.where(band >= 0, away, distance)
    return Overlay(
        diagram,
        run,
        m.time,
        m.slow,
        np.column_stack([run[name] for name in diagram.states]),
        m.extent,
        radius,
        sheets,
        followed,
        distance,
        lag,
        relaxation,
        with_sticking([q for q in phases if q.end > q.start], diagram, run, rests, band),
        tuple(with_laws(p, transitions) if held is None else map(_elsewhere, transitions)),
        bursting_of(bursts, transitions),
        _turning(p),
        _outcome(diagram, run, slow, compared),
        band,
    )


def _checked(diagram: Diagram, run: Trajectory, radius: float, observed: object) -> int:
    """Refuse what does not fit together; the number of the observed state."""
    for name in diagram.states:
        if name not in run.states:
            raise unknown_name("state of the trajectory", name, run.states)
    for name, value in diagram.parameters.items():
        if name in run.parameters and run.parameters[name] != value:
            raise ArgumentError(
                f"the diagram has {name} = {value:g}, the trajectory {run.parameters[name]:g}; "
                "expected the same parameters"
            )
    if not 0.0 < radius < 1.0:
        raise ArgumentError(f"radius = {radius:g}; expected a number between 0 and 1")
    if not len(run.t):
        raise ArgumentError("the trajectory has no samples; simulate with dense=True or samples=")
    plain = [n for n in diagram.states if n not in run.periods]
    name = [*plain, *diagram.states][0] if observed is None else str(observed)
    if name not in diagram.states:
        raise unknown_name("state", name, diagram.states)
    return diagram.states.index(name)


def _drift(m: Measured) -> Array:
    """Rate of the slow quantity, zero where it moves by rounding only."""
    # where a state grows without bound, samples may share their time
    apart = np.r_[True, np.diff(m.time) > 0]
    time, slow = m.time[apart], m.slow[apart]
    if len(time) < 2 or np.ptp(slow) <= 1e-9 * float(np.abs(slow).max()):
        return np.zeros(len(m.time))
    return np.interp(m.time, time, np.gradient(slow, time))


def _followed(m: Measured, stays: list[Stay]) -> NDArray[np.intp]:
    """The sheet at every sample of a stay, past its end still that sheet; −1 elsewhere."""
    followed = np.full(len(m.time), -1, dtype=np.intp)
    for stay in stays:
        rows = slice(stay.start, stay.stop)
        course, inside = m.courses[stay.course], m.present[rows, stay.course]
        last = np.maximum.accumulate(np.where(inside, np.arange(len(inside)), 0))
        followed[rows] = course.sheet(m.slow[rows])[last]
    return followed


def _between(
    p: Passage,
    e: Excursion,
    transitions: list[Transition],
    bursts: list[Burst],
    ends: dict[tuple[str, str], FrozenEnd | None],
) -> Phase:
    """The phase of an excursion; its transitions and bursts are added to the lists."""
    time = p.m.time
    sheet = "" if e.new is None else p.sheets[p.followed[e.new.start]].label
    start, _ = e.rows(p.m)
    outside = start < len(time) and not p.m.within[start]
    begin, end = float(time[0]), float(time[-1])
    first = None
    if e.old is not None and (outside or start >= len(time)):
        begin = float(time[min(start, len(time) - 1)])
    elif e.old is not None:
        first = leaving(p, e)
        transitions.append(first)
        begin = first.leave.time
    if e.new is not None:
        end = p.landed(e.new, begin).time
    away = "jump"
    if first is not None and first.kind == "gap crossing":
        away = "gap crossing"
    elif first is not None and first.from_sheet == first.to_sheet:
        away = "excursion"
    phase = phase_of(p.m, e, begin, end, sheet, away)
    closing = None
    if e.cycle and e.new is not None and not outside:
        closing = cycle_end(p, e, ends)
        transitions.append(ending(p, e, closing))
    complete = first is not None and e.new is not None and phase.kind == "oscillating"
    if complete and slowly(p, e):
        assert first is not None
        bursts.append(Burst(phase, first, closing))
    return phase


def _hand_over(
    p: Passage, e: Excursion | None, found: list[Transition], followed: NDArray[np.intp]
) -> None:
    """In a jump the old sheet is followed up to the transition, then the new one."""
    if e is None or e.old is None or e.new is None or e.cycle or not found:
        return
    start, stop = e.rows(p.m)
    rows = np.arange(start, stop)
    old = p.m.time[rows] < found[-1].time
    followed[rows] = np.where(old, p.followed[start - 1], p.followed[e.new.start])


def _elsewhere(t: Transition) -> Transition:
    """A transition without its delay, where another slow quantity has moved the special point."""
    return replace(t, delay=float("nan"))


def _jumping(p: Passage, phases: list[Phase]) -> NDArray[np.bool_]:
    """Which samples are on the way from one sheet to another, shape (N,)."""
    away = np.zeros(len(p.m.time), dtype=bool)
    for phase in phases:
        if phase.kind != "quasi-static":
            away |= (p.m.time > phase.start) & (p.m.time < phase.end)
    return away


def _distances(
    p: Passage, followed: NDArray[np.intp], away: NDArray[np.bool_]
) -> tuple[Array, Array, Array]:
    """Distance from the followed (else the nearest stable) sheet, lag, and relaxation time.

    The lag solves X(w(t − lag)) ≈ x(t) to first order. There is none in a jump, where the sheet
    at the earlier time is not much nearer (the state oscillates about it, the slow quantity
    turns), or where the drift cannot have caused it: after a jump, before the state has relaxed.
    """
    m = p.m
    apart = np.array([m.apart(k) for k in range(len(m.courses))]).reshape(-1, len(m.time))
    nearest = np.where(m.present.T, apart, np.inf)
    distance = nearest.min(axis=0, initial=np.inf)
    lag, relaxation = np.full((2, len(m.time)), np.nan)
    mean = float(np.abs(np.diff(m.slow)).sum()) / (float(m.time[-1] - m.time[0]) or 1.0)
    for number, course in enumerate(m.courses):
        on = np.flatnonzero(np.isin(np.arange(-1, len(p.sheets)), course.sheets)[followed + 1])
        distance[on] = apart[number, on]
        slow = m.slow[on]
        # a velocity is that of the drifting sheet itself, at whatever lag
        moves = np.where(m.velocities, 0.0, 1.0)
        slope = moves * course.slope(slow) / m.extent
        deviation = moves * rows_of(m.deviation(number), on)
        steep = products(slope, slope)
        rate = -course.relaxation(slow)
        with np.errstate(divide="ignore", invalid="ignore"):
            ahead = products(deviation, slope) / steep
            behind = -ahead / p.drift[on]
            relaxation[on] = np.where(rate > 0, 1.0 / rate, np.nan)
        exists = (np.abs(p.drift[on]) > STILL * mean) & (np.sqrt(steep) * m.span > FLAT)
        exists &= (np.abs(behind) * rate < LONG) & ~away[on]
        earlier = m.time[on] - np.where(exists, behind, 0.0)
        step = p.drift[on] * np.where(exists, behind, 0.0)
        inside = (earlier >= m.time[0]) & (earlier <= m.time[-1])
        before = np.where(inside, np.interp(earlier, m.time, m.slow), slow - step)
        exists &= np.abs(before - slow + step) <= REST * np.abs(step)
        rest = moves * apart_of(rows_of(m.scaled, on), course.state(before) / m.extent, m.periods)
        left, whole = (np.sqrt(products(v, v)) for v in (rest, deviation))
        exists &= left <= REST * whole
        lag[on] = np.where(exists, behind, np.nan)
    return distance, lag, relaxation


def _turning(p: Passage) -> tuple[StatePoint, ...]:
    slow, time = p.m.slow, p.m.time
    reach = float(np.ptp(slow))
    if len(slow) < 3 or reach <= 1e-9 * float(np.abs(slow).max()):
        return ()
    turns = turns_of(slow, WIGGLE * reach)
    return tuple(p.moment(float(t)) for t in refined(time, slow, turns.rows))


def _held(diagram: Diagram, run: Trajectory) -> str | None:
    """A slow quantity of the run that the diagram holds at one value."""
    for name, value in diagram.parameters.items():
        if name in run.columns and np.abs(run[name] - value).max() > HELD * np.abs(run[name]).max():
            return name
    return None


def _outcome(diagram: Diagram, run: Trajectory, slow: SlowQuantity, compared: bool) -> Outcome:
    """What the diagram does not cover of a run, and what else the overlay cannot tell."""
    name, (low, high) = diagram.parameter, diagram.over
    values = slow.table
    held = _held(diagram, run)
    if held is not None:
        return Outcome(
            "another slow quantity",
            f"the diagram holds {held} = {diagram.parameters[held]:.6g}, in the run it goes from "
            f"{run[held].min():.6g} to {run[held].max():.6g}: its special points are not where the "
            "run meets them, and no delays are given.",
            False,
        )
    outside = (values < low) | (values > high)
    if outside.any():
        weight = np.diff(run.t)
        total = float(weight.sum()) or 1.0
        share = float(weight[outside[:-1]].sum()) / total
        return Outcome(
            "outside the diagram",
            f"{name} runs from {values.min():.6g} to {values.max():.6g}, the diagram from "
            f"{low:.6g} to {high:.6g}: what lies outside, {share:.1%} of the time, is not "
            "measured; continue it over the whole range.",
            False,
        )
    if not run.outcome:
        return Outcome(
            "cut short", f"the run ended early, what follows is not known: {run.outcome}", False
        )
    if not np.ptp(values) > HELD * np.abs(values).max():
        return Outcome(
            "at rest",
            f"{name} stays at {values[0]:.6g} all along: nothing is passed, and there are no lags.",
            False,
        )
    if not compared:
        return Outcome(
            "not compared",
            "that the diagram and the run are of one model could not be checked: their equations "
            "are not both known, or written in different ways.",
            False,
        )
    return MEASURED
