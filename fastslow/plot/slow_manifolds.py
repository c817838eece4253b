"""The deviation of a run from the equilibria, with that of the slow manifold to second order."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.legend import Legend
from matplotlib.lines import Line2D
from numpy.typing import NDArray

from fastslow.arguments import Name, flag, formula, instance, validated
from fastslow.errors import unknown_name
from fastslow.plot.arguments import figure_width, line_style
from fastslow.plot.drawings import Drawing
from fastslow.plot.layout.legends import add_legend
from fastslow.plot.layout.style import BLACK, GREY, MOTION, axes_for, note
from fastslow.plot.layout.typesetting import typeset
from fastslow.results.base.intervals import runs_of
from fastslow.results.overlay.freezing import Freezing

#: Fill of the band where the term of second order is small, and elsewhere, with their names.
BAND_FILLS: tuple[tuple[str, dict[str, Any]], ...] = (
    ("x₁ ± |x₂|", {"facecolor": "#CFE3CF", "edgecolor": "#8FBF8F"}),
    ("freezing doubtful", {"facecolor": "#F2C9B4", "edgecolor": "#D55E00"}),
)

#: Height of the axes, in ranges of the band where freezing is valid.
AROUND = 2.0


@dataclass(frozen=True, eq=False, repr=False)
class FreezingDrawing(Drawing):
    """A drawn band of freezing.

    Parameters
    ----------
    ax : Axes
    y : str
        The state.
    line : Line2D
        Deviation of the run from the equilibrium.
    first : Line2D
        The lag x₁.
    bands : tuple of PolyCollection
        The band x₁ ± |x₂|, where freezing is valid, then where it is doubtful.
    legend : Legend or None
    """

    y: str
    line: Line2D
    first: Line2D
    bands: tuple[Artist, ...]
    legend: Legend | None


@validated(
    band=instance(Freezing),
    y=formula,
    ax=instance(Axes),
    width=figure_width,
    label=flag,
    legend=flag,
    style=line_style,
)
def freezing(
    band: Freezing,
    y: Name | None = None,
    *,
    ax: Axes | None = None,
    width: str | float = "column",
    label: bool = True,
    legend: bool | None = None,
    **style: Any,
) -> FreezingDrawing:
    """Draw the deviation of a run from the equilibria with the band of `Overlay.freezing`.

    The lag is small beside the diagram, so that the band is drawn about the equilibrium: the run,
    x₁ and x₁ ± |x₂| over the slow quantity, in another colour where |x₂| is not small or the band
    is cut at an interface.

    Parameters
    ----------
    band : Freezing
        `Overlay.freezing`.
    y : str or Symbol, optional
        State, by default the first.
    ax : Axes, optional
        Axes to draw into; new ones otherwise.
    width : str or float
        Width of a new figure: ``"column"`` (85 mm), ``"page"`` (170 mm), or millimetres.
    label : bool
        Whether to note in the axes that there is no band.
    legend : bool, optional
        Whether to draw a legend; by default as ``label``.
    **style
        Properties of the line of the run.

    Returns
    -------
    FreezingDrawing

    Raises
    ------
    UnknownNameError
        For a name that is no state of the diagram.

    See Also
    --------
    fastslow.overlay, fastslow.plot.overlay

    Examples
    --------
    >>> import fastslow as fs
    >>> model = fs.systems.cusp(omega=0.002)
    >>> diagram = fs.continue_equilibria(model.frozen(), "p", over=(-1.2, 1.2))
    >>> overlay = fs.overlay(diagram, fs.simulate(model, [-1.0], periods=1))
    >>> fs.plot.freezing(overlay.freezing).ax.get_xlabel()
    '$p$'
    """
    name = band.states[0] if y is None else str(y)
    if name not in band.states:
        raise unknown_name("state", name, band.states)
    k = band.states.index(name)
    own, ax = ax is None, axes_for(ax, width, height=64.0)
    ax.axhline(0.0, color=GREY, linewidth=0.5, zorder=1)
    base = band.equilibrium[:, k]
    deviation = band.state[:, k] - base
    look = {"color": MOTION, "linewidth": 0.8, "label": "trajectory", "zorder": 3, **style}
    (line,) = ax.plot(band.slow, deviation, **look)
    dashed: dict[str, Any] = {"color": BLACK, "linestyle": "--", "linewidth": 0.9, "zorder": 2.5}
    (first,) = ax.plot(band.slow, band.lag[:, k], label="lag x₁", **dashed)
    edges = band.lower[:, k] - base, band.upper[:, k] - base
    bands = _fills(ax, band, edges)
    _limits(ax, band, edges)
    ax.set_xlabel(typeset(band.parameter))
    ax.set_ylabel(f"{typeset(name)} minus its equilibrium")
    if label and not band.known.any():
        note(ax, "no stable equilibrium is followed")
    handles = [line, first, *(b for b in bands if not str(b.get_label()).startswith("_"))]
    key = add_legend(ax, handles, own, label, legend)
    return FreezingDrawing(ax, name, line, first, bands, key)


def _fills(
    ax: Axes, found: Freezing, edges: tuple[NDArray[Any], NDArray[Any]]
) -> tuple[Artist, ...]:
    """Draw the band, whose steps belong to the worse of their ends."""
    known = np.isfinite(edges[0])
    steps = known[:-1] & known[1:] & (found.followed[:-1] == found.followed[1:])
    worse = found.doubtful[:-1] | found.doubtful[1:]
    artists: list[Artist] = []
    for flagged, (text, look) in zip((False, True), BAND_FILLS, strict=True):
        for number, (start, stop) in enumerate(runs_of(steps & (worse == flagged))):
            rows = slice(start, stop + 1)
            fill = ax.fill_between(
                found.slow[rows], edges[0][rows], edges[1][rows], linewidth=0.5, zorder=1.5, **look
            )
            fill.set_label(f"_{text}" if number else text)
            artists.append(fill)
    return tuple(artists)


def _limits(ax: Axes, found: Freezing, edges: tuple[NDArray[Any], NDArray[Any]]) -> None:
    """Fit the vertical axis to the band where freezing is valid: not to transients or folds."""
    valid = found.known & ~found.doubtful
    rows = valid if valid.any() else np.isfinite(edges[0])
    if rows.any() and ax.get_autoscaley_on():
        low = min(float(edges[0][rows].min()), 0.0)
        high = max(float(edges[1][rows].max()), 0.0)
        around = 0.5 * (AROUND - 1.0) * ((high - low) or 1.0)
        ax.set_ylim(low - around, high + around)
