"""Insets that magnify delays smaller than their markers, with the predicted delay."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from fastslow.plot.layout.marks import at_states
from fastslow.plot.layout.occupancy import occupied_pixels, overlap_cost, run_engine
from fastslow.plot.layout.style import GREEN, GREY, INTERFACE, root
from fastslow.plot.quantities import Quantity, at_points
from fastslow.results.overlay.overlay import Overlay
from fastslow.results.overlay.transitions import Transition

Array = NDArray[np.float64]

#: Size of the marker of a transition, in points: smaller delays are magnified.
MARKER_SIZE = 6.0

#: Sizes of an inset as fractions of the axes, the preferred one first, and whether its vertical
#: axis has numbers.
SIZES = (
    ((0.44, 0.42), True),
    ((0.38, 0.36), True),
    ((0.32, 0.3), True),
    ((0.3, 0.32), False),
    ((0.24, 0.28), False),
)

#: Space for the tick labels of an inset on the left, below and on the right, and around it, in
#: points.
SPACE_LEFT, SPACE_BELOW, RIGHT, SPACE_AROUND = 20.0, 11.0, 9.0, 4.0

#: Width in points below which an inset has two numbers below.
TWO_NUMBERS = 62.0

#: Font size of the tick labels of an inset.
TICKS = 6.0

#: Look of predicted delays.
LAW: dict[str, Any] = {
    "color": GREEN,
    "linewidth": 1.0,
    "linestyle": (0, (2, 1)),
    "zorder": 4.2,
    "label": "predicted delay",
}


@dataclass(frozen=True, eq=False)
class Inset:
    """An inset of an overlay.

    Parameters
    ----------
    ax : Axes
        Axes of the inset.
    laws : tuple of Line2D
        Predicted delays: the place of a jump, or the path of a gap crossing.
    """

    ax: Axes
    laws: tuple[Line2D, ...]


def hidden_delays(ax: Axes, overlay: Overlay, shown: Sequence[Quantity]) -> list[Transition]:
    """Transitions whose measured and predicted delays are smaller than their marker.

    Only over the slow quantity, in the axes as they are now.
    """
    if shown[0].column != overlay.parameter or ax.get_xscale() != "linear":
        return []
    low, high = ax.get_xlim()
    width = ax.get_window_extent().width * 72.0 / root(ax).dpi
    least = MARKER_SIZE * abs(high - low) / width
    return [
        t
        for t in overlay.transitions
        if t.law is not None
        and t.land is not None
        and not t.turned
        and np.isfinite([t.delay, t.law.delay]).all()
        and t.law.delay > 0.0
        and max(t.delay, t.law.delay) < least
    ]


def add_inset(
    ax: Axes,
    overlay: Overlay,
    shown: Sequence[Quantity],
    draw: Callable[[Axes], object],
) -> Inset | None:
    """Magnify the last delay that its marker hides, if there is one and a free position.

    Parameters
    ----------
    ax : Axes
        Axes with the overlay.
    overlay : Overlay
    shown : sequence of Quantity
        Quantities on both axes, the slow quantity first.
    draw : callable
        Draws the overlay into the axes of the inset.
    """
    run_engine(ax)
    hidden = hidden_delays(ax, overlay, shown)
    place = _free_bounds(ax) if hidden else None
    if place is None:
        return None
    bounds, numbered = place
    inset = ax.inset_axes(bounds, zorder=4.9)
    draw(inset)
    inset.set(xlabel="", ylabel="", title="")
    limits = _window(ax, overlay, shown, hidden)
    inset.set_xlim(limits[0])
    inset.set_ylim(limits[1])
    inset.tick_params(labelsize=TICKS, length=1.5, width=0.4, pad=1.0)
    inset.tick_params(axis="y", labelleft=numbered)
    narrow = inset.get_window_extent().width * 72.0 / root(ax).dpi < TWO_NUMBERS
    inset.xaxis.set_major_locator(MaxNLocator(2, prune="lower" if narrow else None))
    inset.yaxis.set_major_locator(MaxNLocator(2))
    for spine in inset.spines.values():
        spine.set(linewidth=0.5, color=GREY)
    laws: list[Line2D] = []
    for transition in hidden:
        if limits[0][0] <= transition.value <= limits[0][1]:
            laws += inset.plot(*_law(overlay, shown, transition, limits[1]), **LAW)
    (left, right), (low, high) = limits
    corners = [left, right, right, left, left], [low, low, high, high, low]
    ax.add_artist(Line2D(*corners, **{**INTERFACE, "label": "_magnified", "zorder": 4.1}))
    return Inset(inset, tuple(laws))


def _window(
    ax: Axes, overlay: Overlay, shown: Sequence[Quantity], hidden: Sequence[Transition]
) -> list[tuple[float, float]]:
    """Limits around the last hidden delay, and around those at the same value.

    The state may be the same where a branch is left and where the next one is reached.
    """
    place = _start(hidden[-1])
    here = [t for t in hidden if t.law is not None and abs(_start(t) - place) < t.law.delay]
    ends = [_start(t) + 1.6 * _sign(t) * max(t.delay, t.law.delay) for t in here if t.law]
    ends += [_start(t) - 0.6 * _sign(t) * max(t.delay, t.law.delay) for t in here if t.law]
    low, high = min(ends), max(ends)
    inside = np.concatenate([_extent(overlay, shown, t) for t in here])
    alike = float(np.ptp(ax.get_ylim()) / np.ptp(ax.get_xlim())) * (high - low)
    margin = 0.12 * max(float(np.ptp(inside)), alike)
    return [(low, high), (float(inside.min()) - margin, float(inside.max()) + margin)]


def _heights(overlay: Overlay, shown: Sequence[Quantity], t: Transition) -> Array:
    """Quantity on the vertical axis where a branch is left and where the next is reached."""
    return at_states(overlay, shown, [t.leave, t.land])[1]


def _extent(overlay: Overlay, shown: Sequence[Quantity], t: Transition) -> Array:
    """Quantity on the vertical axis at those places and at the special point."""
    assert t.law is not None
    return np.r_[_heights(overlay, shown, t), at_points([t.law.point], shown[1])[0]]


def _start(t: Transition) -> float:
    """Value of the slow quantity from which the delay is measured."""
    assert t.law is not None
    return float(t.law.point[t.law.parameter])


def _sign(t: Transition) -> float:
    """Direction of the drift through the transition."""
    assert t.law is not None
    return 1.0 if t.law.rate > 0.0 else -1.0


def _law(
    overlay: Overlay, shown: Sequence[Quantity], t: Transition, limits: tuple[float, float]
) -> tuple[Array, Array]:
    """Return the line of a predicted delay: vertical, or the path of the law."""
    law = t.law
    assert law is not None
    if law.path is None:
        return np.full(2, law.value), np.array(limits)
    first, last = _heights(overlay, shown, t)
    past, fraction = law.path
    return _start(t) + _sign(t) * past, first + fraction * (last - first)


def _free_bounds(ax: Axes) -> tuple[tuple[float, float, float, float], bool] | None:
    """Return a free position for an inset as fractions of the axes, and whether it is numbered."""
    frame, point = ax.get_window_extent(), root(ax).dpi / 72.0
    # an inset may cover interfaces, which extend across the axes; its numbers may not
    ink, everything = occupied_pixels(ax, INTERFACE["label"]), occupied_pixels(ax)
    fixed = [text for text in ax.texts if getattr(text, "xycoords", "") == "axes fraction"]
    notes = np.reshape([text.get_window_extent().extents for text in fixed], (-1, 4))
    # a legend below takes height from the axes, in which the notes are then higher
    notes[:, 1] -= 0.5 * (notes[:, 3] - notes[:, 1])
    shares = np.linspace(0.0, 1.0, 21)
    places = np.reshape(np.meshgrid(shares, shares, indexing="ij"), (2, -1)).T
    for size, numbered in SIZES:
        left = SPACE_LEFT if numbered else RIGHT
        margins = point * np.array([left + SPACE_AROUND, SPACE_BELOW + SPACE_AROUND])
        after = point * np.array([RIGHT, SPACE_AROUND])
        box = np.array(size) * (frame.width, frame.height)
        room = np.array([frame.width, frame.height]) - box - margins - after
        if (room < 0.0).any():
            continue
        starts = frame.min + places * room
        boxes = np.hstack([starts, starts + box + margins + after])
        below, beside = boxes.copy(), boxes.copy()
        below[:, 3], beside[:, 2] = starts[:, 1] + margins[1], starts[:, 0] + margins[0]
        none, edge = np.empty((0, 4)), frame.padded(1.0)
        cost = overlap_cost(boxes, ink, notes, edge)
        cost += overlap_cost(below, everything, none, edge)
        if numbered:
            cost += overlap_cost(beside, everything, none, edge)
        if cost.min() == 0.0:
            # of the free positions the one farthest into a corner
            free = np.flatnonzero(cost == 0.0)
            depth = np.abs(places[free] - 0.5).sum(axis=1)
            corner = starts[free[int(np.argmax(depth))]] + margins - frame.min
            x, y = (corner / (frame.width, frame.height)).tolist()
            return (x, y, *size), numbered
    return None
