"""Tables of the jumps of a trajectory: resets, executions of events, and changes of switches.

A run lists all of them in one table, in order of time: time, number, and states before and after.
The numbers of resets are followed by those of events, then by two for every switch, the changes to
0 and to 1.
"""

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


class WithSwitches(WithJumps, Protocol):
    """A trajectory that also has a table of the changes of switches."""

    @property
    def event_names(self) -> tuple[str, ...]: ...

    @property
    def switch_table(self) -> NDArray[np.float64] | None: ...


def all_events(run: WithSwitches) -> NDArray[np.float64]:
    """Return resets, events and changes of switches of a run in one table, in order of time."""
    tables = [assignments_of(run)]
    if run.switch_table is not None:
        time, switch, value, *state = run.switch_table.T
        number = len(run.reset_names) + len(run.event_names) + 2 * switch + value
        tables.append(np.column_stack([time, number, *state, *state]))
    table = np.concatenate(tables)
    return np.asarray(table[np.argsort(table[:, 0], kind="stable")])


def tables_of_kinds(
    listed: NDArray[np.float64], n_resets: int, n_events: int, n_switches: int
) -> dict[str, NDArray[np.float64] | None]:
    """Return the rows of each kind as fields of a `Trajectory`, None for no such kind.

    Parameters
    ----------
    listed : ndarray, shape (m, 2 + 2 n)
        The one table of a run.
    n_resets, n_events, n_switches : int
        Numbers of resets, events and switches of the model.

    Examples
    --------
    >>> listed = np.array([[0.5, 0, 1, -1], [0.7, 3, 2, 2]])
    >>> tables_of_kinds(listed, 1, 1, 1)["switch_table"].tolist()
    [[0.7, 0.0, 1.0, 2.0]]
    """
    found: dict[str, NDArray[np.float64] | None] = dict.fromkeys(
        ("reset_table", "event_table", "switch_table")
    )
    if not (n_resets or n_events or n_switches):
        return found
    number, n_states = listed[:, 1] - n_resets, (listed.shape[1] - 2) // 2
    if n_resets:
        found["reset_table"] = listed[number < 0] if n_events or n_switches else listed
    if n_events:
        events = listed[(number >= 0) & (number < n_events)]
        events[:, 1] -= n_resets
        found["event_table"] = events
    number -= n_events
    if n_switches:
        changes, which = listed[number >= 0], number[number >= 0]
        columns = (changes[:, 0], which // 2, which % 2, changes[:, 2 : 2 + n_states])
        found["switch_table"] = np.column_stack(columns)
    return found
