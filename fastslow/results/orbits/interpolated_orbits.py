"""Orbits between two orbits of a branch, without the equations."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from fastslow.results.base.outcome import Outcome, with_notes
from fastslow.results.orbits.orbit import Orbit
from fastslow.results.trajectory.events.jumps import assignments_of
from fastslow.results.trajectory.steps.slicing import expanded_about
from fastslow.results.trajectory.trajectory import Trajectory

Array = NDArray[np.float64]
V = TypeVar("V", float, NDArray[np.float64], NDArray[np.complex128])


def interpolated(one: Orbit, two: Orbit, part: float, parameter: str, value: float) -> Orbit | None:
    """Interpolate linearly between two orbits with the same sequence of segments.

    States are interpolated at equal fractions of each segment.

    Parameters
    ----------
    one, two : Orbit
    part : float
        Fraction of the way from the first to the second.
    parameter : str
    value : float
        Of the parameter.

    Returns
    -------
    Orbit or None
        None for different segments.
    """
    run = _between(one.trajectory, two.trajectory, part)
    if run is None or one.trivial != two.trivial:
        return None
    period = _mean(one.period, two.period, part)
    run = replace(
        run,
        parameters={**run.parameters, parameter: value},
        period=None if one.multiple is None else period / one.multiple,
        model=None if run.model is None else run.model.with_parameters({parameter: value}),
    )
    # multipliers of sliding are 0 on both, with logarithms of minus infinity
    logs = one.log_multipliers, two.log_multipliers
    same = logs[0] == logs[1]
    finite = [np.where(same, 0.0, some) for some in logs]
    outcome = Outcome("periodic", f"periodic with T = {period:.9g}.", True)
    note = f"It is interpolated between rows, at {parameter} = {value:.9g}."
    return Orbit(
        run,
        period,
        one.multiple,
        _mean(one.multipliers, two.multipliers, part),
        np.where(same, logs[0], _mean(finite[0], finite[1], part)),
        one.trivial,
        defect=float("nan"),
        residual=float("nan"),
        accuracy=float("nan"),
        outcome=with_notes(outcome, [note]),
    )


def _mean(one: V, two: V, part: float) -> V:
    return (1.0 - part) * one + part * two


@dataclass(frozen=True)
class _Segment:
    """The steps of a run in one segment, with their first times as fractions of its length."""

    begin: float
    length: float
    shares: Array
    steps: Array
    series: Array

    def series_at(self, share: float) -> Array:
        """Series about a fraction of the segment, in units of its length."""
        row = int(np.searchsorted(self.shares, share, side="right")) - 1
        series = expanded_about(self.series[row], (share - self.shares[row]) * self.length)
        return series * self.length ** np.arange(series.shape[1])


def _segments(run: Trajectory) -> list[_Segment]:
    """The segments of a run."""
    assert run.series is not None
    mode, changed = run.steps[:, 2], np.zeros(len(run.steps), dtype=bool)
    changed[1:] = mode[1:] != mode[:-1]
    changed |= np.isin(run.steps[:, 0], assignments_of(run)[:, 0])
    firsts = np.append(0, np.flatnonzero(changed[1:]) + 1)
    edges = np.append(run.steps[firsts, 0], run.span[1])
    found = []
    for first, last, begin, end in zip(
        firsts, [*firsts[1:], len(mode)], edges[:-1], edges[1:], strict=True
    ):
        steps = run.steps[first:last]
        shares = (steps[:, 0] - begin) / (end - begin)
        found.append(_Segment(begin, end - begin, shares, steps, run.series[first:last]))
    return found


def _between(one: Trajectory, two: Trajectory, part: float) -> Trajectory | None:
    """The trajectory between two of the same segments, None for others."""
    segments, tables = [_segments(one), _segments(two)], [one.crossing_table, two.crossing_table]
    modes = [[segment.steps[0, 2] for segment in some] for some in segments]
    # time, then interface, direction, and the modes before and after
    crossed = [table[:, 1:5].tolist() for table in tables]
    if modes[0] != modes[1] or crossed[0] != crossed[1]:
        return None
    jumps: dict[str, Array] = {}
    for name in ("reset_table", "event_table"):
        ours, theirs = getattr(one, name), getattr(two, name)
        if ours is not None and theirs is not None:
            if ours[:, 1].tolist() != theirs[:, 1].tolist():
                return None
            jumps[name] = _mean(ours, theirs, part)
    steps, series = [], []
    for pair in zip(*segments, strict=True):
        begin = _mean(pair[0].begin, pair[1].begin, part)
        length = _mean(pair[0].length, pair[1].length, part)
        shares = np.unique(np.concatenate([pair[0].shares, pair[1].shares, [1.0]]))
        for low, high in pairwise(shares.tolist()):
            mean = _mean(pair[0].series_at(low), pair[1].series_at(low), part)
            series.append(mean / length ** np.arange(mean.shape[1]))
            steps.append([begin + low * length, (high - low) * length, *pair[0].steps[0, 2:]])
    table = _mean(tables[0], tables[1], part)
    # near-tangential on either
    table[:, 5] = np.maximum(tables[0][:, 5], tables[1][:, 5])
    ends = _mean(np.array(one.span), np.array(two.span), part)
    return replace(
        one,
        span=(float(ends[0]), float(ends[1])),
        end=_mean(one.end, two.end, part),
        steps=np.array(steps),
        series=np.array(series),
        crossing_table=table,
        **jumps,  # type: ignore[arg-type]
    )
