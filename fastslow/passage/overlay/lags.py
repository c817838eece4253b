"""The time by which a run lags behind a moving attractor, to first order."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fastslow.passage.overlay.following import products

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

#: Relative change over the slow range, in units of the extent, below which a branch is flat.
FLAT_SLOPE = 1e-9

#: Largest unexplained fraction of a deviation that is attributed to a lag, and of the change
#: during the lag that is attributed to a constant drift.
UNEXPLAINED = 0.5

#: Lag, in relaxation times, above which the state has not yet relaxed.
LONGEST_LAG = 2.0

#: Fraction of the mean speed below which the slow quantity is at rest.
AT_REST_SPEED = 1e-3


@dataclass(frozen=True, eq=False)
class Lag:
    """Lags of some samples behind an arc of attractors.

    Parameters
    ----------
    behind : ndarray, shape (N,)
        The lag, by which the deviation along the arc is that of the attractor.
    exists : ndarray of bool, shape (N,)
        Whether arc and slow quantity move, and the state has had the time to relax.
    relaxation : ndarray, shape (N,)
        Relaxation time; nan where the attractor is not stable.
    """

    behind: Array
    exists: Mask
    relaxation: Array


def mean_speed(t: Array, slow: Array) -> float:
    """Mean modulus of the rate of the slow quantity over a run."""
    return float(np.abs(np.diff(slow)).sum()) / (float(t[-1] - t[0]) or 1.0)


def lag_behind(
    deviation: Array, slope: Array, drift: Array, rate: Array, *, span: float, mean: float
) -> Lag:
    """Compute the lag that solves X(w(t − lag)) ≈ x(t) to first order.

    Parameters
    ----------
    deviation : ndarray, shape (N, n)
        Of the states from the attractors at the same values of the slow quantity, scaled.
    slope : ndarray, shape (N, n)
        Derivative of the attractors by the slow quantity, scaled.
    drift : ndarray, shape (N,)
        Rate of the slow quantity.
    rate : ndarray, shape (N,)
        Rate at which perturbations decay.
    span, mean : float
        Range of the slow quantity in the run, and its mean speed.
    """
    steep = products(slope, slope)
    with np.errstate(divide="ignore", invalid="ignore"):
        behind = -products(deviation, slope) / steep / drift
        relaxation = np.where(rate > 0, 1.0 / rate, np.nan)
    exists = (np.abs(drift) > AT_REST_SPEED * mean) & (np.sqrt(steep) * span > FLAT_SLOPE)
    exists &= np.abs(behind) * rate < LONGEST_LAG
    return Lag(behind, exists, relaxation)


def explained(rest: Array, deviation: Array) -> Mask:
    """Whether the deviation from an earlier attractor is much smaller than the present one."""
    left, whole = (np.sqrt(products(v, v)) for v in (rest, deviation))
    found: Mask = left <= UNEXPLAINED * whole
    return found
