"""Crossings of interfaces, and the time intervals between them."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fastslow.arguments import among, validated
from fastslow.errors import unknown_name
from fastslow.results.base.display import Displayed
from fastslow.results.base.html import HTML_ROWS, Cells
from fastslow.results.base.immutable import Immutable
from fastslow.results.base.table import ResultTable
from fastslow.results.stored.operations import AT_REST

#: Words for the directions of crossings.
WAYS = {1: "upwards", -1: "downwards", 0: "touching"}


@dataclass(frozen=True, eq=False, repr=False)
class Crossing(Immutable):
    """A crossing of an interface, or a grazing contact.

    Parameters
    ----------
    time : float
    state : ndarray, shape (n,)
        States and slow states, on the interface. Where a reset jumps across the interface, or
        the interface itself jumps at an instant of a clock or table, those after the jump.
    interface : str
    direction : int
        +1 if h increases, −1 if it decreases, 0 for grazing.
    from_region, to_region : str
        The same region for grazing; ``"A|B"`` is sliding between A and B.
    tangential : bool
        True for a nearly tangential crossing, which a change of h by a millionth of its
        size would remove, and whose time is less accurate.
    """

    time: float
    state: NDArray[np.float64]
    interface: str
    direction: int
    from_region: str
    to_region: str
    tangential: bool

    def __repr__(self) -> str:
        near = ", near-tangential" if self.tangential and self.direction else ""
        return (
            f"Crossing(t = {self.time:.9g}, {self.interface} {WAYS[self.direction]}, "
            f"{self.from_region} → {self.to_region}{near})"
        )


class Crossings(ResultTable[Crossing]):
    """Crossings in order of time, as a table.

    ``crossings("x - D", direction=+1)`` selects the upward crossings of an interface.

    Parameters
    ----------
    items : iterable of Crossing
    interfaces, states : tuple of str
        The interfaces of the model, and its states with slow states.
    """

    interfaces: tuple[str, ...]
    states: tuple[str, ...]

    _row = "t"
    _places = ("t",)

    def __new__(
        cls,
        items: Iterable[Crossing] = (),
        interfaces: tuple[str, ...] = (),
        states: tuple[str, ...] = (),
    ) -> Crossings:
        made = super().__new__(cls, items)
        made.interfaces = interfaces
        made.states = states
        return made

    def _words(self) -> Mapping[str, Collection[Any]]:
        return {"interface": self.interfaces, "direction": (-1, 0, 1)}

    def to_dict(self) -> dict[str, NDArray[Any]]:
        """Return time t, the states, interface, direction, regions and tangential."""
        state = np.array([c.state for c in self], dtype=float).reshape(-1, len(self.states))
        names = ("interface", "direction", "from_region", "to_region", "tangential")
        types: tuple[type, ...] = (str, np.int64, str, str, bool)
        return {
            "t": np.array([c.time for c in self], dtype=float),
            **dict(zip(self.states, state.T, strict=True)),
            **{
                name: np.array([getattr(c, name) for c in self], dtype=kind)
                for name, kind in zip(names, types, strict=True)
            },
        }

    def _heading(self) -> str:
        return f"{len(self)} crossing{'' if len(self) == 1 else 's'}"

    def _cells(self) -> Cells:
        head = ["t", *self.states, "interface", "direction", "from", "to"]
        rows = [
            (
                f"{c.time:.9g}",
                *(f"{v:.6g}" for v in c.state),
                c.interface,
                WAYS[c.direction],
                c.from_region,
                c.to_region,
            )
            for c in self[:HTML_ROWS]
        ]
        return Cells(head, rows, len(self))

    @validated(direction=among(-1, 0, 1, None))
    def __call__(self, interface: object = None, *, direction: int | None = None) -> Crossings:
        """Select the crossings of an interface, upwards (+1), downwards (−1) or grazing (0).

        Raises
        ------
        UnknownNameError
            For an unknown interface.
        """
        if interface is not None and str(interface) not in self.interfaces:
            raise unknown_name("interface", interface, self.interfaces)
        kept = (
            crossing
            for crossing in self
            if (interface is None or crossing.interface == str(interface))
            and (direction is None or crossing.direction == direction)
        )
        return Crossings(kept, **self._attributes())


@dataclass(frozen=True)
class Segment(Displayed):
    """A time interval in one region (or of sliding between two).

    Parameters
    ----------
    start, end : float
    region : str
    switches : str
        The states of the switches, such as ``"q = 1"``, empty without switches.
    """

    start: float
    end: float
    region: str
    switches: str = ""

    @property
    def name(self) -> str:
        """The region with the states of the switches."""
        if not self.switches:
            return self.region
        region, at_rest, wall = self.region.partition(AT_REST)
        return f"{region} ({self.switches}){at_rest}{wall}"

    @property
    def duration(self) -> float:
        return self.end - self.start
