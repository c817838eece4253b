"""Slices of a trajectory, between two times or of consecutive samples."""

from __future__ import annotations

from dataclasses import replace
from math import comb
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from fastslow.errors import ArgumentError
from fastslow.results.base.outcome import Outcome
from fastslow.results.branch.slicing import limits_of
from fastslow.results.trajectory.dense import evaluate
from fastslow.results.trajectory.lookup import known_region
from fastslow.results.trajectory.state_at import is_dense

if TYPE_CHECKING:
    from fastslow.results.trajectory.trajectory import Trajectory

Array = NDArray[np.float64]
Samples = tuple[Array, Array]


def slice_bounds(wanted: slice, count: int, what: str) -> tuple[int, int]:
    """Return start and stop of a slice of consecutive samples.

    Raises
    ------
    ArgumentError
        For a slice that is empty or has a step.
    """
    start, stop, step = wanted.indices(count)
    if step != 1:
        raise ArgumentError(
            f"{what} is sliced with a step of 1, received {step}; slice its columns instead"
        )
    if stop <= start:
        raise ArgumentError(f"samples {start} to {stop} contain none of the {count} samples")
    return start, stop


def samples_of(run: Trajectory, wanted: slice) -> Trajectory:
    """Return the trajectory of consecutive samples; see `Trajectory.__getitem__`."""
    start, stop = slice_bounds(wanted, len(run), "a trajectory")
    if stop - start == len(run):
        return run
    kept = run.t[start:stop], run.sampled_columns[:, start:stop]
    return _cut(run, float(kept[0][0]), float(kept[0][-1]), kept)


def parts_of(
    run: Trajectory, region: str | None, between: tuple[float, float] | None
) -> tuple[Trajectory, ...]:
    """The stretches of a trajectory that fulfil conditions; see `Trajectory.select`."""
    windows = [run.span]
    if region is not None:
        known_region(run, region)
        windows = [(s.start, s.end) for s in run.segments if s.region == region]
    if between is not None:
        low, high = limits_of(between)
        windows = [(max(low, begin), min(high, end)) for begin, end in windows]
    parts = (_window(run, begin, end) for begin, end in windows if begin < end)
    return tuple(part for part in parts if part is not None)


def _window(run: Trajectory, begin: float, end: float) -> Trajectory | None:
    """Return the slice between two times, or without dense output that of the samples inside."""
    if (begin, end) == run.span:
        return run
    if not is_dense(run):
        first = int(np.searchsorted(run.t, begin, side="left"))
        last = int(np.searchsorted(run.t, end, side="right"))
        return samples_of(run, slice(first, last)) if last > first else None
    if run.sampled is None:
        return _cut(run, begin, end, None)
    times, columns = run.sampled
    inside = (times > begin) & (times < end)
    ends = run.dense_columns([begin, end])[: len(columns)]
    kept = np.column_stack([ends[:, 0], columns[:, inside], ends[:, 1]])
    return _cut(run, begin, end, (np.concatenate([[begin], times[inside], [end]]), kept))


def _cut(run: Trajectory, begin: float, end: float, sampled: Samples | None) -> Trajectory:
    """Return the slice between two times, with its crossings and exact ends."""
    first = max(int(np.searchsorted(run.step_starts, begin, side="right")) - 1, 0)
    stop = max(int(np.searchsorted(run.step_starts, end, side="left")), first + 1)
    steps = run.steps[first:stop].copy()
    series = None if run.series is None else run.series[first:stop]
    if len(steps):
        ahead = begin - steps[0, 0]
        if ahead > 0.0:
            steps[0, :2] += ahead, -ahead
            if series is not None:
                series = np.concatenate([_moved(series[0], ahead)[None], series[1:]])
        # the last step may extend beyond the end, and may also be the first
        steps[-1, 1] = max(min(steps[-1, 1], end - steps[-1, 0]), 0.0)
    times = run.crossing_table[:, 0]
    part = replace(
        run,
        span=(begin, end),
        steps=steps,
        series=series,
        crossing_table=run.crossing_table[(times >= begin) & (times <= end)],
        sampled=sampled,
        outcome=run.outcome if end == run.span[1] else _outcome(run, begin, end),
    )
    return replace(part, end=_reached(part, end))


def _reached(part: Trajectory, end: float) -> Array:
    """Return time and state at the end of a slice."""
    n = len(part.states)
    if is_dense(part):
        last = np.array([len(part.steps) - 1])
        state = evaluate(part, last, end - part.steps[last, 0])[:n, 0]
    else:
        state = part.sampled_columns[:n, -1]
    return np.append(end, state)


def _outcome(run: Trajectory, begin: float, end: float) -> Outcome:
    low, high = run.span
    return Outcome(
        "cut", f"cut to t from {begin:g} to {end:g} of a run from {low:g} to {high:g}.", True
    )


def _moved(coefficients: Array, ahead: float) -> Array:
    """Re-expand a series about a later time, shape (columns, order + 1).

    Examples
    --------
    >>> _moved(np.array([[1.0, 2.0, 3.0]]), 2.0)
    array([[17., 14.,  3.]])
    """
    order = coefficients.shape[1] - 1
    shift = np.array(
        [
            [comb(k, j) * ahead ** (k - j) if k >= j else 0.0 for j in range(order + 1)]
            for k in range(order + 1)
        ]
    )
    return coefficients @ shift
