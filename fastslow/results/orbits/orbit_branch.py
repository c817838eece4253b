"""Branches of periodic orbits over one parameter."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from fastslow.arguments import Condition, flag, text, validated
from fastslow.errors import ArgumentError, unknown_name
from fastslow.formulas.columns import rows_where
from fastslow.results.base.intervals import limits_of, runs_of
from fastslow.results.base.outcome import Outcome, with_notes
from fastslow.results.base.result import LIVE, Result
from fastslow.results.base.table import (
    Table,
    at_values,
    inside,
    named_value,
    numbered,
)
from fastslow.results.io.html import Cells
from fastslow.results.orbits.functionals import split
from fastslow.results.orbits.orbit import Itinerary, Orbit, stability_of_logs
from fastslow.results.orbits.special_orbit import SpecialOrbit, SpecialOrbits
from fastslow.results.trajectory.trajectory import Trajectory

Array = NDArray[np.float64]


class OrbitCorrector(Protocol):
    """Solves for the orbit of a branch at a value of its parameter, near another orbit."""

    def __call__(self, orbit: Orbit, value: float, /) -> Orbit | None:
        """Return the orbit, None without convergence."""


@dataclass(frozen=True, eq=False, repr=False)
class OrbitBranch(Table[Orbit], Result):
    """A curve of periodic orbits, with one row for each computed orbit along its arclength.

    ``branch["max(x)"]``, ``min``, ``mean`` and ``rms`` of expressions are columns, as are the
    parameter, ``"period"`` and ``"hits"`` (crossings per period); a state is a column of a forced
    model, its value at time 0 of the forcing. ``branch[3]`` and iteration return the orbits of
    rows, ``branch["LPC1"]`` a special point, and ``branch[10:50]`` the branch of those rows.

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
    counts : ndarray of int64, shape (N, 2)
        Numbers of steps and crossings of each row.
    template : Orbit
        The orbit of the first row, for all that the rows have in common.
    corrector : callable, optional
        Solves for orbits between rows; not saved to files.

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
    def stability(self) -> NDArray[np.str_]:
        """``"stable"``, ``"unstable"`` or ``"neutral"``, shape (N,)."""
        rows = zip(self.log_multipliers, self.trivial, strict=True)
        return np.array([stability_of_logs(logs, int(own)) for logs, own in rows])

    @cached_property
    def stable(self) -> NDArray[np.bool_]:
        """True for stable rows, shape (N,)."""
        return self.stability == "stable"

    @property
    def outcome(self) -> Outcome:
        """The outcome of the tracing: the first unsuccessful one, else that at the last row."""
        return next((o for o in self.outcomes if not o.success), self.outcomes[-1])

    @property
    def range(self) -> tuple[float, float]:
        """Smallest and largest value of the parameter."""
        return float(self.values.min()), float(self.values.max())

    @cached_property
    def orbits(self) -> tuple[Orbit, ...]:
        """The orbits of all rows."""
        return tuple(map(self._item, range(len(self))))

    @cached_property
    def itineraries(self) -> tuple[Itinerary, ...]:
        """The itinerary of every row."""
        return tuple(orbit.itinerary for orbit in self.orbits)

    def __len__(self) -> int:
        return len(self.values)

    def __iter__(self) -> Iterator[Orbit]:
        return iter(self.orbits)

    def _item(self, row: int) -> Orbit:
        if "orbits" in self.__dict__:
            return self.orbits[row]
        (steps, crossings), (more, further) = self._first[row], self._first[row + 1]
        value = float(self.values[row])
        shared = self.template.trajectory
        model = shared.model
        if model is not None:
            model = model.with_parameters({self.parameter: value})
        run = replace(
            shared,
            parameters={**shared.parameters, self.parameter: value},
            period=None if self.multiple is None else float(self.period[row]) / self.multiple,
            span=tuple(self.spans[row].tolist()),
            end=self.ends[row],
            steps=self.steps[steps:more],
            series=self.series[steps:more],
            crossing_table=self.crossing_table[crossings:further],
            model=model,
        )
        own = int(self.trivial[row])
        defect, residual, accuracy = self.errors[row].tolist()
        return Orbit(
            run,
            float(self.period[row]),
            self.multiple,
            self.multipliers[row],
            self.log_multipliers[row],
            None if own < 0 else own,
            defect,
            residual,
            accuracy,
            Outcome("periodic", f"periodic with T = {self.period[row]:.9g}.", True),
        )

    @cached_property
    def _first(self) -> NDArray[np.int64]:
        """First step and crossing of every row, and their numbers in total."""
        return np.vstack([np.zeros((1, 2), dtype=np.int64), np.cumsum(self.counts, axis=0)])

    def _labelled(self) -> Mapping[str, SpecialOrbit]:
        return self.special._labelled()

    def _coordinate(self) -> str:
        return self.parameter

    def _read(self, key: Any) -> tuple[Any, dict[str, Callable[[], Array]]]:
        """A key with names in place of functionals, and the columns with these names."""
        columns = dict(self._columns())
        written, functionals = split(key) if isinstance(key, str) else (key, {})
        for own, (which, argument) in functionals.items():
            columns[own] = partial(self._functional, f"{which}({argument})")
        return written, columns

    def _functional(self, name: str) -> Array:
        """A number of the orbit of every row."""
        known = self._functionals
        if name not in known:
            known[name] = np.array([orbit[name] for orbit in self.orbits])
            known[name].flags.writeable = False
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
        """Return parameter, period, extremes, hits, stability, multipliers and labels."""
        labels = np.full(len(self), "", dtype="U16")
        for point, row in zip(self.special, self.special_rows, strict=True):
            labels[row] = point.label
        return {
            self.parameter: self.values,
            "period": self.period,
            **{f"min({name})": self._functional(f"min({name})") for name in self.states},
            **{f"max({name})": self._functional(f"max({name})") for name in self.states},
            "hits": self._hits,
            "stability": self.stability,
            **numbered("multiplier", self.multipliers),
            "label": labels,
        }

    def _rows(self, rows: Any) -> OrbitBranch:
        """Return the branch of consecutive rows."""
        if isinstance(rows, slice):
            start, stop, step = rows.indices(len(self))
            if step != 1 or stop <= start:
                raise ArgumentError(
                    f"rows {rows.start}:{rows.stop}:{rows.step}; expected a slice of at least one "
                    f"row of {len(self)}, without a step"
                )
        else:
            start, stop = int(rows[0]), int(rows[-1]) + 1
        cut = Outcome("cut", "the branch continues beyond this slice.", True)
        kept = [
            (point, row - start)
            for point, row in zip(self.special, self.special_rows, strict=True)
            if start <= row < stop
        ]
        (first, crossing), (last, further) = self._first[start], self._first[stop]
        part = slice(start, stop)
        return replace(
            self,
            **{
                name: getattr(self, name)[part]
                for name in ("values", "period", "multipliers", "log_multipliers", "trivial")
            },
            **{name: getattr(self, name)[part] for name in ("errors", "spans", "ends", "counts")},
            special=SpecialOrbits(point for point, _ in kept),
            special_rows=tuple(row for _, row in kept),
            outcomes=(
                self.outcomes[0] if start == 0 else cut,
                self.outcomes[1] if stop == len(self) else cut,
            ),
            closed=self.closed and start == 0 and stop == len(self),
            steps=self.steps[first:last],
            series=self.series[first:last],
            crossing_table=self.crossing_table[crossing:further],
        )

    @validated(stable=flag)
    def at(self, *, stable: bool | None = None, **value: Any) -> Any:
        """Return the orbits at one value of the parameter, in order along the branch.

        They are solved for; on a branch loaded from a file the orbit of the nearest row is
        returned, with a note in its outcome.

        Parameters
        ----------
        stable : bool, optional
            Select stable or unstable orbits.
        **value : float or ndarray
            The parameter by name, e.g. ``w=1.0``; for an array a list of results.

        Raises
        ------
        UnknownNameError
            If the name is not the parameter of the branch.
        ArgumentError
            If the value is outside the range of the branch.
        """
        name, given = named_value("branch parameter", [self.parameter], value)
        return at_values(name, given, lambda one: self._at(one, stable))

    def _at(self, value: float, stable: bool | None) -> list[Orbit]:
        inside("branch", self.parameter, value, self.range)
        gap = self.values - value
        rows = np.flatnonzero(gap == 0.0).tolist()
        between = np.flatnonzero(gap[:-1] * gap[1:] < 0).tolist()
        labelled = set(self.special_rows)
        found = [(float(row), self._item(row)) for row in rows if row not in labelled]
        if not found:
            found = [(float(row), self._item(row)) for row in rows]
        for row in between:
            near = row if abs(gap[row]) <= abs(gap[row + 1]) else row + 1
            near = near if near not in labelled else (row + 1 if near == row else row)
            found.append((row + 0.5, self._between(near, value)))
        orbits = [orbit for _, orbit in sorted(found, key=lambda pair: pair[0])]
        return [orbit for orbit in orbits if stable in (None, orbit.stable)]

    def _between(self, row: int, value: float) -> Orbit:
        """The orbit near a row at a value of the parameter."""
        orbit = self._item(row)
        solved = None if self.corrector is None else self.corrector(orbit, value)
        if solved is not None and solved.outcome:
            return solved
        note = f"This is the row at {self.parameter} = {self.values[row]:.9g}, not at {value:.9g}."
        return replace(orbit, outcome=with_notes(orbit.outcome, [note]))

    @validated(stable=flag, code=text)
    def select(
        self,
        condition: Condition | None = None,
        /,
        *,
        stable: bool | None = None,
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
        code : str, optional
            Select slices with a special point of this code.
        between : (float, float), optional
            Select rows with the parameter in this closed interval.

        Raises
        ------
        UnknownNameError
            For an unknown column or code.
        ArgumentError
            For text that is not a condition, or an invalid interval.
        """
        wanted = np.ones(len(self), dtype=bool)
        if condition is not None:
            written, columns = self._read(condition)
            wanted = rows_where(written, columns, self.parameters, len(self))
        if stable is not None:
            wanted &= self.stable == stable
        if between is not None:
            low, high = limits_of(between)
            wanted &= (self.values >= low) & (self.values <= high)
        codes = dict.fromkeys(point.code for point in self.special)
        if code is not None and code not in codes:
            raise unknown_name("code of a point of this branch", code, codes)
        parts = (self[first:last] for first, last in runs_of(wanted))
        return tuple(
            part for part in parts if code is None or code in {p.code for p in part.special}
        )

    def stable_intervals(self) -> Array:
        """Return the intervals of the parameter over which the branch is stable, shape (k, 2).

        One interval for each stable slice of the branch, in order. An interval bounded by a
        special point ends exactly there.
        """
        found = []
        for first, last in runs_of(self.stable):
            before, after = first - 1, last
            begin = self.values[before if before in self.special_rows else first]
            end = self.values[after if after in self.special_rows else last - 1]
            found.append((begin, end))
        return np.array(found, dtype=float).reshape(-1, 2)

    def nearest(self, **values: float) -> Orbit:
        """Return the orbit of the row nearest to given values of the parameter and columns.

        Distances are measured in units of each column's range.

        Parameters
        ----------
        **values : float
            At least one, e.g. ``W=0.8``, ``period=7.5``.

        Raises
        ------
        UnknownNameError
            For a name that is not a column.
        ArgumentError
            For a number that is not finite, or without any value.
        """
        return self._item(self._nearest_row(values))

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
        lines += [f"  {words}" for words in shown[:5]]
        if len(shown) > 5:
            lines.append(f"  and {len(shown) - 5} more special points")
        failed = [str(outcome) for outcome in self.outcomes if not outcome]
        lines += [f"  {words}" for words in dict.fromkeys(failed)]
        return "\n".join(lines)


def branch_of(
    parameter: str,
    orbits: Sequence[Orbit],
    points: Sequence[SpecialOrbit | None],
    outcomes: tuple[Outcome, Outcome],
    closed: bool,
    corrector: OrbitCorrector | None,
) -> OrbitBranch:
    """Return the branch of given orbits, with the special points of some of them."""
    runs: list[Trajectory] = [orbit.trajectory for orbit in orbits]
    numbers: dict[str, int] = {}
    labelled, rows = [], []
    for row, point in enumerate(points):
        if point is not None:
            numbers[point.code] = numbers.get(point.code, 0) + 1
            labelled.append(replace(point, label=f"{point.code}{numbers[point.code]}"))
            rows.append(row)
    first = orbits[0]
    series = [run.series for run in runs if run.series is not None]
    return OrbitBranch(
        parameter,
        np.array([orbit.parameters[parameter] for orbit in orbits]),
        np.array([orbit.period for orbit in orbits]),
        first.multiple,
        np.array([orbit.multipliers for orbit in orbits]),
        np.array([orbit.log_multipliers for orbit in orbits]),
        np.array([-1 if o.trivial is None else o.trivial for o in orbits], dtype=np.int64),
        np.array([[o.defect, o.residual, o.accuracy] for o in orbits]),
        SpecialOrbits(labelled),
        tuple(rows),
        outcomes,
        closed,
        np.array([run.span for run in runs]),
        np.array([run.end for run in runs]),
        np.concatenate([run.steps for run in runs]),
        np.concatenate(series),
        np.concatenate([run.crossing_table for run in runs]),
        np.array([[len(run.steps), len(run.crossing_table)] for run in runs], dtype=np.int64),
        first,
        corrector,
    )
