"""Points that the user asks for: values of parameters, and zeros of expressions along a curve."""

from __future__ import annotations

import re
from abc import ABC, abstractmethod
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from fastslow.arguments import finite, items
from fastslow.continuation.location import JITTER, ROUNDINGS
from fastslow.errors import ArgumentError, unknown_name
from fastslow.formulas.columns import evaluation, names_in, written_formula
from fastslow.results.point_types import POINT_TYPES

Array = NDArray[np.float64]

#: The mark of an expression.
Expression = TypeVar("Expression")

#: A test at points of shape (…, k), shape (…).
Test = Callable[[Array], Array]

#: Step of central differences, relative to the size of an unknown.
CENTRAL_DIFFERENCE = 6e-6

#: Rounding of a located point, in units of its scale.
LOCATED = float(np.finfo(float).eps)

#: Largest rounding error, as a fraction of the size of a test.
LARGEST_ROUNDING = 1e-6


@dataclass(frozen=True)
class Mark(ABC):
    """A quantity whose zeros along a curve are special points UZ."""

    @property
    @abstractmethod
    def words(self) -> str:
        """The condition as text."""

    @abstractmethod
    def test(self, names: Sequence[str], constants: Mapping[str, float]) -> Test:
        """Return the quantity as a function of points.

        Parameters
        ----------
        names : sequence of str
            Names of the k entries of a point.
        constants : mapping
            Values of the other names.
        """


@dataclass(frozen=True)
class ValueMark(Mark):
    """A value of a parameter."""

    parameter: str
    value: float

    @property
    def words(self) -> str:
        return f"{self.parameter} = {self.value:g}"

    def test(self, names: Sequence[str], constants: Mapping[str, float]) -> Test:
        place = names.index(self.parameter)
        return lambda points: points[..., place] - self.value


@dataclass(frozen=True)
class ExpressionMark(Mark):
    """An expression with a name, by which the points are labelled.

    Parameters
    ----------
    name : str
        Points are labelled by it and a number.
    expression : str

    Examples
    --------
    >>> level = ExpressionMark("level", "x - a*y")
    >>> level.test(("x", "y"), {"a": 2.0})(np.array([[1.0, 0.5], [3.0, 1.0]]))
    array([0., 1.])
    """

    name: str
    expression: str

    @property
    def words(self) -> str:
        return f"{self.name} ({self.expression} = 0)"

    def test(self, names: Sequence[str], constants: Mapping[str, float]) -> Test:
        function = evaluation(self.expression, [*names, *constants])

        def test(points: Array) -> Array:
            columns = {name: points[..., k] for k, name in enumerate(names)}
            return np.broadcast_to(function({**constants, **columns}), points.shape[:-1])

        return test


def read_marks(
    given: Any, ranges: Mapping[str, tuple[float, float]], names: Collection[str]
) -> tuple[Mark, ...]:
    """Return the marks given by a user.

    Parameters
    ----------
    given : sequence, mapping or None
        Values of the one parameter; or a mapping of a parameter to its values, and of names to
        expressions, as text or in SymPy.
    ranges : mapping
        The free parameters with their ranges.
    names : collection of str
        Every name that an expression may contain.

    Raises
    ------
    ArgumentError
        For a value outside of its range, and for a name of an expression that is no identifier,
        ends with a digit, or is that of a column or of a code.
    UnknownNameError
        For an unknown name in an expression, or an unknown parameter.

    Examples
    --------
    >>> read_marks({"p": [0.5], "level": "x**2 - p"}, {"p": (0.0, 1.0)}, ["x", "p"])
    (ValueMark(parameter='p', value=0.5), ExpressionMark(name='level', expression='x**2 - p'))
    """
    return marks_of(given, ranges, lambda name, entry: _expression(name, entry, names))


def marks_of(
    given: Any, ranges: Mapping[str, tuple[float, float]], read: Callable[[str, Any], Expression]
) -> tuple[ValueMark | Expression, ...]:
    """Return the marks given by a user, as `read_marks`, of which the caller reads expressions.

    Parameters
    ----------
    given : sequence, mapping or None
    ranges : mapping
    read : callable
        Returns the mark of an expression from its name and what is given.
    """
    if given is None:
        return ()
    if not isinstance(given, Mapping):
        (parameter,) = ranges
        return tuple(_value(parameter, value, ranges) for value in given)
    found: list[ValueMark | Expression] = []
    for key, entry in given.items():
        name = str(key)
        if isinstance(entry, str) or hasattr(entry, "free_symbols"):
            found.append(read(name, entry))
            continue
        if name not in ranges:
            raise unknown_name("parameter in marks", name, ranges)
        values = items(finite)(f"marks['{name}']", entry)
        found += [_value(name, value, ranges) for value in values]
    return tuple(found)


def _value(name: str, value: float, ranges: Mapping[str, tuple[float, float]]) -> ValueMark:
    lower, upper = ranges[name]
    if not lower <= value <= upper:
        raise ArgumentError(f"mark {name} = {value:g} is outside the range [{lower:g}, {upper:g}]")
    return ValueMark(name, float(value))


def check_name(name: str, taken: Collection[str]) -> None:
    """Check that points can be labelled by the name of an expression and a number.

    Parameters
    ----------
    name : str
    taken : collection of str
        Names that mean something else.
    """
    if not name.isidentifier() or name[-1].isdigit():
        raise ArgumentError(
            f"marks: the name {name!r} of an expression; expected an identifier that does not end "
            "with a digit, such as 'level', whose points are labelled level1, level2, …"
        )
    if name in POINT_TYPES:
        raise ArgumentError(
            f"marks: the name {name!r} of an expression is the code of a {POINT_TYPES[name].name}; "
            "expected another name"
        )
    like = [one for one in taken if re.fullmatch(rf"{re.escape(name)}\d*", one)]
    if like:
        raise ArgumentError(
            f"marks: the name {name!r} of an expression, or a label of its points, is that of "
            f"{like[0]}; expected another name"
        )


def _expression(name: str, given: Any, names: Collection[str]) -> ExpressionMark:
    check_name(name, names)
    text = written_formula(given)
    if not names_in(text, dict.fromkeys(names)):
        raise ArgumentError(
            f"marks: {name} = {text} is constant; expected an expression in {', '.join(names)}"
        )
    return ExpressionMark(name, text)


def size_of(test: Test, points: Array) -> float:
    """Return the largest modulus of a test at points at which it is finite."""
    with np.errstate(all="ignore"):
        values = np.abs(test(points))
    return float(values[np.isfinite(values)].max(initial=0.0))


def beyond_rounding(test: Test, points: Array, scale: Array, size: float) -> Array:
    """Return the values of a test at points, 0 where they are rounding errors, shape (…).

    Rounding is measured by the change of the test with the last digits of the point. A change that
    is not small is that of a pole or a discontinuity.

    Parameters
    ----------
    test : callable
    points : ndarray, shape (…, k)
    scale : ndarray, shape (k,)
        Unit of each entry.
    size : float
        Size of the test.

    Examples
    --------
    >>> points = np.array([[1.0], [1.0 + 3e-16], [1.0 + 1e-12]])
    >>> beyond_rounding(lambda u: u[..., 0] - 1.0, points, np.ones(1), 1.0).round(14)
    array([0.e+00, 0.e+00, 1.e-12])
    """
    with np.errstate(all="ignore"):
        values = np.array(test(points), dtype=float)
        move = JITTER * np.abs(points) + LOCATED * scale
        even = np.where(np.arange(points.shape[-1]) % 2, -1.0, 1.0)
        moves = np.array([side * one for one in (even, np.abs(even)) for side in (1.0, -1.0)])
        moved = test(points + moves.reshape(len(moves), *(1,) * (points.ndim - 1), -1) * move)
        rounding = ROUNDINGS * np.abs(moved - values).max(axis=0)
    return np.where(np.abs(values) <= np.fmin(rounding, LARGEST_ROUNDING * size), 0.0, values)


def gradient(test: Test, points: Array, scale: Array) -> Array:
    """Return the derivatives of a test at points, by central differences, shape (…, k)."""
    width = points.shape[-1]
    steps = CENTRAL_DIFFERENCE * np.maximum(np.abs(points), scale)
    moves = np.eye(width).reshape(width, *(1,) * (points.ndim - 1), width) * steps
    with np.errstate(all="ignore"):
        change = test(points + moves) - test(points - moves)
    return np.moveaxis(change, 0, -1) / (2.0 * steps)
