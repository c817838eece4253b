"""Text and HTML of objects in a console and a notebook: short, with what is cut short counted."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import fields
from typing import Any

import numpy as np

from fastslow.results.base import html

#: Maximal number of lines of a repr.
LINES = 10

#: Maximal number of entries of an array, a tuple or a mapping in the text of a value.
SHOWN_ENTRIES = 6


def brief(groups: Iterable[Sequence[str]], lines: int = LINES) -> str:
    """Join groups of lines; the longest groups are cut until all fit, and the rest counted.

    Examples
    --------
    >>> print(brief([["Two groups"], ["  a", "  b", "  c"], ["  the end"]], lines=4))
    Two groups
      a
      … 2 more lines, see summary()
      the end
    """
    whole = [list(group) for group in groups]
    shown = [len(group) for group in whole]

    def heights() -> list[int]:
        return [n + (n < len(group)) for n, group in zip(shown, whole, strict=True)]

    while sum(heights()) > lines and max(shown, default=0) > 1:
        longest = max(range(len(whole)), key=heights().__getitem__)
        # one line is replaced by the count together with the line before
        shown[longest] -= 2 if shown[longest] == len(whole[longest]) else 1
    text = []
    for n, group in zip(shown, whole, strict=True):
        text += group[:n]
        if n < len(group):
            indent = group[n][: len(group[n]) - len(group[n].lstrip())]
            text.append(f"{indent}… {len(group) - n} more lines, see summary()")
    return "\n".join(text)


def value_text(value: Any) -> str:
    """Return a value in a few words: numbers with six digits, long arrays by their shape.

    Examples
    --------
    >>> value_text(1 / 3), value_text(np.array([1.0, 0.5])), value_text(np.zeros((40, 2)))
    ('0.333333', '1, 0.5', 'array of shape (40, 2)')
    >>> value_text({"a": 1.0}), value_text(("LP", "HB"))
    ('a = 1', 'LP, HB')
    """
    if isinstance(value, bool | np.bool_) or value is None:
        return str(value)
    if isinstance(value, float | np.floating | complex | np.complexfloating):
        return f"{value:.6g}"
    if isinstance(value, np.ndarray):
        if value.ndim != 1 or len(value) > SHOWN_ENTRIES:
            return f"array of shape {value.shape}"
        return ", ".join(map(value_text, value.tolist()))
    if isinstance(value, Mapping):
        return _joined([f"{name} = {value_text(item)}" for name, item in value.items()])
    if isinstance(value, tuple | list) and not isinstance(value, Displayed):
        return _joined([value_text(item) for item in value[: SHOWN_ENTRIES + 1]], len(value))
    return str(value).split("\n")[0]


def _joined(items: Sequence[str], count: int | None = None) -> str:
    more = (len(items) if count is None else count) - SHOWN_ENTRIES
    return ", ".join(items[:SHOWN_ENTRIES]) + (f", … {more} more" if more > 0 else "")


def fields_of(value: Any) -> dict[str, str]:
    """Return the fields of a dataclass as text, without those that are None or empty."""
    kept = {}
    for entry in fields(value):
        item = getattr(value, entry.name)
        empty = item is None or (isinstance(item, str | tuple | Mapping) and not len(item))
        if entry.repr and not empty:
            kept[entry.name] = value_text(item)
    return kept


class Displayed:
    """Mixin with a short repr, and an HTML table for notebooks."""

    __slots__ = ()

    def __repr__(self) -> str:
        text = ", ".join(f"{name}: {value}" for name, value in fields_of(self).items())
        return f"{type(self).__name__}({text})"

    def _repr_html_(self) -> str:
        return html.cells_as_html(self._caption(), self._cells())

    def _caption(self) -> str:
        """Return the text above the HTML table."""
        return repr(self)

    def _cells(self) -> html.Cells:
        """Return the content of the HTML table, by default the fields."""
        return html.Cells(("field", "value"), list(fields_of(self).items()))


class Summarized(Displayed):
    """Mixin of objects described by several lines, of which the repr shows at most ten."""

    def _groups(self) -> list[list[str]]:
        """Return groups of lines: first the heading with all warnings, then lists."""
        raise NotImplementedError

    def summary(self) -> str:
        """Return the full description; the repr is cut after ten lines."""
        return "\n".join(line for group in self._groups() for line in group)

    def __repr__(self) -> str:
        return brief(self._groups())

    def _caption(self) -> str:
        return "\n".join(self._groups()[0])
