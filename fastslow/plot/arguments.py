"""Validation of the arguments of plot functions."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any, TypeAlias

import numpy as np
from matplotlib.colors import is_color_like
from matplotlib.lines import Line2D
from numpy.typing import ArrayLike, NDArray

from fastslow.arguments import (
    Expression,
    either,
    finite,
    formula,
    function,
    items,
    mapping,
    numbers,
    refusal,
    shown,
    text,
    within,
    word,
)
from fastslow.errors import ArgumentError, unknown_name
from fastslow.plot.layout.bands import Level
from fastslow.plot.layout.style import WIDTHS

#: Quantity on an axis: a name, an expression, or a function of the columns.
Axis: TypeAlias = "Expression | Callable[[Mapping[str, NDArray[np.float64]]], ArrayLike]"
axis_quantity = either(function, formula)


#: Accepted widths in millimetres.
_drawable = within(30.0, 2000.0)


def figure_width(name: str, value: Any) -> str | float:
    """Validate the width of a figure, a name or millimetres."""
    if isinstance(value, str):
        return word("width", WIDTHS)(name, value)
    return _drawable(name, value)


def line_colour(name: str, value: Any) -> Any:
    """Validate a Matplotlib colour."""
    if not is_color_like(value):
        raise refusal(name, value, "a colour, such as '#0072B2' or 'black'")
    return value


def line_style(name: str, value: Mapping[str, Any]) -> Mapping[str, Any]:
    """Validate Matplotlib properties of a line.

    Raises
    ------
    UnknownNameError
        For a name that is not a property of a line.
    ArgumentError
        For an invalid value of a property.
    """
    for key, entry in value.items():
        if key == "color":
            line_colour(key, entry)
        if isinstance(entry, float) and not math.isfinite(entry):
            raise refusal(key, entry, "a finite number")
        try:
            Line2D([], []).set(**{key: entry})
        except AttributeError:
            # the properties that have a setter
            valid = sorted(p[4:] for p in dir(Line2D) if p.startswith("set_"))
            if key not in valid:
                raise unknown_name("property of a line", key, valid) from None
            raise refusal(key, entry, f"a {key} of a line") from None
        except (TypeError, ValueError, KeyError, OverflowError) as error:
            raise ArgumentError(f"{key} = {shown(entry)}: {error}") from None
    return value


def levels_of_states(name: str, value: Any) -> Mapping[str, Level]:
    """Validate interfaces with their state and value, as `Diagram.interface_values`."""
    given = mapping(name, value)
    return {str(key): _level(f"{name}[{key!r}]", entry) for key, entry in given.items()}


def _level(name: str, value: Any) -> Level:
    if (
        not isinstance(value, tuple | list)
        or len(value) not in (2, 3)
        or not isinstance(value[0], str)
    ):
        raise refusal(name, value, "a state and its value")
    level = value[0], finite(name, value[1])
    if len(value) == 2:
        return level
    if value[2] not in (-1, 1):
        raise refusal(name, value, "a state, its value, and 1 or -1, the side beyond a wall")
    return *level, int(value[2])


def points_in_plane(name: str, value: Any) -> Mapping[str, tuple[float, float]]:
    """Validate a mapping of texts to points."""
    return {
        text(f"a name in {name}", key): _point(f"{name}[{key!r}]", at)
        for key, at in mapping(name, value).items()
    }


def _point(name: str, value: Any) -> tuple[float, float]:
    both = items(finite)(name, value)
    if len(both) != 2:
        raise refusal(name, value, "two numbers")
    return both[0], both[1]


def lines_in_plane(name: str, value: Any) -> Mapping[str, Any]:
    """Validate a mapping of texts to the two columns of a line, with NaN for gaps."""
    return {
        text(f"a name in {name}", key): _line(f"{name}[{key!r}]", line)
        for key, line in mapping(name, value).items()
    }


def _line(name: str, value: Any) -> tuple[Any, ...]:
    both = items(numbers)(name, value)
    if len(both) != 2 or both[0].ndim != 1 or both[0].shape != both[1].shape:
        raise refusal(name, value, "two columns of equal length")
    return both
