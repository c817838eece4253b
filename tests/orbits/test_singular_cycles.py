"""Singular cycles against closed forms, SciPy and simulations at small ratios of the rates."""

import math

import numpy as np
import pytest
import sympy as sp
from scipy.integrate import solve_ivp

import fastslow as fs
from fastslow.orbits.canards import singular_cycles
from fastslow.orbits.canards.strong_canards import StrongCanard
from fastslow.symbolic.sheet_flows import flows_of_sheets

pytestmark = pytest.mark.slow

x, y, z, p, t = sp.symbols("x y z p t")
a, k, lam, eps, V = sp.symbols("a k lambda epsilon V")

#: ε x' = y − x³/3 + x, y' = a − x.
VAN_DER_POL = fs.Model({x: (y - x**3 / 3 + x) / eps}, slow={y: a - x}, parameters={a: 0, eps: 0.01})


def period(low, high, value):
    """∫ (x² − 1)/(a − x) dx of one sheet of van der Pol's equation."""
    s = sp.Symbol("s", real=True)
    return float(sp.Integral((s**2 - 1) / (value - s), (s, low, high)).evalf(30))


@pytest.mark.parametrize("value", [0.0, 0.7])
def test_van_der_pol(value):
    """T = 3 − 2 ln 2 for a = 0 (e.g. Krupa and Szmolyan 2001)."""
    cycle = fs.singular_cycle(VAN_DER_POL.with_parameters(a=value), [2, 0])
    exact = period(2, 1, value) + period(-2, -1, value)
    assert exact == pytest.approx(3 - 2 * math.log(2), rel=1e-15) or value
    assert cycle.period == pytest.approx(exact, rel=1e-14)
    assert cycle["type"].tolist() == ["slow", "jump"] * 2
    assert cycle["end"].tolist() == ["fold", "lands"] * 2
    ends = np.array([piece.last[0] for piece in cycle])
    assert ends == pytest.approx([-1, 2, 1, -2], abs=1e-14)
    assert sum(cycle["duration"]) == cycle.period


def test_units_and_an_added_state_change_nothing():
    scaled = fs.Model(
        {x: (1e3 * y - (x / 1e6) ** 3 / 3 + x / 1e6) * 1e6 / eps},
        slow={y: -1e-9 * x},
        parameters={eps: 0.01},
    )
    lagging = fs.Model(
        {x: (y - p**3 / 3 + p + p - x) / eps, p: 3 * (x - p) / eps},
        slow={y: -x},
        parameters={eps: 0.01},
    )
    for model, start in ((scaled, [2e6, 0]), (lagging, [2, 2, 0])):
        cycle = fs.singular_cycle(model, start)
        assert cycle.period == pytest.approx(3 - 2 * math.log(2), rel=1e-14)


def test_corners_of_a_piecewise_linear_model():
    """Slopes −1, 1, −1: sheets y = x ± 2 from ∓3 to ∓1, ∫ dx/(a − x) in closed form."""
    slopes = sp.Piecewise((-x - 2, x < -1), (x, x < 1), (2 - x, True))
    model = fs.Model({x: (y + slopes) / eps}, slow={y: a - x}, parameters={a: 0.1, eps: 0.01})
    cycle = fs.singular_cycle(model, [2, 0])
    assert cycle["end"].tolist() == ["corner", "lands"] * 2
    assert cycle.period == pytest.approx(math.log(3.1 / 1.1) + math.log(2.9 / 0.9), rel=1e-14)


def test_a_slow_piece_continues_across_an_interface():
    cubic, line = x - x**3 / 3, sp.Rational(3, 8) - 2 * (x - sp.Rational(3, 2))
    right = sp.Piecewise((cubic, x < sp.Rational(3, 2)), (line, True))
    cycle = fs.singular_cycle(
        fs.Model({x: (y + right) / eps}, slow={y: -x}, parameters={eps: 0.01}), [2, 0]
    )
    assert cycle["end"].tolist() == ["fold", "lands", "interface", "fold", "lands"]
    # lands on the line at y = 2/3
    landing = 1.5 + (2 / 3 + 3 / 8) / 2
    exact = period(-2, -1, 0) + 2 * math.log(landing / 1.5) + period(sp.Rational(3, 2), 1, 0)
    assert cycle.period == pytest.approx(exact, rel=1e-14)


def test_stick_and_slip():
    """Friction decreases with the velocity: sticking is a sheet of sliding, up to a corner."""
    v, load = sp.symbols("v load")
    friction = sp.Piecewise((1 / (1 + 2 * v), v > 0), (-1 / (1 - 2 * v), True))
    model = fs.Model(
        {v: (load - friction - v / 10) / eps}, slow={load: V - v}, parameters={eps: 0.001, V: 0.3}
    )
    cycle = fs.singular_cycle(model, [0, 0])
    assert cycle["end"].tolist() == ["fold", "lands", "corner", "lands"]
    assert cycle["sheet"].tolist() == ["S1", "S1|S2", "S1|S2", "S1"]
    # slips from v = 9.5, where 1 = 1/(1 + 2v) + v/10, to the fold, (1 + 2v)² = 20
    fold = (math.sqrt(20) - 1) / 2
    lowest = 1 / math.sqrt(20) + fold / 10
    s = sp.Symbol("s", real=True)
    slip = sp.Integral((0.1 - 2 / (1 + 2 * s) ** 2) / (0.3 - s), (s, 9.5, fold)).evalf(20)
    assert cycle.period == pytest.approx((1 - lowest) / 0.3 + float(slip), rel=1e-12)


def koper(value, ratio=0.01):
    return fs.Model(
        {x: (k * y - x**3 + 3 * x - lam) / eps},
        slow={y: x - 2 * y + z, z: y - z},
        parameters={k: -10, lam: value, eps: ratio},
    )


def node_of(model):
    return next(one for one in fs.slow_flow(model).points if one.code == "FN")


def landing_gap(value):
    """Difference in z of landing and strong canard at x = −2, integrated by SciPy over (x, z)."""
    height = lambda u: -(u**3 - 3 * u + value) / 10  # noqa: E731

    def flow(_, u, way=1):
        return [-10 * way * (u[0] - 2 * height(u[0]) + u[1]),
                way * (3 * u[0] ** 2 - 3) * (height(u[0]) - u[1])]  # fmt: skip

    def until(target, start, way):
        event = lambda _, u, way: u[0] - target  # noqa: E731
        event.terminal = True
        settings = {"rtol": 1e-12, "atol": 1e-14, "method": "DOP853", "events": event}
        return solve_ivp(flow, (0, 1e3), start, args=(way,), **settings).y[1, -1]

    fold = 2 * height(-1) + 1
    # strong eigenvector of σ² + 10σ + 6(8 − λ) = 0 at x = −1
    strong = -5 - math.sqrt(25 - 6 * (8 - value))
    slope = -6 * (height(-1) - fold) / strong
    begin = [-1 - 1e-6, fold - 1e-6 * slope]
    return until(1, [2, fold], 1) - until(-2, begin, -1)


def test_return_to_the_funnel_of_a_folded_node():
    """Koper: the return lands on the strong canard at λ = 6.78372516…, where SciPy finds it."""
    model = koper(7)
    cycle = fs.singular_cycle(model, node_of(model), "lambda", over=(6.7, 6.9))
    assert cycle.outcome.code == "on the strong canard"
    assert abs(cycle.distance) < 1e-11
    low, high = (landing_gap(cycle.value + change) for change in (-1e-6, 1e-6))
    assert low * high < 0
    assert abs((low + high) / (high - low)) * 1e-6 < 1e-10
    for value, code in ((6.7, "closed"), (6.9, "through a folded node")):
        moved = koper(value)
        one = fs.singular_cycle(moved, node_of(moved))
        assert one.outcome.code == code
        assert (one.distance > 0) == (value > cycle.value)
        # at a small ratio of the rates: relaxation oscillations, or mixed modes
        run = fs.simulate(koper(value, 1e-4), [-1.5, -0.6, -0.75], t=(0, 8))
        assert (run.mixed_mode().outcome.code == "mixed modes") == (value > cycle.value)
        # from a state, the same cycle
        same = fs.singular_cycle(moved, [2, -0.8, -0.7])
        assert same.period == pytest.approx(one.period, rel=1e-8)


def test_a_change_of_sign_that_is_no_zero_is_no_canard(monkeypatch):
    """Where the return jumps from one side of the strong canard to the other."""

    def jumping(canard, *_):
        return math.copysign(0.1, canard.flow.model.parameters["lambda"] - 6.81)

    monkeypatch.setattr(StrongCanard, "distance", jumping)
    monkeypatch.setattr(singular_cycles, "BRENT", 1e-3)
    model = koper(7)
    cycle = fs.singular_cycle(model, node_of(model), "lambda", over=(6.7, 6.9))
    assert cycle.outcome.code == "not on the canard"
    assert "without becoming zero" in cycle.outcome.message
    assert cycle.value == pytest.approx(6.81, abs=0.02)


def test_a_place_where_the_rates_are_not_defined_has_no_numbers():
    model = fs.Model({x: y - sp.sqrt(x) - x ** sp.Rational(3, 2)}, slow={y: 1 / (x - 1)})
    (sheet,) = flows_of_sheets(model, ("y",)).values()
    assert np.isnan(sheet.at(np.array([-1.0, 0.0]), {}).f).all()
    assert np.isinf(sheet.at(np.array([1.0, 0.0]), {}).g).all()
    assert np.isnan(sheet.bending(np.array([-1.0, 0.0]), {})).all()


def test_ratio_near_zero():
    """μ = 6e-5 beside FSN2 at λ = 8: the node is reached along a slow direction."""
    model = koper(7.999)
    assert fs.singular_cycle(model, node_of(model)).outcome.code == "through a folded node"


def test_cycle_of_a_forced_oscillator_lasts_whole_periods():
    amplitude, frequency = sp.symbols("amplitude frequency")
    model = fs.Model(
        {x: (y - x**3 / 3 + x) / eps},
        slow={y: amplitude * sp.sin(frequency * t) - x},
        parameters={amplitude: 1.2, frequency: 1.5, eps: 0.01},
    )
    cycle = fs.singular_cycle(model, {x: 2, y: 0})
    periods = cycle.period * 1.5 / (2 * math.pi)
    assert periods == pytest.approx(3, abs=1e-8)


def test_orbits_that_do_not_close_say_why(tmp_path):
    stopped = fs.singular_cycle(VAN_DER_POL.with_parameters(a=2), [2, 0])
    assert stopped.outcome.code == "equilibrium"
    assert math.isnan(stopped.period)
    stopped.save(tmp_path / "cycle.npz")
    assert fs.load(tmp_path / "cycle.npz") == stopped
    canard = fs.singular_cycle(VAN_DER_POL.with_parameters(a=1), [2, 0])
    assert canard.outcome.code == "canard point"
    escape = fs.Model({x: y + x**2}, slow={y: 1})
    assert fs.singular_cycle(escape, [-1, -1]).outcome.code == "unbounded jump"
    inflection = fs.Model({x: -y - x**3}, slow={y: 1})
    assert fs.singular_cycle(inflection, [1, -1]).outcome.code == "degenerate fold"
    focus = fs.Model({x: y * x - p - x**3, p: x + y * p - p**3}, slow={y: 1})
    assert fs.singular_cycle(focus, [0, 0, -1]).outcome.code == "Hopf point"
    # a fast oscillation beyond the fold
    spiking = fs.Model(
        {x: p - x**3 + 3 * x**2 + 2 - z, p: 1 - 5 * x**2 - p}, slow={z: 4 * x + 6 - z}
    )
    assert fs.singular_cycle(spiking, [-1.6, -12, 2]).outcome.code == "no landing"


def test_bad_input():
    with pytest.raises(fs.ArgumentError, match="0 slow variables"):
        fs.singular_cycle(fs.Model({x: -x}), [1])
    with pytest.raises(fs.ArgumentError, match="expected a folded node as the state"):
        fs.singular_cycle(VAN_DER_POL, [2, 0], "a", over=(0, 1))
    focus = next(one for one in fs.slow_flow(koper(7)).points if one.code == "FF")
    with pytest.raises(fs.ArgumentError, match="folded focus"):
        fs.singular_cycle(koper(7), focus)
    with pytest.raises(fs.ArgumentError, match="no period"):
        fs.singular_cycle(fs.Model({x: y - x}, forcing={y: t}), [1])
