"""Branches of periodic orbits over one parameter."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from itertools import pairwise
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from fastslow.arguments import Condition, flag, instance, items, text, validated
from fastslow.errors import unknown_name
from fastslow.formulas.definitions import with_definitions
from fastslow.results.base.html import Cells
from fastslow.results.base.immutable import read_only
from fastslow.results.base.intervals import limits_of
from fastslow.results.base.outcome import Outcome, with_notes
from fastslow.results.base.result import LIVE
from fastslow.results.base.table import at_values, check_values, inside, named_value, numbered
from fastslow.results.branch import stability_intervals
from fastslow.results.branch.curve import LabelledCurve
from fastslow.results.branch.nearest import nearest_place
from fastslow.results.branch.table import BranchTable, Place
from fastslow.results.branch.unexplained import UnexplainedChange, unexplained_changes
from fastslow.results.orbits.functionals import EXTREMES, split
from fastslow.results.orbits.interpolated_orbits import interpolated
from fastslow.results.orbits.orbit import Itinerary, Orbit, stability_of_logs
from fastslow.results.orbits.orbit_arrays import OrbitArrays
from fastslow.results.orbits.special_orbit import SpecialOrbit, SpecialOrbits
from fastslow.results.point_types import (
    END_POINT,
    POINT_TYPES,
)

Array = NDArray[np.float64]

#: Ends of a branch that its first line says.
COMPLETE = ("end of range", "closed loop")

#: Codes of the points to which cycles shrink at the end of a branch, by outcome.
VANISHING = {one.shrinking: code for code, one in POINT_TYPES.items() if one.shrinking}

#: Codes of the points at which a branch ends, by outcome, where they are no orbits of the branch.
END_CODES = {
    **VANISHING,
    **{outcome: code for code, one in POINT_TYPES.items() for outcome in one.ending},
}


class OrbitCorrector(Protocol):
    """Solves for the orbit of a branch at a value of its parameter, near another orbit."""

    def __call__(self, orbit: Orbit, value: float, /) -> Orbit | None:
        """Return the orbit, None without convergence."""


@dataclass(frozen=True, eq=False, repr=False)
class OrbitBranch(LabelledCurve[Orbit]):
    """A curve of periodic orbits, with one row for each computed orbit along its arclength.

    ``branch["max(x)"]``, ``min``, ``mean`` and ``rms`` of expressions are columns, as are
    ``branch["abs(multiplier_1)"]``, ``re`` and ``im`` of multipliers, the parameter, ``"period"``
    and ``"hits"`` (crossings per period); a state is a column of a forced model, its value at time
    0 of the forcing. ``branch[3]`` and iteration return the orbits of rows, ``branch["LPC1"]`` a
    special point, and ``branch[10:50]`` the branch of those rows.

    Parameters
    ----------
    parameter : str
        The continuation parameter.
    values : ndarray, shape (N,)
        Its values.
    period : ndarray, shape (N,)
    multiple : int or None
        Number of periods of the forcing; None without forcing.
    multipliers : ndarray of complex, shape (N, n)
        Floquet multipliers of each row, the largest modulus first.
    log_multipliers : ndarray, shape (N, n)
    trivial : ndarray of int64, shape (N,)
        Index of the multiplier 1 of an autonomous model, −1 with forcing.
    errors : ndarray, shape (N, 3)
        Defect, residual and accuracy of every orbit (see `Orbit`).
    special : SpecialOrbits
        In order along the branch; ``branch.special("PD")`` selects one code.
    special_rows : tuple of int
        The row of each special point.
    outcomes : tuple of Outcome
        The outcomes at the first and the last row.
    closed : bool
        True for a closed curve.
    spans : ndarray, shape (N, 2)
        First and last time of the trajectory of each row.
    ends : ndarray, shape (N, 1 + n)
        Its last time and state.
    steps, series, crossing_table : ndarray
        Tables of all trajectories, one after another (see `Trajectory`).
    counts : ndarray of int64, shape (N, 3)
        Numbers of steps, crossings and resets of each row; without resets (N, 2) in files of
        earlier versions.
    template : Orbit
        The orbit of the first row, for all that the rows have in common.
    corrector : callable, optional
        Solves for orbits between rows; not saved to files.
    reset_table : ndarray, optional
        As the other tables, with events and changes of switches; None for a model without resets,
        events and switches.

    Examples
    --------
    >>> import sympy as sp, fastslow as fs
    >>> x, v, a, t = sp.symbols("x v a t")
    >>> model = fs.Model({x: v, v: a * sp.sin(t) - x - v}, parameters={a: 1})
    >>> branch = fs.continue_orbits(fs.find_orbit(model, [-1, 0]), "a", over=(0.5, 2))
    >>> round(branch.at(a=1.5)[0]["max(x)"], 12)
    1.5
    """

    parameter: str
    values: Array
    period: Array
    multiple: int | None
    multipliers: NDArray[np.complex128]
    log_multipliers: Array
    trivial: NDArray[np.int64]
    errors: Array
    special: SpecialOrbits
    special_rows: tuple[int, ...]
    outcomes: tuple[Outcome, Outcome]
    closed: bool
    spans: Array
    ends: Array
    steps: Array
    series: Array
    crossing_table: Array
    counts: NDArray[np.int64]
    template: Orbit
    corrector: OrbitCorrector | None = field(default=None, repr=False, metadata=LIVE)
    reset_table: Array | None = None

    @property
    def definitions(self) -> dict[str, str]:
        """The named definitions of the model as text."""
        return self.template.trajectory.definitions

    @property
    def parameters(self) -> Mapping[str, float]:
        """The values of all other parameters."""
        return {k: v for k, v in self.template.parameters.items() if k != self.parameter}

    @property
    def states(self) -> tuple[str, ...]:
        """States, then slow states."""
        return self.template.states

    @property
    def equations(self) -> str:
        """The model as text."""
        return self.template.equations

    @cached_property
    def table(self) -> BranchTable:
        """The rows, with the period and the last state of each trajectory as columns."""
        return self._table(("period", *self.states), (self.period, *self.ends[:, 1:].T))

    def _table(self, names: tuple[str, ...], columns: Iterable[Array]) -> BranchTable:
        """The rows with given columns; the tangents are those of secants."""
        points = np.column_stack([*columns, self.values])
        with np.errstate(invalid="ignore"):
            tangent = np.gradient(points, axis=0) if len(self) > 1 else np.zeros_like(points)
        # beside a homoclinic orbit, whose period is infinite
        tangent[~np.isfinite(tangent)] = 0.0
        length = np.linalg.norm(tangent, axis=1, keepdims=True)
        return BranchTable(
            columns=names,
            free=(self.parameter,),
            points=read_only(points),
            tangent=tangent / np.where(length > 0, length, 1.0),
            special=self.special,
            special_rows=self.special_rows,
            eigenvalues=self.multipliers,
            region=np.array([" → ".join(route) for route in self.itineraries]),
            closed=self.closed,
            known_stability=self.stability,
        )

    @cached_property
    def stability(self) -> NDArray[np.str_]:
        """``"stable"``, ``"unstable"``, ``"neutral"``, or ``"unknown"`` at grazings of walls."""
        logs = zip(self.log_multipliers, self.trivial, strict=True)
        return np.array([stability_of_logs(row, int(own)) for row, own in logs])

    @property
    def stable(self) -> NDArray[np.bool_]:
        """True for stable rows, shape (N,)."""
        return self.stability == "stable"

    @property
    def range(self) -> tuple[float, float]:
        """Smallest and largest value of the parameter."""
        return self.table.range

    @cached_property
    def unexplained(self) -> tuple[UnexplainedChange, ...]:
        """Changes of the number of unstable multipliers that no special point explains."""
        logs = self.log_multipliers.astype(complex)
        # perturbations along the orbit do not count
        forced = self.trivial < 0
        logs[~forced, self.trivial[~forced]] = -np.inf
        return unexplained_changes(replace(self.table, eigenvalues=logs))

    @cached_property
    def orbits(self) -> tuple[Orbit, ...]:
        """The orbits of all rows."""
        return tuple(map(self._item, range(len(self))))

    @cached_property
    def itineraries(self) -> tuple[Itinerary, ...]:
        """The itinerary of every row."""
        names, modes = self.template.trajectory.modes, self.steps[:, 2].astype(np.int64)
        parts = (modes[first:last] for first, last in pairwise(self._first[:, 0].tolist()))
        # the last segment of a period continues in the first
        changes = (own[:-1][own[1:] != own[:-1]].tolist() or [int(own[0])] for own in parts)
        return tuple(Itinerary(names[mode] for mode in one) for one in changes)

    def __iter__(self) -> Iterator[Orbit]:
        return iter(self.orbits)

    def _item(self, row: int) -> Orbit:
        if "orbits" in self.__dict__:
            return self.orbits[row]
        (steps, crossings, reset), (more, further, next_) = self._first[row : row + 2]
        own = int(self.trivial[row])
        defect, residual, accuracy = self.errors[row].tolist()
        start, end = self.spans[row].tolist()
        return OrbitArrays(
            template=self.template,
            parameter=self.parameter,
            value=float(self.values[row]),
            period=float(self.period[row]),
            multipliers=self.multipliers[row],
            log_multipliers=self.log_multipliers[row],
            trivial=None if own < 0 else own,
            errors=(defect, residual, accuracy),
            span=(start, end),
            end=self.ends[row],
            steps=self.steps[steps:more],
            series=self.series[steps:more],
            crossing_table=self.crossing_table[crossings:further],
            reset_table=self._resets[reset:next_],
        ).orbit()

    @cached_property
    def _first(self) -> NDArray[np.int64]:
        """First step, crossing and reset of every row, and their numbers in total."""
        counts = np.zeros((len(self.counts), 3), dtype=np.int64)
        counts[:, : self.counts.shape[1]] = self.counts
        return np.vstack([np.zeros((1, 3), dtype=np.int64), np.cumsum(counts, axis=0)])

    @property
    def _resets(self) -> Array:
        nothing = np.zeros((0, 2 + 2 * len(self.states)))
        return nothing if self.reset_table is None else self.reset_table

    def _coordinate(self) -> str:
        return self.parameter

    def _read(self, key: Any) -> tuple[Any, dict[str, Callable[[], Array]]]:
        """A key with names in place of functionals, and the columns with these names."""
        columns = dict(self._columns())
        key = with_definitions(key, self.definitions)
        written, functionals = split(key) if isinstance(key, str) else (key, {})
        for own, (which, argument) in functionals.items():
            columns[own] = partial(self._functional, which, argument)
        return written, columns

    def _functional(self, which: str, argument: str) -> Array:
        """A number of the orbit of every row; the extremes of a state are computed together."""
        name, known = f"{which}({argument})", self._functionals
        if name not in known:
            if which in EXTREMES and argument in self.states:
                names = [f"{each}({argument})" for each in EXTREMES]
                dense = (orbit.trajectory.dense for orbit in self.orbits)
                rows = np.array([one.extremes(argument, one.span) for one in dense]).T.copy()
            else:
                names, rows = [name], np.array([[orbit[name] for orbit in self.orbits]])
            rows.flags.writeable = False
            known |= dict(zip(names, rows, strict=True))
        return known[name]

    @cached_property
    def _functionals(self) -> dict[str, Array]:
        return {}

    def _columns(self) -> Mapping[str, Callable[[], Array]]:
        columns: dict[str, Callable[[], Array]] = {
            self.parameter: lambda: self.values,
            "period": lambda: self.period,
            "hits": lambda: self._hits,
        }
        if self.multiple is not None:
            for k, name in enumerate(self.states):
                columns[name] = partial(self._state, k)
        return columns

    def _state(self, k: int) -> Array:
        return self._strobed[:, k]

    @cached_property
    def _hits(self) -> Array:
        return np.array([float(orbit.hits()) for orbit in self.orbits])

    @cached_property
    def _strobed(self) -> Array:
        """States at time 0 of the forcing, shape (N, n)."""
        return np.array([orbit(0.0) for orbit in self.orbits])

    def to_dict(self) -> dict[str, NDArray[Any]]:
        """Return parameter, period, extremes, hits, itinerary, stability, multipliers, labels."""
        return {
            self.parameter: self.values,
            "period": self.period,
            **{f"min({name})": self._functional("min", name) for name in self.states},
            **{f"max({name})": self._functional("max", name) for name in self.states},
            "hits": self._hits,
            "itinerary": self.table.region,
            "stability": self.stability,
            **numbered("multiplier", self.multipliers),
            "label": self.table.labels,
        }

    def _sliced(self, start: int, stop: int) -> dict[str, Any]:
        (step, crossing, reset), (last, further, next_) = self._first[start], self._first[stop]
        known = self.reset_table is not None
        return super()._sliced(start, stop) | {
            "steps": self.steps[step:last],
            "series": self.series[step:last],
            "crossing_table": self.crossing_table[crossing:further],
            "reset_table": self._resets[reset:next_] if known else None,
        }

    @validated(stable=flag, itinerary=items(text))
    def at(
        self, *, stable: bool | None = None, itinerary: Sequence[str] | None = None, **value: Any
    ) -> Any:
        """Return the orbits at values of the parameter.

        Between rows they are solved for; on a branch loaded from a file they are interpolated
        between orbits of the same itinerary, else that of the nearest row is returned. A note
        in their outcome says so.

        Parameters
        ----------
        stable : bool, optional
            Select stable or unstable orbits.
        itinerary : sequence of str, optional
            Select orbits with this sequence of regions, or a rotation of it.
        **value : float or array_like, shape (m,)
            The parameter by name, e.g. ``w=1.0``.

        Returns
        -------
        list of Orbit, or list of m such lists
            In order along the branch.

        Raises
        ------
        UnknownNameError
            If the name is not the parameter of the branch, or the itinerary not one of its
            itineraries.
        ArgumentError
            If the value is outside the range of the branch.
        """
        name, given = named_value("branch parameter", [self.parameter], value)
        wanted = self._itinerary(itinerary)

        def query(number: float) -> list[Orbit]:
            inside("branch", name, number, self.range)
            places = self.table.places(number)
            found = (self._orbit(place) for place in places if self._may_be(place, stable))
            return [
                orbit
                for orbit in found
                if stable in (None, orbit.stable) and wanted in (None, orbit.itinerary)
            ]

        return at_values(name, given, query)

    def _may_be(self, place: Place, stable: bool | None) -> bool:
        """Whether an orbit may have a stability: not if the rows beside it have another one."""
        excluded = {None: "", True: "unstable", False: "stable"}[stable]
        beside = [place.row] if place.part == 0.0 else [place.row, place.row + 1]
        return not (self.stability[beside] == excluded).all()

    def _itinerary(self, regions: Sequence[str] | None) -> Itinerary | None:
        """Validate an itinerary of the branch."""
        if regions is None:
            return None
        wanted, known = Itinerary(regions), dict.fromkeys(self.itineraries)
        if wanted not in known:
            raise unknown_name(
                "itinerary", " → ".join(wanted), [" → ".join(route) for route in known]
            )
        return wanted

    def _orbit(self, place: Place) -> Orbit:
        """The orbit at a place; between rows it is solved for or interpolated."""
        row, part, value, _ = place
        if part == 0.0:
            return self._item(row)
        near = row + (part >= 0.5)
        # beside a special point the equations are singular
        start = near if near not in self.special_rows else 2 * row + 1 - near
        if self.corrector is not None:
            solved = self.corrector(self._item(start), value)
            if solved is not None and solved.outcome:
                return solved
        between = interpolated(self._item(row), self._item(row + 1), part, self.parameter, value)
        if between is not None:
            return between
        note = f"This is the row at {self.parameter} = {self.values[near]:.9g}, not at {value:.9g}."
        orbit = self._item(near)
        return replace(orbit, outcome=with_notes(orbit.outcome, [note]))

    @validated(stable=flag, itinerary=items(text), code=text)
    def select(
        self,
        condition: Condition | None = None,
        /,
        *,
        stable: bool | None = None,
        itinerary: Sequence[str] | None = None,
        code: str | None = None,
        between: tuple[float, float] | None = None,
    ) -> tuple[OrbitBranch, ...]:
        """Return the slices of the branch whose rows satisfy all conditions, in order.

        Parameters
        ----------
        condition : str or Expr, optional
            A condition in columns and parameters, such as ``"max(x) > 1"``.
        stable : bool, optional
            Select rows that are stable, or those that are not.
        itinerary : sequence of str, optional
            Select rows with this sequence of regions, or a rotation of it.
        code : str, optional
            Select slices with a special point of this code, or of this name in ``marks=``.
        between : (float, float), optional
            Select rows with the parameter in this closed interval.

        Returns
        -------
        tuple of OrbitBranch

        Raises
        ------
        UnknownNameError
            For an unknown column, itinerary or code.
        ArgumentError
            For text that is not a condition, or an invalid interval.
        """
        if code is not None:
            self.special.check_code(code)
        wanted, route = self._where(condition), self._itinerary(itinerary)
        if stable is not None:
            wanted = wanted & (self.stable == stable)
        if route is not None:
            wanted = wanted & np.array([route == one for one in self.itineraries])
        if between is not None:
            low, high = limits_of(between)
            wanted = wanted & (self.values >= low) & (self.values <= high)
        return self._slices(wanted, code)

    def stable_intervals(self) -> Array:
        """Return the intervals of the parameter over which the branch is stable, shape (k, 2).

        One interval for each stable slice of the branch, in order. An interval bounded by a
        special point ends exactly there.
        """
        return stability_intervals.stable_intervals(self.table)

    def nearest(self, **values: float) -> Orbit:
        """Return the orbit of the branch nearest to given values of the parameter and columns.

        Distances are measured in units of each column's range. An orbit between rows is
        that of `at`.

        Parameters
        ----------
        **values : float
            At least one, e.g. ``W=0.8``, ``period=7.5``.

        Returns
        -------
        Orbit

        Raises
        ------
        UnknownNameError
            For a name that is not a column.
        ArgumentError
            For a number that is not finite, or without any value.
        """
        columns = self._columns()
        check_values(values, columns, "column")
        names = tuple(name for name in values if name != self.parameter)
        table = self._table(names, [columns[name]() for name in names])
        _, place = nearest_place([table], values)
        return self._orbit(place)

    def _cells(self) -> Cells:
        return self.special._cells()

    def __repr__(self) -> str:
        low, high = self.range
        routes = list(dict.fromkeys(" → ".join(route) for route in self.itineraries))
        counts = ", ".join(
            f"{(self.stability == word).sum()} {word}" for word in np.unique(self.stability)
        )
        lines = [
            f"OrbitBranch({len(self)} orbits, {self.parameter} from {low:.6g} to {high:.6g}: "
            f"{counts})",
            f"  period from {self.period.min():.6g} to {self.period.max():.6g}, "
            f"{len(routes)} {'itineraries' if len(routes) > 1 else 'itinerary'}",
        ]
        shown = [
            f"{p.label} {p.words} at {p.parameters[self.parameter]:.10g}" for p in self.special
        ]
        lines += [f"  {words}" for words in shown[:4]]
        if len(shown) > 4:
            more = f"{len(shown) - 4} more special point{'s' * (len(shown) > 5)}"
            lines.append(f"  and {more}")
        for change in self.unexplained[:1]:
            first, last = change.interval
            lines.append(
                f"  {change.before} to {change.after} unstable multipliers between "
                f"{self.parameter} = {first:.8g} and {last:.8g}, which no special point explains"
            )
        places = {p.parameters[self.parameter] for p in self.special}
        ended = [
            str(outcome)
            for outcome, value in zip(self.outcomes, self[self.parameter][[0, -1]], strict=True)
            if not outcome
            or outcome.notes
            or (outcome.code not in COMPLETE and value not in places)
        ]
        lines += [f"  {words}" for words in dict.fromkeys(ended)]
        return "\n".join(lines)


def end_points(branch: OrbitBranch) -> tuple[tuple[str, int, str], ...]:
    """Return code, row and text of the ends at special points, and of those where tracing failed.

    The text is the outcome of a failed end, otherwise empty; ends that are special points of the
    branch are left out.
    """
    known = set(zip((p.code for p in branch.special), branch.special_rows, strict=True))
    found: dict[tuple[str, int], str] = {}
    for outcome, row in zip(branch.outcomes, (0, len(branch) - 1), strict=True):
        if not outcome:
            found[END_POINT, row] = outcome.code
        elif outcome.code in END_CODES:
            found[END_CODES[outcome.code], row] = ""
    return tuple((*key, text) for key, text in found.items() if key not in known)


def branch_of(
    rows: Sequence[OrbitArrays],
    points: Sequence[SpecialOrbit | None],
    outcomes: tuple[Outcome, Outcome],
    closed: bool,
    corrector: OrbitCorrector | None,
) -> OrbitBranch:
    """Return the branch of given orbits, with the special points of some of them."""
    numbers: dict[str, int] = {}
    labelled, numbered_rows = [], []
    for row, point in enumerate(points):
        if point is not None:
            numbers[point.stem] = numbers.get(point.stem, 0) + 1
            labelled.append(replace(point, label=f"{point.stem}{numbers[point.stem]}"))
            numbered_rows.append(row)
    template = rows[0].orbit()
    return OrbitBranch(
        parameter=rows[0].parameter,
        values=np.array([row.value for row in rows]),
        period=np.array([row.period for row in rows]),
        multiple=template.multiple,
        multipliers=np.array([row.multipliers for row in rows]),
        log_multipliers=np.array([row.log_multipliers for row in rows]),
        trivial=np.array(
            [-1 if row.trivial is None else row.trivial for row in rows], dtype=np.int64
        ),
        errors=np.array([row.errors for row in rows]),
        special=SpecialOrbits(labelled),
        special_rows=tuple(numbered_rows),
        outcomes=outcomes,
        closed=closed,
        spans=np.array([row.span for row in rows]),
        ends=np.array([row.end for row in rows]),
        steps=np.concatenate([row.steps for row in rows]),
        series=np.concatenate([row.series for row in rows]),
        crossing_table=np.concatenate([row.crossing_table for row in rows]),
        counts=np.array([list(map(len, (r.steps, r.crossing_table, r.reset_table))) for r in rows]),
        template=template,
        corrector=corrector,
        reset_table=None
        if all(
            getattr(template.trajectory, f"{kind}_table") is None
            for kind in ("reset", "switch", "event")
        )
        else np.concatenate([row.reset_table for row in rows]),
    )


def branches_of_orbits(name: str, value: Any) -> tuple[OrbitBranch, ...]:
    """Accept a branch of orbits, or a sequence of such branches, as an argument."""
    if isinstance(value, OrbitBranch):
        return (value,)
    check = instance(OrbitBranch)
    return items(check)(name, value) if isinstance(value, tuple | list) else check(name, value)
