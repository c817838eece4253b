"""Expressions as operations on Taylor series, with common subexpressions evaluated once.

Along a solution every subexpression is a power series in time, stored as a row of
coefficients. The operations on rows are implemented in
`fastslow.kernels.taylor.recurrences`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any

import sympy as sp
from sympy.printing.codeprinter import PrintMethodNotImplementedError
from sympy.printing.pycode import PythonCodePrinter

from fastslow.model.known_functions import refusal, register_functions, slope_of, value_code
from fastslow.model.removable import Removable
from fastslow.results.stored.operations import (
    FUNCTION,
    LOGARITHM,
    MULTIPLE,
    POWER,
    PRODUCT,
    QUOTIENT,
    REMOVABLE,
    ROOT,
    SCALAR,
    SUM,
    TIME,
)

#: Number of expressions whose source is kept: regions have most of them in common.
CODES_KEPT = 4096


class ScalarPrinter(PythonCodePrinter):
    """Printer of parameter expressions as Python, with every number a float."""

    def _print_Integer(self, expr: sp.Integer) -> str:
        return repr(float(expr))

    def _print_Rational(self, expr: sp.Rational) -> str:
        return repr(float(expr))

    def _print_Float(self, expr: sp.Float) -> str:
        return repr(float(expr))

    def _print_Pow(self, expr: sp.Pow, rational: bool = False) -> str:
        base, power = expr.args
        inside = self._print(base)
        if power.is_Integer and 1 < abs(int(power)) <= 4:
            product = " * ".join([f"({inside})"] * abs(int(power)))
            return f"({product})" if power > 0 else f"(1.0 / ({product}))"
        if power == -1:
            return f"(1.0 / ({inside}))"
        if power == sp.Rational(1, 2):
            return f"math.sqrt({inside})"
        return f"math.pow({inside}, {self._print(power)})"


register_functions(ScalarPrinter)


@lru_cache(CODES_KEPT)
def scalar_code(expression: sp.Expr) -> str:
    """Return the Python source of a scalar expression, with every number a float.

    Raises
    ------
    ModelError
        For a function that cannot be compiled.

    Examples
    --------
    >>> A = sp.Symbol("A", real=True)
    >>> scalar_code(A**2 / 3)
    '(0.3333333333333333)*((A) * (A))'
    """
    try:
        return str(ScalarPrinter({"fully_qualified_modules": True}).doprint(expression))
    except PrintMethodNotImplementedError:
        raise refusal([expression]) from None


@lru_cache(CODES_KEPT)
def _independent(
    expression: sp.Expr, changing: frozenset[sp.Symbol], as_sum: bool
) -> tuple[sp.Expr, sp.Expr]:
    """Part of a sum or product without some symbols, and the rest; many regions share them."""
    alone, rest = expression.as_independent(*changing, as_Add=as_sum)
    return alone, rest


@lru_cache(CODES_KEPT)
def _symbols_of(expression: sp.Expr) -> frozenset[sp.Symbol]:
    """The symbols of an expression; many regions share it."""
    return frozenset(expression.free_symbols)


@dataclass
class ListedOperations:
    """Operations of several expressions, with common subexpressions evaluated once.

    Parameters
    ----------
    moving : mapping
        Symbol to row, for states and slow states.
    time : Symbol
    reserved : mapping
        Expression to the row of its series.
    next : int
        Next free row for all other expressions.
    """

    moving: Mapping[sp.Symbol, int]
    time: sp.Symbol
    reserved: Mapping[sp.Expr, int]
    next: int
    rows: dict[sp.Expr, int] = field(default_factory=dict)
    nodes: list[tuple[Any, ...]] = field(default_factory=list)
    scalars: dict[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.rows.update(self.moving)
        self.changing = {*self.moving, self.time}

    def name(self, symbol: sp.Symbol, row: int) -> None:
        """Assign a symbol to a row."""
        self.rows[symbol] = row
        self.changing.add(symbol)

    def is_scalar(self, expression: sp.Expr) -> bool:
        """Check that an expression contains no state, slow quantity or time."""
        return self.changing.isdisjoint(_symbols_of(expression))

    def scalar(self, expression: sp.Expr) -> str:
        """Return the name or literal of a parameter expression, computed once per call."""
        code = scalar_code(expression)
        if expression.is_Number or expression.is_Symbol:
            return f"({code})" if code.startswith("-") else code
        return self.scalars.setdefault(code, f"c{len(self.scalars)}")

    def row(self, expression: sp.Expr) -> int:
        """Return the row of an expression's series, after emitting the rows it depends on."""
        if expression in self.rows:
            return self.rows[expression]
        if self.is_scalar(expression):
            return self.add(expression, SCALAR, self.scalar(expression))
        if expression == self.time:
            return self.add(expression, TIME)
        if isinstance(expression, sp.Add):
            return self._sum(expression)
        if isinstance(expression, sp.Mul):
            return self._product(expression)
        if isinstance(expression, sp.Pow):
            return self._power(expression)
        return self._function(expression)

    def add(self, expression: sp.Expr, kind: str, *operands: Any) -> int:
        """Emit an operation whose result is the series of an expression; return its row."""
        row = self.reserved.get(expression)
        if row is None:
            row, self.next = self.next, self.next + 1
        self.rows[expression] = row
        self.nodes.append((kind, row, *operands))
        return row

    def _sum(self, expression: sp.Add) -> int:
        changing = frozenset(self.changing)
        constant, rest = _independent(expression, changing, True)
        terms = []
        for term in sp.Add.make_args(rest):
            factor, body = _independent(term, changing, False)
            terms.append((self._factor(factor), self.row(body)))
        value = self.scalar(constant) if constant != 0 else ""
        return self.add(expression, SUM, tuple(terms), value)

    def _factor(self, factor: sp.Expr) -> str:
        return {1: "+", -1: "-"}.get(factor) or self.scalar(factor)

    def _product(self, expression: sp.Mul) -> int:
        factor, body = _independent(expression, frozenset(self.changing), False)
        if factor != 1:
            row = self.row(body)
            return self.add(expression, MULTIPLE, self.scalar(factor), row)
        above = [f for f in body.args if not _inverse(f)]
        below = [sp.Pow(f.base, -f.exp) for f in body.args if _inverse(f)]
        if below:
            return self._quotient(expression, sp.Mul(*above), sp.Mul(*below))
        partial = above[0]
        for factor in above[1:]:
            whole = sp.Mul(partial, factor)
            if whole not in self.rows:
                self.add(whole, PRODUCT, self.row(partial), self.row(factor))
            partial = whole
        return self.rows.setdefault(expression, self.rows[partial])

    def _quotient(self, expression: sp.Expr, above: sp.Expr, below: sp.Expr) -> int:
        b = self.row(below)
        a = self.scalar(above) if self.is_scalar(above) else self.row(above)
        return self.add(expression, QUOTIENT, a, b)

    def _power(self, expression: sp.Pow) -> int:
        base, exponent = expression.args
        if exponent.is_Integer:
            if exponent < 0:
                return self._quotient(expression, sp.Integer(1), sp.Pow(base, -exponent))
            half = int(exponent) // 2
            first = self.row(base if half == 1 else sp.Pow(base, half))
            if int(exponent) % 2 == 0:
                return self.add(expression, PRODUCT, first, first)
            even = self.row(sp.Pow(base, 2 * half))
            return self.add(expression, PRODUCT, even, self.row(base))
        if not self.is_scalar(exponent):
            written = sp.exp(exponent * sp.log(base), evaluate=False)
            return self.rows.setdefault(expression, self.row(written))
        u = self.row(base)
        kind = ROOT if exponent == sp.Rational(1, 2) else POWER
        return self.add(expression, kind, self.scalar(exponent), u)

    def _function(self, expression: sp.Expr) -> int:
        arguments = {a: self.row(a) for a in expression.args if not self.is_scalar(a)}
        value = value_code(
            expression, lambda a: f"r{arguments[a]}" if a in arguments else self.scalar(a)
        )
        if isinstance(expression, Removable):
            argument, order = expression.args
            return self.add(
                expression, REMOVABLE, expression.stored, arguments[argument], int(order)
            )
        if isinstance(expression, sp.log):
            return self.add(expression, LOGARITHM, value, arguments[expression.args[0]])
        place = len(self.nodes)
        row = self.add(expression, FUNCTION)
        slots = []
        for index, argument in enumerate(expression.args, 1):
            if argument in arguments:
                steady = self._steady_rate(argument)
                slope = self.row(slope_of(expression, index))
                slots.append((arguments[argument], slope, steady))
        self.nodes[place] = (FUNCTION, row, value, tuple(slots))
        return row

    def _steady_rate(self, argument: sp.Expr) -> str:
        """Constant rate of an argument that is affine in time, empty for others."""
        if argument.free_symbols & self.changing != {self.time}:
            return ""
        rate = argument.diff(self.time)
        return self.scalar(rate) if self.is_scalar(rate) else ""


def _inverse(factor: sp.Expr) -> bool:
    return isinstance(factor, sp.Pow) and factor.exp.is_Number and bool(factor.exp.is_negative)
