"""HTML tables of results for notebooks."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from html import escape
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from fastslow.results.branch.branch import Branch
    from fastslow.results.points import SpecialPoint
    from fastslow.results.trajectory.trajectory import Trajectory

#: Maximal number of rows of a table; further ones are counted.
LONGEST = 40


class Cells(NamedTuple):
    """The text of a table.

    Parameters
    ----------
    head, rows : sequence
        Text of the cells; of the rows the first ``LONGEST`` are shown.
    total : int, optional
        Number of rows if ``rows`` are only the first ones.
    """

    head: Sequence[str]
    rows: Sequence[Sequence[str]]
    total: int | None = None


def table(title: str, cells: Cells) -> str:
    """Return a table with a caption; all text is escaped.

    Examples
    --------
    >>> table("a < b", Cells(["x"], [["1"]]))  # doctest: +ELLIPSIS
    '<table><caption ...>a &lt; b</caption><thead><tr><th>x</th></tr></thead><tbody>...</table>'
    """
    shown = cells.rows[:LONGEST]
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


def _number(value: float | None) -> str:
    return "" if value is None else f"{value:.6g}"


def points_cells(points: Sequence[SpecialPoint], varied: tuple[str, ...] = ()) -> Cells:
    """Return the table of special points: type, coordinates and region.

    Without ``varied``, the parameters shown are those that differ between the points.
    """
    states = tuple(dict.fromkeys(n for p in points for n in p.states))
    values = [p.parameters for p in points]
    varied = varied or tuple(
        n
        for n in dict.fromkeys(n for v in values for n in v)
        if len({v.get(n) for v in values}) > 1 or len(values) == 1
    )
    head = ["point", "kind", *varied, *states, "region", "interface"]
    rows = [
        [
            p.label,
            p.words,
            *(_number(p.parameters.get(n)) for n in varied),
            *(_number(p[n]) if n in p.states else "" for n in states),
            " | ".join(p.regions),
            p.interface or "",
        ]
        for p in points
    ]
    return Cells(head, rows)


def diagram_cells(branches: Sequence[Branch], parameter: str) -> Cells:
    """Return the table of the special points of several branches, with the branch of each."""
    points = [p for branch in branches for p in branch.special]
    cells = points_cells(points, (parameter,))
    numbers = [str(k) for k, branch in enumerate(branches) for _ in branch.special]
    rows = [[number, *row] for number, row in zip(numbers, cells.rows, strict=True)]
    return Cells(["branch", *cells.head], rows)


def crossings_cells(run: Trajectory) -> Cells:
    """Return the table of the crossings of a run."""
    head = ["t", *run.states, "interface", "direction", "from", "to"]
    arrows = {1: "upwards", -1: "downwards", 0: "touching"}
    rows = [
        [
            f"{c.time:.9g}",
            *(_number(float(v)) for v in c.state),
            c.interface,
            arrows[c.direction],
            c.from_region,
            c.to_region,
        ]
        for c in run.crossings[:LONGEST]
    ]
    return Cells(head, rows, len(run.crossing_table))
