"""Corner collisions: closed forms, both sides against SciPy, and what has no orbit beyond."""

from functools import cache

import numpy as np
import pytest
import sympy as sp
from scipy.linalg import expm

import fastslow as fs
from fastslow.results.point_types import NON_SMOOTH_FOLD
from tests.campaigns.corners import Report, check, drawn

pytestmark = pytest.mark.slow

x, v, w, t = sp.symbols("x v w t")


def square(height, period, share):
    """A square wave with ±height, begun at +height."""
    return height * (2 * (sp.floor(t / period) - sp.floor(t / period - sp.Rational(share))) - 1)


def below(rate, level, force, share, period=2.0):
    """The w at which the largest x of x' = w - rate x ± force, at an instant, is the level."""
    one, two = np.exp(-rate * share * period), np.exp(-rate * (1 - share) * period)
    swing = 2 * force / rate
    high = -force / rate + swing * (1 - one) / (1 - one * two)
    return rate * (level - high)


def above(rate, level, force, share, period=2.0):
    """The w at which the smallest x of x' = w - level - rate (x - level) ± force is the level."""
    one, two = np.exp(-rate * share * period), np.exp(-rate * (1 - share) * period)
    swing = 2 * force / rate
    low = force / rate - swing * (1 - two) / (1 - one * two)
    return level - rate * low


class TestLinearBelowTheLevel:
    """x' = w − x ± F below x = D, so that the touch at an instant is known in closed form."""

    def test_a_spring_beyond(self):
        D, F, share = 0.7, 0.9, 0.4
        stop = sp.Piecewise((3 * (x - D), x > D), (0, True))
        model = fs.Model({x: w - x - stop + square(F, 2, "2/5")}, parameters={w: -1})
        branch = fs.continue_orbits(fs.find_orbit(model, [0]), "w", over=(-1, 2))
        first, last = branch.special("CC")
        assert first["w"] == pytest.approx(below(1.0, D, F, share), abs=1e-14)
        assert last["w"] == pytest.approx(above(4.0, D, F, share), abs=1e-13)
        for point in (first, last):
            assert (point.type, point.exponent) == ("transition", 2.0)
            assert point.interface.endswith("and instant")
            np.testing.assert_allclose(point.state, [D], atol=1e-15)
            np.testing.assert_allclose(point.multipliers, point.multipliers_beyond, rtol=1e-10)
        np.testing.assert_allclose(first.multipliers, np.exp(-2.0), rtol=1e-13)
        assert branch.range == (-1.0, 2.0)

    def test_sliding_beyond(self):
        D, F, h = 0.7, 0.9, 0.8
        model = fs.Model(
            {x: w - x - h * sp.sign(x - D) + square(F, 2, "2/5")}, parameters={w: -1.9}
        )
        branch = fs.continue_orbits(fs.find_orbit(model, [0]), "w", over=(-2, 0.3))
        (point,) = branch.special("CC")
        assert point["w"] == pytest.approx(below(1.0, D, F, 0.4) - h, abs=1e-14)
        np.testing.assert_allclose(point.multipliers, np.exp(-2.0), rtol=1e-13)
        assert (point.type, point.exponent) == ("transition", 1.0)
        np.testing.assert_array_equal(point.multipliers_beyond, [0.0])

    def test_a_force_that_carries_on(self):
        D, F = 0.7, 0.9
        push = sp.Piecewise((2.5, x > D), (0, True))
        model = fs.Model({x: w - x + push + square(F, 2, "2/5")}, parameters={w: -1})
        branch = fs.continue_orbits(fs.find_orbit(model, [0]), "w", over=(-1, 2))
        (point,) = branch.special("CC")
        assert point["w"] == pytest.approx(below(1.0, D, F, 0.4), abs=1e-14)
        assert (point.type, point.exponent) == ("", 0.0)
        assert branch.outcomes[1].code == "end at a contact"
        assert "corner collision" in branch.outcomes[1].message


@cache
def gear_branch():
    """Orbits of x'' + c x' + k(t) f(x) = w with a rectangular stiffness, f a dead zone."""
    T, D = 2.5 * np.pi, 0.5
    gap = sp.Piecewise((x - D, x > D), (x + D, x < -D), (0, True))
    model = fs.Model({x: v, v: w - v / 10 - (1 + square(0.4, T, "3/5")) * gap}, parameters={w: 1})
    return fs.continue_orbits(fs.find_orbit(model, [1.5, 0]), "w", over=(0.05, 1))


def test_the_branch_of_a_gear_pair_reaches_both_ends():
    branch = gear_branch()
    assert [one.code for one in branch.outcomes] == ["end of range", "end of range"]
    assert len(branch.special("CC")) == 3
    for point in branch.special("CC"):
        assert (point.type, point.exponent) == ("transition", 2.0)
        assert point.interface in ("2*x - 1 and instant", "2*x + 1 and instant")
        assert abs(abs(point.state[0]) - 0.5) < 1e-14
        np.testing.assert_allclose(
            np.sort_complex(point.multipliers), np.sort_complex(point.multipliers_beyond), rtol=1e-9
        )
    assert not branch.unexplained


def test_rows_on_both_sides_have_one_orbit():
    branch = gear_branch()
    for point, row in zip(branch.special, branch.special_rows, strict=True):
        if point.code == "CC":
            same = np.flatnonzero(branch.values == point["w"])
            one, two = (branch[int(k)] for k in same)
            np.testing.assert_allclose(one(0.0), two(0.0), atol=1e-12)
            assert row in same


@pytest.mark.sample(2)
@pytest.mark.parametrize(("seed", "number"), [(1, 1), (1, 4), (1, 6), (1, 9), (1, 12), (2, 38)])
def test_random_models_against_scipy(seed, number):
    # python -m tests.campaigns corners 100: closed to 1e-11, multipliers to 1e-5 of differences
    report = Report(seed)
    check(report, drawn(seed, number), number, limit=1)
    assert report.branches == 1
    assert not report.failures
    assert not report.ended


def test_a_corner_may_turn_the_branch():
    # an impact oscillator, whose impact meets the fall of the load
    D, T = 0.323, 4.34
    model = fs.Model(
        {x: v, v: w - 0.101 * v - x + square(0.522, T, "681/1000")},
        parameters={w: -0.463},
        resets={x >= D: {v: -0.487 * v}},
    )
    branch = fs.continue_orbits(fs.find_orbit(model, [0, 0]), "w", over=(-1.3, -0.3))
    (point,) = (one for one in branch.special("CC") if one.turns)
    assert point.type == NON_SMOOTH_FOLD
    assert point.exponent == 1.0
    # det(I - M) changes its sign where a branch of a piecewise linear map turns
    before, beyond = (
        np.prod(1 - values).real for values in (point.multipliers, point.multipliers_beyond)
    )
    assert before * beyond < 0
    # by the linear motion: from the impact at the fall of the load back to it
    jump = np.diag([1.0, -0.487])
    A = np.array([[0.0, 1.0], [-1.0, -0.101]])
    speed = point.state[1]
    rest = D, -0.487 * speed

    def after(state, shift, time):
        centre = np.array([point["w"] + shift, 0.0])
        return centre + expm(A * time) @ (state - centre)

    closed = after(after(np.array(rest), -0.522, 0.319 * T), 0.522, 0.681 * T)
    np.testing.assert_allclose(closed, [D, speed], atol=1e-12)
    assert (jump @ [D, speed] == rest).all()


def test_knots_of_a_smooth_table_are_passed_without_a_point():
    times = np.linspace(0, 6, 7)
    values = np.cos(2 * np.pi * times / 6)
    load = fs.Tabulated(times, values, interpolation="cubic", periodic=True)
    stop = sp.Piecewise((3 * (x - sp.Rational(1, 2)), x > sp.Rational(1, 2)), (0, True))
    model = fs.Model({x: w - x - stop + sp.Symbol("F")}, forcing={"F": load}, parameters={w: 0})
    branch = fs.continue_orbits(fs.find_orbit(model, [0]), "w", over=(-1, 2))
    assert branch.range == (-1.0, 2.0)
    assert not branch.special("CC")
