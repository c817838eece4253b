"""Segments of a periodic orbit: smooth motions, and the conditions at which they end."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fastslow.orbits.flow.equations import CLOSING, NODE
from fastslow.orbits.flow.events import OrbitError, events_of
from fastslow.orbits.flow.flows import flow
from fastslow.orbits.flow.variations import Variations
from fastslow.results.angles import periods_of
from fastslow.results.base.outcome import Outcome
from fastslow.results.trajectory.trajectory import Trajectory

Array = NDArray[np.float64]
Integers = NDArray[np.int64]

#: Growth of a perturbation along a segment from which nodes divide it: as much as rounding is
#: amplified.
SEGMENT_GROWTH = 1e3

#: The same for a guess, along which the flow is far from linear.
GROWTH_OF_GUESS = 10.0

#: Largest number of segments of an orbit.
MOST_SEGMENTS = 2_000

#: Length of a segment, as a fraction of the longest one, below which an orbit does not start in it.
SHORT_SEGMENT = 0.1

#: Fraction of the period within which the start of an orbit keeps away from events.
EVENT_MARGIN = 1e-2


@dataclass(frozen=True, eq=False)
class Segments:
    """A closed curve in K segments: start states, modes, durations and conditions at the ends.

    Parameters
    ----------
    start : float
        Time of the first state.
    modes : ndarray of int64, shape (K,)
        The smooth motion of every segment.
    ends : ndarray of int64, shape (K,)
        The function that vanishes at the end of every segment, an index of the interfaces and
        then of the bounds of sliding of its mode; or `NODE`, or `CLOSING` for the last one.
    states : ndarray, shape (K, n)
        The first state of every segment.
    durations : ndarray, shape (K,)
    jumps : ndarray of int64, shape (K,), optional
        The jump of the state at the end of every segment, see `Jumps.number`; by default none.
    constants : ndarray, shape (K, m), optional
        Values of clocks and tables along every segment.
    """

    start: float
    modes: NDArray[np.int64]
    ends: NDArray[np.int64]
    states: Array
    durations: Array
    jumps: NDArray[np.int64] = None  # type: ignore[assignment]
    constants: Array = None  # type: ignore[assignment]

    def __post_init__(self) -> None:
        K = len(self.modes)
        if self.jumps is None:
            object.__setattr__(self, "jumps", np.full(K, -1))
        if self.constants is None:
            object.__setattr__(self, "constants", np.zeros((K, 0)))

    def __len__(self) -> int:
        return len(self.modes)

    @property
    def times(self) -> Array:
        """Start times of the segments, and the time of closing, shape (K + 1,)."""
        times = np.empty(len(self.durations) + 1)
        times[0] = 0.0
        self.durations.cumsum(out=times[1:])
        return times + self.start

    @property
    def period(self) -> float:
        return float(self.durations.sum())

    @property
    def events(self) -> tuple[tuple[int, int], ...]:
        """Mode and function of every event, in order."""
        there = self.ends >= 0
        return tuple(zip(self.modes[there].tolist(), self.ends[there].tolist(), strict=True))

    @property
    def event_times(self) -> Array:
        return self.times[1:][self.ends >= 0]

    def without_nodes(self) -> Segments:
        """The same curve without nodes."""
        if not (self.ends == NODE).any():
            return self
        return without_some_nodes(self, np.flatnonzero(np.r_[True, self.ends[:-1] != NODE]))

    def with_constants(self, variations: Variations, parameters: Array) -> Segments:
        """The same curve with the values of clocks and tables at the middle of every segment."""
        middle = self.times[:-1] + 0.5 * self.durations
        switches = self.constants[:, len(variations.instants.symbols) :]
        return replace(self, constants=variations.constants_at(middle, parameters, switches))


def segments_of(
    run: Trajectory,
    since: float,
    period: float,
    winding: Array,
    variations: Variations,
    parameters: Array,
) -> Segments:
    """Return the segments of a run over one period, cyclically closed.

    The start is in the middle of the longest segment, preferably outside sliding. ``winding`` is
    what the periodic states gain in one period.

    Raises
    ------
    OrbitError
        If the first and the last mode differ, or several resets or interfaces coincide.
    """
    until = since + period
    events = events_of(run, since, until, variations, parameters)
    when, count = events.times, len(events)
    if count > MOST_SEGMENTS:
        raise OrbitError(
            Outcome(
                "too many segments",
                f"{count} events within one period, more than {MOST_SEGMENTS}: chattering, or a "
                "period that is too long.",
                False,
            )
        )
    if not count:
        row = max(int(np.searchsorted(run.step_starts, since, side="right")) - 1, 0)
        middle = np.array([since + 0.5 * period])
        switches = variations.switches_at(run, middle)
        known = variations.constants_at(middle, parameters, switches)
        return _single(since, int(run.steps[row, 2]), run(since), period, known)
    if events.after[-1] != events.before[0]:
        names = run.modes[events.before[0]], run.modes[events.after[-1]]
        raise OrbitError(
            Outcome(
                "itinerary not closed",
                f"the run begins in {names[0]} and is in {names[1]} one period later: not yet "
                "periodic, or begun at an interface.",
                False,
            )
        )
    lengths = np.diff(when, append=when[0] + period)
    slides = (variations.signs[events.after] == 0).any(axis=1)
    longest = _longest(lengths, slides)
    middle = when[longest] + 0.5 * lengths[longest]
    start = middle if middle <= until else middle - period
    order = np.arange(longest + 1, longest + 1 + count)
    beyond = (order >= count) & (start == middle)
    order %= count
    # from the start to the first event, between events, and from the last event to the start
    durations = np.r_[0.5 * lengths[longest], lengths[order][:-1], 0.5 * lengths[longest]]
    found = Segments(
        start,
        np.r_[events.after[longest], events.after[order]],
        np.r_[events.ends[order], CLOSING],
        np.vstack([run(start), events.states[order] + beyond[:, None] * winding]),
        durations,
        np.r_[events.jumps[order], -1],
        _constants(variations, np.r_[events.switches[[longest]], events.switches[order]]),
    )
    return found.with_constants(variations, parameters)


def _longest(lengths: Array, slides: NDArray[np.bool_]) -> int:
    """The longest segment outside sliding, unless it is short beside the longest of all."""
    outside = np.where(slides, 0.0, lengths)
    use = outside if outside.max() >= SHORT_SEGMENT * lengths.max() else lengths
    return int(np.argmax(use))


def _constants(variations: Variations, switches: Array) -> Array:
    """Constants of segments with the values of switches, those of instants being zero."""
    return np.hstack([np.zeros((len(switches), len(variations.instants.symbols))), switches])


def _single(start: float, mode: int, state: Array, period: float, constants: Array) -> Segments:
    modes, ends = np.array([mode]), np.array([CLOSING])
    lengths = np.array([period])
    return Segments(start, modes, ends, state[None, :].copy(), lengths, constants=constants)


def divided(
    segments: Segments,
    growth: Array,
    states_at: Callable[[Integers, Array, Array, Array, Array], Array],
    limit: float = SEGMENT_GROWTH,
) -> Segments:
    """Divide every segment with too much growth by nodes into pieces of equal duration.

    Parameters
    ----------
    segments : Segments
    growth : ndarray, shape (K,)
        Largest growth of a perturbation along each segment.
    states_at : callable
        Of modes, first states and times of segments, offsets into them and constants: the states
        there.
    limit : float
        Largest growth of a segment.

    Raises
    ------
    OrbitError
        If more than `MOST_SEGMENTS` segments are needed.
    """
    counts = np.ceil(np.log(np.maximum(growth, 1.0)) / np.log(limit))
    counts = np.clip(counts, 1, MOST_SEGMENTS + 1).astype(int)
    if (counts == 1).all():
        return segments
    if counts.sum() > MOST_SEGMENTS:
        raise OrbitError(
            Outcome(
                "too many segments",
                f"perturbations grow so much along the guess that more than {MOST_SEGMENTS} nodes "
                "are needed: no periodic motion, or a period that is too long.",
                False,
            )
        )
    number = np.repeat(np.arange(len(segments)), counts)
    piece = np.arange(len(number)) - np.repeat(np.cumsum(counts) - counts, counts)
    part = segments.durations[number] / counts[number]
    modes = segments.modes[number]
    first, constants = segments.states[number], segments.constants[number]
    states = states_at(modes, first, segments.times[number], piece * part, constants)
    last = np.append(number[1:] != number[:-1], True)
    ends = np.where(last, segments.ends[number], NODE)
    jumps = np.where(last, segments.jumps[number], -1)
    return Segments(segments.start, modes, ends, states, part, jumps, constants)


def without_some_nodes(segments: Segments, first: Integers) -> Segments:
    """Return the same curve with segments that begin at some of its nodes, and at all events.

    Parameters
    ----------
    segments : Segments
    first : ndarray of int64, shape (M,)
        Numbers of the segments with which those of the curve begin.
    """
    last = np.append(first[1:], len(segments)) - 1
    return Segments(
        segments.start,
        segments.modes[first],
        segments.ends[last],
        segments.states[first],
        np.add.reduceat(segments.durations, first),
        segments.jumps[last],
        segments.constants[first],
    )


def winding_of(run: Trajectory, since: float, period: float) -> Array:
    """Return the whole periods that periodic states gain in one period, 0 for other states."""
    lengths = periods_of(run.states, run.periods)
    gained = run(min(since + period, run.span[1])) - run(since)
    safe = np.where(lengths > 0, lengths, 1.0)
    return np.where(lengths > 0, np.round(gained / safe) * safe, 0.0)


def restarted(
    segments: Segments, period: float, winding: Array, variations: Variations, parameters: Array
) -> Segments:
    """Return the same closed curve with its start in the middle of the longest segment."""
    whole = segments.without_nodes()
    if len(whole) == 1:
        return whole
    lengths = whole.durations.copy()
    # the last segment continues in the first one
    lengths[0] += lengths[-1]
    lengths = lengths[:-1]
    slides = (variations.signs[whole.modes[:-1]] == 0).any(axis=1)
    longest = _longest(lengths, slides)
    if longest == 0:
        origin, since, offset = whole.states[-1] - winding, whole.times[-2], 0.5 * lengths[0]
        start = since + offset - period
    else:
        origin, since, offset = whole.states[longest], whole.times[longest], 0.5 * lengths[longest]
        start = since + offset
    mode = whole.modes[longest]
    first = flow(
        variations,
        np.array([mode]),
        origin[None, :].copy(),
        np.array([since]),
        np.array([offset]),
        parameters,
        whole.constants[[longest if longest else -1]],
    ).ends
    count = len(whole) - 1
    order = np.arange(longest + 1, longest + 1 + count)
    # a segment of the next period; segment 0 of the cycle starts at the last event of this one
    beyond = (order > count) & (longest > 0)
    order %= count
    starts = np.vstack([whole.states[-1:], whole.states[1:-1]])
    moved = replace(
        whole,
        start=float(start),
        modes=np.r_[mode, whole.modes[:-1][order]],
        ends=np.r_[np.roll(whole.ends[:-1], -longest), CLOSING],
        jumps=np.r_[np.roll(whole.jumps[:-1], -longest), -1],
        constants=np.r_[whole.constants[[longest]], whole.constants[:-1][order]],
        states=np.vstack([first, starts[order] + beyond[:, None] * winding]),
        durations=np.r_[0.5 * lengths[longest], lengths[order][:-1], 0.5 * lengths[longest]],
    )
    return moved.with_constants(variations, parameters)
