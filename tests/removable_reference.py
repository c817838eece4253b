"""Derivatives of quotients with a removable singularity by mpmath, from their power series."""

from functools import cache

import mpmath

#: Largest distance from the singular point at which the series about it is summed.
NEAR = mpmath.mpf("0.05")


def derivatives(name, y, order):
    """Derivatives of orders 0 to ``order`` at y, to many more digits than those of a float."""
    y = mpmath.mpf(y)
    shift = y - (name == "log_quotient")
    with mpmath.workdps(110):
        if abs(shift) < NEAR:
            series = _series(name, order + 30)
            return [
                mpmath.factorial(k)
                * sum(
                    series[m] * mpmath.binomial(m, k) * shift ** (m - k) for m in range(k, k + 30)
                )
                for k in range(order + 1)
            ]
        above, below = _numerator_and_denominator(name, y, order)
        found = []
        for k in range(order + 1):
            rest = mpmath.fsum(found[j] * below[k - j] for j in range(k))
            found.append((above[k] - rest) / below[0])
        return [c * mpmath.factorial(k) for k, c in enumerate(found)]


@cache
def _series(name, terms):
    return [_at_point(name, k) / mpmath.factorial(k) for k in range(terms)]


def _at_point(name, k):
    if name == "exp_quotient":
        return mpmath.bernoulli(k)
    if name == "log_quotient":
        return (-1) ** k * mpmath.factorial(k) / (k + 1)
    sign = -1 if name == "sin_quotient" and k % 4 == 2 else 1
    return sign * mpmath.mpf((k + 1) % 2) / (k + 1)


def _numerator_and_denominator(name, y, order):
    line = [y, mpmath.mpf(1), *[mpmath.mpf(0)] * (order - 1)]
    factorials = [mpmath.factorial(k) for k in range(order + 1)]
    if name == "exp_quotient":
        power = mpmath.exp(y)
        return line, [power - 1, *(power / f for f in factorials[1:])]
    if name == "log_quotient":
        powers = [(-1) ** (k + 1) / (k * y**k) for k in range(1, order + 1)]
        return [mpmath.log(y), *powers], [y - 1, *line[1:]]
    if name == "sinh_quotient":
        cycle = [mpmath.sinh(y), mpmath.cosh(y)] * 2
    else:
        cycle = [mpmath.sin(y), mpmath.cos(y), -mpmath.sin(y), -mpmath.cos(y)]
    return [cycle[k % 4] / f for k, f in enumerate(factorials)], line
