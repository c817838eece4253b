"""Regimes of a gap: plain and degenerate cases, against what the motion in closed form does."""

import numpy as np
import pytest
import sympy as sp
from scipy.integrate import solve_ivp

import fastslow as fs
from fastslow.results.trajectory.long_time.regimes import REGIMES, in_words

pytestmark = pytest.mark.slow

x, v, w, t = sp.symbols("x v w t")
D, k, a, B, C, omega = sp.symbols("D k a B C omega")


def regime(model, state, **keywords):
    """The regime of a trajectory, the same alone and among many."""
    run = fs.simulate(model, state, **keywords)
    many = fs.simulate_many(model, state, **keywords)
    assert many.regime[0] == (run.regime or "")
    if run.regime is not None:
        kinds = run.regimes().types
        assert tuple(REGIMES[bits] for bits in many.touched[0]) == kinds
        shares = {name: share[0] for name, share in many.fractions.items()}
        assert shares == pytest.approx(run.regimes().fractions)
    return run.regime


def last(model, state, **keywords):
    """The regime of the last period of a trajectory."""
    regime(model, state, **keywords)
    return fs.simulate(model, state, **keywords).regimes().types[-1]


@pytest.fixture(scope="module")
def falling():
    """A body under a constant pull a between two springs: parabolas in the gap."""
    f = sp.Piecewise((x - D, x > D), (x + D, x < -D), (0, True))
    return fs.Model({x: v, v: -a - k * f}, parameters={D: 0.5, k: 4, a: 1})


@pytest.mark.parametrize("seed", range(4))
def test_as_the_extremes_of_an_independent_integration_say(gear, seed):
    random = np.random.default_rng(seed)
    p = {
        "B": random.uniform(-2, 2),
        "C": random.uniform(0.5, 5),
        "D": random.uniform(0.05, 1.5),
        "omega": random.uniform(0.3, 1.2),
    }
    A, period = gear.parameters["A"], 2 * np.pi / p["omega"]

    def rates(time, y):
        f = y[0] - np.clip(y[0], -p["D"], p["D"])
        load = p["B"] + p["C"] * np.sin(p["omega"] * time)
        return [y[1], load - y[1] - (y[0] ** 2 + A) * f]

    times = np.linspace(3 * period, 4 * period, 20_000)
    # the rates have corners at ±D, which a small step passes well enough
    found = solve_ivp(
        rates, (0, 4 * period), [0, 0], rtol=1e-9, atol=1e-9, max_step=0.05, t_eval=times
    )
    heights = found.y[0] / p["D"]
    assert np.abs(np.abs([heights.min(), heights.max()]) - 1).min() > 1e-4
    lower, upper = heights.min() < -1, heights.max() > 1
    inside = np.any(np.abs(heights) < 1)
    if lower and upper:
        expected = "bilateral"
    elif lower or upper:
        expected = ("unilateral " if inside else "meshed ") + ("upper" if upper else "lower")
    else:
        expected = "free"
    assert regime(gear.with_parameters(p), [0, 0], periods=4) == expected


def test_grazing(falling):
    # thrown up from the middle, it turns at v²/2
    span = {"t": (0, 1.5), "period": 1.5}
    for side, word in ((1, "upper"), (-1, "lower")):
        model = falling.with_parameters(a=side)
        assert regime(model, [0, side * (1 - 1e-9)], **span) == "free"
        assert regime(model, [0, side * (1 + 1e-9)], **span) == f"unilateral {word}"
        # exactly on it rounding decides, and every crossing says so
        run = fs.simulate(model, [0, side], **span)
        assert regime(model, [0, side], **span) in {"free", f"unilateral {word}"}
        assert all(c.tangential for c in run.crossings)


def test_contact_in_the_last_and_in_the_first_instant(falling):
    still = falling.with_parameters(a=0)
    # straight flight at speed 1 from 0 reaches 1/2 at t = 1/2
    assert regime(still, [0, 1], t=(0, 0.5), period=0.5) == "free"
    assert regime(still, [0, 1], t=(0, 0.5 + 1e-9), period=0.5) == "unilateral upper"
    assert regime(still, [0, -1], t=(0, 0.5 + 1e-9), period=0.5) == "unilateral lower"
    assert regime(still, [0.5, -1], t=(0, 0.5), period=0.5) == "free"
    assert regime(still, [0.5, 1], t=(0, 0.5), period=0.5) == "meshed upper"
    # half an oscillation of frequency 2 in the contact, then back through the gap
    there = np.pi / 2
    assert last(still, [0.5, 1], t=(0, there + 0.5), period=0.5 - 1e-6) == "free"
    assert last(still, [0.5, 1], t=(0, there + 0.5), period=0.5 + 1e-6) == "unilateral upper"
    assert regime(still, [0.5, 1], t=(0, there + 0.5), period=0.5 - 1e-6) == "not settled"


def test_rest_and_small_motion(falling):
    # pressed on by a = 1 it rests 1/4 below the lower edge
    assert regime(falling, [-0.75, 0], t=(0, 9), period=3) == "meshed lower"
    assert regime(falling, [-0.75, 0.1], t=(0, 9), period=3) == "meshed lower"
    assert regime(falling, [-0.75, 0.6], t=(0, 9), period=4) == "unilateral lower"
    still = falling.with_parameters(a=0)
    assert regime(still, [0.2, 0], t=(0, 9), period=3) == "free"
    # at a corner without load it counts to the region that the run names
    for corner in (0.5, -0.5):
        (name,) = fs.simulate(still, [corner, 0], t=(0, 9)).itinerary
        expected = {"S1": "meshed upper", "S2": "free", "S3": "meshed lower"}[name]
        assert regime(still, [corner, 0], t=(0, 9), period=3) == expected


def test_without_a_gap_there_is_no_regime(falling):
    for width in (0.0, -0.2):
        assert regime(falling.with_parameters(D=width, a=0), [1, 0], t=(0, 1), period=1) is None
    assert regime(falling, [0, 0], t=(0, 1)) is None


def test_edges_written_with_different_factors():
    f = sp.Piecewise((x - D, x > D), (x + D / 2, 2 * x < -D), (0, True))
    model = fs.Model({x: v, v: -a - k * f}, parameters={D: 0.5, k: 4, a: 0})
    assert fs.simulate(model, [0, 1], t=(0, 9), period=9).regime == "bilateral"
    assert regime(model, [0.2, 0], t=(0, 9), period=3) == "free"


def test_three_regions_that_are_no_gap():
    # x > 1 cuts v < 0 in two: the interfaces are not parallel
    rate = sp.Piecewise((-x, v > 0), (-2 * x, x > 1), (-3 * x, True))
    model = fs.Model({x: v, v: rate})
    assert regime(model, [2, 0], t=(0, 9), period=3) is None


def test_sliding_rests_against_its_side():
    # preloaded stops: a load below the preload holds the state on the edge
    f = sp.Piecewise((1 + k * (x - D), x > D), (-1 + k * (x + D), x < -D), (0, True))
    stops = fs.Model(
        {x: w - f},
        forcing={w: B + C * sp.sin(omega * t)},
        parameters={D: 0.25, k: 40, B: 0.5, C: 0.2, omega: 0.1},
    )
    resting = fs.simulate(stops, [0], periods=2)
    assert resting.itinerary == ("S2", "S1|S2")
    assert regime(stops, [0], periods=2) == "meshed upper"
    assert regime(stops.with_parameters(B=-0.5), [0], periods=2) == "meshed lower"
    # swung from stop to stop, never into them
    assert regime(stops.with_parameters(B=0, C=0.5), [0], periods=2) == "bilateral"
    # lifted off the upper stop by ∫ w = 0.2 of the way of 0.5
    swing = stops.with_parameters(B=0.1, C=0.2, D=2)
    assert regime(swing, [0], periods=3) == "unilateral upper"


def test_a_crossing_at_the_edge_of_two_parts_counts_in_the_later_one():
    """x = 2 − 3t/2 falls through 1/2, x = t/4 grows through it: at t = 1 and at t = 2."""
    y = sp.Symbol("y")
    levels = {"x": x - sp.Rational(1, 2), "y": y - sp.Rational(1, 2)}
    model = fs.Model({x: sp.Rational(-3, 2), y: sp.Rational(1, 4)}, interfaces=levels)
    run = fs.simulate(model, [2, 0], t=(0, 4))
    assert [(c.interface, c.time) for c in run.crossings] == [("x", 1.0), ("y", 2.0)]
    for name, direction, time in (("x", -1, 1.0), ("y", 1, 2.0)):
        assert run.hits(name, direction=direction) == run.hits(name) == 1
        assert run.hits(name, direction=-direction) == 0
        assert run.hits(name, until=time) == 0
        assert run.hits(name, since=time) == 1
    contacts = run.contacts(period=1)
    # up and down, of x and of y, from t = 0 to 1, and so on
    none = [0, 0]
    assert contacts.per_period.tolist() == [
        [none, none], [[0, 1], none], [none, [1, 0]], [none, none]
    ]  # fmt: skip
    assert contacts.hits.tolist() == [[0, 1], [1, 0]]


def test_a_regime_in_words():
    assert in_words("bilateral", ["bilateral"]) == "bilateral in the last period"
    assert in_words("free", ["free"] * 4) == "free in each of the last 4 periods"
    mixed = ["free", "bilateral", "bilateral", "bilateral"]
    told = "chaotic: bilateral in 75.0 %, free in 25.0 % of the last 4 periods"
    assert in_words("chaotic", mixed) == told
    assert in_words("chaotic", ["free"] * 2) == "chaotic: free in 100.0 % of the last 2 periods"


def test_regions_of_the_climate_are_no_gap():
    # an energy balance with ice below -10 and none above 0
    T, S = sp.symbols("T S")
    ice = sp.Piecewise((0.62, T < -10), (0.3, T > 0), (0.3 - 0.032 * T, True))
    climate = fs.Model({T: S * (1 - ice) - T}, forcing={S: 2 + sp.cos(t)})
    assert fs.simulate(climate, [15], periods=2).regime is None
    run = fs.simulate(climate, [15], periods=2)
    with pytest.raises(fs.ArgumentError, match="name the region inside as gap="):
        run.regimes()
    # without ice in each period: always above the region inside
    assert run.regimes(gap="S2").label == "meshed upper"
    with pytest.raises(fs.ArgumentError, match="expected a region with one region below"):
        run.regimes(gap="S1")
    with pytest.raises(fs.UnknownNameError, match="unknown region 'S9'"):
        run.regimes(gap="S9")
