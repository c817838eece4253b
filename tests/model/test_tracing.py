"""Models of Python functions, called with symbols."""

import math

import numpy as np
import pytest
import sympy as sp

import fastslow as fs


def pendulum(t, y, k, F):
    x, v = y
    return np.array([v, F * np.cos(2 * t) - k * v - np.sin(x) + np.maximum(x, 0) ** 2 / 3])


def test_the_rates_are_those_of_the_function():
    model = fs.Model.from_function(pendulum, ["x", "v"], {"k": 0.3, "F": 2})
    for t, state in ((0.4, (0.7, -1.2)), (1.1, (-0.6, 0.1))):
        at = {sp.Symbol(n, real=True): value for n, value in zip("xv", state, strict=True)}
        at |= {sp.Symbol("t", real=True): t} | model.values
        found = [float(rate.subs(at)) for rate in model.rates.values()]
        assert found == pytest.approx(pendulum(t, np.array(state), 0.3, 2), rel=1e-15)


@pytest.mark.parametrize(
    ("rhs", "expected"),
    [
        (lambda t, y, a: -np.array([[1.0, 2.0], [0.0, a]]) @ y, ["-1.0*x - 2.0*y", "-a*y"]),
        (lambda t, y, a: np.exp(-y) + a, ["a + exp(-x)", "a + exp(-y)"]),
        (lambda t, y, a: (sp.tanh(y[0]) * y[1], abs(a - 1) * 0), ["y*tanh(x)", "0"]),
        (lambda t, y, a: [np.float64(2) * y[0], 1 / np.sqrt(a + t)], ["2*x", "1/sqrt(a + t)"]),
    ],
)
def test_arrays_and_functions(rhs, expected):
    model = fs.Model.from_function(rhs, ["x", "y"], {"a": 1})
    for rate, text in zip(model.rates.values(), expected, strict=True):
        names = {n: sp.Symbol(n, real=True) for n in "xyat"}
        assert sp.simplify(rate - sp.sympify(text, names)) == 0


def test_conditions_are_regions():
    def relay(t, y):
        return [np.where((y[0] > 1) | (y[0] < -1), -y[0], 1)]

    assert list(fs.Model.from_function(relay, ["x"]).interfaces) == ["x - 1", "x + 1"]


@pytest.mark.parametrize(
    ("rhs", "message"),
    [
        (
            lambda t, y: [1 if y[0] > 0 else 0],
            "the condition x > 0 is decided by Python: .*np.where",
        ),
        (lambda t, y: [max(y[0], 0)], "is decided by Python"),
        (lambda t, y: [1 if sp.sin(y[0]) > 0 else 0], "a condition is decided by Python"),
        (lambda t, y: [math.sin(y[0])], "x is used as a number, .*such as np.sin"),
        (lambda t, y: [np.gcd(y[0], 2)], "np.gcd cannot be traced"),
        (lambda t, y: [1, 2], "the function returned 2 rates for 1 states"),
        (lambda t, y: None, "cannot be traced with symbols|rate of x"),
        (lambda t: [1], r"it is called as rhs\(t, y\)"),
    ],
)
def test_refused(rhs, message):
    with pytest.raises(fs.ModelError, match=message):
        fs.Model.from_function(rhs, ["x"])
