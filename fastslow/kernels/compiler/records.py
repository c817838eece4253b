"""Named tuples as records of arguments of compiled functions, at no cost.

The annotations of the fields give the type of a record without an instance.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache
from typing import Annotated, Any, NamedTuple, TypeVar, cast, get_origin, get_type_hints

import numpy as np
from numpy.typing import NDArray

R = TypeVar("R")

#: C-contiguous arrays with the name of their type and the number of axes.
Vector = Annotated[NDArray[np.float64], "float64", 1]
Matrix = Annotated[NDArray[np.float64], "float64", 2]
Tensor = Annotated[NDArray[np.float64], "float64", 3]
ComplexVector = Annotated[NDArray[np.complex128], "complex128", 1]
ComplexMatrix = Annotated[NDArray[np.complex128], "complex128", 2]
ComplexTensor = Annotated[NDArray[np.complex128], "complex128", 3]
Integers = Annotated[NDArray[np.int64], "int64", 1]
IntegerMatrix = Annotated[NDArray[np.int64], "int64", 2]
IntegerTensor = Annotated[NDArray[np.int64], "int64", 3]
Flags = Annotated[NDArray[np.bool_], "boolean", 1]

_TYPES: dict[str, Any] = {
    "float64": np.float64,
    "complex128": np.complex128,
    "int64": np.int64,
    "boolean": np.bool_,
}


@cache
def _kinds(record: type) -> tuple[Any, ...]:
    """Kind of each field: a record, a number, or type name and axes of an array."""
    hints = get_type_hints(record, include_extras=True).values()
    return tuple(h.__metadata__ if get_origin(h) is Annotated else h for h in hints)


def zeros(record: type[R], *fields: Any, **named: Any) -> R:
    """Create a record of zero arrays.

    Parameters
    ----------
    record : type
    *fields, **named
        Shape or length of every array, in order or by name; a nested record is passed as it is.
    """
    names: tuple[str, ...] = cast(Any, record)._fields
    kinds = dict(zip(names, _kinds(cast(Any, record)), strict=True))
    given = dict(zip(names[: len(fields)], fields, strict=True), **named)
    made = {
        name: field if hasattr(kinds[name], "_fields") else np.zeros(field, _TYPES[kinds[name][0]])
        for name, field in given.items()
    }
    return record(**made)


def type_of(kind: Any) -> Any:
    """Numba type of a record, of a number, or of an array given by type name and axes."""
    from numba import types

    plain = {int: types.int64, float: types.float64, bool: types.boolean}
    if kind in plain:
        return plain[kind]
    if hasattr(kind, "_fields"):
        return types.NamedTuple([type_of(field) for field in _kinds(kind)], kind)
    name, axes = kind
    return types.Array(getattr(types, name), axes, "C")


def records_within(record: type) -> list[type]:
    """A record type and the record types nested in it; empty for a number."""
    if not hasattr(record, "_fields"):
        return []
    return [record, *(r for kind in _kinds(record) for r in records_within(kind))]


def construction(record: Any, names: Iterator[str]) -> str:
    """Source that constructs a record from names, one for each leaf.

    Examples
    --------
    >>> from typing import NamedTuple
    >>> Pair = NamedTuple("Pair", [("first", int), ("second", float)])
    >>> construction(Pair, iter("ab"))
    'Pair(a, b)'
    """
    if not hasattr(record, "_fields"):
        return next(names)
    fields = ", ".join(construction(kind, names) for kind in _kinds(record))
    return f"{record.__name__}({fields})"


class Leaf(NamedTuple):
    """A number or an array within an argument: access path, type, and number of axes."""

    path: str
    kind: str
    axes: int

    @property
    def dtype(self) -> np.dtype[Any]:
        """NumPy type."""
        return np.dtype(_TYPES[self.kind])


_NUMBERS = {int: "int64", float: "float64", bool: "boolean"}


def leaves(path: str, kind: Any) -> Iterator[Leaf]:
    """Numbers and arrays of an argument, in the order of the fields of its records.

    Examples
    --------
    >>> Pair = NamedTuple("Pair", [("first", int), ("second", Matrix)])
    >>> [tuple(leaf) for leaf in leaves("pair", Pair)]
    [('pair[0]', 'int64', 0), ('pair[1]', 'float64', 2)]
    """
    if kind in _NUMBERS:
        yield Leaf(path, _NUMBERS[kind], 0)
    elif hasattr(kind, "_fields"):
        for place, inner in enumerate(_kinds(kind)):
            yield from leaves(f"{path}[{place}]", inner)
    else:
        name, axes = kind if isinstance(kind, tuple) else kind.__metadata__
        yield Leaf(path, name, axes)
