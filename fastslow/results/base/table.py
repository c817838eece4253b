"""Results as tables: the queries they share, and conversion to arrays and data frames."""

from __future__ import annotations

import re
from abc import ABC, abstractmethod
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any, ClassVar, Generic, Self, TypeVar, cast, overload

import numpy as np
from numpy.typing import NDArray

from fastslow.arguments import Check, Condition, finite, finite_numbers, flag, position, shown, text
from fastslow.errors import ArgumentError, unknown_name
from fastslow.formulas.columns import by_value, column, rows_where
from fastslow.formulas.definitions import with_definitions
from fastslow.results.base import html
from fastslow.results.base.display import value_text
from fastslow.results.base.extras import extra
from fastslow.results.base.framed import Framed
from fastslow.results.base.immutable import ImmutableSequence, ReadOnly
from fastslow.results.base.named_mapping import NamedMapping
from fastslow.results.base.result import Saved

if TYPE_CHECKING:
    import xarray

#: A row of a table.
R = TypeVar("R")

#: A row that is a mapping of columns to values.
Row = Mapping[str, Any]

#: Labels of special points: a code and a number.
LABEL = re.compile("[A-Z]+[0-9]+")


class Table(Framed, ReadOnly, ABC, Generic[R]):
    """A result with columns of equal length; the queries are the same for all tables.

    - ``table["x"]`` is a column and ``table["x**2 + v"]`` an expression in columns and
      parameters, of shape (N,); ``table["LP1"]`` is the special point with this label.
    - ``table[3]`` and iteration return rows: an `Equilibrium`, `SpecialPoint`, `StatePoint`
      and so on, or a mapping of columns to values where rows are numbers alone.
      ``table[10:50]`` is a table of the same kind.
    - ``at(w=0.5)`` returns what the table contains at a value, also between rows; for an
      array of shape (m,) it returns a list of m such results.
    - ``select("x > 0", region="S1")`` returns the rows that satisfy all conditions, as the
      same kind of table; branches, trajectories and overlays as a tuple of their slices.
    - ``nearest(w=0.5, x=0.1)`` returns the nearest row or, on curves, the nearest point.
    - ``to_dict``, ``to_frame`` and ``to_xarray`` convert, ``save`` writes a file.

    A quantity is always given by name. Conditions are text (or SymPy relations) in the same
    columns and parameters as expressions, joined by ``and``, ``or`` and ``not``.
    """

    #: The name of the dimension of rows, the columns that are its coordinates, and the noun
    #: for what an index returns.
    _row: ClassVar[str] = "row"
    _places: tuple[str, ...] = ()
    _entry: ClassVar[str] = "row"

    def __len__(self) -> int:
        return len(next(iter(self.to_dict().values())))

    def _coordinate(self) -> str:
        """Return the column whose values are given to `at`, empty without one."""
        return self._places[0] if self._places else ""

    def _count(self) -> int:
        """Return the length of the columns."""
        return len(self)

    @abstractmethod
    def to_dict(self) -> dict[str, NDArray[Any]]:
        """Return every column by name as a read-only array, all of equal length."""

    def _columns(self) -> Mapping[str, Callable[[], NDArray[Any]]]:
        """Return the columns of numbers, as functions."""
        table = self.to_dict()
        numeric = [name for name, values in table.items() if values.dtype.kind in "biuf"]
        return {name: partial(table.__getitem__, name) for name in numeric}

    def _read(self, key: Any) -> tuple[Any, Mapping[str, Callable[[], NDArray[Any]]]]:
        """Return an expression or condition, and the columns for the names in it."""
        return with_definitions(key, getattr(self, "definitions", {})), self._columns()

    def _constants(self) -> Mapping[str, float]:
        """Return the names besides columns that expressions may contain, with their values."""
        return getattr(self, "parameters", {})

    def _labelled(self) -> Mapping[str, Any] | None:
        """Return the special points by label, None for tables without."""
        return None

    def _item(self, row: int) -> R:
        """Return one row."""
        values = {name: column[row].item() for name, column in self.to_dict().items()}
        return cast(R, NamedMapping("column", values))

    def _rows(self, rows: slice | NDArray[np.intp]) -> Any:
        """Return the table of some rows."""
        kind = type(self).__name__
        raise ArgumentError(
            f"some rows of a {kind} are not a {kind}; select them from to_frame() or its columns"
        )

    @overload
    def __getitem__(self, key: int) -> R: ...
    @overload
    def __getitem__(self, key: slice) -> Self: ...
    @overload
    def __getitem__(self, key: Any) -> Any: ...
    def __getitem__(self, key: Any) -> Any:
        """Return a column or expression, a special point by label, a row, or a slice.

        Raises
        ------
        UnknownNameError
            For a name that is neither a column nor a parameter, or an unknown label.
        ArgumentError
            For text that is not an expression, or an invalid slice.
        OutOfRangeError
            For the index of a row that does not exist.
        """
        if isinstance(key, slice):
            return self._rows(key)
        if isinstance(key, int | np.integer) and not isinstance(key, bool):
            return self._item(position(key, len(self), self._entry))
        key, columns = self._read(key)
        constants, name = self._constants(), str(key)
        if name.isidentifier() and name not in columns and name not in constants:
            labels = self._labelled()
            if labels is not None and (LABEL.fullmatch(name) or _stem(name) in map(_stem, labels)):
                if name not in labels:
                    raise unknown_name("label", name, labels)
                return labels[name]
            table = self.to_dict()  # including columns of text
            if name in table:
                return table[name]
        by = self._coordinate()
        return column(key, columns, constants, self._count(), by and by_value(by, key))

    def __iter__(self) -> Iterator[R]:
        return map(self._item, range(len(self)))

    def _nearest_row(self, values: Mapping[str, float]) -> int:
        """Return the row nearest to values of columns, in units of their ranges."""
        columns = self._columns()
        check_values(values, columns, "column")
        if not len(self):
            raise ArgumentError(f"this {type(self).__name__} has no rows")
        return nearest_row(columns, values)

    def to_xarray(self) -> xarray.Dataset:
        """Return a copy of the columns of `to_dict` as an xarray dataset (extra ``data``).

        Raises
        ------
        MissingPackageError
            When xarray is not installed.
        """
        columns = {n: (self._row, np.array(values)) for n, values in self.to_dict().items()}
        places = {name: columns.pop(name) for name in self._places if name in columns}
        return extra("xarray").Dataset(columns, places, self._about())

    def _cells(self) -> html.Cells:
        """Return the text of the first rows for an HTML table."""
        columns = self.to_dict()
        text = (map(value_text, values[: html.HTML_ROWS].tolist()) for values in columns.values())
        total = len(next(iter(columns.values()), ()))
        return html.Cells(list(columns), list(zip(*text, strict=True)), total)


def _stem(label: str) -> str:
    """Return a label without its number."""
    return label.rstrip("0123456789")


def numbered(name: str, values: NDArray[Any]) -> dict[str, NDArray[Any]]:
    """Return the columns of an array of shape (N, k) named name_1, name_2 and so on."""
    return {f"{name}_{k + 1}": values[:, k] for k in range(values.shape[1])}


def joined(name: str, tables: Sequence[Mapping[str, NDArray[Any]]]) -> dict[str, NDArray[Any]]:
    """Return the concatenated columns of several tables, with the index of each row's table."""
    lengths = [len(next(iter(table.values()))) for table in tables]
    columns = {name: np.repeat(np.arange(len(tables)), lengths)}
    for key in tables[0] if tables else ():
        columns[key] = np.concatenate([table[key] for table in tables])
    return columns


#: Checks of the values of columns by the kind of their type.
_CHECKS: dict[str, Check] = {"U": text, "b": flag, "i": finite, "u": finite}


class RowTable(Table[R]):
    """A table whose rows are isolated points."""

    def _words(self) -> Mapping[str, Collection[Any]]:
        """Return the valid values of columns, where there are only some."""
        return {}

    def select(self, condition: Condition | None = None, /, **matching: Any) -> Self:
        """Return the rows that satisfy all conditions, as a table of the same kind.

        Parameters
        ----------
        condition : str or Expr, optional
            A condition in columns and parameters, such as ``"x > 0 and v**2 < E"``.
        **matching : str, bool or int
            Values of columns of text, flags or whole numbers, such as ``code="LP"``.

        Raises
        ------
        UnknownNameError
            For an unknown column, or a word that is not one of the column's.
        ArgumentError
            For text that is not a condition, or the value of a column of real numbers.
        """
        return self._rows(np.flatnonzero(self._wanted(condition, matching)))

    def _wanted(self, condition: Condition | None, values: Mapping[str, Any]) -> NDArray[np.bool_]:
        """Return True for the rows that satisfy conditions, shape (N,)."""
        wanted = np.ones(len(self), dtype=bool)
        if condition is not None:
            written, columns = self._read(condition)
            wanted = rows_where(written, columns, self._constants(), len(self))
        table, words = (self.to_dict(), self._words()) if values else ({}, {})
        for name, value in values.items():
            valid = {n: c for n, c in table.items() if c.dtype.kind not in "fc"}
            if name in table and name not in valid:
                raise ArgumentError(
                    f"{name} = {shown(value)}: a real number is selected by a condition, such as "
                    f"select('{name} > 0')"
                )
            if name not in valid:
                raise unknown_name("column to select by", name, valid)
            value = _CHECKS[valid[name].dtype.kind](name, value)
            if name in words and value not in words[name]:
                raise unknown_name(name, value, words[name])
            wanted &= valid[name] == value
        return wanted

    def nearest(self, **values: float) -> Any:
        """Return the row nearest to given values of columns.

        Distances are measured in units of each column's range.

        Parameters
        ----------
        **values : float
            At least one, e.g. ``w=0.1, x=0.3``.

        Raises
        ------
        UnknownNameError
            For a name that is not a column.
        ArgumentError
            For a number that is not finite, without any value, or for a table without rows.
        """
        return self._item(self._nearest_row(values))


class ResultTable(RowTable[R], Saved, ImmutableSequence, tuple[R, ...], Generic[R]):
    """A tuple of results, which are the rows of a table."""

    __iter__ = tuple.__iter__
    __len__ = tuple.__len__

    def _item(self, row: int) -> R:
        return tuple.__getitem__(self, row)

    def _rows(self, rows: slice | NDArray[np.intp]) -> Self:
        items = (self._item(row) for row in np.arange(len(self))[rows])
        return type(self)(items, **self._attributes())

    def __getitem__(self, key: Any) -> Any:
        name = isinstance(key, str) or hasattr(key, "free_symbols")
        if not len(self) and name and not LABEL.fullmatch(str(key)):
            return np.empty(0)  # the columns are those of the rows
        return super().__getitem__(key)

    def select(self, condition: Condition | None = None, /, **matching: Any) -> Self:
        return super().select(condition if len(self) else None, **matching)


def nearest_row(
    columns: Mapping[str, Callable[[], NDArray[Any]]], values: Mapping[str, float]
) -> int:
    """Return the row nearest to values of columns, in units of their ranges."""
    table = np.column_stack([np.asarray(columns[name](), dtype=float) for name in values])
    reach = np.ptp(table, axis=0)
    off = (table - list(values.values())) / np.where(reach > 0, reach, 1.0)
    distance = (off**2).sum(axis=1)
    return int(np.argmin(np.where(np.isnan(distance), np.inf, distance)))


def check_values(values: Mapping[str, Any], valid: Iterable[str], kind: str) -> None:
    """Validate values given by name: at least one, each a finite number.

    Raises
    ------
    UnknownNameError
        For a name that is not valid.
    ArgumentError
        For a value that is not a finite number, or without any.
    """
    known = tuple(valid)
    if not values:
        raise ArgumentError(f"expected values of some of {', '.join(known)}, received none")
    for name, value in values.items():
        if name not in known:
            raise unknown_name(kind, name, known)
        finite(name, value)


def named_value(kind: str, valid: Iterable[str], values: Mapping[str, Any]) -> tuple[str, Any]:
    """Return the name and the value of the single quantity given to a query ``at``.

    Raises
    ------
    UnknownNameError
        For another name.
    ArgumentError
        For no value, or several.
    """
    known = tuple(valid)
    for name in values:
        if name not in known:
            raise unknown_name(kind, name, known)
    if len(values) != 1:
        some = f"{'one of ' if len(known) > 1 else ''}{', '.join(known)}"
        received = ", ".join(values) or "none"
        raise ArgumentError(f"expected a value of {some}, received {received}")
    return next(iter(values.items()))


def inside(what: str, name: str, value: float, over: tuple[float, float]) -> None:
    """Raise ArgumentError for a value outside a range."""
    if not over[0] <= value <= over[1]:
        raise ArgumentError(
            f"{name} = {value:g} is outside this {what}'s range [{over[0]:g}, {over[1]:g}]"
        )


def at_values(name: str, given: Any, query: Callable[[float], Any]) -> Any:
    """Return the result of a query at one value, or the list of results for an array of them.

    Raises
    ------
    ArgumentError
        For a value that is not a finite number, or an array with more than one dimension.

    Examples
    --------
    >>> at_values("w", 2, lambda w: [w]), at_values("w", [1, 2], lambda w: [w])
    ([2.0], [[1.0], [2.0]])
    """
    several = isinstance(given, Iterable) and not isinstance(given, str | bytes)
    if not several or getattr(given, "ndim", 1) == 0:
        return query(finite(name, given))
    values = finite_numbers(name, given)
    if values.ndim > 1:
        raise ArgumentError(
            f"{name} has the shape {values.shape}; expected a number or an array of shape (m,)"
        )
    return [query(float(value)) for value in values]
