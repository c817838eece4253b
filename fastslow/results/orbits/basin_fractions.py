"""Fractions of random initial states that each attractor attracts, along a branch."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fastslow.results.base.display import Summarized
from fastslow.results.base.outcome import Outcome
from fastslow.results.base.result import Result
from fastslow.results.base.table import Table
from fastslow.results.branch.branch import Branch
from fastslow.results.orbits.attractors import description
from fastslow.results.orbits.orbit import Orbit
from fastslow.results.orbits.orbit_branch import OrbitBranch
from fastslow.results.points import Equilibrium

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False, repr=False)
class BasinFractions(Summarized, Table[Mapping[str, float]], Result):
    """Fractions of the initial states that each attractor attracts, over a parameter.

    ``found["A1"]`` and ``found["A1_error"]`` are columns over the values of the parameter.
    Attractors at different values are one if they are on one stable part of a branch.

    Parameters
    ----------
    parameter : str
    values : ndarray, shape (K,)
        Values of the parameter, increasing.
    members : tuple of Orbit or Equilibrium
        Each attractor at the first value at which an initial state reached it.
    branches : tuple of Branch or OrbitBranch or None
        The part of a branch on which each attractor was continued, None if it could not be.
    states : tuple of str
        States and slow states.
    over : mapping
        State to the range of its initial values.
    starts : ndarray, shape (m, n)
        The initial states, the same at all values of the parameter.
    assigned : ndarray of int, shape (K, m)
        Index of the attractor that each initial state reached; −1 for none.
    exists : ndarray of bool, shape (K, len(members))
        Whether each attractor exists, also where no initial state reached it.
    seed : int
        Of the random numbers.
    parameters : mapping
        The values of all other parameters.
    outcome : Outcome
        ``"settled"`` if every initial state is assigned and every attractor continued.

    Examples
    --------
    >>> import sympy as sp, fastslow as fs
    >>> x, w = sp.symbols("x w")
    >>> model = fs.Model({x: w + x - x**3}, parameters={w: 0})
    >>> diagram = fs.continue_equilibria(model, "w", over=(-0.3, 0.3))
    >>> found = fs.attractors(model, {x: (-2, 2)}, 100, along=diagram, samples=3)
    >>> found.branches[0].range
    (-0.3, 0.3)
    """

    parameter: str
    values: Array
    members: tuple[Orbit | Equilibrium, ...]
    branches: tuple[Branch | OrbitBranch | None, ...]
    states: tuple[str, ...]
    over: Mapping[str, tuple[float, float]]
    starts: Array
    assigned: NDArray[np.int64]
    exists: NDArray[np.bool_]
    seed: int
    parameters: Mapping[str, float]
    outcome: Outcome

    _row = "value"
    _entry = "column"

    def __len__(self) -> int:
        return len(self.values)

    @property
    def labels(self) -> tuple[str, ...]:
        """A1, A2 and so on, in order of the value at which they were found first."""
        return tuple(f"A{k + 1}" for k in range(len(self.members)))

    @property
    def fractions(self) -> Array:
        """Fraction of the initial states that each attracts, shape (K, len(members))."""
        counts = (self.assigned[:, :, None] == np.arange(len(self.members))).sum(axis=1)
        return np.asarray(counts / max(len(self.starts), 1))

    @property
    def errors(self) -> Array:
        """Standard error of each fraction p of m initial states, sqrt(p (1 − p)/m).

        It is 0 where none or all of them reach an attractor: p is then at most 3/m, or at least
        1 − 3/m, with 95 %.
        """
        share = self.fractions
        return np.sqrt(share * (1.0 - share) / max(len(self.starts), 1))

    @property
    def unassigned(self) -> Array:
        """Fraction of the initial states that reached no attractor, shape (K,)."""
        return np.asarray((self.assigned < 0).mean(axis=1))

    def to_dict(self) -> dict[str, NDArray[Any]]:
        """Return the parameter, each fraction with its error, and the unassigned fraction."""
        columns: dict[str, NDArray[Any]] = {self.parameter: self.values}
        for label, share, error in zip(self.labels, self.fractions.T, self.errors.T, strict=True):
            columns |= {label: share, f"{label}_error": error}
        return {**columns, "unassigned": self.unassigned}

    def _groups(self) -> list[list[str]]:
        low, high = self.values[0], self.values[-1]
        head = (
            f"BasinFractions: {len(self.members)} attractors at {len(self)} values of "
            f"{self.parameter} from {low:.6g} to {high:.6g}, {len(self.starts)} initial states"
        )
        lines = [head] if self.outcome else [head, f"  {self.outcome}"]
        return [lines, [self._line(k) for k in range(len(self.members))]]

    def _line(self, number: int) -> str:
        rows = np.flatnonzero(self.exists[:, number])
        share, error = self.fractions[:, number], self.errors[:, number]
        spans = []
        for row in dict.fromkeys((int(rows[0]), int(rows[-1]))):
            spans.append(
                f"{share[row]:.1%} ± {error[row]:.1%} at {self.parameter} = {self.values[row]:.6g}"
            )
        return f"  {self.labels[number]} {description(self.members[number])}: {' to '.join(spans)}"
