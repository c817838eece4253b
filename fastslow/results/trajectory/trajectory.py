"""Trajectories: the solution in time, its crossings of interfaces and its itinerary."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property, partial
from itertools import chain
from typing import Any, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fastslow.arguments import among, finite, numbers, position, positive, validated
from fastslow.formulas.columns import by_value, column
from fastslow.results.base.outcome import Outcome
from fastslow.results.base.result import STORED, Result
from fastslow.results.base.table import Table
from fastslow.results.io.html import trajectory_html
from fastslow.results.stored.model import StoredModel
from fastslow.results.trajectory.contacts import (
    Contacts,
    contacts_of,
    count_hits,
    time_fractions_in,
)
from fastslow.results.trajectory.crossings import (
    Crossings,
    Segment,
    crossings_of,
    regions_at,
    segments_of,
)
from fastslow.results.trajectory.dense import columns_at, refined_table
from fastslow.results.trajectory.long_time import LongTime
from fastslow.results.trajectory.queries import Queries
from fastslow.results.trajectory.regimes import SAME, Regimes, regimes_of
from fastslow.results.trajectory.section import window_of
from fastslow.results.trajectory.slicing import samples_of
from fastslow.results.trajectory.state_at import StatePoint, in_blocks, is_dense, sample


@dataclass(frozen=True, eq=False, repr=False)
class Trajectory(Queries, LongTime, Table, Result):
    """A solution in time.

    ``run["x"]`` is a column and ``run["x**2 + v"]`` an expression at the samples ``run.t``;
    ``run[3]`` and iteration return the states at samples, ``run[10:50]`` is the trajectory
    of those samples, with its crossings, and ``run(t)`` returns the states at any time.

    Parameters
    ----------
    states : tuple of str
        States, then slow states: the order of every state vector.
    forcing : tuple of str
        Slow quantities.
    interfaces, regions : tuple of str
        Names in the model's order.
    parameters : mapping
        Parameter values.
    period : float or None
        Common period of all forcing.
    gap : tuple of str or None
        For a model with a gap, the regions below, inside and above it.
    outcome : Outcome
        The outcome at the end of the run.
    end : ndarray, shape (1 + n,)
        Time and state reached.
    method : str
        The integration method.
    steps : ndarray, shape (n_steps, 4)
        Time, length, mode and method of every step: 0 Taylor series, 1 collocation,
        2 an implicit method.
    modes : tuple of str
        Names of the modes in ``steps`` and ``crossing_table``: regions, then sliding motions.
    crossing_table : ndarray, shape (n_crossings, 6 + n)
        Time, interface, direction, mode before, mode after, near-tangential, state.
    series : ndarray, shape (n_steps, n + n_forcing, order + 1), optional
        Taylor coefficients of every step.
    sampled : tuple of ndarray, optional
        Times of the samples (N,) and their columns (n or n + n_forcing, N).
    span : tuple of float
        First and last time.
    equations : str
        The model as text.
    settings : mapping
        The settings of the integration.
    periods : mapping
        The period of each periodic state. Its column is unwrapped, that is, continuous
        beyond one period; distances are taken modulo the period.
    model : Model or StoredModel, optional
        The simulated model; for a run loaded from a file a stored model, which can be
        simulated again and does not require SymPy.

    Examples
    --------
    >>> import sympy as sp, fastslow as fs
    >>> x, v = sp.symbols("x v")
    >>> run = fs.simulate(fs.Model({x: v, v: -sp.sign(x)}), [0.5, 0.0], t=(0, 3))
    >>> run.crossings
    (Crossing(t = 1, x downwards, S1 → S2),)
    >>> run.itinerary
    ('S1', 'S2')
    >>> run(3.0).round(12)
    array([0., 1.])
    """

    states: tuple[str, ...]
    forcing: tuple[str, ...]
    interfaces: tuple[str, ...]
    regions: tuple[str, ...]
    parameters: Mapping[str, float]
    period: float | None
    gap: tuple[str, str, str] | None
    outcome: Outcome
    span: tuple[float, float]
    end: NDArray[np.float64]
    method: str
    steps: NDArray[np.float64]
    modes: tuple[str, ...]
    crossing_table: NDArray[np.float64]
    series: NDArray[np.float64] | None
    sampled: tuple[NDArray[np.float64], NDArray[np.float64]] | None
    equations: str = ""
    settings: Mapping[str, Any] = field(default_factory=dict)
    periods: Mapping[str, float] = field(default_factory=dict)
    model: Any = field(default=None, repr=False, metadata=STORED)

    _row = "t"
    _places = ("t",)

    @property
    def stored_model(self) -> StoredModel | None:
        """The model as stored in files."""
        return None if self.model is None else self.model.stored

    @property
    def symbolic_model(self) -> Any:
        """The model with its SymPy equations, None for a run loaded from a file."""
        return None if isinstance(self.model, StoredModel) else self.model

    @cached_property
    def t(self) -> NDArray[np.float64]:
        """Times of the samples; without samples, times dense enough for a plot."""
        return self._table[0]

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of the columns: states, slow states, slow quantities."""
        return (*self.states, *self.forcing)

    def __len__(self) -> int:
        return len(self.t)

    def __iter__(self) -> Iterator[StatePoint]:
        return chain.from_iterable(in_blocks(self))

    @overload
    def __getitem__(self, key: slice) -> Trajectory: ...
    @overload
    def __getitem__(self, key: int) -> StatePoint: ...
    @overload
    def __getitem__(self, key: str) -> NDArray[np.float64]: ...
    def __getitem__(self, key: object) -> Trajectory | StatePoint | NDArray[np.float64]:
        """Return a column or expression, the state at a sample, or the run of some samples.

        Raises
        ------
        UnknownNameError
            For a name that is neither a column nor a parameter.
        ArgumentError
            For text that is not an expression, or a slice that is empty or has a step.
        OutOfRangeError
            For an index out of range.
        """
        if isinstance(key, slice):
            return samples_of(self, key)
        if isinstance(key, int | np.integer) and not isinstance(key, bool):
            return sample(self, position(key, len(self), "sample"))
        columns = {name: partial(self._column, k) for k, name in enumerate(self.columns)}
        return column(
            key, {**columns, "t": lambda: self.t}, self.parameters, len(self.t), by_value("t", key)
        )

    def _column(self, row: int) -> NDArray[np.float64]:
        values = self._table[1]
        return values[row] if row < len(values) else self._all_sampled[row]

    @validated(t=numbers)
    def __call__(self, t: ArrayLike) -> NDArray[np.float64]:
        """Return the states at any times of the run, shape (n, N); (n,) for a scalar time.

        Raises
        ------
        ArgumentError
            For a time outside the run, or without dense output.
        """
        return columns_at(self, t, slice(len(self.states)))

    @validated(t=numbers)
    def dense_columns(self, t: ArrayLike) -> NDArray[np.float64]:
        """Return all columns at any times of the run, shape (n + n_forcing, N).

        Raises
        ------
        ArgumentError
            For a time outside the run, or without dense output.
        """
        return columns_at(self, t)

    @cached_property
    def _table(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        return self.sampled if self.sampled is not None else refined_table(self)

    @cached_property
    def _all_sampled(self) -> NDArray[np.float64]:
        return self.dense_columns(self.t)

    @property
    def sampled_columns(self) -> NDArray[np.float64]:
        """Columns at the times ``t``: all of them, or the stored ones without dense output."""
        values = self._table[1]
        known = len(values) == len(self.columns) or not is_dense(self)
        return values if known else self._all_sampled

    @cached_property
    def step_starts(self) -> NDArray[np.float64]:
        """Start times of the steps, contiguous in memory for a binary search."""
        return np.ascontiguousarray(self.steps[:, 0])

    @cached_property
    def crossings(self) -> Crossings:
        """Crossings in order of time; ``run.crossings("x - D", direction=+1)`` selects some."""
        return crossings_of(self)

    @cached_property
    def segments(self) -> tuple[Segment, ...]:
        """The time intervals in one region, in order."""
        return segments_of(self)

    @property
    def itinerary(self) -> tuple[str, ...]:
        """The sequence of regions along the trajectory."""
        return tuple(segment.region for segment in self.segments)

    @cached_property
    def regime(self) -> str | None:
        """The contact regime of a gap in the second half of the run.

        ``"bilateral"``, ``"unilateral upper"``, ``"unilateral lower"``, ``"meshed upper"``,
        ``"meshed lower"`` or ``"free"`` if it is that of all whole periods, or of several
        together after which the motion repeats; else ``"not settled"``. None for models
        without gap or period. A run of fewer than four periods is classified by its last
        period. Sliding along an edge counts as contact; grazing contacts are decided by
        rounding. `regimes` returns the fractions of the periods,
        `fastslow.classify_regime` distinguishes chaos from a transient.
        """
        return None if self._regimes is None else self._regimes.label

    @cached_property
    def _regimes(self) -> Regimes | None:
        known = self.gap is not None and self.period is not None
        return regimes_of(self, None, None, None, SAME) if known else None

    @validated(period=positive, since=finite, until=finite, tol=positive)
    def regimes(
        self,
        period: float | None = None,
        *,
        since: float | None = None,
        until: float | None = None,
        tol: float = SAME,
    ) -> Regimes:
        """Classify each period of a time interval, and detect whether the states repeat.

        Parameters
        ----------
        period : float, optional
            By default that of the forcing.
        since, until : float, optional
            The time interval; by default the second half of the run. Whole periods are
            counted back from its end.
        tol : float
            Largest difference that counts as a repeat, in units of each state's range; at
            least a thousand times the rtol of the integration.

        Returns
        -------
        Regimes

        Raises
        ------
        ArgumentError
            Without a gap or period, or for times outside the run.
        """
        return regimes_of(self, period, since, until, tol)

    @property
    def time_fractions(self) -> dict[str, float]:
        """The fraction of time in each region and each sliding motion."""
        return time_fractions_in(self, self.span)

    @validated(direction=among(-1, 1, None), since=finite, until=finite)
    def hits(
        self,
        interface: object,
        *,
        direction: int | None = None,
        since: float | None = None,
        until: float | None = None,
    ) -> int:
        """Count crossings of an interface, upwards (+1), downwards (−1) or both.

        Parameters
        ----------
        interface : str or Expr
        direction : int, optional
        since, until : float, optional
            The time interval, by default that of the run.

        Raises
        ------
        UnknownNameError
            For an unknown interface.
        ArgumentError
            For another direction, or times outside the run.
        """
        return count_hits(self, interface, direction, window_of(self, since, until))

    @validated(since=finite, until=finite, period=positive)
    def contacts(
        self,
        since: float | None = None,
        until: float | None = None,
        *,
        period: float | None = None,
    ) -> Contacts:
        """Return crossings and time fractions in a time interval, in total and by period.

        Parameters
        ----------
        since, until : float, optional
            The time interval, by default that of the run.
        period : float, optional
            By default that of the forcing.

        Returns
        -------
        Contacts
        """
        return contacts_of(self, period, window_of(self, since, until))

    def to_dict(self) -> dict[str, NDArray[Any]]:
        """Return time t, every column, and the region."""
        columns = {name: self[name] for name in self.columns}
        return {"t": self.t, **columns, "region": regions_at(self, self.t)}

    def _repr_html_(self) -> str:
        return trajectory_html(self)

    def __repr__(self) -> str:
        low, high = self.span
        lines = [
            f"Trajectory of {', '.join(self.columns)} for t from {low:.6g} to {high:.6g}",
            f"  {len(self.steps)} steps, {len(self.crossing_table)} crossings, "
            f"{len(self.segments)} segments"
            + (f", regime {self._regimes.words}" if self._regimes else ""),
            f"  {self.method}",
            f"  {self.outcome}",
        ]
        return "\n".join(lines)
