"""Executions of the events of a trajectory, with the states before and after."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fastslow.results.base.immutable import Immutable
from fastslow.results.trajectory.events.jumps import JumpTable


@dataclass(frozen=True, eq=False, repr=False)
class Occurrence(Immutable):
    """The execution of an event of a trajectory.

    Parameters
    ----------
    time : float
        Of the execution, that is, after any delay.
    before, after : ndarray, shape (n,)
        States, slow states and parameters that events assign.
    event : str
        A name in ``model.events``.
    """

    time: float
    before: NDArray[np.float64]
    after: NDArray[np.float64]
    event: str

    def __repr__(self) -> str:
        return f"Occurrence(t = {self.time:.9g}, {self.event})"


class Occurrences(JumpTable[Occurrence]):
    """Executions of events in order of time, as a table.

    ``run.events("spike")`` selects those of one event.

    Parameters
    ----------
    items : iterable of Occurrence
    names, states : tuple of str
        The events of the model, and the columns that they may change.
    """

    _kind = "event"
