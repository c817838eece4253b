"""Expressions in named columns, read from text by a whitelist: nothing in them is ever run."""

from __future__ import annotations

import ast
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fastslow.errors import ArgumentError, unknown_name

Array = NDArray[np.float64]

FUNCTIONS: dict[str, Callable[..., Any]] = {
    "Abs": np.abs,
    "abs": np.abs,
    "acos": np.arccos,
    "asin": np.arcsin,
    "atan": np.arctan,
    "cos": np.cos,
    "cosh": np.cosh,
    "exp": np.exp,
    "log": np.log,
    "sign": np.sign,
    "sin": np.sin,
    "sinh": np.sinh,
    "sqrt": np.sqrt,
    "tan": np.tan,
    "tanh": np.tanh,
}
CONSTANTS = {"pi": np.pi, "E": np.e}
OPERATORS: dict[type[ast.operator], Callable[[Any, Any], Any]] = {
    ast.Add: np.add,
    ast.Sub: np.subtract,
    ast.Mult: np.multiply,
    ast.Div: np.divide,
    ast.Pow: np.power,
}


def parsed(expression: object, valid: Mapping[str, Any]) -> ast.expr:
    """The tree of an expression in given names.

    Parameters
    ----------
    expression : str or Expr
        What it prints is read: names, numbers, ``+ - * / **`` and the usual functions.
    valid : mapping
        Its keys are the names that may stand in it.

    Raises
    ------
    UnknownNameError
        For a name that is none of them.
    ArgumentError
        For anything else that is no expression.
    """
    text = str(expression)
    try:
        body = ast.parse(text, mode="eval").body
    except SyntaxError:
        raise ArgumentError(f"{text!r} is no expression in {', '.join(valid)}") from None
    _check(body, valid, text)
    return body


def evaluated(expression: object, values: Mapping[str, Any]) -> Array:
    """An expression of named columns, element by element.

    Parameters
    ----------
    expression : str or Expr
    values : mapping
        Name to number or array.

    Raises
    ------
    UnknownNameError
        For a name that has no values.
    ArgumentError
        For anything that is no expression.

    Examples
    --------
    >>> evaluated("x**2 + 2*v", {"x": np.array([1.0, 3.0]), "v": np.array([0.0, 1.0])})
    array([ 1., 11.])
    >>> evaluated("__import__('os')", {"x": 1.0})
    Traceback (most recent call last):
    ...
    fastslow.errors.ArgumentError: "__import__('os')" is no expression in x
    """
    text = str(expression)
    if text in values:  # a name need not be an identifier
        return np.asarray(values[text], dtype=float)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        return np.asarray(_value(parsed(text, values), values), dtype=float)


def names_in(expression: object, valid: Mapping[str, Any]) -> frozenset[str]:
    """The names that an expression uses.

    Examples
    --------
    >>> sorted(names_in("v + sin(x)", {"x": 0, "v": 0}))
    ['v', 'x']
    """
    found = (n.id for n in ast.walk(parsed(expression, valid)) if isinstance(n, ast.Name))
    return frozenset(name for name in found if name in valid)


def _check(node: ast.expr, valid: Mapping[str, Any], text: str) -> None:
    """Refuse whatever an expression in the given names may not hold."""
    if isinstance(node, ast.Name):
        if node.id not in valid and node.id not in CONSTANTS:
            raise unknown_name("name in an expression", node.id, valid)
    elif isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub | ast.UAdd):
        _check(node.operand, valid, text)
    elif isinstance(node, ast.BinOp) and type(node.op) in OPERATORS:
        _check(node.left, valid, text)
        _check(node.right, valid, text)
    elif _calls(node):
        assert isinstance(node, ast.Call)
        _check(node.args[0], valid, text)
    elif not (isinstance(node, ast.Constant) and type(node.value) in (int, float)):
        raise ArgumentError(f"{text!r} is no expression in {', '.join(valid)}")


def _calls(node: ast.expr) -> bool:
    """Whether a node calls one of the known functions of one argument."""
    if not (isinstance(node, ast.Call) and isinstance(node.func, ast.Name)):
        return False
    return node.func.id in FUNCTIONS and len(node.args) == 1 and not node.keywords


def _value(node: ast.expr, values: Mapping[str, Any]) -> Any:
    """Value of a checked tree."""
    if isinstance(node, ast.Name):
        return np.asarray(values.get(node.id, CONSTANTS.get(node.id)), dtype=float)
    if isinstance(node, ast.UnaryOp):
        inner = _value(node.operand, values)
        return -inner if isinstance(node.op, ast.USub) else inner
    if isinstance(node, ast.BinOp):
        return OPERATORS[type(node.op)](_value(node.left, values), _value(node.right, values))
    if isinstance(node, ast.Call):
        assert isinstance(node.func, ast.Name)
        return FUNCTIONS[node.func.id](_value(node.args[0], values))
    assert isinstance(node, ast.Constant)
    return np.float64(node.value)  # type: ignore[arg-type]
