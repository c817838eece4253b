"""Pulses and transitions of which the Taylor series before them shows nothing."""

import math
from itertools import pairwise

import numpy as np
import pytest
import sympy as sp

import fastslow as fs
from fastslow.kernels.taylor.saturation import saturations
from fastslow.orbits.flow.flows import flow
from fastslow.orbits.flow.variations import variations_of

pytestmark = pytest.mark.slow

a, b, c, d, e, g, s = sp.symbols("a b c d e g s")

#: The time at which the phase s is 0, 20, 40, …: one pulse or transition at each.
RATES = {
    a: sp.exp(-900 * (s - 20) ** 2),
    b: 1 + sp.tanh(2000 * (s - 40)),
    c: sp.erfc(500 * (60 - s)),
    d: 1 / (1 + (s - 80) ** 40),
    e: sp.cos((s - 100) * sp.pi / 40) ** 400,
    g: sp.sqrt((s - 120) ** 2 + sp.Rational(1, 10**16)),
    s: sp.Integer(1),
}
END = 130.0
PRECISE = fs.Integration(rtol=1e-10, atol=1e-10)

#: Integrals from 0 to the end, in closed form. The mean of cos^400 is its binomial coefficient.
EXACT = {
    "a": math.sqrt(math.pi) / 30.0,
    "b": 2.0 * (END - 40.0),
    "c": 2.0 * (END - 60.0),
    "d": 2.0 * (math.pi / 40.0) / math.sin(math.pi / 40.0),
    "g": 0.5 * (120.0**2 + 10.0**2),
}


@pytest.fixture(scope="module")
def model():
    return fs.Model(RATES)


def differences(final, whole):
    exact = np.array([EXACT.get(name, whole) for name in "abcdeg"])
    return np.abs(np.asarray(final, dtype=float)[:6] - exact)


@pytest.fixture(scope="module")
def powers():
    """Integral of the power of the cosine: over 40 s, the whole period, by equal weights."""
    nodes = np.arange(401) / 401 * 40.0
    return float(np.mean(np.cos((nodes - 100) * np.pi / 40) ** 400) * 40.0)


def test_pulses_and_transitions_are_not_passed_over(model, powers):
    run = fs.simulate(model, [0.0] * 7, t=(0, END), integration=PRECISE)
    # of the periods of 40 of cos(…)^400 three pulses lie within: at 20, 60 and 100
    assert differences([run[name][-1] for name in model.states], 3.0 * powers).max() < 3e-8


def test_ensembles_pass_over_none(model, powers):
    starts = np.zeros((16, 7))
    starts[:, 0] = np.arange(16.0)
    ensemble = fs.simulate_many(model, starts, t=(0, END), integration=PRECISE)
    for k, final in enumerate(np.asarray(ensemble.final)):
        final = final.copy()
        final[0] -= k
        assert differences(final, 3.0 * powers).max() < 3e-8


def test_flows_of_orbits_pass_over_none():
    x = sp.Symbol("x")
    relay = fs.Model({x: -x + sp.tanh(3000 * sp.sin(s)), s: sp.Integer(1)})
    variations = variations_of(relay, ())
    start, duration = np.array([[0.3, 0.5]]), np.array([8.0])
    some = np.zeros(1, dtype=int), start, np.zeros(1), duration
    end = flow(variations, *some, variations.parameter_array(relay)).ends[0, 0]
    # +1 to π, −1 to 2π, +1; the smooth switch acts like a jump up to π² / 24 / 3000²
    changes = [0.0, math.pi - 0.5, 2 * math.pi - 0.5, 8.0]
    exact = 0.3
    for k, (begin, stop) in enumerate(pairwise(changes)):
        exact = (-1) ** k + (exact - (-1) ** k) * math.exp(begin - stop)
    assert abs(end - exact) < 2e-7


@pytest.mark.parametrize("rate", [1e2, 1e6])
def test_implicit_steps_pass_over_none(rate):
    x, total = sp.symbols("x total")
    stiff = fs.Model({x: -rate * (x - sp.exp(-1000 * sp.sin(s) ** 2)), total: x, s: sp.Integer(1)})
    run = fs.simulate(stiff, [0.0, 0.0, 0.5], t=(0, 20), integration=PRECISE)
    nodes = np.arange(2000) / 2000 * np.pi
    mean = np.mean(np.exp(-1000 * np.sin(nodes) ** 2)) * np.pi
    # six pulses from 0.5 to 20.5, the delay 1/rate after each is over
    assert abs(run["total"][-1] - 6 * mean) < 1e-8


def test_arguments_are_found_in_every_form():
    x, y, n = sp.symbols("x y n")
    model = fs.Model(
        {x: sp.tanh(9 * y) + y**24 + (1 + y**2) ** -1.5 - x, y: 1 / (1 + sp.exp(x)) + x**n},
        parameters={n: 3},
    )
    found = saturations(model.operations.motions[0])
    kinds = {(one.change > 0, one.low > 0, one.share == 0.95) for one in found}
    assert kinds == {(True, False, False), (False, True, False), (False, False, True)}
    assert (
        saturations(fs.Model({x: x * y - y**8, y: sp.sin(x) / (1 + x**2)}).operations.motions[0])
        == []
    )


def test_an_argument_of_several_functions_has_all_limits():
    x, y = sp.symbols("x y")
    model = fs.Model({x: sp.erf(y) + sp.exp(y) + y**30 - x, y: -y})
    found = saturations(model.operations.motions[0])
    assert sorted(one.high for one in found if one.row == 1) == [math.e, 5.5, 30.0]
