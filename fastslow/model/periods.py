"""The common period of a forcing, from its harmonics."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from fractions import Fraction

import sympy as sp


def common_period(
    expressions: Iterable[sp.Expr], time: sp.Symbol, values: Mapping[sp.Symbol, float]
) -> float | None:
    """Smallest common period in time of all harmonics of several expressions.

    Products and powers of sines are expanded into harmonics first, so that
    sin(ωt)² has the period π/ω. Frequencies whose ratio is no fraction with a
    denominator up to 10 000 have no common period.

    Parameters
    ----------
    expressions : iterable of sympy.Expr
    time : Symbol
    values : mapping
        Parameter values.

    Returns
    -------
    float or None
        None when time stands outside periodic functions, when there is no
        common period, or when nothing depends on time.

    Examples
    --------
    >>> t = sp.Symbol("t", real=True)
    >>> common_period([sp.sin(2*t) + sp.cos(3*t)], t, {}) == 2 * math.pi
    True
    >>> common_period([sp.sin(t) + sp.sin(sp.sqrt(2)*t)], t, {}) is None
    True
    """
    frequencies: list[float] = []
    for expression in expressions:
        if time in expression.free_symbols:
            found = _frequencies(expression, time, values)
            if found is None:
                return None
            frequencies += [f for f in found if f > 0]
    if not frequencies:
        return None
    base = min(frequencies)
    ratios = [Fraction(f / base).limit_denominator(10_000) for f in frequencies]
    if any(abs(r - f / base) > 1e-12 * f / base for r, f in zip(ratios, frequencies, strict=True)):
        return None
    # the greatest common divisor of the ratios, all brought to one denominator
    bottom = math.lcm(*(r.denominator for r in ratios))
    top = math.gcd(*(int(r * bottom) for r in ratios))
    return 2.0 * math.pi * bottom / (top * base)


def _frequencies(
    expression: sp.Expr, time: sp.Symbol, values: Mapping[sp.Symbol, float]
) -> list[float] | None:
    """Angular frequencies of the harmonics, or of the periodic functions' arguments."""
    harmonics = _harmonics(expression, time, values)
    if harmonics is not None:
        return harmonics
    periodic = [
        node
        for node in sp.preorder_traversal(expression)
        if isinstance(node, sp.functions.elementary.trigonometric.TrigonometricFunction)
        and time in node.free_symbols
    ]
    outside = expression.xreplace({node: sp.Dummy(real=True) for node in periodic})
    if time in outside.free_symbols:
        return None
    slopes = [_slope(node.args[0], time, values) for node in periodic]
    return None if any(s is None for s in slopes) else [abs(s) for s in slopes if s is not None]


def _harmonics(
    expression: sp.Expr, time: sp.Symbol, values: Mapping[sp.Symbol, float]
) -> list[float] | None:
    """Frequencies of a polynomial in sines and cosines, None for anything else."""
    if expression.has(sp.Piecewise, sp.Abs, sp.Max, sp.Min, sp.sign, sp.Heaviside):
        return None
    terms = sp.expand(expression.rewrite(sp.exp), power_exp=False)
    terms = sp.Add.make_args(sp.expand(sp.powsimp(terms)))
    frequencies: set[float] = set()
    for term in terms:
        _, moving = term.as_independent(time, as_Add=False)
        if moving == 1:
            continue
        if not isinstance(moving, sp.exp):
            return None
        slope = _slope(sp.expand(moving.args[0] / sp.I), time, values)
        if slope is None:
            return None
        frequencies.add(abs(slope))
    return sorted(frequencies)


def _slope(phase: sp.Expr, time: sp.Symbol, values: Mapping[sp.Symbol, float]) -> float | None:
    slope = phase.diff(time)
    if time in slope.free_symbols:
        return None
    number = slope.subs(values)
    return float(number) if number.is_real and number.is_number else None
