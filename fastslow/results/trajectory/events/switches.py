"""Changes of the switches of a trajectory."""

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
class SwitchEvent(Immutable):
    """A change of a switch of a trajectory.

    Parameters
    ----------
    time : float
    switch : str
        Its name.
    value : int
        The new value, 0 or 1.
    state : ndarray, shape (n,)
        States and slow states.
    """

    time: float
    switch: str
    value: int
    state: NDArray[np.float64]

    def __repr__(self) -> str:
        return f"SwitchEvent(t = {self.time:.9g}, {self.switch} = {self.value})"


class Switches(EventTable[SwitchEvent]):
    """Changes of switches in order of time, as a table.

    ``run.switches("q")`` selects those of one switch, ``run.switches("q", value=1)`` those to 1.

    Parameters
    ----------
    items : iterable of SwitchEvent
    names, states : tuple of str
        The switches of the model, and its states with slow states.
    """

    def _words(self) -> Mapping[str, Collection[Any]]:
        return {"switch": self.names}

    def to_dict(self) -> dict[str, NDArray[Any]]:
        """Return time t, switch, its new value, and the states."""
        table = np.array([s.state for s in self], dtype=float).reshape(-1, len(self.states))
        return {
            "t": np.array([s.time for s in self], dtype=float),
            "switch": np.array([s.switch for s in self], dtype=str),
            "value": np.array([s.value for s in self], dtype=np.int64),
            **dict(zip(self.states, table.T, strict=True)),
        }

    def _heading(self) -> str:
        return f"{len(self)} change{'' if len(self) == 1 else 's'} of switches"

    def _cells(self) -> Cells:
        rows = [
            (f"{s.time:.9g}", s.switch, f"{s.value}", *(f"{v:.6g}" for v in s.state))
            for s in self[:HTML_ROWS]
        ]
        return Cells(["t", "switch", "value", *self.states], rows, len(self))

    def __call__(self, switch: object, *, value: int | None = None) -> Switches:
        """Select the changes of one switch, or those to one value.

        Raises
        ------
        UnknownNameError
            For a name that is no switch of the model.
        """
        if str(switch) not in self.names:
            raise unknown_name("switch", switch, self.names)
        kept = (s for s in self if s.switch == str(switch) and value in (None, s.value))
        return Switches(kept, **self._attributes())
