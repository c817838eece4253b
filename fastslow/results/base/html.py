"""HTML tables of results for notebooks."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from html import escape
from typing import NamedTuple

#: Maximal number of rows of a table; further ones are counted.
HTML_ROWS = 40


class Cells(NamedTuple):
    """The text of a table.

    Parameters
    ----------
    head, rows : sequence
        Text of the cells; of the rows the first ``HTML_ROWS`` are shown.
    total : int, optional
        Number of rows if ``rows`` are only the first ones.
    """

    head: Sequence[str]
    rows: Sequence[Sequence[str]]
    total: int | None = None


def cells_as_html(title: str, cells: Cells) -> str:
    """Return a table with a caption; all text is escaped.

    Examples
    --------
    >>> cells_as_html("a < b", Cells(["x"], [["1"]]))  # doctest: +ELLIPSIS
    '<table><caption ...>a &lt; b</caption><thead><tr><th>x</th></tr></thead><tbody>...</table>'
    """
    shown = cells.rows[:HTML_ROWS]
    lines = "".join(_line("td", row) for row in shown)
    more = (len(cells.rows) if cells.total is None else cells.total) - len(shown)
    if more > 0:
        lines += f'<tr><td colspan="{len(cells.head)}">… {more} more</td></tr>'
    head = f"<thead>{_line('th', cells.head)}</thead>"
    return f"<table>{_caption(title)}{head}<tbody>{lines}</tbody></table>"


def formulas(title: str, latex: str) -> str:
    """Return a caption above formulas in LaTeX, which a notebook typesets.

    Examples
    --------
    >>> formulas("x", "a < b")  # doctest: +ELLIPSIS
    '<table><caption ...>x</caption><tbody><tr><td>a &lt; b</td></tr></tbody></table>'
    """
    return f"<table>{_caption(title)}<tbody>{_line('td', [latex])}</tbody></table>"


def _caption(title: str) -> str:
    lines = escape(title).replace("\n", "<br>")
    return f'<caption style="text-align: left">{lines}</caption>'


def _line(tag: str, cells: Iterable[str]) -> str:
    return "<tr>" + "".join(f"<{tag}>{escape(cell)}</{tag}>" for cell in cells) + "</tr>"
