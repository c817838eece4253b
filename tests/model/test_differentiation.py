"""Derivatives term by term are the expressions of SymPy."""

import numpy as np
import pytest
import sympy as sp

from fastslow.model.differentiation import derivative
from fastslow.model.structure import real

x, y, a = map(real, "xya")


@pytest.mark.parametrize(
    "expression",
    [
        sp.Integer(3),
        x,
        a,
        x**-2,
        sp.sqrt(x),
        (x**2 + a * x) ** sp.Rational(1, 4) * (x + a),
        3 * (x + a) * y,
        sp.Rational(3, 2) * x * (a + y),
        sp.Rational(1, 2) * (a + y) * x**2,
        (x + a) ** 3 * (x - y) / (1 + x**2),
        x * sp.exp(a * x) * sp.sin(x * y) + x / y,
        sp.Float(0.25) * x**3 - sp.tanh(x / a),
        sp.Piecewise((x**2, x > a), (x * y, True)) * x,
        sp.Abs(x - a) * x + sp.sign(y),
    ],
    ids=str,
)
def test_derivatives_are_those_of_sympy(expression):
    for symbol in (x, y, a):
        assert derivative(expression, symbol) == expression.diff(symbol)


def test_a_power_with_a_parameter_as_exponent_has_a_derivative_at_zero():
    for expression in (x**a, a**x, (x - y) ** a * (x + 2) ** y):
        for symbol in (x, y, a):
            assert sp.powsimp(derivative(expression, symbol) - expression.diff(symbol)) == 0
    assert derivative(x**a, x) == a * x ** (a - 1)


def test_derivatives_of_random_polynomials_are_those_of_sympy():
    generator = np.random.default_rng(5)
    for _ in range(6):
        terms = [
            sp.Rational(*map(int, generator.integers(1, 9, 2)))
            * sp.Mul(*(s ** int(generator.integers(-2, 4)) for s in (x, y, a, x + a, y - 2 * x)))
            for _ in range(4)
        ]
        expression = sp.Add(*terms)
        assert derivative(expression, x) == expression.diff(x)
