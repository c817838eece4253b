"""State of a run between two steps, and the work space of its steps."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fastslow.kernels.compiler.records import Matrix, Vector, zeros
from fastslow.simulation.stepper.collocation import Collocation, collocation_for
from fastslow.simulation.stepper.events import Search, search_for
from fastslow.simulation.stepper.implicit import WAIT, Implicit, implicit_for
from fastslow.simulation.stepper.problems import Problem
from fastslow.simulation.stepper.scales import FIXED

#: Real numbers carried from step to step: compensation of the time, usual step length, time
#: of the last event; first length of the next implicit step, length of the series at the last
#: one; depth and rounding error of h at the last event, and rate of h at the last wall; then the
#: recent maxima of the run, and the memory of chattering.
LATE, USUAL, LAST_EVENT, WANTED, LONGEST, DEPTH, FLOOR, SPEED, SIZES = range(9)

#: Integers carried: numbers of steps, crossings and samples, crossings in immediate
#: succession, the mode (-1 before the first), steps until the next implicit attempt, and the
#: wait after a failed one. Then, for a run that paused: the flag of the pause, consecutive
#: implicit steps, the interface of the last event (without a pause, the interface crossed
#: and still to be left, else -1), whether it was touched, whether a mode is to be selected,
#: and whether one has just been. Last the work left before the next pause, the number of
#: resets, the wall of the last one at this time, and whether the state has jumped at this time.
(
    STEPS, CROSSINGS, SAMPLES, CROWDED, MODE, CALM, PAUSE,
    PAUSED, IN_A_ROW, INTERFACE, TOUCHED, CHOOSING, FRESH, WORK, RESETS, APPLIED, JUMPED,
) = range(17)  # fmt: skip

#: Work of a collocation step, and of an implicit attempt with one fast state, in units of a
#: series step.
COLLOCATED_WORK, IMPLICIT_WORK = 50, 4


#: Samples evaluated at a time, a multiple of the SIMD width.
_SAMPLES_AT_A_TIME = 256


def beginnings(
    times: NDArray[np.float64],
    states: NDArray[np.float64],
    n_forcing: int,
    rules: NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.int64]]:
    """Initial values of the state that `integrate` carries from step to step, for several runs.

    Parameters
    ----------
    times : ndarray, shape (m,)
    states : ndarray, shape (m, n)
    n_forcing : int
    rules : ndarray, shape (2, rows)

    Returns
    -------
    places : ndarray, shape (m, 1 + n + n_forcing)
        Times, states, and space for the slow quantities.
    carried : ndarray, shape (m, SIZES + rows + 2 + n)
    counted : ndarray of int64, shape (m, 17)
    """
    m, rows = len(times), rules.shape[1]
    places = np.column_stack([times, states, np.zeros((m, n_forcing))])
    carried = np.zeros((m, SIZES + rows + 2 + states.shape[1]))
    carried[:, SIZES : SIZES + rows] = rules[FIXED]
    carried[:, LAST_EVENT] = -np.inf
    counted = np.zeros((m, JUMPED + 1), dtype=np.int64)
    counted[:, [MODE, INTERFACE, APPLIED]] = -1
    counted[:, [CALM, PAUSE]] = WAIT
    return places, carried, counted


class Workspace(NamedTuple):
    """Work space of `integrate`, reused by consecutive runs; a paused run keeps its own.

    Parameters
    ----------
    W, work : float64 arrays
        Same size as the series.
    offsets : float64 array
        Offsets of samples within a step.
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
    """Allocate the work space for runs of a problem whose series has ``n_rows`` rows."""
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
