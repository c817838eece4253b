"""Pieces nested in pieces: runs follow the rates as they are written."""

import numpy as np
import pytest
import sympy as sp

import fastslow as fs
from tests.campaigns.nested_pieces import campaign

pytestmark = pytest.mark.slow

x, v, t, r, D, lam, mu, q = sp.symbols("x v t r D lam mu q")


def test_random_models():
    # python -m tests.campaigns nested_pieces 500
    report = campaign(3, 20261123)
    assert report.failures == []
    assert report.points > 10
    assert report.rows > 0


@pytest.mark.parametrize(
    "law",
    [
        sp.Min(r * t, D),
        sp.Piecewise((r * t, t < D / r), (D, True)),
        sp.Piecewise((D, t > D / r), (r * t, True)),
        D - sp.Max(0, D - r * t),
        r * t * sp.Heaviside(D - r * t) + D * sp.Heaviside(r * t - D),
    ],
)
@pytest.mark.parametrize("start", [0.0, 1.0])
def test_a_ramp_that_stops_is_a_ramp_until_it_stops(law, start):
    rates, parameters = {x: sp.Abs(x + lam) - 1}, {r: 2.0, D: 2.7}
    ramp, stops = (fs.Model(rates, forcing={lam: f}, parameters=parameters) for f in (r * t, law))
    states = np.array([[-0.9], [-0.5], [0.4], [-2.5]])
    known = fs.simulate_many(ramp, states, t=(start, 1.3)).final
    assert np.allclose(fs.simulate_many(stops, states, t=(start, 1.3)).final, known, atol=1e-12)
    for state, final in zip(states, known, strict=True):
        run = fs.simulate(stops, state, t=(start, 1.3))
        assert abs(run["x"][-1] - final[0]) < 1e-12
        back = fs.simulate(stops, final, t=(1.3, start))
        assert abs(back["x"][0] - state[0]) < 1e-11


def test_sliding_ends_where_a_law_jumps():
    model = fs.Model({x: -sp.sign(x - lam)}, forcing={lam: sp.Piecewise((0, t < 1), (2, True))})
    run = fs.simulate(model, [0.5], t=(0, 4))
    # on x = 0 from t = 0.5, towards x = 2 from t = 1, on it from t = 3
    for time, known in ((0.25, 0.25), (0.75, 0.0), (1.5, 0.5), (2.5, 1.5), (3.5, 2.0)):
        (point,) = run.at(t=time)
        assert abs(point["x"] - known) < 1e-14


def test_sliding_goes_on_where_a_law_has_a_corner():
    model = fs.Model({x: -4 * sp.sign(x - lam)}, forcing={lam: sp.Min(t, 2 - t, 1 / t)})
    run = fs.simulate(model, [0.5], t=(0.1, 4))
    for time in (0.5, 0.9, 1.1, 1.9, 3.0):
        (point,) = run.at(t=time)
        assert abs(point["x"] - min(time, 2 - time, 1 / time)) < 1e-14


def test_a_jump_of_a_law_makes_a_relation_true():
    law = sp.Piecewise((3, t < 1), (1, True))
    model = fs.Model({x: 1}, forcing={lam: law}, resets={x >= lam: {x: 0}})
    run = fs.simulate(model, [0.5], t=(0, 2.25))
    assert [event.time for event in run.resets] == pytest.approx([1, 2], abs=1e-14)
    assert run["x"][-1] == pytest.approx(0.25, abs=1e-14)
    relay = fs.Model({x: 1 - 2 * q}, forcing={lam: law}, switches={q: (x > lam, x < lam - 2)})
    run = fs.simulate(relay, {"x": 0.5, "q": 0}, t=(0, 2))
    assert [(event.time, event.value) for event in run.switches] == [(1.0, 1)]
    assert run["x"][-1] == pytest.approx(0.5, abs=1e-14)


def test_switches_begin_with_the_law_at_the_start():
    law = sp.Min(2 * t, 3)
    model = fs.Model({x: q}, forcing={lam: law}, switches={q: (x > lam, x < lam - 10)})
    run = fs.simulate(model, {"x": 1.0, "q": 0}, t=(0, 0.25))
    assert run["x"][-1] == 1.25


@pytest.mark.parametrize(
    ("rate", "known"),
    [
        (sp.sign(sp.Max(x, 0)), 0),
        (sp.Heaviside(sp.Min(x, 0)), 0),
        (sp.Heaviside(sp.Max(x, 0)), sp.Rational(1, 2)),
        (sp.Piecewise((1, sp.Max(x, 0) > 0), (2, True)), 2),
        (sp.Piecewise((1, sp.Max(x, 0) <= 0), (2, True)), 1),
        (sp.Piecewise((1, sp.Eq(sp.Max(x, 0), 0)), (2, True)), 1),
        (sp.Piecewise((1, sp.Ne(sp.Max(x, 0), 0)), (2, True)), 2),
        (sp.Piecewise((1, sp.Max(x, -1) > -1), (2, x > -2), (3, True)), None),
    ],
)
def test_relations_of_expressions_that_are_constant_in_a_region(rate, known):
    model = fs.Model({x: rate})
    values = {-3: 3, -1.5: 2, -0.5: 1} if known is None else {-1: known}
    for place, value in values.items():
        found = [
            region.rates["x"]
            for region in model.regions.values()
            if all(c.subs(sp.Symbol("x", real=True), place) for c in region.conditions)
        ]
        assert found == [value]
