"""Parameter sets with the same regions share one model, others do not."""

import numpy as np
import pytest
import sympy as sp

from fastslow.model.model import Model
from fastslow.simulation.grouping import same_regions
from tests.samples import examples

pytestmark = pytest.mark.slow

x, y, k, a, b = sp.symbols("x y k a b")


def step(condition, high=1, low=0):
    return sp.Piecewise((high, condition), (low, True))


GAP = sp.Piecewise((x - a, x > a), (x + b, x < -b), (0, True))
MODELS = {
    "one interface": {x: step(x > a)},
    "gap": {x: -GAP},
    "gap and another": {x: -GAP, y: step(y > k) - y},
    "turning": {x: -GAP, y: step(y > k * x) - y},
    "three lines": {x: step(x > a), y: step(y > b) + step(x + y > k)},
    "sign of a factor": {x: step(k * (x - a) > 0)},
    "parameters alone": {x: step(k > 0) * x},
    "curved unless k = 0": {x: step(k * x**2 + x - a > 0), y: step(x > b)},
}


def described(model):
    return {
        (tuple(region.signs.items()), tuple(region.rates.values()))
        for region in model.regions.values()
    }


@pytest.mark.sample(3)
@pytest.mark.parametrize("name", MODELS)
def test_every_member_has_the_regions_of_its_group(name):
    model = Model(MODELS[name], parameters={a: 0.5, b: 0.2, k: 1.0})
    random = np.random.default_rng(1)
    count = examples(120)
    values = {n: random.choice([-0.7, -0.2, 0.3, 0.5, 2.0], count) for n in "abk"}
    values["k"][:4] = 0.3 if name in ("sign of a factor", "parameters alone") else 0.0
    groups = same_regions(model, values, count)
    assert sorted(np.concatenate([chosen for _, chosen in groups])) == list(range(count))
    for one, chosen in groups:
        for i in chosen:
            alone = model.with_parameters({n: v[i] for n, v in values.items()})
            assert described(one) == described(alone)


def test_most_often_there_is_one_group():
    model = Model(MODELS["gap and another"], parameters={a: 0.5, b: 0.2, k: 1.0})
    many = np.linspace(0.1, 1.0, 1000)
    groups = same_regions(model, {"a": many, "b": many**2, "k": many - 0.5}, 1000)
    assert len(groups) == 1
    assert groups[0][0] is model
    assert same_regions(model, {}, 5)[0][1].tolist() == [0, 1, 2, 3, 4]


def test_a_slope_that_vanishes_in_some_sets():
    """Functions of one row each are compared one by one, those without a slope as well."""
    model = Model({x: step(k * x > a), y: step(x > b)}, parameters={a: 0.5, b: 0.2, k: 1.0})
    values = {
        "k": np.array([0.0, 0.0, 0.0, 1.0, -1.0, 2.0, 1.0]),
        "a": np.array([0.5, -0.5, 0.25, 0.5, 0.5, 0.75, -2.0]),
    }
    groups = same_regions(model, values, 7)
    assert sorted(np.concatenate([chosen for _, chosen in groups])) == list(range(7))
    for one, chosen in groups:
        for i in chosen:
            alone = model.with_parameters({n: v[i] for n, v in values.items()})
            assert described(one) == described(alone)
