"""Rows of a branch at the zeros of an expression in the numbers of its orbits."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from itertools import product
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fastslow.continuation import zeros
from fastslow.continuation.settings import Continuation
from fastslow.continuation.zeros import Between, Bracket
from fastslow.orbits.find.orbit_curve import CurveSystem, OrbitCurve, Row, completed
from fastslow.orbits.flow.events import OrbitError
from fastslow.orbits.flow.shooting import solved
from fastslow.orbits.points.kinds import MARKED
from fastslow.orbits.points.marks import OrbitMark
from fastslow.orbits.points.point_curves import PointSource

Array = NDArray[np.float64]

#: A change of sign is a zero if the expression there is below this fraction of its values at the
#: ends of the step, or rounding; else it is discontinuous.
CONTINUOUS_ZERO = 1e-9

#: Width, in steps, to which a bracket is narrowed.
NARROWEST_BRACKET = 1e-12


class MarkedRow(NamedTuple):
    """A row at a zero: at a row of the branch, or after it."""

    after: int
    row: Row
    at_row: bool


@dataclass(eq=False)
class MarkedRows:
    """The zeros of an expression along a branch.

    Parameters
    ----------
    curve : OrbitCurve
    settings : Continuation
    mark : OrbitMark
    rows : sequence of Row
    notes : list of str
        Receives what is not located.
    """

    curve: OrbitCurve
    settings: Continuation
    mark: OrbitMark
    rows: Sequence[Row]
    notes: list[str]
    known: dict[tuple[int, float], Row] = field(default_factory=dict)

    def found(self) -> list[MarkedRow]:
        """Return the rows at zeros, in order along the branch."""
        values = np.array([self._value(row) for row in self.rows])
        if not np.isfinite(values).any():
            self.notes.append(f"{self.mark.name}: {self.mark.expression} is not finite.")
            return []
        if not (values[np.isfinite(values)] != 0).any():
            self.notes.append(
                f"{self.mark.name}: {self.mark.expression} vanishes along the branch, to rounding."
            )
            return []
        at_rows = np.flatnonzero(values == 0).tolist()
        runs = np.split(at_rows, np.flatnonzero(np.diff(at_rows) > 1) + 1) if at_rows else []
        rows = [self._in_place(int(run[0])) for run in runs]
        unit = float(np.nanmax(np.abs(values)))
        tested, touches = self._tested(unit), list[Bracket]()
        numbers = np.arange(float(len(values)))[:, None]
        known = values / unit, np.ones(len(values) - 1)
        for bracket in zeros.brackets(numbers, *known, tested, quartered=True, touches=touches):
            low, high = (float(place[0]) for place in bracket.points)
            if high - low <= 1.0:
                rows += self._located(bracket, tested)
        for touch in touches:
            rows.append(self._touching(touch.row, float(touch.points[0][0])))
        return sorted(rows, key=lambda one: one.after)

    def _value(self, row: Row) -> float:
        """The expression at a row, 0 for rounding errors, NaN for an infinite period."""
        if not np.isfinite(row.arrays.period):
            return np.nan
        value = self.mark.value(row.orbit)
        return 0.0 if abs(value) <= self.mark.rounding(row.orbit) else value

    def _between(self, k: int, part: float) -> Row | None:
        """The orbit at a fraction of the step after a row."""
        if part in (0.0, 1.0):
            return self.rows[k + int(part)]
        if (k, part) not in self.known:
            row = row_between(self.curve, self.settings, self.rows[k], self.rows[k + 1], part)
            if row is None:
                return None
            self.known[k, part] = row
        return self.known[k, part]

    def _tested(self, unit: float) -> Between:
        """The expression between two places, counted in rows from the first one."""

        def between(a: Array, b: Array, part: float) -> tuple[Array, float] | None:
            place = float(a[0] + part * (b[0] - a[0]))
            k = min(int(place), len(self.rows) - 2)
            row = self._between(k, place - k)
            return None if row is None else (np.array([place]), self._value(row) / unit)

        return between

    def _located(self, bracket: Bracket, tested: Between) -> Iterator[MarkedRow]:
        """Locate the zero between two places in the step after a row."""
        k = bracket.row
        # no equations but the test: regula falsi down to rounding
        found = zeros.solved(bracket, tested, lambda *_: None, first=zeros.NARROWINGS)
        assert found is not None
        (low, high), (before, after) = found.points, found.values
        place = float((low if abs(before) < abs(after) else high)[0])
        row = self._between(k, place - k)
        if row is None or float(high[0] - low[0]) > NARROWEST_BRACKET:
            self._missed(k, "no orbit was solved for near the zero")
            return
        ends = [abs(self.mark.value(row.orbit)) for row in self.rows[k : k + 2]]
        value = abs(self.mark.value(row.orbit))
        if value > max(CONTINUOUS_ZERO * min(ends), 10.0 * self.mark.rounding(row.orbit)):
            self._missed(k, "it is discontinuous there")
            return
        yield MarkedRow(k, self._marked(row, value), at_row=False)

    def _missed(self, k: int, why: str) -> None:
        one, two = (row.value for row in self.rows[k : k + 2])
        name = self.curve.name
        self.notes.append(
            f"{self.mark.name}: {self.mark.expression} changes its sign between {name} = {one:.8g} "
            f"and {two:.8g} without a point: {why}."
        )

    def _in_place(self, k: int) -> MarkedRow:
        """The row at which the expression is zero."""
        row = self.rows[k]
        value = abs(self.mark.value(row.orbit))
        return MarkedRow(k, self._marked(row, value), at_row=True)

    def _touching(self, k: int, place: float) -> MarkedRow:
        """The row at an extremum that is zero to rounding."""
        row = self._between(k, place - k)
        assert row is not None
        marked = self._marked(row, abs(self.mark.value(row.orbit)))
        assert marked.point is not None
        point = replace(marked.point, type="no change of sign")
        return MarkedRow(k, replace(marked, point=point), at_row=False)

    def _marked(self, row: Row, residual: float) -> Row:
        """A row with the point of the mark."""
        shooting = row.shooting.with_phase(row.u)
        point = MARKED.point(
            *(self.curve.name, row.orbit, (residual, row.arrays.errors[2])),
            mark=self.mark.name,
            expression=self.mark.expression,
            source=PointSource(self.curve.problem, shooting, row.u, mark=self.mark),
        )
        return replace(row, point=point)


def row_between(
    curve: OrbitCurve, settings: Continuation, one: Row, two: Row, part: float
) -> Row | None:
    """Solve for the orbit at a fraction of the step between two rows; None without convergence."""
    pairs = (pair for pair in product(one.forms, two.forms) if pair[0].continues(pair[1]))
    begin, end = next(pairs, (None, None))
    if begin is None or end is None:
        return row_at(curve, one, two, one.value + part * (two.value - one.value))
    gap = end.u - begin.u
    frame = curve.frame(begin.shooting, begin.u, one.arrays)
    along = gap / np.sqrt(gap**2 @ frame.weight)
    system = CurveSystem(begin.shooting)
    system.solved(begin.u + part * gap, along, frame, settings)
    row = None if system.point is None else curve.confirmed(begin.shooting, system.point)
    return None if row is None else completed([row], [one.slope])[0]


def row_at(curve: OrbitCurve, one: Row, two: Row, value: float) -> Row | None:
    """Solve for the orbit at a value of the parameter between two rows, None without success."""
    near = one if two.point is None or len(one.u) == len(two.u) else two
    share = (value - one.value) / (two.value - one.value or 1.0)
    u = one.u + share * (two.u - one.u) if one.continues(two) else near.u.copy()
    u[-1] = value
    segments, period = near.shooting.unpack(u)
    shooting = near.shooting.with_phase(u)
    try:
        solution = solved(shooting, u, shooting.scales(segments, period))
    except OrbitError:
        return None
    u = solution.u
    orbit = curve.orbit(shooting, u)
    return curve.row(shooting, u, orbit, one.slope, None) if orbit.outcome else None


def rows_with_marks(
    curve: OrbitCurve,
    settings: Continuation,
    marks: Sequence[OrbitMark],
    rows: Sequence[Row],
    notes: list[str],
) -> list[list[MarkedRow]]:
    """Return the zeros of all marks, those after every row of a branch."""
    after: list[list[MarkedRow]] = [[] for _ in rows]
    for mark in marks:
        for one in MarkedRows(curve, settings, mark, rows, notes).found():
            after[one.after].append(one)
    return after


def own_rows(row: Row, marked: Sequence[MarkedRow]) -> list[Row]:
    """A row of a branch, with the points of the marks that are zero at it."""
    found = [one.row for one in marked if one.at_row]
    return found if found and row.point is None else [row, *found]
