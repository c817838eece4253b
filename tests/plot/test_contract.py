"""What every plot function promises, function by function: the table in ``cases.py``."""

import dataclasses
import inspect
from functools import cache

import matplotlib as mpl
import matplotlib.pyplot as plt
import numpy as np
import pytest
import sympy as sp
from matplotlib.figure import Figure
from matplotlib.text import Text

import fastslow as fs
from fastslow.plot.drawings import Drawing
from fastslow.plot.layout.collisions import overlaps
from fastslow.results.base.result import Result
from fastslow.results.branch.branch import Branch

from .cases import CASES, results_by_name

pytestmark = pytest.mark.slow

#: What draws a result; `axes` only makes the axes.
FUNCTIONS = [n for n in fs.plot.__all__ if inspect.isfunction(getattr(fs.plot, n)) and n != "axes"]
MM = 1 / 25.4


@pytest.fixture(scope="session")
def results(gear_diagram, folded_overlay):
    return results_by_name(gear_diagram, folded_overlay)


def call(name, results, space=False, **keywords):
    case = CASES[name]
    more = {} if space else case.more(results)
    return getattr(fs.plot, name)(*case.args(results), **{**more, **keywords})


@pytest.fixture(scope="module")
def usual(results):
    """The figure of a plot function without further keywords, drawn once."""
    return cache(lambda name: call(name, results))


@pytest.fixture(scope="module")
def styled(results):
    """Given axes, and what a plot function drew into them with its keyword of style, once."""

    def drawn_into(name):
        ax = given(name)
        return ax, call(name, results, ax=ax, **CASES[name].style)

    return cache(drawn_into)


def axes(count=1, width=85, height=90, **look):
    """One or more axes below each other in a figure outside pyplot."""
    figure = Figure((width * MM, count * height * MM), dpi=150, layout="constrained")
    grid = [figure.add_subplot(count, 1, k + 1, **look) for k in range(count)]
    return grid if count > 1 else grid[0]


def given(name, **look):
    return axes(CASES[name].axes, **look)


def words(drawn):
    """Texts written into the axes, those of axes and legend left out."""
    texts = [t for ax in drawn.figure.axes for t in ax.texts if t.get_text() and t.get_visible()]
    return [t for t in texts if ax_shows(t)]


def ax_shows(text):
    anchor = getattr(text, "xy", None)
    return anchor is None or text.axes.bbox.padded(1).contains(
        *text.axes.transData.transform(anchor)
    )


def boxes(texts):
    return [Text.get_window_extent(t) for t in texts]


def test_the_table_has_every_plot_function():
    assert sorted(CASES) == FUNCTIONS


@pytest.mark.parametrize("name", FUNCTIONS)
def test_signature(name):
    """The same words for the same things, and all but data and axes by name."""
    parameters = inspect.signature(getattr(fs.plot, name)).parameters
    assert parameters["ax"].default is None
    assert parameters["label"].default is True
    assert parameters["width"].default in ("column", "page")
    assert "legend" in parameters
    kinds = {p.kind for p in parameters.values()}
    assert inspect.Parameter.VAR_KEYWORD in kinds
    for keyword in ("ax", "label", "legend", "width"):
        assert parameters[keyword].kind is inspect.Parameter.KEYWORD_ONLY
        assert keyword in getattr(fs.plot, name).__doc__


@pytest.mark.parametrize("name", FUNCTIONS)
def test_draws_into_given_axes_and_returns_what_it_drew(name, styled):
    before = dict(mpl.rcParams)
    ax, drawn = styled(name)
    assert dict(mpl.rcParams) == before
    mine = ax if isinstance(ax, list) else [ax]
    assert isinstance(drawn, Drawing)
    assert drawn.ax is mine[-1]
    assert drawn.figure is mine[0].figure
    with pytest.raises(dataclasses.FrozenInstanceError):
        drawn.ax = None
    assert drawn.artists
    for artist in drawn.artists:
        assert artist.axes in mine
        assert artist.figure is drawn.figure
    bars = [a for a in drawn.figure.axes if a not in mine]
    assert all(hasattr(a, "_colorbar") for a in bars)
    assert plt.get_fignums() == []


@pytest.mark.parametrize("name", FUNCTIONS)
def test_all_text_is_inside_the_figure(name, styled):
    figure = styled(name)[1].figure
    figure.draw_without_rendering()  # the layout follows from the ticks of a first drawing
    found = overlaps(figure)
    assert [str(one) for one in found if one.over == "edge"] == []


@pytest.mark.parametrize("name", FUNCTIONS)
def test_hands_over_the_data_drawn(name, styled):
    data = styled(name)[1].data
    assert data
    for curves in data.values():
        for curve in curves:
            assert curve.ndim == 2
            assert curve.shape[1] == 2
            assert len(curve) > 0
    assert not any(kind.startswith("_") for kind in data)


@pytest.mark.sample(8)
@pytest.mark.parametrize("name", FUNCTIONS)
@pytest.mark.parametrize("own", [True, False])
def test_without_labels_there_is_no_text_and_no_legend(name, own, results):
    drawn = call(name, results, label=False, ax=None if own else given(name))
    assert drawn.legend is None
    assert drawn.figure.legends == []
    for ax in drawn.figure.axes:
        assert ax.get_legend() is None
        assert [t.get_text() for t in ax.texts if t.get_text()] == []
        assert ax.get_title() == ax.get_title(loc="left") == ""
    assert drawn.ax.get_xlabel()
    assert drawn.ax.get_ylabel()


@pytest.mark.sample(3)
@pytest.mark.parametrize("name", FUNCTIONS)
def test_the_legend_has_its_own_word(name, results):
    assert call(name, results, legend=False).legend is None
    assert call(name, results, label=False, legend=True).legend is not None
    entries = [t.get_text() for t in call(name, results, legend=True).legend.get_texts()]
    assert len(entries) == len(set(entries))


@pytest.mark.parametrize("name", FUNCTIONS)
def test_style_is_obeyed(name, styled):
    assert set(CASES[name].styled(styled(name)[1])) == {3.0}


@pytest.mark.sample(1)
@pytest.mark.parametrize("name", FUNCTIONS)
def test_files_and_nothing_global_is_touched(name, usual, tmp_path):
    before = dict(mpl.rcParams)
    drawn = usual(name)
    for suffix in ("pdf", "svg"):
        assert drawn.save(tmp_path / f"a.{suffix}").stat().st_size > 3000
    assert b"/Type3" not in (tmp_path / "a.pdf").read_bytes()
    assert "<text" in (tmp_path / "a.svg").read_text(encoding="utf-8")
    assert dict(mpl.rcParams) == before
    assert plt.get_fignums() == []


@pytest.mark.sample(4)
@pytest.mark.parametrize("name", FUNCTIONS)
@pytest.mark.parametrize("width", ["column", "page"])
def test_a_figure_for_print(name, width, results, usual):
    default = inspect.signature(getattr(fs.plot, name)).parameters["width"].default
    drawn = usual(name) if width == default else call(name, results, width=width)
    size = drawn.figure.get_size_inches()
    assert size[0] == pytest.approx({"column": 85 * MM, "page": 170 * MM}[width])
    drawn.figure.draw_without_rendering()
    all_of_it = drawn.figure.get_tightbbox()  # in inches
    assert min(all_of_it.x0, all_of_it.y0) >= 0.0
    assert (all_of_it.max <= size).all()
    written = [t for t in drawn.figure.findobj(Text) if t.get_text()]
    assert min(t.get_fontsize() for t in written) >= 6.0
    nothing_overlaps(drawn)


def nothing_overlaps(drawn):
    """No text on a curve, a marker, another text or the frame."""
    assert overlaps(drawn.figure) == ()
    for text, box in zip(words(drawn), boxes(words(drawn)), strict=True):
        frame = text.axes.bbox
        assert frame.x0 < box.x0 < box.x1 < frame.x1, text.get_text()
        assert frame.y0 < box.y0 < box.y1 < frame.y1, text.get_text()


@pytest.mark.sample(3)
@pytest.mark.parametrize("name", FUNCTIONS)
def test_side_by_side_and_in_narrow_axes(name, results):
    """Two of a kind in one row of a page, without a layout: no text meets another."""
    if CASES[name].axes > 1:
        pytest.skip("fills a page by itself")
    figure = Figure((170 * MM, 70 * MM), dpi=150)
    pair = figure.subplots(1, 2, gridspec_kw={"wspace": 0.4})
    drawings = [call(name, results, ax=ax) for ax in pair]
    figure.draw_without_rendering()
    for ax, drawn in zip(pair, drawings, strict=True):
        shown = [t for t in ax.texts if t.get_text() and t.get_visible() and ax_shows(t)]
        extents = boxes(shown)
        key = [] if drawn.legend is None else [drawn.legend.get_window_extent()]
        for k, box in enumerate(extents):
            assert not any(box.overlaps(other) for other in (*extents[:k], *key)), shown[k]
            assert ax.bbox.x0 < box.x0 < box.x1 < ax.bbox.x1
        for box in key:
            covered = [m for line in markers(ax) for m in pixels(line) if box.contains(*m)]
            assert covered == []


def markers(ax):
    return [line for line in ax.lines if line.get_linestyle() == "None"]


def pixels(line):
    return line.get_transform().transform(np.asarray(line.get_xydata(), dtype=float))


def again(value, path):
    """The same result from a file; a special point from that of its diagram."""
    if not isinstance(value, Result):
        return value
    value.save(path)
    return fs.load(path)


@pytest.mark.sample(2)
@pytest.mark.parametrize("name", FUNCTIONS)
def test_a_loaded_result_is_drawn_alike(name, results, usual, tmp_path):
    loaded = {}
    for key, value in results.items():
        many = value if isinstance(value, tuple) else (value,)
        back = tuple(again(v, tmp_path / f"{key}{k}.npz") for k, v in enumerate(many))
        loaded[key] = back if isinstance(value, tuple) else back[0]
    first, second = usual(name).data, call(name, loaded).data
    assert list(first) == list(second)
    for kind, curves in first.items():
        for one, other in zip(curves, second[kind], strict=True):
            np.testing.assert_array_equal(one, other)


@pytest.mark.sample(1)
@pytest.mark.parametrize("name", [n for n in FUNCTIONS if CASES[n].space])
def test_in_space(name, results, tmp_path):
    keywords = CASES[name].space
    drawn = call(name, results, space=True, **keywords)
    assert drawn.ax.name == "3d"
    assert {curve.shape[1] for curves in drawn.data.values() for curve in curves} == {3}
    assert drawn.save(tmp_path / "a.pdf").stat().st_size > 3000
    ax = axes(projection="3d")
    assert call(name, results, space=True, ax=ax).ax is ax
    with pytest.raises(fs.ArgumentError, match='needs axes with projection="3d"'):
        call(name, results, space=True, ax=axes(), **keywords)
    # labels stand where their points are seen, however the box is turned
    ax.view_init(elev=60, azim=10)
    ax.figure.draw_without_rendering()
    labels = [t for t in ax.texts if t.get_text() and t.get_visible()]
    extents = boxes(labels)
    for k, box in enumerate(extents):
        assert not any(box.overlaps(other) for other in extents[:k])
    bare = call(name, results, space=True, label=False, **keywords)
    assert bare.legend is None
    assert [t.get_text() for t in bare.ax.texts if t.get_text()] == []
    page = drawn.figure.bbox
    drawn.figure.draw_without_rendering()
    for axis in (drawn.ax.xaxis, drawn.ax.yaxis, drawn.ax.zaxis):
        assert axis.label.get_text()
        box = axis.label.get_window_extent()
        assert page.x0 <= box.x0 <= box.x1 <= page.x1
        assert page.y0 <= box.y0 <= box.y1 <= page.y1


@pytest.mark.parametrize("width", ["line", 10, np.nan])
def test_widths_that_are_none(width, s_curve):
    with pytest.raises(fs.FastSlowError, match="width"):
        fs.plot.diagram(s_curve, width=width)


def test_a_width_in_millimetres(s_curve):
    assert fs.plot.diagram(s_curve, width=120).figure.get_size_inches()[0] == pytest.approx(
        120 * MM
    )


def square(columns):
    return columns["x"] ** 2


X = sp.Symbol("x", real=True)
SAME = ["x**2", X**2, square]


@pytest.mark.sample(1)
@pytest.mark.parametrize("quantity", SAME)
def test_any_axis_takes_any_quantity(quantity, results):
    """A string, an expression of SymPy and functions mean the same along every axis."""
    overlay, section, curves = results["overlay"], results["section"], results["curves"]
    along = [
        (fs.plot.overlay(overlay, quantity).lines[-1].get_ydata(), overlay["x**2"]),
        (fs.plot.overlay(overlay, x=quantity).lines[-1].get_xdata(), overlay["x**2"]),
        (fs.plot.overlay(overlay, "v", quantity).line.get_data_3d()[2], overlay["x**2"]),
        (fs.plot.time_series(overlay.run, quantity).lines[0].get_ydata(), overlay.run["x**2"]),
        (fs.plot.phase_portrait(overlay.run, quantity).lines[-1].get_xdata(), overlay.run["x**2"]),
        (
            fs.plot.phase_portrait(overlay.run, y=quantity).lines[-1].get_ydata(),
            overlay.run["x**2"],
        ),
        (fs.plot.section(section, quantity).points[0].get_xdata(), section["x**2"]),
        (fs.plot.section(section, y=quantity).points[0].get_ydata(), section["x**2"]),
    ]
    for drawn, whole in along:
        assert len(drawn)
        assert np.isin(np.round(drawn, 12), np.round(whole, 12)).all()
    branch = overlay.diagram.branches[0]
    for keyword, coordinate in (("y", 1), ("x", 0), ("z", 2)):
        drawn = fs.plot.diagram(overlay.diagram, **{keyword: quantity}, virtual=False)
        values = np.concatenate([c[:, coordinate] for k in LINES for c in drawn.data.get(k, ())])
        assert np.isin(np.round(branch["x**2"], 12), np.round(values, 12)).all()
        plane = fs.plot.parameter_plane(*curves, **{keyword: quantity})
        values = np.concatenate([c[:, coordinate] for c in plane.data["LP fold"]])
        assert np.isin(np.round(curves[0]["x**2"], 12), np.round(values, 12)).all()


LINES = ("stable", "unstable", "neutral")


def test_symbols_and_parameters_along_the_axes(results):
    drawn = fs.plot.diagram(results["crowd"], sp.Symbol("p"), x=X)
    assert (drawn.ax.get_xlabel(), drawn.ax.get_ylabel()) == ("$x$", "$p$")
    assert drawn.ax.get_ylim() == pytest.approx(results["crowd"].over)
    assert (drawn.x, drawn.y) == ("x", "p")
    other = fs.plot.overlay(results["overlay"], "w", x="x")
    assert other.diagram.bands.vertical
    assert len(other.diagram.bands.lines) == 2
    folds = results["overlay"].diagram.folds
    (marks,) = [m for m in other.diagram.markers if m.get_label() == "LP fold"]
    assert marks.get_xdata() == pytest.approx([p["x"] for p in folds], abs=1e-14)
    assert marks.get_ydata() == pytest.approx([p["w"] for p in folds], abs=1e-14)


def test_functions_say_what_is_wrong_with_them(results):
    crowd = results["crowd"]
    with pytest.raises(fs.UnknownNameError, match="unknown column 'y'"):
        fs.plot.diagram(crowd, lambda c: c["y"])
    with pytest.raises(fs.ArgumentError, match=r"returned values of shape \(2,\)"):
        fs.plot.diagram(crowd, lambda c: c["x"][:2])
    assert fs.plot.diagram(crowd, square).ax.get_ylabel() == "square"


def test_a_branch_of_one_point_is_a_branch(results):
    point = results["crowd"].branches[0][5:6]
    assert isinstance(point, Branch)
    diagram = dataclasses.replace(results["crowd"], branches=(point,))
    assert len(fs.plot.diagram(diagram).lines) == 1


def test_an_axis_that_is_no_quantity(s_curve):
    with pytest.raises(fs.ArgumentError, match="y = 3; expected a name or an expression"):
        fs.plot.diagram(s_curve, 3)
