"""The overlay and the panel as drawn."""

import numpy as np
import pytest
from matplotlib.figure import Figure

import fastslow as fs


def test_overlay_is_drawn_above_the_branches(gear_lay):
    ax = Figure().add_subplot()
    drawn = fs.plot.overlay(gear_lay, ax=ax)
    assert drawn.ax is ax
    branches = max(line.get_zorder() for line in drawn.diagram.lines)
    assert all(line.get_zorder() > branches for line in drawn.lines)
    assert drawn.arrows
    assert len(drawn.crossings.get_xdata()) == len(gear_lay.run.crossings)


def test_a_jump_is_told_apart_from_a_passage_of_the_gap(gear_lay, folded_lay):
    (passage,) = fs.plot.overlay(gear_lay).transitions
    (jump,) = fs.plot.overlay(folded_lay).transitions
    assert passage.get_label() == "transit of the gap"
    assert jump.get_label() == "jump at a fold"
    assert passage.get_marker() != jump.get_marker()
    assert len(jump.get_xdata()) == len(folded_lay.transitions)


def test_crossings_lie_on_the_trajectory(gear_lay):
    drawn = fs.plot.overlay(gear_lay)
    times = np.array([c.time for c in gear_lay.run.crossings])
    load = 2.372 + 3.546 * np.sin(0.01 * times)
    assert np.abs(drawn.crossings.get_xdata() - load).max() < 1e-3


def test_each_thing_once_in_the_legend(folded_lay):
    texts = [t.get_text() for t in fs.plot.overlay(folded_lay).legend.get_texts()]
    assert len(texts) == len(set(texts))
    assert {"stable", "unstable", "LP fold", "trajectory", "jump at a fold"} <= set(texts)


def test_another_state(gear_lay):
    drawn = fs.plot.overlay(gear_lay, "v", legend=False)
    assert (drawn.state, drawn.legend) == ("v", None)
    with pytest.raises(fs.UnknownNameError, match="unknown state 'w'"):
        fs.plot.overlay(gear_lay, "w")


def test_the_legend_of_a_column_wide_figure_fits(folded_lay):
    drawn = fs.plot.overlay(folded_lay)
    drawn.figure.draw_without_rendering()
    box, page = drawn.legend.get_window_extent(), drawn.figure.bbox
    assert page.x0 <= box.x0
    assert box.x1 <= page.x1


def test_panel(gear_lay, tmp_path):
    drawn = fs.plot.panel(gear_lay, title="$D = 0.25$")
    assert len(drawn.figure.axes) == 3
    assert drawn.figure.get_size_inches()[0] == pytest.approx(170 / 25.4)
    assert drawn.time_series.y == drawn.overlay.state == "x"
    assert [ax.get_title(loc="left") for ax in drawn.figure.axes] == ["(a)", "(b)", "(c)"]
    assert drawn.save(tmp_path / "panel.pdf").stat().st_size > 10_000
    drawn.figure.draw_without_rendering()
    box, page = drawn.legend.get_window_extent(), drawn.figure.bbox
    assert page.x0 <= box.x0
    assert box.x1 <= page.x1
    frame = drawn.overlay.ax.get_window_extent()
    for label in drawn.overlay.diagram.labels:
        inside = label.get_window_extent()
        assert frame.x0 < inside.x0
        assert inside.x1 < frame.x1
