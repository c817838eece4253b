"""What a run is between two steps, and the memory that its steps work in."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from fastslow.simulation.collocation import memory_size
from fastslow.simulation.implicit_steps import WAIT, Q
from fastslow.simulation.radau import carried_size
from fastslow.simulation.scales import FIXED

#: Numbers carried from step to step: by how much the time is late, the usual length of a
#: step, the time of the last event; the length that an implicit step tries first, and that
#: of the series at the last one; depth and rounding error of h at the last event. From then on
#: the sizes that the run has reached.
LATE, USUAL, LAST_EVENT, WANTED, LONGEST, DEPTH, FLOOR, SIZES = range(8)

#: Whole numbers carried: steps, crossings and samples so far, crossings crowded
#: together, the mode, -1 before the first was chosen, steps until an implicit one is
#: tried, and how many to wait for should it fail. Then what only a run that paused goes on
#: from: that it did, how many implicit steps in a row, the interface of the last event,
#: whether it was touched, whether a mode is to be chosen, and whether it has just been. Last
#: the work that is left before the next pause.
(
    STEPS, CROSSINGS, SAMPLES, CROWDED, MODE, CALM, PAUSE,
    PAUSED, IN_A_ROW, INTERFACE, TOUCHED, CHOOSING, FRESH, WORK,
) = range(14)  # fmt: skip

#: Work of a step by collocation, and of an attempt at an implicit one with one fast state, in
#: units of a step of the series.
COLLOCATED_WORK, IMPLICIT_WORK = 50, 4


def beginnings(
    times: NDArray[np.float64],
    states: NDArray[np.float64],
    n_forcing: int,
    rules: NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.int64]]:
    """What `drive` carries from step to step, of several runs at their beginnings.

    Parameters
    ----------
    times : ndarray, shape (m,)
    states : ndarray, shape (m, n)
    n_forcing : int
    rules : ndarray, shape (2, rows)

    Returns
    -------
    places : ndarray, shape (m, 1 + n + n_forcing)
        Times, states, and room for the slow quantities.
    carried : ndarray, shape (m, SIZES + rows)
    counted : ndarray of int64, shape (m, 14)
    """
    m = len(times)
    places = np.column_stack([times, states, np.zeros((m, n_forcing))])
    carried = np.zeros((m, SIZES + rules.shape[1]))
    carried[:, SIZES:] = rules[FIXED]
    carried[:, LAST_EVENT] = -np.inf
    counted = np.zeros((m, WORK + 1), dtype=np.int64)
    counted[:, MODE] = -1
    counted[:, [CALM, PAUSE]] = WAIT
    return places, carried, counted


def room_for(
    layout: tuple[int, int, int, int, int], sizes: tuple[int, int, int], n_times: int
) -> tuple[NDArray[Any], ...]:
    """Work space of `drive`, for one run after the other; one that paused goes on in its own."""
    n_states, n_forcing, n_interfaces, _, order = layout
    columns = order + 1
    settling = sizes[0] * columns if sizes[2] > 0 else 0
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
        np.empty(settling),
        np.empty(settling),
        np.empty((2 + Q, n_states, n_states + 1)),
        np.empty((6, max(1 + n_states + n_forcing, columns))),
        np.zeros(memory_size(n_states, order)),
        np.zeros((2, n_states + n_forcing + n_interfaces)),
        np.zeros(carried_size(n_states)),
    )
