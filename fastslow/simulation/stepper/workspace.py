"""What a run is between two steps, and the memory that its steps work in."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fastslow.kernels.records import Matrix, Vector, zeros
from fastslow.simulation.stepper.collocation import Collocation, collocation_for
from fastslow.simulation.stepper.events import Search, search_for
from fastslow.simulation.stepper.implicit import WAIT, Implicit, implicit_for
from fastslow.simulation.stepper.problems import Problem
from fastslow.simulation.stepper.scales import FIXED

#: Numbers carried from step to step: by how much the time is late, the usual length of a
#: step, the time of the last event; the length that an implicit step tries first, and that
#: of the series at the last one; depth and rounding error of h at the last event. From then on
#: the sizes that the run has reached.
LATE, USUAL, LAST_EVENT, WANTED, LONGEST, DEPTH, FLOOR, SIZES = range(8)

#: Whole numbers carried: steps, crossings and samples so far, crossings crowded
#: together, the mode, -1 before the first was chosen, steps until an implicit one is
#: tried, and how many to wait for should it fail. Then what only a run that paused goes on
#: from: that it did, how many implicit steps in a row, the interface of the last event (of one
#: that did not pause, the one that it has crossed and is to leave, else -1),
#: whether it was touched, whether a mode is to be chosen, and whether it has just been. Last
#: the work that is left before the next pause.
(
    STEPS, CROSSINGS, SAMPLES, CROWDED, MODE, CALM, PAUSE,
    PAUSED, IN_A_ROW, INTERFACE, TOUCHED, CHOOSING, FRESH, WORK,
) = range(14)  # fmt: skip

#: Work of a step by collocation, and of an attempt at an implicit one with one fast state, in
#: units of a step of the series.
COLLOCATED_WORK, IMPLICIT_WORK = 50, 4


#: Samples that are taken at a time, a multiple of those that one instruction takes.
_SAMPLES_AT_A_TIME = 256


def beginnings(
    times: NDArray[np.float64],
    states: NDArray[np.float64],
    n_forcing: int,
    rules: NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.int64]]:
    """What `integrate` carries from step to step, of several runs at their beginnings.

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
    counted[:, [MODE, INTERFACE]] = -1
    counted[:, [CALM, PAUSE]] = WAIT
    return places, carried, counted


class Workspace(NamedTuple):
    """Work space of `integrate`, for one run after the other; one that paused goes on in its own.

    Parameters
    ----------
    W, work : float64 arrays
        As large as the series.
    offsets : float64 array
        Of samples within a step, some at a time.
    scales : float64 array, shape (2, n_states + n_forcing + n_interfaces)
    search : Search
    collocation : Collocation
    implicit : Implicit
    """

    W: Vector
    work: Vector
    offsets: Vector
    scales: Matrix
    search: Search
    collocation: Collocation
    implicit: Implicit


def workspace_for(problem: Problem, n_rows: int) -> Workspace:
    """Work space for runs of a problem, whose series fills so many rows."""
    n, forcing, interfaces = problem.n_states, problem.n_forcing, problem.n_interfaces
    size = n_rows * (problem.order + 1)
    fast = problem.n_fast > 0
    return zeros(
        Workspace,
        *(size, size),
        _SAMPLES_AT_A_TIME,
        (2, n + forcing + interfaces),
        search_for(n, forcing, interfaces, problem.order),
        collocation_for(n, forcing, interfaces, problem.order, n_rows),
        # states without a fast one take no such steps
        implicit_for(n if fast else 0, forcing, interfaces, size if fast else 0),
    )
