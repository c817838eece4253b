"""Results of a sweep over labelled axes."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from fastslow.arguments import Condition, path, real_number, shown, validated
from fastslow.errors import ArgumentError, unknown_name
from fastslow.formulas.columns import column, rows_where
from fastslow.results.base.display import Summarized, value_text
from fastslow.results.base.extras import extra
from fastslow.results.base.framed import Framed
from fastslow.results.base.immutable import read_only
from fastslow.results.base.named_mapping import NamedMapping
from fastslow.results.base.outcome import Outcome
from fastslow.results.base.result import Result
from fastslow.results.maps.tiles import POINT, trailing, unit_attributes

if TYPE_CHECKING:
    import xarray

Array = NDArray[Any]

#: Values of a point by the names of the axes.
Point = Mapping[str, Any]

#: Distance, in units of the range of an axis, within which a number is a value of the axis.
ON_AXIS = 1e-9


@dataclass(frozen=True, eq=False, repr=False)
class Grid(Framed, Summarized, Result):
    """Outputs of a function at the points of labelled axes.

    Points that failed or are missing have NaN, False or empty text in every output.
    ``grid["x"]`` is an output, or an expression in outputs and axes; its first dimensions are
    the axes in order, or the points where the axes are paired.

    Parameters
    ----------
    axes : mapping
        Values of each axis, shape (n,).
    paired : bool
        Whether point k has the k-th value of each axis; else the points are all combinations.
    outputs : mapping
        Arrays by name, the dimensions of the points first; a store is read at each access.
    done : ndarray of bool, shape (N,)
        True for points whose task is finished, the last axis fastest.
    failed : ndarray of int, shape (k,)
        Indices of points that failed.
    reasons : tuple of str
        The text of the error of each.
    function : str
        Module and name of the function.
    equations : str
        The models that the function refers to, as text.
    settings : mapping
        Whether the function took arrays, and which outputs were kept.
    versions : mapping
        Versions of packages with which the outputs were computed.
    notes : tuple of str
        Sentences on what cannot be verified when the sweep is resumed.
    units : mapping
        Units of axes and outputs, as given.

    Examples
    --------
    >>> import fastslow as fs
    >>> def rise(a, b):
    ...     return {"sum": a + b, "root": (a - b) ** 0.5 if a >= b else None}
    >>> grid = fs.sweep(rise, {"a": [0, 1, 2], "b": [0.0, 0.5]})
    >>> grid["sum"]
    array([[0. , 0.5],
           [1. , 1.5],
           [2. , 2.5]])
    >>> grid.at(a=2, b=0.5)["sum"], grid.select(a=(1, 2))["sum - a"].shape
    (2.5, (2, 2))
    """

    axes: Mapping[str, Array]
    paired: bool
    outputs: Mapping[str, Array]
    done: NDArray[np.bool_]
    failed: NDArray[np.int64]
    reasons: tuple[str, ...]
    function: str
    equations: str = ""
    settings: Mapping[str, Any] = NamedMapping("setting")
    versions: Mapping[str, str] = NamedMapping("version")
    notes: tuple[str, ...] = ()
    units: Mapping[str, str] = NamedMapping("unit")

    @property
    def shape(self) -> tuple[int, ...]:
        """Number of values along each axis, or the number of points of paired axes."""
        return shape_of(self.axes, self.paired)

    @property
    def dims(self) -> tuple[str, ...]:
        """Names of the first dimensions of every output."""
        return (POINT,) if self.paired else tuple(self.axes)

    def __len__(self) -> int:
        return len(self.done)

    def __getitem__(self, key: Any) -> Any:
        """Return an axis, an output, or an expression in axes and outputs of numbers.

        Raises
        ------
        UnknownNameError
            For an unknown name.
        ArgumentError
            For text that is not an expression, or an expression in arrays or text.
        """
        name = str(key)
        if name in self.outputs:
            return _array(self.outputs[name])
        if name in self.axes:
            return self.axes[name]
        columns = {n: partial(self._column, n) for n in (*self.axes, *self.outputs)}
        return read_only(column(key, columns, {}, len(self)).reshape(self.shape))

    def _column(self, name: str) -> Any:
        """Return an axis or an output of one value for each point, shape (N,)."""
        if name in self.axes:
            return self._points(np.arange(len(self)))[name]
        values = _array(self.outputs[name])
        if values.shape != self.shape or values.dtype.kind not in "bf":
            raise ArgumentError(
                f"{name} is {described(values, len(self.shape))}; expressions are of numbers and "
                "bools, one for each point"
            )
        values = values.reshape(-1)
        return np.where(self._computed, values, np.nan) if values.dtype.kind == "b" else values

    def _points(self, rows: NDArray[np.intp]) -> dict[str, Array]:
        """Return the values of the axes at some points, given by their indices."""
        if self.paired:
            return {name: values[rows] for name, values in self.axes.items()}
        places = np.unravel_index(rows, self.shape)
        pairs = zip(self.axes.items(), places, strict=True)
        return {name: values[place] for (name, values), place in pairs}

    def _point_list(self, rows: NDArray[np.intp]) -> tuple[Point, ...]:
        columns = [values.tolist() for values in self._points(rows).values()]
        return tuple(
            NamedMapping("axis", zip(self.axes, values, strict=True))
            for values in zip(*columns, strict=True)
        )

    @property
    def failures(self) -> tuple[tuple[Point, str], ...]:
        """Pairs of a point that failed and the text of its error."""
        return tuple(zip(self._point_list(self.failed), self.reasons, strict=True))

    @property
    def missing(self) -> tuple[Point, ...]:
        """The points that are not computed yet."""
        return self._point_list(self._missing)

    @property
    def _missing(self) -> NDArray[np.intp]:
        absent = ~self.done
        absent[self.failed] = False
        return np.flatnonzero(absent)

    @property
    def outcome(self) -> Outcome:
        """Whether every point is computed, and how many failed or are missing."""
        count, failed, missing = len(self), len(self.failed), len(self._missing)
        notes = (" ".join(["", *self.notes])) if self.notes else ""
        if missing:
            text = f"{missing} of {count} points are missing"
            text += f" and {failed} failed" if failed else ""
            return Outcome("incomplete", f"{text}.{notes}", False, self.notes)
        if failed:
            text = f"{failed} of {count} points failed."
            return Outcome("points failed", f"{text}{notes}", False, self.notes)
        return Outcome("complete", f"all {count} points are computed.{notes}", True, self.notes)

    def at(self, **values: Any) -> Any:
        """Return the outputs at a point, or a list of them at arrays of values.

        Parameters
        ----------
        **values : float, str or array_like
            A value of each axis.

        Returns
        -------
        NamedMapping
            The outputs by name.

        Raises
        ------
        UnknownNameError
            For a name that is not an axis.
        ArgumentError
            For a number that is not a value of its axis, without a value of each axis, or at a
            point that failed or is missing.
        """
        for name in values:
            if name not in self.axes:
                raise unknown_name("axis", name, self.axes)
        if len(values) != len(self.axes):
            raise ArgumentError(f"expected a value of each of {', '.join(self.axes)}")
        given = [values[name] for name in self.axes]
        several = [v for v in given if np.ndim(v)]
        if not several:
            return self._at(given)
        length = len(several[0])
        if any(np.ndim(v) != 1 or len(v) != length for v in several):
            raise ArgumentError("expected numbers, or arrays of one length")
        columns = [list(v) if np.ndim(v) else [v] * length for v in given]
        return [self._at(point) for point in zip(*columns, strict=True)]

    def _at(self, given: Sequence[Any]) -> NamedMapping[Any]:
        named = dict(zip(self.axes, given, strict=True))
        places = [np.flatnonzero(self._equal(name, value)) for name, value in named.items()]
        if self.paired:
            common = np.flatnonzero(
                np.logical_and.reduce([self._equal(name, value) for name, value in named.items()])
            )
            if not len(common):
                raise ArgumentError(f"{_text(named)} is not one of the points")
            row = int(common[0])
        else:
            row = int(np.ravel_multi_index([int(place[0]) for place in places], self.shape))
        if row in self.failed:
            reason = self.reasons[int(np.flatnonzero(self.failed == row)[0])]
            raise ArgumentError(f"the point {_text(named)} failed: {reason}")
        if not self.done[row]:
            raise ArgumentError(f"the point {_text(named)} is not computed yet")
        place = np.unravel_index(row, self.shape)
        found = {name: _array(values)[place] for name, values in self.outputs.items()}
        plain = {n: v.item() if np.ndim(v) == 0 else v for n, v in found.items()}
        return NamedMapping("output", plain)

    def _equal(self, name: str, value: Any) -> NDArray[np.bool_]:
        """Return True for the values of an axis that are a given one, at least one."""
        known = self.axes[name]
        if known.dtype.kind in "Ub":
            found = known == value
        else:
            number = real_number(value)
            if number is None:
                raise ArgumentError(f"{name} = {shown(value)}; expected a number of this axis")
            distance = np.abs(known - number)
            # values that are closer to each other than rounding of a given one
            found = distance <= min(
                ON_AXIS * max(float(np.ptp(known)), abs(number)), distance.min()
            )
            if known.dtype.kind == "i" and isinstance(value, int | np.integer):
                found = known == value
        if not np.any(found):
            raise ArgumentError(
                f"{name} = {shown(value)} is not a value of this axis; {_nearest(known, value)}"
            )
        return np.asarray(found)

    def select(self, condition: Condition | None = None, /, **matching: Any) -> Grid:
        """Return the grid of some values of axes, or the points that satisfy conditions.

        Parameters
        ----------
        condition : str or Expr, optional
            A condition in axes and outputs of numbers, such as ``"x > 0 and D < 0.2"``; with an
            output it selects points that are computed.
        **matching
            For an axis, one of its values or a range (low, high); for an output of text or
            bools, its value, such as ``regime="bilateral"``.

        Returns
        -------
        Grid
            With the same axes, for axes alone; with paired axes otherwise.

        Raises
        ------
        UnknownNameError
            For a name that is neither an axis nor an output.
        ArgumentError
            For a value that is not one of an axis, or an output of numbers.
        """
        keep = {name: np.ones(len(values), dtype=bool) for name, values in self.axes.items()}
        wanted = np.ones(len(self), dtype=bool)
        for name, value in matching.items():
            if name in self.axes:
                keep[name] &= self._within(name, value)
            elif name in self.outputs:
                wanted &= self._matches(name, value)
            else:
                raise unknown_name("axis or output", name, (*self.axes, *self.outputs))
        if condition is not None:
            used: set[str] = set()

            def values_of(name: str) -> Any:
                used.add(name)
                return self._column(name)

            columns = {n: partial(values_of, n) for n in (*self.axes, *self.outputs)}
            wanted &= rows_where(condition, columns, {}, len(self))
            if used - set(self.axes):
                wanted &= self._computed
        if self.paired:
            rows = np.flatnonzero(np.logical_and.reduce([wanted, *keep.values()]))
            return self._subset(rows, {name: values[rows] for name, values in self.axes.items()})
        inside = np.ix_(*keep.values()) if keep else ()
        box = np.arange(len(self)).reshape(self.shape)[inside]
        if condition is None and not set(matching) - set(self.axes):
            axes = {name: values[keep[name]] for name, values in self.axes.items()}
            return self._subset(box.reshape(-1), axes, box.shape)
        rows = box.reshape(-1)[wanted[box.reshape(-1)]]
        return self._subset(rows, self._points(rows), paired=True)

    def _within(self, name: str, value: Any) -> NDArray[np.bool_]:
        """Return True for the values of an axis that are a value or within a range."""
        if not isinstance(value, tuple | list) or self.axes[name].dtype.kind in "Ub":
            return self._equal(name, value)
        ends = [real_number(end) for end in value]
        if len(ends) != 2 or ends[0] is None or ends[1] is None or ends[0] > ends[1]:
            raise ArgumentError(
                f"{name} = {shown(value)}; expected a value, or a range (low, high)"
            )
        known = self.axes[name]
        found = (known >= ends[0]) & (known <= ends[1])
        if not found.any():
            raise ArgumentError(f"{name}: no value of this axis is within {shown(value)}")
        return np.asarray(found)

    def _matches(self, name: str, value: Any) -> NDArray[np.bool_]:
        values = _array(self.outputs[name])
        if values.shape != self.shape or values.dtype.kind not in "bU":
            raise ArgumentError(
                f"{name} is {described(values, len(self.shape))}; select it by a condition, such "
                f"as select('{name} > 0')"
            )
        if values.dtype.kind == "U" and value not in (known := np.unique(values).tolist()):
            raise unknown_name(name, value, filter(None, known))
        finished = self.done.copy()
        finished[self.failed] = False
        return (values == value).reshape(-1) & finished

    def _subset(
        self,
        rows: NDArray[np.intp],
        axes: Mapping[str, Array],
        shape: tuple[int, ...] | None = None,
        *,
        paired: bool | None = None,
    ) -> Grid:
        """Return the grid of some points."""
        of_row = np.full(len(self), -1)
        of_row[rows] = np.arange(len(rows))
        new = of_row[self.failed]
        count = len(self.shape)
        outputs = {}
        for name, stored in self.outputs.items():
            values = _array(stored)
            flat = values.reshape(len(self), *values.shape[count:])[rows]
            outputs[name] = flat.reshape((*(shape or (len(rows),)), *values.shape[count:]))
        order = np.argsort(new[new >= 0])
        return replace(
            self,
            axes=axes,
            paired=self.paired if paired is None else paired,
            outputs=outputs,
            done=self.done[rows],
            failed=np.sort(new[new >= 0]),
            reasons=tuple(np.array(self.reasons, dtype=object)[new >= 0][order].tolist()),
        )

    def to_dict(self) -> dict[str, Array]:
        """Return axes and outputs with one row for each point, and the text of failures.

        Arrays are divided into columns ``name_1``, ``name_2`` and so on. The column ``failure``
        is empty for points that are computed.

        Raises
        ------
        ArgumentError
            If an output has the name of the column of an array.
        """
        columns: dict[str, Array] = dict(self._points(np.arange(len(self))))
        for name, stored in self.outputs.items():
            values = _array(stored)
            if values.shape == self.shape:
                columns[name] = values.reshape(-1)
            else:
                table = values.reshape(len(self), -1)
                parts = {f"{name}_{k + 1}": table[:, k] for k in range(table.shape[1])}
                for part in parts:
                    if part in columns or part in self.outputs:
                        raise ArgumentError(f"two columns would be {part}; rename this output")
                columns |= parts
        texts = np.full(len(self), "", dtype=object)
        texts[self._missing] = "not computed yet"
        texts[self.failed] = self.reasons
        columns["failure"] = texts.astype(str)
        return columns

    def to_xarray(self) -> xarray.Dataset:
        """Return axes and outputs as an xarray dataset with labelled dimensions (extra ``data``).

        Its attributes are the function, the equations of the models it refers to, the settings
        and the versions; those of axes and outputs their units.

        Raises
        ------
        MissingPackageError
            When xarray is not installed.
        """
        data = {}
        for name, stored in self.outputs.items():
            values = np.array(_array(stored))
            dims = self.dims + trailing(name, values.ndim - len(self.dims))
            data[name] = (dims, values, unit_attributes(self.units, name))
        data["computed"] = (self.dims, self._computed.reshape(self.shape), {})
        axes = {
            n: (POINT if self.paired else n, np.array(v), unit_attributes(self.units, n))
            for n, v in self.axes.items()
        }
        return extra("xarray").Dataset(data, axes, self._about())

    @property
    def _computed(self) -> NDArray[np.bool_]:
        computed = self.done.copy()
        computed[self.failed] = False
        return computed

    @validated(path=path)
    def save(self, path: str | os.PathLike[str]) -> None:
        """Save to a file with the extension ``.npz`` or ``.nc``, as `Result.save`.

        The outputs of a store are read first. A store itself is loaded by `fastslow.load`.
        """
        outputs = {name: _array(values) for name, values in self.outputs.items()}
        super(Grid, replace(self, outputs=outputs)).save(path)

    def _content(self) -> tuple[Any, ...]:
        # an output in a store is equal to the same one in memory
        outputs = {name: _array(values) for name, values in self.outputs.items()}
        return (outputs, *(v for v in super()._content() if v is not self.outputs))

    def _about(self) -> dict[str, Any]:
        """Return metadata as plain values."""
        settings = {f"settings_{n}": value_text(v) for n, v in self.settings.items()}
        versions = {f"version_{n}": v for n, v in self.versions.items()}
        about = {"result": "Grid", "function": self.function, "outcome": str(self.outcome)}
        units = {f"units_{n}": unit for n, unit in self.units.items()}
        return {**about, "equations": self.equations, **settings, **versions, **units}

    def _in_units(self, name: str) -> str:
        return f" in {self.units[name]}" if name in self.units else ""

    def _groups(self) -> list[list[str]]:
        axes = [_axis_text(n, values) + self._in_units(n) for n, values in self.axes.items()]
        how = "paired over" if self.paired else "over"
        head = f"Grid of {self.function} {how} {', '.join(self.axes)}: {self.outcome}"
        outputs = [
            f"  {name}: {described(values, len(self.shape))}{self._in_units(name)}"
            for name, values in self.outputs.items()
        ]
        failures = []
        if self.reasons:
            (point,) = self._point_list(self.failed[:1])
            failures = [f"  at {_text(point)}: {self.reasons[0]}"]
        return [[head], [f"  {line}" for line in axes], outputs, failures]


def shape_of(axes: Mapping[str, Array], paired: bool) -> tuple[int, ...]:
    """Return the shape of the outputs over axes."""
    lengths = tuple(len(values) for values in axes.values())
    return lengths[:1] if paired else lengths


def _array(values: Any) -> Array:
    """Return an output in memory, reading it if it is in a store."""
    return values if isinstance(values, np.ndarray) else values.read()


def described(values: Any, count: int) -> str:
    """Return the kind of an output in words, without its first dimensions.

    Examples
    --------
    >>> described(np.zeros((4, 2)), 1), described(np.array(["free"]), 1)
    ('an array of numbers of shape (2,)', 'text')
    """
    words = {"f": ("a number", "numbers"), "c": ("a complex number", "complex numbers")}
    words |= {"b": ("a bool", "bools"), "U": ("text", "text")}
    one, several = words[values.dtype.kind]
    inner = tuple(values.shape[count:])
    return f"an array of {several} of shape {inner}" if inner else one


def _axis_text(name: str, values: Array) -> str:
    if len(values) == 1 or values.dtype.kind in "Ub":
        return f"{name} = {value_text(values)}"
    return f"{name}: {len(values)} values from {values.min():.6g} to {values.max():.6g}"


def _text(point: Mapping[str, Any]) -> str:
    return ", ".join(f"{name} = {value_text(value)}" for name, value in point.items())


def _nearest(known: Array, value: Any) -> str:
    """Return the values of an axis next to a given one, in words."""
    if known.dtype.kind in "Ub":
        return f"its values are {value_text(known)}"
    near = known[np.argsort(np.abs(known - float(value)))[:2]]
    return f"the nearest are {value_text(np.sort(near).astype(float))}"
