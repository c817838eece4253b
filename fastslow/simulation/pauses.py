"""Compiled loops a slice at a time.

Python handles signals, Ctrl-C among them, between two instructions of its own, and compiled
code has none. So a loop returns after some hundredths of a second, and is called again to go
on from where it was, to the last bit as if it had not paused. What it needs is provided in
between: code that few runs need, and larger tables.
"""

from __future__ import annotations

import time

from fastslow.kernels.loops import load_address
from fastslow.simulation.loops import COLLOCATION, RADAU
from fastslow.simulation.stepper.driver import NEEDS_COLLOCATION, NEEDS_RADAU
from fastslow.simulation.stepper.problems import Problem

#: Seconds between two pauses, about.
SLICE = 0.02

#: Work of the first slice, in coefficients times order: it takes some hundredths of a second at
#: most, and short runs less.
FIRST = 2.0**24

#: By how much a slice may differ from the one before.
CHANGE = 4.0


class Pace:
    """How much work a loop is given at a time, from what the last took.

    Parameters
    ----------
    rows, order : int
        Of the series, on which the work of a step depends.
    """

    def __init__(self, rows: int, order: int) -> None:
        self._work = FIRST / (rows * (order + 1) ** 2)
        self._began = 0.0

    def begin(self) -> int:
        """The work of the next slice, which begins now."""
        self._began = time.perf_counter()
        return max(1, int(self._work))

    def end(self) -> None:
        """Note that a slice has been used up."""
        seconds = max(time.perf_counter() - self._began, 1e-9)
        self._work *= min(max(SLICE / seconds, 1.0 / CHANGE), CHANGE)


_addresses: dict[int, int] = {}


def with_lazy_callbacks(problem: Problem) -> Problem:
    """A problem with the addresses of its steps by collocation and of Radau, as far as known.

    A step by collocation could not be taken again for want of the other: both, then, or none.
    """
    collocation, radau = _addresses.get(NEEDS_COLLOCATION, 0), _addresses.get(NEEDS_RADAU, 0)
    collocation = collocation if radau or not problem.n_fast else 0
    if (collocation, radau) == (problem.collocation, problem.radau):
        return problem
    return problem._replace(collocation=collocation, radau=radau)


def provide(code: int, n_fast: int) -> None:
    """Compile what a loop that paused needs.

    Parameters
    ----------
    code : int
        `NEEDS_COLLOCATION` or `NEEDS_RADAU`.
    n_fast : int
        States that implicit steps may be tried for, 0 if none.
    """
    if code == NEEDS_RADAU or n_fast:
        _addresses[NEEDS_RADAU] = load_address(RADAU)
    if code == NEEDS_COLLOCATION:
        _addresses[NEEDS_COLLOCATION] = load_address(COLLOCATION)
