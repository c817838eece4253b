"""Measured and predicted delays over the rate of drift."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.legend import Legend
from matplotlib.lines import Line2D
from matplotlib.text import Text
from numpy.typing import NDArray

from fastslow.arguments import flag, instance, validated
from fastslow.errors import ArgumentError
from fastslow.plot.arguments import figure_width, line_style
from fastslow.plot.drawings import Drawing
from fastslow.plot.layout.legends import add_legend
from fastslow.plot.layout.occupancy import run_layout
from fastslow.plot.layout.style import BLUE, GREY, SMALL_TEXT, VERMILION, axes_for
from fastslow.plot.layout.typesetting import typeset
from fastslow.results.overlay.delay_scaling import DelayScaling

Array = NDArray[np.float64]

#: Exponents written as fractions.
FRACTIONS = {2.0 / 3.0: "2/3", 0.5: "1/2", 1.0: "1"}

#: Width of the slope triangle and its distance below the points, as fractions of the range;
#: distance of its text, in points.
TRIANGLE_WIDTH, TRIANGLE_BELOW, TEXT_OFF = 0.26, 0.10, 3.0


@dataclass(frozen=True, eq=False, repr=False)
class DelayDrawing(Drawing):
    """Drawn delays.

    Parameters
    ----------
    ax : Axes
    measured : Line2D
    predicted : Line2D
        The predicted delay at the same rates.
    leading : Line2D or None
        Leading term of the prediction.
    triangle : Line2D or None
        Slope of the leading term; None where that is not a power of the rate.
    texts : tuple of Text
        Texts of the triangle.
    legend : Legend or None
    """

    measured: Line2D
    predicted: Line2D
    leading: Line2D | None
    triangle: Line2D | None
    texts: tuple[Text, ...]
    legend: Legend | None


@validated(
    scaling=instance(DelayScaling),
    ax=instance(Axes),
    width=figure_width,
    label=flag,
    legend=flag,
    style=line_style,
)
def delay_scaling(
    scaling: DelayScaling,
    *,
    ax: Axes | None = None,
    width: str | float = "column",
    label: bool = True,
    legend: bool | None = None,
    **style: Any,
) -> DelayDrawing:
    """Draw measured and predicted delays over the rate of drift, on logarithmic axes.

    Parameters
    ----------
    scaling : DelayScaling
    ax : Axes, optional
        Axes to draw into; new ones otherwise.
    width : str or float
        Width of a new figure: ``"column"`` (85 mm), ``"page"`` (170 mm), or millimetres.
    label : bool
        Whether to write the slope beside its triangle.
    legend : bool, optional
        Whether to draw a legend, with the fitted exponent; by default as ``label``.
    **style
        Properties of the measured points.

    Returns
    -------
    DelayDrawing

    Raises
    ------
    ArgumentError
        If no run has a delay.

    See Also
    --------
    fastslow.delay_scaling
    """
    good = np.isfinite(scaling.delay) & (scaling.delay > 0)
    if not good.any():
        raise ArgumentError("no run of this scaling has a delay to draw; see scaling.outcomes")
    own = ax is None
    ax = axes_for(ax, width, height=66.0)
    ax.set_xscale("log")
    ax.set_yscale("log")
    eps = scaling.eps
    words = "measured"
    if math.isfinite(scaling.exponent):
        power = rf"$\varepsilon^{{{scaling.exponent:.3f}\pm{scaling.uncertainty:.3f}}}$"
        words += f", {power}" if not scaling.offset else f", less {scaling.offset:.3g} ε: {power}"
    leading = _leading(ax, scaling)
    (predicted,) = ax.plot(
        eps, scaling.predicted, color=VERMILION, linewidth=1.2, label=_law_words(scaling)
    )
    look: dict[str, Any] = {
        "linestyle": "none",
        "marker": "o",
        "markersize": 4.0,
        "color": BLUE,
        "markerfacecolor": "none",
        "markeredgewidth": 0.9,
        "label": words,
        "zorder": 4,
    }
    (measured,) = ax.plot(eps[good], scaling.delay[good], **{**look, **style})
    ax.set_xlabel(rf"rate of drift $\varepsilon$ of {typeset(scaling.parameter)}")
    ax.set_ylabel(f"delay past {scaling.point.label} in {typeset(scaling.parameter)}")
    triangle, texts = _triangle(ax, scaling, good, label)
    drawn = [measured, predicted, *([leading] if leading else [])]
    shown = add_legend(ax, drawn, own, label, legend)
    return DelayDrawing(ax, measured, predicted, leading, triangle, texts, shown)


def _law_words(scaling: DelayScaling) -> str:
    if math.isfinite(scaling.law_exponent):
        return "predicted"
    return r"predicted, $\varepsilon\,\ln(1/\varepsilon)$"


def _leading(ax: Axes, scaling: DelayScaling) -> Line2D | None:
    """Draw the leading term of the prediction, if there are further terms."""
    first = float(scaling.predicted_coefficients[0])
    if not (math.isfinite(scaling.law_exponent) and len(scaling.terms) > 1):
        return None
    (line,) = ax.plot(
        scaling.eps,
        first * scaling.eps**scaling.law_exponent,
        color=GREY,
        linewidth=0.9,
        linestyle=(0, (3.5, 1.8)),
        label=rf"leading term, ${first:.4g}\,\varepsilon^{{{_written(scaling)}}}$",
    )
    return line


def _written(scaling: DelayScaling) -> str:
    return FRACTIONS.get(scaling.law_exponent, f"{scaling.law_exponent:.3g}")


def _triangle(
    ax: Axes, scaling: DelayScaling, good: NDArray[np.bool_], label: bool
) -> tuple[Line2D | None, tuple[Text, ...]]:
    """Draw a triangle with the slope of the leading term below the points."""
    power = scaling.law_exponent
    if not math.isfinite(power) or good.sum() < 2:
        return None, ()
    x, y = np.log10(scaling.eps[good]), np.log10(scaling.delay[good])
    width = TRIANGLE_WIDTH * float(np.ptp(x))
    left = float(x.min()) + 0.5 * float(np.ptp(x))
    right = left + width
    run_layout(ax)
    low, high = np.log10(ax.get_ylim())
    order = np.argsort(x)
    base = float(np.interp(left, x[order], y[order])) - TRIANGLE_BELOW * (high - low)
    corners = np.array([[left, base], [right, base], [right, base + power * width], [left, base]])
    (line,) = ax.plot(*10.0**corners.T, color=GREY, linewidth=0.8)
    if not label:
        return line, ()
    texts = [
        ax.annotate(
            words,
            tuple(10.0 ** np.array(at)),
            xytext=off,
            textcoords="offset points",
            ha=ha,
            va=va,
            fontsize=SMALL_TEXT,
        )
        for words, at, off, ha, va in (
            ("1", (0.5 * (left + right), base), (0.0, -TEXT_OFF), "center", "top"),
            (
                _written(scaling),
                (right, base + 0.5 * power * width),
                (TEXT_OFF, 0.0),
                "left",
                "center",
            ),
        )
    ]
    return line, tuple(texts)
