"""What a run is between two steps, and the memory that its steps work in."""

from __future__ import annotations

import numpy as np

from fastslow.compiled.parts import part
from fastslow.simulation.collocation import memory_size
from fastslow.simulation.settled import WAIT

#: Numbers carried from step to step: by how much the time is late, the usual length of a
#: step, the time of the last event.
LATE, USUAL, LAST_EVENT = 0, 1, 2
CARRIED = 3

#: Whole numbers carried: steps, crossings and samples so far, crossings crowded
#: together, the mode, -1 before the first was chosen, steps until an implicit one is
#: tried, and how many to wait for should it fail.
STEPS, CROSSINGS, SAMPLES, CROWDED, MODE, CALM, PAUSE = 0, 1, 2, 3, 4, 5, 6
COUNTED = 7


@part
def put_at_start(place, carried, counted, time, state):
    """Put a run at its beginning: time and state, and what is carried from step to step."""
    place[0] = time
    for i in range(state.shape[0]):
        place[1 + i] = state[i]
    carried[LATE], carried[USUAL], carried[LAST_EVENT] = 0.0, 0.0, -np.inf
    for i in range(COUNTED):
        counted[i] = 0
    counted[MODE] = -1
    counted[CALM] = counted[PAUSE] = WAIT


@part
def room_for(layout, sizes, n_times):
    """Work space of a run; nothing in it outlasts a step but what the next one is told."""
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
        np.empty((2, n_states, n_states + 1)),
        np.empty((5, max(1 + n_states + n_forcing, columns))),
        np.zeros(memory_size(n_states, order)),
    )


@part
def grown(array):
    """A copy with room for twice as many rows."""
    larger = np.empty((2 * array.shape[0] + 16, array.shape[1]))
    for i in range(array.shape[0]):
        for j in range(array.shape[1]):
            larger[i, j] = array[i, j]
    return larger
