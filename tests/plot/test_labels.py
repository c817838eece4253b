"""Labels, legends and the names of regions find their places, and find them again."""

import dataclasses
from io import BytesIO

import numpy as np
import pytest
from matplotlib.figure import Figure
from matplotlib.text import Text
from matplotlib.transforms import Bbox

import fastslow as fs
from fastslow.plot.layout.bands import draw_bands
from fastslow.plot.layout.labels import place, tag
from fastslow.plot.layout.occupancy import overlap_cost

from .cases import crowd, swept
from .conftest import cubic, diagram_of

pytestmark = pytest.mark.slow


def clear(drawn, texts=None):
    """Whether visible labels are apart, within the axes, off the markers; how much they cover."""
    drawn.figure.draw_without_rendering()
    ax = drawn.ax
    shown = [t for t in (drawn.labels if texts is None else texts) if t.get_visible()]
    boxes = [Text.get_window_extent(t) for t in shown]
    frame = ax.get_window_extent()
    for k, box in enumerate(boxes):
        assert frame.x0 < box.x0 < box.x1 < frame.x1
        assert frame.y0 < box.y0 < box.y1 < frame.y1
        assert not any(box.overlaps(other) for other in boxes[:k])
    inked = 0
    for line in drawn.lines:
        x, y = ax.transData.transform(line.get_xydata()).T
        fine = np.linspace(0, len(x) - 1, 20 * len(x))
        x, y = (np.interp(fine, np.arange(len(x)), c) for c in (x, y))
        for box in boxes:
            inked += ((box.x0 < x) & (x < box.x1) & (box.y0 < y) & (y < box.y1)).any()
    for marker in drawn.markers:
        for at in ax.transData.transform(marker.get_xydata()):
            assert not any(box.contains(*at) for box in boxes)
    return shown, inked


def test_a_crowd_of_folds():
    drawn = fs.plot.diagram(crowd())
    shown, inked = clear(drawn)
    assert [t.get_text() for t in shown] == [f"LP{k}" for k in range(1, 17)]
    assert inked == 0


@pytest.mark.sample(1)
@pytest.mark.parametrize("dpi", [300, 600])
def test_a_figure_saved_at_another_resolution_has_its_labels_where_they_were(dpi):
    drawn = fs.plot.diagram(crowd())
    drawn.figure.draw_without_rendering()
    before = [t.get_position() for t in drawn.labels]
    drawn.figure.savefig(BytesIO(), dpi=dpi)
    np.testing.assert_allclose([t.get_position() for t in drawn.labels], before, atol=0.5)


def test_the_limits_are_changed_by_hand():
    drawn = fs.plot.diagram(crowd())
    before = [t.get_position() for t in drawn.labels]
    drawn.ax.set_xlim(-1.7, 0.7)
    drawn.ax.set_ylim(-1.5, 1.2)
    shown, inked = clear(drawn)
    inside = [
        t.get_text() for t in drawn.labels if -1.7 <= t.xy[0] <= 0.7 and -1.5 <= t.xy[1] <= 1.2
    ]
    assert [t.get_text() for t in shown] == inside
    assert 2 < len(inside) < 8
    assert inked == 0
    drawn.ax.set_xlim(-5.5, 5.5)
    drawn.ax.set_ylim(-4.4, 4.4)
    shown, _ = clear(drawn)
    assert len(shown) == len(before) == 16


def test_the_figure_becomes_smaller():
    drawn = fs.plot.diagram(crowd())
    drawn.figure.set_size_inches(1.9, 1.9)
    shown, _ = clear(drawn)
    # those without room are left out, not written over each other
    assert 0 < len(shown) <= 16
    drawn.figure.set_size_inches(6.0, 5.0)
    assert len(clear(drawn)[0]) == 16


def test_logarithmic_axes():
    ax = Figure((85 / 25.4, 3), dpi=150, layout="constrained").add_subplot()
    ax.set_xscale("log")
    drawn = fs.plot.diagram(crowd(), x="exp(p)", ax=ax)
    shown, inked = clear(drawn)
    assert len(shown) == 16
    assert inked == 0
    box = drawn.legend.get_window_extent()
    assert not any(box.overlaps(Text.get_window_extent(t)) for t in shown)


def test_two_drawings_in_the_same_axes_know_of_each_other():
    first = fs.plot.diagram(crowd(), legend=False)
    second = fs.plot.diagram(crowd(0.9), ax=first.ax, color="#0072B2", legend=False)
    shown, _ = clear(second, [*first.labels, *second.labels])
    assert {t.get_text() for t in shown} == {f"LP{k}" for k in range(1, 17)}


def test_limits_set_before_are_kept(s_curve):
    ax = Figure().add_subplot()
    ax.set_xlim(-0.5, 0.5)
    ax.set_ylim(-3.0, 2.0)
    fs.plot.diagram(s_curve, ax=ax)
    assert ax.get_xlim() == (-0.5, 0.5)
    assert ax.get_ylim() == (-3.0, 2.0)


def test_a_label_far_from_its_point_is_joined_to_it():
    figure = Figure((3, 2), dpi=100)
    ax = figure.add_axes((0, 0, 1, 1))
    ax.set(xlim=(0, 1), ylim=(0, 1))
    ax.plot(*np.random.default_rng(1).uniform(0.25, 0.75, (2, 4000)), ".", markersize=3)
    label = tag(ax, "LP1", (0.5, 0.5))
    place(ax, [label])
    figure.draw_without_rendering()
    (leader,) = [line for line in ax.lines if len(line.get_xdata()) == 3]
    start, end = np.transpose(leader.get_data())[:2]
    assert start == pytest.approx([1.5, 1.0])
    assert Text.get_window_extent(label).padded(1.5).contains(*(100 * end))


def test_regions_reach_to_new_limits(gear_diagram):
    drawn = fs.plot.diagram(gear_diagram)
    drawn.ax.set_ylim(-3.0, 0.1)
    drawn.figure.draw_without_rendering()
    visible = [n.get_text() for n in drawn.bands.names if n.get_visible()]
    assert visible == ["S2", "S3"]
    lowest = drawn.bands.fills[-1]
    assert lowest.get_y() == pytest.approx(-3.0)
    assert lowest.get_y() + lowest.get_height() == pytest.approx(-0.25)
    assert drawn.bands.fills[0].get_height() == 0.0


def test_regions_on_a_logarithmic_axis():
    figure = Figure((3, 3), dpi=100)
    ax = figure.add_subplot()
    ax.set(yscale="log", ylim=(1, 1000))
    heights, regions = np.array([2.0, 500.0]), np.array(["low", "high"])
    bands = draw_bands(ax, "x", {"wall": ("x", 10.0)}, heights, regions)
    place(ax, bands=[bands])
    figure.draw_without_rendering()
    assert [name.get_text() for name in bands.names] == ["high", "low"]
    assert bands.names[0].get_position()[1] == pytest.approx(100.0)
    assert bands.names[1].get_position()[1] == pytest.approx(np.sqrt(10.0))
    assert ax.get_ylim() == (1, 1000)


@pytest.mark.parametrize("jumps", [(0.13, 0.27, 0.58, 0.8), (0.3, 0.58, 0.83)])
def test_the_name_of_a_region_fits_between_the_jumps_of_a_curve(jumps):
    figure = Figure((2.3, 2.6), dpi=100)
    ax = figure.add_axes((0.03, 0.03, 0.96, 0.94))
    ax.set(xlim=(0, 1), ylim=(-1, 2))
    x = np.repeat([0.0, *jumps, 1.0], 2)[1:-1]
    (line,) = ax.plot(x, np.repeat(np.arange(len(jumps) + 1) % 2, 2) * 2.0 - 0.5)
    values = {"one": ("x", 0.0), "other": ("x", 1.0)}
    bands = draw_bands(ax, "x", values, np.array([0.5]), np.array(["middle"]))
    place(ax, bands=[bands])
    figure.draw_without_rendering()
    (name,) = bands.names
    box = name.get_window_extent()
    left, right = ax.transData.inverted().transform([[box.x0, box.y0], [box.x1, box.y1]])[:, 0]
    assert name.get_visible()
    assert not any(left <= at <= right for at in jumps)
    assert line in ax.lines


def test_room_is_made_for_a_legend_where_the_curves_leave_none():
    ax = Figure((2.2, 2.0), dpi=150, layout="constrained").add_subplot()
    drawn = fs.plot.sweep(swept(), ax=ax)
    ax.figure.draw_without_rendering()
    box = drawn.legend.get_window_extent()
    for line in (drawn.up, drawn.down):
        assert not any(box.contains(*at) for at in ax.transData.transform(line.get_xydata()))


def test_a_legend_without_any_room(gear_overlay):
    """Below the axes where a layout makes room, else left out; its entries are handed over."""
    small = Figure((1.7, 1.5), dpi=150).add_subplot()
    drawn = fs.plot.overlay(gear_overlay, ax=small)
    assert drawn.legend is None
    assert small.get_legend() is None
    assert len(drawn.handles) > 4
    laid = Figure((2.2, 2.8), dpi=150, layout="constrained").add_subplot()
    laid.set_ylim(-1.2, 1.2)
    drawn = fs.plot.overlay(gear_overlay, ax=laid)
    laid.figure.draw_without_rendering()
    box = drawn.legend.get_window_extent()
    assert box.y1 < laid.xaxis.label.get_window_extent().y0
    page = laid.figure.bbox
    assert page.x0 <= box.x0 <= box.x1 <= page.x1
    assert page.y0 <= box.y0


def test_nothing_to_draw(gear, gear_diagram, gear_overlay):
    empty = dataclasses.replace(crowd(), branches=())
    drawn = fs.plot.diagram(empty)
    assert drawn.artists == ()
    assert drawn.data == {}
    assert fs.plot.diagram(empty, "x", "x**2").branches == ()
    quiet = fs.simulate(gear, [0, 0], t=(0, 0.01))
    assert fs.plot.time_series(quiet).crossings is None
    assert fs.plot.phase_portrait(quiet).crossings is None
    overlay = fs.overlay(gear_diagram, quiet)
    assert fs.plot.overlay(overlay).crossings is None
    assert fs.plot.panel(overlay).overlay.transitions == ()
    assert fs.plot.overlay(overlay, "x", "v").transitions == ()


def test_one_sample_is_a_dot(gear_run):
    table = np.array([[gear_run[name][0]] for name in gear_run.columns])
    one = dataclasses.replace(gear_run, sampled=(gear_run.t[:1], table), period=None)
    for drawn in (fs.plot.time_series(one), fs.plot.phase_portrait(one)):
        (line,) = drawn.lines
        assert len(line.get_xdata()) == 1
        assert line.get_marker() == "."
        drawn.figure.draw_without_rendering()


def test_a_virtual_branch_of_one_row():
    row = cubic(admissible=False)[3:4]
    drawn = fs.plot.diagram(diagram_of(row))
    assert [line.get_label() for line in drawn.lines] == ["virtual"]


def test_boxes_on_a_grid_and_anywhere_cover_the_samples_within_their_reach():
    rng = np.random.default_rng(3)
    places = rng.uniform(0, 100, (400, 2))
    ink = np.column_stack([places, rng.choice([1.0, 80.0], 400), rng.choice([0.5, 3.0], 400)])
    starts = np.reshape(np.meshgrid([5.0, 30.0, 60.0], [10.0, 50.0, 70.0]), (2, -1)).T
    for corners in (starts, rng.uniform(0, 80, (9, 2))):
        boxes = np.hstack([corners, corners + np.array([20.0, 8.0])])
        expected = [
            sum(w for x, y, w, r in ink if x0 - r < x < x1 + r and y0 - r < y < y1 + r)
            for x0, y0, x1, y1 in boxes
        ]
        found = overlap_cost(boxes, ink, np.empty((0, 4)), Bbox.from_extents(-1, -1, 101, 101))
        np.testing.assert_array_equal(found, expected)
