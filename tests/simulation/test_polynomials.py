"""The root finder of a step, against polynomials with known roots."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numba import njit
from numpy.polynomial import polynomial as P

from fastslow.simulation.polynomials import DEEPEST, first_root


@njit
def _call(b, first, last, noise, stack):
    return first_root(b, first, last, noise, stack)


def root(coefficients, noise=1e-15, first=0):
    b = np.array(coefficients, dtype=float)
    return _call(b, first, len(b) - 1, noise, np.empty((DEEPEST + 2, len(b) + 4)))


@given(st.lists(st.floats(-1.5, 2.5), min_size=1, max_size=7))
@settings(max_examples=200, deadline=None)
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


def test_a_known_root_at_the_start_is_left_out():
    s, _ = root(P.polyfromroots([0, 0.6, 2]), first=1)
    assert s == pytest.approx(0.6, abs=1e-15)


def test_roots_at_the_end_and_at_a_division():
    assert root(P.polyfromroots([1.0, 3.0]))[0] == 1.0
    assert root(P.polyfromroots([0.5, 3.0]))[0] == 0.5
