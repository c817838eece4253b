"""Figures of several axes."""

import pytest

import fastslow as fs

MM = 1 / 25.4


def test_axes_are_those_of_the_layout():
    above, left, right = fs.plot.axes("aa;bc", width="column")
    figure = above.figure
    assert left.figure is right.figure is figure
    assert figure.get_size_inches() == pytest.approx([85 * MM, 85 * MM * 0.75], rel=1e-12)
    figure.draw_without_rendering()
    assert above.get_position().y0 > left.get_position().y1
    assert above.get_position().width > 1.5 * left.get_position().width
    assert right.get_position().x0 > left.get_position().x1
    assert [ax.get_title(loc="left") for ax in (above, left, right)] == ["(a)", "(b)", "(c)"]
    assert above.xaxis.label.get_fontsize() == 8.0


def test_letters_may_be_left_out():
    (ax,) = fs.plot.axes("a", width=100, height=50, label=False)
    assert ax.get_title(loc="left") == ""
    assert ax.figure.get_size_inches() == pytest.approx([100 * MM, 50 * MM], rel=1e-12)


def test_letters_are_in_order_whatever_their_case():
    axes = fs.plot.axes("Ba", width=100, height=50)
    assert [ax.get_title(loc="left") for ax in axes] == ["(a)", "(B)"]
