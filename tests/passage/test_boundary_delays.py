"""Lags, non-smooth folds and gaps, against closed forms and SciPy."""

import math

import mpmath
import numpy as np
import pytest
import sympy as sp
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

import fastslow as fs
from fastslow.passage.delays import interface_passages
from fastslow.passage.delays.laws.boundary_delays import boundary_delay
from fastslow.passage.delays.laws.gap_crossings import gap_crossing

pytestmark = pytest.mark.slow


def corner_point(model):
    return fs.continue_equilibria(model, "p", over=(-1, 1)).boundary_equilibria[0]


@pytest.mark.parametrize(("eps", "value"), [(0.01, 0.0497000894), (0.001, 0.0072227973)])
def test_the_corner_of_the_absolute_value(corner, eps, value):
    """p = ε (1 + ln((x + p + ε)/(2ε))) at x = 1, to all digits that are given and to 1e-15."""
    law = boundary_delay(corner_point(corner), eps, level={"x": 1})
    assert round(law.delay, 10) == value
    known = mpmath.findroot(lambda d: eps * (1 + mpmath.log((1 + d + eps) / (2 * eps))) - d, value)
    assert law.delay == pytest.approx(float(known), abs=1e-15)
    assert law.lag == pytest.approx(eps, abs=1e-16)
    assert "exact" in law.validity


@settings(max_examples=25)
@given(
    k=st.floats(-5, -0.2),
    u=st.floats(0.2, 5),
    b=st.sampled_from([-2.0, -0.5, 0.5, 3.0]),
    eps=st.floats(1e-6, 0.05),
    level=st.floats(0.1, 10),
)
def test_any_corner_in_one_dimension(corner, k, u, b, eps, level):
    """x = −b p/u − b ε/u² + C e^(u t) behind the corner, entered at t = 1/|k|."""
    point = corner_point(corner.with_parameters(k=k, u=u, b=b))
    rate = math.copysign(eps, b)
    law = boundary_delay(point, rate, level={"x": level})
    start = abs(b) * eps / u * (1 / abs(k) + 1 / u)
    t = law.delay_time

    def state(time):
        grown = start * mpmath.exp(u * (time - 1 / abs(k)))
        return grown - abs(b) * eps * time / u - abs(b) * eps / u**2

    assert float(state(t)) == pytest.approx(level, rel=1e-9)
    assert law.lag == pytest.approx(eps / abs(k), rel=1e-12)
    assert (law.stable, law.unstable) == pytest.approx((k, u), rel=1e-12)


def test_persistence_is_a_lag(corner):
    both = corner.with_parameters(k=-1, u=-3)
    law = boundary_delay(corner_point(both), 0.01)
    assert law.type == "persistence"
    assert law.delay == law.lag == pytest.approx(0.01, rel=1e-13)
    back = boundary_delay(corner_point(both), -0.01)
    assert back.delay == pytest.approx(0.01 / 3, rel=1e-13)
    assert back.value == -back.delay
    assert "no delay but a lag" in law.validity


def test_two_states_against_scipy():
    """x' = p + |x| + y, y' = x/2 − 2y, and its mirror image in the drift."""
    x, y, p = sp.symbols("x y p")
    model = fs.Model({x: p + sp.Abs(x) + y, y: x / 2 - 2 * y}, parameters={p: -1})
    point = corner_point(model)
    assert point.type == "non-smooth fold"
    law = boundary_delay(point, 0.003, level={"y": 0.2})
    before = np.array([[-1.0, 1.0], [0.5, -2.0]])
    first = -np.linalg.solve(before, [1.0, 0.0])
    start = first * -0.5 + np.linalg.solve(before, first) * 0.003

    def rates(t, z):
        return [-0.5 + 0.003 * t + abs(z[0]) + z[1], z[0] / 2 - 2 * z[1]]

    def corner_hit(t, z):
        return z[0]

    def level_hit(t, z):
        return z[1] - 0.2

    corner_hit.terminal = level_hit.terminal = True
    settings = {"rtol": 1e-13, "atol": 1e-15, "method": "DOP853"}
    one = solve_ivp(rates, (0, 400), start, events=corner_hit, **settings)
    assert law.lag == pytest.approx(-0.5 + 0.003 * one.t[-1], abs=1e-11)
    other = solve_ivp(rates, (one.t[-1], 900), one.y[:, -1], events=level_hit, **settings)
    assert law.delay == pytest.approx(-0.5 + 0.003 * other.t[-1], abs=1e-11)


def test_a_level_that_is_not_reached(corner):
    law = boundary_delay(corner_point(corner), 0.01, level={"x": -1})
    assert math.isnan(law.delay)
    assert "does not reach the level" in law.validity
    assert "nan" in repr(law)


def test_a_passage_through_more_regions_than_are_followed_ends_there(monkeypatch):
    """Behind the corner at 0 the rate is p + x, and from x = 1/2 on p + 2 x − 1/2."""
    x, p = sp.symbols("x p")
    faster = sp.Piecewise((x - sp.Rational(1, 2), x > sp.Rational(1, 2)), (0, True))
    model = fs.Model({x: p + sp.Abs(x) + faster}, parameters={p: -1})
    points = fs.continue_equilibria(model, "p", over=(-1, 1)).boundary_equilibria
    (point,) = (b for b in points if b["x"] == 0)
    near, far = (boundary_delay(point, 0.01, level={"x": level}) for level in (0.5, 1))
    assert near.delay < far.delay < near.delay + 0.01 * math.log(2)
    monkeypatch.setattr(interface_passages, "REGIONS_CROSSED", 1)
    law = boundary_delay(point, 0.01, level={"x": 1})
    assert math.isnan(law.delay)
    assert "does not reach the level" in law.validity


def test_a_level_on_the_interface(corner):
    """Reached when the interface is, with the lag."""
    law = boundary_delay(corner_point(corner), 0.01, level={"x": 0})
    assert law.delay == law.lag


def test_wrong_boundary_points(corner, gap, cusp_fold):
    point = corner_point(corner)
    with pytest.raises(fs.ArgumentError, match=r"with p falling no stable branch ends at BE1"):
        boundary_delay(point, -0.01, level={"x": 1})
    with pytest.raises(fs.ArgumentError, match="give level="):
        boundary_delay(point, 0.01)
    with pytest.raises(fs.ArgumentError, match=r"degenerate .* received BE1, non-smooth"):
        gap_crossing(point, 0.01)
    with pytest.raises(fs.ArgumentError, match="requires a point BE"):
        boundary_delay(cusp_fold, 0.01)
    upper = gap_point(gap, 1)
    with pytest.raises(fs.ArgumentError, match="a degenerate one; see gap_crossing"):
        boundary_delay(upper, -0.01)
    unstable = corner_point(corner.with_parameters(k=1, u=2))
    with pytest.raises(fs.ArgumentError, match="before the interface an eigenvalue has real part"):
        boundary_delay(unstable, 0.01)


def test_a_flat_corner_is_no_gap(corner):
    """x' = p + k x below, p above: a continuum at p = 0 that has no other end."""
    flat = corner.with_parameters(u=0)
    diagram = fs.continue_equilibria(flat, "p", over=(-1, 1))
    point = next(p for p in diagram.boundary_equilibria if p.type == "degenerate")
    with pytest.raises(fs.ArgumentError, match="ends at no other interface"):
        gap_crossing(point, 0.01)


def test_a_filippov_corner_has_another_law():
    x, p = sp.symbols("x p")
    model = fs.Model({x: p + sp.Piecewise((1, x > 0), (-x, True))}, parameters={p: -1})
    points = fs.continue_equilibria(model, "p", over=(-1.5, 1)).boundary_equilibria
    with pytest.raises(fs.ArgumentError, match="one of a Filippov field"):
        boundary_delay(points[0], 0.01)


def gap_point(model, side):
    diagram = fs.continue_equilibria(model, "w", over=(-1, 1))
    return next(p for p in diagram.boundary_equilibria if side * p["x"] > 0)


def gap_state(t, s, c, k, width):
    """x in the gap with x'' + c x' = −s t, in closed form, from the lagging contact x = D + …"""
    start = c / k
    # on the contact x − D = −(s t)/k + s c/k², which leaves at t = c/k with v = −s/k
    speed = -s / k
    u = mpmath.mpf(t) - start

    # v' = −c v − s (start + u)
    def particular(w):
        return -s * (start + w) / c + s / c**2

    rest = speed - particular(0)
    moved = rest * (1 - mpmath.exp(-c * u)) / c - s * (start * u + u**2 / 2) / c + s * u / c**2
    return width + moved


@pytest.mark.parametrize(("c", "k", "width", "s"), [(1, 4, 0.25, 1e-3), (0.4, 2, 0.1, 0.02)])
def test_the_gap_in_closed_form(gap, c, k, width, s):
    law = gap_crossing(gap_point(gap.with_parameters(c=c, k=k, D=width), 1), -s)
    assert law.lag == pytest.approx(s * c / k, rel=1e-12)
    end = mpmath.findroot(lambda t: gap_state(t, s, c, k, width) + width, law.delay_time)
    assert law.delay_time == pytest.approx(float(end), rel=1e-12)
    assert law.asymptotic == pytest.approx(2 * math.sqrt(c * width * s) + s / c, rel=1e-12)
    assert (law.length, law.relaxation) == pytest.approx((2 * width, 1 / c), rel=1e-12)
    assert law.interfaces == ("x - D", "x + D")
    assert law.duration == pytest.approx(law.delay_time - c / k, rel=1e-12)


def test_a_gap_that_moves_with_the_load():
    """Between x = ±D + m w, w = −s t, the body lags by s/c² and the far contact comes by m s t.

    D + s t/c² − s t²/(2c) = −D − m s t gives the slow limit t = √(4cD/s) + 1/c + c m.
    """
    x, v, w = sp.symbols("x v w")
    c, k, m, width = 0.5, 4.0, 0.3, 0.25
    u = x - m * w
    contact = sp.Piecewise((u - width, u > width), (u + width, u < -width), (0, True))
    model = fs.Model({x: v, v: w - c * v - k * contact}, parameters={w: 0})
    s = 1e-6
    law = gap_crossing(gap_point(model, 1), -s)
    assert law.relaxation == pytest.approx(1 / c + c * m, rel=1e-12)
    assert law.asymptotic == pytest.approx(2 * math.sqrt(c * width * s) + s * law.relaxation)
    # what is left out is smaller by √s
    assert law.delay == pytest.approx(law.asymptotic, abs=s * 0.02)


def test_the_gap_is_the_same_from_both_sides(gap):
    down, up = gap_crossing(gap_point(gap, 1), -0.01), gap_crossing(gap_point(gap, -1), 0.01)
    assert up.delay == pytest.approx(down.delay, rel=1e-13)
    assert up.interfaces == down.interfaces[::-1]
    assert up.value == pytest.approx(-down.value, rel=1e-13)
    with pytest.raises(fs.ArgumentError, match="with w rising no stable branch"):
        gap_crossing(gap_point(gap, 1), 0.01)


def test_a_drift_along_the_interface(gap):
    """As D changes so does the contact, and without load the body stays at it."""
    point = gap_point(gap, 1)
    for rate in (0.01, -0.01):
        with pytest.raises(fs.ArgumentError, match="a drift of D keeps the equilibrium at BE2 on"):
            gap_crossing(point, rate, parameter="D")


def test_the_law_of_the_gear_under_its_sine(gear):
    """Δt − 1 goes as s^(−1/2) and Δw = s Δt is 2√(Ds) + s within 1 %, s the slope at zero load.

    The sine bends meanwhile, by 5 % of its slope at ω = 0.005.
    """
    speeds, times, changes = [], [], []
    for omega in (0.005, 0.002, 0.001, 0.0005):
        slow = gear.with_parameters(omega=omega)
        mean, swing = slow.parameters["B"], slow.parameters["C"]
        falls = (math.pi + math.asin(mean / swing)) / omega
        run = fs.simulate(
            slow, [0.3, 0], t=(0.8 * falls, 1.4 * falls), integration=fs.Integration(rtol=1e-12)
        )
        left = next(c for c in run.crossings if c.interface == "x - D" and c.time > 0.99 * falls)
        met = next(c for c in run.crossings if c.interface == "x + D" and c.time > left.time)
        speeds.append(omega * math.sqrt(swing**2 - mean**2))
        times.append(met.time - left.time)
        changes.append(speeds[-1] * times[-1])
    exponent = np.polyfit(np.log(speeds), np.log(np.array(times) - 1), 1)[0]
    assert exponent == pytest.approx(-0.5, abs=0.005)
    for s, change in zip(speeds, changes, strict=True):
        assert change == pytest.approx(2 * math.sqrt(0.25 * s) + s, rel=0.01)
    diagram = fs.continue_equilibria(gear.frozen(), "w", over=(-1, 1))
    upper = next(p for p in diagram.boundary_equilibria if p["x"] > 0)
    for s, time in zip(speeds, times, strict=True):
        assert gap_crossing(upper, -s).duration == pytest.approx(time, rel=0.01)
