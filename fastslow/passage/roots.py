"""Where a function of one number changes its sign."""

from __future__ import annotations

from collections.abc import Callable

#: Evaluations at most; some ten are usual.
TRIALS = 100


def sign_change(function: Callable[[float], float], low: float, high: float, fine: float) -> float:
    """The upper end of an interval, no longer than ``fine``, within which a function changes sign.

    By regula falsi, the value at the end that stays halved (Illinois).

    Parameters
    ----------
    function : callable
        Of opposite signs at both ends.
    low, high : float
    fine : float

    Examples
    --------
    >>> import math
    >>> abs(sign_change(math.cos, 1.0, 2.0, 1e-15) - math.pi / 2) < 1e-15
    True
    """
    left, right = function(low), function(high)
    if left == 0.0:
        return low
    sense = 1.0 if left > 0.0 else -1.0
    side = 0
    for _ in range(TRIALS):
        middle = 0.5 * (low + high)
        if right == 0.0 or not high - low > fine or not low < middle < high:
            break
        if left != right:
            # one that rounds to an end is put beside it, so that the other end comes there
            estimate = (low * right - high * left) / (right - left)
            inside = min(max(estimate, low + 0.5 * fine), high - 0.5 * fine)
            middle = inside if low < inside < high else middle
        value = function(middle)
        if sense * value > 0.0:
            right = 0.5 * right if side > 0 else right
            low, left, side = middle, value, 1
        else:
            left = 0.5 * left if side < 0 else left
            high, right, side = middle, value, -1
    return high
