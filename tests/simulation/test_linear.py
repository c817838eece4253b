"""Piecewise-linear systems, whose solution between crossings is known exactly."""

import math

import numpy as np
import pytest
import sympy as sp
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.linalg import expm

from fastslow.model.model import Model
from fastslow.simulation.one import simulate
from fastslow.simulation.settings import Integration

pytestmark = pytest.mark.slow

numbers = st.floats(-1.5, 1.5, allow_nan=False).map(lambda z: round(z, 3))
stiffness = st.floats(0.1, 30.0)


@given(k1=stiffness, k3=stiffness, gap=st.floats(0.01, 2.0), speed=st.floats(0.05, 3.0))
@settings(max_examples=30, deadline=None)
def test_free_flight_between_two_springs(linear, k1, k3, gap, speed):
    # half a period on each spring, constant speed between: every crossing in closed form
    model = linear.with_parameters(k1=k1, k3=k3, D=gap)
    flight, upper, lower = 2 * gap / speed, math.pi / math.sqrt(k1), math.pi / math.sqrt(k3)
    period = 2 * flight + upper + lower
    expected = np.cumsum([upper, flight, lower, flight] * 3)
    run = simulate(
        model, [gap, speed], t=(0, 3 * period - flight / 2), integration=Integration(rtol=1e-12)
    )
    times = [c.time for c in run.crossings]
    assert len(times) == 11
    assert times == pytest.approx(expected[:11], rel=1e-10)
    assert run.itinerary == (("S1", "S2", "S3", "S2") * 3)
    speeds = np.array([abs(c.state[1]) for c in run.crossings])
    assert np.abs(speeds / speed - 1).max() < 1e-10


def test_energy_and_period_of_the_oscillator_with_a_gap(linear):
    gap, amplitude = 0.25, 1.25
    run = simulate(
        linear, [amplitude, 0], t=(0, 400), integration=Integration(rtol=1e-14), samples=4001
    )
    x, v = run["x"], run["v"]
    outside = np.maximum(np.abs(x) - gap, 0)
    assert np.ptp(v**2 + outside**2) < 2e-12
    # T = 2 pi + 4 D / (a - D)
    period = 2 * math.pi + 4 * gap / (amplitude - gap)
    rises = [c.time for c in run.crossings if c.interface == "x - D" and c.direction > 0]
    assert np.diff(rises) == pytest.approx(period, abs=1e-12)


@pytest.fixture(scope="module")
def kinked():
    x, y = sp.symbols("x y")
    a, b, c, d, e, p, q, r, s = sp.symbols("a b c d e p q r s")
    right, top = sp.Max(x - 1, 0), sp.Max(y + sp.Rational(1, 2), 0)
    return Model(
        {x: a * x + b * y + p * right + q * top, y: c * x + d * y + e + r * right + s * top},
        parameters=dict.fromkeys((a, b, c, d, e, p, q, r, s), 0),
    )


def exact(values, signs, state, times):
    """The state after each time, by the matrix exponential of one region's affine field."""
    right, top = (signs[0] > 0), (signs[1] > 0)
    a, b, c, d, e, p, q, r, s = values
    field = np.array(
        [
            [a + p * right, b + q * top, -p * right + 0.5 * q * top],
            [c + r * right, d + s * top, e - r * right + 0.5 * s * top],
            [0.0, 0.0, 0.0],
        ]
    )
    return np.array([(expm(field * t) @ [*state, 1.0])[:2] for t in times])


@given(values=st.tuples(*[numbers] * 9), start=st.tuples(numbers, numbers))
@settings(max_examples=20, deadline=None)
def test_every_segment_is_the_exact_solution_in_its_region(kinked, values, start):
    model = kinked.with_parameters(dict(zip("abcdepqrs", values, strict=True)))
    run = simulate(model, start, t=(0, 4), integration=Integration(rtol=1e-13))
    assert run.outcome
    signs = {name: tuple(region.signs.values()) for name, region in model.regions.items()}
    state = np.array(start)
    for segment in run.segments:
        offsets = np.linspace(0, segment.duration, 9)
        solution = exact(values, signs[segment.region], state, offsets)
        size = 1 + np.abs(solution).max()
        assert np.abs(run(segment.start + offsets).T - solution).max() < 1e-11 * size
        for j, level in enumerate((1.0, -0.5)):
            h = (solution[1:-1, j] - level) * signs[segment.region][j]
            assert h.min() > -1e-11 * size
        state = run(segment.end)


def test_two_crossings_within_one_step():
    # x' = 1, so the whole run is one step; y = x**2 dips below 1e-6 for a thousandth
    x, y = sp.symbols("x y")
    model = Model({x: 1, y: 2 * x}, interfaces={"floor": y - sp.Rational(1, 10**6)})
    run = simulate(model, [-1, 1], t=(0, 2))
    assert [c.time for c in run.crossings] == pytest.approx([0.999, 1.001], abs=1e-12)
    assert len(run.steps) == 3


def test_grazing_is_a_touch():
    x, y = sp.symbols("x y")
    model = Model({x: 1, y: 2 * x}, interfaces={"floor": y})
    run = simulate(model, [-1, 1], t=(0, 2))
    assert run.itinerary == ("S1",)
    assert all(c.direction == 0 and c.tangential for c in run.crossings)
    assert run(2.0) == pytest.approx([1, 1], abs=1e-12)
    near = simulate(model, [-1, 1 + 1e-12], t=(0, 2))
    assert not near.crossings


def test_near_tangential_crossings_are_marked():
    x, y = sp.symbols("x y")
    model = Model({x: 1, y: 2 * x}, interfaces={"floor": y})
    run = simulate(model, [-1, 1 - 1e-9], t=(0, 2))
    assert [c.tangential for c in run.crossings] == [True, True]
    assert [c.time for c in run.crossings] == pytest.approx(
        [1 - 1e-9**0.5, 1 + 1e-9**0.5], abs=1e-11
    )
