"""Many solutions in time, each by what sums it up."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from fastslow.errors import ArgumentError, unknown_name
from fastslow.results.base.outcome import Outcome
from fastslow.results.base.result import Result
from fastslow.results.base.table import Table
from fastslow.results.trajectory.endings import outcome_of
from fastslow.results.trajectory.regimes import REGIMES


@dataclass(frozen=True, eq=False, repr=False)
class Ensemble(Table, Result):
    """What sums up each of m trajectories.

    A trajectory that could not go on keeps what it had reached; where it did
    not reach the time from which extremes count, they are NaN.

    Parameters
    ----------
    states : tuple of str
        States, then slow states: the columns of ``start``, ``final``, ``minimum``, ``maximum``.
    forcing, interfaces : tuple of str
        Names in the model's order.
    modes : tuple of str
        Regions, then sliding motions, of all parameter sets.
    parameters : mapping
        The parameters that were varied, each an array of shape (m,).
    start : ndarray, shape (m, n)
    span : ndarray, shape (m, 2)
        First time and last time asked for.
    since : ndarray, shape (m,)
        Time from which extremes and hits count.
    minimum, maximum : ndarray, shape (m, n)
        Extremes of every state, exact within the steps.
    final : ndarray, shape (m, n)
        State at the time reached.
    reached : ndarray, shape (m,)
        Time reached.
    hits : ndarray of int, shape (m, n_interfaces, 2)
        How often each interface was crossed, upwards (index 0) and downwards (index 1).
    regime : ndarray of str, shape (m,)
        How the sides of a gap were touched, period by period, as in
        `Trajectory.regime`; empty for models without a gap or a period.
    n_steps : ndarray of int, shape (m,)
    codes, last_mode : ndarray of int, shape (m,)
        How each ended, and in which of the modes.
    sampled : tuple of ndarray, optional
        Times (N,) or (m, N) and columns (m, n + n_forcing, N), NaN after the end of a trajectory.
    method : str
        How the steps were made; where a series is singular, collocation takes its place.
    limits : tuple of int
        Most steps and most crossings of one trajectory.
    constants : mapping
        The values of all other parameters.
    equations : str
        The model as text.
    settings : mapping
        How they were simulated.
    undecided : tuple of (str, str)
        Intersections of discontinuities along which no sliding is derived, and why.
    notes : tuple of str
        In how many trajectories a tolerance, or the smallest number, decides when a state
        leaves zero, and which.
    touched : ndarray of int, shape (m, k)
        Which sides of a gap were touched in each whole period of the second half of a
        run, the last one last: lower 1, inside 2, upper 4, added up; 0 where the run has
        fewer periods.
    multiples : ndarray of int, shape (m,)
        After how many periods the states repeat at the end of a run with a gap, 0 where
        they do not.
    changes : ndarray, shape (m,)
        By how much they change over so many periods, else over one, in units of their
        ranges.

    Examples
    --------
    >>> import sympy as sp, fastslow as fs
    >>> x, v = sp.symbols("x v")
    >>> bounce = fs.Model({x: v, v: -sp.sign(x)})
    >>> many = fs.simulate_many(bounce, [[0.5, 0], [2.0, 0]], t=(0, 3))
    >>> many.hits[:, 0]
    array([[0, 1],
           [0, 1]])
    >>> many.final.round(9) + 0.0
    array([[ 0. ,  1. ],
           [-1.5, -1. ]])
    """

    states: tuple[str, ...]
    forcing: tuple[str, ...]
    interfaces: tuple[str, ...]
    modes: tuple[str, ...]
    parameters: Mapping[str, NDArray[np.float64]]
    start: NDArray[np.float64]
    span: NDArray[np.float64]
    since: NDArray[np.float64]
    minimum: NDArray[np.float64]
    maximum: NDArray[np.float64]
    final: NDArray[np.float64]
    reached: NDArray[np.float64]
    hits: NDArray[np.int64]
    regime: NDArray[np.str_]
    n_steps: NDArray[np.int64]
    codes: NDArray[np.int64]
    last_mode: NDArray[np.int64]
    sampled: tuple[NDArray[np.float64], NDArray[np.float64]] | None
    method: str
    limits: tuple[int, int]
    constants: Mapping[str, float] = field(default_factory=dict)
    equations: str = ""
    settings: Mapping[str, Any] = field(default_factory=dict)
    undecided: tuple[tuple[str, str], ...] = ()
    notes: tuple[str, ...] = ()
    touched: NDArray[np.int64] = field(default_factory=lambda: np.zeros((0, 0), dtype=np.int64))
    multiples: NDArray[np.int64] = field(default_factory=lambda: np.zeros(0, dtype=np.int64))
    changes: NDArray[np.float64] = field(default_factory=lambda: np.empty(0))

    _row = "trajectory"

    #: Numbers are no columns, and rows no points: there is nothing to go through one by one.
    __iter__: ClassVar[None] = None

    def __len__(self) -> int:
        return len(self.final)

    @property
    def success(self) -> NDArray[np.bool_]:
        """Whether each trajectory reached the end of time, shape (m,)."""
        return self.codes == 0

    @property
    def fractions(self) -> dict[str, NDArray[np.float64]]:
        """The fraction of the periods of each regime, over the second half of each run, (m,)."""
        counted = np.maximum(np.count_nonzero(self.touched, axis=1), 1)
        found: dict[str, NDArray[np.float64]] = {}
        for bits in np.unique(self.touched[self.touched > 0]):
            share = np.count_nonzero(self.touched == bits, axis=1) / counted
            found[REGIMES[bits]] = found.get(REGIMES[bits], 0.0) + share
        return found

    @cached_property
    def outcomes(self) -> tuple[Outcome, ...]:
        """How each trajectory ended, in words."""
        ends = np.column_stack([self.reached, self.final])
        return tuple(
            outcome_of(
                int(self.codes[i]),
                int(self.last_mode[i]),
                ends[i],
                int(self.n_steps[i]),
                self.start[i],
                self.modes,
                self.limits,
                self.undecided,
            )
            for i in range(len(self))
        )

    @property
    def columns(self) -> tuple[str, ...]:
        """Names that can be asked for: states, slow states, slow quantities."""
        return (*self.states, *self.forcing)

    @property
    def t(self) -> NDArray[np.float64]:
        """Times of the samples, shape (N,), or (m, N) where the trajectories differ in them."""
        return self._samples[0]

    def __getitem__(self, name: object) -> NDArray[np.float64]:
        """A state, slow state or slow quantity at the times ``t``, shape (m, N).

        Raises
        ------
        UnknownNameError
            For a name that is no column.
        ArgumentError
            When no samples were asked for.
        """
        if str(name) == "t":
            return self.t
        if str(name) not in self.columns:
            raise unknown_name("column", name, self.columns)
        return self._samples[1][:, self.columns.index(str(name))]

    @property
    def _samples(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        if self.sampled is None:
            raise ArgumentError("this ensemble kept no samples; simulate_many with samples=")
        return self.sampled

    def to_dict(self) -> dict[str, NDArray[Any]]:
        """What sums up each trajectory, one row each; samples are not among it."""
        columns: dict[str, NDArray[Any]] = dict(self.parameters)
        for name in ("start", "final", "minimum", "maximum"):
            values = getattr(self, name)
            columns |= {f"{name} {key}": values[:, k] for k, key in enumerate(self.states)}
        for k, interface in enumerate(self.interfaces):
            columns[f"hits {interface} upwards"] = self.hits[:, k, 0]
            columns[f"hits {interface} downwards"] = self.hits[:, k, 1]
        return {**columns, "reached": self.reached, "regime": self.regime, "success": self.success}

    def _about(self) -> dict[str, Any]:
        return {**super()._about(), **self.constants}

    def __repr__(self) -> str:
        count = len(self)
        first, last = self.span[:, 0].min(), self.span[:, 1].max()
        lines = [f"Ensemble of {count} trajectories of {', '.join(self.columns)}"]
        lines[0] += f" for t from {first:.6g} to {last:.6g}"
        for name, values in self.parameters.items():
            lines.append(f"  {name} from {values.min():.6g} to {values.max():.6g}")
        kinds, counts = np.unique(self.regime[self.regime != ""], return_counts=True)
        if len(kinds):
            lines.append("  " + ", ".join(f"{k}: {n}" for k, n in zip(kinds, counts, strict=True)))
        done = int(np.count_nonzero(self.success))
        lines.append(f"  {self.method}")
        lines.append(f"  {done} of {count} reached the end of time")
        if done < count:
            worst = int(np.flatnonzero(~self.success)[0])
            lines.append(f"  trajectory {worst}: {self.outcomes[worst]}")
        lines += [f"  {note}" for note in self.notes]
        return "\n".join(lines)
