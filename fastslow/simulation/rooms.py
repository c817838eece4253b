"""What a run is between two steps, and the memory that its steps work in."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from fastslow.compiled.parts import part

#: Numbers carried from step to step: by how much the time is late, the usual length of a
#: step, the time of the last event.
LATE, USUAL, LAST_EVENT = 0, 1, 2

#: Whole numbers carried: steps, crossings and samples so far, crossings crowded
#: together, and the mode, -1 before the first was chosen.
STEPS, CROSSINGS, SAMPLES, CROWDED, MODE = 0, 1, 2, 3, 4


def beginnings(
    times: NDArray[np.float64], states: NDArray[np.float64], n_forcing: int
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.int64]]:
    """What `drive` carries from step to step, of several runs at their beginnings.

    Parameters
    ----------
    times : ndarray, shape (m,)
    states : ndarray, shape (m, n)
    n_forcing : int

    Returns
    -------
    places : ndarray, shape (m, 1 + n + n_forcing)
        Times, states, and room for the slow quantities.
    carried : ndarray, shape (m, 3)
    counted : ndarray of int64, shape (m, 5)
    """
    m = len(times)
    places = np.column_stack([times, states, np.zeros((m, n_forcing))])
    carried = np.zeros((m, 3))
    carried[:, LAST_EVENT] = -np.inf
    counted = np.zeros((m, 5), dtype=np.int64)
    counted[:, MODE] = -1
    return places, carried, counted


def room_for(
    layout: tuple[int, int, int, int, int], sizes: tuple[int, int], n_times: int
) -> tuple[NDArray[Any], ...]:
    """Work space of `drive`, for one run after the other."""
    n_states, _, n_interfaces, _, order = layout
    columns = order + 1
    return (
        np.empty(sizes[0] * columns),
        np.empty(sizes[0] * columns),
        np.empty(columns),
        np.empty(columns),
        np.empty((sizes[1], columns + 3)),
        np.empty(2 + n_states),
        np.empty(n_interfaces),
        np.empty(n_interfaces, dtype=np.bool_),
        np.empty(n_interfaces, dtype=np.bool_),
        np.empty(n_interfaces, dtype=np.bool_),
        np.empty(n_interfaces, dtype=np.int64),
        np.empty(n_times),
    )


@part
def grown(array):
    """A copy with room for twice as many rows."""
    larger = np.empty((2 * array.shape[0] + 16, array.shape[1]))
    for i in range(array.shape[0]):
        for j in range(array.shape[1]):
            larger[i, j] = array[i, j]
    return larger
