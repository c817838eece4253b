"""Polynomial systems whose solutions are known, with other degrees in every unknown."""

from fractions import Fraction
from itertools import product

import numpy as np
import pytest

from fastslow.continuation import polynomial_systems
from fastslow.continuation.polynomial_systems import _merged, solve_polynomials


def times(one, other):
    """Product of two polynomials, from exponents to coefficients."""
    result = {}
    for (e, a), (f, b) in product(one.items(), other.items()):
        key = tuple(i + j for i, j in zip(e, f, strict=True))
        result[key] = result.get(key, Fraction(0)) + a * b
    return {e: c for e, c in result.items() if c}


def with_roots(roots, axis, count):
    """∏ (x_axis − r)."""
    whole = {(0,) * count: Fraction(1)}
    one = tuple(int(k == axis) for k in range(count))
    for root in roots:
        whole = times(whole, {one: Fraction(1), (0,) * count: -Fraction(root)})
    return whole


def plus(one, other, factor):
    keys = {*one, *other}
    both = {k: one.get(k, Fraction(0)) + factor * other.get(k, Fraction(0)) for k in keys}
    return {k: c for k, c in both.items() if c}


@pytest.mark.parametrize(
    "roots",
    [
        [(-3, Fraction(1, 2), 7)],
        [(-1, 2, 5), (Fraction(1, 3), 4)],
        [(1,), (-2, 3, Fraction(11, 2), 8)],
        [(-1, 2), (3,), (Fraction(-1, 2), 1, 6)],
    ],
)
def test_products_of_known_roots_in_mixed_equations(roots):
    """Every equation plus a multiple of the next one has the same solutions."""
    count = len(roots)
    plain = [with_roots(r, k, count) for k, r in enumerate(roots)]
    mixed = [
        plus(e, plain[(k + 1) % count], Fraction(k + 2, 3)) if k + 1 < count else e
        for k, e in enumerate(plain)
    ]
    found = solve_polynomials(mixed)
    assert found.complete
    assert len(found.clusters) == 0
    expected = np.array(sorted(tuple(map(float, p)) for p in product(*roots)))
    simple = np.array(sorted(map(tuple, found.simple.round(9).tolist())))
    np.testing.assert_allclose(simple, expected, rtol=1e-9, atol=1e-9)


def test_solutions_outside_of_a_range_do_not_count():
    found = solve_polynomials([with_roots((-3, 1, 7), 0, 1)], {0: (0.0, 5.0)})
    assert found.simple.tolist() == [[pytest.approx(1.0, abs=1e-12)]]


def test_a_double_root_is_a_cluster():
    found = solve_polynomials([with_roots((2, 2, -1), 0, 1)])
    np.testing.assert_allclose(found.simple, [[-1.0]], atol=1e-9)
    assert found.clusters.shape[1:] == (2, 1)
    assert found.clusters[:, 0].min() <= 2 <= found.clusters[:, 1].max()


def test_boxes_that_touch_but_for_rounding_are_one():
    boxes = [[[0.0], [1.0]], [[3.000003], [4.0]], [[1.0 + 5e-10], [2.0]], [[2.0], [3.0]]]
    for size in (1.0, 1e-8):
        found = _merged([size * np.array(box) for box in boxes], np.array([size]))
        np.testing.assert_allclose(found[:, :, 0] / size, [[3.000003, 4.0], [0.0, 3.0]])


def test_the_budget_holds_over_pauses(monkeypatch):
    """A pause after every box: a budget of three boxes ends the search all the same."""
    monkeypatch.setattr(polynomial_systems, "WORK", 1)
    equations = [with_roots((-3, 1, 7), 0, 2), with_roots((2, 5), 1, 2)]
    assert solve_polynomials(equations).complete
    monkeypatch.setattr(polynomial_systems, "BUDGET", 3 * 2 * 12)
    assert not solve_polynomials(equations).complete
