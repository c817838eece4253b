"""Sign changes of scalar functions."""

from __future__ import annotations

from collections.abc import Callable

#: Largest number of evaluations; about ten are typical.
ROOT_EVALUATIONS = 100


def sign_change(function: Callable[[float], float], low: float, high: float, fine: float) -> float:
    """Locate a sign change by regula falsi (Illinois); return the upper end of its bracket.

    Parameters
    ----------
    function : callable
        Function with opposite signs at both ends.
    low, high : float
    fine : float
        Largest length of the final bracket.

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
    for _ in range(ROOT_EVALUATIONS):
        middle = 0.5 * (low + high)
        if right == 0.0 or not high - low > fine or not low < middle < high:
            break
        if left != right:
            # an estimate at an end is moved inside, so that the other end moves
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
