"""Formulas given as text, read by a walk over a few kinds of nodes; nothing is evaluated."""

from __future__ import annotations

import ast
from collections.abc import Callable
from typing import Any

import sympy as sp
from sympy.core.relational import Relational

from fastslow.errors import ArgumentError
from fastslow.model.structure import real

#: Longest text that is read.
LENGTH = 2000

#: Largest power of a number.
POWER = 64

FUNCTIONS: dict[str, Any] = {
    f.__name__: f for f in (sp.exp, sp.log, sp.sin, sp.cos, sp.tan, sp.sinh, sp.cosh, sp.tanh)
} | {"sqrt": sp.sqrt}

OPERATIONS: dict[type[ast.operator], Callable[[Any, Any], Any]] = {
    ast.Add: lambda a, b: a + b,
    ast.Sub: lambda a, b: a - b,
    ast.Mult: lambda a, b: a * b,
    ast.Div: lambda a, b: a / b,
}

RELATIONS: dict[type[ast.cmpop], Any] = {
    ast.Gt: sp.Gt,
    ast.Lt: sp.Lt,
    ast.GtE: sp.Ge,
    ast.LtE: sp.Le,
}


def read_relation(text: str) -> Relational:
    """Read one inequality between formulas in real symbols.

    Raises
    ------
    ArgumentError
        If it is anything else.

    Examples
    --------
    >>> read_relation("A < -D**2")
    A < -D**2
    """
    node = _tree(text)
    if (
        not isinstance(node, ast.Compare)
        or len(node.ops) != 1
        or type(node.ops[0]) not in RELATIONS
    ):
        raise ArgumentError(f"cannot read {text!r}; expected one inequality such as A < -D**2")
    first, second = _walk(node.left, text), _walk(node.comparators[0], text)
    relation = RELATIONS[type(node.ops[0])](first, second)
    if not isinstance(relation, Relational):
        raise ArgumentError(f"{text!r} is always {relation}; expected an inequality in parameters")
    return relation


def read_formula(text: str) -> sp.Expr:
    """Read a formula in real symbols: numbers, names, + - * / ** and a few functions.

    Raises
    ------
    ArgumentError
        If it holds anything else.

    Examples
    --------
    >>> read_formula("x**2*v + sqrt(2)/3")
    v*x**2 + sqrt(2)/3
    """
    return _walk(_tree(text), text)


def _tree(text: str) -> ast.expr:
    if len(text) > LENGTH:
        raise ArgumentError(f"a formula of {len(text)} characters; expected at most {LENGTH}")
    try:
        return ast.parse(text.strip(), mode="eval").body
    except (SyntaxError, ValueError, RecursionError, MemoryError) as trouble:
        raise ArgumentError(f"cannot read {text!r} as a formula") from trouble


def _walk(node: ast.expr, text: str) -> sp.Expr:
    if isinstance(node, ast.Name):
        return real(node.id)
    if isinstance(node, ast.Constant) and type(node.value) in (int, float):
        return sp.Rational(repr(node.value))
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, (ast.USub, ast.UAdd)):
        inside = _walk(node.operand, text)
        return -inside if isinstance(node.op, ast.USub) else inside
    if isinstance(node, ast.BinOp):
        first, second = _walk(node.left, text), _walk(node.right, text)
        if type(node.op) in OPERATIONS:
            return OPERATIONS[type(node.op)](first, second)
        if isinstance(node.op, ast.Pow):
            if second.is_number and not (second.is_Rational and abs(second) <= POWER):
                raise ArgumentError(f"{text!r}: expected a power of at most {POWER}")
            return first**second
    if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and len(node.args) == 1:
        name = node.func.id
        if name in FUNCTIONS and not node.keywords:
            return FUNCTIONS[name](_walk(node.args[0], text))
    raise ArgumentError(
        f"cannot read {ast.unparse(node)!r} in {text!r}; expected numbers, names, + - * / **, "
        f"{', '.join(FUNCTIONS)}"
    )
