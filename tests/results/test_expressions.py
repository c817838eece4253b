"""Expressions in numbers: what SymPy prints is read back to the same value; nothing is run."""

import numpy as np
import pytest
import sympy as sp

from fastslow.errors import ArgumentError, UnknownNameError
from fastslow.results.expressions import evaluated, names_in

B, D, ratio = sp.symbols("B D ratio")


@pytest.mark.parametrize(
    "expression",
    [
        B * ratio,
        sp.sqrt(D) / (1 + ratio**2) - 3,
        -sp.exp(-D) * sp.log(B) ** -2,
        sp.sin(B) * sp.cos(D) + sp.tan(ratio) - sp.pi * sp.Abs(-B),
        sp.Rational(3, 7) * D ** sp.Rational(1, 3),
        sp.Float(0.1),
    ],
)
def test_as_sympy_says(expression):
    values = {"B": 2.372, "D": np.array([0.1, 0.25, 3.0]), "ratio": 1.03}
    for row, width in enumerate(values["D"]):
        exact = float(expression.subs({B: 2.372, D: width, ratio: 1.03}))
        found = np.broadcast_to(evaluated(expression, values), 3)[row]
        assert found == pytest.approx(exact, rel=1e-14)
    assert names_in(expression) == {s.name for s in expression.free_symbols}


def test_numbers_and_text():
    assert evaluated(2, {}) == 2
    assert evaluated("2**-1", {}) == 0.5
    assert evaluated("x", {"x": [1, 2]}).tolist() == [1, 2]
    assert names_in("1 +") == set()


@pytest.mark.parametrize(
    "text", ["__import__('os')", "x.real", "x[0]", "(lambda: 1)()", "sqrt(x, 2)", "x if x else 1"]
)
def test_nothing_else_is_read(text):
    with pytest.raises(ArgumentError, match="expected names, numbers"):
        evaluated(text, {"x": 1.0})


def test_wrong_names_and_grammar():
    with pytest.raises(UnknownNameError, match="'rato'; did you mean 'ratio'"):
        evaluated("B*rato", {"B": 1, "ratio": 2})
    with pytest.raises(ArgumentError, match="no expression in B"):
        evaluated("B B", {"B": 1})
