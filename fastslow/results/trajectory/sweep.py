"""A bifurcation diagram by simulation: what runs settle on as a parameter is swept."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fastslow.arguments import validated, within
from fastslow.errors import ArgumentError
from fastslow.results.base.outcome import Outcome
from fastslow.results.base.result import Result
from fastslow.results.base.table import Table

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False, repr=False)
class SweepPass(Result):
    """One pass over the values of a parameter, each run begun where the last one ended.

    Parameters
    ----------
    direction : int
        +1 for rising values, −1 for falling ones.
    values : ndarray, shape (m,)
        In the order of the pass.
    counts : ndarray of int, shape (m,)
        How many points were recorded at each value.
    parameter, x : ndarray, shape (N,)
        The points, value by value.
    ends : ndarray, shape (m, n)
        States in which the runs ended; nan where one failed.
    outcomes : tuple of Outcome
        How each value's run ended.
    """

    direction: int
    values: Array
    counts: NDArray[np.intp]
    parameter: Array
    x: Array
    ends: Array
    outcomes: tuple[Outcome, ...]

    def at(self, value: float) -> Array:
        """The points recorded at the nearest of the values, shape (its count,)."""
        row = int(np.argmin(np.abs(self.values - value)))
        first = int(self.counts[:row].sum())
        return self.x[first : first + int(self.counts[row])]

    def __repr__(self) -> str:
        way = "up" if self.direction > 0 else "down"
        failed = sum(not outcome for outcome in self.outcomes)
        text = f"pass {way}: {len(self.x)} points at {len(self.values)} values"
        text += f", {failed} of them failed" if failed else ""
        noted = [outcome.notes[0] for outcome in self.outcomes if outcome.notes]
        if noted:
            text += f"; noise may decide at {len(noted)} of them, first: {noted[0]}"
        return text


@dataclass(frozen=True, eq=False, repr=False)
class BifurcationSweep(Table, Result):
    """A bifurcation diagram by simulation.

    Parameters
    ----------
    parameter_name, name : str
        The parameter swept, and the column recorded.
    what : str
        ``"stroboscopic"``, ``"extremes"`` or ``"section"``.
    rule : str
        The same in full, e.g. ``"x where v = 0 downwards"``.
    passes : tuple of SweepPass
        One, or one each way.
    parameters : mapping
        The values of all other parameters.
    equations : str
        The model as text.
    settings : mapping
        How the runs were made.
    """

    parameter_name: str
    name: str
    what: str
    rule: str
    passes: tuple[SweepPass, ...]
    parameters: Mapping[str, float] = field(default_factory=dict)
    equations: str = ""
    settings: Mapping[str, Any] = field(default_factory=dict)

    _row = "point"

    def to_dict(self) -> dict[str, NDArray[Any]]:
        """The parameter, the column recorded, and the direction of the pass, point by point."""
        return {
            self.parameter_name: self.parameter,
            self.name: self.x,
            "direction": self.direction,
        }

    @property
    def up(self) -> SweepPass | None:
        """The pass with rising values."""
        return next((p for p in self.passes if p.direction > 0), None)

    @property
    def down(self) -> SweepPass | None:
        """The pass with falling values."""
        return next((p for p in self.passes if p.direction < 0), None)

    @property
    def values(self) -> Array:
        """The parameter values in rising order, shape (m,)."""
        return np.sort(self.passes[0].values)

    @property
    def parameter(self) -> Array:
        """Parameter value of every point, shape (N,)."""
        return np.concatenate([p.parameter for p in self.passes])

    @property
    def x(self) -> Array:
        """The column at every point, shape (N,)."""
        return np.concatenate([p.x for p in self.passes])

    @property
    def direction(self) -> NDArray[np.int64]:
        """Pass of every point, +1 up and −1 down, shape (N,)."""
        return np.concatenate([np.full(len(p.x), p.direction, dtype=np.int64) for p in self.passes])

    @property
    def failures(self) -> tuple[tuple[float, Outcome], ...]:
        """Values whose run failed, each with what happened."""
        return tuple(
            (float(value), outcome)
            for p in self.passes
            for value, outcome in zip(p.values, p.outcomes, strict=True)
            if not outcome
        )

    @validated(resolution=within(0.0, 1.0))
    def hysteresis(self, resolution: float = 1e-3) -> Array:
        """Intervals of the parameter over which the two passes differ.

        At each value the points of one pass are compared with the nearest of
        the other, both ways. Passes through chaos differ throughout.

        Parameters
        ----------
        resolution : float
            Largest difference that does not count, as a part of the range of all points.

        Returns
        -------
        ndarray, shape (k, 2)
            First and last differing value of each interval; each jump lies within
            one step of the sweep outside it, when the runs settle. Just past a
            fold a lost motion lingers, and may still be there when a run ends. A
            value that failed is passed over.

        Raises
        ------
        ArgumentError
            For a sweep of one pass.
        """
        up, down = self.up, self.down
        if up is None or down is None:
            raise ArgumentError("hysteresis needs both passes; sweep with back=True")
        allowed = resolution * (float(np.ptp(self.x)) if len(self.x) else 0.0)
        intervals: list[list[float]] = []
        inside = False
        for value in self.values:
            one, other = up.at(value), down.at(value)
            if not (len(one) and len(other)):
                continue
            gaps = np.abs(one[:, None] - other)
            if max(gaps.min(axis=0).max(), gaps.min(axis=1).max()) > allowed:
                if inside:
                    intervals[-1][1] = float(value)
                else:
                    intervals.append([float(value), float(value)])
                inside = True
            else:
                inside = False
        return np.array(intervals).reshape(-1, 2)

    def __repr__(self) -> str:
        low, high = self.values[[0, -1]]
        first = f"Sweep of {self.parameter_name} from {low:.6g} to {high:.6g}: {self.rule}"
        return "\n".join([first, *(f"  {p!r}" for p in self.passes)])
