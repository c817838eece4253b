"""Legends that fit: one of them, in as many columns as have room."""

import pytest
from matplotlib.figure import Figure
from matplotlib.legend import Legend
from matplotlib.lines import Line2D

from fastslow.plot.layout.legends import legend_below, legend_inside


def handles(count, words):
    return [Line2D([], [], label=f"{words} {k}") for k in range(count)]


@pytest.mark.parametrize(
    ("count", "words", "columns"),
    [(1, "a", 1), (4, "a", 4), (6, "a", 6), (3, "w" * 40, 1)],
)
def test_one_legend_below_in_as_many_columns_as_have_room(count, words, columns):
    figure = Figure(figsize=(5, 3), dpi=100)
    legend = legend_below(figure.add_subplot(), handles(count, words))
    assert figure.legends == [legend]
    assert len(legend.get_texts()) == count
    assert legend.get_window_extent().width <= 0.98 * 500
    assert legend._ncols == columns


def test_one_legend_inside_where_it_covers_nothing():
    ax = Figure(figsize=(4, 3), dpi=100).add_subplot()
    (line,) = ax.plot([0, 1, 2], [0, 0, 3], label="curve")
    legend = legend_inside(ax, [line])
    assert [a for a in ax.get_children() if isinstance(a, Legend)] == [legend]
    box = legend.get_window_extent()
    for at in ((0.5, 0), (1, 0), (1.5, 1.5), (2, 3)):
        assert not box.contains(*ax.transData.transform(at))
