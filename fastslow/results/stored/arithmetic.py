"""Arithmetic as text: what may stand in it, and its value.

The text is a small part of Python's: numbers, names, the four operations, comparisons and
choices by them, and calls of known functions. It is what machine code is made from, and what a
file may hold; nothing of it is ever run as Python.
"""

from __future__ import annotations

import ast
import operator
from collections.abc import Callable, Iterable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fastslow.formulas.elementary import ELEMENTARY
from fastslow.formulas.functions import FUNCTIONS
from fastslow.quotients import LARGEST_ORDER, QUOTIENTS

#: The functions of `math` and the special ones that a text may call, with their arguments.
MATHEMATICS: Mapping[str, int] = {
    **{name: one.arguments for name, one in ELEMENTARY.items() if one.direct},
    **dict.fromkeys(("sqrt", "floor", "fabs"), 1),
    **dict.fromkeys(("pow", "copysign"), 2),
}
SPECIAL: Mapping[str, int] = {
    **dict.fromkeys(("gamma", "loggamma", "zetac", "expi"), 1),
    **dict.fromkeys(("erfi", "erfinv", "erfcinv", "ellipk", "ellipe"), 1),
    **dict.fromkeys(("jv", "yv", "iv", "kv", "expn", "ellipkinc", "ellipeinc"), 2),
    **dict.fromkeys(("beta", "gammainc", "gammaincc", "polygamma", "lambertw"), 2),
}
#: Special functions with several results, of which the last argument names one.
SEVERAL: Mapping[str, int] = {
    **{"airy": 4, "sici": 2, "shichi": 2, "fresnel": 2},
    # the order of the derivative
    **dict.fromkeys(QUOTIENTS, LARGEST_ORDER + 1),
}

_CONSTANTS = {"pi": np.pi, "e": np.e, "nan": np.nan, "inf": np.inf}

#: Longest text, and the deepest one.
LONGEST_TEXT, DEEPEST_TEXT = 10**6, 90

#: Highest power that is written as one.
HIGHEST_POWER = 2**16


class UnknownOperationError(ValueError):
    """An operation outside the vocabulary."""


def expect(holds: bool, what: str) -> None:
    """Raise UnknownOperationError for stored data without a property."""
    if not holds:
        raise UnknownOperationError(f"expected {what}")


_OPERATIONS: Mapping[type[ast.operator], Callable[[Any, Any], Any]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.Pow: operator.pow,
}
_COMPARISONS: Mapping[type[ast.cmpop], Callable[[Any, Any], Any]] = {
    ast.Eq: np.equal,
    ast.NotEq: np.not_equal,
    ast.Lt: np.less,
    ast.LtE: np.less_equal,
    ast.Gt: np.greater,
    ast.GtE: np.greater_equal,
}
_NUMPY: Mapping[str, Callable[..., Any]] = {
    "fabs": np.abs,
    "pow": operator.pow,
    "copysign": np.copysign,
    "abs": np.abs,
}


def check_number(text: Any, names: set[str]) -> None:
    """Validate a text as arithmetic in given names with a numerical value.

    Parameters
    ----------
    text : str
    names : set of str
        The names that it may contain.

    Raises
    ------
    UnknownOperationError

    Examples
    --------
    >>> check_number("math.sin(p0) * 2.0 if p0 < 1.0 else -p0", {"p0"})
    >>> check_number("p0.x", {"p0"})
    Traceback (most recent call last):
    ...
    fastslow.results.stored.arithmetic.UnknownOperationError: expected arithmetic, received p0.x
    """
    _check(_parsed(text), names, 0, True)


def _parsed(text: Any) -> ast.expr:
    if not isinstance(text, str) or not 0 < len(text) <= LONGEST_TEXT:
        raise UnknownOperationError(
            f"expected a text of arithmetic, received {type(text).__name__}"
        )
    try:
        return ast.parse(text, mode="eval").body
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        raise UnknownOperationError(f"expected arithmetic, received {text[:80]!a}") from None


def check_literal(text: Any) -> None:
    """Validate a text as a literal number, with or without a sign."""
    node = _parsed(text)
    if isinstance(node, ast.UnaryOp):
        node = node.operand
    if not isinstance(node, ast.Constant | ast.Attribute):
        raise UnknownOperationError(f"expected a name or a number, received {text[:80]!a}")
    _check(node, set(), 0, True)


def _check(node: ast.expr, names: set[str], depth: int, number: bool) -> None:
    """Validate a node as a number, or as a condition if one is required."""
    if depth > DEEPEST_TEXT:
        raise UnknownOperationError(
            f"expected at most {DEEPEST_TEXT} operations inside one another"
        )

    def all_of(parts: Iterable[ast.expr], kind: bool) -> None:
        for part in parts:
            _check(part, names, depth + 1, kind)

    while number and isinstance(node, ast.BinOp) and type(node.op) in _OPERATIONS:
        # a long sum does not count as deep nesting
        all_of([node.right], True)
        if isinstance(node.op, ast.Pow):
            _check_power(node)
        node = node.left
    match node:
        case ast.Constant(value=bool()) if not number:
            return None
        case ast.Constant(value=float() | int() as value) if number and type(value) is not bool:
            if abs(value) < 2**53 or isinstance(value, float):
                return None
        case ast.Name(id=name) if number and name in names:
            return None
        case ast.Attribute(value=ast.Name(id="math"), attr=name) if number and name in _CONSTANTS:
            return None
        case ast.UnaryOp(op=ast.USub() | ast.UAdd(), operand=a) if number:
            return all_of([a], True)
        case ast.IfExp(test=test, body=a, orelse=b) if number:
            all_of([test], False)
            return all_of([a, b], True)
        case ast.Compare(left=a, ops=[op], comparators=[b]) if not number:
            if type(op) in _COMPARISONS:
                return all_of([a, b], True)
        case ast.BoolOp(values=parts) if not number:
            return all_of(parts, False)
        case ast.UnaryOp(op=ast.Not(), operand=a) if not number:
            return all_of([a], False)
        case ast.Call(func=function, args=arguments, keywords=[]) if number:
            if _may_call(function, arguments):
                return all_of(arguments, True)
    raise UnknownOperationError(f"expected arithmetic, received {ast.unparse(node)[:80]}")


def _check_power(node: ast.BinOp) -> None:
    """Reject high powers and nested powers of literals, which are huge integers."""
    base, exponent = (_holds(side, ast.Name) for side in (node.left, node.right))
    high = not exponent and not _low(node.right)
    if high or (not base and _holds(node.left, ast.Pow)):
        raise UnknownOperationError(f"expected a low power, received {ast.unparse(node)[:80]}")


def _holds(node: ast.expr, kind: type[ast.AST]) -> bool:
    return any(isinstance(part, kind) for part in ast.walk(node))


def _low(node: ast.expr) -> bool:
    """Return True if a literal, or a fraction of two, is an allowed exponent."""
    match node:
        case ast.UnaryOp(operand=operand):
            return _low(operand)
        case ast.BinOp(left=above, op=ast.Div(), right=ast.Constant()):
            return _low(above)
        case ast.Constant(value=float() | int() as value):
            return abs(value) <= HIGHEST_POWER
    return False


def _may_call(function: ast.expr, arguments: list[ast.expr]) -> bool:
    count = len(arguments)
    match function:
        case ast.Name(id="abs"):
            return count == 1
        case ast.Name(id="max" | "min"):
            return count >= 2
        case ast.Attribute(value=ast.Name(id="math"), attr=name):
            return MATHEMATICS.get(name) == count
        case ast.Attribute(value=ast.Name(id="special"), attr=name) if name in SEVERAL:
            which = arguments[-1] if count == 2 else None
            return isinstance(which, ast.Constant) and which.value in range(SEVERAL[name])
        case ast.Attribute(value=ast.Name(id="special"), attr=name):
            return SPECIAL.get(name) == count
    return False


def value_of(text: str, values: Mapping[str, Any]) -> NDArray[np.float64]:
    """Evaluate arithmetic elementwise.

    Parameters
    ----------
    text : str
        As `check_number` lets pass.
    values : mapping
        Name to number or array.

    Raises
    ------
    UnknownOperationError
        For a name without value, and for a special function, which compiled code alone has.

    Examples
    --------
    >>> value_of("math.sqrt(p0) / 2.0", {"p0": np.array([4.0, 16.0])})
    array([1., 2.])
    """
    given = {name: np.asarray(value, dtype=float) for name, value in values.items()}
    try:
        with np.errstate(all="ignore"):
            return np.asarray(evaluated(text, given), dtype=float)
    except ArithmeticError:
        # of literals alone
        return np.asarray(np.nan)


def evaluated(text: str, values: Mapping[str, Any]) -> Any:
    """Evaluate arithmetic with the result types of Python and NumPy.

    Raises
    ------
    UnknownOperationError
        As `value_of`.
    ArithmeticError
        As Python's own numbers raise.
    """
    return _value(_parsed(text), values)


def _value(node: ast.expr, values: Mapping[str, Any]) -> Any:
    match node:
        case ast.Constant(value=value):
            return value
        case ast.Name(id=name) if name in values:
            return values[name]
        case ast.Attribute(attr=name):
            return _CONSTANTS[name]
        case ast.UnaryOp(op=ast.USub(), operand=a):
            return -_value(a, values)
        case ast.UnaryOp(op=ast.Not(), operand=a):
            return np.logical_not(_value(a, values))
        case ast.UnaryOp(operand=a):
            return _value(a, values)
        case ast.BinOp(left=a, op=op, right=b):
            return _OPERATIONS[type(op)](_value(a, values), _value(b, values))
        case ast.Compare(left=a, ops=[op], comparators=[b]):
            return _COMPARISONS[type(op)](_value(a, values), _value(b, values))
        case ast.BoolOp(op=op, values=parts):
            join = np.logical_and if isinstance(op, ast.And) else np.logical_or
            return join.reduce(np.broadcast_arrays(*(_value(part, values) for part in parts)))
        case ast.IfExp(test=test, body=a, orelse=b):
            return np.where(_value(test, values), _value(a, values), _value(b, values))
        case ast.Call(func=ast.Name(id="max" | "min" as name), args=parts):
            chosen = np.maximum if name == "max" else np.minimum
            return chosen.reduce(np.broadcast_arrays(*(_value(part, values) for part in parts)))
        case ast.Call(func=ast.Name(id=name) | ast.Attribute(ast.Name("math"), name), args=parts):
            function = _NUMPY[name] if name in _NUMPY else FUNCTIONS[name].values
            assert function is not None
            return function(*(_value(part, values) for part in parts))
        case ast.Call(func=ast.Attribute(ast.Name("special"), name), args=[y, ast.Constant(k)]) if (
            name in QUOTIENTS
        ):
            return np.vectorize(QUOTIENTS[name], otypes=[float])(_value(y, values), k)
    raise UnknownOperationError(f"no value is known for {ast.unparse(node)[:80]}")
