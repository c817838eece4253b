"""Clocks: sawtooth and step functions of time, with instants that are known in advance."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import sympy as sp

from fastslow.model.rational import exact

#: Largest number of values that a step function takes in one period of a clock in its argument.
MOST_STEPS = 64


class ClockFunction(sp.Function):
    """A function of (period, phase, t) that is constant between the instants phase + k period."""

    nargs = 3
    is_real = True

    @property
    def clock(self) -> tuple[sp.Expr, sp.Expr]:
        """Period, and time of instant 0."""
        return self.args[0], self.args[1]

    def written(self) -> sp.Expr:
        """Return the function in terms of floor."""
        raise NotImplementedError

    def _sympystr(self, printer: Any) -> str:
        return f"({printer.doprint(self.written())})"

    def _latex(self, printer: Any, exp: str | None = None) -> str:
        inside = rf"\left({printer.doprint(self.written())}\right)"
        return f"{inside}^{{{exp}}}" if exp else inside

    def _numpycode(self, printer: Any) -> str:
        return f"({printer.doprint(self.written())})"

    _pythoncode = _numpycode


class ClockCount(ClockFunction):
    """Number of the last instant."""

    @classmethod
    def eval(cls, period: Any, phase: Any, time: Any) -> Any:
        if period.is_Number and phase.is_Number and time.is_Number:
            return sp.floor((time - phase) / period)
        return None

    def written(self) -> sp.Expr:
        period, phase, time = self.args
        return sp.floor((time - phase) / period)

    def _eval_derivative(self, _: sp.Symbol) -> sp.Expr:
        return sp.S.Zero


class ClockTime(ClockFunction):
    """Time of the last instant."""

    @classmethod
    def eval(cls, period: Any, phase: Any, time: Any) -> Any:
        if period.is_Number and phase.is_Number and time.is_Number:
            return phase + period * sp.floor((time - phase) / period)
        return None

    def written(self) -> sp.Expr:
        period, phase, time = self.args
        return phase + period * sp.floor((time - phase) / period)

    def _eval_derivative(self, symbol: sp.Symbol) -> sp.Expr:
        period, phase, _ = self.args
        # the instant phase + k period moves with its parameters, not with time
        return phase.diff(symbol) + ClockCount(*self.args) * period.diff(symbol)


def clock_of(argument: sp.Expr, time: sp.Symbol) -> tuple[sp.Expr, sp.Expr] | None:
    """Return period and phase of floor(argument), None if it is not affine in time alone.

    The period is negative for an argument that decreases.

    Examples
    --------
    >>> t, T = sp.symbols("t T", real=True)
    >>> clock_of(t / T - 1, t)
    (T, T)
    """
    slope = argument.diff(time)
    if slope == 0 or time in slope.free_symbols:
        return None
    offset = sp.expand(argument - slope * time)
    if time in offset.free_symbols:
        return None
    return sp.cancel(exact(1 / slope)), sp.cancel(exact(-offset / slope))


def floor_of(argument: sp.Expr, time: sp.Symbol) -> sp.Expr | None:
    """Return floor of a function of time and of clocks in terms of clocks, None if there is none.

    At an instant the value is that after it. The argument is affine in time and in the numbers of
    the last instants. Integer multiples of these are taken out of floor; beside them one clock
    is allowed, with numbers as coefficients, whose time or whose number alone occurs.

    Examples
    --------
    >>> t = sp.Symbol("t", real=True)
    >>> floor_of(2 * t - 2 * ClockCount(1, 0, t), t)
    (floor(2*t)) - 2*(floor(t))
    """
    argument = argument.replace(ClockTime, lambda *a: a[1] + a[0] * ClockCount(*a))
    symbols = {count: sp.Dummy(real=True) for count in sorted(argument.atoms(ClockCount), key=str)}
    rest = sp.expand(argument.xreplace(symbols))
    slope = rest.diff(time)
    whole, left = sp.S.Zero, []
    for count, symbol in symbols.items():
        factor = sp.cancel(exact(rest.diff(symbol)))
        rest = sp.expand(rest.subs(symbol, 0))
        if factor.is_integer:
            whole += factor * count
        elif factor != 0:
            left.append((count, factor))
    if rest.free_symbols & {*symbols.values()} or time in slope.free_symbols or len(left) > 1:
        return None
    if not left:
        if slope == 0:
            return whole + sp.floor(rest)
        period, phase = clock_of(rest, time) or (None, None)
        if period is None:
            return None
        if period.as_coeff_Mul()[0].is_negative:
            return whole - ClockCount(-period, phase, time) - 1
        return whole + ClockCount(period, phase, time)
    steps = _steps(*left[0], sp.cancel(exact(slope)), exact(rest.subs(time, 0)), time)
    return None if steps is None else whole + steps


def _steps(
    count: ClockCount, factor: sp.Expr, slope: sp.Expr, rest: sp.Expr, time: sp.Symbol
) -> sp.Expr | None:
    """Return floor(slope t + factor N + rest) for the number N of the last instant of a clock."""
    period, phase = count.clock
    if slope == 0:
        # N = n M + m with the number M of the last n-th instant; m selects one of n values
        if not (factor.is_Rational and factor.q <= MOST_STEPS and rest.is_number):
            return None
        n = factor.q
        first, *later = (ClockCount(n * period, phase + m * period, time) for m in range(n))
        values = [sp.floor(factor * m + rest) for m in range(n)]
        # M of instant m lags by 1 until it
        rises = (b - a for a, b in pairwise(values))
        jumps = (rise * (one - first + 1) for rise, one in zip(rises, later, strict=True))
        return sp.expand(factor.p * first + values[0] + sp.Add(*jumps))
    rise, begin = sp.cancel(slope * period), sp.expand(rest + slope * phase)
    if sp.cancel(factor + rise) != 0 or not (rise.is_number and begin.is_number):
        return None
    if abs(rise) > MOST_STEPS:
        return None
    # at an instant the value is that after it, also of a decreasing argument
    up = 1 if rise > 0 else -1
    first = sp.floor(begin) if up > 0 else sp.ceiling(begin) - 1
    total, place = first, first + (1 if up > 0 else 0)
    while (place - begin - rise) * up < 0:
        after = phase + sp.cancel((place - begin) / slope)
        total += up * (ClockCount(period, after, time) - count + 1)
        place += up
    return sp.expand(total)


def with_clocks(expression: Any, time: sp.Symbol, fixed: set[sp.Symbol]) -> Any:
    """Replace Mod, floor, ceiling and frac of time, also nested, by functions of clocks.

    Parameters
    ----------
    expression : Expr or Boolean
    time : Symbol
    fixed : set of Symbol
        Parameters, which may occur in their arguments.

    Examples
    --------
    >>> t, T = sp.symbols("t T", real=True)
    >>> with_clocks(sp.Mod(t, T), t, {T})
    t - (T*floor(t/T))
    """

    def clock(argument: sp.Expr) -> tuple[sp.Expr, sp.Expr, bool] | None:
        found = clock_of(argument, time) if argument.free_symbols <= {time, *fixed} else None
        if found is None:
            return None
        falls = bool(found[0].as_coeff_Mul()[0].is_negative)
        return (-found[0] if falls else found[0]), found[1], falls

    def nested(argument: sp.Expr) -> sp.Expr | None:
        clocked = argument.has(ClockFunction) and argument.free_symbols <= {time, *fixed}
        return floor_of(argument, time) if clocked else None

    def replaced(part: Any) -> Any:
        # at an instant the value is that after it
        if isinstance(part, sp.Mod):
            dividend, divisor = part.args
            found = clock(dividend / divisor)
            if found is not None:
                since = time - ClockTime(*found[:2], time)
                return dividend.diff(time) * since + (divisor if found[2] else 0)
            steps = nested(dividend / divisor)
            return part if steps is None else dividend - divisor * steps
        if isinstance(part, (sp.floor, sp.ceiling)):
            found = clock(part.args[0])
            if found is not None:
                count = ClockCount(*found[:2], time)
                below = -count - 1 if found[2] else count
                return below + (1 if isinstance(part, sp.ceiling) else 0)
            up = isinstance(part, sp.ceiling)
            steps = nested(-part.args[0] if up else part.args[0])
            if steps is not None:
                return -steps if up else steps
        return part

    # SymPy prints frac in products without brackets
    expression = expression.replace(sp.frac, lambda argument: argument - sp.floor(argument))
    # from the inside out
    steps = (sp.Mod, sp.floor, sp.ceiling)
    return expression.replace(lambda part: isinstance(part, steps), replaced)
