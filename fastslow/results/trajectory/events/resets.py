"""Resets of a trajectory: jumps of the state with the states before and after."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fastslow.errors import unknown_name
from fastslow.results.base.html import HTML_ROWS, Cells
from fastslow.results.base.immutable import Immutable
from fastslow.results.trajectory.events.event_table import EventTable


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


class Resets(EventTable[ResetEvent]):
    """Resets in order of time, as a table.

    ``run.resets("x >= sigma")`` selects those of one relation.

    Parameters
    ----------
    items : iterable of ResetEvent
    names, states : tuple of str
        The resets of the model, and its states with slow states.
    """

    def _words(self) -> Mapping[str, Collection[Any]]:
        return {"reset": self.names}

    def to_dict(self) -> dict[str, NDArray[Any]]:
        """Return time t, the states before and after (``x_before``, ``x_after``), and reset."""
        columns: dict[str, NDArray[Any]] = {"t": np.array([r.time for r in self], dtype=float)}
        for when in ("before", "after"):
            table = np.array([getattr(r, when) for r in self], dtype=float)
            table = table.reshape(-1, len(self.states))
            columns |= {
                f"{n}_{when}": column for n, column in zip(self.states, table.T, strict=True)
            }
        return {**columns, "reset": np.array([r.reset for r in self], dtype=str)}

    def _heading(self) -> str:
        return f"{len(self)} reset{'' if len(self) == 1 else 's'}"

    def _cells(self) -> Cells:
        head = ["t", *(f"{n} {w}" for w in ("before", "after") for n in self.states), "reset"]
        rows = [
            (f"{r.time:.9g}", *(f"{v:.6g}" for v in (*r.before, *r.after)), r.reset)
            for r in self[:HTML_ROWS]
        ]
        return Cells(head, rows, len(self))

    def __call__(self, reset: object) -> Resets:
        """Select the resets of one relation.

        Raises
        ------
        UnknownNameError
            For a relation that is no reset of the model.
        """
        if str(reset) not in self.names:
            raise unknown_name("reset", reset, self.names)
        kept = (one for one in self if one.reset == str(reset))
        return Resets(kept, **self._attributes())
