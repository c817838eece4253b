"""Units of the fast states for distances between a run and a diagram."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from fastslow.passage.delays.local_field import frozen_field
from fastslow.passage.overlay.attracting_branches import Arc
from fastslow.passage.slow_quantities import SlowQuantity
from fastslow.results.angles import periods_of

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

#: Bounds of a state's extent, relative to its range over the branches.
LEAST_EXTENT, MOST_EXTENT = 1e-3, 20.0

#: Extent of a state in a run that escaped, relative to its range over the branches: the state
#: moves to the branch and away from it.
ESCAPED_EXTENT = 2.0

#: Relative range of a state below which it is constant up to rounding.
CONSTANT_STATE = 1e-9

#: Relative tolerance for a rate proportional to a state; implicit steps correct derivatives.
PROPORTIONAL = 1e-10

#: Number of equidistant times at which the typical size of a run is sampled.
TIMES = 257

#: Rows of each arc at which the fast motion is linearised.
LINEARISED_ROWS = 5

#: Relative component of an eigenvector below which it is zero up to rounding.
ZERO_COMPONENT = 1e-9


def extents_of(
    slow: SlowQuantity, arcs: Sequence[Arc], state: Array, places: Sequence[Array]
) -> tuple[Array, Mask]:
    """Compute the extent of each state, and detect velocities.

    The extent is the range of a state over the run and over the stable branches present
    during the run, bounded by multiples of its range over all branches. The range of a state
    that is constant along the branches is a mere lag in a run that follows them; its extent is
    then at least its amplitude in the fast modes whose other states have their extents.
    The extent of a velocity is the velocity of the fast motion. The range of a run that escaped,
    by a blow-up or until a stop farther from the branches, is no unit: `ESCAPED_EXTENT` times that
    of the branches is used.

    Parameters
    ----------
    slow : SlowQuantity
    arcs : sequence of Arc
    state : ndarray, shape (N, n)
        States of the run.
    places : sequence of ndarray, shape (M, n)
        States of each arc where it is stable, at the slow values of the run.

    Returns
    -------
    extent : ndarray, shape (n,)
    velocities : ndarray of bool, shape (n,)
    """
    run = slow.run
    grew = _escaped(slow, state, places)
    extent = np.zeros(state.shape[1]) if grew else np.ptp(state, axis=0)
    for present in places:
        if len(present):
            extent = np.maximum(extent, (ESCAPED_EXTENT if grew else 1.0) * np.ptp(present, axis=0))
    fastest = float(np.median([c.fastest() for c in arcs] or [0.0]))
    # equidistant in time: for unbounded growth most samples are at the end
    even = np.searchsorted(run.t, np.linspace(run.t[0], run.t[-1], TIMES))
    usual = state[np.minimum(even, len(state) - 1)]
    typical = np.median(np.abs(usual - np.median(usual, axis=0)), axis=0)
    size = np.median(np.abs(usual), axis=0) if grew else np.abs(state).max(axis=0)
    # variations by rounding give no extent
    extent = of_moving(extent, size)
    extent = _bounded(extent, typical, arcs)
    extent = _from_modes(slow, arcs, extent)
    periods = periods_of(slow.states, run.periods)
    extent = np.where(periods > 0, np.minimum(extent, periods), extent)
    velocities = np.zeros(len(extent), dtype=bool)
    for rate, of, factor in _velocities(slow):
        extent[rate] = max(extent[rate], extent[of] * fastest / factor)
        velocities[rate] = True
    return extent, velocities


def of_moving(extent: Array, size: Array) -> Array:
    """Range of each state, its size where it is constant up to rounding, shape (n,)."""
    found: Array = np.where(extent > CONSTANT_STATE * size, extent, np.where(size > 0, size, 1.0))
    return found


def _escaped(slow: SlowQuantity, state: Array, places: Sequence[Array]) -> bool:
    """Check whether a run ends far from the branches that it passed."""
    code, passed = slow.run.outcome.code, [rows for rows in places if len(rows)]
    if code != "stopped" or not passed:
        return code == "blow-up"
    known = np.concatenate(passed)
    low, high = known.min(axis=0), known.max(axis=0)
    away = np.maximum(low - state[-1], state[-1] - high)
    spans = high - low > CONSTANT_STATE * np.abs(known).max(axis=0)
    return bool((spans & (away > ESCAPED_EXTENT * (high - low))).any())


def _bounded(extent: Array, typical: Array, arcs: Sequence[Arc]) -> Array:
    """Bound the extents by multiples of the range of the branches, where that is not zero.

    A run that hardly moves, or grows without bound, gives no meaningful unit.
    """
    if not arcs:
        return extent
    rows = np.concatenate([c.curve()[:, :-1] for c in arcs])
    span = np.ptp(rows, axis=0)
    low, high = LEAST_EXTENT * span, MOST_EXTENT * span
    # a state that is constant along the branches up to rounding gives no bound
    spans = (span > CONSTANT_STATE * np.abs(rows).max(axis=0)) & (span > CONSTANT_STATE * typical)
    return np.where(spans, np.clip(extent, low, high), extent)


def _velocities(slow: SlowQuantity) -> list[tuple[int, int, float]]:
    """Triples (i, j, |c|) where c times fast state i is the time derivative of fast state j.

    The velocity of a drifting equilibrium is no deviation from it, and small compared with
    the velocities of the fast motion.
    """
    if not slow.dense:
        return []
    series = slow.run.dense.series
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
            if factor != 0 and apart <= PROPORTIONAL * np.abs(slope).max():
                found.append((i, j, abs(float(factor))))
    return found


def _from_modes(slow: SlowQuantity, arcs: Sequence[Arc], extent: Array) -> Array:
    """Replace the extents of states that are constant along the branches by modal amplitudes.

    In each mode of the linearised fast motion, the other states have their extents.
    """
    if not arcs or slow.run.symbolic_model is None or slow.laws:
        return extent
    rows = np.concatenate([c.curve()[:, :-1] for c in arcs])
    fixed = np.ptp(rows, axis=0) <= CONSTANT_STATE * np.maximum(np.abs(rows).max(axis=0), extent)
    if fixed.all() or not fixed.any():
        return extent
    modes = np.concatenate([_modes(slow, arc) for arc in arcs])
    moved = np.abs(modes / np.linalg.norm(modes / extent[:, None], axis=1, keepdims=True))
    reach = (moved[:, ~fixed] / extent[~fixed, None]).max(axis=1, keepdims=True)
    with np.errstate(divide="ignore", invalid="ignore"):
        mixed = np.where(reach > ZERO_COMPONENT, moved / reach, np.inf)
    mixed[mixed <= ZERO_COMPONENT * extent[:, None]] = np.inf
    found = mixed.min(axis=2)[(reach > ZERO_COMPONENT).any(axis=(1, 2))]
    if not len(found):
        return extent
    usual = np.median(found, axis=0)
    return np.where(fixed & np.isfinite(usual), np.maximum(extent, usual), extent)


def _modes(slow: SlowQuantity, arc: Arc) -> NDArray[np.complex128]:
    """Eigenvectors of the Jacobian at rows of an arc, in columns, shape (rows, n, n)."""
    branch = arc.branch
    field = frozen_field(slow.run.symbolic_model, slow.name, branch.parameters)
    every = np.concatenate([np.arange(piece.start, piece.stop) for piece in arc.pieces])
    rows = every[np.linspace(0, len(every) - 1, LINEARISED_ROWS).astype(int)]
    found = [np.empty((0, field.n, field.n), dtype=complex)]
    for name in dict.fromkeys(branch.region[rows].tolist()):
        if name not in field.regions:
            continue
        on = rows[branch.region[rows] == name]
        points = np.column_stack([branch.state[on], branch.values[on]])
        jacobians = field.evaluate(field.regions.index(name), points)[1][:, :, : field.n]
        jacobians = jacobians[np.isfinite(jacobians).all(axis=(1, 2))]
        found.append(np.linalg.eig(jacobians)[1].astype(complex))
    return np.concatenate(found)
