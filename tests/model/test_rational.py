"""Quotients of polynomials with roots: equal values, no common factors."""

from fractions import Fraction

import numpy as np
import pytest
import sympy as sp
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from fastslow.model import polynomials
from fastslow.model.rational import decimal, exact, quotient

pytestmark = pytest.mark.slow

x, y, a, b = sp.symbols("x y a b", positive=True)

#: Positive everywhere, with square and cube roots of sums.
CASES = [
    (x + a) ** 3 / (x + a),
    x ** sp.Rational(3, 2) / sp.sqrt(x),
    sp.sqrt(x + a) ** 3 / (x + a),
    1 / (sp.sqrt(x) - sp.sqrt(a + x + 1)),
    (x * y + a) ** -2 - (x * y - a - 50) ** -2,
    1 / (x + sp.sqrt(a)) + 1 / (x + 3 * sp.sqrt(a)),
    (x + 1) ** sp.Rational(2, 3) * (x + 1) ** sp.Rational(1, 3),
    (a - 7 * b) / (x * (a + b)) + sp.Rational(2, 3) * b / x,
    x**-3 + (a + b) ** 4 / x,
    (x + a) ** sp.Rational(5, 7) + 1 / (x + a) ** sp.Rational(2, 7),
]


@pytest.mark.parametrize("case", CASES, ids=str)
@settings(max_examples=5, deadline=None)
@given(st.tuples(*[st.fractions(sp.Rational(1, 9), 9, max_denominator=20)] * 4))
def test_the_value_stays(case, place):
    found = quotient(case)
    at = {s: sp.Rational(v) for s, v in zip((x, y, a, b), place, strict=True)}
    # of a root that was cleared the denominator vanishes where x is its other value
    assume(found.denominator.as_expr().subs(at) != 0)
    whole = (found.numerator.as_expr() / found.denominator.as_expr()).subs(at)
    expected = case.subs(at).n(30)
    for form in (whole, found.expanded().subs(at), found.factored().subs(at)):
        assert abs(form.n(30) - expected) <= sp.Float("1e-20") * (1 + abs(expected))


@pytest.mark.parametrize(
    ("expression", "expected"),
    [
        ((x**2 - a**2) / (x - a), x + a),
        (x ** sp.Rational(3, 2) / sp.sqrt(x), x),
        (sp.sqrt(x + a) ** 4 / (x + a) - x, a),
        ((x + 1) ** sp.Rational(2, 3) * (x + 1) ** sp.Rational(1, 3), x + 1),
        # powers of one root, which SymPy itself does not bring together
        (((x + a) ** sp.Rational(3, 2) + sp.sqrt(x + a)) / (x + a + 1), sp.sqrt(x + a)),
        ((x + 1) ** sp.Rational(4, 3) - x * sp.cbrt(x + 1), sp.cbrt(x + 1)),
        ((x + a) ** 5 / (x + a) ** 3, x**2 + 2 * a * x + a**2),
    ],
)
def test_what_cancels_is_gone(expression, expected):
    found = quotient(expression)
    assert found.denominator == 1
    assert sp.expand(found.expanded() - expected) == 0


def test_one_square_root_goes_to_the_numerator():
    """(x + 2√a)/(x + √a) = (x² + x√a − 2a)/(x² − a)."""
    found = quotient((x + 2 * sp.sqrt(a)) / (x + sp.sqrt(a)))
    assert found.denominator.as_expr() == x**2 - a
    assert sp.expand(found.numerator.as_expr() - (x**2 + x * sp.sqrt(a) - 2 * a)) == 0


def test_what_is_no_quotient_or_too_long():
    assert quotient(sp.sin(x) + 1) is None
    assert quotient((x + a) ** 25) is None
    assert quotient((x + a) ** 24 / (x + a) ** 23) is not None
    assert quotient(x**25) is not None
    assert quotient(sp.Add(*sp.symbols("c0:1600"))) is None
    assert exact(0.25 * x + sp.Float("0.1")) == x / 4 + sp.Rational(1, 10)


def test_past_the_budget_of_factors_a_quotient_is_expanded(monkeypatch):
    found = quotient((x**2 + a) ** 2 * (x**2 + 2 * a + 1) / (x + a))
    assert found.factored() != found.expanded()
    monkeypatch.setattr(polynomials, "BITS", 10)
    with pytest.raises(polynomials.PastBudgetError):
        found.factors()
    assert found.factored() == found.expanded()


@settings(max_examples=200, deadline=None)
@given(st.integers(-(10**9), 10**9), st.integers(-40, 40))
def test_a_float_is_the_decimal_that_was_written(digits, exponent):
    written = f"{digits}e{exponent}"
    number = sp.Rational(written)
    assert exact(float(written)) == exact(np.float64(written)) == number
    assert exact(sp.Float(float(written))) == exact(sp.Float(written, 40)) == number
    assert exact(sp.Float(float(written)) * x) == number * x


@settings(max_examples=200, deadline=None)
@given(st.floats(allow_nan=False, allow_infinity=False))
def test_decimals_are_read_as_the_same_float(number):
    assert float(decimal(number)) == number
    assert decimal(number) == Fraction(repr(number))


@settings(max_examples=200, deadline=None)
@given(*[st.decimals(-99, 99, places=2)] * 3)
def test_sympys_arithmetic_with_decimals_stays_decimal(one, two, three):
    """SymPy multiplies a number into a sum: 1.1 (x - 1.1) is 1.1 x - 1.2100000000000002."""
    written = [sp.Rational(str(n)) for n in (one, two, three)]
    computed = float(one) * (x - float(two)) + float(three)
    expected = sp.expand(written[0] * (x - written[1]) + written[2])
    lost = abs(written[0] * written[1]) + abs(written[2])
    # only a sum that cancels to less than a tenth of its terms may not be recognised
    if computed.subs(x, 0) and abs(expected.subs(x, 0)) * 10 > lost:
        assert exact(sp.expand(computed)) == expected
