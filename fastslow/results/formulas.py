"""Expressions in the columns of a result, read from text and never run as code."""

from __future__ import annotations

import ast
from collections.abc import Callable, Mapping
from functools import reduce
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fastslow.errors import ArgumentError, unknown_name

Array = NDArray[Any]

#: Functions of one argument, as SymPy and as NumPy write them.
FUNCTIONS: dict[str, Callable[[Any], Any]] = {
    "sin": np.sin,
    "cos": np.cos,
    "tan": np.tan,
    "asin": np.arcsin,
    "acos": np.arccos,
    "atan": np.arctan,
    "arcsin": np.arcsin,
    "arccos": np.arccos,
    "arctan": np.arctan,
    "sinh": np.sinh,
    "cosh": np.cosh,
    "tanh": np.tanh,
    "asinh": np.arcsinh,
    "acosh": np.arccosh,
    "atanh": np.arctanh,
    "exp": np.exp,
    "log": np.log,
    "sqrt": np.sqrt,
    "cbrt": np.cbrt,
    "abs": np.abs,
    "Abs": np.abs,
    "sign": np.sign,
    "floor": np.floor,
    "ceiling": np.ceil,
}

#: Functions of several arguments, taken two by two.
FOLDED: dict[str, Callable[[Any, Any], Any]] = {
    "max": np.maximum,
    "Max": np.maximum,
    "min": np.minimum,
    "Min": np.minimum,
}

CONSTANTS = {"pi": np.pi, "E": np.e}

_OPERATORS: dict[type[ast.operator], Callable[[Any, Any], Any]] = {
    ast.Add: np.add,
    ast.Sub: np.subtract,
    ast.Mult: np.multiply,
    ast.Div: np.divide,
    ast.Pow: np.power,
}


def column(
    key: object, columns: Mapping[str, Callable[[], Array]], constants: Mapping[str, float], n: int
) -> Array:
    """A column by name, or an expression in columns and constants.

    Parameters
    ----------
    key : str or Expr
        Read from what it prints: names, numbers, ``+ - * / **``, and the usual functions.
    columns : mapping
        Name to a function that gives the column, shape (n,).
    constants : mapping
        Names with one value throughout.
    n : int

    Returns
    -------
    ndarray, shape (n,)
        NaN where the expression has no real value.

    Raises
    ------
    UnknownNameError
        For a name that is neither.
    ArgumentError
        For text that is no such expression.

    Examples
    --------
    >>> x = np.array([3.0, 4.0])
    >>> column("sqrt(x**2 + D**2) - 1", {"x": lambda: x}, {"D": 4.0}, 2).round(3)
    array([4.   , 4.657])
    """
    text = str(key)
    if text in columns:
        return columns[text]()
    if text in constants:
        return np.full(n, constants[text])
    if text.isidentifier() and text not in CONSTANTS:
        raise unknown_name("column", text, (*columns, *constants))
    try:
        tree = ast.parse(text.strip(), mode="eval")
        with np.errstate(all="ignore"):
            values = _read(tree.body, text, columns, constants)
    except (SyntaxError, ValueError, RecursionError, MemoryError) as error:
        if isinstance(error, ArgumentError):
            raise
        raise ArgumentError(f"{text!r} is no expression in {', '.join(columns)}") from None
    return np.array(np.broadcast_to(values, (n,)))


def _read(
    node: ast.expr,
    text: str,
    columns: Mapping[str, Callable[[], Array]],
    constants: Mapping[str, float],
) -> Any:
    """Values of a parsed expression; only what is listed here is ever called."""
    if isinstance(node, ast.Name):
        if node.id in columns:
            return columns[node.id]()
        for known in (constants, CONSTANTS):
            if node.id in known:
                return np.float64(known[node.id])
        raise unknown_name("column", node.id, (*columns, *constants))
    if (
        isinstance(node, ast.Constant)
        and isinstance(node.value, int | float)
        and not isinstance(node.value, bool)
    ):
        return np.float64(_number(node.value, text))
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub | ast.UAdd):
        inner = _read(node.operand, text, columns, constants)
        return -inner if isinstance(node.op, ast.USub) else inner
    if isinstance(node, ast.BinOp) and type(node.op) in _OPERATORS:
        left = _read(node.left, text, columns, constants)
        right = _read(node.right, text, columns, constants)
        return _OPERATORS[type(node.op)](left, right)
    if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and not node.keywords:
        return _called(node, node.func.id, text, columns, constants)
    raise ArgumentError(
        f"{text!r}: cannot read {ast.unparse(node)!r}; expected names, numbers, + - * / ** and "
        f"the functions {', '.join((*FUNCTIONS, *FOLDED))}"
    )


def _called(
    node: ast.Call,
    name: str,
    text: str,
    columns: Mapping[str, Callable[[], Array]],
    constants: Mapping[str, float],
) -> Any:
    values = [_read(argument, text, columns, constants) for argument in node.args]
    if name in FUNCTIONS:
        if len(values) != 1:
            raise ArgumentError(f"{text!r}: {name} takes one argument, received {len(values)}")
        return FUNCTIONS[name](values[0])
    if name in FOLDED:
        if not values:
            raise ArgumentError(f"{text!r}: {name} takes at least one argument")
        return reduce(FOLDED[name], values)
    raise unknown_name("function", name, (*FUNCTIONS, *FOLDED))


def _number(value: float, text: str) -> float:
    try:
        return float(value)
    except OverflowError:
        raise ArgumentError(f"{text!r}: a number in it is too large") from None
