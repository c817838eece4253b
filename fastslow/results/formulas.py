"""Expressions in named columns, read from text by a whitelist: nothing in them is ever run."""

from __future__ import annotations

import ast
from collections.abc import Callable, Iterable, Mapping
from functools import reduce
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fastslow.errors import ArgumentError, unknown_name

Array = NDArray[np.float64]

#: Functions of one argument, as SymPy and as NumPy write them.
SINGLE: dict[str, Callable[[Any], Any]] = {
    "Abs": np.abs,
    "abs": np.abs,
    "acos": np.arccos,
    "acosh": np.arccosh,
    "arccos": np.arccos,
    "arcsin": np.arcsin,
    "arctan": np.arctan,
    "asin": np.arcsin,
    "asinh": np.arcsinh,
    "atan": np.arctan,
    "atanh": np.arctanh,
    "cbrt": np.cbrt,
    "ceiling": np.ceil,
    "cos": np.cos,
    "cosh": np.cosh,
    "exp": np.exp,
    "floor": np.floor,
    "log": np.log,
    "sign": np.sign,
    "sin": np.sin,
    "sinh": np.sinh,
    "sqrt": np.sqrt,
    "tan": np.tan,
    "tanh": np.tanh,
}
#: Functions of several arguments, taken two by two.
FOLDED: dict[str, Callable[[Any, Any], Any]] = {
    "Max": np.maximum,
    "Min": np.minimum,
    "max": np.maximum,
    "min": np.minimum,
}
FUNCTIONS: dict[str, Callable[..., Any]] = {**SINGLE, **FOLDED}
CONSTANTS = {"pi": np.pi, "E": np.e}
OPERATORS: dict[type[ast.operator], Callable[[Any, Any], Any]] = {
    ast.Add: np.add,
    ast.Sub: np.subtract,
    ast.Mult: np.multiply,
    ast.Div: np.divide,
    ast.Pow: np.power,
}

#: What an unknown name is called in an error.
KIND = "name in an expression"


def parsed(expression: object, valid: Iterable[str], kind: str = KIND) -> ast.expr:
    """The tree of an expression in given names.

    Parameters
    ----------
    expression : str or Expr
        What it prints is read: names, numbers, ``+ - * / **`` and the usual functions.
    valid : iterable of str
        The names that may stand in it.
    kind : str
        What the names are, for the error.

    Raises
    ------
    UnknownNameError
        For a name that is none of them.
    ArgumentError
        For anything else that is no expression.
    """
    text, names = str(expression), list(valid)
    try:
        body = ast.parse(text.strip(), mode="eval").body
        _check(body, names, text, kind)
    except ArgumentError:
        raise
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        raise ArgumentError(f"{text!r} is no expression in {', '.join(names)}") from None
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
    >>> evaluated("__import__('os')", {"x": 1.0})  # doctest: +ELLIPSIS
    Traceback (most recent call last):
    ...
    fastslow.errors.ArgumentError: "__import__('os')" is no expression in x: unknown function ...
    """
    text = str(expression)
    if text in values:  # a name need not be an identifier
        return np.asarray(values[text], dtype=float)
    return _computed(parsed(text, values), values.__getitem__)


def column(
    key: object, columns: Mapping[str, Callable[[], Array]], constants: Mapping[str, float], n: int
) -> Array:
    """A column by name, or an expression in columns and constants.

    Parameters
    ----------
    key : str or Expr
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
        For text that is no expression.

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
    tree = parsed(text, dict.fromkeys([*columns, *constants]), "column")
    values = _computed(tree, lambda name: columns[name]() if name in columns else constants[name])
    return np.array(np.broadcast_to(values, (n,)))


def names_in(expression: object, valid: Mapping[str, Any]) -> frozenset[str]:
    """The names that an expression uses.

    Examples
    --------
    >>> sorted(names_in("v + sin(x)", {"x": 0, "v": 0}))
    ['v', 'x']
    """
    found = (n.id for n in ast.walk(parsed(expression, valid)) if isinstance(n, ast.Name))
    return frozenset(name for name in found if name in valid)


def _check(node: ast.expr, valid: list[str], text: str, kind: str) -> None:
    """Refuse whatever an expression in the given names may not hold."""
    parts: list[ast.expr] = []
    if isinstance(node, ast.Name):
        if node.id not in valid and node.id not in CONSTANTS:
            raise unknown_name(kind, node.id, valid)
    elif isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub | ast.UAdd):
        parts = [node.operand]
    elif isinstance(node, ast.BinOp) and type(node.op) in OPERATORS:
        parts = [node.left, node.right]
    elif isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and not node.keywords:
        name, parts = node.func.id, node.args
        if name not in FUNCTIONS:
            raise _refused(text, valid, str(unknown_name("function", name, FUNCTIONS)))
        if not parts or (name in SINGLE and len(parts) != 1):
            wanted = "one argument" if name in SINGLE else "at least one argument"
            raise _refused(text, valid, f"{name} takes {wanted}, received {len(parts)}")
    elif not (isinstance(node, ast.Constant) and type(node.value) in (int, float)):
        expected = "expected names, numbers, + - * / ** and functions"
        raise _refused(text, valid, f"cannot read {ast.unparse(node)!r}; {expected}")
    for part in parts:
        _check(part, valid, text, kind)


def _refused(text: str, valid: list[str], reason: str) -> ArgumentError:
    return ArgumentError(f"{text!r} is no expression in {', '.join(valid)}: {reason}")


def _computed(tree: ast.expr, value_of: Callable[[str], Any]) -> Array:
    with np.errstate(all="ignore"):
        return np.asarray(_value(tree, value_of), dtype=float)


def _value(node: ast.expr, value_of: Callable[[str], Any]) -> Any:
    """Value of a checked tree."""
    if isinstance(node, ast.Name):
        try:
            known = value_of(node.id)
        except KeyError:
            known = CONSTANTS[node.id]
        return np.asarray(known, dtype=float)
    if isinstance(node, ast.UnaryOp):
        inner = _value(node.operand, value_of)
        return -inner if isinstance(node.op, ast.USub) else inner
    if isinstance(node, ast.BinOp):
        left, right = _value(node.left, value_of), _value(node.right, value_of)
        return OPERATORS[type(node.op)](left, right)
    if isinstance(node, ast.Call):
        assert isinstance(node.func, ast.Name)
        arguments = [_value(part, value_of) for part in node.args]
        if node.func.id in SINGLE:
            return SINGLE[node.func.id](arguments[0])
        return reduce(FOLDED[node.func.id], arguments)
    assert isinstance(node, ast.Constant)
    try:
        return np.float64(node.value)  # type: ignore[arg-type]
    except OverflowError:
        # a whole number beyond all floats
        return np.float64(np.inf)
