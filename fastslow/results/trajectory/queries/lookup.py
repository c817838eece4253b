"""Lookup of states by the value of a column: roots of the series, or of linear interpolants."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fastslow.formulas.columns import read, rows_where
from fastslow.formulas.grammar import Comparison, Sum, nodes, text_of
from fastslow.results.base.intervals import runs_of
from fastslow.results.base.table import inside
from fastslow.results.trajectory.queries.state_at import StatePoint
from fastslow.results.trajectory.steps.dense import DenseOutput
from fastslow.results.trajectory.steps.step_polynomials import StepPolynomials
from fastslow.results.trajectory.steps.step_roots import CLOSE_ROOTS, Zero, find_zeros

Array = NDArray[np.float64]

#: Returns the states at given times.
PointsAt = Callable[[Array], list[StatePoint]]

#: Distance of an end of the run from the value, relative to the terms of the step, below
#: which it is a root.
ROOT_AT_END = 1e-12


def states_at_level(
    points_at: PointsAt, dense: DenseOutput, name: str, level: float, direction: int | None
) -> list[StatePoint]:
    """Return the states at which a column has a value, in order of time; see `Trajectory.at`."""
    quantity = dense.polynomials(name).minus(level)
    zeros = _with_ends(find_zeros(quantity), quantity)
    if not zeros:
        inside("run", name, level, dense.extremes(name, dense.span))
    return _states_at_roots(points_at, zeros, dense.steps[:, :2], dense.span, direction)


def _with_ends(zeros: list[Zero], quantity: StepPolynomials) -> list[Zero]:
    """Return the roots, with an end of the run that misses zero by rounding."""
    b = quantity.coefficients
    first, last = float(b[0, 0]), float(b[-1].sum())
    near = ROOT_AT_END * quantity.size
    # a neighbouring root is not counted twice
    if abs(first) <= near[0] and not (zeros and zeros[0].low <= CLOSE_ROOTS):
        zeros = [Zero(0.0, 0.0, 0, int(np.sign(b[0, 1:].sum()))), *zeros]
    if abs(last) <= near[-1] and not (zeros and zeros[-1].high >= len(b) - CLOSE_ROOTS):
        zeros = [*zeros, Zero(len(b), len(b), int(np.sign(b[-1, 0] - last)), 0)]
    return zeros


def states_between_samples(
    points_at: PointsAt,
    samples: tuple[Array, Array],
    name: str,
    level: float,
    direction: int | None,
) -> list[StatePoint]:
    """Return states as `states_at_level`, by linear interpolation between samples.

    The samples are times and values of the named column.
    """
    times, values = samples
    inside("run", name, level, (float(values.min()), float(values.max())))
    if len(values) == 1:
        return points_at(times) if direction in (None, 0) else []
    rise = np.diff(values)
    lines = StepPolynomials(
        np.column_stack([values[:-1] - level, rise]), np.abs(values[:-1]) + np.abs(rise)
    )
    steps, span = np.column_stack([times[:-1], np.diff(times)]), (times[0], times[-1])
    found = _states_at_roots(points_at, find_zeros(lines), steps, span, direction)
    at_samples = np.isin([point.time for point in found], times).tolist()
    return [
        replace(point, interpolated=not exact)
        for point, exact in zip(found, at_samples, strict=True)
    ]


def _states_at_roots(
    points_at: PointsAt,
    zeros: list[Zero],
    steps: Array,
    span: tuple[float, float],
    direction: int | None,
) -> list[StatePoint]:
    """Return the states at roots along steps; an interval of roots gives its two ends."""
    places: list[float] = []
    resting: list[bool] = []
    for zero in zeros:
        if direction is None or zero.direction == direction:
            ends = [zero.low, zero.high] if zero.long else [zero.middle]
            places += ends
            resting += [zero.long] * len(ends)
    found = points_at(np.clip(times_of(np.array(places), steps), *span))
    return [
        replace(point, resting=True) if rests else point
        for point, rests in zip(found, resting, strict=True)
    ]


def windows_where(dense: DenseOutput, condition: Any) -> list[tuple[float, float]]:
    """Return the time intervals on which a condition is true, except at single instants.

    Their ends are jumps, and roots of the differences of all compared expressions, computed to
    rounding.

    Raises
    ------
    UnknownNameError
        For a name that is neither a column nor a parameter.
    ArgumentError
        For text that is not a condition, or compares expressions that are not polynomials.
    """
    known = (*dense.columns, *dense.parameters, "t")
    tree, _ = read(condition, known, "column", condition=True)
    low, high = dense.span
    # a jump may change the condition without a root
    ends = [low, high, *dense.jump_times]
    for node in nodes(tree):
        if isinstance(node, Comparison):
            for one, other in zip(node.operands[:-1], node.operands[1:], strict=True):
                zeros = find_zeros(dense.polynomials(text_of(Sum((("+", one), ("-", other))))))
                places = np.array([end for zero in zeros for end in (zero.low, zero.high)])
                ends += times_of(places, dense.steps).tolist()
    times = np.unique(np.clip(ends, low, high))
    times = times[np.append(True, np.diff(times) > ROOT_AT_END * (high - low))]
    times[-1] = high
    middle = 0.5 * (times[:-1] + times[1:])
    columns = dict(zip((*dense.columns, "t"), (*dense.columns_at(middle), middle), strict=True))
    at_middle = {name: partial(np.asarray, values) for name, values in columns.items()}
    wanted = rows_where(condition, at_middle, dense.parameters, len(middle))
    return [(float(times[start]), float(times[stop])) for start, stop in runs_of(wanted)]


def times_of(places: Array, steps: Array) -> Array:
    """Return the times of places along steps, each a step + fraction, shape (K,)."""
    step = np.minimum(places.astype(np.intp), len(steps) - 1)
    return np.asarray(steps[step, 0] + (places - step) * steps[step, 1])
