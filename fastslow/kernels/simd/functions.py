"""Elementary functions of lanes.

Sine and cosine by reduction to an eighth of a turn and the polynomials of
fdlibm (Sun Microsystems 1993), to three units in the last place; other
functions lane by lane. Logarithm and power to base 2, for step lengths only, have four digits.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.polynomial import chebyshev

from fastslow.kernels.simd.lanes import Lanes, evaluated, polynomial

# fdlibm's k_sin.c, k_cos.c and e_rem_pio2.c; each term of pi/2 has 33 bits, so that its
# product with an integer below 2**20 is exact
_SINE = (
    -1.66666666666666324348e-01,
    8.33333333332248946124e-03,
    -1.98412698298579493134e-04,
    2.75573137070700676789e-06,
    -2.50507602534068634195e-08,
    1.58969099521155010221e-10,
)
_COSINE = (
    4.16666666666666019037e-02,
    -1.38888888888741095749e-03,
    2.48015872894767294178e-05,
    -2.75573143513906633035e-07,
    2.08757232129817482790e-09,
    -1.13596475577881948265e-11,
)
_QUARTER = (1.57079632673412561417e00, 6.07710050630396597660e-11, 2.02226624879595063154e-21)

#: Largest argument of sine and cosine.
_LARGEST_ARGUMENT = 1e6

#: Added to a number, it leaves the nearest integer in the last bits.
_SHIFT = 1.5 * 2.0**52


def _fit(function: Callable[[Any], Any]) -> tuple[float, ...]:
    """Return the coefficients of a polynomial approximation on [-1, 1]."""
    series = chebyshev.Chebyshev.interpolate(function, 5)
    return tuple(float(c) for c in chebyshev.cheb2poly(series.coef))


_LOGARITHM = _fit(lambda u: np.log2(1.5 + 0.5 * u))
_POWER = _fit(lambda u: np.exp2(0.5 * u))


def _nearest(x: Lanes) -> tuple[Lanes, Lanes]:
    """Return the nearest integer, and the shifted number with it in its last bits."""
    shifted = evaluated(x + _SHIFT)
    return evaluated(shifted - _SHIFT), shifted


def _sine_and_cosine(x: Lanes) -> tuple[Lanes, Lanes]:
    if x.invariant:
        return x.trace.lane_by_lane("sin", x), x.trace.lane_by_lane("cos", x)
    quarters, shifted = _nearest(x * (2.0 / math.pi))
    reduced = x
    for term in _QUARTER:
        reduced = evaluated(reduced - quarters * term)
    square = evaluated(reduced * reduced)
    sine = reduced + evaluated(square * reduced) * polynomial(_SINE, square)
    cosine = evaluated(1.0 - 0.5 * square) + evaluated(square * square) * polynomial(
        _COSINE, square
    )
    quadrant = shifted.bits
    x.trace.conditions.append(abs(x) < _LARGEST_ARGUMENT)
    return (
        _signed(quadrant.odd.choose(cosine, sine), quadrant),
        _signed(quadrant.odd.choose(sine, cosine), quadrant + 1),
    )


def _signed(x: Lanes, quadrant: Any) -> Lanes:
    """Negate in the third and fourth quadrant."""
    return (x.bits ^ ((quadrant & 2) << 62)).number


def log2(x: Lanes) -> Lanes:
    """Return the logarithm to base 2 of a positive number, to four decimals."""
    exponent = ((x.bits >> 52) | 0x4330000000000000).number - (2.0**52 + 1023.0)
    fraction = ((x.bits & (2**52 - 1)) | 0x3FF0000000000000).number
    return exponent + polynomial(_LOGARITHM, evaluated(2.0 * fraction - 3.0))


def exp2(x: Lanes) -> Lanes:
    """Return 2 to the power of a number between -1000 and 1000, to four digits."""
    integer, shifted = _nearest(x)
    fraction = polynomial(_POWER, evaluated(2.0 * (x - integer)))
    return (fraction.bits + (shifted.bits << 52)).number


class Mathematics:
    """The functions that generated source calls as ``math``, for lanes."""

    def __init__(self, trace: Any) -> None:
        self.trace = trace

    def sin(self, x: Any) -> Lanes:
        return _sine_and_cosine(self.trace.lanes(x))[0]

    def cos(self, x: Any) -> Lanes:
        return _sine_and_cosine(self.trace.lanes(x))[1]

    def sqrt(self, x: Any) -> Lanes:
        return self.trace.intrinsic("sqrt", x)

    @property
    def pi(self) -> float:
        return math.pi

    @property
    def e(self) -> float:
        return math.e

    def __getattr__(self, name: str) -> Callable[..., Lanes]:
        return lambda *arguments: self.trace.lane_by_lane(name, *arguments)
