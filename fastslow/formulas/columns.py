"""Evaluation of formulas on numbers and arrays."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fastslow.arguments import real_number, shown
from fastslow.errors import ArgumentError, quoted, unknown_name
from fastslow.formulas.functions import CONSTANTS, FUNCTIONS, SPECIAL
from fastslow.formulas.grammar import (
    CONDITIONS,
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
    names_of,
    nodes,
    normalised,
    parse,
    refused,
    text_of,
)

Array = NDArray[np.float64]

#: Description of an unknown name in an error.
KIND = "name in an expression"

_COMPARED: dict[str, Callable[[Any, Any], Any]] = {
    "<": np.less,
    "<=": np.less_equal,
    ">": np.greater,
    ">=": np.greater_equal,
    "==": np.equal,
    "!=": np.not_equal,
}


def written_formula(given: object, instead: str = "") -> str:
    """Return a name or an expression as text; SymPy objects are printed.

    ``instead`` is an alternative proposed in the error.

    Raises
    ------
    ArgumentError
        For a number or any other object.

    Examples
    --------
    >>> written_formula(5.0)
    Traceback (most recent call last):
    ...
    fastslow.errors.ArgumentError: expected a name such as 'x' or an expression in names, as text \
or in SymPy, received 5.0
    """
    if isinstance(given, str) or hasattr(given, "free_symbols"):
        return str(given)
    raise ArgumentError(
        "expected a name such as 'x' or an expression in names, as text or in SymPy, "
        f"received {shown(given)}{instead and '; ' + instead}"
    )


def read(
    expression: object, valid: Iterable[str], kind: str = KIND, condition: bool = False
) -> tuple[Node, dict[str, str]]:
    """Parse an expression in given names; return its tree and the given form of each name.

    Parameters
    ----------
    expression : str or Expr
    valid : iterable of str
        The accepted names.
    kind : str
        Description of the names in errors.
    condition : bool
        True for a condition such as ``x > 0`` in place of a value.

    Raises
    ------
    UnknownNameError
        For an unknown name.
    ArgumentError
        For text that is not an expression.
    """
    text, names = written_formula(expression), list(valid)
    tree = parse(text, names)
    if isinstance(tree, CONDITIONS) is not condition:
        received, expected = "condition", "value"
        if condition:
            received, expected = "value", "condition such as x > 0"
        reason = f"{quoted(text_of(tree))} is a {received}; expected a {expected}"
        raise refused(text, reason, names)
    known = {normalised(name): name for name in names}
    for name in names_of(tree):
        if name not in known and name not in CONSTANTS:
            raise unknown_name(kind, name, names)
    for node in nodes(tree):
        if isinstance(node, Call) and FUNCTIONS[node.function].symbolic in SPECIAL:
            raise refused(text, f"{node.function} is a function for equations alone", names)
    return tree, {name: known[name] for name in names_of(tree) if name in known}


def by_value(name: str, key: object) -> str:
    """Return the hint for a number in place of a key: the query by value.

    Examples
    --------
    >>> by_value("t", 5.0), by_value("t", None)
    ('the rows at a value are at(t=5.0)', '')
    """
    value = real_number(key)
    return "" if value is None else f"the rows at a value are at({name}={value!r})"


def evaluated(expression: object, values: Mapping[str, Any], instead: str = "") -> Array:
    """Evaluate an expression of named columns elementwise.

    Parameters
    ----------
    expression : str or Expr
    values : mapping
        Numbers or arrays by name.
    instead : str
        Alternative proposed in the error for an expression that is not text.

    Raises
    ------
    UnknownNameError
        For a name without values.
    ArgumentError
        For an invalid expression.

    Examples
    --------
    >>> evaluated("x**2 + 2*v", {"x": np.array([1.0, 3.0]), "v": np.array([0.0, 1.0])})
    array([ 1., 11.])
    >>> evaluated("__import__('os')", {"x": 1.0})  # doctest: +ELLIPSIS
    Traceback (most recent call last):
    ...
    fastslow.errors.ArgumentError: "__import__('os')" is not an expression in x: unknown ...
    """
    return evaluation(expression, values, instead)(values)


def evaluation(
    expression: object, valid: Iterable[str], instead: str = ""
) -> Callable[[Mapping[str, Any]], Array]:
    """Read an expression of named columns once, and return its evaluation at their values.

    Parameters
    ----------
    expression : str or Expr
    valid : iterable of str
        The names that have values.
    instead : str
        Alternative proposed in the error for an expression that is not text.

    Examples
    --------
    >>> square = evaluation("x**2 + 2*v", ["x", "v"])
    >>> square({"x": 1.0, "v": 0.0}), square({"x": 3.0, "v": 1.0})
    (array(1.), array(11.))
    """
    text, names = written_formula(expression, instead), tuple(valid)
    if text in names:  # a name need not be an identifier
        return lambda values: np.asarray(values[text], dtype=float)
    tree, known = read(text, names)
    return lambda values: computed(tree, {name: values[own] for name, own in known.items()})


def column(
    key: object,
    columns: Mapping[str, Callable[[], Array]],
    constants: Mapping[str, float],
    n: int,
    instead: str = "",
) -> Array:
    """Return a column by name, or evaluate an expression in columns and constants.

    Parameters
    ----------
    key : str or Expr
    columns : mapping
        Functions that return columns of shape (n,), by name.
    constants : mapping
        Constants by name.
    n : int
    instead : str
        Alternative proposed in the error for a key that is not text.

    Returns
    -------
    ndarray, shape (n,)
        NaN where the expression has no real value.

    Raises
    ------
    UnknownNameError
        For a name that is neither a column nor a constant.
    ArgumentError
        For text that is not an expression.

    Examples
    --------
    >>> x = np.array([3.0, 4.0])
    >>> column("sqrt(x**2 + D**2) - 1", {"x": lambda: x}, {"D": 4.0}, 2).round(3)
    array([4.   , 4.657])
    """
    text = written_formula(key, instead)
    if text in columns:
        return columns[text]()
    if text in constants:
        return np.full(n, constants[text])
    tree, values = _operands(text, columns, constants)
    return np.array(np.broadcast_to(computed(tree, values), (n,)))


def rows_where(
    condition: object,
    columns: Mapping[str, Callable[[], Array]],
    constants: Mapping[str, float],
    n: int,
) -> NDArray[np.bool_]:
    """Evaluate a condition in columns and constants, shape (n,).

    Parameters
    ----------
    condition : str or Expr
    columns, constants, n
        As for `column`.

    Raises
    ------
    UnknownNameError
        For a name that is neither a column nor a constant.
    ArgumentError
        For text that is not a condition.

    Examples
    --------
    >>> x = np.array([-1.0, 0.5, 2.0])
    >>> rows_where("x > 0 and x**2 < D", {"x": lambda: x}, {"D": 1.0}, 3)
    array([False,  True, False])
    """
    tree, values = _operands(written_formula(condition), columns, constants, condition=True)
    with np.errstate(all="ignore"):
        return np.array(np.broadcast_to(_holds(tree, values), (n,)), dtype=bool)


def _operands(
    text: str,
    columns: Mapping[str, Callable[[], Array]],
    constants: Mapping[str, float],
    condition: bool = False,
) -> tuple[Node, dict[str, Any]]:
    """Parse an expression in columns and constants; return its tree and the values of its names."""
    named = {}
    for k, name in enumerate(sorted(columns, key=len, reverse=True)):
        if not name.isidentifier() and name in text:
            # such as max(x), the column of a table of orbits
            named[f"column_{k}"] = name
            text = re.sub(rf"(?<!\w){re.escape(name)}(?!\w)", f"column_{k}", text)
    tree, known = read(text, dict.fromkeys([*columns, *constants, *named]), "column", condition)
    known |= {name: named[name] for name in known.keys() & named.keys()}
    return tree, {
        name: columns[own]() if own in columns else constants[own] for name, own in known.items()
    }


def names_in(expression: object, valid: Mapping[str, Any]) -> frozenset[str]:
    """Return the names in an expression.

    Examples
    --------
    >>> sorted(names_in("v + sin(x)", {"x": 0, "v": 0}))
    ['v', 'x']
    """
    return frozenset(read(expression, valid)[1].values())


def computed(tree: Node, values: Mapping[str, Any]) -> Array:
    """Evaluate a tree, with NaN where it has no real value.

    Parameters
    ----------
    tree : Node
    values : mapping
        Numbers or arrays by normalised name.
    """
    with np.errstate(all="ignore"):
        return np.asarray(_value(tree, values), dtype=float)


def _value(node: Node, values: Mapping[str, Any]) -> Any:
    match node:
        case Number():
            return np.float64(node.value)
        case Name(name):
            return np.asarray(values[name] if name in values else CONSTANTS[name], dtype=float)
        case Negative(operand):
            return -_value(operand, values)
        case Sum(((_, first), *rest)):
            total = _value(first, values)
            for sign, term in rest:
                total = (np.add if sign == "+" else np.subtract)(total, _value(term, values))
            return total
        case Product(((_, first), *rest)):
            total = _value(first, values)
            for sign, factor in rest:
                join = np.multiply if sign == "*" else np.divide
                total = join(total, _value(factor, values))
            return total
        case Power(base, exponent):
            # the operator squares and takes roots in every version of NumPy, the function in some
            return np.asarray(_value(base, values)) ** _value(exponent, values)
        case Call("Piecewise", pieces):
            return _piecewise(pieces, values)
        case Call(function, arguments):
            known = FUNCTIONS[function].values
            assert known is not None
            return known(*(_value(argument, values) for argument in arguments))
    raise TypeError(node)


def _piecewise(pieces: Iterable[Node], values: Mapping[str, Any]) -> Any:
    """Evaluate the first piece whose condition is true, NaN without any."""
    conditions, found = [], []
    for piece in pieces:
        assert isinstance(piece, Pair)
        found.append(np.asarray(_value(piece.value, values), dtype=float))
        conditions.append(np.asarray(_holds(piece.condition, values)))
    shape = np.broadcast_shapes(*(a.shape for a in (*found, *conditions)))
    result = np.full(shape, np.nan)
    for value, condition in zip(reversed(found), reversed(conditions), strict=True):
        result = np.where(condition, value, result)
    return result


def _holds(node: Node, values: Mapping[str, Any]) -> Any:
    match node:
        case Truth(value):
            return value
        case Comparison(operators, operands):
            known = [_value(operand, values) for operand in operands]
            held = [
                _COMPARED[sign](one, other)
                for sign, one, other in zip(operators, known[:-1], known[1:], strict=True)
            ]
            return np.logical_and.reduce(np.broadcast_arrays(*held))
        case Logic("not", (operand,)):
            return np.logical_not(_holds(operand, values))
        case Logic(word, operands):
            join = np.logical_and if word == "and" else np.logical_or
            held = [_holds(operand, values) for operand in operands]
            return join.reduce(np.broadcast_arrays(*held))
    raise TypeError(node)
