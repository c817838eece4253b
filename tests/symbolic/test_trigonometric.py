"""Closed forms of trigonometric rates, and folds of random models found numerically."""

import numpy as np
import pytest
import sympy as sp

import fastslow as fs
from fastslow.model.structure import real
from fastslow.symbolic.signs.signs import Signs
from fastslow.symbolic.solving.trigonometric import trigonometric_roots
from tests.campaigns import derivations

pytestmark = pytest.mark.slow

x, a, b = map(real, "xab")


def zeros(function, low, high):
    """Return the zeros in an interval, from changes of sign on a fine grid."""
    grid = np.linspace(low, high, 40000)
    values = function(grid)
    return grid[np.flatnonzero(values[1:] * values[:-1] < 0)]


@pytest.mark.parametrize(
    "equation",
    [
        sp.sin(x) ** 2 - sp.cos(x) ** 2,
        2 * sp.cos(x) - 1,
        3 * sp.sin(2 * x) + sp.sin(x),
        sp.sin(3 * x) - sp.Rational(1, 3),
        3 * sp.sin(x) + 4 * sp.cos(x) - 2,
        sp.tan(x) - 2,
        sp.sin(x + 1) - sp.sin(2 * x + 2) / 3,
        sp.cos(3 * x) + sp.cos(x) ** 2 - sp.Rational(1, 5),
        sp.cos(x / 2) + sp.cos(x / 3) / 3,
        sp.sin(x) * sp.cos(x) - sp.sin(x) / 5,
        (1 - 2 * sp.cos(x)) / (2 - sp.cos(x)) ** 2,
    ],
)
def test_all_roots_are_found(equation):
    found, counter = trigonometric_roots(equation, x, Signs({}), set())
    values = [float(root.value.subs(counter, k)) for root in found for k in range(-30, 31)]
    inside = np.sort([value for value in values if -9.0 < value < 9.0])
    expected = zeros(sp.lambdify(x, equation, "numpy"), -9.0, 9.0)
    # poles of the tangent change the sign as well
    residuals = np.abs(sp.lambdify(x, equation, "numpy")(expected))
    np.testing.assert_allclose(inside, expected[residuals < 1], atol=1e-3)
    for value in inside:
        assert abs(equation.subs(x, value)) < 1e-12


def test_folds_of_products_of_sine_and_cosine():
    derived = fs.derive(fs.Model({x: b - a * sp.sin(x) * sp.cos(x)}, parameters={a: 1, b: 0.1}))
    assert {p.parameters["b"] for p in derived.folds} == {a / 2, -a / 2}
    assert all(p.check == "exact" for p in derived.folds)
    assert "fold: k is any integer" in derived.summary()


def test_folds_of_a_quotient():
    rate = b - a * sp.sin(x) / (2 - sp.cos(x))
    derived = fs.derive(fs.Model({x: rate}, parameters={a: 1, b: 0.1}))
    # the largest value of sin/(2 − cos) is 1/√3, at π/3
    assert {p.parameters["b"] for p in derived.folds} == {a / sp.sqrt(3), -a / sp.sqrt(3)}
    (at,) = {p.state["x"] for p in derived.folds if p.parameters["b"] == a / sp.sqrt(3)}
    assert at.subs(dict.fromkeys(at.free_symbols, 0)) == sp.pi / 3


def test_a_coefficient_that_may_vanish_is_named():
    p = real("p")
    model = fs.Model({x: a - p * sp.sin(x) - sp.exp(x) * sp.cos(x)}, parameters={a: 1, p: 1})
    region = fs.derive(model)["S1"]
    (fold,) = region.folds
    assert fold.note == "p is solved for where cos(x) ≠ 0"
    assert f"fold: {fold.note}" in region.notes


def test_no_point_of_random_models_is_lost_in_silence():
    report = derivations.campaign(3, 3)
    assert report.located > 10
    assert not report.failures, report
