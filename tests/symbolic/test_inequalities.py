"""Signs and inequalities decided without SymPy's solvers."""

import numpy as np
import pytest
import sympy as sp
from hypothesis import given, settings
from hypothesis import strategies as st

from fastslow.errors import ArgumentError
from fastslow.model.structure import real
from fastslow.symbolic.signs.assumptions import read_signs
from fastslow.symbolic.signs.inequalities import (
    conjunction,
    implied,
    irredundant,
    positive,
    sign_within,
)
from fastslow.symbolic.signs.signs import Signs
from tests.samples import examples

pytestmark = pytest.mark.slow

A, B, D, x = map(real, ["A", "B", "D", "x"])


@pytest.mark.parametrize(
    ("expression", "expected"),
    [
        (A + D**2, 1),
        (-A * D, -1),
        (A - D, None),
        ((A + D) ** 2 * (A * D + 1), 1),
        (A / (A + D), 1),
        (sp.S.Zero, 0),
        ((A - D) ** 2 + A, 1),
    ],
)
def test_signs(expression, expected):
    assert Signs({A: 1, D: 1}).sign(expression) == expected


def test_a_fact_gives_signs():
    signs = read_signs({"A": 1.0, "D": 1.0}, "A < -D**2")
    assert signs.known == {D: 1, A: -1}
    assert signs.sign(A + D**2) == -1
    assert signs.sign(D**2 - 3 * A) == 1
    assert signs.sign(A + 2 * D**2) is None


values = st.floats(-3, 3).filter(lambda s: abs(s) > 1e-3)


@settings(max_examples=examples(60), deadline=None, derandomize=True)
@given(a=values, b=values, p=values, q=values)
def test_conditions_on_radicals_are_equivalent(a, b, p, q):
    # P + Q√R > 0 with all signs open, against its floating-point value
    P, Q, R = A + B, A - 2 * B, A + 3 * B
    condition = positive(P + Q * sp.sqrt(R), Signs({}))
    inside = a + 3 * b
    if inside < 1e-3:
        return
    value = a + b + (a - 2 * b) * np.sqrt(inside)
    if abs(value) > 1e-9:
        assert bool(condition.subs({A: a, B: b})) == (value > 0)


@settings(max_examples=60, deadline=None, derandomize=True)
@given(a=values, d=st.floats(0.01, 3))
def test_fold_of_the_gear(a, d):
    fold = (D + sp.sqrt(D**2 - 3 * A)) / 3
    condition = positive(fold - D, Signs({D: 1}), [A])
    assert condition == (A < -(D**2))
    if abs(a + d * d) > 1e-9:
        numeric = d * d - 3 * a >= 0 and (d + np.sqrt(max(d * d - 3 * a, 0))) / 3 > d
        assert bool(condition.subs({A: a, D: d})) == numeric


def test_a_root_of_a_negative_number_is_not_positive():
    """2 − √A > 0 for 0 ≤ A < 4, and 2 + √A for A ≥ 0."""
    below, above = (positive(2 + s * sp.sqrt(A), Signs({}), [A]) for s in (-1, 1))
    for value in (-5, -1, 0, 1, 3, 4, 5):
        assert bool(below.subs(A, value)) == (0 <= value < 4)
        assert bool(above.subs(A, value)) == (value >= 0)


def test_products_and_quotients():
    both = positive(A * B, Signs({}))
    for a in (-1, 1):
        for b in (-1, 1):
            assert bool(both.subs({A: a, B: b})) == (a * b > 0)
    assert positive((A - 1) / D, Signs({D: 1}), [A]) == (A > 1)
    assert positive((A - 1) / D, Signs({D: -1}), [A]) == (A < 1)


def test_sign_within_bounds():
    quadratic = 3 * x**2 - 2 * D * x + A
    assert sign_within(quadratic, x, [x - D], Signs({A: 1, D: 1})) == 1
    assert sign_within(quadratic, x, [x - D], Signs({D: 1})) is None
    assert sign_within(x**2 - D**2, x, [x + D, D - x], Signs({D: 1})) == -1


def test_superfluous_conditions():
    assert irredundant((x - D, x + D), Signs({D: 1})) == [x - D]
    assert conjunction([A <= D**2, A < -(D**2)], Signs({D: 1})) == (A < -(D**2))
    assert implied(A < -(D**2), Signs({A: 1, D: 1})) is False
    assert implied(sp.Or(A > B, A > 0), Signs({A: 1})) is True
    assert implied(A > B, Signs({A: 1})) is None


def test_signs_by_counting_roots():
    # x⁵ − 3x + 3 has its minimum 3 − 12/5 (3/5)^(1/4) > 0 for x > 0, and one root below
    quintic = A**5 - 3 * A + 3
    assert Signs({A: 1}).sign(quintic) == 1
    assert Signs({A: -1}).sign(quintic) is None
    assert Signs({A: 1}).sign(A**5 - 3 * A + 1) is None
    # 1 < A < 6/5 lies between its roots 0.3347 and 1.2146
    between = Signs({A: 1}, (A - 1, 6 - 5 * A))
    assert between.sign(A**5 - 3 * A + 1) == -1


@pytest.mark.parametrize(
    "text",
    [
        "__import__('os').getcwd() > 0",
        "A.__class__ > 0",
        "(lambda: A)() > 0",
        "[A for A in (1,)] > 0",
        "9**9**9 > A",
        "A > 0 > B",
        "A == 0",
        "",
    ],
)
def test_assumptions_never_run_code(text):
    with pytest.raises(ArgumentError):
        read_signs({"A": 1.0, "B": 2.0}, text)


def test_assumptions_as_text_and_as_relations_agree():
    values = {"A": 1.0, "D": 2.0}
    text, relation = read_signs(values, "A < -sqrt(2)*D**2"), sp.Lt(A, -sp.sqrt(2) * D**2)
    assert text == read_signs(values, relation)
    with pytest.raises(ArgumentError, match="received 5"):
        read_signs(values, 5)
