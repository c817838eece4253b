"""Operations that compute the motion of any signs of the interfaces of a model."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from fastslow.results.stored.sign_patterns import Pattern

#: A row that is chosen by the signs of some interfaces: these, and the row by their signs.
Choice = tuple[tuple[int, ...], Mapping[Pattern, int]]


@dataclass(frozen=True, eq=False)
class SignedOperations:
    """Operations that compute the Taylor series of every motion of a model.

    Parameters
    ----------
    sizes : tuple of int
        Numbers of states, of slow quantities and of interfaces.
    parameters : tuple of str
        Names of ``p0``, ``p1``, …
    scalars : tuple of str
    nodes : tuple of tuple
        As in `fastslow.results.stored.operations.SeriesOperations`.
    rates : tuple of int
        Row of the rate of each state and slow state.
    outputs : tuple of int
        Rows of slow quantities and interface functions.
    choices : tuple of (tuple of int, mapping)
        For the k-th node `CHOSEN` its interfaces, and its row by their signs.
    sliding : tuple of int
        Interfaces along which sliding is derived.
    gradients, continuous
        As in `fastslow.results.stored.operations.Operations`.
    undecided : tuple of (str, str)
        Interfaces across which the rates jump without a sliding motion, with the reason.
    """

    sizes: tuple[int, int, int]
    parameters: tuple[str, ...]
    scalars: tuple[str, ...]
    nodes: tuple[tuple[Any, ...], ...]
    rates: tuple[int, ...]
    outputs: tuple[int, ...]
    choices: tuple[Choice, ...]
    sliding: tuple[int, ...]
    gradients: tuple[tuple[tuple[str, ...], tuple[str, ...]], ...]
    continuous: tuple[bool, ...]
    undecided: tuple[tuple[str, str], ...]

    @property
    def first_free(self) -> int:
        """The first row after those of states, slow quantities, interfaces and bounds."""
        return sum(self.sizes) + self.n_bounds

    @property
    def n_bounds(self) -> int:
        """Number of rows for the bounds of sliding."""
        return max(2, 2 * len(self.sliding))

    def formed(self, signs: Sequence[int]) -> bool:
        """Check whether the motion of some signs is among those of the operations."""
        return all(
            tuple(signs[j] for j in deciding) in rows for deciding, rows in self.choices
        ) and all(sign != 0 or j in self.sliding for j, sign in enumerate(signs))

    def rows(self, signs: Sequence[int]) -> list[int]:
        """Return the rows of all choices for some signs."""
        return [rows[tuple(signs[j] for j in deciding)] for deciding, rows in self.choices]
