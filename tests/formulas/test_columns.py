"""Expressions in named columns."""

import numpy as np
import pytest
import sympy as sp

from fastslow import ArgumentError, UnknownNameError
from fastslow.formulas.columns import evaluated, names_in

x, v = sp.symbols("x v")
VALUES = {"x": np.array([0.3, -1.2]), "v": np.array([2.0, 0.5]), "k": 3.0}


@pytest.mark.parametrize(
    "expression",
    [
        x**2 + v,
        sp.sqrt(v) * sp.exp(-x) / 3,
        sp.Abs(x) - sp.sign(x) * sp.tanh(v),
        sp.sin(x) ** 3 + sp.pi - sp.E * sp.log(v),
        -x / (1 + sp.Symbol("k") * v**2),
        sp.atan(x) + sp.cosh(v) - sp.Rational(1, 7),
        sp.tan(x) * v ** sp.Rational(1, 3) - sp.Float(0.1),
    ],
)
def test_it_agrees_with_sympy(expression):
    names = [sp.Symbol(n) for n in VALUES]
    expected = sp.lambdify(names, expression, "numpy")(*VALUES.values())
    assert evaluated(expression, VALUES) == pytest.approx(expected, rel=1e-14)


def test_a_number_alone_is_an_expression():
    assert float(evaluated("2.5", VALUES)) == 2.5


def test_a_name_need_not_be_an_identifier():
    assert evaluated("x - D", {"x - D": np.ones(2)}).tolist() == [1.0, 1.0]


@pytest.mark.parametrize(
    "text",
    [
        "x +",
        "x.real",
        "x[0]",
        "open('f')",
        "sin(x, v)",
        "lambda: x",
        "x if v else k",
        "'x'",
        "True",
        "__import__('os')",
        "x v",
    ],
)
def test_what_is_no_expression_is_refused(text):
    with pytest.raises(ArgumentError, match="is not an expression in x, v, k"):
        evaluated(text, VALUES)


def test_a_nearly_right_name_is_suggested():
    with pytest.raises(UnknownNameError, match="'rato'; did you mean 'ratio'"):
        evaluated("B*rato", {"B": 1, "ratio": 2})


def test_an_unknown_name_is_refused():
    with pytest.raises(UnknownNameError, match="unknown name in an expression 'y'"):
        evaluated("x + y", VALUES)


def test_names():
    assert names_in("k*sin(x) + x + pi", VALUES) == {"k", "x"}
