"""Maps of tracking and tipping with the computed boundary over them."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes

from fastslow.arguments import flag, instance, validated
from fastslow.errors import ArgumentError
from fastslow.plot.arguments import figure_width, line_style
from fastslow.plot.maps import MapDrawing, regime_map
from fastslow.results.maps.adaptive_map import RefinedMap
from fastslow.results.threshold_curves import ThresholdCurve

#: Colours of the areas; they differ in lightness too.
OUTCOMES = {"track": "#FFFFFF", "return": "#BFDDF0", "tip": "#F6D5A8"}


@validated(
    result=instance(RefinedMap),
    boundary=instance(ThresholdCurve),
    ax=instance(Axes),
    width=figure_width,
    label=flag,
    legend=flag,
    style=line_style,
)
def tipping_map(
    result: RefinedMap,
    boundary: ThresholdCurve | None = None,
    *,
    ax: Axes | None = None,
    width: str | float = "column",
    label: bool = True,
    legend: bool | None = None,
    **style: Any,
) -> MapDrawing:
    """Draw where a shift is tracked and where it tips, with the computed boundary.

    Parameters
    ----------
    result : RefinedMap
        From `fastslow.tipping_map`, or any other map.
    boundary : ThresholdCurve, optional
        Critical rates over the other parameter, from `continue_points`, drawn dashed over the map
        as ``"critical rate"``.
    ax : Axes, optional
        Axes to draw into, in which limits set by hand are kept; new ones otherwise.
    width : str or float
        Width of a new figure: ``"column"`` (85 mm), ``"page"`` (170 mm), or millimetres.
    label : bool
        Whether to name the areas.
    legend : bool, optional
        Whether to draw a legend; by default as ``label``.
    **style
        Properties of the boundary lines of the map.

    Returns
    -------
    MapDrawing

    Raises
    ------
    ArgumentError
        For a curve in other parameters than those of the map.

    See Also
    --------
    fastslow.tipping_map, fastslow.plot.regime_map

    Examples
    --------
    >>> import fastslow as fs
    >>> coarse = fs.Refinement(cells=(2, 2), levels=1)
    >>> plane = fs.refined_map(
    ...     lambda r, D: np.where(r * D > 4, "tip", "track"),
    ...     {"r": (1, 3), "D": (1, 3)},
    ...     refinement=coarse,
    ... )
    >>> sorted(fs.plot.tipping_map(plane).fills)
    ['tip', 'track']
    """
    curves: dict[str, tuple[Any, Any]] = {}
    if boundary is not None:
        names = boundary.parameter_names
        if set(names) != set(result.names):
            raise ArgumentError(
                f"boundary: a curve in {', '.join(names)}; the map is over "
                f"{', '.join(result.names)}"
            )
        x, y = (np.asarray(boundary[name]) for name in result.names)
        curves["critical rate"] = x, y
    fills = {word: OUTCOMES[str(word)] for word in result.labels if str(word) in OUTCOMES}
    return regime_map(
        result,
        ax=ax,
        width=width,
        label=label,
        legend=legend,
        curves=curves,
        fills=fills,
        **style,
    )
