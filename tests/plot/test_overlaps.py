"""Overlaps of texts with what is drawn, against boxes known by construction."""

import numpy as np
import pytest
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.text import Text

from fastslow.plot.layout.collisions import overlaps
from fastslow.plot.layout.style import save


@pytest.fixture
def ax():
    """Axes of 300 by 200 points, without ticks, in a figure without a layout."""
    ax = Figure((300 / 72, 200 / 72), dpi=144).add_axes((0, 0, 1, 1))
    ax.set(xlim=(0, 300), ylim=(0, 200), xticks=[], yticks=[])
    return ax


def box(text):
    """Box in points."""
    return np.array(Text.get_window_extent(text).extents) / 2


def test_length_of_curves_and_depth_of_markers(ax):
    text = ax.text(150, 100, "label", ha="center", va="center")
    ax.figure.draw_without_rendering()
    x0, y0, x1, y1 = box(text)
    ax.plot([0, 300], [100, 100], linewidth=0.0, label="through")
    ax.plot([0, 300], [y1 + 1, y1 + 1], linewidth=1.0, label="above")
    ax.plot([0, 300], [y0 - 1, y0 - 1], linewidth=4.0, label="below")
    ax.plot([x0 - 2], [100], "o", markersize=8, label="left")
    ax.plot([x1 + 5], [100], "o", markersize=8, label="right")
    ax.add_collection(LineCollection([[(x0 + 1, 0), (x0 + 1, 100)]], linewidth=0, label="half"))
    found = {one.over: one.size for one in overlaps(ax.figure)}
    expected = {
        "curve through": x1 - x0,
        # the caps of a wide line reach beyond the box
        "curve below": x1 - x0 + 4,
        "marker left": 2.0,
        "curve half": 100 - y0,
    }
    assert found == pytest.approx(expected, abs=1e-6)


def test_texts_legends_edges_and_other_axes(ax):
    figure = ax.figure
    ax.text(150, 100, "one", ha="center", va="center")
    ax.text(150, 100, "other", ha="center", va="center")
    ax.text(330, 20, "cut")
    ax.text(20, 20, "clipped away", clip_on=True, transform=ax.transAxes)
    ax.text(20, 20, "hidden", visible=False)
    ax.set_position((0, 0, 0.8, 1))
    other = figure.add_axes((0.9, 0.0, 0.1, 1.0))
    other.set(yticks=[0.5], yticklabels=["a long label of a tick"], xticks=[])
    ax.plot([5, 295], [190, 190], label="top")
    legend = ax.legend(loc="upper left")
    legend.set_in_layout(False)
    names = {(one.text, one.over) for one in overlaps(figure)}
    assert names == {
        ("other", "text one"),
        ("cut", "axes"),
        ("a long label of a tick", "axes"),
        ("legend (top …)", "curve top"),
    }
    ax.texts[2].set_x(370)
    assert ("cut", "edge") in {(one.text, one.over) for one in overlaps(figure)}


def test_an_inset_is_not_other_axes(ax):
    inset = ax.inset_axes((0.5, 0.5, 0.3, 0.3))
    inset.set(xticks=[], yticks=[])
    inset.text(0.5, 0.5, "inside", ha="center")
    assert overlaps(ax.figure) == ()


def test_a_figure_that_was_just_drawn_is_measured_as_it_is(tmp_path):
    figure = Figure((4, 3), dpi=100, layout="constrained")
    for ax in figure.subplots(2, 2).flat:
        ax.plot([0, 1], [0, 1], label="diagonal")
        ax.text(0.5, 0.5, "middle")
        ax.text(0.5, 0.5, "other")
    save(figure, tmp_path / "a.png", figure.dpi)
    found = {
        (one.text, one.over, k): one.size for k, one in enumerate(overlaps(figure, drawn=True))
    }
    assert len(found) == 12
    # a second layout moves the axes by a hundredth of a point
    again = {(one.text, one.over, k): one.size for k, one in enumerate(overlaps(figure))}
    assert found == pytest.approx(again, rel=1e-3)
