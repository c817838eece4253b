"""Canard cycles by two-sided shooting, against other methods."""

import math

import numpy as np
import pytest
import sympy as sp
from scipy.integrate import quad

import fastslow as fs

pytestmark = pytest.mark.slow

x, y, a, eps = sp.symbols("x y a epsilon")


def van_der_pol(ratio):
    return fs.Model({x: (y - x**3 / 3 + x) / eps}, slow={y: a - x}, parameters={a: 1, eps: ratio})


def canard_of(model):
    (point,) = fs.slow_flow(model).points
    return fs.find_canard(model, point, "a")


@pytest.fixture(scope="module")
def explosion():
    model = van_der_pol(0.01)
    return model, canard_of(model)


def test_small_cycles_are_those_of_shooting_at_the_same_parameter(explosion):
    """Where the parameter determines the cycle, find_orbit from a state finds it too."""
    model, canard = explosion
    cycle = fs.find_orbit(model, canard, at={y: -0.62})
    value = cycle.trajectory.parameters["a"]
    assert value - canard.value > 1e-6
    again = fs.find_orbit(model.with_parameters(a=value), cycle(0.0))
    assert cycle.period == pytest.approx(again.period, rel=1e-9)
    assert cycle["max(y)"] == pytest.approx(-0.62, abs=1e-12)
    assert cycle.log_multipliers[1] == pytest.approx(again.log_multipliers[1], rel=1e-6)
    assert "does not determine" not in str(cycle.outcome)


@pytest.mark.parametrize("at", [{"y": 0.0}, {"y": 0.4}, {"x": -1, "y": 0.2}, {"x": -1, "y": -0.4}])
def test_cycles_of_all_heights_share_the_parameter_to_the_last_bits(explosion, at):
    model, canard = explosion
    cycle = fs.find_orbit(model, canard, at=at)
    assert cycle.outcome
    assert abs(cycle.trajectory.parameters["a"] - canard.value) < 1e-14
    assert max(cycle.residual, cycle.accuracy) < 1e-11
    assert abs(cycle.log_multipliers[0]) < 1e-10
    head = "x" in at
    assert (cycle["min(x)"] < -1) == head
    if not head:
        assert cycle["max(y)"] == pytest.approx(at["y"], abs=1e-12)
        assert "does not determine the height" in str(cycle.outcome)
    # log μ = ∮ div dt, by the trapezoidal rule along the dense output
    t = np.linspace(*cycle.trajectory.span, 400_001)
    fast = cycle.trajectory(t)[0]
    trace = np.trapezoid((1 - fast**2) / 0.01, t)
    assert cycle.log_multipliers[1] == pytest.approx(trace, rel=1e-6)


def test_period_is_that_of_the_slow_pieces_to_first_order():
    """∫ dy/g along both sheets up to the height, y' = a − x with x of y = x³/3 − x."""
    errors = []
    for ratio in (4e-3, 1e-3):
        model = van_der_pol(ratio)
        cycle = fs.find_orbit(model, canard_of(model), at={y: 0.2})
        ends = np.sort(np.roots([1 / 3, 0, -1, -0.2]).real)[1:]
        slow, _ = quad(lambda v: (v**2 - 1) / (v - 1) if v != 1 else 2.0, *ends)
        errors.append(cycle.period / abs(slow) - 1)
    assert abs(errors[1]) < 5e-3
    assert 2.5 < errors[0] / errors[1] < 6


def test_branch_through_the_explosion_contains_the_cycles(explosion):
    """Continuation steps in the orbit: its parameter is constant to rounding along canards."""
    model, canard = explosion
    start = fs.find_orbit(model, canard, at={y: -0.4})
    settings = fs.Continuation(max_points=60)
    branch = fs.continue_orbits(start, "a", over=(0.9985, 0.9990), continuation=settings)
    height = branch["max(y)"]
    assert np.ptp(height) > 0.2
    assert np.abs(branch.values - canard.value)[height > -0.4].max() < 1e-12
    assert "a = 0.99874045124" in str(branch.outcomes[1])
    assert "is constant to rounding along" in str(branch.outcomes[1])
    row = int(np.argmax(height))
    cycle = fs.find_orbit(model, canard, at={y: float(height[row])})
    assert cycle.period == pytest.approx(float(branch.period[row]), rel=1e-9)


def test_bad_input(explosion):
    model, canard = explosion
    with pytest.raises(fs.ArgumentError, match="required with a canard"):
        fs.find_orbit(model, canard)
    with pytest.raises(fs.ArgumentError, match="required with a canard"):
        fs.find_orbit(model, [1.0, 0.0], at={y: 0})
    with pytest.raises(fs.UnknownNameError, match="unknown state 'z'"):
        fs.find_orbit(model, canard, at={"z": 0})
    with pytest.raises(fs.ArgumentError, match="height of the cycle as a value of y"):
        fs.find_orbit(model, canard, at={"x": 0})
    with pytest.raises(fs.ArgumentError, match="the canard is one at epsilon"):
        fs.find_orbit(van_der_pol(0.02), canard, at={y: 0})
    above = fs.find_orbit(model, canard, at={y: 2.0})
    assert not above.outcome
    assert math.isfinite(above.period)
