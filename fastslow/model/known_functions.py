"""Functions supported in models: their numerical evaluation and their Taylor recurrences."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable
from functools import cache
from typing import Any

import mpmath
import sympy as sp
from sympy.core.function import ArgumentIndexError
from sympy.printing.codeprinter import CodePrinter

from fastslow.errors import ModelError
from fastslow.formulas import elementary
from fastslow.formulas.elementary import Elementary
from fastslow.formulas.symbolic import read
from fastslow.model.clocks import ClockFunction
from fastslow.model.removable import REMOVABLE, Removable
from fastslow.model.tabulated import TableValue

#: Elementary functions by their classes. Taylor coefficients follow from the derivative.
ELEMENTARY: dict[type[sp.Function], Elementary] = {
    getattr(sp, name): one for name, one in elementary.ELEMENTARY.items()
}

#: Special functions whose derivatives are expressed by functions of these two tables.
CLOSED = {
    sp.erfi: "special.erfi({})",
    sp.erfinv: "special.erfinv({})",
    sp.erfcinv: "special.erfcinv({})",
    sp.fresnels: "special.fresnel({}, 0)",
    sp.fresnelc: "special.fresnel({}, 1)",
    sp.airyai: "special.airy({}, 0)",
    sp.airyaiprime: "special.airy({}, 1)",
    sp.airybi: "special.airy({}, 2)",
    sp.airybiprime: "special.airy({}, 3)",
    sp.Ei: "special.expi({})",
    sp.li: "special.expi(math.log({}))",
    sp.Ci: "special.sici({}, 1)",
    sp.Chi: "special.shichi({}, 1)",
    sp.LambertW: "special.lambertw({}, {})",
    sp.expint: "special.expn({}, {})",
    sp.uppergamma: "special.gammaincc({0}, {1}) * special.gamma({0})",
    sp.lowergamma: "special.gammainc({0}, {1}) * special.gamma({0})",
}

#: Special functions whose derivatives are not, or are indeterminate quotients 0/0 somewhere.
OPEN = {
    sp.gamma: "special.gamma({})",
    sp.loggamma: "special.loggamma({})",
    sp.polygamma: "special.polygamma({}, {})",
    sp.beta: "special.beta({}, {})",
    sp.factorial: "special.gamma(1.0 + ({}))",
    sp.zeta: "1.0 + special.zetac({})",
    sp.besselj: "special.jv({}, {})",
    sp.bessely: "special.yv({}, {})",
    sp.besseli: "special.iv({}, {})",
    sp.besselk: "special.kv({}, {})",
    sp.elliptic_k: "special.ellipk({})",
    sp.elliptic_f: "special.ellipkinc({}, {})",
    sp.elliptic_e: "special.ellipe({})",
    sp.Si: "special.sici({}, 0)",
    sp.Shi: "special.shichi({}, 0)",
}

#: Arguments of the formulas of records.
_ARGUMENTS = sp.symbols("u v")

VALUES: dict[type[sp.Function], str] = (
    {f: one.template for f, one in ELEMENTARY.items()} | CLOSED | OPEN
)

#: Functions that have other names in mpmath than in SymPy.
IN_MPMATH: dict[str, Callable[[Any], Any]] = {
    "airyaiprime": lambda x: mpmath.airyai(x, derivative=1),
    "airybiprime": lambda x: mpmath.airybi(x, derivative=1),
    "erfcinv": lambda x: mpmath.erfinv(1 - x),
}

#: Indices of the arguments in which functions have a recurrence, where not in all.
_IN_ARGUMENTS = {sp.LambertW: (0,), sp.expint: (1,), sp.uppergamma: (1,), sp.lowergamma: (1,)}

#: Functions that SymPy prints as Python.
_PRINTED = (sp.Abs, sp.sign, sp.Max, sp.Min, sp.Heaviside, sp.Piecewise)

#: Functions with two forms in SymPy: default arguments, and another function here.
_DEFAULTS = {sp.LambertW: (sp.Integer(0),)}
_OTHERWISE = {(sp.elliptic_e, 2): "special.ellipeinc({}, {})"}


@cache
def _formula(text: str) -> sp.Expr:
    return sp.sympify(read(text, sp.Symbol))


def formula_at(text: str, *arguments: sp.Expr) -> sp.Expr:
    """Return a formula of a record, in u and v, at the arguments of its function.

    Examples
    --------
    >>> x = sp.Symbol("x", real=True)
    >>> formula_at(ELEMENTARY[sp.acosh].domain, 2 * x)
    2*x - 1
    """
    return _formula(text).xreplace(dict(zip(_ARGUMENTS, arguments, strict=False)))


def in_functions_of(expression: sp.Expr, program: str) -> sp.Expr:
    """Return an expression without the elementary functions that a program lacks.

    Those that can be written by others are; see `fastslow.formulas.elementary`.
    """

    def lacks(e: sp.Basic) -> bool:
        known = ELEMENTARY.get(e.func)
        return known is not None and not known.named(program) and bool(known.written)

    def written(e: sp.Function) -> sp.Expr:
        return formula_at(ELEMENTARY[e.func].written, *e.args)

    while expression.find(lacks):
        expression = expression.replace(lacks, written)
    return expression


def value_code(expression: sp.Function, code_of: Callable[[sp.Expr], str]) -> str:
    """Return the source of a function's value, from the source of its arguments.

    Raises
    ------
    ModelError
        For a function, or a form of one, that is not in the tables.
    """
    function, arguments = expression.func, expression.args
    if isinstance(expression, Removable):
        return f"special.{expression.stored}({code_of(arguments[0])}, {int(arguments[1])})"
    if function not in VALUES:
        raise refusal([expression])
    if len(arguments) == 1:
        arguments += _DEFAULTS.get(function, ())
    code = _OTHERWISE.get((function, len(arguments)), VALUES[function])
    if _count(code) != len(arguments) or not _in_domain(function, arguments):
        raise ModelError(f"{function} cannot be compiled in this form: {_form(function)}")
    return f"({code.format(*map(code_of, arguments))})"


def refusal(expressions: Iterable[sp.Expr]) -> ModelError:
    """Return the error that names the unsupported functions in some expressions."""
    held = set().union(*(e.atoms(sp.Function, sp.Derivative, sp.Integral) for e in expressions))
    if any(isinstance(f, TableValue) for f in held):
        return ModelError(
            "the equations contain a table of values in time (Tabulated), which only simulations, "
            "overlay and, for periodic tables, functions for periodic orbits accept; give its "
            "quantity a formula, or freeze the model"
        )
    if any(isinstance(f, ClockFunction) for f in held):
        return ModelError(
            "the equations contain a clock (Mod, floor or frac of time), which only simulations "
            "and functions for periodic orbits accept"
        )
    names = {
        f"the derivative of {f.expr.func}" if isinstance(f, sp.Derivative) else str(f.func)
        for f in held
        if f.func not in (*VALUES, *_PRINTED) and not isinstance(f, Removable)
    }
    found = ", ".join(sorted(names)) or "complex numbers"
    return ModelError(
        f"the equations or their derivatives contain {found}, which cannot be compiled; "
        "expected one of " + ", ".join(sorted(f.__name__ for f in VALUES))
    )


def register_functions(printer: type[CodePrinter]) -> None:
    """Add all supported functions to a printer of source code."""

    def show(self: CodePrinter, expr: sp.Function) -> str:
        return value_code(expr, self._print)

    # a printer looks for a method by the names of a class and of its parents; a function
    # that is not known anywhere has AppliedUndef among them
    for name in (*(f.__name__ for f in (*VALUES, *REMOVABLE)), "AppliedUndef"):
        setattr(printer, f"_print_{name}", show)


def _count(code: str) -> int:
    """Number of arguments of a template."""
    return len(set(re.findall(r"{\d?}", code))) if "{0}" in code else code.count("{}")


def _in_domain(function: type[sp.Function], arguments: tuple[sp.Expr, ...]) -> bool:
    if function is sp.LambertW:
        return arguments[1] in (0, -1)
    if function is sp.expint:
        return bool(arguments[0].is_Integer and arguments[0] >= 0)
    if function is sp.polygamma:
        return bool(arguments[0].is_Integer)
    return True


def _form(function: type[sp.Function]) -> str:
    forms = {
        sp.LambertW: "the branch must be 0 or -1",
        sp.expint: "the order must be a whole number",
        sp.polygamma: "the order must be a whole number",
    }
    return forms.get(function, "another number of arguments was expected")


def without_recurrence(expression: sp.Expr, changing: set[sp.Symbol]) -> set[str]:
    """Return the names of functions of changing symbols that have no Taylor recurrence.

    Examples
    --------
    >>> x, a = sp.symbols("x a")
    >>> without_recurrence(sp.airyai(x) * sp.gamma(a), {x})
    set()
    >>> without_recurrence(sp.airyai(x) * sp.gamma(x), {x})
    {'gamma'}
    """
    found = set()
    for f in expression.atoms(sp.Function):
        moving = {k for k, argument in enumerate(f.args) if argument.free_symbols & changing}
        allowed = set(_IN_ARGUMENTS.get(f.func, range(len(f.args))))
        if moving and (f.func in OPEN or not moving <= allowed):
            found.add(f.func.__name__)
    return found


def slope_of(expression: sp.Function, index: int) -> sp.Expr:
    """Return the derivative of a function by one of its arguments, numbered from 1.

    Raises
    ------
    ModelError
        If it has no closed form.
    """
    if isinstance(expression, sp.LambertW):
        # SymPy's form is 0/0 at 0
        return sp.exp(-expression) / (1 + expression)
    try:
        return sp.sympify(expression.fdiff(index))
    except ArgumentIndexError:
        raise ModelError(f"{expression} has no derivative that could be compiled") from None
