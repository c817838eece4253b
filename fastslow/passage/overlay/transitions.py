"""Transitions of a trajectory between stable branches: departures, landings, causes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.polynomial import Chebyshev
from numpy.typing import NDArray

from fastslow.passage.overlay.attracting_branches import Arc, ends_of, over_a_gap
from fastslow.passage.overlay.excursions import Excursion
from fastslow.passage.overlay.following import WAY, Episode, Measured, way_done
from fastslow.passage.overlay.overlaid_arcs import OverlaidArcs
from fastslow.passage.overlay.spikes import refined
from fastslow.results.orbits.orbit_branch import OrbitBranch
from fastslow.results.overlay.transitions import OSCILLATING, StableBranch, Transition
from fastslow.results.points import SpecialPoint
from fastslow.results.stored.operations import AT_REST
from fastslow.results.stored.switch_state_names import without_state
from fastslow.results.trajectory.events.crossings import Crossing
from fastslow.results.trajectory.queries.state_at import StatePoint

Array = NDArray[np.float64]

#: Largest distance before the end of a branch, relative to the slow range, of a departure due to
#: that end.
BEFORE_END = 0.05

#: Decrease of the distance between samples, relative to the radius, that counts as a return.
RETURN_DECREASE = 1e-3

#: Number of 16-fold refinements of the bracket of an extremum before parabolic interpolation.
CLOSER = 4

#: Change of the slow quantity, relative to its range, that is rounding.
SLOW_ROUNDING = 1e-12

#: Rounding of a number of size one.
EPSILON = float(np.finfo(float).eps)

#: Relative abscissae in an interval, and about the estimated onset of a condition.
EVEN = np.linspace(0.0, 1.0, 17)
NEARBY = np.concatenate([-(10.0 ** -np.arange(1, 13)), [0.0], 10.0 ** -np.arange(1, 13)])
PLACES = np.concatenate([EVEN, NEARBY])


@dataclass(frozen=True, eq=False)
class OverlaidRun(OverlaidArcs):
    """A run over equilibria.

    Parameters
    ----------
    m : Measured
    cycles : tuple of OrbitBranch
        Traced cycles of the frozen model.
    """

    m: Measured
    cycles: tuple[OrbitBranch, ...] = ()

    def within(self, episode: Episode) -> list[Transition]:
        found = [*passages_within(self, episode), *steep_parts(self, episode)]
        return sorted(found, key=lambda t: t.time)

    def departure(self, excursion: Excursion) -> Transition:
        return leaving(self, excursion)

    def away(self, excursion: Excursion, first: Transition) -> str:
        if first.type == "gap crossing":
            return "gap crossing"
        return "excursion" if first.from_branch == first.to_branch else "jump"

    @cached_property
    def crossed(self) -> tuple[Array, NDArray[np.str_], NDArray[np.str_]]:
        """Times of the run's crossings, and the regions before and after them."""
        table, modes = self.slow.run.crossing_table, np.array(self.slow.run.modes, dtype=str)
        return table[:, 0], modes[table[:, 3].astype(int)], modes[table[:, 4].astype(int)]

    @cached_property
    def changes(self) -> tuple[Array, NDArray[np.str_], NDArray[np.str_]]:
        """Times at which the region of the run changes, and the regions before and after."""
        segments = self.slow.run.segments
        names = np.array([segment.region for segment in segments], dtype=str)
        return np.array([segment.start for segment in segments[1:]]), names[:-1], names[1:]

    def lifted(self, left: StableBranch, until: float) -> StatePoint | None:
        """State at the last lift-off from a held stable branch before a time."""
        times, before, _ = self.changes
        found = times[(before == without_state(left.region)) & (times <= until)]
        return self.state_at(float(found[-1])) if len(found) else None

    def first(self, start: float, stop: float, over: Callable[[Array, Array], Array]) -> float:
        """Locate the onset of a condition in an interval, up to rounding.

        Parameters
        ----------
        start, stop : float
            Times; the condition is fulfilled at the second.
        over : callable
            (slow (N,), state (N, n)) -> (N,), nonnegative where it is fulfilled.
        """
        guess = 0.5 * (start + stop)
        while stop - start > 4.0 * EPSILON * max(abs(start), abs(stop)):
            times = (stop - start) * PLACES
            times[: len(EVEN)] += start
            times[len(EVEN) :] += guess
            times = np.minimum(np.maximum(times, start), stop)
            times.sort()
            value = np.asarray(over(*self.slow.at(times)))
            holds = (value >= 0.0) & (times > start) | (times >= stop)
            k = int(np.argmax(holds))
            if not times[k] - times[k - 1] < stop - start:
                break
            start, stop = float(times[k - 1]), float(times[k])
            rows = slice(max(k - 2, 0), k + 2)
            guess = zero_between(times[rows], value[rows], start, stop)
        return stop

    def left(self, episode: Episode, rival: int | None) -> StatePoint:
        """State at the end of an episode."""
        time, arc = self.m.t, self.m.arcs[episode.arc]
        if episode.stop >= len(time):
            return self.state_at(float(time[-1]))
        other = None if rival is None else self.m.arcs[rival]

        def away(slow: Array, state: Array) -> Array:
            scaled = state / self.m.extent
            far = -self.m.nearness(episode.arc, slow, scaled)
            there = None if other is None else other.present(slow)
            if other is not None and there is not None and there.any():
                old, new = (c.state(slow) / self.m.extent for c in (arc, other))
                way = way_done(scaled, old, new, self.m.periods)
                far = np.where(there, np.maximum(far, way - WAY), far)
            return far

        return self.state_at(
            self.first(float(time[episode.stop - 1]), float(time[episode.stop]), away)
        )

    def landed(self, episode: Episode, not_before: float) -> StatePoint:
        time, arc = self.m.t, self.m.arcs[episode.arc]

        def near(slow: Array, state: Array) -> Array:
            beside = self.m.nearness(episode.arc, slow, state / self.m.extent)
            return np.where(arc.present(slow), beside, -1.0)

        since = max(float(time[max(episode.start - 1, 0)]), not_before)
        if since >= time[episode.start]:
            return self.state_at(since)
        if (episode, since) not in self._landings:
            found = self.state_at(self.first(since, float(time[episode.start]), near))
            self._landings[episode, since] = found
        return self._landings[episode, since]

    @cached_property
    def _landings(self) -> dict[tuple[Episode, float], StatePoint]:
        return {}

    def passing(self, point: SpecialPoint, until: float) -> float | None:
        """Time of the last passage of a special point before the sample after a time."""
        value, time = point[self.diagram.parameter], self.m.t
        stop = int(np.searchsorted(time, until, side="right"))
        passed = np.flatnonzero(np.diff(self.m.slow[:stop] > value))
        return self._passed(value, int(passed[-1])) if len(passed) else None

    def reaching(self, point: SpecialPoint, since: float) -> float | None:
        """Time at which a special point is reached after a time; None if the slow one turns."""
        value, slow = point[self.diagram.parameter], self.m.slow
        start = max(int(np.searchsorted(self.m.t, since, side="right")) - 1, 0)
        passed = np.flatnonzero(np.diff(slow[start:] > value))
        if not len(passed):
            return None
        row = start + int(passed[0])
        ways = np.sign(np.diff(slow[start : row + 2]))
        return self._passed(value, row) if np.all(ways == ways[-1]) else None

    def _passed(self, value: float, row: int) -> float:
        """Time after a row at which the slow quantity passes a value."""
        time = self.m.t
        if (value, row) not in self._passings:
            way = 1.0 if self.m.slow[row] <= value else -1.0
            self._passings[value, row] = self.first(
                float(time[row]), float(time[row + 1]), lambda w, _: way * (w - value)
            )
        return self._passings[value, row]

    @cached_property
    def _passings(self) -> dict[tuple[float, int], float]:
        return {}

    def two_thirds(self, old: Episode, new: Episode) -> StatePoint | None:
        """State at which two thirds of the distance between two arcs are covered."""
        # branches close to each other are reached earlier
        rows = slice(old.stop, new.stop)
        over = self.m.present[rows, new.arc] & (self.m.way(old.arc, new.arc)[rows] > WAY)
        if not over.any():
            return None
        row = old.stop + int(np.argmax(over))
        one, other = self.m.arcs[old.arc], self.m.arcs[new.arc]

        def done(slow: Array, state: Array) -> Array:
            unit = self.m.extent
            places = one.state(slow) / unit, other.state(slow) / unit
            way = way_done(state / unit, *places, self.m.periods)
            return np.where(other.present(slow), way - WAY, -1.0)

        return self.state_at(self.first(float(self.m.t[row - 1]), float(self.m.t[row]), done))

    def outward(self, stable_branch: StableBranch, point: SpecialPoint) -> float:
        """+1 for a special point at the upper end of a stable branch, −1 at the lower."""
        branch = self.diagram.branches[stable_branch.branch]
        ends = branch.values[[stable_branch.start, stable_branch.stop - 1]]
        return 1.0 if point[self.diagram.parameter] >= ends.mean() else -1.0

    def passed(self, stable_branch: StableBranch, rows: slice) -> SpecialPoint | None:
        """End of a stable branch that the slow quantity passes first in some samples."""
        found: list[tuple[int, SpecialPoint]] = []
        for point in ends_of(self.diagram, stable_branch):
            past = self.m.slow[rows] - point[self.diagram.parameter]
            beyond = self.outward(stable_branch, point) * past
            if (beyond > 0).any():
                found.append((int(np.argmax(beyond > 0)), point))
        return min(found, key=lambda f: f[0])[1] if found else None

    def extreme_past(
        self, stable_branch: StableBranch, point: SpecialPoint, until: float
    ) -> StatePoint | None:
        """Extremum of the slow quantity past the end of a stable branch, if before a time."""
        where, outward = point[self.diagram.parameter], self.outward(stable_branch, point)
        stop = int(np.searchsorted(self.m.t, until, side="right"))
        past = outward * (self.m.slow[:stop] - where)
        within = np.flatnonzero(past <= 0.0)
        # after the last passage of the end, or after one that is reversed before landing
        rows = np.arange(within[-1] + 1 if len(within) else 0, stop)
        if not len(rows) and len(within):
            gone = np.flatnonzero(past > 0.0)
            if not len(gone):
                return None
            start = within[within < gone[-1]]
            rows = np.arange(start[-1] + 1 if len(start) else 0, gone[-1] + 1)
        if not len(rows):
            return None
        row = int(rows[np.argmax(past[rows])])
        if row in (0, stop - 1):
            return None
        time = self._turn(row, outward)
        return self.state_at(time) if time < until else None

    def _turn(self, row: int, outward: float) -> float:
        """Time of the extremum of the slow quantity near the extreme sample."""
        times = self.m.t[[row - 1, row, row + 1]]
        value = self.slow.at(times)[0]
        for _ in range(CLOSER if self.slow.dense else 0):
            times = np.linspace(times[0], times[-1], 33)
            value = self.slow.at(times)[0]
            best = int(np.clip(np.argmax(outward * value), 1, len(times) - 2))
            times, value = times[best - 1 : best + 2], value[best - 1 : best + 2]
        return float(refined(times, value, np.array([1]))[0])

    def delay(self, stable_branch: StableBranch, point: SpecialPoint | None, value: float) -> float:
        if point is None:
            return float("nan")
        delay = self.outward(stable_branch, point) * (value - point[self.diagram.parameter])
        return delay if abs(delay) > 1e-13 * self.m.span else 0.0

    def slope(self, point: SpecialPoint | None, until: float) -> float:
        """|dw/dt| at the last passage of a special point before a time, else at that time."""
        time = self.m.t
        passed = None if point is None else self.passing(point, until)
        until = until if passed is None else passed
        step = 5e-4 * float(time[-1] - time[0])
        if not step:
            return 0.0
        start, stop = max(until - step, float(time[0])), min(until + step, float(time[-1]))
        if not self.slow.dense:
            first, second = self.slow.at(np.array([start, stop]))[0]
            return float(abs(second - first) / (stop - start))
        law = Chebyshev.interpolate(lambda t: self.slow.at(t)[0], 6, domain=[start, stop])
        return abs(float(law.deriv()(until)))


def zero_between(times: Array, values: Array, start: float, stop: float) -> float:
    """Zero of values at up to four times, between two of these, by inverse interpolation.

    The midpoint if the values do not increase.

    Examples
    --------
    >>> t = np.array([1.0, 1.1, 1.2, 1.3])
    >>> round(zero_between(t, (t + 1) ** 3 - 10, 1.1, 1.2), 4)
    1.1545
    """
    for used in (slice(None), (times >= start) & (times <= stop)):
        t, v = times[used].tolist(), values[used].tolist()
        if not all(b > a for a, b in pairwise(v)):
            continue
        # Neville's scheme for the time as a function of the value
        for level in range(1, len(t)):
            for k in range(len(t) - level):
                a, b = v[k], v[k + level]
                t[k] = (b * t[k] - a * t[k + 1]) / (b - a)
        if start < t[0] < stop:
            return float(t[0])
    return 0.5 * (start + stop)


def passages_within(p: OverlaidRun, episode: Episode) -> list[Transition]:
    """Transitions along one arc: boundary equilibria passed, unstable intervals."""
    found = []
    rows = np.arange(episode.start, episode.stop)
    for row in rows[1:][np.diff(p.followed[rows]) != 0]:
        left, entered = p.stable_branches[p.followed[row - 1]], p.stable_branches[p.followed[row]]
        arc = p.m.arcs[episode.arc]
        last = episode.start + int(
            np.flatnonzero(p.m.present[episode.start : row, episode.arc])[-1]
        )
        # a sample at the end itself is not past it
        special = p.passed(left, slice(last, row + 1)) or p.passed(left, slice(last, row + 2))
        low, high = arc.ranges[arc.stable_branches.index(int(p.followed[row]))]

        def entering(slow: Array, state: Array, low: float = low, high: float = high) -> Array:
            return np.minimum(slow - low, high - slow)

        here = p.state_at(p.first(float(p.m.t[row - 1]), float(p.m.t[row]), entering))
        kind, note = "crossing", ""
        if special is not None and special.kind.two_rows:
            crossing = _crossing(p, special, left, entered, here.time)
            here = p.state_at(crossing) if crossing is not None else here
        elif special is not None and special.kind.starts_cycles:
            kind, note = (
                special.kind.transition,
                "follows the branch along its entire unstable part",
            )
        found.append(
            Transition(
                time=here.time,
                value=here.value,
                state=here.state,
                from_branch=left.label,
                to_branch=entered.label,
                special=special,
                delay=p.delay(left, special, here.value),
                type=kind,
                leave=here,
                land=here,
                slope=p.slope(special, float(p.m.t[row])),
                note=note,
            )
        )
    return found


def steep_parts(p: OverlaidRun, episode: Episode) -> list[Transition]:
    """Detect intervals with a large lag along a steep part of a stable branch.

    Such an interval begins and ends where the distance at the same value of the slow quantity
    passes the radius; one that lasts to the end of the episode belongs to the departure.
    """
    arc = p.m.arcs[episode.arc]
    rows = slice(episode.start, episode.stop)
    behind = (p.m.apart(episode.arc)[rows] >= p.m.radius) & p.m.present[rows, episode.arc]
    edges = np.flatnonzero(np.diff(behind.astype(int)))
    if behind[0]:
        edges = edges[1:]
    found = []
    for start, stop in zip(edges[::2], edges[1::2], strict=False):
        inside = slice(episode.start + int(start), episode.start + int(stop) + 2)
        if p.m.jumps[inside.start : inside.start + 2].any():
            # the run relaxes after a jump of the slow quantity
            continue
        steepness = _steepness(p, arc, episode, inside)
        stable_branches = p.followed[inside]
        time = p.m.t[inside]
        worst = inside.start + int(np.argmax(p.m.apart(episode.arc)[inside]))
        lags = steepness >= 0.5 * p.m.radius and _behind(p, episode.arc, worst)
        if not lags or np.ptp(stable_branches):
            continue
        here = p.state_at(float(p.m.t[worst]))
        label = p.stable_branches[stable_branches[0]].label
        found.append(
            Transition(
                time=here.time,
                value=here.value,
                state=here.state,
                from_branch=label,
                to_branch=label,
                special=None,
                delay=float("nan"),
                type="steep",
                leave=p.state_at(float(time[0])),
                land=p.state_at(float(time[-1])),
                slope=p.slope(None, here.time),
                steepness=steepness,
            )
        )
    return found


def _behind(p: OverlaidRun, number: int, row: int) -> bool:
    """Whether the deviation of a sample is opposite to the drift of the arc."""
    slope = p.m.slope(number, np.array([row]))[0]
    back = -slope * p.m.drift[row]
    deviation = p.m.deviation(number, row)
    sizes = np.linalg.norm(back) * np.linalg.norm(deviation)
    return bool(back @ deviation > 0.7 * sizes)


def _crossing(
    p: OverlaidRun, point: SpecialPoint, left: StableBranch, entered: StableBranch, time: float
) -> float | None:
    """Crossing time of the interface of a boundary equilibrium nearest to a given time.

    At a wall, the time at which the state comes to rest on it or lifts off.
    """
    run = p.slow.run
    times, outside, inside = p.changes if point.at_wall else p.crossed
    matching = outside == without_state(left.region)
    matching &= inside == without_state(entered.region)
    if not point.at_wall:
        through = run.crossing_table[:, 1].astype(int)
        matching &= np.array(run.interfaces, dtype=str)[through] == point.interface
    if not matching.any():
        return None
    nearest = float(times[matching][np.argmin(np.abs(times[matching] - time))])
    if not p.m.t[0] <= nearest <= p.m.t[-1]:
        return None
    # a crossing of this passage precedes the reversal of the slow quantity
    slow = p.m.slow[slice(*np.searchsorted(p.m.t, sorted((time, nearest))))]
    change = np.diff(slow)
    # both states at a jump share their time, to rounding
    change = change[np.abs(change) > SLOW_ROUNDING * p.m.span]
    turned = len(slow) > 2 and len(np.unique(np.sign(change))) > 1
    return None if turned else nearest


def leaving(p: OverlaidRun, excursion: Excursion) -> Transition:
    """Transition that begins with the departure from a stable branch."""
    old, new = excursion.old, excursion.new
    assert old is not None
    arc = p.m.arcs[old.arc]
    rows = slice(old.start, old.stop)
    last = old.start + int(np.flatnonzero(p.m.present[rows, old.arc])[-1])
    left = p.stable_branches[p.followed[old.stop - 1]]
    leave = p.left(old, None if new is None else new.arc)
    stop = len(p.m.t) if new is None else new.start + 1
    special = p.passed(left, slice(last, stop)) or _passed_before(p, left, old)
    land = None if new is None else p.landed(new, leave.time)
    entered = None if new is None else p.stable_branches[p.followed[new.start]]
    if special is not None and special.at_wall and AT_REST in left.region:
        leave = p.lifted(left, leave.time) or leave
    here = leave
    if new is not None and not excursion.cycle and new.arc != old.arc:
        here = p.two_thirds(old, new) or leave
        if land is not None and land.time < here.time:
            land = here
    to_branch = OSCILLATING if excursion.cycle else "" if entered is None else entered.label
    passed = special is not None
    if special is None and to_branch != left.label:
        special = _just_before(p, left, leave.value)
    steepness = _steepness(p, arc, old, slice(max(old.stop - 2, 0), stop))
    kind, note = _kind(p, excursion, left, entered, special, steepness)
    if kind == "gap crossing":
        leave, land = _across(p, left, entered, here.time) or (leave, land)
    extreme = None
    if kind == "jump" and special is not None and passed:
        extreme = p.extreme_past(left, special, here.time if land is None else land.time)
        # a forcing that reversed before the jump did not do so because of it
        if extreme is not None and not p.slow.responds and extreme.time < leave.time:
            extreme = None
        here = extreme or here
    notes = [note]
    if special is None and p.m.jumps[max(old.stop - 2, 0) : old.stop + 1].any():
        notes.append(f"{p.slow.name} jumps there")
    if excursion.turns and not excursion.cycle:
        count = len(excursion.turns)
        notes.append(f"{count} oscillation{'s' if count > 1 else ''} on landing")
    delay = p.delay(left, special, here.value)
    if special is not None and delay < 0.0:
        candidate = "" if passed else ", which is not passed (candidate)"
        notes.insert(0, f"departure {-delay:.3g} before {special.label}{candidate}")
        delay = float("nan")
    note = "; ".join(filter(None, notes))
    return Transition(
        time=here.time,
        value=here.value,
        state=here.state,
        from_branch=left.label,
        to_branch=to_branch,
        special=special,
        delay=delay,
        type=kind,
        leave=leave,
        land=None if excursion.cycle else land,
        slope=p.slope(special, here.time),
        steepness=steepness,
        note=note,
        turned=extreme is not None,
    )


def _passed_before(p: OverlaidRun, left: StableBranch, episode: Episode) -> SpecialPoint | None:
    """End of a stable branch that was passed in an episode, without a later approach.

    The slow quantity has reversed and is back in the range of the branch at the departure.
    """
    rows = np.arange(episode.start, episode.stop)
    past = np.zeros(len(rows), dtype=bool)
    for point in ends_of(p.diagram, left):
        beyond = p.outward(left, point) * (p.m.slow[rows] - point[p.diagram.parameter])
        past |= beyond > 0.0
    if not past.any():
        return None
    since = episode.start + int(np.flatnonzero(past)[-1])
    away = np.diff(p.m.apart(episode.arc)[since : episode.stop])
    if (away < -RETURN_DECREASE * p.m.radius).any():
        return None
    return p.passed(left, slice(since, since + 1))


def _just_before(p: OverlaidRun, left: StableBranch, value: float) -> SpecialPoint | None:
    """End of a stable branch shortly after a departure."""
    reach = BEFORE_END * float(np.ptp(p.m.slow))
    near = [
        point
        for point in ends_of(p.diagram, left)
        if abs(point[p.diagram.parameter] - value) <= reach
    ]
    return min(near, key=lambda e: abs(e[p.diagram.parameter] - value), default=None)


def _steepness(p: OverlaidRun, arc: Arc, episode: Episode, rows: slice) -> float:
    """Largest predicted lag behind the stable part of an arc, in units of the extent."""
    slow = p.m.slow[rows]
    # the lag solves J y = dX/dw dw/dt; at a Hopf point Re λ vanishes, λ does not
    rate = arc.stiffness(slow)
    usable = p.m.present[rows, episode.arc] & (rate > 0)
    if not usable.any():
        return float("nan")
    slope = np.linalg.norm(arc.slope(slow[usable]) / p.m.extent, axis=1)
    lag = slope * np.abs(p.m.drift[rows][usable]) / rate[usable]
    lag = lag[np.isfinite(lag)]
    return float(lag.max()) if len(lag) else float("nan")


def _kind(
    p: OverlaidRun,
    excursion: Excursion,
    left: StableBranch,
    entered: StableBranch | None,
    special: SpecialPoint | None,
    steepness: float,
) -> tuple[str, str]:
    """Kind of a departure, and a note."""
    back = entered is not None and entered.label == left.label and not excursion.cycle
    if special is not None:
        if special.turns:
            return "jump", ""
        if special.at_switch:
            return "switch", f"at the threshold {special.interface}"
        if special.kind.transition:
            return special.kind.transition, ""
        if special.kind.two_rows and back:
            return "excursion", "past the end of the branch and back"
        if special.kind.two_rows and entered is not None:
            if over_a_gap(p.diagram, left, entered):
                return "gap crossing", ""
            if entered.region in special.regions:
                return "crossing", ""
        return "unclassified", ""
    touch = _touch(p, excursion)
    if touch is not None:
        return "grazing", f"tangency with {touch.interface} at t = {touch.time:.6g}"
    if back:
        return ("steep" if steepness >= 0.5 * p.m.radius else "excursion"), ""
    if _rate_induced(p, excursion):
        return "rate-induced", _still_stable(p, excursion)
    return "loss of tracking", ""


def _rate_induced(p: OverlaidRun, excursion: Excursion) -> bool:
    """Whether the departure is rate-induced tipping.

    The branch remains stable throughout, the state lags behind it, and reaches another
    stable branch or grows without bound.
    """
    old, (_, stop) = excursion.old, excursion.rows(p.m)
    assert old is not None
    if excursion.cycle or (excursion.new is None and p.slow.run.outcome):
        return False
    rows = slice(old.stop - 1, min(stop + 1, len(p.m.t)))
    return bool(p.m.present[rows, old.arc].all()) and _behind(p, old.arc, old.stop - 1)


def _still_stable(p: OverlaidRun, excursion: Excursion) -> str:
    start, stop = excursion.rows(p.m)
    rows = slice(max(start - 1, 0), min(stop + 1, len(p.m.t)))
    low, high = float(p.m.slow[rows].min()), float(p.m.slow[rows].max())
    return (
        f"the equilibrium remains stable from {p.diagram.parameter} = {low:.6g} to {high:.6g}, "
        "and the state lags behind it"
    )


def _touch(p: OverlaidRun, excursion: Excursion) -> Crossing | None:
    """First tangency with an interface, from one fast oscillation before a departure on."""
    start, stop = excursion.rows(p.m)
    since = p.m.t[max(start - (stop - start), 0)]
    until = p.m.t[min(stop, len(p.m.t) - 1)]
    times, tangential = p.crossed[0], p.slow.run.crossing_table[:, 5] != 0.0
    found = np.flatnonzero((since <= times) & (times <= until) & tangential)
    return p.slow.run.crossings[int(found[0])] if len(found) else None


def _across(
    p: OverlaidRun, left: StableBranch, entered: StableBranch | None, time: float
) -> tuple[StatePoint, StatePoint] | None:
    """States at which a trajectory leaves one side of a gap and reaches the other.

    Between walls, those at which it lifts off one and comes to rest on the other.
    """
    if entered is None:
        return None
    times, outside, inside = p.changes if AT_REST in left.region else p.crossed
    out = times[(outside == without_state(left.region)) & (times <= time)]
    if not len(out):
        return None
    reach = times[(inside == without_state(entered.region)) & (times > out[-1])]
    return (p.state_at(float(out[-1])), p.state_at(float(reach[0]))) if len(reach) else None
