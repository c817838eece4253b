"""Where a trajectory takes one value of a column: every root of its series, or between samples."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from fastslow.arguments import finite
from fastslow.errors import ArgumentError, unknown_name
from fastslow.results.trajectory.extrema import extremes_of
from fastslow.results.trajectory.state_at import (
    StatePoint,
    check_readable,
    is_dense,
    state_points_at,
)
from fastslow.results.trajectory.step_polynomials import StepPolynomials, along_steps
from fastslow.results.trajectory.step_roots import CLOSE, Zero, find_zeros

if TYPE_CHECKING:
    from fastslow.results.trajectory.trajectory import Trajectory

Array = NDArray[np.float64]

#: An end of a run that misses the value by this part of the terms of its step is on it.
NEAR = 1e-12


def one_value(values: Mapping[str, float], valid: Sequence[str]) -> tuple[str, float]:
    """The column asked for and its value.

    Raises
    ------
    UnknownNameError
        For a name that is no column.
    ArgumentError
        For none, several, or a number that is not finite.
    """
    for name in values:
        if name not in valid:
            raise unknown_name("column", name, valid)
    if len(values) != 1:
        received = ", ".join(values) or "none"
        raise ArgumentError(f"expected a value of one of {', '.join(valid)}, received {received}")
    ((name, value),) = values.items()
    return name, finite(name, value)


def moments_on(run: Trajectory, name: str, level: float, direction: int | None) -> list[StatePoint]:
    """The moments at which a column has a value, in order of time; see `Trajectory.at`."""
    check_readable(run)
    if name == "t":
        low, high = run.span if is_dense(run) else (float(run.t[0]), float(run.t[-1]))
        if not low <= level <= high:
            raise outside(name, level, (low, high))
        found = state_points_at(run, np.array([level]))
        return found if direction in (None, 1) else []
    if not is_dense(run):
        values = run[name]
        return between_samples(run, name, values, level, direction)
    quantity = along_steps(run, name).minus(level)
    zeros = _with_ends(find_zeros(quantity), quantity)
    if not zeros:
        low, high = extremes_of(run, name, None)
        if not low <= level <= high:
            raise outside(name, level, (low, high))
    return _moments(run, zeros, run.steps[:, 0], run.steps[:, 1], direction)


def _with_ends(zeros: list[Zero], quantity: StepPolynomials) -> list[Zero]:
    """The zeros, and an end of the run that misses zero by rounding only."""
    b = quantity.coefficients
    first, last = float(b[0, 0]), float(b[-1].sum())
    near = NEAR * quantity.size
    # the passage of a neighbouring zero is not counted again
    if abs(first) <= near[0] and not (zeros and zeros[0].low <= CLOSE):
        zeros = [Zero(0.0, 0.0, 0, int(np.sign(b[0, 1:].sum()))), *zeros]
    if abs(last) <= near[-1] and not (zeros and zeros[-1].high >= len(b) - CLOSE):
        zeros = [*zeros, Zero(len(b), len(b), int(np.sign(b[-1, 0] - last)), 0)]
    return zeros


def between_samples(
    run: Trajectory, name: str, values: Array, level: float, direction: int | None
) -> list[StatePoint]:
    """The same on straight lines between values at the samples, and so interpolated."""
    low, high = float(values.min()), float(values.max())
    if not low <= level <= high:
        raise outside(name, level, (low, high))
    if len(values) == 1:
        return state_points_at(run, run.t) if direction in (None, 0) else []
    rise = np.diff(values)
    lines = StepPolynomials(
        np.column_stack([values[:-1] - level, rise]), np.abs(values[:-1]) + np.abs(rise)
    )
    found = _moments(run, find_zeros(lines), run.t[:-1], np.diff(run.t), direction)
    at_samples = np.isin([moment.time for moment in found], run.t).tolist()
    return [
        replace(moment, interpolated=not exact)
        for moment, exact in zip(found, at_samples, strict=True)
    ]


def _moments(
    run: Trajectory, zeros: list[Zero], starts: Array, lengths: Array, direction: int | None
) -> list[StatePoint]:
    """The moments of zeros along steps; of a stretch its two ends."""
    places: list[float] = []
    resting: list[bool] = []
    for zero in zeros:
        if direction is None or zero.direction == direction:
            ends = [zero.low, zero.high] if zero.long else [zero.middle]
            places += ends
            resting += [zero.long] * len(ends)
    where = np.array(places)
    step = np.minimum(where.astype(np.intp), len(starts) - 1)
    times = starts[step] + (where - step) * lengths[step]
    low, high = run.span
    found = state_points_at(run, np.clip(times, low, high))
    return [
        replace(moment, resting=True) if rests else moment
        for moment, rests in zip(found, resting, strict=True)
    ]


def in_region(run: Trajectory, found: list[StatePoint], region: str | None) -> list[StatePoint]:
    """Those of a region, or of sliding between two.

    Raises
    ------
    UnknownNameError
        For a region that there is not.
    """
    if region is None:
        return found
    known_region(run, region)
    return [moment for moment in found if moment.region == region]


def known_region(run: Trajectory, region: str) -> None:
    """Refuse a name that is no region, and no sliding between two."""
    valid = tuple(dict.fromkeys([*run.regions, *run.modes]))
    if region not in valid:
        raise unknown_name("region", region, valid)


def outside(name: str, level: float, over: tuple[float, float]) -> ArgumentError:
    """The error for a value that is not reached, to be raised."""
    return ArgumentError(
        f"{name} = {level:g} is outside this run's range [{over[0]:g}, {over[1]:g}]"
    )
