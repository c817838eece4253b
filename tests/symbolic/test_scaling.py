"""Reduction and scaling by derivation: the gear's equations (2) to (6), and general models."""

import numpy as np
import pytest
import sympy as sp

from fastslow.errors import ArgumentError, UnknownNameError
from fastslow.model.model import Model
from fastslow.model.structure import real
from fastslow.simulation.one import simulate
from fastslow.symbolic.reduction import reduce_states
from fastslow.symbolic.scaling import compare_scalings, identify, nondimensionalise
from fastslow.systems import harmonic_gear, harmonic_gear_twist
from fastslow.systems.geartrain import gear_scaling

pytestmark = pytest.mark.slow

#: J_eq and C_eq from J_i = 6.8e-4, J_o = 2.4e-2, N = 100, ξ = 0.05, K_HD = 7200.
J_EQ = 100**2 * 6.8e-4 * 2.4e-2 / (100**2 * 6.8e-4 + 2.4e-2)
C_EQ = 2 * 0.05 * (J_EQ * 7200) ** 0.5
PAPER = {
    "J_eq": J_EQ,
    "J_o": 2.4e-2,
    "C_eq": C_EQ,
    "k1": 3000,
    "k2": 21000,
    "phi": 1.75e-2,
    "T_m": 10,
    "T_am": 15,
    "omega": 1,
}


@pytest.fixture(scope="module")
def scaling():
    return gear_scaling()


def at_paper(expressions):
    place = {real(n): v for n, v in PAPER.items()}
    return {n: float(e.subs(place)) for n, e in expressions.items()}


def test_two_inertias_reduce_states_the_twist_equation(scaling):
    assert scaling.reduced


def test_consistent_parameters_follow(scaling):
    assert scaling.agrees
    found = at_paper(scaling.consistent)
    expected = {
        "A": 41.6666667,
        "B": 2.37197934,
        "C": 3.54545564,
        "D": 0.298869397,
        "omega": 0.0182252846,
    }
    assert found == pytest.approx(expected, rel=1e-8)


def test_printed_parameters_do_not_follow_and_the_slip_reproduces_them(scaling):
    assert list(scaling.ratios) == ["A", "B", "C"]
    assert scaling.reproduced
    found = at_paper(scaling.slip)
    expected = {
        "A": 12152.7778,
        "B": 40.5092593,
        "C": 60.5501824,
        "D": 5.10416667,
        "omega": 0.0182252846,
    }
    assert found == pytest.approx(expected, rel=1e-8)
    J, k2, c = map(real, ("J_eq", "k2", "C_eq"))
    assert scaling.ratios["A"] == J * k2 / c**2


def test_scaled_rates_agree_with_numbers():
    # x'' at one state, once from the physical equation and once from the dimensionless one
    unit = [("theta", "v"), ("v", "v"), ("v", "theta**3"), ("v", "w")]
    scaled = nondimensionalise(harmonic_gear_twist(), unit)
    place = {real(n): v for n, v in PAPER.items()}
    theta_s, v_s, w_s = (float(scaled.scales[n].subs(place)) for n in ("theta", "v", "w"))
    time = float(scaled.time.subs(place))
    state = {"theta": 0.5, "v": 0.3, "w": 1.2}
    moving = {real(n): s for n, s in state.items()}
    mine = float(scaled.regions["S1"]["v"].subs({**place, **moving}))
    physical = {
        real("theta"): 0.5 * theta_s,
        real("v"): 0.3 * v_s,
        real("w"): 1.2 * w_s,
        **place,
    }
    rate = float(harmonic_gear_twist().regions["S1"].rates["v"].subs(physical))
    assert mine == pytest.approx(rate * time / v_s, rel=1e-12)


def test_another_choice_of_scales_is_told_apart():
    x, r, K, y, a = sp.symbols("x r K y a")
    logistic = Model({x: r * x * (1 - x / K)}, parameters={r: 2, K: 3})
    scaled = nondimensionalise(logistic, [("x", "x"), ("x", "x**2")])
    target = Model({y: a * y - 2 * y**2}, parameters={a: 1})
    result = identify(scaled, target, {"x": "y"})
    assert not result.agrees
    assert result.contradictions == (1,)
    assert dict(compare_scalings(scaled.scales, {"x": real("K") / 2})) == {"x": sp.Rational(1, 2)}


def test_van_der_pol_scaling():
    # x'' − c(1 − x²/a²)x' + k x = 0 becomes mu = c/√k
    x, v, c, a, k, mu = sp.symbols("x v c a k mu")
    model = Model({x: v, v: c * (1 - x**2 / a**2) * v - k * x}, parameters={c: 0.5, a: 2, k: 4})
    scaled = nondimensionalise(model, [("x", "v"), ("v", "x"), ("v", "x**2*v")])
    assert scaled.time == real("k") ** sp.Rational(-1, 2)
    target = Model({x: v, v: mu * v - x**2 * v - x}, parameters={mu: 1})
    result = identify(scaled, target, {})
    assert result.agrees
    assert result.values["mu"] == real("c") / sp.sqrt(real("k"))


def test_reduction_needs_a_closed_set():
    p, q = sp.symbols("p q")
    assert dict(reduce_states({p: q, q: -p}, {"u": p, "s": q})) == {"u": real("s"), "s": -real("u")}
    with pytest.raises(ArgumentError, match="also depends on q"):
        reduce_states({p: q, q: -p}, {"u": p})
    with pytest.raises(ArgumentError, match="depend"):
        reduce_states({p: q, q: -p}, {"u": p, "s": 2 * p})
    with pytest.raises(ArgumentError, match="linear"):
        reduce_states({p: q, q: -p}, {"u": p * q})


def test_bad_scaling_requests():
    model = harmonic_gear()
    with pytest.raises(ArgumentError, match="do not determine the scale"):
        nondimensionalise(model, [("x", "v")])
    with pytest.raises(ArgumentError, match="no term"):
        nondimensionalise(model, [("x", "x**7")])
    with pytest.raises(UnknownNameError):
        nondimensionalise(model, [("velocity", "v")])


def test_modes_of_two_coupled_oscillators():
    # the difference of two equal masses: eigenfrequency √3 of the antisymmetric mode
    x1, x2, v1, v2 = sp.symbols("x1 x2 v1 v2")
    rates = {x1: v1, v1: -2 * x1 + x2, x2: v2, v2: -2 * x2 + x1}
    reduced = reduce_states(rates, {"d": x1 - x2, "e": v1 - v2})
    matrix = np.array([[float(e.diff(real(s))) for s in ("d", "e")] for e in reduced.values()])
    assert np.abs(np.linalg.eigvals(matrix).imag) == pytest.approx([3**0.5, 3**0.5], rel=1e-15)


def test_impacts_kicks_and_switches_are_scaled():
    """A scaled model meets its events at the scaled times."""
    x, v, t, m, k, c, r, at, big, q, pull = sp.symbols("x v t m k c r sigma T q F")
    values = {m: 2, k: 3, c: 0.2, r: 0.7, at: 0.4, big: 2.5, pull: 1.2}
    model = Model(
        {x: v, v: (-k * x - c * v + pull * q + sp.cos(t)) / m},
        parameters=values,
        resets={x >= at: {v: -r * v}, sp.Eq(sp.Mod(t, big), 0): {v: v - at}},
        switches={q: (x < -at / 2, x > at / 4)},
    )
    scaled = nondimensionalise(model, [("x", "v"), ("v", "x"), ("v", "q")])
    place = {real(n): v for n, v in model.parameters.items()}
    again = Model(
        scaled.regions["S1"],
        parameters=values,
        resets={one.name: dict(one.jump.items()) for one in scaled.resets.values()},
        switches={name: one.relations for name, one in scaled.switches.items()},
    )
    time, length, speed = (
        float(e.subs(place)) for e in (scaled.time, scaled.scales["x"], scaled.scales["v"])
    )
    assert time == pytest.approx((2 / 3) ** 0.5)
    one = simulate(model, {"x": 0.1, "v": 0.3, "q": 0}, t=(0, 30))
    start = {"x": 0.1 / length, "v": 0.3 / speed, "q": 0}
    other = simulate(again, start, t=(0, 30 / time))
    assert len(one.resets) == len(other.resets) > 10
    assert len(one.switches) == len(other.switches) > 2
    assert time * other.resets["t"] == pytest.approx(one.resets["t"], abs=1e-6)
    assert time * other.switches["t"] == pytest.approx(one.switches["t"], abs=1e-6)
