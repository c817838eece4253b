"""The equilibrium diagram as drawn."""

import matplotlib as mpl
import numpy as np
import pytest
import sympy as sp
from matplotlib.colors import same_color
from matplotlib.figure import Figure

import fastslow as fs
from fastslow.plot.branch_lines import stability_runs
from fastslow.plot.branches import runs
from fastslow.results.base.outcome import Outcome

from .conftest import cubic, diagram_of

pytestmark = pytest.mark.slow


def extents(drawn):
    drawn.figure.draw_without_rendering()
    return [label.get_window_extent() for label in drawn.labels]


def test_runs_of_constant_stability():
    branch = cubic()
    found = list(runs(branch))
    assert [kind for kind, _ in found] == ["stable", "unstable", "stable"]
    assert found[0][1].stop - 1 == found[1][1].start == branch.special_rows[1]
    assert found[1][1].stop - 1 == found[2][1].start == branch.special_rows[2]
    assert found[2][1].stop == len(branch)


def test_a_drawing_prints_as_what_it_shows_without_addresses(s_curve):
    drawn = fs.plot.diagram(s_curve, "x**2")
    assert "0x" not in repr(drawn)
    y = drawn.ax.get_ylabel().strip("$")
    assert repr(drawn) == f"DiagramDrawing({y} over p)"


def test_a_line_for_each_run_and_a_marker_for_each_code(s_curve):
    drawn = fs.plot.diagram(s_curve)
    assert [line.get_label() for line in drawn.lines] == ["stable", "unstable", "stable"]
    assert [line.is_dashed() for line in drawn.lines] == [False, True, False]
    assert len({line.get_color() for line in drawn.lines}) == 1
    assert [m.get_label() for m in drawn.markers] == ["LP fold"]
    assert [t.get_text() for t in drawn.labels] == ["LP1", "LP2"]
    texts = [t.get_text() for t in drawn.legend.get_texts()]
    assert texts == ["stable", "unstable", "LP fold"]


def test_every_mark_has_a_marker_of_its_own():
    x, w = sp.symbols("x w")
    model = fs.Model({x: w - x}, parameters={w: 0})
    levels = {"one": "x - 0.2", "two": "x - 0.4", "three": "x - 0.6", w: [0.1]}
    drawn = fs.plot.diagram(fs.continue_equilibria(model, w, (0, 1), marks=levels))
    assert len({str(marker.get_marker()) for marker in drawn.markers}) == 4
    drawn.figure.draw_without_rendering()


def test_the_gap_is_neutral(gear_diagram):
    drawn = fs.plot.diagram(gear_diagram)
    assert [line.get_label() for line in drawn.lines] == ["stable", "neutral", "stable"]
    gap = drawn.lines[1]
    assert gap.get_linestyle() not in ("-", "None")
    assert np.abs(gap.get_xdata()).max() < 1e-12
    assert list(gap.get_ydata()[[0, -1]]) == [-0.25, 0.25]


def test_interfaces_and_regions(gear_diagram):
    drawn = fs.plot.diagram(gear_diagram)
    assert sorted(line.get_ydata()[0] for line in drawn.bands.lines) == [-0.25, 0.25]
    assert [name.get_text() for name in drawn.bands.names] == ["S1", "S2", "S3"]
    for name, (low, high) in zip(drawn.bands.names, drawn.bands.spans, strict=True):
        assert low < name.get_position()[1] < high
    middles = [sum(span) / 2 for span in drawn.bands.spans]
    assert middles == sorted(middles, reverse=True)
    plain = fs.plot.diagram(gear_diagram, interfaces=False)
    assert plain.bands.lines == plain.bands.fills == ()
    assert fs.plot.diagram(gear_diagram, "v").bands.lines == ()


def test_virtual_branches_are_dotted_and_faint():
    source = diagram_of(cubic(), cubic(admissible=False))
    drawn = fs.plot.diagram(source)
    virtual = drawn.lines[-1]
    assert virtual.get_label() == "virtual"
    assert virtual.get_alpha() < 0.5
    assert len(fs.plot.diagram(source, virtual=False).lines) == 3


def test_an_end_that_was_not_meant_is_marked():
    good = Outcome("end of range", "reached the end of the range.", True)
    bad = Outcome("step too small", "the step became too small.", False)
    drawn = fs.plot.diagram(diagram_of(cubic((good, bad))))
    assert [t.get_text() for t in drawn.labels] == ["step too small", "LP1", "LP2"]
    assert drawn.markers[0].get_label() == "EP end point"


@pytest.mark.parametrize("source", ["s_curve", "gear_diagram"])
def test_labels_stay_within_the_axes_and_apart(source, request):
    drawn = fs.plot.diagram(request.getfixturevalue(source))
    boxes = extents(drawn)
    frame = drawn.ax.get_window_extent()
    for box in boxes:
        assert frame.x0 < box.x0
        assert box.x1 < frame.x1
        assert frame.y0 < box.y0
        assert box.y1 < frame.y1
    assert not boxes[0].overlaps(boxes[1])


def test_a_label_is_nearest_to_its_own_point(s_curve):
    drawn = fs.plot.diagram(s_curve)
    points = drawn.ax.transData.transform([label.xy for label in drawn.labels])
    for number, box in enumerate(extents(drawn)):
        middle = [(box.x0 + box.x1) / 2, (box.y0 + box.y1) / 2]
        assert np.argmin(np.hypot(*(points - middle).T)) == number


def test_draws_into_axes_given(s_curve):
    ax = Figure().add_subplot()
    drawn = fs.plot.diagram(s_curve, ax=ax, color="#0072B2", linewidth=3)
    assert drawn.ax is ax
    assert drawn.figure is ax.figure
    assert all(line.axes is ax for line in drawn.lines)
    assert {line.get_linewidth() for line in drawn.lines} == {3}
    assert all(same_color(line.get_color(), "#0072B2") for line in drawn.lines)
    assert drawn.legend.axes is ax


def test_without_labels_or_legend(s_curve):
    drawn = fs.plot.diagram(s_curve, label=False, legend=False)
    assert drawn.labels == ()
    assert drawn.legend is None


def test_no_global_setting_changes(s_curve, tmp_path):
    before = dict(mpl.rcParams)
    fs.plot.diagram(s_curve).save(tmp_path / "a.pdf")
    assert dict(mpl.rcParams) == before


@pytest.mark.sample(1)
@pytest.mark.parametrize("suffix", ["png", "pdf", "svg"])
def test_files(s_curve, tmp_path, suffix):
    path = fs.plot.diagram(s_curve).save(tmp_path / f"a.{suffix}")
    assert path.stat().st_size > 1000


def test_shows_itself_in_a_notebook(s_curve):
    assert fs.plot.diagram(s_curve)._repr_png_().startswith(b"\x89PNG")


def test_a_column_wide(s_curve):
    width, _ = fs.plot.diagram(s_curve).figure.get_size_inches()
    assert width == pytest.approx(85 / 25.4)


def test_unknown_state(gear_diagram):
    with pytest.raises(
        fs.UnknownNameError, match="unknown state or parameter 'vv'; did you mean 'v'"
    ):
        fs.plot.diagram(gear_diagram, "vv")


def test_bands_are_named_by_what_lies_in_them(gear):
    # an interface given the other way round turns the order of the regions
    written = dict(zip(gear.states, gear.rates.values(), strict=True))
    turned = fs.Model(
        written,
        forcing=gear.forcing,
        parameters=gear.parameters,
        interfaces={"top": sp.sympify("D - x"), "bottom": sp.sympify("x + D")},
    )
    above = next(n for n, r in turned.regions.items() if r.signs["top"] < 0)
    drawn = fs.plot.diagram(fs.continue_equilibria(turned.frozen(), "w", over=(-2, 6)))
    names = [name.get_text() for name in drawn.bands.names]
    assert names[0] == above != "S1"
    assert sorted(names) == ["S1", "S2", "S3"]


def test_branches_that_cross_name_their_branch_point_once():
    x, w = sp.symbols("x w")
    model = fs.Model({x: x * (w - x)}, parameters={w: 1})
    drawn = fs.plot.diagram(fs.continue_equilibria(model, "w", over=(-1, 1.3)))
    assert [text.get_text() for text in drawn.labels] == ["BP1"]


@pytest.mark.parametrize(
    ("kinds", "expected"),
    [
        (["stable", "stable", "unknown", "unstable"], [("stable", 0, 3), ("unstable", 2, 4)]),
        (["unstable", "stable", "unknown"], [("unstable", 0, 2), ("stable", 1, 3)]),
    ],
)
def test_a_grazing_orbit_without_multipliers_ends_a_line(kinds, expected):
    runs = [(kind, rows.start, rows.stop) for kind, rows in stability_runs(np.array(kinds))]
    assert runs == expected


def test_the_two_rows_of_a_boundary_equilibrium_are_no_line():
    x, v, belt = sp.symbols("x v belt")
    rates = {x: v, v: -x - sp.sign(v - belt) * (1 + sp.exp(-sp.Abs(v - belt)))}
    diagram = fs.continue_equilibria(fs.Model(rates, parameters={belt: 0}), "belt", (-1, 1))
    drawn = sorted(fs.plot.diagram(diagram).data)
    assert drawn == ["BE boundary equilibrium", "neutral pseudo-equilibrium", "unstable"]
