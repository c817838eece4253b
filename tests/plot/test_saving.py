"""A file is laid out for its format and drawn once; the figure stays as it was."""

import pytest
from matplotlib.axes import Axes
from matplotlib.figure import Figure

import fastslow as fs
from fastslow.plot.layout import style

pytestmark = pytest.mark.slow


@pytest.fixture
def drawn_axes(monkeypatch):
    """The axes drawn, one entry each time."""
    drawn, draw = [], Axes.draw

    def counted(ax, renderer):
        drawn.append(ax)
        draw(ax, renderer)

    monkeypatch.setattr(Axes, "draw", counted)
    return drawn


@pytest.mark.sample(1)
@pytest.mark.parametrize("suffix", ["svg", "eps", "png", "pdf"])
def test_a_file_is_drawn_once_and_laid_out_as_by_matplotlib(
    gear_overlay, drawn_axes, tmp_path, suffix
):
    ours, theirs = (fs.plot.panel(gear_overlay).figure for _ in range(2))
    assert drawn_axes == []
    style.save(ours, tmp_path / f"a.{suffix}", dpi=100)
    insets = [inset for ax in ours.axes for inset in ax.child_axes]
    assert sorted(map(id, drawn_axes)) == sorted(map(id, [*ours.axes, *insets]))
    theirs.savefig(tmp_path / f"b.{suffix}", dpi=100)
    for one, other in zip(ours.axes, theirs.axes, strict=True):
        assert one.get_position().extents.tolist() == other.get_position().extents.tolist()


def test_the_figure_stays_as_it_was_and_each_font_is_in_the_file_once(gear_overlay, tmp_path):
    """With the minus signs, which Matplotlib may put into a font of their own."""
    drawn = fs.plot.panel(gear_overlay)
    figure = drawn.figure
    before = figure.get_layout_engine(), figure.canvas, figure.dpi
    text = drawn.save(tmp_path / "a.pdf").read_bytes()
    assert (figure.get_layout_engine(), figure.canvas, figure.dpi) == before
    assert len(text) > 10_000
    assert text.count(b"/FontFile2") == 2
    assert text.count(b"/Type0") == 2


def test_a_figure_that_cannot_be_drawn_stays_as_it_was(tmp_path):
    figure = Figure(layout="constrained")
    figure.add_subplot().xaxis.set_major_formatter(lambda value, place: f"{1 / 0}")
    before = figure.get_layout_engine(), figure.canvas, figure.dpi
    with pytest.raises(ZeroDivisionError):
        style.save(figure, tmp_path / "a.pdf")
    assert (figure.get_layout_engine(), figure.canvas, figure.dpi) == before
