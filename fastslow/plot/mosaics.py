"""Figures of several axes, to be drawn into by `ax=`."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes

from fastslow.arguments import flag, refusal, validated, within
from fastslow.plot.arguments import figure_width
from fastslow.plot.layout.style import MM, TEXT, inches, new_figure, styled_axes

#: Height of axes over their width, with their labels.
ASPECT = 0.75


def mosaic(name: str, value: Any) -> list[list[str]]:
    """Validate a layout, rows of letters of equal length."""
    rows = [list(row.strip()) for row in str(value).split(";")]
    valid = isinstance(value, str) and len({len(row) for row in rows}) == 1 and rows[0]
    if not valid or not all(letter.isalpha() for row in rows for letter in row):
        raise refusal(name, value, "rows of letters of equal length, such as 'ab' or 'aa;bc'")
    for letter in {letter for row in rows for letter in row}:
        across, down = np.nonzero(np.array(rows) == letter)
        if len(across) != (np.ptp(across) + 1) * (np.ptp(down) + 1):
            raise refusal(name, value, "each letter in one rectangle")
    return rows


@validated(layout=mosaic, width=figure_width, height=within(20.0, 2000.0), label=flag)
def axes(
    layout: str,
    *,
    width: str | float = "page",
    height: float | None = None,
    label: bool = True,
) -> tuple[Axes, ...]:
    """Create a figure of several axes, with small text and the letters (a), (b), … above them.

    Parameters
    ----------
    layout : str
        A letter for each axes, rows separated by semicolons: ``"ab"`` for two side by side,
        ``"a;b"`` for one above the other, ``"aa;bc"`` for a wide one above two.
    width : str or float
        Width of the figure: ``"column"`` (85 mm), ``"page"`` (170 mm), or millimetres.
    height : float, optional
        In millimetres; by default axes of one letter are 4 wide and 3 high.
    label : bool
        Whether to write the letters.

    Returns
    -------
    tuple of Axes
        In the order of the letters; ``axes[0].figure`` is the figure.

    See Also
    --------
    fastslow.plot.panel

    Examples
    --------
    >>> import fastslow as fs
    >>> above, left, right = fs.plot.axes("aa;bc", height=100)
    >>> left.get_title(loc="left")
    '(b)'
    >>> run = fs.simulate(fs.systems.van_der_pol_relaxation(), [1, 0], t=(0, 100))
    >>> drawn = fs.plot.time_series(run, "x", ax=above)
    >>> drawn.figure is right.figure
    True
    """
    rows: Any = layout
    across = inches(width)
    high = ASPECT * across * len(rows) / len(rows[0]) if height is None else height * MM
    found = new_figure(across, high).subplot_mosaic(rows)
    for letter, ax in found.items():
        styled_axes(ax).locator_params(nbins=5)
        if label:
            ax.set_title(f"({letter})", loc="left", fontsize=TEXT)
    return tuple(found[letter] for letter in sorted(found, key=lambda one: (one.casefold(), one)))
