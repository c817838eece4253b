"""State of a run between two steps, and the work space of its steps."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fastslow.kernels.compiler.records import Matrix, Vector, zeros
from fastslow.simulation.stepper.collocation import Collocation, collocation_for
from fastslow.simulation.stepper.event_location import EventSearch, search_for
from fastslow.simulation.stepper.implicit import WAIT, Implicit, implicit_for
from fastslow.simulation.stepper.problems import Problem
from fastslow.simulation.stepper.scales import FIXED

#: Places of the real numbers carried from phase to phase, `Run.carried`.
(
    # part of the time reached that the floating-point time has lost to rounding
    LATE,
    # usual length of a step, beyond which its end is checked
    USUAL,
    # time of the last event
    LAST_EVENT,
    # length of the first attempt of the next implicit step
    WANTED,
    # length on which the last series is valid
    LONGEST,
    # relative change of h that would have removed the last event
    DEPTH,
    # rounding error of h at the last event
    FLOOR,
    # rate of h at the last wall or switch
    SPEED,
    # time at which the next step ends at the latest: the next instant, or the end of the run
    UNTIL,
    # length of the step that is being taken
    STEP_LENGTH,
    # from here on the recent maxima of the run, and then the memory of chattering and of events
    SIZES,
) = range(11)

#: Places of the integers and flags carried from phase to phase, `Run.counted`.
(
    # number of steps
    STEPS,
    # number of crossings
    CROSSINGS,
    # number of samples
    SAMPLES,
    # number of resets, events and changes of switches
    RESETS,
    # events in immediate succession
    CROWDED,
    # the motion of the run, -1 before the first one
    MODE,
    # the motion that is selected to follow it
    NEXT_MODE,
    # steps until the next attempt of an implicit step
    CALM,
    # steps that it waits after a failure
    PAUSE,
    # consecutive implicit steps
    IN_A_ROW,
    # work left before the next pause
    WORK,
    # whether the run has paused, and is to be resumed with the same work space
    PAUSED,
    # the interface of the last event, -1 for none; after a hand-over the one still to be left, and
    # after a failed reset the row of what failed
    INTERFACE,
    # whether the last event touched its interface without crossing it
    TOUCHED,
    # whether a motion is to be selected before the next step
    CHOOSING,
    # whether a motion has been selected since the last step
    FRESH,
    # the wall, switch or inequality that becomes true, to be applied next, -1 for none
    DUE,
    # the wall whose reset was the last one applied at this time, -1 for none
    APPLIED,
    # whether the state, or the slow quantities, have jumped at this time
    JUMPED,
    # whether a motion at rest is decided anew, as it has crossed an interface
    ANEW,
    # whether the series in the work space is that of the selected motion
    AHEAD,
    # whether the error scales were raised for this step, to be lowered if it is repeated
    RAISED,
    # whether the step that is being taken ends at `UNTIL`
    FINAL,
    # whether the step that is being taken is implicit
    LONG,
    # the motion that is proposed where none of those formed so far is known to continue,
    # `UNPROPOSED`, or `NOT_FORMED`
    PROPOSED,
    # the wall at which a motion at rest is needed that is not formed, -1 for none
    RESTING,
    # the phase in which a paused run goes on, 0 for the beginning of a step
    RESUMED,
    # number of these places
    INTEGERS,
) = range(28)

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
    events: int,
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.int64]]:
    """Initial values of the state that `integrate` carries from step to step, for several runs.

    Parameters
    ----------
    times : ndarray, shape (m,)
    states : ndarray, shape (m, n)
    n_forcing : int
    rules : ndarray, shape (2, rows)
    events : int
        Size of the memory of events.

    Returns
    -------
    places : ndarray, shape (m, 1 + n + n_forcing)
        Times, states, and space for the slow quantities.
    carried : ndarray, shape (m, SIZES + rows + 2 + n + events)
    counted : ndarray of int64, shape (m, INTEGERS)
    """
    m, rows = len(times), rules.shape[1]
    places = np.column_stack([times, states, np.zeros((m, n_forcing))])
    carried = np.zeros((m, SIZES + rows + 2 + states.shape[1] + events))
    carried[:, SIZES : SIZES + rows] = rules[FIXED]
    carried[:, LAST_EVENT] = -np.inf
    counted = np.zeros((m, INTEGERS), dtype=np.int64)
    counted[:, [MODE, INTERFACE, APPLIED, PROPOSED, RESTING]] = -1
    counted[:, [CALM, PAUSE]] = WAIT
    return places, carried, counted


class StepWorkspace(NamedTuple):
    """Work space of `integrate`, reused by consecutive runs; a paused run keeps its own.

    Parameters
    ----------
    W, work : float64 arrays
        Same size as the series.
    offsets : float64 array
        Offsets of samples within a step.
    scales : float64 array, shape (2, n_states + n_forcing + n_interfaces)
    search : EventSearch
    collocation : Collocation
    implicit : Implicit
    """

    W: Vector
    work: Vector
    offsets: Vector
    scales: Matrix
    search: EventSearch
    collocation: Collocation
    implicit: Implicit


def workspace_for(problem: Problem, n_rows: int) -> StepWorkspace:
    """Allocate the work space for runs of a problem whose series has ``n_rows`` rows."""
    n, forcing, interfaces = problem.n_states, problem.n_forcing, problem.n_interfaces
    size = n_rows * (problem.order + 1)
    fast = problem.n_fast > 0
    return zeros(
        StepWorkspace,
        *(size, size),
        _SAMPLES_AT_A_TIME,
        (2, n + forcing + interfaces),
        search_for(n, forcing, interfaces, problem.order),
        collocation_for(n, forcing, interfaces, problem.order, n_rows),
        # states without a fast one take no such steps
        implicit_for(
            n if fast else 0,
            forcing,
            interfaces,
            size if fast else 0,
            problem.saturating.shape[1],
        ),
    )
