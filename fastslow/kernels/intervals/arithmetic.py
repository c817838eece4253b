"""Interval arithmetic on pairs (low, high) of floating-point numbers, rounded outwards.

Every operation is computed to nearest and then moved outwards: the numbers c ∓ (φ|c| + η) enclose
the exact result of an operation whose rounded result is c, with φ = 2⁻⁵³(1 + 2⁻⁵²) and η at least
the smallest positive number (Rump, Zimmermann, Boldo and Melquiond, BIT 49, 2009, algorithm 1).
An interval is finite or the whole line: whatever overflows or is not defined on all of an
argument becomes (−∞, ∞). Elementary functions are computed from sums, products and quotients, so
that the results do not depend on the C library.
"""

from __future__ import annotations

import math

from fastslow.kernels.compiler.decorators import unfused_kernel

#: Relative and absolute widening of a rounded result. The absolute one covers numbers below the
#: normal range too, also where the processor replaces them by zero.
PHI = 2.0**-53 * (1.0 + 2.0**-52)
ETA = 2.0**-1019

#: Largest finite number.
LARGEST_NUMBER = 1.7976931348623157e308

#: Relative widening of `exp_estimate`, whose error is below 2·2⁻⁵³: reduction 0.35, remainder of
#: the series 0.05, Horner's scheme 0.43, and the last sum at most 1, all in units of 2⁻⁵³.
EXP_ERROR = 8.0 * 2.0**-53

#: Bound of the arguments of exponentials, and bounds of e^(±700).
EXP_RANGE, EXP_TINY, EXP_HUGE = 700.0, 1e-304, 1e304

#: Widening of an estimate of a logarithm, verified by the exponential.
LOG_ERROR = 2.0**-49

#: log 2 and π/2 as exact leading parts and remainders.
LOG2_HIGH, LOG2_LOW = 6.93147180369123816490e-01, 1.90821492927058770002e-10
PI2_HIGH, PI2_LOW = 1.57079632673412561417, 6.07710050650619224932e-11

#: Largest argument of sine and cosine whose multiple of π/2 has an exact leading part.
EXACT_ARGUMENT = 1e6

#: Coefficients of y/(e^y − 1), Bernoulli numbers over factorials, and the error of its series of
#: these terms and of its first and second derivatives for |y| < 1/2, rounding included.
SERIES = (
    1.0, -0.5, 1 / 12.0, 0.0, -1 / 720.0, 0.0, 1 / 30240.0, 0.0, -1 / 1209600.0, 0.0,
    1 / 47900160.0, 0.0, -691 / 1307674368000.0, 0.0, 1 / 74724249600.0,
)  # fmt: skip
SERIES_RANGE, SERIES_ERROR = 0.5, 4e-15

#: Beyond this argument y/(e^y − 1) and its derivatives are below `QUOTIENT_TINY` in modulus.
QUOTIENT_RANGE, QUOTIENT_TINY = 600.0, 1e-250


@unfused_kernel
def outwards(low, high):  # type: ignore[no-untyped-def]
    """Enclose the exact bounds of which low and high are the rounded values."""
    low = low - (PHI * abs(low) + ETA)
    high = high + (PHI * abs(high) + ETA)
    if low >= -LARGEST_NUMBER and high <= LARGEST_NUMBER:
        return low, high
    return -math.inf, math.inf


@unfused_kernel
def add(a, b):  # type: ignore[no-untyped-def]
    """Enclose a + b."""
    return outwards(a[0] + b[0], a[1] + b[1])


@unfused_kernel
def subtract(a, b):  # type: ignore[no-untyped-def]
    """Enclose a − b."""
    return outwards(a[0] - b[1], a[1] - b[0])


@unfused_kernel
def negative(a):  # type: ignore[no-untyped-def]
    """Enclose −a."""
    return -a[1], -a[0]


@unfused_kernel
def multiply(a, b):  # type: ignore[no-untyped-def]
    """Enclose a b."""
    p, q, r, s = a[0] * b[0], a[0] * b[1], a[1] * b[0], a[1] * b[1]
    low, high = (p, q) if p < q else (q, p)
    low = r if r < low else low
    high = r if r > high else high
    low = s if s < low else low
    high = s if s > high else high
    return outwards(low, high)


@unfused_kernel
def scale(c, a):  # type: ignore[no-untyped-def]
    """Multiply an interval by a number."""
    p, q = c * a[0], c * a[1]
    if c < 0.0:
        return outwards(q, p)
    return outwards(p, q)


@unfused_kernel
def divide(a, b):  # type: ignore[no-untyped-def]
    """Enclose a/b, without bounds if b contains 0."""
    if not (b[0] > 0.0 or b[1] < 0.0):
        return -math.inf, math.inf
    p, q, r, s = a[0] / b[0], a[0] / b[1], a[1] / b[0], a[1] / b[1]
    low, high = (p, q) if p < q else (q, p)
    low = r if r < low else low
    high = r if r > high else high
    low = s if s < low else low
    high = s if s > high else high
    return outwards(low, high)


@unfused_kernel
def magnitudes(a):  # type: ignore[no-untyped-def]
    """Smallest and largest modulus in an interval."""
    low, high = abs(a[0]), abs(a[1])
    if low > high:
        low, high = high, low
    if a[0] <= 0.0 <= a[1]:
        low = 0.0
    return low, high


@unfused_kernel
def square(a):  # type: ignore[no-untyped-def]
    """Enclose a²."""
    low, high = magnitudes(a)
    low, high = outwards(low * low, high * high)
    if low < 0.0 and high < math.inf:
        low = 0.0
    return low, high


@unfused_kernel
def _power_of_number(x, n):  # type: ignore[no-untyped-def]
    base, result = (x, x), (1.0, 1.0)
    while n > 0:
        if n % 2 == 1:
            result = multiply(result, base)
        n //= 2
        if n > 0:
            base = multiply(base, base)
    return result


@unfused_kernel
def power(a, n):  # type: ignore[no-untyped-def]
    """Integer power, even ones by the modulus."""
    size = abs(n)
    if size == 2:
        result = square(a)
    elif size % 2 == 0:
        low, high = magnitudes(a)
        low, high = max(_power_of_number(low, size)[0], 0.0), _power_of_number(high, size)[1]
        result = (low, high) if high < math.inf else (-math.inf, math.inf)
    else:
        low, high = _power_of_number(a[0], size)[0], _power_of_number(a[1], size)[1]
        finite = low > -math.inf and high < math.inf
        result = (low, high) if finite else (-math.inf, math.inf)
    return divide((1.0, 1.0), result) if n < 0 else result


@unfused_kernel
def square_root(a):  # type: ignore[no-untyped-def]
    """Enclose √a, without bounds if a contains negative numbers."""
    if not (a[0] >= 0.0 and a[1] <= LARGEST_NUMBER):
        return -math.inf, math.inf
    # IEEE arithmetic rounds square roots correctly
    low, high = outwards(math.sqrt(a[0]), math.sqrt(a[1]))
    return max(low, 0.0), high


@unfused_kernel
def _two_to(k):  # type: ignore[no-untyped-def]
    """Power of two with an exponent of at most 1022 in modulus, exactly."""
    base, n, result = 2.0, abs(k), 1.0
    while n > 0:
        if n % 2 == 1:
            result *= base
        n //= 2
        if n > 0:
            base *= base
    return 1.0 / result if k < 0 else result


@unfused_kernel
def exp_estimate(x):  # type: ignore[no-untyped-def]
    """e^x for |x| ≤ 700, by Cody and Waite's reduction and Taylor's polynomial of degree 13."""
    k = math.floor(x * 1.4426950408889634 + 0.5)
    r = (x - k * LOG2_HIGH) - k * LOG2_LOW
    s = 1.0 / 6227020800.0
    s = s * r + 1.0 / 479001600.0
    s = s * r + 1.0 / 39916800.0
    s = s * r + 1.0 / 3628800.0
    s = s * r + 1.0 / 362880.0
    s = s * r + 1.0 / 40320.0
    s = s * r + 1.0 / 5040.0
    s = s * r + 1.0 / 720.0
    s = s * r + 1.0 / 120.0
    s = s * r + 1.0 / 24.0
    s = s * r + 1.0 / 6.0
    s = s * r + 0.5
    s = 1.0 + ((s * r) * r + r)
    return s * _two_to(int(k))


@unfused_kernel
def exponential(a):  # type: ignore[no-untyped-def]
    """Enclose e^a."""
    if not (a[1] <= EXP_RANGE and a[0] >= -LARGEST_NUMBER):
        return -math.inf, math.inf
    low, high = 0.0, EXP_TINY
    if a[0] > -EXP_RANGE:
        low = exp_estimate(a[0])
        low -= EXP_ERROR * low
    if a[1] > -EXP_RANGE:
        high = exp_estimate(a[1])
        high += EXP_ERROR * high
    return low, high


@unfused_kernel
def _exp_of(x):  # type: ignore[no-untyped-def]
    return exponential((x, x))


@unfused_kernel
def _log_of(x):  # type: ignore[no-untyped-def]
    """Logarithm of a positive number: an estimate by Halley's method, verified by e^y."""
    if not EXP_TINY < x < EXP_HUGE:
        return -math.inf, math.inf
    k, m, step = 0, x, 512
    while step > 0:
        size = _two_to(step)
        if m >= size:
            m /= size
            k += step
        elif m * size < 2.0:
            m *= size
            k -= step
        step //= 2
    y = 2.0 * (m - 1.0) / (m + 1.0)
    for _ in range(3):
        e = exp_estimate(y)
        y += 2.0 * (m - e) / (m + e)
    y += k * 0.6931471805599453
    error = LOG_ERROR * (1.0 + abs(y))
    low, high = y - error, y + error
    if _exp_of(low)[1] <= x <= _exp_of(high)[0]:
        return low, high
    return -math.inf, math.inf


@unfused_kernel
def logarithm(a):  # type: ignore[no-untyped-def]
    """Enclose log a, without bounds unless a > 0."""
    if not (a[0] > 0.0 and a[1] <= LARGEST_NUMBER):
        return -math.inf, math.inf
    low, high = _log_of(a[0])[0], _log_of(a[1])[1]
    if low >= -LARGEST_NUMBER and high <= LARGEST_NUMBER:
        return low, high
    return -math.inf, math.inf


@unfused_kernel
def real_power(a, b):  # type: ignore[no-untyped-def]
    """a^b for a > 0."""
    return exponential(multiply(b, logarithm(a)))


@unfused_kernel
def _sine_of(x, quarter):  # type: ignore[no-untyped-def]
    """Sine of a number plus quarter turns, |x| ≤ `EXACT_ARGUMENT`."""
    k = math.floor(x / 1.5707963267948966 + 0.5)
    # the leading product is exact
    r = subtract((x, x), (k * PI2_HIGH, k * PI2_HIGH))
    r = subtract(r, scale(float(k), outwards(PI2_LOW, PI2_LOW)))
    turn = (int(k) + quarter) % 4
    z, n = negative(square(r)), 19 if turn % 2 == 0 else 18
    # Taylor's polynomial of degree 17 or 16, with its remainder, as |r| < 0.8
    s = (-1.0, 1.0)
    while n > 1:
        s = add((1.0, 1.0), multiply(s, divide(z, (n * (n - 1.0), n * (n - 1.0)))))
        n -= 2
    if turn % 2 == 0:
        s = multiply(s, r)
    return negative(s) if turn >= 2 else s


@unfused_kernel
def _contains_turn(a, phase):  # type: ignore[no-untyped-def]
    """True unless an interval certainly contains no phase + 2πj, the phase in units of π/2."""
    quarter = outwards(1.5707963267948966, 1.5707963267948966)
    low = scale(0.25, subtract(divide((a[0], a[0]), quarter), (phase, phase)))
    high = scale(0.25, subtract(divide((a[1], a[1]), quarter), (phase, phase)))
    return math.ceil(low[0]) <= high[1]


@unfused_kernel
def sine(a, quarter):  # type: ignore[no-untyped-def]
    """Sine of an interval plus quarter turns: 0 for the sine, 1 for the cosine."""
    if not (a[0] >= -EXACT_ARGUMENT and a[1] <= EXACT_ARGUMENT):
        return -1.0, 1.0
    first, last = _sine_of(a[0], quarter), _sine_of(a[1], quarter)
    low = -1.0 if _contains_turn(a, 3.0 - quarter) else max(min(first[0], last[0]), -1.0)
    high = 1.0 if _contains_turn(a, 1.0 - quarter) else min(max(first[1], last[1]), 1.0)
    return low, high


@unfused_kernel
def tangent(a):  # type: ignore[no-untyped-def]
    """Enclose tan a, without bounds near a pole."""
    cosine = sine(a, 1)
    if cosine[0] <= 0.0 <= cosine[1]:
        return -math.inf, math.inf
    first = divide(sine((a[0], a[0]), 0), sine((a[0], a[0]), 1))
    last = divide(sine((a[1], a[1]), 0), sine((a[1], a[1]), 1))
    return first[0], last[1]


@unfused_kernel
def _arctangent_of(x):  # type: ignore[no-untyped-def]
    quarter = outwards(1.5707963267948966, 1.5707963267948966)
    size = abs(x)
    t = divide((1.0, 1.0), (size, size)) if size > 1.0 else (size, size)
    for _ in range(2):
        # half of the angle
        root = square_root(add((1.0, 1.0), square(t)))
        t = divide(t, add((1.0, 1.0), root))
    # the series alternates: the first term left out bounds the remainder, as t < 0.2
    z, s, n = negative(square(t)), (0.0, 1.0 / 31.0), 29
    while n > 0:
        s = add(divide((1.0, 1.0), (float(n), float(n))), multiply(s, z))
        n -= 2
    s = scale(4.0, multiply(s, t))
    if size > 1.0:
        s = subtract(quarter, s)
    return negative(s) if x < 0.0 else s


@unfused_kernel
def arctangent(a):  # type: ignore[no-untyped-def]
    """Enclose atan a."""
    if not (a[0] >= -LARGEST_NUMBER and a[1] <= LARGEST_NUMBER):
        return outwards(-1.5707963267948966, 1.5707963267948966)
    return _arctangent_of(a[0])[0], _arctangent_of(a[1])[1]


@unfused_kernel
def _arcsine_of(x):  # type: ignore[no-untyped-def]
    left = multiply(subtract((1.0, 1.0), (x, x)), add((1.0, 1.0), (x, x)))
    return arctangent(divide((x, x), square_root(left)))


@unfused_kernel
def arcsine(a):  # type: ignore[no-untyped-def]
    """Enclose asin a, without bounds unless −1 < a < 1."""
    if not (a[0] > -1.0 and a[1] < 1.0):
        return -math.inf, math.inf
    return _arcsine_of(a[0])[0], _arcsine_of(a[1])[1]


@unfused_kernel
def _hyperbolic_sine_of(x):  # type: ignore[no-untyped-def]
    e = _exp_of(x)
    return scale(0.5, subtract(e, divide((1.0, 1.0), e)))


@unfused_kernel
def hyperbolic_sine(a):  # type: ignore[no-untyped-def]
    """Enclose sinh a."""
    if not (a[0] > -EXP_RANGE and a[1] < EXP_RANGE):
        return -math.inf, math.inf
    return _hyperbolic_sine_of(a[0])[0], _hyperbolic_sine_of(a[1])[1]


@unfused_kernel
def _hyperbolic_cosine_of(x):  # type: ignore[no-untyped-def]
    e = _exp_of(x)
    return scale(0.5, add(e, divide((1.0, 1.0), e)))


@unfused_kernel
def hyperbolic_cosine(a):  # type: ignore[no-untyped-def]
    """Enclose cosh a."""
    low, high = magnitudes(a)
    if not high < EXP_RANGE:
        return -math.inf, math.inf
    return max(_hyperbolic_cosine_of(low)[0], 1.0), _hyperbolic_cosine_of(high)[1]


@unfused_kernel
def _hyperbolic_tangent_of(x):  # type: ignore[no-untyped-def]
    if x > 20.0:
        return 1.0 - 1e-16, 1.0
    if x < -20.0:
        return -1.0, -1.0 + 1e-16
    e = _exp_of(2.0 * x)
    return subtract((1.0, 1.0), divide((2.0, 2.0), add(e, (1.0, 1.0))))


@unfused_kernel
def hyperbolic_tangent(a):  # type: ignore[no-untyped-def]
    """Enclose tanh a."""
    low, high = _hyperbolic_tangent_of(a[0])[0], _hyperbolic_tangent_of(a[1])[1]
    return max(low, -1.0), min(high, 1.0)


@unfused_kernel
def _series_of(y, order):  # type: ignore[no-untyped-def]
    """Series of y/(e^y − 1), or of its first or second derivative."""
    s = 0.0
    for i in range(14, order - 1, -1):
        factor = 1.0
        for j in range(order):
            factor *= i - j
        s = s * y + factor * SERIES[i]
    return s - SERIES_ERROR, s + SERIES_ERROR


@unfused_kernel
def _quotient_of(y):  # type: ignore[no-untyped-def]
    if abs(y) < SERIES_RANGE:
        return _series_of(y, 0)
    if y > QUOTIENT_RANGE:
        return 0.0, QUOTIENT_TINY
    return divide((y, y), subtract(_exp_of(y), (1.0, 1.0)))


@unfused_kernel
def _first_slope_of(y):  # type: ignore[no-untyped-def]
    """(e^y − 1 − y e^y)/(e^y − 1)²."""
    if abs(y) < SERIES_RANGE:
        return _series_of(y, 1)
    if y > QUOTIENT_RANGE:
        return -QUOTIENT_TINY, 0.0
    e = _exp_of(y)
    inverse = divide((1.0, 1.0), subtract(e, (1.0, 1.0)))
    return multiply(inverse, subtract((1.0, 1.0), multiply((y, y), multiply(e, inverse))))


@unfused_kernel
def _second_slope_of(y):  # type: ignore[no-untyped-def]
    """e^y (y(e^y + 1) − 2(e^y − 1))/(e^y − 1)³ for y ≥ 0."""
    if y < SERIES_RANGE:
        return _series_of(y, 2)
    if y > 0.5 * QUOTIENT_RANGE:
        return 0.0, 1e-120
    e = _exp_of(y)
    m = subtract(e, (1.0, 1.0))
    inverse = divide((1.0, 1.0), m)
    top = subtract(multiply((y, y), add(e, (1.0, 1.0))), scale(2.0, m))
    return multiply(multiply(multiply(e, inverse), square(inverse)), top)


@unfused_kernel
def exp_quotient(a, order):  # type: ignore[no-untyped-def]
    """y/(e^y − 1), continuous at 0, or its first or second derivative.

    The function decreases, its slope increases from −1 to 0, and the second derivative is even
    and decreases with |y|.
    """
    if not (a[0] >= -LARGEST_NUMBER and a[1] <= LARGEST_NUMBER):
        return -math.inf, math.inf
    if order == 0:
        return max(_quotient_of(a[1])[0], 0.0), _quotient_of(a[0])[1]
    if order == 1:
        return max(_first_slope_of(a[0])[0], -1.0), min(_first_slope_of(a[1])[1], 0.0)
    low, high = magnitudes(a)
    return max(_second_slope_of(high)[0], 0.0), _second_slope_of(low)[1]
