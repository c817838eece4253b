"""Attractors of a model, with the fraction of random initial states that each attracts."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fastslow.results.base.display import Summarized
from fastslow.results.base.outcome import Outcome
from fastslow.results.base.result import Result
from fastslow.results.base.table import RowTable
from fastslow.results.orbits.orbit import Orbit
from fastslow.results.points import Equilibrium

#: The label of initial states that reach no attractor, in a map of basins.
NO_ATTRACTOR = "none"


@dataclass(frozen=True, eq=False, repr=False)
class Attractors(Summarized, RowTable[Orbit | Equilibrium], Result):
    """Attracting periodic orbits and equilibria reached from random initial states.

    ``attractors["A1"]`` and ``attractors[0]`` are the attractor that attracts most of the
    initial states, an `Orbit` or an `Equilibrium`.

    Parameters
    ----------
    members : tuple of Orbit or Equilibrium
        In order of the fraction attracted.
    states : tuple of str
        States and slow states.
    over : mapping
        State to the range of its initial values.
    starts : ndarray, shape (m, n)
        The initial states.
    ends : ndarray, shape (m, n)
        The final state of each trajectory.
    assigned : ndarray of int, shape (m,)
        Index of the attractor of each initial state; −1 if it reached none.
    seed : int
        Of the random numbers.
    outcome : Outcome
        ``"settled"`` if every initial state is assigned.
    early : ndarray of str, shape (m,), optional
        Code of the outcome of each trajectory that ended early, such as ``"not decided"``; empty
        for the others.

    Examples
    --------
    >>> import sympy as sp, fastslow as fs
    >>> x, v = sp.symbols("x v")
    >>> wells = fs.Model({x: v, v: x - x**3 - v / 2})
    >>> found = fs.attractors(wells, {x: (-2, 2), v: (-1, 1)}, 40, seed=1)
    >>> sorted(round(one["x"], 9) for one in found)
    [-1.0, 1.0]
    """

    members: tuple[Orbit | Equilibrium, ...]
    states: tuple[str, ...]
    over: Mapping[str, tuple[float, float]]
    starts: NDArray[np.float64]
    ends: NDArray[np.float64]
    assigned: NDArray[np.int64]
    seed: int
    outcome: Outcome
    early: NDArray[np.str_] | None = None

    _row = "attractor"
    _entry = "attractor"

    def __len__(self) -> int:
        return len(self.members)

    @property
    def labels(self) -> tuple[str, ...]:
        """A1, A2 and so on."""
        return tuple(f"A{k + 1}" for k in range(len(self)))

    @property
    def fractions(self) -> NDArray[np.float64]:
        """Fraction of the initial states that each attracts: its basin's share of the box."""
        counts = np.bincount(self.assigned[self.assigned >= 0], minlength=len(self))
        return np.asarray(counts / max(len(self.starts), 1))

    @property
    def errors(self) -> NDArray[np.float64]:
        """Standard error of each fraction, sqrt(p (1 − p)/m) for m initial states."""
        share = self.fractions
        return np.sqrt(share * (1.0 - share) / max(len(self.starts), 1))

    @property
    def unassigned(self) -> float:
        """Fraction of the initial states that reached no known attractor."""
        return float(np.mean(self.assigned < 0)) if len(self.assigned) else 0.0

    def to_dict(self) -> dict[str, NDArray[Any]]:
        """Return label, type, stability, period, multiple, fraction and its error."""
        orbits = [one if isinstance(one, Orbit) else None for one in self.members]
        return {
            "label": np.array(self.labels, dtype=str),
            "type": np.array(["orbit" if one else "equilibrium" for one in orbits], dtype=str),
            "stability": np.array([one.stability for one in self.members], dtype=str),
            "period": np.array([np.nan if one is None else one.period for one in orbits]),
            "multiple": np.array(
                [0 if one is None else one.multiple or 0 for one in orbits], dtype=int
            ),
            "fraction": self.fractions,
            "error": self.errors,
        }

    def _labelled(self) -> Mapping[str, Any]:
        return dict(zip(self.labels, self.members, strict=True))

    def _rows(self, rows: slice | NDArray[np.intp]) -> Attractors:
        kept = np.arange(len(self))[rows]
        place = np.full(len(self) + 1, -1)
        place[kept] = np.arange(len(kept))
        members = tuple(self.members[k] for k in kept)
        return replace(self, members=members, assigned=place[self.assigned])

    def _item(self, row: int) -> Orbit | Equilibrium:
        return self.members[row]

    def _groups(self) -> list[list[str]]:
        head = f"Attractors: {len(self)} from {len(self.starts)} initial states"
        lines = [head] if self.outcome else [head, f"  {self.outcome}"]
        rows = []
        for label, one, share, error in zip(
            self.labels, self.members, self.fractions, self.errors, strict=True
        ):
            rows.append(f"  {label} {description(one)}: {share:.1%} ± {error:.1%}")
        if self.unassigned:
            codes = Counter([] if self.early is None else self.early[self.early != ""].tolist())
            shares = (f"{code} {n / len(self.starts):.1%}" for code, n in codes.most_common())
            ended = f", ended early: {', '.join(shares)}" if codes else ""
            rows.append(f"  none of these: {self.unassigned:.1%}{ended}")
        return [lines, rows]


def description(one: Orbit | Equilibrium) -> str:
    """Kind of an attractor, with the region of an equilibrium or the period of an orbit."""
    if isinstance(one, Equilibrium):
        return f"equilibrium in {one.region}"
    which = "" if one.multiple is None else f", {one.multiple} of the forcing"
    return f"orbit of period {one.period:.6g}{which}, {one.event_counts}"
