"""XPPAUT .ode files."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import sympy as sp
from sympy.printing.str import StrPrinter

from fastslow.exporters.common import comment_text, identifiers, region_values, supported
from fastslow.model.model import Model
from fastslow.model.structure import real

#: Reserved words of XPPAUT, in lower case.
XPP_WORDS = frozenset(
    [
        "t",
        "pi",
        "exp",
        "ln",
        "log",
        "sin",
        "cos",
        "tan",
        "abs",
        "max",
        "min",
        "if",
        "then",
        "else",
        "par",
        "init",
        "aux",
        "done",
        "heav",
        "sign",
        "mod",
        "ran",
        "flr",
    ]
)


def to_xpp(
    model: Model,
    region: str,
    *,
    values: Mapping[Any, float] | None = None,
    state: Mapping[Any, float] | None = None,
) -> dict[str, str]:
    """Write an XPPAUT .ode file for one region. Parameters and errors as for `export`."""
    smooth, parameters, initial = region_values(model, region, values, state)
    names = [*model.states, *model.slow_states]
    # XPPAUT ignores case, distinguishes nine characters and reserves some names
    inside = identifiers(
        [*names, *parameters, *smooth.forcing], XPP_WORDS.__contains__, str.lower, 9
    )
    place = {real(n): sp.Symbol(safe, real=True) for n, safe in inside.items()}
    printer = _XppPrinter()

    def code(expression: sp.Expr) -> str:
        return str(printer.doprint(supported(expression).xreplace(place)))

    lines = [f"# {comment_text(', '.join(names))}, region {comment_text(region)}"]
    where = ", ".join(map(str, smooth.conditions))
    lines += [f"# where {comment_text(where)}"] if where else []
    lines += [f"par {inside[n]}={value!r}" for n, value in parameters.items()]
    lines += [f"{inside[n]}={code(law)}" for n, law in smooth.forcing.items()]
    lines += [f"{inside[n]}'={code(smooth.rates[n])}" for n in names]
    lines += [f"init {inside[n]}={value!r}" for n, value in initial.items()]
    return {f"{region}.ode": "\n".join([*lines, "@ total=100", "done"]) + "\n"}


class _XppPrinter(StrPrinter):
    def _print_Pow(self, expr: sp.Pow, rational: bool = False) -> str:
        if expr.exp == sp.Rational(1, 2):
            return f"sqrt({self._print(expr.base)})"
        if expr.exp.is_number and expr.exp.is_negative:
            return f"(1/({self._print(sp.Pow(expr.base, -expr.exp))}))"
        return f"({self._print(expr.base)})^({self._print(expr.exp)})"

    def _print_log(self, expr: sp.log) -> str:
        return f"ln({self._print(expr.args[0])})"

    def _print_exp(self, expr: sp.exp) -> str:
        return f"exp({self._print(expr.args[0])})"
