"""A branch of equilibria, stored as a table."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fastslow.arguments import Condition, Name, flag, formula, instance, text, validated
from fastslow.errors import unknown_name
from fastslow.results.angles import periods_of, principal
from fastslow.results.base.display import Displayed
from fastslow.results.base.html import Cells
from fastslow.results.base.intervals import limits_of
from fastslow.results.base.outcome import Outcome
from fastslow.results.base.result import LIVE
from fastslow.results.base.table import at_values, inside, named_value, numbered
from fastslow.results.branch import stability_intervals
from fastslow.results.branch.curve import TracedCurve
from fastslow.results.branch.curve_intersections import intersections
from fastslow.results.branch.interpolation import hermite
from fastslow.results.branch.nearest import nearest_place
from fastslow.results.branch.table import Place
from fastslow.results.branch.unexplained import UnexplainedChange, unexplained_changes
from fastslow.results.points import Corrector, Equilibrium, SpecialPoints
from fastslow.results.stored.operations import AT_REST


@dataclass(frozen=True)
class MonotonePiece(Displayed):
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
class Branch(TracedCurve[Equilibrium]):
    """A curve of equilibria, with one row for each computed point along its arclength.

    A boundary equilibrium has two rows, the last one of the region left and the
    first one of the region entered, so that the eigenvalues of every row belong to
    its own region.

    ``branch["x"]`` is a column and ``branch["x**2 + v"]`` an expression in states
    and parameters, ``branch["LP1"]`` the special point with this label; ``branch[3]``
    and iteration return the equilibria of rows, and ``branch[10:50]`` returns the
    branch of those rows, with its special points.

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
    definitions : mapping
        Named definitions of the model as text, which expressions may contain.

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
    definitions: Mapping[str, str] = field(default_factory=dict)

    @property
    def _free(self) -> tuple[str, ...]:
        return (self.parameter,)

    def _coordinate(self) -> str:
        return self.parameter

    def _more(self) -> dict[str, Any]:
        return {"known_stability": self.known_stability, "periods": self.periods}

    @property
    def stability(self) -> NDArray[np.str_]:
        """``"stable"``, ``"unstable"``, ``"neutral"`` or ``"undecided"``, shape (N,)."""
        return self.table.stability

    @property
    def stable(self) -> NDArray[np.bool_]:
        """True for stable rows, shape (N,)."""
        return self.table.stable

    @property
    def regions(self) -> tuple[str, ...]:
        """The regions along the branch, each once, in order."""
        return self.table.regions

    @property
    def range(self) -> tuple[float, float]:
        """Smallest and largest value of the parameter."""
        return self.table.range

    @cached_property
    def unexplained(self) -> tuple[UnexplainedChange, ...]:
        """Changes of the number of unstable eigenvalues that no special point explains."""
        return unexplained_changes(self.table)

    def _item(self, row: int) -> Equilibrium:
        return self._equilibrium(Place(row, 0.0, float(self.values[row])))

    def _equilibrium(self, place: Place) -> Equilibrium:
        """Return the equilibrium at a place; between rows it is solved for or interpolated."""
        row, part, value, vertical = place
        if part == 0.0:
            if self.corrector is not None and AT_REST in str(self.region[row]):
                # with the contact forces
                solved = self.corrector(str(self.region[row]), self.state[row], value)
                if solved is not None:
                    return solved
            return self._made(row, self.state[row], value, self.eigenvalues[row], vertical)
        low, high = self.values[row : row + 2]
        if min(low, high) < value < max(low, high):
            state = hermite(self.table, np.array([row]), np.array([value]))[0]
            if self.corrector is not None:
                solved = self.corrector(str(self.region[row]), state, value)
                if solved is not None:
                    return solved
            part = (value - low) / (high - low)
        else:
            state = (1 - part) * self.state[row] + part * self.state[row + 1]
        pair = self.eigenvalues[row : row + 2]
        # separately, because a complex number times an infinite one (of sliding) is NaN
        real, imaginary = (np.array([1 - part, part]) @ p for p in (pair.real, pair.imag))
        made = self._made(row, state, value, real + 1j * imaginary, near=row + (part >= 0.5))
        return replace(made, residual=float("nan"), interpolated=True)

    def _made(
        self,
        row: int,
        state: NDArray[np.float64],
        value: float,
        eigenvalues: NDArray[np.complex128],
        continuum: bool = False,
        near: int | None = None,
    ) -> Equilibrium:
        """Return an equilibrium in the region of a row, with the stability of a near one."""
        stability = self.known_stability
        return Equilibrium(
            self.states,
            principal(state, periods_of(self.states, self.periods)),
            {**self.parameters, self.parameter: value},
            str(self.region[row]),
            self.admissible,
            eigenvalues.copy(),
            continuum=continuum,
            known_stability=None if stability is None else str(stability[near or row]),
        )

    @validated(stable=flag, region=text)
    def at(
        self, *, stable: bool | None = None, region: str | None = None, **value: Any
    ) -> list[Any]:
        """Return the equilibria at values of the parameter; see `Diagram.at`.

        Parameters
        ----------
        stable : bool, optional
        region : str, optional
        **value : float or array_like, shape (m,)
            The parameter by name, e.g. ``w=1.0``.

        Returns
        -------
        list of Equilibrium, or list of m such lists
            In order along the branch.

        Raises
        ------
        UnknownNameError
            If the name is not the parameter of the branch, or the region not one of its
            regions.
        ArgumentError
            If the value is outside the range of the branch.
        """
        name, given = named_value("branch parameter", [self.parameter], value)
        check_region(region, self.regions)

        def query(number: float) -> list[Equilibrium]:
            inside("branch", name, number, self.range)
            return self._at(number, stable, region)

        return at_values(name, given, query)

    def _at(self, value: float, stable: bool | None, region: str | None) -> list[Equilibrium]:
        """Return the equilibria at a value in the range."""
        return filtered(map(self._equilibrium, self.table.places(value)), stable, region)

    @validated(stable=flag, region=text, code=text)
    def select(
        self,
        condition: Condition | None = None,
        /,
        *,
        stable: bool | None = None,
        region: str | None = None,
        code: str | None = None,
        between: tuple[float, float] | None = None,
    ) -> tuple[Branch, ...]:
        """Return the slices of the branch whose rows satisfy all conditions, in order.

        Parameters
        ----------
        condition : str or Expr, optional
            A condition in states and parameters, such as ``"x > 0 and x**2 + v < 1"``.
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
            For an unknown column, region or code.
        ArgumentError
            For text that is not a condition, or an invalid interval.
        """
        check_region(region, self.regions)
        if code is not None:
            self.special._check_code(code)
        return self._selected(condition, stable, region, code, between)

    def _selected(
        self,
        condition: Condition | None,
        stable: bool | None,
        region: str | None,
        code: str | None,
        between: tuple[float, float] | None,
    ) -> tuple[Branch, ...]:
        """Return the slices of valid conditions."""
        wanted = self._where(condition)
        if stable is not None:
            wanted = wanted & (self.stable == stable)
        if region is not None:
            wanted = wanted & (self.region == region)
        if between is not None:
            low, high = limits_of(between)
            wanted = wanted & (self.values >= low) & (self.values <= high)
        return self._slices(wanted, code)

    def stable_intervals(self) -> NDArray[np.float64]:
        """Return the intervals of the parameter over which the branch is stable, shape (k, 2).

        One interval for each stable slice of the branch, in order. An interval
        bounded by a special point ends exactly there.
        """
        return self._stable_intervals

    @cached_property
    def _stable_intervals(self) -> NDArray[np.float64]:
        return stability_intervals.stable_intervals(self.table)

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
        return self._equilibrium(nearest_place([self.table], values)[1])

    @validated(x=formula, y=formula)
    def intersections(self, other: Branch, x: Name, y: Name) -> NDArray[np.float64]:
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
        instance(Branch)("other", other)
        return intersections(self.table, other.table, (str(x), str(y)))

    def to_dict(self) -> dict[str, NDArray[Any]]:
        """Return parameter, states, region, stability, eigenvalues and labels of special points."""
        return {
            self.parameter: self.values,
            **{name: self.state[:, k] for k, name in enumerate(self.states)},
            "region": self.region,
            "stability": self.stability,
            **numbered("eigenvalue", self.eigenvalues),
            "label": self.table.labels,
        }

    def monotone_pieces(self) -> Iterator[MonotonePiece]:
        """Yield the ranges of rows in one region with strictly monotone parameter.

        Vertical segments, where the parameter is constant, are omitted.
        """
        change = np.diff(self.values)
        step = np.sign(change)
        span = max(float(np.ptp(self.values)), np.finfo(float).tiny)
        step[np.abs(change) <= 1e-13 * span] = 0
        step[self.table.region_changes - 1] = 0
        edges = np.flatnonzero(step[1:] != step[:-1]) + 1
        for start, stop in zip([0, *edges.tolist()], [*edges.tolist(), len(step)], strict=True):
            if stop > start and step[start] != 0:
                yield MonotonePiece(start, stop + 1, str(self.region[start]))

    def _cells(self) -> Cells:
        return self.special._cells((self.parameter,))

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


def check_region(region: str | None, regions: tuple[str, ...]) -> None:
    """Raise UnknownNameError for a region that is not one of those given."""
    if region is not None and region not in regions:
        raise unknown_name("region", region, regions)


def filtered(
    found: Iterable[Equilibrium], stable: bool | None, region: str | None
) -> list[Equilibrium]:
    """Return the equilibria of a stability and a region."""
    return [e for e in found if stable in (None, e.stable) and region in (None, e.region)]
