"""The root finder of a step, against polynomials with known roots."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numba import njit
from numpy.polynomial import polynomial as P

from fastslow.simulation.stepper.polynomials import DEEPEST, first_root, take_samples, to_bernstein
from tests.samples import examples

pytestmark = pytest.mark.slow


@njit
def _call(b, first, last, noise, stack, touches):
    return first_root(b, first, last, noise, stack, touches)


def root(coefficients, noise=1e-15, first=0, touches=True):
    b = np.array(coefficients, dtype=float)
    return _call(b, first, len(b) - 1, noise, np.empty((DEEPEST + 2, len(b) + 4)), touches)


@given(st.lists(st.floats(-1.5, 2.5), min_size=1, max_size=7))
@settings(max_examples=examples(200), deadline=None)
def test_the_first_of_many_roots(roots):
    roots = sorted(roots)
    if any(abs(r) < 1e-3 or abs(r - 1) < 1e-3 for r in roots):
        return
    if min(np.diff(roots), default=1.0) < 1e-2:
        return
    inside = [r for r in roots if 0 < r <= 1]
    s, touch = root(P.polyfromroots(roots))
    assert not touch
    assert s == pytest.approx(inside[0], abs=1e-8) if inside else s > 1


@pytest.mark.parametrize("gap", [1e-2, 1e-4, 1e-6])
def test_close_pairs_are_told_apart(gap):
    s, touch = root(P.polyfromroots([0.37 - gap / 2, 0.37 + gap / 2]), noise=1e-17)
    assert not touch
    assert s == pytest.approx(0.37 - gap / 2, abs=1e-16 / gap)


def test_a_double_root_is_a_touch_or_nothing():
    s, touch = root(P.polyfromroots([0.3, 0.3]))
    assert touch
    assert s == pytest.approx(0.3, abs=1e-7)
    s, _ = root(np.add(P.polyfromroots([0.3, 0.3]), [1e-12, 0, 0]))
    assert s > 1


def test_roots_behind_a_touch():
    s, touch = root(P.polyfromroots([0.3, 0.3, 0.7]), touches=False)
    assert not touch
    assert s == pytest.approx(0.7, abs=1e-14)


@pytest.mark.parametrize("order", [3, 16, 24])
def test_a_triple_root_is_a_sign_change(order):
    """At 1/2 the first bisection ends on the root, with values that are rounding errors."""
    b = np.zeros(order + 1)
    b[:4] = [1, -6, 12, -8]
    s, touch = root(b, touches=False)
    assert not touch
    assert s == pytest.approx(0.5, abs=1e-5)


def test_a_known_root_at_the_start_is_left_out():
    s, _ = root(P.polyfromroots([0, 0.6, 2]), first=1)
    assert s == pytest.approx(0.6, abs=1e-15)


def test_roots_at_the_end_and_at_a_division():
    assert root(P.polyfromroots([1.0, 3.0]))[0] == 1.0
    assert root(P.polyfromroots([0.5, 3.0]))[0] == 0.5


#: An interface function along a step of a piecewise-linear system, up to its root.
STEP = [
    -16.032518176094182, 12.213726115908715, 5.440449917779179, -1.3673842256388868,
    -0.3068741081122470, 4.6532974016430188e-2, 6.9019709485304611e-3, -7.5875977020397754e-4,
    -8.3024023720064470e-5, 7.2373880408558787e-6, 6.2083553485648413e-7, -4.5238763459206378e-8,
    -3.1634629819869550e-9, 1.9947372307283201e-10, 1.1686005285617954e-11,
    -6.5341316926236988e-13, -3.2724738645825274e-14,
]  # fmt: skip


def test_every_root_is_located_to_rounding():
    """At an end of its bracket, too: there a halved bracket once passed for convergence."""
    for longer in np.linspace(1.0001, 3, 5001):
        series = STEP * longer ** np.arange(len(STEP))
        s, touch = root(series, noise=1e-14)
        assert not touch
        assert abs(P.polyval(s, series)) < 1e-14 * np.abs(series).sum()


@pytest.mark.parametrize("n", range(20))
def test_bernstein_coefficients_are_summed_as_in_the_triangle_of_pascal(n):
    """To the last bit: row after row, though two rows are made at a time."""
    b = np.random.default_rng(n).normal(size=n + 3)
    stack = np.zeros((2, n + 4))
    to_bernstein(b, 2, n, stack)
    row = [b[2 + k] * (1.0 / math.comb(n, k)) for k in range(n + 1)]
    for level in range(1, n + 1):
        row[level:] = [row[j] + row[j - 1] for j in range(level, n + 1)]
    assert stack[0].tolist() == [*row, 0.0, 1.0, 0.0]


@njit(fastmath={"contract"})
def _four(W, columns, times, out):
    """Blocks of four by Horner's rule, one number after the other."""
    for i in range(out.shape[0]):
        for c in range(times.shape[0] - times.shape[0] % 4):
            value = W[i * columns + columns - 1]
            for k in range(columns - 2, -1, -1):
                value = value * times[c] + W[i * columns + k]
            out[i, c] = value


@njit
def _taken(W, columns, step, times, out, first, offsets):
    return take_samples(W, columns, step, times, out, first, offsets)


@pytest.mark.parametrize("count", [0, 1, 3, 4, 11, 64, 203])
def test_samples_are_those_of_one_number_after_the_other(count):
    """In portions, and of the rest of a portion that is no block of four to rounding."""
    columns, rng = 17, np.random.default_rng(count)
    W, times = rng.normal(size=3 * columns), np.sort(rng.uniform(0.0, 0.9, count))
    late = np.append(times, [1.5, 2.0])
    got = np.full((3, 2 + len(late)), np.nan)
    before = np.concatenate([[-2.0, -1.0], late])
    # an end before the last two, and two that were taken before
    assert _taken(W, columns, (0.0, 0.0, 1.0), before, got, 2, np.empty(8)) == 2 + count
    assert np.isnan(got[:, [0, 1, -2, -1]]).all()
    one = np.zeros((3, count))
    _four(W, columns, times, one)
    whole = count - count % 4
    np.testing.assert_array_equal(got[:, 2 : 2 + whole], one[:, :whole])
    exact = [P.polyval(times, row) for row in W.reshape(3, columns)]
    np.testing.assert_allclose(got[:, 2:-2], exact, rtol=1e-13, atol=1e-14)
