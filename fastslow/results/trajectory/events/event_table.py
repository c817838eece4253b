"""Tables of the events of a trajectory that have names in its model."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Self, TypeVar

from fastslow.results.base.table import ResultTable

E = TypeVar("E")


class EventTable(ResultTable[E]):
    """Events in order of time.

    Parameters
    ----------
    items : iterable
    names, states : tuple of str
        The names that events may have, and the states with slow states.
    """

    names: tuple[str, ...]
    states: tuple[str, ...]

    _row = "t"
    _places = ("t",)

    def __new__(
        cls,
        items: Iterable[E] = (),
        names: tuple[str, ...] = (),
        states: tuple[str, ...] = (),
    ) -> Self:
        made = super().__new__(cls, items)
        made.names = names
        made.states = states
        return made
