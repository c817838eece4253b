"""HTML tables of results for notebooks."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from html import escape
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from fastslow.results.branch.branch import Branch
    from fastslow.results.branch.diagram import Diagram
    from fastslow.results.points import SpecialPoint
    from fastslow.results.trajectory.trajectory import Trajectory

#: Maximal number of rows of a table; further ones are counted.
LONGEST = 40


def table(title: str, head: Sequence[str], rows: Sequence[Sequence[str]], notes: str = "") -> str:
    """Return a table with a caption; all text is escaped.

    Examples
    --------
    >>> table("a < b", ["x"], [["1"]])  # doctest: +ELLIPSIS
    '<table><caption ...>a &lt; b</caption><thead><tr><th>x</th></tr></thead><tbody>...</table>'
    """
    shown = rows[:LONGEST]
    lines = "".join(_line("td", row) for row in shown)
    if len(rows) > len(shown):
        more = f"and {len(rows) - len(shown)} more"
        lines += f'<tr><td colspan="{len(head)}">{more}</td></tr>'
    caption = escape(title).replace("\n", "<br>")
    text = (
        f'<table><caption style="text-align: left">{caption}</caption>'
        f"<thead>{_line('th', head)}</thead><tbody>{lines}</tbody></table>"
    )
    return text + (f"<p>{escape(notes)}</p>" if notes else "")


def _line(tag: str, cells: Iterable[str]) -> str:
    return "<tr>" + "".join(f"<{tag}>{escape(cell)}</{tag}>" for cell in cells) + "</tr>"


def _number(value: float | None) -> str:
    return "" if value is None else f"{value:.6g}"


def points_html(
    points: Sequence[SpecialPoint], title: str = "", varied: tuple[str, ...] = ()
) -> str:
    """Special points, one row each: what, where, and in which region.

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
    return table(title or f"{len(points)} special points", head, rows)


def branch_html(branch: Branch) -> str:
    """Return the table of a branch with its special points."""
    return _with_points([("", branch)], repr(branch).split(";")[0], branch.parameter)


def diagram_html(diagram: Diagram) -> str:
    """Return the table of all branches with their special points."""
    title = repr(diagram).split("\n")[0]
    if not diagram.outcome:
        title += f"\n{diagram.outcome}"
    title += "".join(f"\n{change}" for change in diagram.unexplained)
    numbered = [(str(k), branch) for k, branch in enumerate(diagram.branches)]
    return _with_points(numbered, title, diagram.parameter)


def _with_points(branches: Sequence[tuple[str, Branch]], title: str, name: str) -> str:
    states = branches[0][1].states if branches else ()
    head = ["branch"] * (len(branches) != 1 or branches[0][0] != "")
    head += ["point", "kind", name, *states, "region", "interface"]
    rows = []
    for number, branch in branches:
        for p in branch.special:
            row = [p.label, p.words, _number(p.parameters[name])]
            row += [_number(p[n]) for n in states]
            row += [" | ".join(p.regions), p.interface or ""]
            rows.append([number, *row] if number else row)
    return table(title, head, rows)


def trajectory_html(run: Trajectory) -> str:
    """Return the table of a run with its crossings."""
    title = repr(run)
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
    more = len(run.crossing_table) - len(rows)
    return table(title, head, rows, f"and {more} more crossings" if more > 0 else "")
