"""Common period of a forcing, from its harmonics."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from functools import lru_cache

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from fastslow.model.clocks import ClockCount, ClockFunction
from fastslow.model.functions import FUNCTIONS_KEPT, function_of
from fastslow.model.tabulated import TableValue
from fastslow.results.stored.harmonics import period_of


def common_period(
    expressions: Iterable[sp.Expr], time: sp.Symbol, values: Mapping[sp.Symbol, float]
) -> float | None:
    """Return the smallest common period in time of all harmonics of several expressions.

    Products and powers of sines are expanded into harmonics first, so that
    sin(ωt)² has the period π/ω. Frequencies whose ratio is not a fraction with a
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
        None if time occurs outside periodic functions, if there is no common
        period, or if nothing depends on time.

    Examples
    --------
    >>> t = sp.Symbol("t", real=True)
    >>> common_period([sp.sin(2*t) + sp.cos(3*t)], t, {}) == 2 * np.pi
    True
    >>> common_period([sp.sin(t) + sp.sin(sp.sqrt(2)*t)], t, {}) is None
    True
    """
    found = frequencies(expressions, time)
    if found is None:
        return None
    numbers = [frequency.subs(values) for frequency in found]
    if not all(number.is_number and number.is_real for number in numbers):
        return None
    return period_of([float(number) for number in numbers])


def common_periods(
    expressions: Iterable[sp.Expr], time: sp.Symbol, values: Mapping[sp.Symbol, NDArray[np.float64]]
) -> NDArray[np.float64]:
    """Return the common period at each of many parameter sets, NaN where there is none.

    Parameters
    ----------
    expressions : iterable of sympy.Expr
    time : Symbol
    values : mapping
        Parameter to its values, all of one shape (m,).

    Examples
    --------
    >>> t, k = sp.symbols("t k", real=True)
    >>> common_periods([sp.sin(k * t)], t, {k: np.array([1.0, 2.0])}) / np.pi
    array([2., 1.])
    """
    count = len(next(iter(values.values())))
    found = frequencies(expressions, time)
    if found is None:
        return np.full(count, np.nan)
    table = np.empty((count, len(found)))
    for column, frequency in enumerate(found):
        used, function = function_of(frequency)
        if any(symbol not in values for symbol in used):
            return np.full(count, np.nan)
        table[:, column] = function(*(values[symbol] for symbol in used))
    rows, which = np.unique(table, axis=0, return_inverse=True)
    periods = np.array([period_of(row) or np.nan for row in rows.tolist()])
    return periods[which.reshape(-1)]


def frequencies(expressions: Iterable[sp.Expr], time: sp.Symbol) -> list[sp.Expr] | None:
    """Return the angular frequencies of all harmonics, as expressions; None if not periodic."""
    collected: list[sp.Expr] = []
    for expression in expressions:
        if time in expression.free_symbols:
            found = _frequencies(expression, time)
            if found is None:
                return None
            collected += [f for f in found if f not in collected]
    return collected


@lru_cache(maxsize=FUNCTIONS_KEPT)
def _frequencies(expression: sp.Expr, time: sp.Symbol) -> tuple[sp.Expr, ...] | None:
    """Angular frequencies of the harmonics, or of the periodic functions' arguments."""
    values = expression.atoms(TableValue)
    if values:
        if not all(value.table.periodic and value.args[2] == time for value in values):
            return None
        lengths = dict.fromkeys(value.table.period for value in values)
        rest = frequencies([expression.xreplace({v: sp.Dummy(real=True) for v in values})], time)
        own = (2 * sp.pi / sp.Float(length, 17) for length in lengths)
        return None if rest is None else (*own, *rest)
    clocks = sorted(expression.atoms(ClockFunction), key=str)
    if clocks:
        rest = frequencies([_without_sawtooths(expression, clocks, time)], time)
        turns = dict.fromkeys(2 * sp.pi / one.clock[0] for one in clocks)
        return None if rest is None else (*turns, *rest)
    harmonics = _harmonics(expression, time)
    if harmonics is not None:
        return tuple(harmonics)
    if outside_periodic(expression, time):
        return None
    slopes = [_slope(node.args[0], time) for node in _periodic(expression, time)]
    return None if any(s is None for s in slopes) else tuple(s for s in slopes if s is not None)


def _without_sawtooths(
    expression: sp.Expr, clocks: Iterable[ClockFunction], time: sp.Symbol
) -> sp.Expr:
    """An expression with constants for the sawtooths, the times since the last instants."""
    saws: dict[tuple[sp.Expr, sp.Expr], sp.Symbol] = {}
    within = {}
    for one in clocks:
        period, phase = one.clock
        last = time - saws.setdefault(one.clock, sp.Dummy(real=True))
        within[one] = (last - phase) / period if isinstance(one, ClockCount) else last
    written = expression.xreplace(within)
    # the time cancels in differences of counts
    return written.xreplace({one: sp.expand(one) for one in written.atoms(sp.Add)})


def _periodic(expression: sp.Expr, time: sp.Symbol) -> list[sp.Expr]:
    """The trigonometric functions of time in an expression."""
    return [
        node
        for node in sp.preorder_traversal(expression)
        if isinstance(node, sp.functions.elementary.trigonometric.TrigonometricFunction)
        and time in node.free_symbols
    ]


def outside_periodic(expression: sp.Expr, time: sp.Symbol) -> bool:
    """Return True if time occurs outside trigonometric functions.

    Examples
    --------
    >>> t, k = sp.symbols("t k", real=True)
    >>> outside_periodic(k * t, t), outside_periodic(sp.exp(sp.sin(k * t)), t)
    (True, False)
    """
    periodic = _periodic(expression, time)
    outside = expression.xreplace({node: sp.Dummy(real=True) for node in periodic})
    return time in outside.free_symbols


def _harmonics(expression: sp.Expr, time: sp.Symbol) -> list[sp.Expr] | None:
    """Frequencies of a polynomial in sines and cosines, None for anything else."""
    if expression.has(sp.Piecewise, sp.Abs, sp.Max, sp.Min, sp.sign, sp.Heaviside):
        return None
    terms = sp.expand(expression.rewrite(sp.exp), power_exp=False)
    terms = sp.Add.make_args(sp.expand(sp.powsimp(terms)))
    found: list[sp.Expr] = []
    for term in terms:
        _, moving = term.as_independent(time, as_Add=False)
        if moving == 1:
            continue
        if not isinstance(moving, sp.exp):
            return None
        slope = _slope(sp.expand(moving.args[0] / sp.I), time)
        if slope is None:
            return None
        if slope not in found and -slope not in found:
            found.append(slope)
    return found


def _slope(phase: sp.Expr, time: sp.Symbol) -> sp.Expr | None:
    slope = phase.diff(time)
    return None if time in slope.free_symbols or slope.has(sp.I) else slope
