"""Ensembles: summaries of many trajectories."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fastslow.errors import ArgumentError
from fastslow.results.base.display import Summarized
from fastslow.results.base.outcome import Outcome
from fastslow.results.base.result import Result
from fastslow.results.base.table import Row, RowTable
from fastslow.results.trajectory.endings import outcome_of
from fastslow.results.trajectory.long_time.regimes import (
    CHAOTIC,
    NO_GAP,
    NOT_SETTLED,
    REGIMES,
    RUN_LABELS,
)


@dataclass(frozen=True, eq=False, repr=False)
class Ensemble(Summarized, RowTable[Row], Result):
    """Summaries of m trajectories: extremes, crossings and final states.

    A trajectory that ended early is summarised up to its end; its extremes are NaN if it
    ended before they were recorded.

    Parameters
    ----------
    states : tuple of str
        States, then slow states: the columns of ``initial``, ``final``, ``minimum``, ``maximum``.
    forcing, interfaces : tuple of str
        Names in the model's order.
    modes : tuple of str
        Regions, then sliding motions, of all parameter sets.
    parameters : mapping
        The varied parameters, each an array of shape (m,).
    initial : ndarray, shape (m, n)
    span : ndarray, shape (m, 2)
        Requested first and last time.
    since : ndarray, shape (m,)
        Time from which extremes and hits are recorded.
    minimum, maximum : ndarray, shape (m, n)
        Extremes of every state, exact within the steps.
    final : ndarray, shape (m, n)
        Final state.
    reached : ndarray, shape (m,)
        Final time.
    hits : ndarray of int, shape (m, n_interfaces, 2)
        Number of crossings of each interface, upwards (index 0) and downwards (index 1).
    regime_numbers : ndarray of int, shape (m,)
        Number of the contact regime, whose name is in `regime`.
    n_steps : ndarray of int, shape (m,)
    codes, last_mode : ndarray of int, shape (m,)
        Code of the outcome and index of the final mode.
    sampled : tuple of ndarray, optional
        Times (N,) or (m, N) and columns (m, n + n_forcing, N), NaN after the end of a trajectory.
    method : str
        The integration method, with collocation for steps with a singular series.
    limits : tuple of int
        Maximal number of steps and of crossings of one trajectory.
    constants : mapping
        The values of all other parameters.
    equations : str
        The model as text.
    settings : mapping
        The settings of the integration.
    undecided : tuple of (str, str)
        Intersections of discontinuities without a sliding motion, with the reason.
    notes : tuple of str
        Warnings on trajectories in which a tolerance, or the smallest representable number,
        decides when a state departs from zero.
    touched : ndarray of int, shape (m, k)
        The sides of a gap in contact during each whole period of the second half of a
        run, as the sum of lower 1, inside 2 and upper 4; 0 for missing periods.
    multiples : ndarray of int, shape (m,)
        Number of periods after which the states repeat at the end of a run with a gap,
        0 if they do not.
    changes : ndarray, shape (m,)
        Largest change of a state over that number of periods, else over one, in units
        of its range.
    reset_names : tuple of str
        The resets of the model.
    resets : ndarray of int, shape (m, n_resets)
        Number of resets of each kind, from the same time on as the hits; shape (0, 0) for models
        without resets.
    switch_names : tuple of str
        The switches of the model, which are the last of the slow quantities.
    switches : ndarray of int, shape (m, n_switches, 2)
        Number of changes of each switch to 1 (index 0) and to 0 (index 1), counted as the hits.
    end_switches : ndarray of int, shape (m, n_switches)
        Final values of the switches.
    event_names : tuple of str
        The events of the model.
    events : ndarray of int, shape (m, n_events)
        Number of executions of each event, counted as the hits; shape (0, 0) for models without
        events.

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
    initial: NDArray[np.float64]
    span: NDArray[np.float64]
    since: NDArray[np.float64]
    minimum: NDArray[np.float64]
    maximum: NDArray[np.float64]
    final: NDArray[np.float64]
    reached: NDArray[np.float64]
    hits: NDArray[np.int64]
    regime_numbers: NDArray[np.uint8]
    n_steps: NDArray[np.integer]
    codes: NDArray[np.integer]
    last_mode: NDArray[np.integer]
    sampled: tuple[NDArray[np.float64], NDArray[np.float64]] | None
    method: str
    limits: tuple[int, int]
    constants: Mapping[str, float] = field(default_factory=dict)
    equations: str = ""
    settings: Mapping[str, Any] = field(default_factory=dict)
    undecided: tuple[tuple[str, str], ...] = ()
    notes: tuple[str, ...] = ()
    touched: NDArray[np.integer] = field(default_factory=lambda: np.zeros((0, 0), dtype=np.uint8))
    multiples: NDArray[np.integer] = field(default_factory=lambda: np.zeros(0, dtype=np.int16))
    changes: NDArray[np.float64] = field(default_factory=lambda: np.empty(0))
    reset_names: tuple[str, ...] = ()
    resets: NDArray[np.int64] = field(default_factory=lambda: np.zeros((0, 0), dtype=np.int64))
    switch_names: tuple[str, ...] = ()
    switches: NDArray[np.int64] = field(default_factory=lambda: np.zeros((0, 0, 2), dtype=np.int64))
    end_switches: NDArray[np.int64] = field(
        default_factory=lambda: np.zeros((0, 0), dtype=np.int64)
    )
    event_names: tuple[str, ...] = ()
    events: NDArray[np.int64] = field(default_factory=lambda: np.zeros((0, 0), dtype=np.int64))

    _row = "trajectory"

    def __len__(self) -> int:
        return len(self.final)

    @property
    def regime(self) -> NDArray[np.str_]:
        """The contact regime of a gap, as in `Trajectory.regime`, shape (m,).

        Empty for models without a gap or a period.
        """
        return np.array(RUN_LABELS)[self.regime_numbers]

    @property
    def success(self) -> NDArray[np.bool_]:
        """True for trajectories that reached the end of the time span, shape (m,)."""
        return self.codes == 0

    @property
    def fractions(self) -> dict[str, NDArray[np.float64]]:
        """The fraction of periods in each regime, over the second half of each run, shape (m,)."""
        counted = np.maximum(np.count_nonzero(self.touched, axis=1), 1)
        found: dict[str, NDArray[np.float64]] = {}
        for bits in np.unique(self.touched[self.touched > 0]):
            share = np.count_nonzero(self.touched == bits, axis=1) / counted
            found[REGIMES[bits]] = found.get(REGIMES[bits], 0.0) + share
        return found

    @cached_property
    def outcomes(self) -> tuple[Outcome, ...]:
        """The outcome of each trajectory."""
        ends = np.column_stack([self.reached, self.final])
        return tuple(
            outcome_of(
                int(self.codes[i]),
                int(self.last_mode[i]),
                ends[i],
                int(self.n_steps[i]),
                self.initial[i],
                self.modes,
                self.limits,
                self.undecided,
            )
            for i in range(len(self))
        )

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of the columns: states, slow states, slow quantities."""
        return (*self.states, *self.forcing)

    @property
    def t(self) -> NDArray[np.float64]:
        """Times of the samples, shape (N,), or (m, N) if they differ between trajectories."""
        return self._samples[0]

    def __getitem__(self, key: Any) -> Any:
        """Return a state, slow state or slow quantity at the times ``t``, shape (m, N).

        Other names and expressions are those of the summaries in `to_dict`, shape (m,).

        Raises
        ------
        UnknownNameError
            For a name that is not a column.
        ArgumentError
            Without samples.
        """
        if str(key) in self.columns:
            return self._samples[1][:, self.columns.index(str(key))]
        return self.t if str(key) == "t" else super().__getitem__(key)

    def _constants(self) -> Mapping[str, float]:
        return self.constants

    def _words(self) -> Mapping[str, Collection[str]]:
        return {"regime": (*REGIMES, NOT_SETTLED, CHAOTIC, NO_GAP)}

    def _rows(self, rows: slice | NDArray[np.intp]) -> Ensemble:
        kept: dict[str, Any] = {
            name: value[rows]
            for name in self.__dataclass_fields__
            if isinstance(value := getattr(self, name), np.ndarray) and len(value) == len(self)
        }
        if self.sampled is not None:
            t, columns = self.sampled
            kept["sampled"] = t if t.ndim == 1 else t[rows], columns[rows]
        return replace(self, **kept, parameters={n: v[rows] for n, v in self.parameters.items()})

    @property
    def _samples(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        if self.sampled is None:
            raise ArgumentError("this ensemble has no samples; call simulate_many with samples=")
        return self.sampled

    def to_dict(self) -> dict[str, NDArray[Any]]:
        """Return the summaries with one row for each trajectory, without samples."""
        columns: dict[str, NDArray[Any]] = dict(self.parameters)
        for name in ("initial", "final", "minimum", "maximum"):
            values = getattr(self, name)
            columns |= {f"{name} {key}": values[:, k] for k, key in enumerate(self.states)}
        for k, interface in enumerate(self.interfaces):
            columns[f"hits {interface} upwards"] = self.hits[:, k, 0]
            columns[f"hits {interface} downwards"] = self.hits[:, k, 1]
        for k, name in enumerate(self.reset_names):
            columns[f"resets {name}"] = self.resets[:, k]
        for k, name in enumerate(self.event_names):
            columns[f"events {name}"] = self.events[:, k]
        for k, name in enumerate(self.switch_names):
            columns[f"changes of {name} to 1"] = self.switches[:, k, 0]
            columns[f"changes of {name} to 0"] = self.switches[:, k, 1]
            columns[f"final {name}"] = self.end_switches[:, k]
        return {**columns, "reached": self.reached, "regime": self.regime, "success": self.success}

    def _about(self) -> dict[str, Any]:
        return {**super()._about(), **self.constants}

    def _groups(self) -> list[list[str]]:
        count = len(self)
        first, last = self.span[:, 0].min(), self.span[:, 1].max()
        head = f"Ensemble of {count} trajectories of {', '.join(self.columns)}"
        head += f" for t from {first:.6g} to {last:.6g}"
        varied = [
            f"  {name} from {values.min():.6g} to {values.max():.6g}"
            for name, values in self.parameters.items()
        ]
        lines = []
        kinds, counts = np.unique(self.regime_numbers, return_counts=True)
        known = sorted((RUN_LABELS[k], n) for k, n in zip(kinds, counts, strict=True) if k)
        if known:
            lines.append("  " + ", ".join(f"{kind}: {n}" for kind, n in known))
        done = int(np.count_nonzero(self.success))
        lines.append(f"  {self.method}")
        lines.append(f"  {done} of {count} reached the end of the time span")
        if done < count:
            worst = int(np.flatnonzero(~self.success)[0])
            lines.append(f"  trajectory {worst}: {self.outcomes[worst]}")
        return [[head], varied, lines, [f"  {note}" for note in self.notes]]
