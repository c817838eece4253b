"""Brute-force bifurcation diagrams: long-time behaviour of runs over a swept parameter."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fastslow.arguments import among, validated, within
from fastslow.errors import ArgumentError
from fastslow.results.base.outcome import Outcome
from fastslow.results.base.result import Result
from fastslow.results.base.table import Row, RowTable, at_values, inside, named_value

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False, repr=False)
class SweepPass(Result):
    """One pass over the values of a parameter; each run starts at the end of the previous one.

    Parameters
    ----------
    direction : int
        +1 for increasing values, −1 for decreasing ones.
    values : ndarray, shape (m,)
        In the order of the pass.
    counts : ndarray of int, shape (m,)
        Number of points recorded at each value.
    swept, x : ndarray, shape (N,)
        The points, value by value.
    ends : ndarray, shape (m, n)
        Final states of the runs; NaN for those that failed.
    outcomes : tuple of Outcome
        The outcome of the run at each value.
    irregular : ndarray of bool, shape (m,), or None
        In sweeps by strips: values at which the recorded motion does not repeat to 1e-9, or to a
        larger relative tolerance of the runs: chaos, invariant tori or a transient. The points of
        chaos depend on the strips. None in sweeps without strips, where it is not computed.
    """

    direction: int
    values: Array
    counts: NDArray[np.intp]
    swept: Array
    x: Array
    ends: Array
    outcomes: tuple[Outcome, ...]
    irregular: NDArray[np.bool_] | None = None

    def points_at(self, value: float) -> Array:
        """Return the points recorded at the nearest of the values."""
        row = int(np.argmin(np.abs(self.values - value)))
        first = int(self.counts[:row].sum())
        return self.x[first : first + int(self.counts[row])]

    def some(self, kept: NDArray[np.bool_]) -> SweepPass:
        """Return the pass with some of its points, given by a mask of shape (N,)."""
        number = np.repeat(np.arange(len(self.values)), self.counts)
        counts = np.bincount(number[kept], minlength=len(self.values))
        return replace(self, counts=counts, swept=self.swept[kept], x=self.x[kept])

    def __repr__(self) -> str:
        way = "up" if self.direction > 0 else "down"
        failed = sum(not outcome for outcome in self.outcomes)
        text = f"pass {way}: {len(self.x)} points at {len(self.values)} values"
        text += f", {failed} of them failed" if failed else ""
        irregular = 0 if self.irregular is None else int(np.count_nonzero(self.irregular))
        if irregular:
            text += f"; the motion does not repeat at {irregular} of them"
        noted = [outcome.notes[0] for outcome in self.outcomes if outcome.notes]
        if noted:
            text += f"; noise may decide at {len(noted)} of them, first: {noted[0]}"
        return text


@dataclass(frozen=True, eq=False, repr=False)
class BifurcationSweep(RowTable[Row], Result):
    """A brute-force bifurcation diagram, computed by simulation.

    Parameters
    ----------
    parameter, name : str
        The swept parameter and the recorded column.
    what : str
        ``"stroboscopic"``, ``"extremes"`` or ``"section"``.
    rule : str
        A description of the recorded points, e.g. ``"x where v = 0 downwards"``.
    passes : tuple of SweepPass
        One pass, or one in each direction.
    parameters : mapping
        The values of all other parameters.
    equations : str
        The model as text.
    settings : mapping
        The settings of the integration.
    """

    parameter: str
    name: str
    what: str
    rule: str
    passes: tuple[SweepPass, ...]
    parameters: Mapping[str, float] = field(default_factory=dict)
    equations: str = ""
    settings: Mapping[str, Any] = field(default_factory=dict)

    _row = "point"

    def to_dict(self) -> dict[str, NDArray[Any]]:
        """Return parameter, recorded column and direction, by point; ``irregular`` with strips."""
        known = {self.parameter: self.swept, self.name: self.x, "direction": self.direction}
        return known if self.irregular is None else known | {"irregular": self.irregular}

    def _words(self) -> Mapping[str, Collection[int]]:
        return {"direction": (-1, 1)}

    def _rows(self, rows: slice | NDArray[np.intp]) -> BifurcationSweep:
        kept = np.zeros(len(self), dtype=bool)
        kept[rows] = True
        ends = np.cumsum([len(p.x) for p in self.passes])[:-1]
        parts = zip(self.passes, np.split(kept, ends), strict=True)
        return replace(self, passes=tuple(p.some(mine) for p, mine in parts))

    @validated(direction=among(-1, 1, None))
    def at(self, *, direction: int | None = None, **value: Any) -> Any:
        """Return the points recorded at the nearest value of the parameter.

        Parameters
        ----------
        direction : int, optional
            Select the pass upwards (+1) or downwards (−1).
        **value : float or array_like, shape (m,)
            The parameter by name, e.g. ``C=3.45``.

        Returns
        -------
        ndarray, shape (k,), or list of m such arrays

        Raises
        ------
        UnknownNameError
            If the name is not the parameter of the sweep.
        ArgumentError
            For a value outside the range of the sweep.
        """
        passes = [p for p in self.passes if direction in (None, p.direction)]
        name, over = self.parameter, (self.values[0], self.values[-1])

        def points(number: float) -> Array:
            inside("sweep", name, number, over)
            return np.concatenate([np.empty(0), *(p.points_at(number) for p in passes)])

        return at_values(*named_value("sweep parameter", [name], value), points)

    @property
    def up(self) -> SweepPass | None:
        """The pass with increasing values."""
        return next((p for p in self.passes if p.direction > 0), None)

    @property
    def down(self) -> SweepPass | None:
        """The pass with decreasing values."""
        return next((p for p in self.passes if p.direction < 0), None)

    @property
    def values(self) -> Array:
        """The parameter values in increasing order, shape (m,)."""
        return np.sort(self.passes[0].values)

    @property
    def swept(self) -> Array:
        """The parameter value of every point, shape (N,)."""
        return np.concatenate([p.swept for p in self.passes])

    @property
    def x(self) -> Array:
        """The recorded column at every point, shape (N,)."""
        return np.concatenate([p.x for p in self.passes])

    @property
    def direction(self) -> NDArray[np.int64]:
        """The direction of the pass of every point, +1 up and −1 down, shape (N,)."""
        return np.concatenate([np.full(len(p.x), p.direction, dtype=np.int64) for p in self.passes])

    @property
    def irregular(self) -> NDArray[np.bool_] | None:
        """Whether the motion at the value of every point is irregular, see `SweepPass`."""
        marks = [(p.irregular, p.counts) for p in self.passes if p.irregular is not None]
        return np.concatenate([np.repeat(*one) for one in marks]) if marks else None

    @property
    def failures(self) -> tuple[tuple[float, Outcome], ...]:
        """Parameter values at which the run failed, each with its outcome."""
        return tuple(
            (float(value), outcome)
            for p in self.passes
            for value, outcome in zip(p.values, p.outcomes, strict=True)
            if not outcome
        )

    @validated(resolution=within(0.0, 1.0))
    def hysteresis(self, resolution: float = 1e-3) -> Array:
        """Return the intervals of the parameter over which the two passes differ.

        At each value every point of one pass is compared with the nearest point of
        the other, and conversely. Passes through chaotic motion differ throughout.

        Parameters
        ----------
        resolution : float
            Smallest difference that counts, as a fraction of the range of all points.

        Returns
        -------
        ndarray, shape (k, 2)
            First and last differing value of each interval. If the runs settle, each
            jump is within one step of the sweep outside it; just past a fold the
            passage is slow, and a run may end before it jumps. Values at which a run
            failed are skipped.

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
            one, other = up.points_at(value), down.points_at(value)
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
        first = f"Sweep of {self.parameter} from {low:.6g} to {high:.6g}: {self.rule}"
        return "\n".join([first, *(f"  {p!r}" for p in self.passes)])
