"""Periodic states: principal range, nearest copies and differences modulo a period."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]


def periods_of(states: Sequence[str], periods: Mapping[str, float]) -> Array:
    """Return the period of every state, 0 without one, shape (n,)."""
    return np.array([float(periods.get(name, 0.0)) for name in states])


def principal(values: ArrayLike, periods: ArrayLike) -> Array:
    """Reduce values to the principal range (−P/2, P/2]; a period of 0 leaves them unchanged.

    Examples
    --------
    >>> principal([-3.0, 2.0, 7.0], 4.0).tolist()
    [1.0, 2.0, -1.0]
    """
    x, period = np.asarray(values, dtype=float), np.asarray(periods, dtype=float)
    safe = np.where(period > 0, period, 1.0)
    return np.where(period > 0, x - safe * np.ceil(x / safe - 0.5), x)


def nearest_copy(values: ArrayLike, target: ArrayLike, periods: ArrayLike) -> Array:
    """Shift values by whole periods to the copies nearest to a target.

    Examples
    --------
    >>> nearest_copy([0.5, 3.5], 10.0, 4.0).tolist()
    [8.5, 11.5]
    """
    x, period = np.asarray(values, dtype=float), np.asarray(periods, dtype=float)
    safe = np.where(period > 0, period, 1.0)
    return np.where(period > 0, x + safe * np.round((target - x) / safe), x)


def apart(one: ArrayLike, other: ArrayLike, periods: ArrayLike) -> Array:
    """Return the difference of two states modulo the periods."""
    difference = np.asarray(one, dtype=float) - np.asarray(other, dtype=float)
    return nearest_copy(difference, 0.0, periods) if np.any(periods) else difference


def copies(value: float, low: float, high: float, period: float) -> list[float]:
    """Return the copies of a value within a range, and one more on either side.

    Examples
    --------
    >>> copies(0.5, 0.0, 9.0, 4.0), copies(0.5, 0.0, 9.0, 0.0)
    ([-3.5, 0.5, 4.5, 8.5, 12.5], [0.5])
    """
    if period == 0:
        return [value]
    first = int(np.ceil((low - value) / period)) - 1
    last = int(np.floor((high - value) / period)) + 1
    return [value + k * period for k in range(first, last + 1)]
