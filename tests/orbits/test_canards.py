"""Maximal canards against asymptotic series and SciPy."""

import math

import numpy as np
import pytest
import sympy as sp
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

import fastslow as fs

pytestmark = pytest.mark.slow

x, y, z, a, b, c, eps = sp.symbols("x y z a b c epsilon")
v, w, current, t = sp.symbols("v w I t")


def van_der_pol(ratio):
    return fs.Model({x: (y - x**3 / 3 + x) / eps}, slow={y: a - x}, parameters={a: 1, eps: ratio})


@pytest.fixture(scope="module")
def canards():
    """The maximal canards of van der Pol's equation by the ratio of the rates."""
    found = {}
    for ratio in (1e-3, 2e-3, 5e-3, 1e-2, 2e-2, 5e-2):
        model = van_der_pol(ratio)
        (point,) = fs.slow_flow(model).points
        found[ratio] = fs.find_canard(model, point, "a")
    return found


def test_van_der_pol_against_its_series(canards):
    """a_c = 1 − ε/8 − 3ε²/32 − 173ε³/1024 + O(ε⁴) (Zvonkin and Shubin 1984; Algaba 2020)."""
    left = []
    for ratio, found in canards.items():
        series = 1 - ratio / 8 - 3 * ratio**2 / 32 - 173 * ratio**3 / 1024
        left.append((found.value - series) / ratio**4)
        assert found.outcome.code == "connected"
        assert found.evaluations <= 10
        assert found.slope == pytest.approx(math.sqrt(2 * math.pi * ratio), rel=2 * ratio)
    # the remainder is of fourth order: its coefficient has a limit, linear in ε
    assert left[0] == pytest.approx(left[1], abs=3e-3)
    slopes = np.diff(left) / np.diff(list(canards))
    assert np.ptp(slopes[1:]) < 0.5 * abs(slopes[1:].mean())
    assert -0.6 < min(left) < max(left) < -0.46


def test_accuracy_contains_what_is_left_of_the_starts(canards):
    assert max(found.accuracy for ratio, found in canards.items() if ratio < 0.05) < 1e-14
    # the repelling sheet ends at the other fold: K ≤ 4/(3ε)
    last = canards[0.05]
    assert 26 < last.contraction < 4 / (3 * 0.05)
    assert 1e-11 < last.accuracy < 1e-10
    assert f"{last.accuracy:.2g}" in repr(last)


def test_sections_do_not_matter(canards):
    """At another section through the fold region, and across both states."""
    model = van_der_pol(0.01)
    (point,) = fs.slow_flow(model).points
    for section in ("x - 0.95", "x - 1.05 + (y + 2/3)/2"):
        found = fs.find_canard(model, point, a, section=section)
        assert found.value == pytest.approx(canards[0.01].value, abs=5e-15)


def test_canard_is_a_solution_from_sheet_to_sheet(canards):
    found = canards[0.01]
    table = found.to_dict()
    assert table["t"][0] < 0 < table["t"][-1]
    left, right = (table[name][table["sheet"] == "attracting"] for name in ("x", "y"))
    assert np.abs(right - left**3 / 3 + left).max() < 0.03
    assert left[-1] == pytest.approx(1.0, abs=1e-14)
    below, height = (table[name][table["sheet"] == "repelling"] for name in ("x", "y"))
    assert np.abs(height - below**3 / 3 + below).max() < 0.03
    assert height[0] == pytest.approx(right[-1], abs=2e-15)
    assert (np.diff(below) < 0).all()


def scipy_gap(ratio, value, starts):
    """Gap of the slow manifolds of FitzHugh and Nagumo's model on v = −1, by SciPy's Radau."""
    ends = []
    for start, way in zip(starts, (1, -1), strict=True):

        def rates(_, u, way=way):
            fast = u[0] - u[0] ** 3 / 3 - u[1] + value
            return [way * fast / ratio, way * (u[0] + 0.7 - 0.8 * u[1])]

        event = lambda _, u: u[0] + 1  # noqa: E731
        event.terminal = True
        begin = start, start - start**3 / 3 + value
        run = solve_ivp(rates, (0, 100), begin, "Radau", rtol=1e-10, atol=1e-13, events=event)
        ends.append(run.y_events[0][0, 1])
    return ends[0] - ends[1]


def test_fitzhugh_nagumo():
    """Against SciPy, and the value to first order, from which it differs by c₂ε² + c₃ε³ + …"""
    errors = []
    for ratio in (0.04, 0.01, 0.02):
        model = fs.Model(
            {v: (v - v**3 / 3 - w + current) / eps},
            slow={w: v + 0.7 - 0.8 * w},
            parameters={current: 0.3, eps: ratio},
        )
        point = next(
            p
            for p in fs.slow_flow(model, parameter="I").points
            if p.canard is not None and p.values["v"] < 0
        )
        found = fs.find_canard(model, point, "I")
        assert found.outcome.code == "connected"
        errors.append((found.value - point.canard.canard) / ratio**2)
    slopes = (errors[0] - errors[2]) / 0.02, (errors[2] - errors[1]) / 0.01
    assert slopes[0] == pytest.approx(slopes[1], rel=0.1)
    assert abs(errors[1]) < 2e-3
    close = 2e-7
    reference = brentq(
        lambda value: scipy_gap(0.02, value, (-1.6, -0.4)), found.value - close, found.value + close
    )
    assert found.value == pytest.approx(reference, abs=3e-9)


def test_bad_input():
    model = van_der_pol(0.01)
    (point,) = fs.slow_flow(model).points
    with pytest.raises(fs.UnknownNameError, match="unknown parameter 'b'"):
        fs.find_canard(model, point, "b")
    with pytest.raises(fs.ArgumentError, match="the canard point is one in a"):
        fs.find_canard(model, point, "epsilon")
    with pytest.raises(fs.ArgumentError, match="missed by both slow manifolds"):
        fs.find_canard(model, point, "a", section="x - 40")
    with pytest.raises(fs.ArgumentError, match="across the fast direction"):
        fs.find_canard(model, point, "a", section="y")
    near = van_der_pol(1.0)
    with pytest.raises(fs.ArgumentError, match="rates are not separated"):
        fs.find_canard(near, fs.slow_flow(near).points[0], "a")
    frozen = fs.Model({x: y - x**2}, parameters={y: 1, a: 1})
    with pytest.raises(fs.ArgumentError, match="no slow state"):
        fs.find_canard(frozen, point, "a")
    two = fs.Model({x: y - x**2, z: -z}, slow={y: a - x}, parameters={a: 1})
    with pytest.raises(fs.ArgumentError, match="2 fast and 1 slow states"):
        fs.find_canard(two, point, "a")
    repelling = fs.Model({x: -(y - x**2)}, slow={y: x - a}, parameters={a: 0})
    (turned,) = fs.slow_flow(repelling).points
    if turned.canard is None:
        with pytest.raises(fs.ArgumentError, match="expected a canard point"):
            fs.find_canard(repelling, turned, "a")
