"""Quotients with a removable singularity: their values and derivatives of any order.

A quotient such as y/(exp(y) − 1) loses its digits where numerator and denominator vanish, and a
Taylor recurrence that divides by its denominator loses them in the whole disc around that point
where the quotient itself converges. The functions here return derivatives of order k to a few
units in the last place at every argument. They are written in the subset of Python that
`fastslow.kernels.compiler.native` translates, so that machine code and NumPy evaluate the same
formulas.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from decimal import Decimal, localcontext
from functools import cached_property

#: Highest order of a derivative: the highest coefficient of a series, and that of the derivatives
#: of rates.
HIGHEST_DERIVATIVE = 46

#: Highest order in rates and their derivatives, before any series.
LARGEST_ORDER = 6

#: Distance of the points at which `exp_quotient` is expanded, the last of them, and the number of
#: terms beyond the order of the derivative.
_SPACING, _LAST, _TERMS = 0.25, 24.0, 24

_COLUMNS = HIGHEST_DERIVATIVE + _TERMS + 1

#: Digits of the expansions: the division of the series loses some.
_EXPANSION_DIGITS = 80


class _Expansions:
    """Derivatives of y/(exp(y) − 1) at equidistant points, row by row, computed when used."""

    def __getitem__(self, place: int) -> float:
        return self.values[place]

    @cached_property
    def values(self) -> tuple[float, ...]:
        count = round(_LAST / _SPACING) + 1
        with localcontext() as context:
            context.prec = _EXPANSION_DIGITS
            rows = [_derivatives(Decimal(k) * Decimal(_SPACING)) for k in range(count)]
            return tuple(float(value) for row in rows for value in row)


def _derivatives(y: Decimal) -> list[Decimal]:
    """Derivatives of y/(exp(y) − 1) at y ≥ 0, as exp(−y) over the mean of exp(−s y) in [0, 1].

    The mean has no zeros near the real axis, so that the division is stable. Its derivatives
    follow from one another downwards.
    """
    n = _COLUMNS
    power, value = (-y).exp(), Decimal(0)
    means = [value] * n
    for k in range(n + 2 * int(y) + 2 * _EXPANSION_DIGITS, 0, -1):
        # the integral of s^k exp(−s y), by parts
        value = (power + y * value) / k
        if k <= n:
            means[k - 1] = value
    factorial = Decimal(1)
    series: list[Decimal] = []
    below: list[Decimal] = []
    for k in range(n):
        factorial *= k or 1
        below.append((-1) ** k * means[k] / factorial)
        above = (-1) ** k * power / factorial
        series.append((above - sum(series[j] * below[k - j] for j in range(k))) / below[0])
    factorial, found = Decimal(1), []
    for k in range(n):
        factorial *= k or 1
        found.append(series[k] * factorial)
    return found


_EXPANSIONS = _Expansions()


def exp_quotient(y: float, k: int) -> float:
    """Derivative of order k of y/(exp(y) − 1), NaN beyond the highest order."""
    x = abs(y)
    if k > 46 or math.isnan(x):
        return math.nan
    if k == 0:
        if y > 700.0:
            return y * math.exp(-y) if y < 800.0 else 0.0
        return y / math.expm1(y) if y != 0.0 else 1.0
    total = 0.0
    if x <= 24.125:
        # Taylor's polynomial at the nearest point
        row = 0
        step = 64
        while step > 0:
            if (row + step) * 0.25 - 0.125 <= x and row + step <= 96:
                row += step
            step = step // 2
        shift = x - 0.25 * row
        place = 71 * row + k
        for j in range(24):
            left = 23 - j
            total = _EXPANSIONS[place + left] + total * shift / (left + 1.0)
    elif x < 800.0:
        # terms of Σ y exp(−n y), differentiated
        factor = math.exp(-x)
        power = 1.0
        for j in range(1, 40):
            power *= factor
            total += math.pow(j, k - 1.0) * power * (j * x - k)
        if k % 2 == 1:
            total = -total
    if y < 0.0:
        # the quotient at −y differs by y
        if k % 2 == 1:
            total = -total
        if k == 1:
            total -= 1.0
    return total


def sinh_quotient(y: float, k: int) -> float:
    """Derivative of order k of sinh(y)/y."""
    x = abs(y)
    if x > 710.0:
        return -math.inf if y < 0.0 and k % 2 == 1 else math.inf
    value = math.sinh(x)
    slope = math.cosh(x)
    total = 0.0
    if x > k + 1.0:
        # y f = sinh(y), differentiated: upwards while the factors are below 1
        total = value / x
        for m in range(1, k + 1):
            total = ((slope if m % 2 == 1 else value) - m * total) / x
    else:
        # and downwards
        m = k
        size = 1.0
        while size > 1e-18 or m < k + 3:
            m += 1
            size *= x / m
        while m > k:
            total = ((slope if m % 2 == 1 else value) - x * total) / m
            m -= 1
    return -total if y < 0.0 and k % 2 == 1 else total


def sin_quotient(y: float, k: int) -> float:
    """Derivative of order k of sin(y)/y."""
    x = abs(y)
    total = 0.0
    if math.isinf(x):
        return math.nan
    value = math.sin(x)
    slope = math.cos(x)
    if x > k + 1.0:
        total = value / x
        for m in range(1, k + 1):
            now = slope if m % 2 == 1 else value
            total = ((-now if m % 4 > 1 else now) - m * total) / x
    else:
        m = k
        size = 1.0
        while size > 1e-18 or m < k + 3:
            m += 1
            size *= x / m
        while m > k:
            now = slope if m % 2 == 1 else value
            total = ((-now if m % 4 > 1 else now) - x * total) / m
            m -= 1
    return -total if y < 0.0 and k % 2 == 1 else total


def log_quotient(y: float, k: int) -> float:
    """Derivative of order k of log(y)/(y − 1)."""
    if y <= 0.0 or math.isnan(y) or math.isinf(y):
        return math.nan
    if k == 0:
        return math.log(y) / (y - 1.0) if y != 1.0 else 1.0
    ratio = (y - 1.0) / y
    # the derivative is (−1)^k k! y^(−k) times the integral of s^k/(y (1 − ratio s)) over [0, 1]
    total = 0.0
    if ratio < -3.0 or ratio > 0.99 or (k < 3 and ratio > 0.5):
        total = math.log(y) / (y - 1.0)
        for m in range(1, k + 1):
            total = (total - 1.0 / (m * y)) / ratio
    elif ratio >= 0.0:
        power = 1.0
        last = k + 1
        while power > 1e-18:
            power *= ratio
            last += 1
        # from the smallest term
        while last > k:
            total = total * ratio + 1.0 / last
            last -= 1
        total = total / y
    else:
        # in powers of 1 − s, all terms of which are positive
        part = -ratio / (1.0 - ratio)
        term = 1.0 / (k + 1.0)
        j = 0
        while term > 1e-18 / (k + 1.0):
            total += term
            j += 1
            term *= part * j / (k + j + 1.0)
        total = total / (y * (1.0 - ratio))
    for m in range(1, k + 1):
        total *= -m
    return total * math.pow(y, -1.0 * k)


#: The functions by the names in stored operations.
QUOTIENTS: Mapping[str, Callable[[float, int], float]] = {
    function.__name__: function
    for function in (exp_quotient, sinh_quotient, sin_quotient, log_quotient)
}


def tables() -> dict[str, tuple[float, ...]]:
    """Return the tuples of numbers that the functions use, by their names."""
    return {"_EXPANSIONS": _EXPANSIONS.values}
