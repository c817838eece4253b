"""Tables of the jumps of a trajectory: resets, and executions of events."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import Any, ClassVar, Protocol, Self, TypeVar

import numpy as np
from numpy.typing import NDArray

from fastslow.errors import unknown_name
from fastslow.results.base.html import HTML_ROWS, Cells
from fastslow.results.trajectory.events.event_table import EventTable


class Jump(Protocol):
    """A jump of the state."""

    @property
    def time(self) -> float: ...

    @property
    def before(self) -> NDArray[np.float64]: ...

    @property
    def after(self) -> NDArray[np.float64]: ...


J = TypeVar("J", bound=Jump)


class JumpTable(EventTable[J]):
    """Jumps in order of time, as a table; each has its name in a field of that name."""

    _kind: ClassVar[str]

    def _words(self) -> Mapping[str, Collection[Any]]:
        return {self._kind: self.names}

    def to_dict(self) -> dict[str, NDArray[Any]]:
        """Return time t, the states before and after (``x_before``, ``x_after``), and the name."""
        columns: dict[str, NDArray[Any]] = {"t": np.array([r.time for r in self], dtype=float)}
        for when in ("before", "after"):
            table = np.array([getattr(r, when) for r in self], dtype=float)
            table = table.reshape(-1, len(self.states))
            columns |= {
                f"{n}_{when}": column for n, column in zip(self.states, table.T, strict=True)
            }
        return {**columns, self._kind: np.array([getattr(r, self._kind) for r in self], dtype=str)}

    def _heading(self) -> str:
        return f"{len(self)} {self._kind}{'' if len(self) == 1 else 's'}"

    def _cells(self) -> Cells:
        head = ["t", *(f"{n} {w}" for w in ("before", "after") for n in self.states), self._kind]
        rows = [
            (
                f"{r.time:.9g}",
                *(f"{v:.6g}" for v in (*r.before, *r.after)),
                getattr(r, self._kind),
            )
            for r in self[:HTML_ROWS]
        ]
        return Cells(head, rows, len(self))

    def __call__(self, name: object) -> Self:
        """Select the jumps of one name.

        Raises
        ------
        UnknownNameError
            For a name that the model does not have.
        """
        if str(name) not in self.names:
            raise unknown_name(self._kind, name, self.names)
        kept = (one for one in self if getattr(one, self._kind) == str(name))
        return type(self)(kept, **self._attributes())


class WithJumps(Protocol):
    """A trajectory with tables of its resets and events."""

    @property
    def states(self) -> tuple[str, ...]: ...

    @property
    def reset_names(self) -> tuple[str, ...]: ...

    @property
    def reset_table(self) -> NDArray[np.float64] | None: ...

    @property
    def event_table(self) -> NDArray[np.float64] | None: ...


def assignments_of(run: WithJumps) -> NDArray[np.float64]:
    """Return the resets and executed events of a run, in order of time.

    The rows are those of its ``reset_table``; events are numbered after the resets.
    """
    tables = [np.zeros((0, 2 + 2 * len(run.states)))]
    if run.reset_table is not None:
        tables.append(run.reset_table)
    if run.event_table is not None:
        time, event, *states = run.event_table.T
        tables.append(np.column_stack([time, len(run.reset_names) + event, *states]))
    table = np.concatenate(tables)
    return np.asarray(table[np.argsort(table[:, 0], kind="stable")])
