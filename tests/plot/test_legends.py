"""Legends that fit: one of them, in as many columns as have room."""

import pytest
from matplotlib.figure import Figure
from matplotlib.legend import Legend
from matplotlib.lines import Line2D

from fastslow.plot.layout.labels import tag
from fastslow.plot.layout.legends import legend_below, legend_inside
from fastslow.plot.layout.style import new_figure


def handles(count, words):
    return [Line2D([], [], label=f"{words} {k}") for k in range(count)]


@pytest.mark.sample(2)
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


@pytest.mark.parametrize("count", [4, 9])
def test_a_legend_of_one_column_takes_little_of_the_height(count):
    figure = Figure(figsize=(85 / 25.4, 78 / 25.4), dpi=150, layout="constrained")
    ax = figure.add_subplot()
    tag(ax, "LP1", (0.5, 0.5))
    names = ["LP fold", "stable", "unstable", "earlier periods", "turning point of w", "BP branch"]
    entries = [Line2D([], [], label=(names * 2)[k] + " " * (k // 6)) for k in range(count)]
    legend = legend_below(ax, entries)
    figure.draw_without_rendering()
    assert legend.get_window_extent().height <= 0.15 * figure.bbox.height
    assert legend.get_window_extent().width <= figure.bbox.width
    shown = [text.get_text() for text in legend.get_texts()]
    # named at its point, it may be left out; what is named nowhere else may not
    assert {"stable", "unstable", "earlier periods"} <= {word.strip() for word in shown} | {
        names[k] for k in range(count, 6)
    }
    assert min(text.get_fontsize() for text in legend.get_texts()) >= 6.0


def test_axes_of_a_figure_share_one_legend_instead_of_covering_data():
    figure = new_figure(6.0, 3.0)
    first, second = figure.subplots(1, 2)
    for ax, words in ((first, "abcdefgh"), (second, "cdefghij")):
        for k in range(20):
            ax.plot([0, 1, 0.2], [k / 20, (k + 7) % 20 / 20, 0.5], color="k")
        legend = legend_inside(ax, [Line2D([], [], label=f"entry {word}") for word in words])
    assert figure.legends == [legend]
    assert [text.get_text()[-1] for text in legend.get_texts()] == list("abcdefghij")
    assert first.get_ylim()[1] < 1.1
