"""The common period of harmonics."""

from __future__ import annotations

import math
from collections.abc import Iterable
from fractions import Fraction


def period_of(frequencies: Iterable[float]) -> float | None:
    """Return the common period of harmonics with given angular frequencies, None without one."""
    positive = [abs(f) for f in frequencies if f != 0]
    if not positive:
        return None
    base = min(positive)
    ratios = [Fraction(f / base).limit_denominator(10_000) for f in positive]
    if any(abs(r - f / base) > 1e-12 * f / base for r, f in zip(ratios, positive, strict=True)):
        return None
    # the greatest common divisor of the ratios over a common denominator
    bottom = math.lcm(*(r.denominator for r in ratios))
    top = math.gcd(*(int(r * bottom) for r in ratios))
    return 2.0 * math.pi * bottom / (top * base)
