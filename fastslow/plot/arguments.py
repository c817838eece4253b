"""What the look of a figure may be, checked before anything is drawn."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from matplotlib.colors import is_color_like
from matplotlib.lines import Line2D

from fastslow.arguments import refusal, shown
from fastslow.errors import ArgumentError, unknown_name


def line_colour(name: str, value: Any) -> Any:
    """A colour, as matplotlib reads it."""
    if not is_color_like(value):
        raise refusal(name, value, "a colour, such as '#0072B2' or 'black'")
    return value


def line_style(name: str, value: Mapping[str, Any]) -> Mapping[str, Any]:
    """Properties of a line, as matplotlib names them.

    Raises
    ------
    UnknownNameError
        For a name that is no property of a line.
    ArgumentError
        For a value that its property cannot have.
    """
    for key, entry in value.items():
        try:
            Line2D([], []).set(**{key: entry})
        except AttributeError:
            # the properties themselves, by the setters of the class
            valid = sorted(p[4:] for p in dir(Line2D) if p.startswith("set_"))
            if key not in valid:
                raise unknown_name("property of a line", key, valid) from None
            raise refusal(key, entry, f"a {key} of a line") from None
        except (TypeError, ValueError, KeyError) as error:
            raise ArgumentError(f"{key} = {shown(entry)}: {error}") from None
    return value
