"""Values of formulas: numbers and arrays by name."""

from __future__ import annotations

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

#: What an unknown name is called in an error.
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
    """What a name or an expression is as text: itself, or what SymPy prints.

    ``instead`` says in the error what else to write.

    Raises
    ------
    ArgumentError
        For a number or anything else that is neither.

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


def read(expression: object, valid: Iterable[str], kind: str = KIND) -> tuple[Node, dict[str, str]]:
    """The tree of an expression in given names, and the given name of each in it.

    Parameters
    ----------
    expression : str or Expr
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
    text, names = written_formula(expression), list(valid)
    tree = parse(text, names)
    if isinstance(tree, CONDITIONS):
        reason = f"{quoted(text_of(tree))} is a condition; expected a value"
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
    """What to write for the rows at a number, which is no key.

    Examples
    --------
    >>> by_value("t", 5.0), by_value("t", None)
    ('the rows at a value are at(t=5.0)', '')
    """
    value = real_number(key)
    return "" if value is None else f"the rows at a value are at({name}={value!r})"


def evaluated(expression: object, values: Mapping[str, Any], instead: str = "") -> Array:
    """An expression of named columns, element by element.

    Parameters
    ----------
    expression : str or Expr
    values : mapping
        Name to number or array.
    instead : str
        What to write where the expression is no text, for the error.

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
    text = written_formula(expression, instead)
    if text in values:  # a name need not be an identifier
        return np.asarray(values[text], dtype=float)
    tree, known = read(text, values)
    return computed(tree, {name: values[own] for name, own in known.items()})


def column(
    key: object,
    columns: Mapping[str, Callable[[], Array]],
    constants: Mapping[str, float],
    n: int,
    instead: str = "",
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
    instead : str
        What to write where a key is no text, for the error.

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
    text = written_formula(key, instead)
    if text in columns:
        return columns[text]()
    if text in constants:
        return np.full(n, constants[text])
    tree, known = read(text, dict.fromkeys([*columns, *constants]), "column")
    own = {
        name: columns[mine]() if mine in columns else constants[mine]
        for name, mine in known.items()
    }
    return np.array(np.broadcast_to(computed(tree, own), (n,)))


def names_in(expression: object, valid: Mapping[str, Any]) -> frozenset[str]:
    """The names that an expression uses.

    Examples
    --------
    >>> sorted(names_in("v + sin(x)", {"x": 0, "v": 0}))
    ['v', 'x']
    """
    return frozenset(read(expression, valid)[1].values())


def computed(tree: Node, values: Mapping[str, Any]) -> Array:
    """The value of a tree, NaN where it has none that is real.

    Parameters
    ----------
    tree : Node
    values : mapping
        Normalised name to number or array.
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
    """The value of the first piece whose condition holds, NaN where none does."""
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
