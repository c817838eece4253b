"""Divisors and factors of sparse polynomials, against SymPy's own."""

import pytest
import sympy as sp
from hypothesis import given, settings
from hypothesis import strategies as st
from sympy.polys.domains import ZZ
from sympy.polys.rings import ring

from fastslow.model import polynomials
from fastslow.model.polynomials import (
    PastBudgetError,
    coefficients,
    content,
    degree,
    divided,
    factor,
    gcd,
    product,
    square_root,
    used,
)

pytestmark = pytest.mark.slow

R, x, y, a = ring("x y a", ZZ)

terms = st.dictionaries(
    st.tuples(*[st.integers(0, 2)] * 3), st.integers(-5, 5).filter(bool), min_size=1, max_size=4
)
some = terms.map(R.from_dict)


@settings(max_examples=60, deadline=None)
@given(some, some, some)
def test_the_common_divisor_is_that_of_sympy(one, two, shared):
    found = gcd(one * shared, two * shared)
    expected = (one * shared).gcd(two * shared)
    assert found in (expected, -expected)
    assert found.LC > 0
    assert divided(one * shared, found) * found == one * shared
    assert gcd(one * shared, R.zero) in (one * shared, -one * shared)


@settings(max_examples=40, deadline=None)
@given(some, some, st.integers(1, 3))
def test_factors_multiply_to_the_whole(one, two, power):
    whole = one * two**power
    number, parts = factor(whole)
    result = R.one * number
    for part, exponent in parts:
        assert part.LC > 0
        assert not part.is_ground
        result *= part**exponent
    assert result == whole
    content_, known = whole.factor_list()
    assert abs(number) == abs(int(content_))
    assert sorted(e for _, e in parts) == sorted(int(e) for _, e in known)


@settings(max_examples=40, deadline=None)
@given(some, some)
def test_division_is_exact_or_none(one, by):
    quotient, rest = one.div(by)
    assert divided(one, by) == (None if rest else quotient)
    assert divided(one * by, by) == one


def test_parts_by_one_generator():
    poly = 3 * x**2 * y - x**2 * a + 5 * y
    assert coefficients(poly, 0) == {2: 3 * y - a, 0: 5 * y}
    assert [degree(poly, k) for k in range(3)] == [2, 1, 1]
    assert used(poly - 3 * x**2 * y - 5 * y) == [0, 2]
    assert content(6 * x * y**2 + 4 * x**2 * y, 0) == 2 * y
    assert content((x + y) * a + (x + y) * (x - y) * a**2, 2) == x + y


def test_square_roots_of_squares_only():
    root = 2 * x * (x - 3 * y) * a**2
    assert square_root(root**2) in (root, -root)
    for none in (-(root**2), 2 * root**2, root**2 * a, root**3):
        assert square_root(none) is None


def test_what_is_past_the_budget_raises(monkeypatch):
    many = sum((x**k for k in range(200)), R.zero)
    with pytest.raises(PastBudgetError):
        product(many, many)
    wide = sum((x**j * y**k for j in range(25) for k in range(25)), R.zero)
    with pytest.raises(PastBudgetError):
        product(wide, R.one)
    one, two = (x**2 + 1) * (x**2 + 2), (x**2 + 1) * (x**2 + 3)
    assert gcd(one, two) == x**2 + 1
    # coefficients up to 4 have 3 bits, 2 are added, and of degree 4 there are 5: 25
    monkeypatch.setattr(polynomials, "BITS", 25)
    assert gcd(one, two) == x**2 + 1
    monkeypatch.setattr(polynomials, "BITS", 24)
    with pytest.raises(PastBudgetError):
        gcd(one, two)


def test_a_long_number_is_no_content():
    """−6 x + 4 y: the sign goes with the number, the factor begins positive."""
    assert factor(-6 * x + 4 * y) == (-2, [(3 * x - 2 * y, 1)])
    assert factor(R.one * -7) == (-7, [])
    assert sp.prod(e for _, e in factor((x**2 + y) ** 3)[1]) == 3
