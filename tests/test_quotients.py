"""Quotients with a removable singularity and their derivatives against mpmath."""

import math

import mpmath
import numpy as np
import pytest

from fastslow.quotients import HIGHEST_DERIVATIVE, LARGEST_ORDER, QUOTIENTS
from fastslow.results.stored.arithmetic import (
    UnknownOperationError,
    check_number,
    value_of,
)
from tests.removable_reference import derivatives

pytestmark = pytest.mark.slow

DISTANCES = [0.0, 1e-300, 1e-16, 1e-8, 1e-3, 0.7, 1.0, 3.1, 8.3, 14.6, 24.1, 24.2, 50.0, 700.0]
POINTS = [sign * y for y in DISTANCES for sign in (1, -1)]
POSITIVE = [
    1e-3,
    0.24,
    0.3,
    0.6,
    1 - 1e-8,
    1.0,
    1 + 1e-16,
    1 + 1e-8,
    1.001,
    2.0,
    20.0,
    51.0,
    99.0,
    101.0,
    701.0,
]
#: Highest coefficient of a series: the order that may be chosen.
ORDER = 40


@pytest.mark.parametrize("name", QUOTIENTS)
def test_all_orders(name):
    """To 1e-15 of the largest modulus within distance 1, to 3e-15 where not near a zero.

    The derivatives of log(y)/(y - 1), of one sign, are right to 2.5e-15 (to 1e-15 below 20).
    """
    points, digits = (POSITIVE, 2.5e-15) if name == "log_quotient" else (POINTS, 1e-15)
    for y in points:
        allowed = 1e-15 if y <= 20.0 else digits
        exact = derivatives(name, y, ORDER)
        beside = [y + d for d in (-1.0, 1.0) if name != "log_quotient" or y + d > 1e-3]
        near = [derivatives(name, z, ORDER) for z in beside]
        for k in range(ORDER + 1):
            found = QUOTIENTS[name](y, k)
            largest = max(abs(d[k]) for d in (exact, *near))
            error = abs(mpmath.mpf(found) - exact[k])
            assert error <= allowed * largest + mpmath.mpf(5e-324), (y, k)
            if abs(exact[k]) > 0.3 * largest and largest > 1e-290:
                assert error <= 3e-15 * abs(exact[k]), (y, k)


def test_far_from_the_singular_point():
    assert QUOTIENTS["exp_quotient"](750.0, 0) == pytest.approx(750 * math.exp(-750), abs=1e-323)
    for k in range(3):
        assert QUOTIENTS["exp_quotient"](1e9, k) == 0.0
    assert QUOTIENTS["exp_quotient"](-1e9, 0) == 1e9
    assert [QUOTIENTS["exp_quotient"](-1e9, k) for k in (1, 2)] == [-1.0, 0.0]
    assert QUOTIENTS["sinh_quotient"](-800.0, 1) == -math.inf
    assert math.isnan(QUOTIENTS["log_quotient"](-1.0, 0))
    for function in QUOTIENTS.values():
        assert math.isnan(function(math.nan, 0))
        assert math.isnan(function(math.nan, 3))


def test_no_value_beyond_the_highest_order():
    assert math.isnan(QUOTIENTS["exp_quotient"](0.5, HIGHEST_DERIVATIVE + 1))


def test_in_stored_arithmetic():
    y = np.array([-1.0, 0.0, 2.0])
    check_number("special.exp_quotient(p0, 1) / 2.0", {"p0"})
    found = value_of("special.exp_quotient(p0, 1) / 2.0", {"p0": y})
    assert found == pytest.approx([QUOTIENTS["exp_quotient"](v, 1) / 2 for v in y], rel=1e-15)
    for wrong in (f"special.exp_quotient(p0, {LARGEST_ORDER + 1})", "special.exp_quotient(p0, p0)"):
        with pytest.raises(UnknownOperationError):
            check_number(wrong, {"p0"})
