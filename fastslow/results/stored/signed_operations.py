"""Operations that compute the motion of any signs of the interfaces and walls of a model."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from fastslow.results.stored.operations import Operations
from fastslow.results.stored.sign_names import name_at_rest
from fastslow.results.stored.sign_patterns import Pattern

#: A row that is chosen by the signs of some interfaces: these, and the row by their signs.
Choice = tuple[tuple[int, ...], Mapping[Pattern, int]]


@dataclass(frozen=True, eq=False)
class SignedOperations:
    """Operations that compute the Taylor series of every motion of a model.

    Parameters
    ----------
    common : Operations
        All but the motions. After the jumps of the resets, one for each wall moves the state onto
        it.
    walls : tuple of str
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
        Interfaces along which sliding is derived, and walls on which a motion may rest, numbered
        as in the sizes of the operations.
    held : mapping
        By the number of each of these walls the interfaces on which a motion is at rest there.
    """

    common: Operations
    walls: tuple[str, ...]
    scalars: tuple[str, ...]
    nodes: tuple[tuple[Any, ...], ...]
    rates: tuple[int, ...]
    outputs: tuple[int, ...]
    choices: tuple[Choice, ...]
    sliding: tuple[int, ...]
    held: Mapping[int, tuple[int, ...]]

    @property
    def n_signs(self) -> int:
        """Number of interfaces and walls, whose signs are those of a motion."""
        return self.common.sizes[2] - len(self.common.switches) - len(self.common.triggers)

    @property
    def first_wall(self) -> int:
        """Number of interfaces before the walls."""
        return self.n_signs - len(self.walls)

    @property
    def first_free(self) -> int:
        """The first row after those of states, slow quantities, interfaces and bounds."""
        return sum(self.common.sizes) + self.n_bounds

    @property
    def n_bounds(self) -> int:
        """Number of rows for the bounds of sliding."""
        return max(2, 2 * len(self.sliding))

    def formed(self, signs: Sequence[int]) -> bool:
        """Check whether the motion of some signs is among those of the operations."""
        slides = all(sign != 0 or j in self.sliding for j, sign in enumerate(signs))
        alone = all(signs[j] != 0 for j in self.held_at(signs))
        known = (tuple(signs[j] for j in deciding) in rows for deciding, rows in self.choices)
        return slides and alone and all(known)

    def held_at(self, signs: Sequence[int]) -> list[int]:
        """Return the interfaces on which a motion is because it rests on walls."""
        return [j for wall, some in self.held.items() if signs[wall] == 0 for j in some]

    def whole(self, signs: Pattern) -> Pattern:
        """Return the signs of a motion with those of the walls, -1 without rest."""
        return (*signs, *[-1] * (self.n_signs - len(signs)))

    def kind(self, signs: Pattern) -> tuple[bool, bool]:
        """Return what orders motions: regions, sliding, and rest on walls."""
        return 0 in signs[self.first_wall :], 0 in signs

    def name(self, signs: Pattern) -> str:
        """Return the name of a motion."""
        return name_at_rest(signs, self.walls)

    def rows(self, signs: Sequence[int]) -> list[int]:
        """Return the rows of all choices for some signs."""
        return [rows[tuple(signs[j] for j in deciding)] for deciding, rows in self.choices]
