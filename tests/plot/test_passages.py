"""The overlay and the panel as drawn."""

import numpy as np
import pytest
import sympy as sp
from matplotlib.figure import Figure

import fastslow as fs

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def gear_figure(gear_overlay):
    return fs.plot.overlay(gear_overlay)


@pytest.fixture(scope="module")
def folded_figure(folded_overlay):
    return fs.plot.overlay(folded_overlay)


def test_overlay_is_drawn_above_the_branches(gear_overlay):
    ax = Figure().add_subplot()
    drawn = fs.plot.overlay(gear_overlay, ax=ax)
    assert drawn.ax is ax
    branches = max(line.get_zorder() for line in drawn.diagram.lines)
    assert all(line.get_zorder() > branches for line in drawn.lines)
    assert drawn.arrows
    assert len(drawn.crossings.get_xdata()) == len(gear_overlay.run.crossings)


def test_a_jump_is_told_apart_from_a_passage_of_the_gap(gear_figure, folded_figure, folded_overlay):
    (passage,) = gear_figure.transitions
    (jump,) = folded_figure.transitions
    assert passage.get_label() == "gap crossing"
    assert jump.get_label() == "jump at a fold"
    assert passage.get_marker() != jump.get_marker()
    assert len(jump.get_xdata()) == len(folded_overlay.transitions)


def test_crossings_lie_on_the_trajectory(gear_overlay, gear_figure):
    drawn = gear_figure
    times = np.array([c.time for c in gear_overlay.run.crossings])
    load = 2.372 + 3.546 * np.sin(0.01 * times)
    assert np.abs(drawn.crossings.get_xdata() - load).max() < 1e-3


def test_each_thing_once_in_the_legend(folded_figure):
    drawn = folded_figure
    texts = [t.get_text() for t in drawn.legend.get_texts()]
    assert len(texts) == len(set(texts))
    assert {"stable", "unstable", "trajectory", "jump at a fold"} <= set(texts)
    # in one column the labels LP1 and LP2 in the axes take the place of an entry
    assert {"LP1", "LP2"} <= {t.get_text() for t in drawn.ax.texts if t.get_visible()}
    assert "LP fold" in {h.get_label() for h in drawn.handles}


def test_another_state(gear_overlay):
    drawn = fs.plot.overlay(gear_overlay, "v", legend=False)
    assert (drawn.y, drawn.legend) == ("v", None)
    with pytest.raises(fs.UnknownNameError, match="unknown state or parameter 'u'"):
        fs.plot.overlay(gear_overlay, "u")


def test_the_legend_of_a_column_wide_figure_fits(folded_figure):
    drawn = folded_figure
    drawn.figure.draw_without_rendering()
    box, page = drawn.legend.get_window_extent(), drawn.figure.bbox
    assert page.x0 <= box.x0
    assert box.x1 <= page.x1


def test_panel(gear_overlay):
    drawn = fs.plot.panel(gear_overlay, title="$D = 0.25$")
    assert len(drawn.figure.axes) == 3
    assert drawn.figure.get_size_inches()[0] == pytest.approx(170 / 25.4)
    assert drawn.time_series.y == drawn.overlay.y == "x"
    assert [ax.get_title(loc="left") for ax in drawn.figure.axes] == ["(a)", "(b)", "(c)"]
    drawn.figure.draw_without_rendering()
    box, page = drawn.legend.get_window_extent(), drawn.figure.bbox
    assert page.x0 <= box.x0
    assert box.x1 <= page.x1
    frame = drawn.overlay.ax.get_window_extent()
    for label in drawn.overlay.diagram.labels:
        inside = label.get_window_extent()
        assert frame.x0 < inside.x0
        assert inside.x1 < frame.x1


def test_an_expression_on_the_vertical_axis(folded_overlay):
    drawn = fs.plot.overlay(folded_overlay, "x**2 + v")
    assert drawn.y == "x**2 + v"
    assert drawn.ax.get_ylabel() == "$x^{2} + v$"
    for line, branch in zip(drawn.diagram.lines[:1], folded_overlay.diagram.branches, strict=False):
        height = branch["x"] ** 2 + branch["v"]
        assert np.isin(line.get_ydata(), height).all()
    (fold,) = [m for m in drawn.diagram.markers if m.get_label().startswith("LP")]
    points = folded_overlay.diagram.folds
    assert fold.get_ydata() == pytest.approx([p["x"] ** 2 + p["v"] for p in points], abs=1e-14)
    states = np.array([c.state for c in folded_overlay.run.crossings])
    expected = states[:, 0] ** 2 + states[:, 1]
    assert drawn.crossings.get_ydata() == pytest.approx(expected, abs=1e-14)
    assert not drawn.diagram.bands.lines
    with pytest.raises(fs.UnknownNameError, match="unknown name in an expression 'y'"):
        fs.plot.overlay(folded_overlay, "x + y")
    with pytest.raises(fs.UnknownNameError, match="unknown state or parameter 'A'"):
        fs.plot.overlay(folded_overlay, "A")


def test_turning_points_are_marked(gear_overlay, gear_figure):
    drawn = gear_figure
    assert drawn.turning.get_xdata() == pytest.approx([5.918, -1.174] * 2, abs=1e-3)
    assert drawn.turning.get_label() == "turning point of $w$"
    assert fs.plot.overlay(gear_overlay, turning=False).turning is None


def test_a_head_in_every_jump_of_the_last_period(folded_figure):
    tips = np.array([a.xy for a in folded_figure.arrows])
    # a head in the gap, halfway between the branches, both ways
    assert (np.abs(tips[:, 1]) < 0.3).sum() == 2


def test_in_space(folded_overlay):
    drawn = fs.plot.overlay(folded_overlay, "x", "v")
    slow, x, v = drawn.line.get_data_3d()
    assert np.array_equal(slow, folded_overlay.slow)
    assert np.array_equal(np.column_stack([x, v]), folded_overlay.state)
    assert {line.get_label() for line in drawn.branches} == {"stable", "unstable", "neutral"}
    axes = Figure().add_subplot(projection="3d")
    given = fs.plot.overlay(folded_overlay, ax=axes)
    assert (given.ax, given.x, given.y) == (axes, "x", "v")
    with pytest.raises(fs.ArgumentError, match='needs axes with projection="3d"'):
        fs.plot.overlay(folded_overlay, "x", "v", ax=Figure().add_subplot())


def test_the_phases_stand_above_the_time_series(folded_overlay):
    drawn = fs.plot.panel(folded_overlay)
    strip = drawn.time_series.phases
    assert [box.get_x() for box in strip] == [p.start for p in folded_overlay.phases]
    drawn.figure.draw_without_rendering()
    top = drawn.time_series.ax.transAxes.transform((0, 1))[1]
    for box in strip:
        edge = box.get_window_extent()
        assert edge.y1 == pytest.approx(top, abs=1)
        inked = drawn.time_series.lines[0].get_window_extent()
        assert inked.y1 < edge.y0 + 1
    written = [w.get_text() for w in drawn.time_series.words if w.get_visible() and w.get_text()]
    assert written == ["on S1", "on S3", "on S1", "on S3"]
    texts = [t.get_text() for t in drawn.legend.get_texts()]
    assert {"quasi-static phase", "jump phase"} <= set(texts)


def test_a_panel_of_a_columns_width(folded_overlay):
    drawn = fs.plot.panel(folded_overlay, width="column")
    drawn.figure.draw_without_rendering()
    frames = [ax.get_window_extent() for ax in drawn.figure.axes]
    assert len({round(f.x0) for f in frames}) == 1
    assert frames[0].y0 > frames[1].y1
    box, page = drawn.legend.get_window_extent(), drawn.figure.bbox
    assert page.x0 <= box.x0
    assert box.x1 <= page.x1


def test_a_panel_shows_a_state(gear_overlay):
    with pytest.raises(fs.UnknownNameError, match="unknown state 'w'"):
        fs.plot.panel(gear_overlay, "w")


def test_what_an_overlay_does_not_tell_is_in_its_figure():
    x, w, t = sp.symbols("x w t")
    model = fs.Model({x: w - x}, forcing={w: sp.sin(t / 100)})
    run = fs.simulate(model, [0.0], t=(0, 628))

    def words(over, trajectory):
        diagram = fs.continue_equilibria(model.frozen(), "w", over=over)
        ax = fs.plot.overlay(fs.overlay(diagram, trajectory)).ax
        return [" ".join(text.get_text().split()) for text in ax.texts]

    assert "the trajectory leaves the range of the diagram" in words((-0.5, 0.5), run)
    assert "the trajectory leaves the range of the diagram" not in words((-1.1, 1.1), run)
    short = fs.simulate(model, [0.0], t=(0, 628), integration=fs.Integration(max_steps=5))
    assert any(word.startswith("run ended early") for word in words((-1.1, 1.1), short))


def test_a_jump_is_marked_where_the_branch_is_left(folded_overlay, folded_figure):
    (jumps,) = folded_figure.transitions
    leaving = [t.leave.value for t in folded_overlay.transitions]
    assert jumps.get_xdata().tolist() == leaving
    fold = abs(folded_overlay.diagram.folds[0]["w"])
    # beyond the fold, before two thirds of the jump
    for t, w in zip(folded_overlay.transitions, leaving, strict=True):
        assert fold < abs(w) < abs(t.value)


def test_axes_are_not_scaled_to_a_blow_up():
    x, w, t = sp.symbols("x w t")
    model = fs.Model({x: x**2 + w}, forcing={w: t / 100 - 1})
    diagram = fs.continue_equilibria(model.frozen(), "w", over=(-2, 1))
    run = fs.simulate(model, [-1], t=(0, 600))
    assert run["x"].max() > 1e9
    panel = fs.plot.panel(fs.overlay(diagram, run))
    for drawn in (panel.time_series, panel.phase_portrait, panel.overlay):
        low, high = drawn.ax.get_ylim()
        assert -3 < low < -1 < 0.5 < high < 3
        assert drawn.ax.get_xlim()[0] > -3
    # below the strip of phases
    (note,) = panel.time_series.ax.texts[-1:]
    assert note.get_text().split() == ["run", "ended", "early:", "blow-up"]
    assert note.xy[1] < 0.95
