"""A branch of equilibria, stored as a table."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, overload

import numpy as np
from numpy.typing import NDArray

from fastslow.arguments import flag, formula, position, text, validated
from fastslow.errors import unknown_name
from fastslow.formulas.columns import by_value, column
from fastslow.results.base.outcome import Outcome
from fastslow.results.base.result import LIVE, Result
from fastslow.results.base.table import Table, numbered
from fastslow.results.branch import slicing, stability_intervals
from fastslow.results.branch.curve_intersections import intersections
from fastslow.results.branch.lookup import (
    MonotoneRuns,
    filter_equilibria,
    monotone_runs,
    passages,
    stored,
    validate_value,
)
from fastslow.results.branch.nearest import nearest_of
from fastslow.results.branch.point_columns import labels_at
from fastslow.results.branch.unexplained import UnexplainedChange, unexplained_changes
from fastslow.results.io.html import Cells, points_cells
from fastslow.results.points import Corrector, Equilibrium, SpecialPoints, stability_of


@dataclass(frozen=True)
class MonotonePiece:
    """A range of rows of a branch with strictly monotone parameter in a single region.

    Parameters
    ----------
    start, stop : int
        Rows ``start`` to ``stop - 1`` of the branch.
    region : str
        The region of these rows.
    """

    start: int
    stop: int
    region: str


@dataclass(frozen=True, eq=False, repr=False)
class Branch(Table, Result):
    """A curve of equilibria, with one row for each computed point along its arclength.

    A boundary equilibrium has two rows, the last one of the region left and the
    first one of the region entered, so that the eigenvalues of every row belong to
    its own region.

    ``branch["x"]`` is a column and ``branch["x**2 + v"]`` an expression in states
    and parameters; ``branch[3]`` and iteration return the equilibria of rows, and
    ``branch[10:50]`` returns the branch of those rows, with its special points.

    Parameters
    ----------
    states : tuple of str
        State names.
    parameter : str
        The continuation parameter.
    state : ndarray, shape (N, n)
        The states of each row.
    values : ndarray, shape (N,)
        Parameter values.
    tangent : ndarray, shape (N, n + 1)
        Unit tangents (states, parameter), in the direction of tracing.
    eigenvalues : ndarray of complex, shape (N, n)
        Of the Jacobian in the row's region.
    region : ndarray of str, shape (N,)
        The region whose rates vanish.
    special : SpecialPoints
        In order along the branch; ``branch.special("LP")`` selects one code.
    special_rows : tuple of int
        The row of each special point (of a boundary equilibrium, the first of its two).
    outcomes : tuple of Outcome
        The outcomes at the first and the last row.
    closed : bool
        True for a closed curve, whose last row repeats the first.
    admissible : bool
        False for a branch of virtual equilibria.
    parameters : mapping
        The values of all other parameters.
    known_stability : ndarray of str, shape (N,), optional
        The stability where the eigenvalues are unknown, as in files of AUTO-07p.
    corrector : callable, optional
        Solves for equilibria between rows; not saved to files.
    periods : mapping
        The period of each periodic state. Its column is unwrapped, that is,
        continuous beyond the principal range (−period/2, period/2], and the last row
        of a closed branch may differ from the first by whole periods; equilibria and
        special points are reduced to the principal range.

    Examples
    --------
    >>> import fastslow as fs
    >>> gear = fs.systems.harmonic_gear(A=-0.6)
    >>> (branch,) = fs.continue_equilibria(gear.frozen(), "w", over=(-0.5, 0.5)).branches
    >>> [point.region for point in branch.at(w=0.05, stable=True)]
    ['S3', 'S1']
    >>> branch.stable_intervals().round(6)
    array([[-0.5    ,  0.08944],
           [-0.08944,  0.5    ]])
    """

    states: tuple[str, ...]
    parameter: str
    state: NDArray[np.float64]
    values: NDArray[np.float64]
    tangent: NDArray[np.float64]
    eigenvalues: NDArray[np.complex128]
    region: NDArray[np.str_]
    special: SpecialPoints
    special_rows: tuple[int, ...]
    outcomes: tuple[Outcome, Outcome]
    closed: bool = False
    admissible: bool = True
    parameters: Mapping[str, float] = field(default_factory=dict)
    known_stability: NDArray[np.str_] | None = None
    corrector: Corrector | None = field(default=None, repr=False, metadata=LIVE)
    periods: Mapping[str, float] = field(default_factory=dict)

    @cached_property
    def stability(self) -> NDArray[np.str_]:
        """``"stable"``, ``"unstable"`` or ``"neutral"``, shape (N,)."""
        if self.known_stability is not None:
            return self.known_stability
        return stability_of(self.eigenvalues)

    @cached_property
    def stable(self) -> NDArray[np.bool_]:
        """True for stable rows, shape (N,)."""
        return self.stability == "stable"

    @property
    def outcome(self) -> Outcome:
        """The outcome of the tracing: the first unsuccessful one, else that at the last row."""
        return next((o for o in self.outcomes if not o.success), self.outcomes[-1])

    @cached_property
    def unexplained(self) -> tuple[UnexplainedChange, ...]:
        """Changes of the number of unstable eigenvalues that no special point explains."""
        return unexplained_changes(self)

    def __len__(self) -> int:
        return len(self.values)

    def __iter__(self) -> Iterator[Equilibrium]:
        return (stored(self, row, self.parameters) for row in range(len(self)))

    @overload
    def __getitem__(self, key: slice) -> Branch: ...
    @overload
    def __getitem__(self, key: int) -> Equilibrium: ...
    @overload
    def __getitem__(self, key: str) -> NDArray[np.float64]: ...
    def __getitem__(self, key: object) -> Branch | Equilibrium | NDArray[np.float64]:
        """Return a column or expression, the equilibrium of a row, or the branch of some rows.

        Raises
        ------
        UnknownNameError
            For a name that is neither a state nor a parameter.
        ArgumentError
            For text that is not an expression, or a slice that is empty or has a step.
        OutOfRangeError
            For a row that there is not.
        """
        if isinstance(key, slice):
            return slicing.rows_of(self, key)
        if isinstance(key, int | np.integer) and not isinstance(key, bool):
            return stored(self, position(key, len(self), "row"), self.parameters)
        columns = {n: self._state(k) for k, n in enumerate(self.states)}
        columns[self.parameter] = lambda: self.values
        return column(key, columns, self.parameters, len(self), by_value(self.parameter, key))

    def _state(self, k: int) -> Callable[[], NDArray[np.float64]]:
        return lambda: self.state[:, k]

    @cached_property
    def monotone_runs(self) -> MonotoneRuns:
        """Ranges of rows with monotone parameter."""
        return monotone_runs(self.values)

    @cached_property
    def regions(self) -> tuple[str, ...]:
        """The regions along the branch, each once, in order."""
        starts = np.flatnonzero(np.append(True, self.region[1:] != self.region[:-1]))
        return tuple(dict.fromkeys(self.region[starts].tolist()))

    @property
    def range(self) -> tuple[float, float]:
        """Smallest and largest value of the parameter."""
        return float(self.monotone_runs.low.min()), float(self.monotone_runs.high.max())

    @validated(stable=flag, region=text)
    def at(
        self, *, stable: bool | None = None, region: str | None = None, **value: float
    ) -> list[Equilibrium]:
        """Return the equilibria at one value of the parameter; see `Diagram.at`.

        Parameters
        ----------
        stable : bool, optional
        region : str, optional
        **value : float
            The parameter by name, e.g. ``w=1.0``.

        Returns
        -------
        list of Equilibrium
            In order along the branch.

        Raises
        ------
        UnknownNameError
            If the name is not the parameter of the branch, or the region not one of its
            regions.
        ArgumentError
            If the value is outside the range of the branch.
        """
        where = validate_value(self.parameter, self.range, "branch", value)
        found = passages(self, where, self.parameters, self.corrector)
        return filter_equilibria(found, stable, region, self.regions)

    @validated(stable=flag, region=text, code=text)
    def select(
        self,
        *,
        stable: bool | None = None,
        region: str | None = None,
        code: str | None = None,
        between: tuple[float, float] | None = None,
    ) -> tuple[Branch, ...]:
        """Return the slices of the branch whose rows satisfy all conditions, in order.

        Parameters
        ----------
        stable : bool, optional
            Select rows that are stable, or those that are not.
        region : str, optional
            Select rows in one region.
        code : str, optional
            Select slices with a special point of this code.
        between : (float, float), optional
            Select rows with the parameter in this closed interval.

        Returns
        -------
        tuple of Branch

        Raises
        ------
        UnknownNameError
            For an unknown region or code.
        ArgumentError
            For an invalid interval.
        """
        if region is not None and region not in self.regions:
            raise unknown_name("region", region, self.regions)
        return slicing.parts_of(self, stable, region, code, between)

    def stable_intervals(self) -> NDArray[np.float64]:
        """Return the intervals of the parameter over which the branch is stable, shape (k, 2).

        One interval for each stable slice of the branch, in order. An interval
        bounded by a special point ends exactly there.
        """
        return self._stable_intervals

    @cached_property
    def _stable_intervals(self) -> NDArray[np.float64]:
        return stability_intervals.stable_intervals(self)

    def nearest(self, **values: float) -> Equilibrium:
        """Return the point of the branch nearest to given values of states and parameter.

        Distances are measured in units of each column's range. A point between rows
        is interpolated and, if the model is attached, corrected at its parameter value.

        Parameters
        ----------
        **values : float
            At least one, e.g. ``w=0.1, x=0.3``.

        Returns
        -------
        Equilibrium

        Raises
        ------
        UnknownNameError
            For a name that is neither a state nor the parameter.
        ArgumentError
            For a number that is not finite, or without any value.
        """
        return nearest_of([self], self.parameters, values, self.corrector)

    @validated(x=formula, y=formula)
    def intersections(self, other: Branch, x: str, y: str) -> NDArray[np.float64]:
        """Compute the intersections of two branches in the plane of two columns, shape (k, 2).

        Both curves are interpolated by cubics with their tangents. An intersection in
        a plane need not be a common equilibrium if there are more columns.

        Parameters
        ----------
        other : Branch
            Over the same parameter.
        x, y : str
            Two of the columns: states and the parameter.

        Returns
        -------
        ndarray
            Values of x and y, in order along this branch. Overlapping segments of
            both curves have no intersections.

        Raises
        ------
        UnknownNameError
            For a name that is not a column of both branches.
        ArgumentError
            If both branches are the same.
        """
        return intersections(self, other, (str(x), str(y)))

    @property
    def points(self) -> NDArray[np.float64]:
        """States and parameter, shape (N, n + 1)."""
        return np.column_stack([self.state, self.values])

    @property
    def point_names(self) -> tuple[str, ...]:
        """The names of the columns of `points`."""
        return (*self.states, self.parameter)

    def to_dict(self) -> dict[str, NDArray[Any]]:
        """Return parameter, states, region, stability, eigenvalues and labels of special points."""
        return {
            self.parameter: self.values,
            **{name: self.state[:, k] for k, name in enumerate(self.states)},
            "region": self.region,
            "stability": self.stability,
            **numbered("eigenvalue", self.eigenvalues),
            "label": labels_at(self.special, self.special_rows, len(self)),
        }

    def monotone_pieces(self) -> Iterator[MonotonePiece]:
        """Yield the ranges of rows in one region with strictly monotone parameter.

        Vertical segments, where the parameter is constant, are omitted.
        """
        change = np.diff(self.values)
        step = np.sign(change)
        span = max(float(np.ptp(self.values)), np.finfo(float).tiny)
        step[np.abs(change) <= 1e-13 * span] = 0
        step[self.region[1:] != self.region[:-1]] = 0
        edges = np.flatnonzero(step[1:] != step[:-1]) + 1
        for start, stop in zip([0, *edges.tolist()], [*edges.tolist(), len(step)], strict=True):
            if stop > start and step[start] != 0:
                yield MonotonePiece(start, stop + 1, str(self.region[start]))

    def _cells(self) -> Cells:
        return points_cells(self.special, (self.parameter,))

    def __repr__(self) -> str:
        low, high = self.range
        codes = "".join(f" {p.label}" for p in self.special)
        failed = [
            f"{outcome.code} at {self.parameter} = {self.values[row]:.6g}"
            for outcome, row in zip(self.outcomes, (0, -1), strict=True)
            if not outcome.success
        ]
        return (
            f"Branch({len(self)} points, {self.parameter} from {low:.6g} to {high:.6g}, "
            f"regions {' → '.join(self.regions)}"
            + (f";{codes}" if codes else "")
            + "".join(f"; {words}" for words in dict.fromkeys(failed))
            + ")"
        )
