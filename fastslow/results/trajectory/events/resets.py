"""Resets of a trajectory: jumps of the state with the states before and after."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fastslow.results.base.immutable import Immutable
from fastslow.results.trajectory.events.jumps import JumpTable


@dataclass(frozen=True, eq=False, repr=False)
class ResetEvent(Immutable):
    """A reset of a trajectory.

    Parameters
    ----------
    time : float
    before, after : ndarray, shape (n,)
        States and slow states. After the last reset of a completed chatter the state is at
        rest on the wall; for the time of the flights that are not computed, velocities of the
        run are right up to r v, where v is the speed before this reset.
    reset : str
        Its relation, a name in ``model.resets``.
    """

    time: float
    before: NDArray[np.float64]
    after: NDArray[np.float64]
    reset: str

    def __repr__(self) -> str:
        return f"ResetEvent(t = {self.time:.9g}, {self.reset})"


class Resets(JumpTable[ResetEvent]):
    """Resets in order of time, as a table.

    ``run.resets("x >= sigma")`` selects those of one relation.

    Parameters
    ----------
    items : iterable of ResetEvent
    names, states : tuple of str
        The resets of the model, and its states with slow states.
    """

    _kind = "reset"
