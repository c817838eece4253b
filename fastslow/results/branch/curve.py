"""What branches of equilibria, of special points and of orbits have in common."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import fields, replace
from functools import cached_property, partial
from typing import Any, Self, TypeVar

import numpy as np
from numpy.typing import NDArray

from fastslow.arguments import Condition
from fastslow.errors import ArgumentError
from fastslow.formulas.columns import rows_where
from fastslow.results.base.immutable import read_only
from fastslow.results.base.intervals import runs_of
from fastslow.results.base.outcome import Outcome
from fastslow.results.base.result import Result
from fastslow.results.base.table import Table
from fastslow.results.branch.table import BranchTable
from fastslow.results.points import SpecialPoints

R = TypeVar("R")


class LabelledCurve(Table[R], Result):
    """A traced curve with special points on its rows; queries read its rows as a `BranchTable`.

    A subclass is a dataclass with these fields, and turns a place on the curve into an object
    in ``_item``.
    """

    values: NDArray[np.float64]
    special: Any
    special_rows: tuple[int, ...]
    outcomes: tuple[Outcome, Outcome]
    closed: bool

    @property
    @abstractmethod
    def table(self) -> BranchTable:
        """The rows with tangents and special points, which queries take."""

    @property
    def outcome(self) -> Outcome:
        """The outcome of the tracing: the first unsuccessful one, else that at the last row."""
        return next((o for o in self.outcomes if not o.success), self.outcomes[-1])

    def __len__(self) -> int:
        return len(self.values)

    def _labelled(self) -> Mapping[str, Any]:
        labelled: Mapping[str, Any] = self.special._labelled()
        return labelled

    def _rows(self, rows: Any) -> Self:
        """Return the curve of consecutive rows, with its special points."""
        start, stop, step = rows.indices(len(self))
        if step != 1:
            raise ArgumentError(
                f"a branch is sliced with a step of 1, received {step}; slice its columns instead"
            )
        if stop <= start:
            raise ArgumentError(
                f"rows {start} to {stop} contain none of the {len(self)} points of the branch"
            )
        if stop - start == len(self):
            return self
        kept = [
            (point, row)
            for point, row in zip(self.special, self.special_rows, strict=True)
            if start <= row < stop or (point.kind.two_rows and row + 1 == start)
        ]
        first, last = self.outcomes
        return replace(  # type: ignore[type-var]
            self,
            **self._sliced(start, stop),
            special=type(self.special)(point for point, _ in kept),
            special_rows=tuple(max(row - start, 0) for _, row in kept),
            outcomes=(
                first if start == 0 else _cut(start, len(self)),
                last if stop == len(self) else _cut(stop - 1, len(self)),
            ),
            closed=False,
        )

    def _sliced(self, start: int, stop: int) -> dict[str, Any]:
        """Return the arrays of some rows, by name."""
        columns = {e.name: getattr(self, e.name) for e in fields(self)}  # type: ignore[arg-type]
        return {n: a[start:stop] for n, a in columns.items() if isinstance(a, np.ndarray)}

    def _where(self, condition: Condition | None) -> NDArray[np.bool_]:
        """Return True for the rows that satisfy a condition, shape (N,); for all without one."""
        if condition is None:
            return np.ones(len(self), dtype=bool)
        written, columns = self._read(condition)
        return rows_where(written, columns, self._constants(), len(self))

    def _slices(self, wanted: NDArray[np.bool_], code: str | None) -> tuple[Self, ...]:
        """Return the slices of consecutive rows, with a special point of a code if one is given.

        The code may be the name of an expression in ``marks=``.
        """
        parts = (self._rows(slice(*ends)) for ends in runs_of(wanted))
        return tuple(
            part
            for part in parts
            if code is None or any(code in (point.code, point.stem) for point in part.special)
        )


class TracedCurve(LabelledCurve[R]):
    """A curve of equilibria or special points, of which arrays have one entry per row."""

    states: tuple[str, ...]
    state: NDArray[np.float64]
    tangent: NDArray[np.float64]
    eigenvalues: NDArray[np.complex128]
    region: Any
    special: SpecialPoints
    parameters: Mapping[str, float]

    @property
    @abstractmethod
    def _free(self) -> tuple[str, ...]:
        """The names of the free parameters."""

    @cached_property
    def table(self) -> BranchTable:
        """The rows with tangents and special points, which queries take."""
        return BranchTable(
            columns=self.states,
            free=self._free,
            points=read_only(np.column_stack([self.state, self.values])),
            tangent=self.tangent,
            special=self.special,
            special_rows=self.special_rows,
            eigenvalues=self.eigenvalues,
            region=np.broadcast_to(self.region, len(self)),
            closed=self.closed,
            **self._more(),
        )

    def _more(self) -> dict[str, Any]:
        """Return further properties of the rows, by name."""
        return {}

    @property
    def points(self) -> NDArray[np.float64]:
        """States and free parameters, shape (N, k)."""
        return self.table.points

    @property
    def point_names(self) -> tuple[str, ...]:
        """The names of the columns of `points`."""
        return (*self.states, *self._free)

    def _columns(self) -> Mapping[str, Callable[[], NDArray[np.float64]]]:
        columns = (*self.state.T, *np.atleast_2d(self.values.T))
        return {
            name: partial(np.asarray, values)
            for name, values in zip(self.point_names, columns, strict=True)
        }


def _cut(row: int, count: int) -> Outcome:
    return Outcome("cut", f"cut at row {row} of a branch of {count} rows.", True)
