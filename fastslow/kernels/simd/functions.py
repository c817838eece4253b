"""Elementary functions of lanes.

Sine and cosine by reduction to an eighth of a turn and the polynomials of
fdlibm (Sun Microsystems 1993), to three units in the last place; other
functions one lane after the other. Logarithm and power to base 2 are for lengths of
steps only, to four digits.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.polynomial import chebyshev

from fastslow.kernels.simd.lanes import Lanes, added, polynomial

# fdlibm's k_sin.c, k_cos.c and e_rem_pio2.c; each part of pi/2 has 33 bits, so that its
# product with a whole number below 2**20 is exact
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
_LARGEST = 1e6

#: Added to a number it leaves the nearest whole number in the last bits.
_SHIFT = 1.5 * 2.0**52


def _fit(function: Callable[[Any], Any]) -> tuple[float, ...]:
    """Coefficients of a polynomial close to a function on [-1, 1]."""
    series = chebyshev.Chebyshev.interpolate(function, 5)
    return tuple(float(c) for c in chebyshev.cheb2poly(series.coef))


_LOGARITHM = _fit(lambda u: np.log2(1.5 + 0.5 * u))
_POWER = _fit(lambda u: np.exp2(0.5 * u))


def _nearest(x: Lanes) -> tuple[Lanes, Lanes]:
    """The nearest whole number, and the shifted number that has it in its last bits."""
    shifted = added(x + _SHIFT)
    return added(shifted - _SHIFT), shifted


def _sine_and_cosine(x: Lanes) -> tuple[Lanes, Lanes]:
    if x.steady:
        return x.trace.one_by_one("sin", x), x.trace.one_by_one("cos", x)
    quarters, shifted = _nearest(x * (2.0 / math.pi))
    rest = x
    for part in _QUARTER:
        rest = added(rest - quarters * part)
    square = added(rest * rest)
    sine = rest + added(square * rest) * polynomial(_SINE, square)
    cosine = added(1.0 - 0.5 * square) + added(square * square) * polynomial(_COSINE, square)
    turned = shifted.bits
    x.trace.conditions.append(abs(x) < _LARGEST)
    return (
        _signed(turned.odd.choose(cosine, sine), turned),
        _signed(turned.odd.choose(sine, cosine), turned + 1),
    )


def _signed(x: Lanes, turned: Any) -> Lanes:
    """The negative in the third and fourth quarter of a turn."""
    return (x.bits ^ ((turned & 2) << 62)).number


def log2(x: Lanes) -> Lanes:
    """Logarithm of a positive number, to four digits after the point."""
    exponent = ((x.bits >> 52) | 0x4330000000000000).number - (2.0**52 + 1023.0)
    fraction = ((x.bits & (2**52 - 1)) | 0x3FF0000000000000).number
    return exponent + polynomial(_LOGARITHM, added(2.0 * fraction - 3.0))


def exp2(x: Lanes) -> Lanes:
    """2 to the power of a number between -1000 and 1000, to four digits."""
    whole, shifted = _nearest(x)
    fraction = polynomial(_POWER, added(2.0 * (x - whole)))
    return (fraction.bits + (shifted.bits << 52)).number


class Mathematics:
    """What generated source calls ``math``, for numbers that are lanes."""

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
        return lambda *arguments: self.trace.one_by_one(name, *arguments)
