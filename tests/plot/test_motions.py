"""Time series and phase portraits as drawn."""

import dataclasses

import numpy as np
import pytest
import sympy as sp
from matplotlib.figure import Figure

import fastslow as fs

VALUES = {"x - D": ("x", 0.25), "x + D": ("x", -0.25)}


def test_time_series(gear_run):
    ax = Figure().add_subplot()
    drawn = fs.plot.time_series(gear_run, "x", ax=ax, interface_values=VALUES)
    (line,) = drawn.lines
    assert drawn.ax is line.axes is ax
    assert (drawn.x, drawn.y) == ("t", "x")
    assert np.array_equal(line.get_ydata(), gear_run["x"])
    assert len(drawn.crossings.get_xdata()) == len(gear_run.crossings)
    assert np.allclose(np.abs(drawn.crossings.get_ydata()), 0.25, atol=1e-14)
    assert len(drawn.bands[0].lines) == 2


def test_time_series_of_two_runs_share_the_longer_span(gear_run):
    short = fs.simulate(fs.systems.van_der_pol(), {"x": 1, "v": 0}, t=(0, 1))
    ax = fs.plot.time_series(gear_run, "x").ax
    assert fs.plot.time_series(short, "x", ax=ax).ax.get_xlim() == gear_run.span


def test_time_series_of_a_slow_quantity(gear_run):
    drawn = fs.plot.time_series(gear_run, "w", crossings=False)
    assert drawn.crossings is None
    assert drawn.lines[0].get_ydata().max() == pytest.approx(2.372 + 3.546, rel=1e-4)


def test_phase_portrait_has_a_direction(gear_run):
    drawn = fs.plot.phase_portrait(gear_run, interface_values=VALUES)
    assert (drawn.x, drawn.y) == ("x", "v")
    assert [line.get_label() for line in drawn.lines] == ["earlier periods", "trajectory"]
    joined = np.concatenate([line.get_xdata() for line in drawn.lines])
    assert len(joined) == len(gear_run.t) + 1
    assert drawn.arrows
    assert [b.vertical for b in drawn.bands] == [True, False]


def test_any_plane(gear_run):
    drawn = fs.plot.phase_portrait(gear_run, "w", "v")
    assert (drawn.x, drawn.y) == ("w", "v")
    assert drawn.ax.get_xlabel() == "$w$"


def test_one_state_stands_over_its_slow_quantity():
    x, p, t = sp.symbols("x p t")
    run = fs.simulate(fs.Model({x: p - x}, forcing={p: sp.sin(t)}), [0], periods=1)
    drawn = fs.plot.phase_portrait(run)
    assert (drawn.x, drawn.y) == ("p", "x")


def test_one_quantity_alone_has_no_phase_portrait():
    x = sp.Symbol("x")
    run = fs.simulate(fs.Model({x: -x}), [1], t=(0, 1))
    with pytest.raises(fs.ArgumentError, match="two quantities, received x alone"):
        fs.plot.phase_portrait(run)


def test_unknown_quantities(gear_run):
    with pytest.raises(fs.UnknownNameError, match="unknown state or slow quantity 'ww'; did you"):
        fs.plot.time_series(gear_run, "ww")
    with pytest.raises(fs.UnknownNameError, match=r"\(known: x, v, w, t\)"):
        fs.plot.phase_portrait(gear_run, "x", "theta")


@pytest.fixture(scope="module")
def bounces():
    x, v = sp.symbols("x v")
    ball = fs.Model({x: v, v: -1}, resets={x <= 0: {v: -0.8 * v}})
    return fs.simulate(ball, [1, 0], t=(0, 6))


@pytest.mark.parametrize("draw", [fs.plot.time_series, fs.plot.phase_portrait])
def test_jumps_are_dotted_lines(draw, bounces):
    drawn = draw(bounces, y="v")
    (line,) = drawn.lines
    assert np.isnan(line.get_ydata()).sum() == len(bounces.resets) == 3
    (dotted,) = (one for one in drawn.ax.lines if one.get_linestyle() == ":")
    ends = [(r.before[1], r.after[1], np.nan) for r in bounces.resets]
    assert dotted.get_ydata() == pytest.approx(np.ravel(ends), nan_ok=True)
    assert dotted.get_color() == line.get_color()
    assert dotted not in drawn.handles


def test_a_state_that_does_not_jump_is_one_line(bounces):
    drawn = fs.plot.time_series(bounces, "x")
    assert np.array_equal(drawn.lines[0].get_ydata(), bounces["x"])
    assert not [one for one in drawn.ax.lines if one.get_linestyle() == ":"]


@pytest.fixture(scope="module")
def stepwise():
    """An overlay of a model under a load that jumps."""
    x, w = sp.symbols("x w")
    load = fs.Tabulated([0, 10, 20, 30, 40], [0, 0.3, 0.6, -0.6, 0], interpolation="previous")
    model = fs.Model({x: w - x**3 + x}, forcing={w: load})
    diagram = fs.continue_equilibria(model.frozen(), "w", over=(-1, 1))
    return fs.overlay(diagram, fs.simulate(model, [-1], t=(0, 40)))


@pytest.mark.parametrize("more", [{}, {"z": "x**2"}])
def test_jumps_in_an_overlay(stepwise, more):
    drawn = fs.plot.overlay(stepwise, **more)
    (dotted,) = (one for one in drawn.ax.lines if one.get_linestyle() == ":")
    places = dotted.get_data_3d() if more else dotted.get_data()
    expected = [0, 0.3, np.nan, 0.3, 0.6, np.nan, 0.6, -0.6, np.nan]
    assert np.asarray(places[0], dtype=float) == pytest.approx(expected, nan_ok=True)


def test_arrows_of_an_interrupted_line_are_at_its_samples(stepwise):
    drawn = fs.plot.overlay(stepwise)
    states = np.column_stack([stepwise.slow, stepwise.run["x"]])
    for head in drawn.arrows:
        assert np.abs(states - head.get_position()).max(axis=1).min() < 1e-9
    jumps = [head for head in drawn.arrows if abs(head.get_position()[1]) < 0.6]
    assert len(jumps) == 2


@pytest.fixture(scope="module")
def relay_run():
    x, v, q = sp.symbols("x v q")
    relay = fs.Model({x: v, v: -x - 0.4 * v + 2 * q - 1}, switches={q: (x < -0.3, x > 0.3)})
    return fs.simulate(relay, {x: 1.5, v: 0}, t=(0, 12))


def test_a_switch_is_a_strip_below_a_time_series(relay_run):
    drawn = fs.plot.time_series(relay_run)
    (strip,) = drawn.switches
    begins = [path.vertices[0, 0] for path in strip.get_paths()]
    ends = [path.vertices[2, 0] for path in strip.get_paths()]
    assert begins == [s.time for s in relay_run.switches("q", value=1)]
    assert ends == [s.time for s in relay_run.switches("q", value=0)]
    # below the curve
    drawn.ax.figure.canvas.draw()
    lowest = drawn.ax.transData.transform((0, relay_run["x"].min()))[1]
    assert strip.get_window_extent().y1 < lowest
    assert [text.get_text() for text in drawn.ax.texts] == ["$q$"]


def test_states_of_a_switch_are_sheets_of_a_phase_portrait(relay_run):
    drawn = fs.plot.phase_portrait(relay_run)
    assert [line.get_label() for line in drawn.lines] == ["$q$ = 1", "$q$ = 0"]
    assert [line.get_linestyle() for line in drawn.lines] == ["-", "--"]
    for line, value in zip(drawn.lines, (1, 0), strict=True):
        inside = np.isfinite(line.get_xdata())
        assert (relay_run["q"] == value)[inside].mean() > 0.9
        assert inside[relay_run["q"] == value].all()
    # over the switch itself the changes are dotted
    space = fs.plot.phase_portrait(relay_run, "x", "v", "q")
    dotted = [line for line in space.ax.lines if line.get_linestyle() == ":"]
    assert len(space.lines) == len(dotted) == 1


def test_a_line_that_fills_the_axes_is_thinner(gear_run):
    widths = {line.get_linewidth() for line in fs.plot.phase_portrait(gear_run).lines}
    assert widths == {0.8}
    t = np.linspace(*gear_run.span, 4000)
    table = np.array([np.cos(0.37 * k + np.arange(4000)) for k in range(len(gear_run.columns))])
    dense = dataclasses.replace(gear_run, sampled=(t, table), period=None)
    (line,) = fs.plot.phase_portrait(dense).lines
    assert 0.3 <= line.get_linewidth() < 0.5
    (line,) = fs.plot.phase_portrait(dense, linewidth=0.8).lines
    assert line.get_linewidth() == 0.8
