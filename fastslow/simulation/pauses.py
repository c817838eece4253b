"""Execution of compiled loops in time slices.

Python handles signals such as Ctrl-C only between its own instructions. A compiled loop
therefore returns after some hundredths of a second and is called again, with bitwise the same
result as without the pause. In between, code that few runs need is loaded and tables are
enlarged.
"""

from __future__ import annotations

import time

from fastslow.kernels.loops import load_address
from fastslow.simulation.loops import COLLOCATION, RADAU
from fastslow.simulation.stepper.phases import NEEDS_COLLOCATION, NEEDS_RADAU
from fastslow.simulation.stepper.problems import Problem

#: Approximate time between two pauses, in seconds.
SLICE = 0.02

#: Work of the first slice, in coefficients times order: at most some hundredths of a second.
FIRST_SLICE_WORK = 2.0**24

#: Maximum ratio of consecutive slices.
CHANGE = 4.0


class Pace:
    """Work quota of a loop, adapted to the duration of the last slice.

    Parameters
    ----------
    rows, order : int
        Size of the series, on which the work of a step depends.
    """

    def __init__(self, rows: int, order: int) -> None:
        self._work = FIRST_SLICE_WORK / (rows * (order + 1) ** 2)
        self._began = 0.0

    def begin(self) -> int:
        """Start a slice and return its work quota."""
        self._began = time.perf_counter()
        return max(1, int(self._work))

    def end(self) -> None:
        """Adapt the quota after a slice that was used up."""
        seconds = max(time.perf_counter() - self._began, 1e-9)
        self._work *= min(max(SLICE / seconds, 1.0 / CHANGE), CHANGE)


_addresses: dict[int, int] = {}


def with_lazy_callbacks(problem: Problem) -> Problem:
    """A problem with the addresses of its collocation and Radau steps, as far as loaded.

    A collocation step cannot be repeated if Radau steps are missing: both are set, or none.
    """
    collocation, radau = _addresses.get(NEEDS_COLLOCATION, 0), _addresses.get(NEEDS_RADAU, 0)
    collocation = collocation if radau or not problem.n_fast else 0
    if (collocation, radau) == (problem.collocation, problem.radau):
        return problem
    return problem._replace(collocation=collocation, radau=radau)


def provide(code: int, n_fast: int) -> None:
    """Load the code that a paused loop needs.

    Parameters
    ----------
    code : int
        `NEEDS_COLLOCATION` or `NEEDS_RADAU`.
    n_fast : int
        Number of states with implicit steps, 0 for none.
    """
    if code == NEEDS_RADAU or n_fast:
        _addresses[NEEDS_RADAU] = load_address(RADAU)
    if code == NEEDS_COLLOCATION:
        _addresses[NEEDS_COLLOCATION] = load_address(COLLOCATION)
