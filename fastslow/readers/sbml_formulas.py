"""Formulas of SBML files, as libSBML has read them, in SymPy."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cached_property, reduce
from itertools import pairwise
from typing import Any

import sympy as sp
from sympy.logic.boolalg import Boolean

from fastslow.errors import ModelError
from fastslow.model.structure import TIME, real

#: The function rateOf of Level 3 Version 2, which is replaced by a rate.
RATE_OF = sp.Function("rateOf")

#: Number of particles of one mole, as SBML has defined it.
AVOGADRO = 6.02214179e23

_ONE = {
    "EXP": sp.exp, "LN": sp.log, "ABS": sp.Abs, "FLOOR": sp.floor, "CEILING": sp.ceiling,
    "FACTORIAL": sp.factorial, "SIN": sp.sin, "COS": sp.cos, "TAN": sp.tan, "SEC": sp.sec,
    "CSC": sp.csc, "COT": sp.cot, "SINH": sp.sinh, "COSH": sp.cosh, "TANH": sp.tanh,
    "SECH": sp.sech, "CSCH": sp.csch, "COTH": sp.coth, "ARCSIN": sp.asin, "ARCCOS": sp.acos,
    "ARCTAN": sp.atan, "ARCSEC": sp.asec, "ARCCSC": sp.acsc, "ARCCOT": sp.acot,
    "ARCSINH": sp.asinh, "ARCCOSH": sp.acosh, "ARCTANH": sp.atanh,
    "ARCSECH": lambda u: sp.acosh(1 / u), "ARCCSCH": lambda u: sp.asinh(1 / u),
    "ARCCOTH": lambda u: sp.atanh(1 / u),
}  # fmt: skip
_RELATIONS = {
    "EQ": sp.Eq, "NEQ": sp.Ne, "GT": sp.Gt, "GEQ": sp.Ge, "LT": sp.Lt, "LEQ": sp.Le
}  # fmt: skip


class Formulas:
    """Formulas of a model, with its function definitions.

    Parameters
    ----------
    content
        The model of libSBML.
    name_of : callable
        Name in the model of a name in the file.
    """

    def __init__(self, content: Any, name_of: Callable[[str], str]) -> None:
        self.content, self.name_of = content, name_of

    @cached_property
    def kinds(self) -> dict[int, str]:
        """Names of the kinds of nodes."""
        import libsbml

        return {
            value: name.removeprefix("AST_")
            for name, value in vars(libsbml).items()
            if name.startswith("AST_")
            and isinstance(value, int)
            and not name.startswith("AST_TYPE")
        }

    def number(self, node: Any, local: Mapping[str, Any] | None = None) -> sp.Expr:
        """Return a formula with the value of a number, in the names of the model."""
        found = self._of(node, local or {})
        if isinstance(found, sp.Symbol):
            return found
        if isinstance(found, Boolean):
            return sp.Piecewise((sp.S.One, found), (sp.S.Zero, True))
        return found

    def condition(self, node: Any, local: Mapping[str, Any] | None = None) -> Boolean:
        """Return a formula that is true or false; a number is true unless it is zero."""
        found = self._of(node, local or {})
        if isinstance(found, Boolean) and not isinstance(found, sp.Symbol):
            return found
        return sp.Ne(found, 0)

    def _of(self, node: Any, local: Mapping[str, Any]) -> Any:
        kind = self.kinds.get(node.getType(), "UNKNOWN")
        children = [node.getChild(k) for k in range(node.getNumChildren())]
        if kind in ("INTEGER", "REAL", "REAL_E", "RATIONAL"):
            return self._literal(node, kind)
        if kind == "NAME":
            name = node.getName()
            return local[name] if name in local else real(self.name_of(name))
        name = kind.removeprefix("FUNCTION_")
        if kind == "FUNCTION":
            return self._called(node, children, local)
        if kind in ("FUNCTION_PIECEWISE",):
            return self._piecewise(children, local)
        if kind.startswith("RELATIONAL_"):
            values = [self.number(c, local) for c in children]
            relation = _RELATIONS[kind.removeprefix("RELATIONAL_")]
            return sp.And(*(relation(a, b) for a, b in pairwise(values)))
        if kind.startswith("LOGICAL_"):
            truths = [self.condition(c, local) for c in children]
            return self._logical(kind.removeprefix("LOGICAL_"), truths)
        constants = {
            "NAME_TIME": TIME, "NAME_AVOGADRO": sp.Float(AVOGADRO), "CONSTANT_E": sp.E,
            "CONSTANT_PI": sp.pi, "CONSTANT_TRUE": sp.true, "CONSTANT_FALSE": sp.false,
        }  # fmt: skip
        if kind in constants:
            return constants[kind]
        values = [self.number(c, local) for c in children]
        return self._arithmetic(kind, name, node, values)

    def _literal(self, node: Any, kind: str) -> sp.Expr:
        if kind == "INTEGER":
            return sp.Integer(node.getInteger())
        if kind == "RATIONAL":
            return sp.Rational(node.getNumerator(), node.getDenominator())
        value = node.getReal()
        if value != value:
            raise ModelError("notanumber: expected a number")
        if value in (float("inf"), float("-inf")):
            return sp.oo if value > 0 else -sp.oo
        return sp.nsimplify(value, rational=True) if value == int(value) else sp.Float(value)

    def _arithmetic(self, kind: str, name: str, node: Any, values: list[sp.Expr]) -> Any:
        if name in _ONE and len(values) == 1:
            return _ONE[name](values[0])
        match (name, *values):
            case ("PLUS", *_):
                return sp.Add(*values)
            case ("TIMES", *_):
                return sp.Mul(*values)
            case ("MINUS", u):
                return -u
            case ("MINUS", u, v):
                return u - v
            case ("DIVIDE", u, v):
                return u / v
            case ("POWER", u, v):
                return u**v
            case ("ROOT", n, u):
                return u ** (1 / n)
            case ("LOG", base, u):
                return sp.log(u) / sp.log(base)
            case ("MAX", *_):
                return sp.Max(*values)
            case ("MIN", *_):
                return sp.Min(*values)
            case ("QUOTIENT", u, v):
                return (
                    sp.floor(u / v)
                    if (u / v).is_nonnegative
                    else sp.sign(u / v) * sp.floor(sp.Abs(u / v))
                )
            case ("REM", u, v):
                return u - v * sp.sign(u / v) * sp.floor(sp.Abs(u / v))
            case ("RATE_OF", u):
                return RATE_OF(u)
        what = (
            "the function delay" if "DELAY" in kind else f"the operation {node.getName() or kind}"
        )
        raise ModelError(f"{what}: expected the operations of ordinary differential equations")

    def _called(self, node: Any, children: list[Any], local: Mapping[str, Any]) -> Any:
        definition = self.content.getFunctionDefinition(node.getName())
        if definition is None or not definition.isSetMath() or definition.getBody() is None:
            raise ModelError(f"functionDefinition {node.getName()}: expected one with a formula")
        names = [definition.getArgument(k).getName() for k in range(definition.getNumArguments())]
        return self._of(
            definition.getBody(),
            dict(zip(names, (self._of(c, local) for c in children), strict=True)),
        )

    def _piecewise(self, children: list[Any], local: Mapping[str, Any]) -> Any:
        pairs = [
            (self.number(value, local), self.condition(when, local))
            for value, when in zip(children[::2], children[1::2], strict=False)
        ]
        if len(children) % 2:
            pairs.append((self.number(children[-1], local), sp.true))
        return sp.Piecewise(*pairs)

    def _logical(self, name: str, truths: list[Boolean]) -> Boolean:
        match name:
            case "AND":
                return sp.And(*truths)
            case "OR":
                return sp.Or(*truths)
            case "NOT":
                return sp.Not(truths[0])
            case "XOR":
                return reduce(sp.Xor, truths, sp.false)
        return sp.Or(sp.Not(truths[0]), truths[1])
