"""Shortest displacements of some states out of a basin of attraction."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fastslow.errors import ArgumentError
from fastslow.results.base.display import Summarized
from fastslow.results.base.outcome import Outcome
from fastslow.results.base.result import Result
from fastslow.results.base.table import RowTable
from fastslow.results.points import Equilibrium

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False, repr=False)
class Shock(Result):
    """A displacement of some states to the boundary of a basin, of locally least length.

    Parameters
    ----------
    names : tuple of str
        The states that are displaced.
    displacement : ndarray, shape (k,)
        In the units of the states.
    length : float
        sqrt(Σ (w dx)²) with the weights w.
    beyond : str
        Where a run from slightly beyond ends.
    edge : Equilibrium, optional
        The edge state on which the run from it lands, if it is an equilibrium.
    method : str
        ``"smooth"`` for the nearest point of a smooth boundary, by Newton's method; ``"bisection"``
        at a corner of the boundary, and where the edge is no equilibrium.
    error : float
        Last change of the displacement, or the length of the last bracket, in units of the length.
    """

    names: tuple[str, ...]
    displacement: Array
    length: float
    beyond: str
    edge: Equilibrium | None
    method: str
    error: float

    def __repr__(self) -> str:
        return f"Shock({_words(self)})"


@dataclass(frozen=True, eq=False, repr=False)
class MinimalShock(Summarized, RowTable[Shock], Result):
    """The shortest displacements out of the basin of an equilibrium.

    ``found.length`` is the length of the shortest one, ``found[0]``.

    Parameters
    ----------
    names : tuple of str
        The states that are displaced.
    weights : mapping
        State to its weight in the length.
    origin : Equilibrium
        The equilibrium that is left.
    shocks : tuple of Shock
        Local optima that were found, by length.
    directions : ndarray, shape (m, k)
        Directions that were searched: unit vectors of the displacements times the weights.
    lengths : ndarray, shape (m,)
        Length at which each of them leaves the basin, infinite if it does not.
    outcome : Outcome
        ``"not proved"``: no shorter one was found; ``"no boundary"``.
    """

    names: tuple[str, ...]
    weights: Mapping[str, float]
    origin: Equilibrium
    shocks: tuple[Shock, ...]
    directions: Array
    lengths: Array
    outcome: Outcome

    _row = "shock"
    _entry = "shock"

    def __len__(self) -> int:
        return len(self.shocks)

    @property
    def length(self) -> float:
        """Length of the shortest displacement.

        Raises
        ------
        ArgumentError
            If none was found.
        """
        if not self.shocks:
            raise ArgumentError(f"there is no shortest displacement: {self.outcome}")
        return self.shocks[0].length

    def to_dict(self) -> dict[str, NDArray[Any]]:
        """Return the displacement of every state, length, what is beyond, method and error."""
        table = np.array([one.displacement for one in self.shocks]).reshape(-1, len(self.names))
        return {
            **{name: table[:, k] for k, name in enumerate(self.names)},
            "length": np.array([one.length for one in self.shocks], dtype=float),
            "beyond": np.array([one.beyond for one in self.shocks], dtype=str),
            "method": np.array([one.method for one in self.shocks], dtype=str),
            "error": np.array([one.error for one in self.shocks], dtype=float),
        }

    def _item(self, row: int) -> Shock:
        return self.shocks[row]

    def _rows(self, rows: slice | NDArray[np.intp]) -> MinimalShock:
        kept = np.arange(len(self))[rows]
        return replace(self, shocks=tuple(self.shocks[k] for k in kept))

    def _groups(self) -> list[list[str]]:
        head = f"MinimalShock of {', '.join(self.names)} from {self.origin._values()}"
        head += f": length {self.length:.6g}" if self.shocks else ": none"
        rows = [f"  {_words(one)}" for one in self.shocks]
        return [[head], rows, [f"  {self.outcome}"]]


def _words(one: Shock) -> str:
    moved = ", ".join(
        f"{n} {'+' if d >= 0 else '−'} {abs(d):.6g}"
        for n, d in zip(one.names, one.displacement, strict=True)
    )
    edge = f"; lands on {one.edge._values()}" if one.edge is not None else ""
    return f"{moved}, length {one.length:.6g}: {one.beyond}{edge}"
