"""Critical rates of shifts, against closed forms and bisection of runs by SciPy."""

import math

import numpy as np
import pytest
import sympy as sp
from scipy.integrate import solve_ivp

import fastslow as fs
from tests.campaigns import critical_rates as campaign

pytestmark = pytest.mark.slow

x, t, w, r, L, D = sp.symbols("x t w r L D")


@pytest.fixture(scope="module")
def smooth():
    """x' = (x + w)² − 1 under a shift of length L, with the rate 4/(L (L − 2))."""
    shift = {w: L * (1 + sp.tanh(L * r * t / 2)) / 2}
    return fs.Model({x: (x + w) ** 2 - 1}, forcing=shift, parameters={r: 1, L: 3})


@pytest.fixture(scope="module")
def cornered():
    """x' = |x + w| − 1 under a ramp at rate r that stops at D = 2 r ln(r/(r − 1))."""
    shift = {w: sp.Min(r * t, D)}
    return fs.Model({x: sp.Abs(x + w) - 1}, forcing=shift, parameters={r: 2, D: 2.7})


@pytest.fixture(scope="module")
def across(cornered):
    return fs.critical_rate(cornered, r, (1.2, 4))


@pytest.mark.parametrize("length", [2.5, 3, 4])
def test_a_smooth_shift(smooth, length):
    found = fs.critical_rate(smooth.with_parameters({L: length}), "r", (0.3, 4))
    assert found.rate == pytest.approx(4 / (length * (length - 2)), rel=1e-13)
    slope = -8 * (length - 1) / (length**2 * (length - 2) ** 2)
    assert found.gradient("L") == pytest.approx(slope, rel=1e-12)
    (one,) = found
    assert one.method == "Newton"
    assert one.edge["x"] == pytest.approx(1 - length)
    assert (one.below, one.above) == ("tracks", "tips, unbounded")
    assert max(one.start_error, one.end_error) < 1e-12
    assert found.target["x"] == pytest.approx(-1 - length)
    # the run at the critical rate ends on the edge
    assert one.run.final_state["x"] == pytest.approx(1 - length, abs=1e-4)


def test_a_shift_across_an_interface(across):
    rate = across.rate
    assert 2 * rate * math.log(rate / (rate - 1)) == pytest.approx(2.7, rel=1e-14)
    slope = 1 / (2 * math.log(rate / (rate - 1)) - 2 / (rate - 1))
    assert across.gradient(D) == pytest.approx(slope, rel=1e-12)
    assert across[0].start_error < 1e-14
    assert len(across[0].run.crossings) == 2


def test_no_critical_rate_is_a_result(smooth, cornered):
    for model, name, length in ((smooth, L, 1.9), (cornered, D, 1.9)):
        found = fs.critical_rate(model.with_parameters({name: length}), r, (0.5, 60))
        assert len(found) == 0
        assert found.outcome.code == "basin stable"
        assert found.outcome
        with pytest.raises(fs.ArgumentError, match="0 critical rates were found; expected one"):
            _ = found.rate
    slow = fs.critical_rate(smooth, r, (0.1, 0.5))
    assert slow.outcome.code == "tracks at all rates"
    assert "is outside the basin" in str(slow.outcome)
    fast = fs.critical_rate(smooth, r, (2, 3))
    assert fast.outcome.code == "no change"
    assert set(fast.ends) == {"tips, unbounded"}


def test_a_branch_that_ends():
    """Beyond the fold the shift tips at every rate, unless it returns soon enough."""
    slow = {"x": w + x - x**3}
    gone = fs.Model(slow, forcing={w: -1 + D * (1 + sp.tanh(r * t)) / 2}, parameters={r: 1, D: 1.9})
    found = fs.critical_rate(gone, r, (0.05, 2))
    assert len(found) == 0
    assert found.target is None
    assert found.outcome.code == "bifurcation-induced"
    assert "LP1" in str(found.outcome)
    back = fs.Model(slow, forcing={w: -0.3 + D / sp.cosh(r * t)}, parameters={r: 1, D: 1.2})
    over = fs.critical_rate(back, r, (0.05, 2), branch=[-1.1])
    assert over.overshoot
    assert (over[0].below, over[0].above) == ("tips to x = 0.786483", "tracks")
    ends = [
        fs.simulate(back.with_parameters({r: over.rate * f}), over.origin.state, t=(-20, 60))["x"][
            -1
        ]
        for f in (1 - 1e-9, 1 + 1e-9)
    ]
    assert ends[0] > 0 > ends[1]


def test_a_tangency_as_the_edge():
    """Runs leave x = w where the speed of the shift is 1: no equilibrium, located by bisection."""
    jumping = fs.Model(
        {x: w - x + sp.sign(x - w)},
        forcing={w: -D * (1 + sp.tanh(r * t)) / 2},
        parameters={r: 1, D: 2},
    )
    (found,) = fs.critical_rate(jumping, r, (0.5, 5), branch=[-1])
    assert found.method == "bisection"
    assert found.edge is None
    # not the width of the last interval, 1e-15, but the error of the runs
    assert 1e-14 < found.end_error < 1e-7
    with pytest.raises(fs.ArgumentError, match="located by bisection"):
        found.gradient("D")


@pytest.mark.parametrize("number", [1, 3])
def test_random_shifts(number):
    """Runs by SciPy end differently on both sides of each critical rate."""
    model, start = campaign.random_model(np.random.default_rng((0, number)), number)
    found, end = fs.critical_rate(model, r, (0.3, 3), branch=start), campaign.ends_of(model, start)
    assert len(found)
    assert all(one.method == "Newton" for one in found)
    for one in found:
        assert end(one.rate * (1 - 1e-8)) == -end(one.rate * (1 + 1e-8))


def side_after_impacts(rate):
    """The side of the saddle on which a run of SciPy with impacts ends, and their number."""

    def field(time, state):
        y = state[0] - 1.5 * (1 + math.tanh(rate * time)) / 2
        return [state[1], y - y**3 - state[1] / 10]

    def wall(time, state):
        return state[0] - 2.9

    wall.terminal, wall.direction = True, 1
    time, state, count = -18 / rate, np.array([-1.0, 0.0]), 0
    while time < 100:
        options = {"rtol": 1e-11, "atol": 1e-12, "method": "DOP853", "max_step": 1.0}
        run = solve_ivp(field, (time, 100), state, events=wall, **options)
        time, state = run.t[-1], run.y[:, -1]
        if run.status == 1:
            state, count = state * [1, -0.8], count + 1
    return np.sign(state[0] - 1.5), count


def test_runs_with_impacts():
    """Runs land on the saddle after an impact; derivatives pass it by its saltation matrix."""
    v, y = sp.Symbol("v"), x - w
    shift = {w: D * (1 + sp.tanh(r * t)) / 2}
    rates = {x: v, v: y - y**3 - v / 10}
    model = fs.Model(
        rates, forcing=shift, parameters={r: 1, D: 1.5}, resets={x >= 2.9: {v: -0.8 * v}}
    )
    (found,) = fs.critical_rate(model, r, (1.1, 1.5), branch=[-1, 0])
    assert found.method == "Newton"
    assert len(found.run.resets) == 1
    assert side_after_impacts(found.rate * (1 - 1e-7)) == (-1, 1)
    assert side_after_impacts(found.rate * (1 + 1e-7)) == (1, 1)
    h = 1e-5
    ends = [
        fs.critical_rate(model.with_parameters({D: 1.5 + s}), r, (1.25, 1.3), branch=[-1, 0]).rate
        for s in (-h, h)
    ]
    assert found.gradient("D") == pytest.approx((ends[1] - ends[0]) / (2 * h), rel=1e-7)


def test_bad_input(smooth, cornered):
    def refused(match, model=cornered, rate=r, over=(1, 4), **named):
        with pytest.raises(fs.FastSlowError, match=match):
            fs.critical_rate(model, rate, over, **named)

    refused("unknown parameter 'q'", rate="q")
    refused("is not on a stable branch at w = 0", branch=[1.0])
    refused("is no edge state, which has one unstable direction", edge=[-3.7])
    refused("does not settle", fs.Model({x: -x + w}, forcing={w: r * t}, parameters={r: 1}))
    still = fs.Model({x: D * (w - x)}, forcing={w: sp.tanh(r * t)}, parameters={r: 1, D: 1})
    refused("D is no parameter of the forcing w", still, D)
    two = fs.Model({x: x - x**3 + w}, forcing={w: sp.tanh(r * t) / 9}, parameters={r: 1})
    refused("has 2 stable equilibria at w = -0.111111: .* give one as branch=", two)
    q = sp.Symbol("q")
    relay = fs.Model(
        {x: w - x + q},
        forcing={w: sp.tanh(r * t)},
        parameters={r: 1},
        switches={q: (x > 1, x < -1)},
    )
    refused("ignore the changes of the switch of this model", relay)
    refused("expected one, with its law in time", fs.Model({x: -x * r}, parameters={r: 1}))
    refused(
        "the limits of w .* depend on r",
        fs.Model({x: w - x}, forcing={w: r * sp.tanh(t)}, parameters={r: 1}),
    )
    fastest = smooth.with_parameters(L=3)
    with pytest.raises(fs.ArgumentError, match="is the rate itself"):
        fs.critical_rate(fastest, r, (1, 2)).gradient("r")


def soil(hottest):
    """Soil of temperature T and carbon C under air that warms at the rate v: the compost bomb.

    The decay no longer grows above a temperature.
    """
    T, C, air, warming, eps = sp.symbols("T C T_a v epsilon")
    decay = C * sp.exp(sp.Symbol("alpha") * sp.Min(T, hottest)) / 100
    values = {"alpha": math.log(2.5) / 10, "k": 5.049 / 39, warming: 0.09, eps: 0.064}
    heat = (decay - sp.Symbol("k") * (T - air)) / eps
    ramp = {air: warming * t}
    return fs.Model({T: heat}, slow={C: 1.055 - decay}, forcing=ramp, parameters=values)


@pytest.fixture(scope="module")
def compost():
    return soil(sp.oo)


@pytest.mark.sample(0)
def test_a_ramp_after_which_runs_come_back():
    """Above 40 degrees the soil burns its carbon, cools, and follows the ramp again."""
    (one,) = fs.critical_rate(soil(40), "v", (0.05, 0.2))
    assert one.rate == pytest.approx(0.08846855393, abs=6e-12)
    assert (one.below, one.above) == ("tracks", "tips over the fold")
    with pytest.raises(fs.ArgumentError, match=r"crosses T - 17 at .*; expected a canard within"):
        fs.critical_rate(soil(17), "v", (0.05, 0.2))


def test_a_jump_shorter_than_the_samples_of_a_run(compost):
    """Against Radau by SciPy with bisection, at a larger ratio of the rates."""
    (one,) = fs.critical_rate(compost.with_parameters(epsilon=0.08), "v", (0.08, 0.1))
    assert one.rate == pytest.approx(0.09087171047, abs=3e-11)
    assert one.method == "canard"


def test_a_ramp_that_does_not_settle(compost):
    """Against Radau by SciPy with bisection, and the slow flow to its folded saddle (SciPy)."""
    found = fs.critical_rate(compost, "v", (0.05, 0.2))
    assert found.rate == pytest.approx(0.08846855393, abs=6e-12)
    (one,) = found
    assert (one.below, one.above, one.method) == ("tracks", "tips over the fold", "canard")
    assert one.limit == pytest.approx(0.0807740634011, abs=2e-13)
    assert one.contraction > 25
    assert one.end_error < 1e-14
    assert one.canard.type == "saddle"
    # the state passes the folded saddle on the fold, T - T_a = 1/α, to O(√ε)
    assert one.canard["T"] - one.canard["T_a"] == pytest.approx(10.9, rel=0.4)
    h = 1e-6
    ends = [
        fs.critical_rate(compost.with_parameters(epsilon=0.064 + s), "v", (0.08, 0.1)).rate
        for s in (-h, h)
    ]
    assert found.gradient("epsilon") == pytest.approx((ends[1] - ends[0]) / (2 * h), rel=1e-7)
    with pytest.raises(fs.ArgumentError, match="no curve, as it is that of a canard"):
        fs.continue_points(one, ("v", "epsilon"), over={"v": (0.05, 0.2), "epsilon": (0.01, 0.1)})


def test_no_folded_saddle(compost):
    refused = [
        ("r is no parameter of the forcing|unknown parameter 'r'", "r", compost),
        ("alpha is no parameter of the forcing T_a = t", "alpha", compost),
    ]
    y, v = sp.symbols("y v")
    bent = {w: D + r * t**2}
    flat = fs.Model({x: w - x}, slow={y: x - y}, forcing={w: r * t}, parameters={r: 1})
    refused += [
        ("does not settle, and no folded saddle was found", "r", flat),
        (
            r"is no ramp w0 \+ c t; for a shift that settles",
            "r",
            fs.Model({x: y - x}, slow={y: w - y}, forcing=bent, parameters={r: 1, D: 1}),
        ),
        (
            "has 2 fast and 1 slow states, and 1 forcings",
            "r",
            fs.Model({x: y - x, v: -v}, slow={y: w - y}, forcing={w: r * t}, parameters={r: 1}),
        ),
    ]
    for match, name, model in refused:
        with pytest.raises(fs.FastSlowError, match=match):
            fs.critical_rate(model, name, (0.05, 0.2))
    with pytest.raises(fs.ArgumentError, match="edge: the threshold of a ramp is a canard"):
        fs.critical_rate(compost, "v", (0.05, 0.2), edge=[1, 2])
