"""Lookup of states by the value of a column: roots of the series, or of linear interpolants."""

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

#: Distance of an end of the run from the value, relative to the terms of the step, below
#: which it is a root.
NEAR = 1e-12


def one_value(values: Mapping[str, float], valid: Sequence[str]) -> tuple[str, float]:
    """Validate a single column given with its value.

    Raises
    ------
    UnknownNameError
        For a name that is not a column.
    ArgumentError
        For no value, several values, or a number that is not finite.
    """
    for name in values:
        if name not in valid:
            raise unknown_name("column", name, valid)
    if len(values) != 1:
        received = ", ".join(values) or "none"
        raise ArgumentError(f"expected a value of one of {', '.join(valid)}, received {received}")
    ((name, value),) = values.items()
    return name, finite(name, value)


def states_at_level(
    run: Trajectory, name: str, level: float, direction: int | None
) -> list[StatePoint]:
    """Return the states at which a column has a value, in order of time; see `Trajectory.at`."""
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
    return _states_at_roots(run, zeros, run.steps[:, 0], run.steps[:, 1], direction)


def _with_ends(zeros: list[Zero], quantity: StepPolynomials) -> list[Zero]:
    """Return the roots, with an end of the run that misses zero by rounding."""
    b = quantity.coefficients
    first, last = float(b[0, 0]), float(b[-1].sum())
    near = NEAR * quantity.size
    # a neighbouring root is not counted twice
    if abs(first) <= near[0] and not (zeros and zeros[0].low <= CLOSE):
        zeros = [Zero(0.0, 0.0, 0, int(np.sign(b[0, 1:].sum()))), *zeros]
    if abs(last) <= near[-1] and not (zeros and zeros[-1].high >= len(b) - CLOSE):
        zeros = [*zeros, Zero(len(b), len(b), int(np.sign(b[-1, 0] - last)), 0)]
    return zeros


def between_samples(
    run: Trajectory, name: str, values: Array, level: float, direction: int | None
) -> list[StatePoint]:
    """Return states as `states_at_level`, by linear interpolation between samples."""
    low, high = float(values.min()), float(values.max())
    if not low <= level <= high:
        raise outside(name, level, (low, high))
    if len(values) == 1:
        return state_points_at(run, run.t) if direction in (None, 0) else []
    rise = np.diff(values)
    lines = StepPolynomials(
        np.column_stack([values[:-1] - level, rise]), np.abs(values[:-1]) + np.abs(rise)
    )
    found = _states_at_roots(run, find_zeros(lines), run.t[:-1], np.diff(run.t), direction)
    at_samples = np.isin([point.time for point in found], run.t).tolist()
    return [
        replace(point, interpolated=not exact)
        for point, exact in zip(found, at_samples, strict=True)
    ]


def _states_at_roots(
    run: Trajectory, zeros: list[Zero], starts: Array, lengths: Array, direction: int | None
) -> list[StatePoint]:
    """Return the states at roots along steps; an interval of roots gives its two ends."""
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
        replace(point, resting=True) if rests else point
        for point, rests in zip(found, resting, strict=True)
    ]


def in_region(run: Trajectory, found: list[StatePoint], region: str | None) -> list[StatePoint]:
    """Select the states in a region, or sliding between two.

    Raises
    ------
    UnknownNameError
        For an unknown region.
    """
    if region is None:
        return found
    known_region(run, region)
    return [point for point in found if point.region == region]


def known_region(run: Trajectory, region: str) -> None:
    """Raise UnknownNameError for a name that is neither a region nor a sliding motion."""
    valid = tuple(dict.fromkeys([*run.regions, *run.modes]))
    if region not in valid:
        raise unknown_name("region", region, valid)


def outside(name: str, level: float, over: tuple[float, float]) -> ArgumentError:
    """Return the error for a value that is not reached."""
    return ArgumentError(
        f"{name} = {level:g} is outside this run's range [{over[0]:g}, {over[1]:g}]"
    )
