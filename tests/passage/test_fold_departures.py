"""Whether an attractor remains near a fold, and where runs go, against closed forms and SciPy."""

import numpy as np
import pytest
import sympy as sp
from scipy.integrate import solve_ivp

import fastslow as fs

pytestmark = pytest.mark.slow

LARGE = fs.Continuation(step=0.2, max_step=1.0)

x, v, y, t, p, F = sp.symbols("x v y t p F")


def test_a_smooth_fold():
    model = fs.Model({x: p + x - x**3}, parameters={p: 0})
    fold = fs.continue_equilibria(model, "p", over=(0, 1)).folds[0]
    beyond = fs.beyond_fold(model, fold, p, 0.1)
    assert (beyond.remains, beyond.proved, beyond.exponent) == (False, True, 0)
    assert beyond.value == pytest.approx(2 / np.sqrt(27))
    # the other root, 2/√3 at the fold, of x³ − x = p
    assert beyond.reached["x"] == pytest.approx(2 / np.sqrt(3), abs=1e-4)
    assert beyond.reached["x"] ** 3 - beyond.reached["x"] == pytest.approx(beyond.value + 1e-4)
    with pytest.raises(fs.ArgumentError, match="the branch exists on this side of LP"):
        fs.beyond_fold(model, fold, p, -0.1)


def test_a_corner():
    model = fs.Model({x: p + sp.Abs(x) - x**2, y: -y}, parameters={p: 0})
    diagram = fs.continue_equilibria(model, "p", over=(-0.2, 1))
    beyond = fs.beyond_fold(model, diagram.special("BE")[0], "p", 0.01)
    assert (beyond.remains, beyond.proved) == (False, True)
    assert beyond.reached["x"] == pytest.approx(0.5 + np.sqrt(0.25 + 1e-5), rel=1e-12)
    assert "non-smooth fold" in beyond.type
    with pytest.raises(fs.ArgumentError, match="at which the branch does not turn"):
        fs.beyond_fold(model, diagram.special("EP")[0], "p", 0.01)


def test_where_the_field_jumps_it_is_a_candidate():
    """A stable equilibrium and an escaping point vanish at p = 0, and x falls to −2."""
    model = fs.Model(
        {x: sp.Piecewise((-p - x, x > 0), (-1, x > -1), (-x - 2, True))}, parameters={p: -0.1}
    )
    diagram = fs.continue_equilibria(model, "p", over=(-0.5, 0.5))
    (fold,) = diagram.special("BE")
    beyond = fs.beyond_fold(model, fold, "p", 0.01)
    assert (beyond.remains, beyond.proved) == (False, False)
    assert beyond.reached["x"] == pytest.approx(-2)


def strobe_after_impacts(force, state):
    """State after 40 periods of a run by SciPy."""

    def field(time, state):
        return [state[1], force * np.cos(1.2 * time) - state[0] - state[1] / 10]

    def wall(time, state):
        return state[0] - 1

    wall.terminal, wall.direction = True, 1
    time, end = 0.0, 40 * 2 * np.pi / 1.2
    while time < end:
        run = solve_ivp(field, (time, end), state, events=wall, rtol=1e-10, atol=1e-12)
        time, state = run.t[-1], run.y[:, -1]
        if run.status == 1:
            state = state * [1, -0.8]
    return state


def test_a_grazing_fold_of_cycles():
    wall = {x >= 1: {v: -sp.Rational(4, 5) * v}}
    model = fs.Model({x: v, v: F * sp.cos(1.2 * t) - x - v / 10}, parameters={F: 0.45}, resets=wall)
    linear = 0.45 / complex(-0.44, 0.12)
    start = fs.find_orbit(model, [linear.real, (1.2j * linear).real])
    branch = fs.continue_orbits(start, "F", over=(0.44, 0.46), continuation=LARGE)
    touch = branch["GR1"]
    assert touch["F"] == pytest.approx(np.hypot(0.44, 0.12), rel=1e-12)
    assert touch.turns
    beyond = fs.beyond_fold(model, touch, "F", 0.005)
    assert (beyond.remains, beyond.proved) == (False, False)
    assert beyond.outcome.code == "tipping point"
    assert "orbit of period 5.23599" in repr(beyond)
    # an orbit with one impact, whose distance from the grazing one does not vanish
    assert beyond.away.min() > 0.1
    assert len(beyond.reached.trajectory.resets) == 1
    cycle = beyond.reached(0.0)
    expected = strobe_after_impacts(touch["F"] + 5e-6, cycle + 1e-3)
    np.testing.assert_allclose(cycle, expected, atol=1e-6)
    with pytest.raises(fs.ArgumentError, match="the branch exists on this side of GR1"):
        fs.beyond_fold(model, touch, "F", -0.005)
