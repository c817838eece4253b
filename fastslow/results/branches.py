"""A branch of equilibria as a table."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fastslow.errors import unknown_name
from fastslow.results.outcome import Outcome
from fastslow.results.points import SpecialPoints, stability_of


@dataclass(frozen=True)
class Sheet:
    """A run of a branch over which the parameter is strictly monotone and the region one.

    Parameters
    ----------
    start, stop : int
        Rows ``start`` to ``stop - 1`` of the branch.
    region : str
        The region of all its rows.
    """

    start: int
    stop: int
    region: str


@dataclass(frozen=True, eq=False)
class Branch:
    """A curve of equilibria, row by row along its arclength.

    At an interface the boundary equilibrium stands twice, once as the last row
    of the region left and once as the first row of the region entered, so that
    every row's eigenvalues belong to its own region.

    Parameters
    ----------
    states : tuple of str
        State names.
    parameter_name : str
        The continuation parameter.
    state : ndarray, shape (N, n)
        States, row by row.
    parameter : ndarray, shape (N,)
        Parameter values.
    tangent : ndarray, shape (N, n + 1)
        Unit tangents (states, parameter), in the direction of tracing.
    eigenvalues : ndarray of complex, shape (N, n)
        Of the Jacobian in the row's region.
    region : ndarray of str, shape (N,)
        The region whose rates vanish.
    special : SpecialPoints
        In order along the branch; ``branch.special("LP")`` gives those of one code.
    special_rows : tuple of int
        The row of each special point (of a boundary equilibrium, the first of its two).
    outcomes : tuple of Outcome
        Why the branch stopped at its first and its last row.
    closed : bool
        Whether the last row is the first again (an isolated loop).
    admissible : bool
        False for a branch of virtual equilibria.
    """

    states: tuple[str, ...]
    parameter_name: str
    state: NDArray[np.float64]
    parameter: NDArray[np.float64]
    tangent: NDArray[np.float64]
    eigenvalues: NDArray[np.complex128]
    region: NDArray[np.str_]
    special: SpecialPoints
    special_rows: tuple[int, ...]
    outcomes: tuple[Outcome, Outcome]
    closed: bool = False
    admissible: bool = True

    @property
    def stability(self) -> NDArray[np.str_]:
        """``"stable"``, ``"unstable"`` or ``"neutral"``, shape (N,)."""
        return stability_of(self.eigenvalues)

    @property
    def stable(self) -> NDArray[np.bool_]:
        """Whether each row is stable, shape (N,)."""
        return self.stability == "stable"

    @property
    def outcome(self) -> Outcome:
        """How the tracing ended: the first unsuccessful end, else the last one."""
        return next((o for o in self.outcomes if not o.success), self.outcomes[-1])

    def __len__(self) -> int:
        return len(self.parameter)

    def __getitem__(self, name: object) -> NDArray[np.float64]:
        """Column of a state or of the parameter, shape (N,)."""
        key = str(name)
        if key in self.states:
            return self.state[:, self.states.index(key)]
        if key == self.parameter_name:
            return self.parameter
        raise unknown_name("column", key, [*self.states, self.parameter_name])

    def sheets(self) -> Iterator[Sheet]:
        """Split into runs of one region and strictly monotone parameter.

        Vertical segments, where the parameter does not change, are no sheets.
        """
        step = np.sign(np.diff(self.parameter))
        span = max(float(np.ptp(self.parameter)), np.finfo(float).tiny)
        step[np.abs(np.diff(self.parameter)) <= 1e-13 * span] = 0
        step[self.region[1:] != self.region[:-1]] = 0
        start = 0
        while start < len(step):
            stop = start + 1
            if step[start] != 0:
                while stop < len(step) and step[stop] == step[start]:
                    stop += 1
                yield Sheet(start, stop + 1, str(self.region[start]))
            start = stop

    def __repr__(self) -> str:
        low, high = float(self.parameter.min()), float(self.parameter.max())
        regions = list(dict.fromkeys(self.region.tolist()))
        codes = " ".join(p.label for p in self.special)
        return (
            f"Branch({len(self)} points, {self.parameter_name} from {low:.6g} to {high:.6g}, "
            f"regions {' → '.join(regions)}; {codes})"
        )
