"""Clocks: sawtooth and step functions of time, with instants that are known in advance."""

from __future__ import annotations

from typing import Any

import sympy as sp

from fastslow.model.rational import exact


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


def with_clocks(expression: Any, time: sp.Symbol, fixed: set[sp.Symbol]) -> Any:
    """Replace Mod, floor, ceiling and frac of time by functions of clocks.

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

    def replaced(part: Any) -> Any:
        # at an instant the value is that after it
        if isinstance(part, sp.Mod):
            dividend, divisor = part.args
            found = clock(dividend / divisor)
            if found is not None:
                since = time - ClockTime(*found[:2], time)
                return dividend.diff(time) * since + (divisor if found[2] else 0)
        elif isinstance(part, (sp.floor, sp.ceiling)):
            found = clock(part.args[0])
            if found is not None:
                count = ClockCount(*found[:2], time)
                below = -count - 1 if found[2] else count
                return below + (1 if isinstance(part, sp.ceiling) else 0)
        return part

    # SymPy prints frac in products without brackets
    expression = expression.replace(sp.frac, lambda argument: argument - sp.floor(argument))
    parts = expression.atoms(sp.Mod, sp.floor, sp.ceiling)
    return expression.xreplace({part: replaced(part) for part in parts})
