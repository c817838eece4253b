"""What an explorer shows after a slider has moved is what a new one shows."""

import numpy as np
import pytest
from matplotlib.axis import Axis
from PIL import Image

import fastslow as fs
from fastslow.interactive.pictures import Picture, own_figure
from fastslow.plot.layout import labels

pytestmark = pytest.mark.slow

#: ipympl 0.10 makes its toolbar in a way that traitlets will refuse one day
IPYMPL = pytest.mark.filterwarnings("ignore:Passing unrecognized arguments:DeprecationWarning")

OVER, SLIDERS = (-0.5, 0.5), {"D": (0.1, 0.5), "C": (0, 1)}


def shown(explorer):
    """The pixels of the canvas as they are."""
    return np.array(explorer.figure.canvas.buffer_rgba()).astype(int)


def new(model, **changes):
    return fs.explore(model.with_parameters(changes), over=OVER, periods=1, sliders={})


def far(one, other):
    """How many pixels differ by more than a stroke at the edge of the axes may."""
    return int((np.abs(one - other).max(axis=2) > 20).sum())


@pytest.fixture
def axis_draws(monkeypatch):
    met, draw = [], Axis.draw

    def counted(axis, renderer):
        if axis.get_visible():
            met.append(axis)
        draw(axis, renderer)

    monkeypatch.setattr(Axis, "draw", counted)
    return met


def test_at_rest_the_picture_is_that_of_a_new_explorer(folded, explorer):
    explorer.glance({"D": 0.4, "C": 0.7})
    explorer.set({"D": 0.12, "C": 0.4})
    np.testing.assert_array_equal(shown(explorer), shown(new(folded, D=0.12, C=0.4)))


def test_a_view_without_a_run_leaves_nothing_of_the_one_before(folded, explorer):
    explorer.glance({"omega": 0.0})
    explorer.set(omega=0.0)
    other = fs.explore(folded, over=OVER, periods=1, sliders={})
    other.set(omega=0.0)
    fresh = own_figure()
    Picture(fresh).draw(explorer.view)
    fresh.canvas.draw()
    np.testing.assert_array_equal(shown(explorer), np.array(fresh.canvas.buffer_rgba()))
    explorer.set(omega=0.02)
    np.testing.assert_array_equal(shown(explorer), shown(new(folded)))


def test_within_their_limits_no_axis_is_drawn_anew(explorer, axis_draws):
    explorer.glance({"D": 0.25})
    axis_draws.clear()
    for value in (0.251, 0.252, 0.249):
        explorer.glance({"D": value})
    assert axis_draws == []


def test_a_moving_picture_shows_what_a_whole_drawing_shows(explorer, tmp_path):
    for value in (0.25, 0.26, 0.24):
        explorer.glance({"D": value})
        moving = shown(explorer)
        explorer._picture._backdrop._seen = []
        explorer.figure.canvas.draw()
        np.testing.assert_array_equal(shown(explorer), moving)
        explorer._picture._backdrop.remove()
        for artist in explorer._picture._backdrop.still:
            artist.set_visible(True)
        explorer.figure.canvas.draw()
        assert far(moving, shown(explorer)) == 0


@pytest.mark.sample(1)
@pytest.mark.parametrize("value", [0.5, 0.1])
def test_limits_hold_all_that_moves(explorer, value):
    for part in np.linspace(0.0, 1.0, 8):
        explorer.glance({"D": 0.25 + part * (value - 0.25)})
        for ax in explorer.figure.axes[:2]:
            box, (left, right), (low, high) = ax.dataLim, ax.get_xlim(), ax.get_ylim()
            assert left <= box.x0 < box.x1 <= right
            assert low <= box.y0 < box.y1 <= high
            assert box.height > 0.5 * (high - low)


def test_few_frames_of_a_long_way_change_the_limits(explorer, axis_draws):
    changed = 0
    for value in np.linspace(0.1, 0.2, 11):
        axis_draws.clear()
        explorer.glance({"D": value})
        changed += bool(axis_draws)
    assert changed < 4


def test_a_drawing_by_another_keeps_what_moves(explorer, tmp_path):
    """As after a window was uncovered, or a zoom of the toolbar; and a file has all of it."""
    explorer.glance({"D": 0.26})
    before = shown(explorer)
    explorer.figure.canvas.draw()
    np.testing.assert_array_equal(shown(explorer), before)
    explorer.figure.savefig(tmp_path / "a.png", dpi="figure")
    with Image.open(tmp_path / "a.png") as image:
        assert far(np.array(image), before) == 0
    explorer.figure.axes[0].set_xlim(0.0, 50.0)
    explorer.figure.canvas.draw()
    explorer.glance({"D": 0.261})
    assert explorer.figure.axes[0].get_xlim()[1] > 300.0


def test_a_drawing_without_output_is_not_kept(explorer):
    explorer.glance({"D": 0.25})
    before = shown(explorer)
    explorer._picture._backdrop._seen = []
    explorer.figure.draw_without_rendering()
    explorer.figure.canvas.draw()
    np.testing.assert_array_equal(shown(explorer), before)


def test_a_file_of_another_format_has_the_axes_too(explorer, tmp_path):
    explorer.glance({"D": 0.25})
    explorer.figure.savefig(tmp_path / "moving.svg")
    explorer.set(D=0.25)
    explorer.figure.savefig(tmp_path / "resting.svg")
    moving, resting = ((tmp_path / f"{n}.svg").read_text() for n in ("moving", "resting"))
    for name in ("xtick", "ytick", "legend"):
        assert moving.count(f'<g id="{name}') == resting.count(f'<g id="{name}') > 0


def test_the_pointer_lays_its_box_over_the_moving_picture(explorer, mouse):
    explorer.glance({"D": 0.25})
    explorer.glance({"D": 0.26})
    before = shown(explorer)
    (main,) = [ax for ax in explorer.figure.axes if ax.get_xlabel() == "$w$"]
    fold = explorer.view.diagram.folds[0]
    mouse("motion_notify_event", main, fold["w"], fold["x"])
    assert (shown(explorer) != before).any()
    mouse("motion_notify_event", main, -0.45, 0.9 * main.get_ylim()[1])
    np.testing.assert_array_equal(shown(explorer), before)


def test_what_was_cleared_or_written_on_the_figure_is_drawn_anew(folded, explorer):
    explorer.figure.clear()
    explorer.glance({"D": 0.3})
    explorer.figure.text(0.5, 0.5, "stale")
    explorer.figure.axes[0].axhline(0.1)
    explorer.set(D=0.3)
    np.testing.assert_array_equal(shown(explorer), shown(new(folded, D=0.3)))


@IPYMPL
def test_the_canvas_of_a_notebook(folded, explorer, axis_draws):
    """Its browser asks for drawings, also after it was moved to a finer screen."""
    explorer.widget  # noqa: B018
    canvas = explorer.figure.canvas
    for ratio in (1, 2):
        canvas.handle_set_device_pixel_ratio({"device_pixel_ratio": ratio})
        explorer.glance({"D": 0.25})
        canvas.draw()
        assert shown(explorer).shape[0] == 500 * ratio
        axis_draws.clear()
        explorer.glance({"D": 0.251})
        canvas.draw()
        assert axis_draws == []
    canvas.handle_set_device_pixel_ratio({"device_pixel_ratio": 1})
    explorer.set(D=0.251)
    canvas.draw()
    np.testing.assert_array_equal(shown(explorer), shown(new(folded, D=0.251)))


def test_names_of_regions_keep_their_places_within_their_bands(explorer, monkeypatch):
    placed, place = [], labels._place
    monkeypatch.setattr(labels, "_place", lambda *given: placed.append(given) or place(*given))
    explorer.glance({"D": 0.25})
    placed.clear()
    before = [name.get_position() for ax in explorer.figure.axes for name in ax.texts]
    explorer.glance({"D": 0.2501})
    after = [name.get_position() for ax in explorer.figure.axes for name in ax.texts]
    assert placed == []
    np.testing.assert_allclose(after, before, atol=2e-4)
    explorer.set({"D": 0.2502})
    assert len(placed) == 3
