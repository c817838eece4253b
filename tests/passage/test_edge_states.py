"""Edge states between two attractors, and the shortest shocks out of a basin."""

import numpy as np
import pytest
import sympy as sp
from scipy.integrate import solve_ivp

import fastslow as fs

pytestmark = pytest.mark.slow

x, v, y, t, p = sp.symbols("x v y t p")


@pytest.fixture(scope="module")
def well():
    return fs.Model({x: v, v: x - x**3 - v / 2})


@pytest.fixture(scope="module")
def left(well):
    return next(e for e in fs.equilibria(well) if e.stable and e["x"] < 0)


def test_a_saddle(well, left):
    edge = fs.edge_state(well, left, {x: 1.2, v: 0.1})
    assert edge.type == "saddle"
    assert edge.outcome
    np.testing.assert_allclose(edge.state, 0, atol=1e-14)
    assert [one["x"] for one in edge.between] == pytest.approx([-1, 1])
    with pytest.raises(fs.ArgumentError, match="a and b reach the same attractor"):
        fs.edge_state(well, left, [-1.1, 0])


def test_a_cycle():
    """The circles r² = 1 ± sqrt(1 − p) are cycles of period 2π; the smaller one is the edge."""
    growth = 2 * (x**2 + y**2) - (x**2 + y**2) ** 2 - p
    model = fs.Model({x: -y + x * growth, y: x + y * growth}, parameters={p: 0.5})
    edge = fs.edge_state(model, [0, 0], [1.3, 0])
    assert edge.type == "orbit"
    assert edge.state @ edge.state == pytest.approx(1 - np.sqrt(0.5), rel=1e-10)
    assert edge.orbit.period == pytest.approx(2 * np.pi, rel=1e-10)


def test_a_forced_orbit():
    forced = fs.Model({x: v, v: x - x**3 - v / 2 + sp.cos(2 * t) / 20})
    edge = fs.edge_state(forced, [-1, 0], [1, 0])
    assert edge.orbit.period == pytest.approx(np.pi)
    assert np.sum(np.abs(edge.orbit.multipliers) > 1) == 1
    # to first order in the force, x = Re(c exp(2 i t)) with (−4 − 1 + i) c = 1/20
    assert edge["x"] == pytest.approx((0.05 / (-5 + 1j)).real, abs=1e-4)


def test_edges_at_events():
    """Grazing of a wall, a visible tangency, a repelling sliding region, a two-fold."""
    wall = fs.Model({x: v, v: -x - v / 5, y: y - y**3}, resets={x >= 1: {v: -v / 2, y: 1}})
    grazing = fs.edge_state(wall, [0.5, 0, -1], [0.5, 3, -1])
    assert (grazing.type, grazing.interface) == ("grazing", "x >= 1")
    assert (grazing["x"], grazing["v"]) == pytest.approx((1, 0), abs=1e-5)
    rates = {x: (3 - x, v > 1), v: (3 - v, v > 1)}
    below = {x: v, v: -x - v / 5}
    jump = fs.Model({s: sp.Piecewise(rates[s], (below[s], True)) for s in (x, v)})
    tangency = fs.edge_state(jump, [-0.9, 0], [-1.5, 0.3])
    assert (tangency.type, tangency.interface) == ("visible tangency", "v - 1")
    # where v' = −x − v/5 vanishes on v = 1
    assert (tangency["x"], tangency["v"]) == pytest.approx((-0.2, 1), abs=1e-5)
    sliding = fs.Model({x: -x + sp.sign(x), y: -y})
    escaping = fs.edge_state(sliding, [-1, 0.1], [1, 0.2])
    assert escaping.type == "escaping"
    assert "not unique" in str(escaping.outcome)
    fold = fs.edge_state(fs.Model({x: v, v: -v / 3 - x + sp.sign(x)}), [-1, 0], [1, 0])
    assert (fold.type, fold.point.at_two_fold) == ("pseudo-saddle", True)


def test_a_third_attractor():
    model = fs.Model({x: -x * (x**2 - 1) * (x**2 - 4)})
    with pytest.raises(fs.ArgumentError, match="reaches a third attractor"):
        fs.edge_state(model, [-2], [2])


def test_a_shock_across_a_corner():
    model = fs.Model({y: sp.Abs(y) - 1})
    stable = next(e for e in fs.equilibria(model) if e.stable)
    found = fs.minimal_shock(model, stable, ["y"])
    assert found.length == 2
    assert (found[0].beyond, found[0].edge["y"]) == ("unbounded", 1)


def side(start):
    """The well in which a run of SciPy ends."""
    run = solve_ivp(
        lambda _, u: [u[1], u[0] - u[0] ** 3 - u[1] / 2], (0, 80), start, rtol=1e-11, atol=1e-12
    )
    return np.sign(run.y[0, -1])


def test_the_shortest_shock_of_the_double_well(well, left):
    found = fs.minimal_shock(well, left, ["x", "v"])
    assert [one.method for one in found] == ["smooth", "smooth"]
    shortest = found[0].displacement
    # the boundary is normal to the x axis where v = 0
    assert shortest[1] == pytest.approx(0, abs=1e-10)
    assert side(left.state + shortest * (1 - 1e-8)) == -1
    assert side(left.state + shortest * (1 + 1e-8)) == 1
    # no shorter one in any of 24 directions, and both optima are stationary
    for angle in np.linspace(0, 2 * np.pi, 24, endpoint=False):
        ray = np.array([np.cos(angle), np.sin(angle)])
        assert side(left.state + found.length * (1 - 1e-6) * ray) == -1
    other = found[1].displacement
    for turn in (-3e-3, 3e-3):
        c, s = np.cos(turn), np.sin(turn)
        assert side(left.state + np.array([[c, -s], [s, c]]) @ other) == -1
    heavy = fs.minimal_shock(well, left, ["x", "v"], weights={v: 0.5})
    assert heavy.length == pytest.approx(np.hypot(*(heavy[0].displacement * [1, 0.5])))
    assert heavy.length < found.length


def test_walls_exclude_shocks():
    """With an elastic wall between both wells no displacement before it leaves the basin."""
    walled = fs.Model({x: v, v: x - x**3 - v / 2}, resets={x >= -0.2: {v: -v}})
    start = next(e for e in fs.equilibria(walled) if e.stable)
    found = fs.minimal_shock(walled, start, ["x"])
    assert (len(found), found.outcome.code) == (0, "no boundary")
    with pytest.raises(fs.ArgumentError, match="there is no shortest displacement"):
        _ = found.length
