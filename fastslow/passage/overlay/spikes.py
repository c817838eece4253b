"""Extrema of sampled quantities: spikes of a fast state, extrema of a forcing."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: Prominence of a spike on both sides, relative to the extent of the state.
PROMINENT = 0.1


@dataclass(frozen=True, eq=False)
class Extrema:
    """Alternating maxima and minima.

    Parameters
    ----------
    rows : ndarray of int, shape (K,)
        Sample indices.
    upper : ndarray of bool, shape (K,)
        Whether it is a maximum.
    """

    rows: NDArray[np.intp]
    upper: NDArray[np.bool_]


def extrema_of(values: Array, least: float) -> Extrema:
    """Maxima and minima between which the values change by at least ``least`` on both sides.

    The first and the last value are no extrema.

    Examples
    --------
    >>> extrema = extrema_of(np.array([0.0, 3.0, 2.9, 4.0, 0.0, 1.0]), 0.5)
    >>> extrema.rows.tolist(), extrema.upper.tolist()
    ([3, 4], [True, False])
    """
    if len(values) < 3 or not least > 0:
        return Extrema(np.empty(0, dtype=np.intp), np.empty(0, dtype=bool))
    change = np.sign(np.diff(values))
    moving = np.flatnonzero(change)
    steps = change[moving]
    bends = moving[np.flatnonzero(np.diff(steps)) + 1] if len(moving) else moving
    rows: list[int] = []
    upper: list[bool] = []
    low = high = 0
    sense = 0
    for row in (*bends.tolist(), len(values) - 1):
        value = values[row]
        if sense >= 0 and value >= values[high]:
            high = row
        if sense <= 0 and value <= values[low]:
            low = row
        if sense >= 0 and values[high] - value >= least:
            if sense > 0 or _rose(values, high, least):
                rows.append(high)
                upper.append(True)
            sense, low = -1, row
        elif sense <= 0 and value - values[low] >= least:
            if sense < 0 or _fell(values, low, least):
                rows.append(low)
                upper.append(False)
            sense, high = 1, row
    return Extrema(np.array(rows, dtype=np.intp), np.array(upper, dtype=bool))


def _rose(values: Array, row: int, least: float) -> bool:
    """Whether a sufficient rise precedes the first maximum."""
    return bool(row > 0 and values[row] - values[: row + 1].min() >= least)


def _fell(values: Array, row: int, least: float) -> bool:
    return bool(row > 0 and values[: row + 1].max() - values[row] >= least)


def refined(time: Array, values: Array, rows: NDArray[np.intp]) -> Array:
    """Times of extrema by the parabola through each sample and its neighbours.

    Examples
    --------
    >>> t = np.linspace(0, 3, 31)
    >>> refined(t, -((t - 1.234) ** 2), np.array([12])).round(12)
    array([1.234])
    """
    rows = np.clip(rows, 1, len(time) - 2)
    t, v = (np.array([a[rows + k] for k in (-1, 0, 1)]) for a in (time, values))
    with np.errstate(divide="ignore", invalid="ignore"):
        first, second = (v[1] - v[0]) / (t[1] - t[0]), (v[2] - v[1]) / (t[2] - t[1])
        bend = (second - first) / (t[2] - t[0])
        top = 0.5 * (t[0] + t[1]) - first / (2 * bend)
    return np.asarray(np.where(np.isfinite(top), np.clip(top, t[0], t[2]), t[1]))
