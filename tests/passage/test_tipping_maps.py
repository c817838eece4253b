"""Curves of critical rates, maps of tipping, and basin instability, against closed forms."""

import numpy as np
import pytest
import sympy as sp

import fastslow as fs
from fastslow.passage.tipping.ends_of_shifts import UNDECIDED_END, FutureSystem

pytestmark = pytest.mark.slow

x, v, t, w, r, L, D = sp.symbols("x v t w r L D")

#: Few points: each is solved to rounding.
LONG = fs.Continuation(step=0.1, max_step=0.2, max_turn=0.6)

COARSE = fs.Refinement(cells=(3, 3), levels=1, resolution=1e-9)


@pytest.fixture(scope="module")
def smooth():
    shift = {w: L * (1 + sp.tanh(L * r * t / 2)) / 2}
    return fs.Model({x: (x + w) ** 2 - 1}, forcing=shift, parameters={r: 1, L: 3})


@pytest.fixture(scope="module")
def curve(smooth):
    found = fs.critical_rate(smooth, r, (0.5, 2))
    return fs.continue_points(
        found[0], ("r", "L"), over={"r": (0.8, 2), "L": (2.5, 4)}, continuation=LONG
    )


def test_a_curve_in_closed_form(curve):
    length = curve["L"]
    np.testing.assert_allclose(curve["r"], 4 / (length * (length - 2)), rtol=1e-13)
    assert [one.code for one in curve.outcomes] == ["end of range", "end of range"]
    assert sorted([curve["r"][0], curve["r"][-1]]) == pytest.approx([0.8, 2], abs=1e-12)
    assert curve.at(L=3) == pytest.approx([4 / 3], rel=1e-5)
    assert len(curve.folds("L")) == 0


def test_a_curve_across_an_interface():
    ramp = {w: sp.Min(r * t, D)}
    model = fs.Model({x: sp.Abs(x + w) - 1}, forcing=ramp, parameters={r: 2, D: 2.7})
    found = fs.critical_rate(model, r, (1.2, 4))
    curve = fs.continue_points(
        found[0], ("r", "D"), over={"r": (1.1, 5), "D": (2, 5)}, continuation=LONG
    )
    rate = curve["r"]
    np.testing.assert_allclose(curve["D"], 2 * rate * np.log(rate / (rate - 1)), rtol=1e-13)
    assert np.ptp(rate) > 3


@pytest.mark.sample(0)
def test_a_curve_with_a_fold():
    """With L = 5/2 + q² the largest critical rate is 16/5, at q = 0, where the curve turns."""
    q = sp.Symbol("q")
    length = sp.Rational(5, 2) + q**2
    shift = {w: length * (1 + sp.tanh(length * r * t / 2)) / 2}
    model = fs.Model({x: (x + w) ** 2 - 1}, forcing=shift, parameters={r: 1, q: 0.4})
    found = fs.critical_rate(model, r, (0.5, 3))
    over = {"r": (2.2, 4), "q": (-0.45, 0.45)}
    curve = fs.continue_points(found[0], ("q", "r"), over=over, continuation=LONG)
    length = 2.5 + curve["q"] ** 2
    np.testing.assert_allclose(curve["r"], 4 / (length * (length - 2)), rtol=1e-13)
    (turn,) = curve.folds("r")
    assert curve["q"][turn] * curve["q"][turn + 1] < 0
    assert len(curve.at(r=2.5)) == 2
    assert curve.at(q=0) == pytest.approx([3.2], rel=1e-3)


@pytest.fixture(scope="module")
def before_a_wall():
    """A moving double well in front of a wall: runs pass the saddle several times."""
    v, y = sp.Symbol("v"), x - w
    return fs.Model(
        {x: v, v: y - y**3 - v / 10},
        forcing={w: D * (1 + sp.tanh(r * t)) / 2},
        parameters={r: 1, D: 1.5},
        resets={x >= 2.9: {v: -0.8 * v}},
    )


def test_neighbouring_curves_are_not_confused(before_a_wall):
    """Another critical rate, whose run passes the saddle once less, is at r = 0.815."""
    first = fs.critical_rate(before_a_wall, r, (0.97, 1.03), branch=[-1, 0])[0]
    over = {"r": (0.7, 1.3), "D": (1.45, 1.55)}
    curve = fs.continue_points(first, ("r", "D"), over, continuation=LONG)
    assert curve["D"][[0, -1]] == pytest.approx([1.45, 1.55])
    other = before_a_wall.with_parameters({D: 1.45})
    (same,) = fs.critical_rate(other, r, (0.97, 1.04), branch=[-1, 0])
    assert curve["r"][0] == pytest.approx(same.rate, abs=1e-11)


def test_a_curve_ends_where_its_run_grazes(before_a_wall):
    """Above D = 1.19927 the run has an impact, whose speed vanishes there."""
    model = before_a_wall.with_parameters({D: 1.2})
    (one,) = fs.critical_rate(model, r, (1.9, 1.94), branch=[-1, 0])
    assert len(one.run.resets) == 1
    coarse = fs.Continuation(step=0.1, max_step=0.2, max_turn=0.5, min_step=0.04)
    over = {"r": (1.9, 1.93), "D": (1.19, 1.202)}
    curve = fs.continue_points(one, ("r", "D"), over, continuation=coarse)
    (end,) = (one for one in curve.outcomes if one.code == "step too small")
    assert "runs beyond differ by an impact at x >= 2.9, which is grazed here" in str(end)
    assert curve["D"].min() == pytest.approx(1.19928, abs=2e-4)


def test_the_map_and_its_boundary(smooth, curve):
    few = fs.Refinement(cells=(3, 3), levels=1, resolution=1e-5)
    plane = fs.tipping_map(smooth, r, {"r": (0.5, 3), "L": (2.3, 4)}, refinement=few)
    for rate in (0.55, 1.4, 2.9):
        for length in (2.35, 2.9, 3.9):
            known = "tip" if rate > 4 / (length * (length - 2)) else "track"
            assert plane.at(r=rate, L=length) == known or abs(rate * length * (length - 2) - 4) < 2
    brackets = plane.boundary("track", "tip")
    points = np.vstack([one.points for one in brackets])
    on_curve = np.abs(points[:, 0] * points[:, 1] * (points[:, 1] - 2) / 4 - 1)
    assert np.median(on_curve) < 1e-4
    drawn = fs.plot.tipping_map(plane, curve)
    assert {line.get_label() for line in drawn.curves} == {"critical rate"}
    np.testing.assert_array_equal(drawn.curves[0].get_ydata(), curve["L"])
    other = fs.refined_map(lambda a, b: a > b, {"a": (0, 1), "b": (0, 1)}, refinement=COARSE)
    with pytest.raises(fs.ArgumentError, match="boundary: a curve in r, L; the map is over a, b"):
        fs.plot.tipping_map(other, curve)


def test_a_shift_that_returns():
    """A pulse of the load beyond the fold: short ones track, longer ones return, then tip."""
    pulse = fs.Model(
        {x: w + x - x**3}, forcing={w: -0.3 + D / sp.cosh(r * t)}, parameters={r: 1, D: 1.2}
    )
    over = {"r": (1.0, 1.6), "D": (0.6, 1.2)}
    few = fs.Refinement(cells=(8, 1), levels=0)
    plane = fs.tipping_map(pulse, r, over, branch=[-1.1], refinement=few)
    assert set(plane.labels) == {"track", "tip", "return"}
    # the critical rate at D = 1.2 is 1.1295
    words = ["tip"] * 2 + ["return"] * 5
    assert [plane.at(r=rate, D=1.2) for rate in np.linspace(1, 1.45, 7)] == words


def test_basin_instability(smooth):
    diagram = fs.continue_equilibria(smooth.frozen(), "w", over=(0, 4))
    plane = fs.basin_instability(diagram, refinement=COARSE)
    points = np.vstack([one.points for one in plane.boundary("inside", "outside")])
    np.testing.assert_allclose(points[:, 1] - points[:, 0], 2, atol=1e-7)
    wells = fs.continue_equilibria(fs.Model({x: w + x - x**3}, parameters={w: 0}), "w", (-1, 1))
    with pytest.raises(fs.ArgumentError, match="the diagram has 2 stable branches"):
        fs.basin_instability(wells)
    left = next(e for e in wells.at(w=-0.2, stable=True) if e["x"] < 0)
    lower = fs.basin_instability(wells, point=left, refinement=COARSE)
    assert set(lower.labels) == {"inside"}


def test_pairs_and_shifts_whose_attractor_is_not_known_fail(smooth, monkeypatch):
    def undecided(self, states, codes):
        return np.full(len(states), UNDECIDED_END)

    frozen = smooth.frozen()
    diagram = fs.continue_equilibria(frozen, "w", over=(0, 3))
    monkeypatch.setattr(FutureSystem, "reached", undecided)
    coarse = fs.Refinement(cells=(2, 2), levels=1)
    pairs = fs.basin_instability(diagram, refinement=coarse)
    runs = fs.tipping_map(smooth, r, {"r": (0.5, 2), "L": (2.5, 3)}, refinement=coarse)
    for plane in (pairs, runs):
        assert plane.failures
        assert not {"inside", "outside", "track", "tip"} & set(plane.labels)
