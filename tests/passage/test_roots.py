"""Changes of sign, against mpmath's numbers and the worst of functions."""

import math

import pytest

from fastslow.passage.roots import sign_change


@pytest.mark.parametrize(
    ("function", "low", "high", "root"),
    [
        (math.cos, 1.0, 2.0, math.pi / 2),
        (lambda s: -math.cos(s), 1.0, 2.0, math.pi / 2),
        (lambda s: s**9 - 2.0**-45, 0.0, 1.0, 2.0**-5),
        (lambda s: math.expm1(40.0 * (s - 0.9)), 0.0, 1.0, 0.9),
        (lambda s: -1.0 if s < 1.0 / 3.0 else 1.0, 0.0, 1.0, 1.0 / 3.0),
        (lambda s: s - 1e-9, 0.0, 1.0, 1e-9),
    ],
)
def test_a_change_of_sign_is_found_to_the_length_asked_for(function, low, high, root):
    count = 0

    def counted(s):
        nonlocal count
        count += 1
        return function(s)

    found = sign_change(counted, low, high, 1e-15)
    assert abs(found - root) <= 1.1e-15
    assert count < 70
    # the sign has changed there
    assert function(found) * function(low) <= 0.0


def test_ends_at_zero_are_roots():
    assert sign_change(lambda s: s, 0.0, 1.0, 1e-15) == 0.0
    assert sign_change(lambda s: s - 1.0, 0.0, 1.0, 1e-15) == 1.0
