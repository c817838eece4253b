"""Conversion of formulas to SymPy expressions, without unbounded evaluation."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Sequence
from functools import reduce
from operator import mul, truediv
from typing import Any

import numpy as np
import sympy as sp

from fastslow.errors import ArgumentError, FastSlowError, quoted
from fastslow.formulas.functions import CONSTANTS, FUNCTIONS, SPECIAL
from fastslow.formulas.grammar import (
    Call,
    Comparison,
    Logic,
    Name,
    Negative,
    Node,
    Number,
    Pair,
    Power,
    Product,
    Sum,
    Truth,
    normalised,
    parse,
    parts,
    refused,
    text_of,
)
from fastslow.formulas.limits import ARGUMENT, EXPONENT

_COMPARED: dict[str, Any] = {
    "<": sp.Lt,
    "<=": sp.Le,
    ">": sp.Gt,
    ">=": sp.Ge,
    "==": sp.Eq,
    "!=": sp.Ne,
}
_JOINED: dict[str, Any] = {"and": sp.And, "or": sp.Or, "not": sp.Not}
_CONSTANTS: dict[str, sp.Expr] = {"pi": sp.pi, "E": sp.E}

#: Number of factors up to which they are multiplied one by one, as in Python; longer products
#: are built at once, to save time.
ONE_BY_ONE = 50


def read(
    text: str, symbol: Callable[[str], sp.Symbol], known: Collection[str] = (), exact: bool = False
) -> sp.Basic:
    """Read an expression or a condition.

    Parameters
    ----------
    text : str
    symbol : callable
        Returns the symbol of a name.
    known : collection of str
        Names of the model, which shadow the constants pi and E. One that is not an
        identifier is recognised only as a whole formula.
    exact : bool
        Whether to convert decimal numbers to fractions.

    Returns
    -------
    sympy.Expr or Boolean

    Raises
    ------
    ArgumentError
        For text that is not a formula, powers that are too large, and numbers or constant
        subexpressions that are not finite and real.

    Examples
    --------
    >>> read("x**2*v + sqrt(2)/3", sp.Symbol)
    v*x**2 + sqrt(2)/3
    >>> read("Piecewise((x, x > 0), (0, True))", sp.Symbol)
    Piecewise((x, x > 0), (0, True))
    >>> read("10**10**10", sp.Symbol)
    Traceback (most recent call last):
    ...
    fastslow.errors.ArgumentError: '10**10**10' is not an expression: the exponent 10**10 is \
larger than 64 in size
    """
    if text in known:
        return symbol(text)
    tree = parse(text)
    names = {normalised(name): name for name in known}

    def named(name: str) -> sp.Expr:
        if name in _CONSTANTS and name not in names:
            return _CONSTANTS[name]
        return symbol(names.get(name, name))

    return built(tree, text, names, Builder(named, exact))


def built(tree: Node, text: str, known: Collection[str], builder: Builder) -> sp.Basic:
    """Validate a tree and build its expression; errors as for `read`.

    Parameters
    ----------
    tree : Node
    text : str
        The formula, for errors.
    known : collection of str
        Names that are not constants.
    builder : Builder
    """
    _Limits(text, known).of(tree)
    try:
        return builder.of(tree)
    except (TypeError, ValueError, ArithmeticError, NotImplementedError, RecursionError) as error:
        if isinstance(error, FastSlowError):
            raise
        # what SymPy cannot compare or evaluate
        raise refused(text, f"SymPy cannot read it ({quoted(str(error))})") from error


class _Limits:
    """Validation of everything that SymPy would evaluate or expand."""

    def __init__(self, text: str, known: Collection[str]) -> None:
        self.text, self.known = text, known

    def refused(self, reason: str) -> ArgumentError:
        return refused(self.text, reason)

    def finite(self, value: Any, node: Node) -> float:
        number = float(np.real(value)) if np.isreal(value) else math.nan
        if not math.isfinite(number):
            raise self.refused(f"{quoted(text_of(node))} has no finite real value")
        return number

    def of(self, node: Node) -> tuple[float | None, int]:
        """Return the value of a subexpression, None if it contains names, and its total degree."""
        found = [self.of(part) for part in parts(node)]
        values = [value for value, _ in found]
        degrees = [degree for _, degree in found]
        value: float | None = None
        degree = max(degrees, default=0)
        with np.errstate(all="ignore"):
            match node:
                case Number():
                    value = node.value
                case Name(name):
                    value = CONSTANTS.get(name) if name not in self.known else None
                    degree = int(value is None)
                case Negative():
                    value = None if values[0] is None else -values[0]
                case Sum(pairs):
                    value = self.joined(node, "+", pairs, values)
                case Product(pairs):
                    value = self.joined(node, "*", pairs, values)
                    degree = sum(degrees)
                case Power():
                    value, degree = self.power(node, values, degree)
                case Call(function):
                    value = self.called(function, node, values)
                    degree = int(value is None)
        if degree > EXPONENT:
            raise self.refused(
                f"{quoted(text_of(node))} has the degree {degree}; expected at most {EXPONENT}"
            )
        return value, degree

    def joined(
        self,
        node: Node,
        first: str,
        pairs: Sequence[tuple[str, Node]],
        values: Sequence[float | None],
    ) -> float | None:
        """Return the value of all numerical terms or factors, which SymPy combines."""
        total = np.float64(first == "*")
        join = {"+": np.add, "-": np.subtract, "*": np.multiply, "/": np.divide}
        for (sign, _), value in zip(pairs, values, strict=True):
            if value is not None:
                total = join[sign](total, value)
        number = self.finite(total, node)
        return None if None in values else number

    def power(
        self, node: Power, values: Sequence[float | None], degree: int
    ) -> tuple[float | None, int]:
        base, exponent = values
        if exponent is None:
            return None, degree
        if abs(exponent) > EXPONENT:
            shown = text_of(node.exponent)
            raise self.refused(f"the exponent {shown} is larger than {EXPONENT} in size")
        if base is None:
            return None, degree * max(1, math.ceil(abs(exponent)))
        return self.finite(np.power(np.float64(base), exponent), node), 0

    def called(self, name: str, node: Call, values: Sequence[float | None]) -> float | None:
        function = FUNCTIONS.get(name)
        if function is None:
            return None
        if function.symbolic in SPECIAL:
            for part, value in zip(node.arguments, values, strict=True):
                if value is not None and abs(value) > ARGUMENT:
                    raise self.refused(
                        f"{name} is given {quoted(text_of(part))}; expected a number of at most "
                        f"{ARGUMENT:g} in size"
                    )
        known = [value for value in values if value is not None]
        if name == "Piecewise" or len(known) < len(values):
            return None
        if function.values is not None:
            return self.finite(function.values(*map(np.float64, known)), node)
        try:
            number = complex(sp.N(getattr(sp, function.symbolic)(*map(sp.Float, known))))
        except (TypeError, ValueError, ArithmeticError, NotImplementedError):
            number = complex(math.nan)
        return self.finite(number, node)


class Builder:
    """Builder of the SymPy expression of a validated tree.

    Parameters
    ----------
    named : callable
        Returns the expression of a name.
    exact : bool
        Whether to convert decimal numbers to fractions.
    called : callable
        Returns the expression of a call, or None for a function of formulas.
    """

    def __init__(
        self,
        named: Callable[[str], sp.Expr],
        exact: bool = False,
        called: Callable[[Call], sp.Expr | None] = lambda call: None,
    ) -> None:
        self.named, self.exact, self.called = named, exact, called

    def of(self, node: Node) -> Any:
        """Return the expression of a node."""
        match node:
            case Number(text):
                if text.isdecimal():
                    return sp.Integer(text)
                return sp.Rational(text) if self.exact else sp.Float(text)
            case Name(name):
                return self.named(name)
            case Truth(value):
                return sp.true if value else sp.false
            case Negative(operand):
                return -self.of(operand)
            case Sum(pairs):
                terms = [(sign, self.of(term)) for sign, term in pairs]
                return sp.Add(*(term if sign == "+" else -term for sign, term in terms))
            case Product(pairs):
                return _product([(sign, self.of(factor)) for sign, factor in pairs])
            case Power(base, exponent):
                return self.of(base) ** self.of(exponent)
            case Call(function, arguments):
                own = self.called(node)
                return self.function(function, arguments) if own is None else own
            case Comparison(operators, operands):
                made = [self.of(operand) for operand in operands]
                return sp.And(
                    *(
                        _COMPARED[sign](one, other)
                        for sign, one, other in zip(operators, made[:-1], made[1:], strict=True)
                    )
                )
            case Logic(word, operands):
                return _JOINED[word](*(self.of(operand) for operand in operands))
        raise TypeError(node)

    def function(self, name: str, arguments: Sequence[Node]) -> Any:
        if name == "Piecewise":
            pairs = [p for p in arguments if isinstance(p, Pair)]
            return sp.Piecewise(*((self.of(p.value), self.of(p.condition)) for p in pairs))
        return getattr(sp, FUNCTIONS[name].symbolic)(*map(self.of, arguments))


def _product(factors: list[tuple[str, sp.Expr]]) -> sp.Expr:
    if len(factors) > ONE_BY_ONE:
        return sp.Mul(*(f if sign == "*" else 1 / f for sign, f in factors))
    (_, first), *rest = factors
    return reduce(lambda total, f: (mul if f[0] == "*" else truediv)(total, f[1]), rest, first)
