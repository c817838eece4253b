"""Bifurcation diagrams by simulation (brute-force diagrams)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.legend import Legend
from matplotlib.lines import Line2D

from fastslow.arguments import flag, instance, positive, validated
from fastslow.plot.arguments import figure_width, line_style
from fastslow.plot.drawings import Drawing
from fastslow.plot.layout.legends import add_legend
from fastslow.plot.layout.style import BLACK, BLUE, GREY, VERMILION, axes_for, widen_limits
from fastslow.plot.layout.thinning import draw_long
from fastslow.plot.layout.typesetting import typeset
from fastslow.results.trajectory.long_time.sweep import BifurcationSweep, SweepPass

#: Size of the dots in points by the number up to which it is used.
SIZES = ((2_000, 1.6), (20_000, 0.9), (np.inf, 0.5))

#: Size of the dots swept up relative to those swept down, whose rims they are where both agree.
RIM = 1.8

#: Dots by direction of the sweep.
LOOKS: dict[int, dict[str, Any]] = {
    1: {"color": BLUE, "markeredgewidth": 0.0, "label": "swept up"},
    -1: {"color": VERMILION, "markeredgewidth": 0.0, "label": "swept down"},
}


@dataclass(frozen=True, eq=False, repr=False)
class SweepDrawing(Drawing):
    """A drawn sweep.

    Parameters
    ----------
    ax : Axes
    x, y : str
        Quantities on the axes.
    up, down : Line2D or None
        The points of the sweep in each direction.
    failures : Line2D or None
        Values at which the simulation failed, along the lower edge.
    legend : Legend or None
    """

    x: str
    y: str
    up: Line2D | None
    down: Line2D | None
    failures: Line2D | None
    legend: Legend | None


@validated(
    sweep=instance(BifurcationSweep),
    ax=instance(Axes),
    width=figure_width,
    label=flag,
    legend=flag,
    size=positive,
    style=line_style,
)
def sweep(
    sweep: BifurcationSweep,
    *,
    ax: Axes | None = None,
    width: str | float = "column",
    label: bool = True,
    legend: bool | None = None,
    size: float | None = None,
    **style: Any,
) -> SweepDrawing:
    """Draw a bifurcation diagram by simulation, with both directions in one figure.

    Parameters
    ----------
    sweep : BifurcationSweep
    ax : Axes, optional
        Axes to draw into; new ones otherwise.
    width : str or float
        Width of a new figure: ``"column"`` (85 mm), ``"page"`` (170 mm), or millimetres.
    label, legend : bool, optional
        Whether to draw a legend of the two directions; ``legend`` takes precedence and is by
        default as ``label``.
    size : float, optional
        Diameter of the dots in points; by default decreasing with their number.
    **style
        Properties of the points of both directions.

    Returns
    -------
    SweepDrawing

    See Also
    --------
    fastslow.bifurcation_sweep, fastslow.plot.response

    Examples
    --------
    >>> import fastslow as fs
    >>> import sympy as sp
    >>> x, c, t = sp.symbols("x c t")
    >>> model = fs.Model({x: c * sp.cos(t) - x}, parameters={c: 1})
    >>> found = fs.bifurcation_sweep(model, "c", [1, 2], [0], settle=5, keep=1)
    >>> drawn = fs.plot.sweep(found, width=120)
    >>> drawn.ax.get_ylabel(), sorted(drawn.data)
    ('$x$ (stroboscopic)', ['swept down', 'swept up'])
    """
    own = ax is None
    ax = axes_for(ax, width)
    most = max((len(p.x) for p in sweep.passes), default=0)
    if size is None:
        size = next(size for count, size in SIZES if most <= count)
    one = len(sweep.passes) == 1
    up = _points(ax, sweep.up, size if one else RIM * size, one, style)
    down = _points(ax, sweep.down, size, one, style)
    failed = sorted({value for value, _ in sweep.failures})
    crosses = None
    if failed:
        (crosses,) = ax.plot(
            failed,
            np.full(len(failed), 0.02),
            linestyle="none",
            marker="x",
            markersize=3.0,
            markeredgewidth=0.7,
            color=GREY,
            transform=ax.get_xaxis_transform(),
            label="run failed",
        )
    widen_limits(ax)
    margin = 0.02 * (sweep.values[-1] - sweep.values[0]) or 0.5
    ax.set_xlim(sweep.values[0] - margin, sweep.values[-1] + margin)
    ax.set_xlabel(typeset(sweep.parameter))
    ax.set_ylabel(f"{typeset(sweep.name)} ({sweep.what})")
    drawn = [line for line in (up, down, crosses) if line is not None]
    samples = [_sample(line) for line in drawn]
    words = add_legend(ax, samples, own, label, legend) if len(samples) > 1 else None
    return SweepDrawing(ax, sweep.parameter, sweep.name, up, down, crosses, words)


def _points(
    ax: Axes, one: SweepPass | None, size: float, alone: bool, style: dict[str, Any]
) -> Line2D | None:
    if one is None:
        return None
    look = {"color": BLACK, "markeredgewidth": 0.0} if alone else LOOKS[one.direction]
    look = {"linestyle": "none", "marker": "o", "markersize": size, **look, **style}
    return draw_long(ax, one.swept, one.x, **look)


def _sample(line: Line2D) -> Line2D:
    """Return a legend entry with larger markers."""
    sample = Line2D([], [])
    sample.update_from(line)
    sample.set_label(str(line.get_label()))
    sample.set_markersize(max(line.get_markersize(), 3.0))
    return sample
