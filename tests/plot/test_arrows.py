"""Heads along a curve: where they are, and which way they point."""

import numpy as np
import pytest
from matplotlib.figure import Figure

from fastslow.plot.layout.arrows import draw_arrows, draw_heads, length_along


@pytest.mark.parametrize("turn", [0.0, 0.7, 2.5, -1.2])
def test_heads_point_along_the_curve(turn):
    """On a straight line, at a fraction of its length, in the direction of growing rows."""
    ax = Figure().add_subplot()
    ax.set(xlim=(-2, 2), ylim=(-2, 2))
    way = np.array([np.cos(turn), np.sin(turn)])
    (line,) = ax.plot(*(np.linspace(-1, 1, 201)[:, None] * way).T)
    heads = draw_arrows(line, length_along(line), (0.25, 0.5))
    assert len(heads) == 2
    for head, place in zip(heads, (-0.5, 0.0), strict=True):
        start, tip = np.array(head.xyann), np.array(head.xy)
        np.testing.assert_allclose(start, place * way, atol=0.02)
        # three points of 1/72 inch, and no more than a row beyond
        pixels = np.hypot(*np.diff(ax.transData.transform([start, tip]), axis=0)[0])
        assert 3 / 72 * ax.figure.dpi <= pixels < 3 / 72 * ax.figure.dpi + 4
        assert (tip - start) @ way == pytest.approx(np.hypot(*(tip - start)), rel=1e-9)


def test_no_heads_without_a_direction():
    ax = Figure().add_subplot()
    (still,) = ax.plot([1, 1, 1], [2, 2, 2])
    assert draw_arrows(still, length_along(still), (0.5,)) == ()
    (line,) = ax.plot([0, 1], [0, 1])
    ax.set(xlim=(2, 3), ylim=(2, 3))
    assert draw_heads(line, [0]) == ()
    (point,) = ax.plot([0], [0])
    assert draw_heads(point, [0]) == ()


def test_length_is_counted_in_pixels_and_not_across_gaps():
    ax = Figure().add_subplot()
    ax.set(xlim=(0, 10), ylim=(0, 10))
    (line,) = ax.plot([0, 1, np.nan, 4, 6], [0, 0, np.nan, 0, 0])
    one = np.diff(ax.transData.transform([(0, 0), (1, 0)]), axis=0)[0, 0]
    np.testing.assert_allclose(length_along(line) / one, [0, 1, 1, 1, 3], atol=1e-9)


def test_heads_are_drawn_before_the_axes_know_their_limits():
    """A curve that was just drawn lies inside of the axes, though no limit has been set."""
    ax = Figure().add_subplot()
    (line,) = ax.plot(np.linspace(100, 300, 201), np.linspace(-7, -5, 201))
    assert len(draw_heads(line, [50, 100])) == 2
