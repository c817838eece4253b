"""Expressions as recurrences for their Taylor coefficients.

Along a solution every subexpression is a power series in time. Each operation
has a recurrence that gives its coefficient of order k from those of lower
order (Jorba and Zou 2005; Haro et al. 2016, table 2.1): linear for sums, one
convolution for products, quotients, powers, exp and log, and for any function
f with a derivative the node w = f(u) follows from w' = f'(u) u',

    w_k = (1/k) sum_{j=1}^{k} j u_j g_{k-j},    g = f'(u),

so that only w_0 needs the function itself.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import sympy as sp
from sympy.printing.codeprinter import PrintMethodNotImplementedError
from sympy.printing.pycode import PythonCodePrinter

from fastslow.compiled.functions import refusal, slope_of, teach_functions, value_code


class ScalarPrinter(PythonCodePrinter):
    """Expressions of parameters as Python: every number a float, so that none overflows."""

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


teach_functions(ScalarPrinter)


def scalar_code(expression: sp.Expr) -> str:
    """Python source of an expression of numbers, every number a float.

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


@dataclass
class Node:
    """One series: where it lies, its value, and its coefficient of order k from lower ones."""

    row: int
    value: str
    lines: list[str]
    needs: tuple[int, ...]


@dataclass
class Recurrences:
    """The recurrences of several expressions, shared subexpressions once.

    Parameters
    ----------
    order : int
        Highest coefficient.
    moving : mapping
        Symbol to row, for states and slow states.
    time : Symbol
    reserved : mapping
        Expression to the row its series must occupy.
    first_free : int
        First row for everything else.
    clock : str
        Source of the rate of time: 1, or a name where it may be 0.
    """

    order: int
    moving: Mapping[sp.Symbol, int]
    time: sp.Symbol
    reserved: Mapping[sp.Expr, int]
    first_free: int
    clock: str = "1.0"
    rows: dict[sp.Expr, int] = field(default_factory=dict)
    nodes: list[Node] = field(default_factory=list)
    scalars: dict[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.rows.update(self.moving)
        self.next = self.first_free
        self.changing = {*self.moving, self.time}

    def name(self, symbol: sp.Symbol, row: int) -> None:
        """Let a symbol stand for a row."""
        self.rows[symbol] = row
        self.changing.add(symbol)

    def is_scalar(self, expression: sp.Expr) -> bool:
        """Whether an expression holds no state, slow quantity or time."""
        return not (expression.free_symbols & self.changing)

    def scalar(self, expression: sp.Expr) -> str:
        """Name (or literal) of a parameter-only expression, computed once a call."""
        code = scalar_code(expression)
        if expression.is_Number or expression.is_Symbol:
            return f"({code})" if code.startswith("-") else code
        return self.scalars.setdefault(code, f"c{len(self.scalars)}")

    def at(self, row: int, index: str = "k") -> str:
        """Source of one coefficient of a row."""
        start = row * (self.order + 1)
        return f"W[{start}]" if index == "0" else f"W[{start} + {index}]"

    def row(self, expression: sp.Expr) -> int:
        """The row that holds an expression's series, with all it needs emitted before it."""
        if expression in self.rows:
            return self.rows[expression]
        if self.is_scalar(expression):
            return self._add(expression, self.scalar(expression), ["{} = 0.0"], ())
        if expression == self.time:
            start = f"{self.clock} if k == 1 else 0.0"
            return self._add(expression, "t", [f"{{}} = {start}"], ())
        if isinstance(expression, sp.Add):
            return self._sum(expression)
        if isinstance(expression, sp.Mul):
            return self._product(expression)
        if isinstance(expression, sp.Pow):
            return self._power(expression)
        return self._function(expression)

    def _place(self, expression: sp.Expr) -> int:
        row = self.reserved.get(expression)
        if row is None:
            row, self.next = self.next, self.next + 1
        self.rows[expression] = row
        return row

    def _add(
        self, expression: sp.Expr, value: str, lines: list[str], needs: tuple[int, ...]
    ) -> int:
        row = self._place(expression)
        target = self.at(row)
        self.nodes.append(Node(row, value, [line.format(target) for line in lines], needs))
        return row

    def _sum(self, expression: sp.Add) -> int:
        constant, rest = expression.as_independent(*self.changing, as_Add=True)
        terms: list[tuple[str, int]] = []
        for term in sp.Add.make_args(rest):
            factor, body = term.as_independent(*self.changing, as_Add=False)
            terms.append((self._factor(factor), self.row(body)))
        value = "".join(f"{f}{self.at(r, '0')}" for f, r in terms)
        if constant != 0:
            value += f" + {self.scalar(constant)}"
        value = value.removeprefix(" + ")
        general = "".join(f"{f}{self.at(r)}" for f, r in terms).removeprefix(" + ")
        return self._add(expression, value, [f"{{}} = {general}"], tuple(r for _, r in terms))

    def _factor(self, factor: sp.Expr) -> str:
        if factor == 1:
            return " + "
        if factor == -1:
            return " - "
        return f" + {self.scalar(factor)} * "

    def _product(self, expression: sp.Mul) -> int:
        factor, body = expression.as_independent(*self.changing, as_Add=False)
        if factor != 1:
            row = self.row(body)
            name = self.scalar(factor)
            return self._add(
                expression,
                f"{name} * {self.at(row, '0')}",
                [f"{{}} = {name} * {self.at(row)}"],
                (row,),
            )
        above = [f for f in body.args if not _inverse(f)]
        below = [sp.Pow(f.base, -f.exp) for f in body.args if _inverse(f)]
        if below:
            return self._quotient(expression, sp.Mul(*above), sp.Mul(*below))
        partial = above[0]
        for factor in above[1:]:
            whole = sp.Mul(partial, factor)
            if whole not in self.rows:
                self._convolve(whole, self.row(partial), self.row(factor))
            partial = whole
        return self.rows.setdefault(expression, self.rows[partial])

    def _convolve(self, expression: sp.Expr, a: int, b: int) -> int:
        A, B = (r * (self.order + 1) for r in (a, b))
        if a == b:
            lines = [
                "s = 0.0",
                "for j in range((k + 1) // 2):",
                f"    s += W[{A} + j] * W[{A} + k - j]",
                "s += s",
                "if k % 2 == 0:",
                f"    s += W[{A} + k // 2] * W[{A} + k // 2]",
                "{} = s",
            ]
        else:
            lines = [
                "s = 0.0",
                "for j in range(k + 1):",
                f"    s += W[{A} + j] * W[{B} + k - j]",
                "{} = s",
            ]
        return self._add(expression, f"W[{A}] * W[{B}]", lines, (a, b))

    def _quotient(self, expression: sp.Expr, above: sp.Expr, below: sp.Expr) -> int:
        b = self.row(below)
        B = b * (self.order + 1)
        needs: tuple[int, ...]
        if self.is_scalar(above):
            name = self.scalar(above)
            needs, value, start = (b,), f"{name} / W[{B}]", "0.0"
        else:
            a = self.row(above)
            needs, value, start = (a, b), f"{self.at(a, '0')} / W[{B}]", self.at(a)
        row = self._place(expression)
        R = row * (self.order + 1)
        lines = [
            f"s = {start}",
            "for j in range(k):",
            f"    s -= W[{R} + j] * W[{B} + k - j]",
            f"W[{R} + k] = s / W[{B}]",
        ]
        self.nodes.append(Node(row, value, lines, needs))
        return row

    def _power(self, expression: sp.Pow) -> int:
        base, exponent = expression.args
        if exponent.is_Integer:
            if exponent < 0:
                return self._quotient(expression, sp.Integer(1), sp.Pow(base, -exponent))
            half = int(exponent) // 2
            first = self.row(base if half == 1 else sp.Pow(base, half))
            if int(exponent) % 2 == 0:
                return self._convolve(expression, first, first)
            even = self.row(sp.Pow(base, 2 * half))
            return self._convolve(expression, even, self.row(base))
        if not self.is_scalar(exponent):
            written = sp.exp(exponent * sp.log(base), evaluate=False)
            return self.rows.setdefault(expression, self.row(written))
        u = self.row(base)
        U = u * (self.order + 1)
        p = self.scalar(exponent)
        value = f"math.sqrt(W[{U}])" if exponent == sp.Rational(1, 2) else f"math.pow(W[{U}], {p})"
        row = self._place(expression)
        R = row * (self.order + 1)
        lines = [
            "s = 0.0",
            "for j in range(1, k + 1):",
            f"    s += (j * ({p} + 1.0) - k) * W[{U} + j] * W[{R} + k - j]",
            f"W[{R} + k] = s / (k * W[{U}])",
        ]
        self.nodes.append(Node(row, value, lines, (u,)))
        return row

    def _function(self, expression: sp.Expr) -> int:
        arguments = {a: self.row(a) for a in expression.args if not self.is_scalar(a)}
        value = value_code(
            expression,
            lambda a: self.at(arguments[a], "0") if a in arguments else self.scalar(a),
        )
        if isinstance(expression, sp.log):
            return self._logarithm(expression, arguments[expression.args[0]], value)
        row = self._place(expression)
        node = Node(row, value, [], tuple(arguments.values()))
        self.nodes.append(node)
        lines: list[str] = ["s = 0.0"]
        for index, argument in enumerate(expression.args, 1):
            if argument not in arguments:
                continue
            slope = slope_of(expression, index)
            steady = self._steady_rate(argument)
            g = self.row(slope)
            U, G = (r * (self.order + 1) for r in (arguments[argument], g))
            if steady is not None:
                clock = "" if self.clock == "1.0" else f"{self.clock} * "
                lines.append(f"s += {clock}{steady} * W[{G} + k - 1]")
            else:
                lines.append("for j in range(1, k + 1):")
                lines.append(f"    s += j * W[{U} + j] * W[{G} + k - j]")
        node.lines = [*lines, f"{self.at(row)} = s * q"]
        return row

    def _steady_rate(self, argument: sp.Expr) -> str | None:
        """The constant rate of an argument that is affine in time, None for others."""
        if argument.free_symbols & self.changing != {self.time}:
            return None
        rate = argument.diff(self.time)
        return self.scalar(rate) if self.is_scalar(rate) else None

    def _logarithm(self, expression: sp.Expr, u: int, value: str) -> int:
        row = self._place(expression)
        U, R = (r * (self.order + 1) for r in (u, row))
        lines = [
            "s = 0.0",
            "for j in range(1, k):",
            f"    s += j * W[{R} + j] * W[{U} + k - j]",
            f"W[{R} + k] = (W[{U} + k] - s / k) / W[{U}]",
        ]
        self.nodes.append(Node(row, value, lines, (u,)))
        return row

    def values(self) -> list[str]:
        """Source lines of all coefficients of order 0."""
        return [f"{self.at(n.row, '0')} = {n.value}" for n in self.nodes]

    def general(self, rows: Sequence[int] | None = None) -> list[str]:
        """Source lines of the coefficients of order k, of all rows or of those needed for some."""
        wanted = {n.row for n in self.nodes} if rows is None else self._ancestors(rows)
        return [line for n in self.nodes if n.row in wanted for line in n.lines]

    def _ancestors(self, rows: Sequence[int]) -> set[int]:
        by_row = {n.row: n for n in self.nodes}
        found: set[int] = set()
        pending = list(rows)
        while pending:
            row = pending.pop()
            if row not in found:
                found.add(row)
                pending += by_row[row].needs if row in by_row else ()
        return found


def _inverse(factor: sp.Expr) -> bool:
    return isinstance(factor, sp.Pow) and factor.exp.is_Number and bool(factor.exp.is_negative)
