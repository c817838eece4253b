"""XPPAUT .ode files."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import sympy as sp
from sympy.printing.str import StrPrinter

from fastslow.exporters.common import (
    Helpers,
    comment_text,
    identifiers,
    region_values,
    supported,
)
from fastslow.model.model import Model
from fastslow.model.structure import TIME, real

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
    # time of the next instant of a clock
    instants = [f"next{k}" for k in range(_count_of_clocks(model))]
    # XPPAUT ignores case, distinguishes nine characters and reserves some names
    inside = identifiers(
        [*names, *parameters, *smooth.forcing, *model.switches, *instants],
        lambda n: n in XPP_WORDS or Helpers.reserved(n),
        str.lower,
        9,
    )
    place = {real(n): sp.Symbol(safe, real=True) for n, safe in inside.items()}
    printer, helpers = _XppPrinter(), Helpers()

    def code(expression: sp.Expr) -> str:
        written = supported(expression, clocks=True).xreplace(place)
        return str(printer.doprint(helpers.called(written)))

    lines = [f"# {comment_text(', '.join(names))}, region {comment_text(region)}"]
    where = ", ".join(map(str, smooth.conditions))
    lines += [f"# where {comment_text(where)}"] if where else []
    lines += [f"par {inside[n]}={value!r}" for n, value in parameters.items()]
    first = len(lines)
    lines += [f"{inside[n]}={code(law)}" for n, law in smooth.forcing.items()]
    lines += [f"{inside[n]}'={code(smooth.rates[n])}" for n in names]
    here = {real(n): v for n, v in {**initial, **parameters}.items()} | {TIME: 0.0}
    for name, switch in model.switches.items():
        lines.append(f"{inside[name]}'=0")
        if name not in {str(key) for key in state or {}}:
            # a relation that is true at the start decides
            initial[name] = float(bool(switch.watched(0).subs(here) > 0))
    lines += [f"init {inside[n]}={value!r}" for n, value in initial.items()]
    lines += _events(model, inside, parameters, instants, code)
    lines[first:first] = [f"{n}(y)={printer.doprint(e)}" for n, e in helpers.used.items()]
    return {f"{region}.ode": "\n".join([*lines, "@ total=100", "done"]) + "\n"}


def _count_of_clocks(model: Model) -> int:
    clocks = [reset.clock for reset in model.resets.values()]
    clocks += [clock for switch in model.switches.values() for clock in switch.clocks]
    return sum(clock is not None for clock in clocks)


def _events(
    model: Model,
    inside: Mapping[str, str],
    parameters: Mapping[str, float],
    instants: Sequence[str],
    code: Callable[[sp.Expr], str],
) -> list[str]:
    """Lines of the ``global`` events of resets and switches.

    At instants of time the state is a variable, the time of the next one.
    """
    lines: list[str] = []
    left = list(instants)

    def event(function: sp.Expr, clock: tuple[sp.Expr, sp.Expr] | None, changes: list[str]) -> None:
        if clock is None:
            lines.append(f"global 1 {{{code(function)}}} {{{';'.join(changes)}}}")
            return
        following, (period, phase) = inside[left.pop(0)], clock
        values = {real(n): value for n, value in parameters.items()}
        step, first = (float(e.subs(values)) for e in (period, phase))
        # the instant at the start is not one of this run
        first += step * (math.floor(-first / step) + 1)
        lines.extend([f"{following}'=0", f"init {following}={first!r}"])
        changes = [*changes, f"{following}={following}+{code(period)}"]
        lines.append(f"global 1 {{t-{following}}} {{{';'.join(changes)}}}")

    for reset in model.resets.values():
        changes = [f"{inside[n]}={code(e)}" for n, e in reset.jump.items()]
        event(reset.function, reset.clock, changes)
    for switch in model.switches.values():
        for value, function, clock in zip((1, 0), switch.functions, switch.clocks, strict=True):
            event(function, clock, [f"{inside[switch.name]}={value}"])
    return lines


class _XppPrinter(StrPrinter):
    def _print_Pow(self, expr: sp.Pow, rational: bool = False) -> str:
        if expr.exp == sp.Rational(1, 2):
            return f"sqrt({self._print(expr.base)})"
        if expr.exp.is_number and expr.exp.is_negative:
            return f"(1/({self._print(sp.Pow(expr.base, -expr.exp))}))"
        return f"({self._print(expr.base)})^({self._print(expr.exp)})"

    def _print_Piecewise(self, expr: sp.Piecewise) -> str:
        *pieces, (last, _) = expr.args
        text = self._print(last)
        for value, condition in reversed(pieces):
            text = f"if({self._print(condition)})then({self._print(value)})else({text})"
        return text

    def _print_Abs(self, expr: sp.Abs) -> str:
        return f"abs({self._print(expr.args[0])})"

    def _print_Float(self, expr: sp.Float) -> str:
        return repr(float(expr))

    def _print_floor(self, expr: sp.floor) -> str:
        return f"flr({self._print(expr.args[0])})"

    def _print_log(self, expr: sp.log) -> str:
        return f"ln({self._print(expr.args[0])})"

    def _print_exp(self, expr: sp.exp) -> str:
        return f"exp({self._print(expr.args[0])})"
