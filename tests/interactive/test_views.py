"""What a view computes is what the functions compute that its call names."""

from dataclasses import replace

import numpy as np
import pytest
import sympy as sp
from matplotlib.figure import Figure

import fastslow as fs
from fastslow.interactive.drawing import draw_view
from fastslow.interactive.frames import Store, frame_of, kept_rows
from fastslow.interactive.views import at_start, setup_of, view_of
from fastslow.results.base.outcome import Outcome

pytestmark = pytest.mark.slow


def executed(view, model):
    names = {"fs": fs, "model": model}
    exec(view.call(), names)
    return names


def test_the_call_reproduces_the_view(folded):
    view = view_of(folded, setup_of(folded, periods=1), {"D": 0.3, "C": 0.45})
    assert view.model.parameters["D"] == 0.3
    assert view.outcomes == ()
    names = executed(view, folded)
    np.testing.assert_array_equal(names["run"].end, view.run.end)
    np.testing.assert_array_equal(names["overlay"].delays, view.overlay.delays)
    for ours, theirs in zip(view.diagram, names["diagram"], strict=True):
        np.testing.assert_array_equal(ours.points, theirs.points)
    # folds of x³ − D x² − 0.6 x + 0.6 D, from the derivative 3 x² − 2 D x − 0.6
    roots = np.roots([3, -2 * 0.3, -0.6])
    loads = roots**3 - 0.3 * roots**2 - 0.6 * roots + 0.18
    expected = loads[np.argmax(roots)]
    assert np.abs(view.diagram.folds["w"]).tolist() == pytest.approx([abs(expected)] * 2, abs=1e-12)


def test_the_diagram_goes_beyond_what_the_load_covers(folded):
    view = view_of(folded, setup_of(folded, periods=1))
    low, high = view.diagram.over
    assert low < -0.4
    assert high > 0.4
    assert view.overlay.outcome


def test_an_incomplete_overlay_is_noted_in_its_axes(folded):
    view = view_of(folded, setup_of(folded, periods=1))
    outcome = Outcome("cut short", "the run leaves the diagram", False)
    axes = Figure().subplots(1, 3)
    draw_view(axes, replace(view, overlay=replace(view.overlay, outcome=outcome)))
    assert [text.get_text() for text in axes[2].texts].count("cut short") == 1


def test_a_slow_state_is_what_the_diagram_is_over():
    model = fs.systems.van_der_pol_relaxation()
    view = view_of(model, setup_of(model, t=(0, 300), state={"x": 2, "y": 0}))
    assert view.diagram.parameter == "y"
    assert {t.type for t in view.overlay.transitions} == {"jump"}
    names = executed(view, model)
    np.testing.assert_array_equal(names["overlay"].delays, view.overlay.delays)


def test_a_model_without_slow_quantity_has_a_diagram_over_a_parameter():
    model = fs.systems.stick_slip()
    setup = setup_of(model, parameter="v_b", t=(0, 20), state=[0.5, 0])
    view = view_of(model, setup, {"v_b": 0.1})
    assert view.overlay is None
    assert view.outcomes == ()
    # F_s/(1 + δ v_b), also at the value of the run
    (point,) = view.diagram.at(v_b=0.1)
    assert point["x"] == pytest.approx(1 / 1.3, abs=1e-12)
    names = executed(view, model)
    assert names["diagram"].over == (0.0, 0.4)
    np.testing.assert_array_equal(names["run"].end, view.run.end)


def test_without_slow_quantity_and_parameter_there_is_a_run_alone():
    x = sp.Symbol("x")
    model = fs.Model({x: -x})
    view = view_of(model, setup_of(model, state=[1], t=(0, 1)))
    assert view.diagram is None
    assert view.run.end[1] == pytest.approx(np.exp(-1), abs=1e-9)
    assert "diagram" not in executed(view, model)


def test_what_fails_is_said_and_the_rest_is_there(folded):
    setup = setup_of(folded, over=(-0.5, 0.5), periods=1)
    view = view_of(folded, setup, {"omega": 0.0})
    assert view.run is None
    assert view.overlay is None
    (outcome,) = view.outcomes
    assert outcome.code == "not computed"
    assert "common period" in str(outcome)
    names = executed(view, folded.with_parameters(omega=0))
    np.testing.assert_array_equal(names["diagram"]["x"], view.diagram["x"])
    assert "run" not in names


def test_time_in_a_rate_leaves_the_trajectory():
    x, t, k = sp.symbols("x t k")
    model = fs.Model({x: sp.cos(t) - k * x}, parameters={k: 1.0})
    view = view_of(model, setup_of(model, periods=2))
    assert view.diagram is None
    assert view.run.outcome
    assert "depends on time explicitly" in str(view.outcomes[0])
    assert view.call().splitlines()[-1].startswith("# no diagram")


def test_a_run_that_grows_without_bound_says_so():
    x, k = sp.symbols("x k")
    model = fs.Model({x: k * x**2}, parameters={k: 1.0})
    view = view_of(model, setup_of(model, t=(0, 5), state=[1]))
    assert view.run is not None
    assert not view.outcomes[0]


def test_a_second_slow_quantity_is_held():
    x, y, u, w, t = sp.symbols("x y u w t")
    model = fs.Model(
        {x: u - x, y: w + x - y}, forcing={u: 1 + sp.sin(0.1 * t), w: 3 + sp.cos(0.1 * t)}
    )
    view = view_of(model, setup_of(model, parameter="u"))
    assert view.held == {"w": pytest.approx(3.0, abs=1e-5)}
    assert "another slow quantity" in [outcome.code for outcome in view.outcomes]
    names = executed(view, model)
    np.testing.assert_array_equal(names["diagram"]["y"], view.diagram["y"])


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"parameter": "w2"}, "unknown slow quantity or parameter 'w2'; did you mean 'w'?"),
        ({"y": "z"}, "unknown state 'z'"),
        ({"over": (1, 0)}, "did you mean .0, 1."),
        ({"over": 3}, "over = 3; expected two finite numbers"),
        ({"state": [0]}, "expected 2 values"),
        ({"t": (0, 1), "periods": 2}, "received both"),
        ({"periods": -1}, "positive"),
    ],
)
def test_wrong_settings_raise_at_once(folded, settings, message):
    with pytest.raises(fs.FastSlowError, match=message):
        setup_of(folded, **settings)


@pytest.mark.parametrize("value", [float("nan"), "much"])
def test_a_value_that_is_no_number_raises(folded, value):
    with pytest.raises(fs.ModelError, match="parameter D: expected a finite number"):
        view_of(folded, setup_of(folded, periods=1), {"D": value})


def test_pages_keep_both_sides_of_jumps():
    """Where rows are left out, a jump in the direction of motion would be drawn slanted."""
    x, t = sp.symbols("x t")
    jumping = fs.Model({x: 1 + sp.cos(40 * t) / 2}, resets={sp.Eq(sp.Mod(t, 1), 0): {x: x + 1}})
    run = fs.simulate(jumping, [0], t=(0, 200.5))
    rows = kept_rows(run)
    kept = run.t[rows]
    assert len(kept) < len(run.t)
    assert np.count_nonzero(np.diff(run["x"][rows]) > 0.9) == len(run.resets) == 200
    at_jumps = np.flatnonzero(np.diff(run["x"][rows]) > 0.9)
    assert np.diff(kept)[at_jumps].max() < 1e-11


def test_pages_interrupt_lines_at_jumps():
    x, t = sp.symbols("x t")
    jumping = fs.Model({x: 1 - x}, resets={sp.Eq(sp.Mod(t, 1), 0): {x: x - 1}})
    view = view_of(jumping, setup_of(jumping, t=(0, 5.5)))
    store = Store()
    table = frame_of(view, store)["tables"][0]
    values = view.run["x"][kept_rows(view.run)]
    assert len(table["jumps"]) == 5
    assert values[table["jumps"]] - values[np.array(table["jumps"]) - 1] == pytest.approx(-1)


def test_the_start_includes_switches():
    x, q = sp.symbols("x q")
    relay = fs.Model({x: 2 * q - x}, switches={q: (x < 0.5, x > 1.5)})
    setup = setup_of(relay, state={x: 1.0, q: 1}, t=(0, 2))
    view = view_of(relay, at_start(setup, relay, {"x": 0.75}))
    assert view.run["q"][0] == 1.0
    assert "fs.simulate(model, {'x': 0.75, 'q': 1.0}, t=(0.0, 2.0))" in view.call()
    # by default all are 0
    assert setup_of(relay, t=(0, 2)).start(relay) == {"x": 0.0, "q": 0.0}
