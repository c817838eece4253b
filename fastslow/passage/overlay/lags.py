"""The time by which a run lags behind a moving attractor, to first order."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fastslow.passage.overlay.following import Distances, products, rows_of
from fastslow.results.angles import apart as apart_of

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
Integers = NDArray[np.intp]

#: Relative change over the slow range, in units of the extent, below which a branch is flat.
FLAT_SLOPE = 1e-9

#: Largest unexplained fraction of a deviation that is attributed to a lag, and of the change
#: during the lag that is attributed to a constant drift.
UNEXPLAINED = 0.5

#: Lag, in relaxation times, above which the state has not yet relaxed.
LONGEST_LAG = 2.0

#: Fraction of the mean speed below which the slow quantity is at rest.
AT_REST_SPEED = 1e-3


def distances_and_lags(
    m: Distances, arc_at: Integers, away: Mask | None = None
) -> tuple[Array, Array, Array]:
    """Compute the distance from the followed arc, the lag behind it, and the relaxation time.

    The lag solves X(w(t − lag)) ≈ x(t) to first order. It is nan in a jump, where the attractor at
    the earlier time is not much nearer (the state oscillates about it, the slow quantity has an
    extremum), and after a jump until the state has relaxed, where the drift is not the cause.

    Parameters
    ----------
    m : Distances
    arc_at : ndarray of int, shape (N,)
        The arc followed in each row, −1 for none: there the distance is that from the nearest
        stable attractor.
    away : ndarray of bool, shape (N,), optional
        Rows in which the state moves between two arcs.
    """
    apart = np.array([m.apart(k) for k in range(len(m.arcs))]).reshape(-1, len(m.t))
    distance = np.where(m.present.T, apart, np.inf).min(axis=0, initial=np.inf)
    lag, relaxation = np.full((2, len(m.t)), np.nan)
    mean = float(np.abs(np.diff(m.slow)).sum()) / (float(m.t[-1] - m.t[0]) or 1.0)
    for number, arc in enumerate(m.arcs):
        on = np.flatnonzero(arc_at == number)
        distance[on] = apart[number, on]
        slow, drift, rate = m.slow[on], m.drift[on], -arc.relaxation(m.slow[on])
        slope = m.moving * m.slope(number, on)
        deviation = m.moving * rows_of(m.deviation(number), on)
        steep = products(slope, slope)
        with np.errstate(divide="ignore", invalid="ignore"):
            behind = -products(deviation, slope) / steep / drift
            relaxation[on] = np.where(rate > 0, 1.0 / rate, np.nan)
        exists = (np.abs(drift) > AT_REST_SPEED * mean) & (np.sqrt(steep) * m.span > FLAT_SLOPE)
        exists &= np.abs(behind) * rate < LONGEST_LAG
        if away is not None:
            exists &= ~away[on]
        behind = np.where(exists, behind, 0.0)
        earlier, step = m.t[on] - behind, drift * behind
        inside = (earlier >= m.t[0]) & (earlier <= m.t[-1])
        before = np.where(inside, np.interp(earlier, m.t, m.slow), slow - step)
        exists &= np.abs(before - slow + step) <= UNEXPLAINED * np.abs(step)
        rest = m.moving * apart_of(rows_of(m.scaled, on), m.place(number, on, before), m.periods)
        left, whole = (np.sqrt(products(v, v)) for v in (rest, deviation))
        lag[on] = np.where(exists & (left <= UNEXPLAINED * whole), behind, np.nan)
    return distance, lag, relaxation
