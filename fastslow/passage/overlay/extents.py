"""The unit of each fast state in which distances of a run from a diagram are measured."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from fastslow.passage.delays.local_field import frozen_field
from fastslow.passage.overlay.attracting_branches import Course
from fastslow.passage.overlay.slow_quantities import SlowQuantity
from fastslow.results.angles import periods_of

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

#: A state's extent is between these parts of what the branches span.
LEAST, MOST = 1e-3, 20.0

#: A range below this part of a state's size is rounding.
FLAT = 1e-9

#: Rounding of a rate that is a constant times a state: implicit steps correct derivatives.
SAME = 1e-10

#: Times at which a run is looked at for its usual size.
TIMES = 257

#: Rows of each course at which the fast motion is linearised.
ROWS = 5

#: A part of an eigenvector below this part of its length is rounding.
PART = 1e-9


def extents_of(
    slow: SlowQuantity, courses: Sequence[Course], state: Array, places: Sequence[Array]
) -> tuple[Array, Mask]:
    """The extent of each state, and which states are velocities.

    The range of a state over the run and over the stable branches that the run meets,
    within reason of what all branches span. Where a state is constant along the
    branches, its range in a run that follows them is a lag only; it is then at least
    as large as the fast motion makes it, with the other states at their extents. A
    velocity is measured against the velocities of the fast motion.

    Parameters
    ----------
    slow : SlowQuantity
    courses : sequence of Course
    state : ndarray, shape (N, n)
        Of the run.
    places : sequence of ndarray, shape (M, n)
        States of each course where it is stable, at values that the run takes.

    Returns
    -------
    extent : ndarray, shape (n,)
    velocities : ndarray of bool, shape (n,)
    """
    run = slow.run
    extent = np.ptp(state, axis=0)
    for met in places:
        if len(met):
            extent = np.maximum(extent, np.ptp(met, axis=0))
    fastest = float(np.median([c.fastest() for c in courses] or [0.0]))
    size = np.abs(state).max(axis=0)
    # what moves by rounding only has no extent
    extent = np.where(extent > FLAT * size, extent, np.where(size > 0, size, 1.0))
    # by time: where a state grows without bound most samples are at the end
    even = np.searchsorted(run.t, np.linspace(run.t[0], run.t[-1], TIMES))
    usual = state[np.minimum(even, len(state) - 1)]
    typical = np.median(np.abs(usual - np.median(usual, axis=0)), axis=0)
    extent = _bounded(extent, typical, courses)
    extent = _from_modes(slow, courses, extent)
    periods = periods_of(slow.states, run.periods)
    extent = np.where(periods > 0, np.minimum(extent, periods), extent)
    velocities = np.zeros(len(extent), dtype=bool)
    for rate, of, factor in _velocities(slow):
        extent[rate] = max(extent[rate], extent[of] * fastest / factor)
        velocities[rate] = True
    return extent, velocities


def _bounded(extent: Array, typical: Array, courses: Sequence[Course]) -> Array:
    """Extents within reach of what the branches span, where they span anything.

    A run that hardly moves, or that grows without bound, is no measure for its own distances.
    """
    if not courses:
        return extent
    rows = np.concatenate([c.curve()[:, :-1] for c in courses])
    span = np.ptp(rows, axis=0)
    low, high = LEAST * span, MOST * span
    # a state that is constant along the branches but for rounding bounds nothing
    spans = (span > FLAT * np.abs(rows).max(axis=0)) & (span > FLAT * typical)
    return np.where(spans, np.clip(extent, low, high), extent)


def _velocities(slow: SlowQuantity) -> list[tuple[int, int, float]]:
    """Triples (i, j, |c|) where c times fast state i is the time derivative of fast state j.

    A sheet that drifts carries a velocity with it, which is no distance from the sheet:
    it is small beside the velocities of the fast motion.
    """
    if not slow.dense:
        return []
    series = slow.run.series
    assert series is not None
    rows = [slow.run.columns.index(name) for name in slow.states]
    found = []
    for j, of in enumerate(rows):
        for i, rate in enumerate(rows):
            value, slope = series[:, rate, 0], series[:, of, 1]
            if i == j or not len(series):
                continue
            largest = int(np.argmax(np.abs(value)))
            factor = slope[largest] / value[largest] if value[largest] != 0 else 0.0
            apart = np.abs(slope - factor * value).max()
            if factor != 0 and apart <= SAME * np.abs(slope).max():
                found.append((i, j, abs(float(factor))))
    return found


def _from_modes(slow: SlowQuantity, courses: Sequence[Course], extent: Array) -> Array:
    """Extents; of states that are constant along the branches, from the fast modes.

    In each mode of the linearised fast motion, the other states have their extents.
    """
    if not courses or slow.run.symbolic_model is None or slow.laws:
        return extent
    rows = np.concatenate([c.curve()[:, :-1] for c in courses])
    fixed = np.ptp(rows, axis=0) <= FLAT * np.maximum(np.abs(rows).max(axis=0), extent)
    if fixed.all() or not fixed.any():
        return extent
    modes = np.concatenate([_modes(slow, course) for course in courses])
    moved = np.abs(modes / np.linalg.norm(modes / extent[:, None], axis=1, keepdims=True))
    reach = (moved[:, ~fixed] / extent[~fixed, None]).max(axis=1, keepdims=True)
    with np.errstate(divide="ignore", invalid="ignore"):
        mixed = np.where(reach > PART, moved / reach, np.inf)
    mixed[mixed <= PART * extent[:, None]] = np.inf
    found = mixed.min(axis=2)[(reach > PART).any(axis=(1, 2))]
    if not len(found):
        return extent
    usual = np.median(found, axis=0)
    return np.where(fixed & np.isfinite(usual), np.maximum(extent, usual), extent)


def _modes(slow: SlowQuantity, course: Course) -> NDArray[np.complex128]:
    """Eigenvectors of the Jacobian at rows of a course, in columns, shape (rows, n, n)."""
    branch = course.branch
    field = frozen_field(slow.run.symbolic_model, slow.name, branch.parameters)
    every = np.concatenate([np.arange(piece.start, piece.stop) for piece in course.pieces])
    rows = every[np.linspace(0, len(every) - 1, ROWS).astype(int)]
    found = [np.empty((0, field.n, field.n), dtype=complex)]
    for name in dict.fromkeys(branch.region[rows].tolist()):
        if name not in field.regions:
            continue
        on = rows[branch.region[rows] == name]
        points = np.column_stack([branch.state[on], branch.parameter[on]])
        jacobians = field.evaluate(field.regions.index(name), points)[1][:, :, : field.n]
        jacobians = jacobians[np.isfinite(jacobians).all(axis=(1, 2))]
        found.append(np.linalg.eig(jacobians)[1].astype(complex))
    return np.concatenate(found)
