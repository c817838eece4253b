"""XPPAUT .ode files."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping, Sequence
from typing import Any

import sympy as sp
from sympy.printing.str import StrPrinter

from fastslow.errors import ModelError
from fastslow.exporters.common import (
    Helpers,
    comment_text,
    identifiers,
    region_values,
    supported,
)
from fastslow.model.clocks import ClockFunction
from fastslow.model.events import Event
from fastslow.model.known_functions import ELEMENTARY
from fastslow.model.model import Model
from fastslow.model.structure import TIME, real

#: Reserved words of XPPAUT, in lower case.
XPP_WORDS = frozenset(
    [
        "t",
        "pi",
        *(one.named("xpp") for one in ELEMENTARY.values()),
        "log",
        "sqrt",
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


#: XPPAUT misses an event at the end of a step, as every instant of a clock may be with its default
#: step of 0.05; this one has no such multiples.
XPP_STEP = 0.0499371834


def to_xpp(
    model: Model,
    region: str | None,
    *,
    values: Mapping[Any, float] | None = None,
    state: Mapping[Any, float] | None = None,
) -> dict[str, str]:
    """Write an XPPAUT .ode file for one region, or for all in pieces.

    Parameters and errors as for `export`.
    """
    smooth, parameters, initial = region_values(model, region, values, state)
    rates, forcing = smooth.rates, smooth.forcing
    if region is None:
        rates, forcing = model.rates, model.forcing
    names = [*model.states, *model.slow_states]
    # time of the next instant of a clock
    instants = [f"next{k}" for k in range(_count_of_clocks(model))]
    given: list[Mapping[str, sp.Expr]] = [one.jump for one in model.resets.values()]
    given += [one.then for one in model.events.values()]
    jumps = [_in_order(jump, parameters) for jump in given]
    # values before a reset, which XPPAUT has only as variables of their own
    olds = sorted({name for jump in jumps for name, _ in jump} - {*names, *parameters})
    # XPPAUT ignores case, distinguishes nine characters and reserves some names
    inside = identifiers(
        [*names, *parameters, *forcing, *model.switches, *instants, *olds, *model.definitions],
        lambda n: n in XPP_WORDS or Helpers.reserved(n),
        str.lower,
        9,
    )
    place = {real(n): sp.Symbol(safe, real=True) for n, safe in inside.items()}
    printer, helpers = _XppPrinter(), Helpers()

    def code(expression: sp.Expr) -> str:
        written = supported(expression, "xpp", clocks=True, pieces=True).xreplace(place)
        return str(printer.doprint(helpers.called(written)))

    laws = {real(n): law for n, law in forcing.items()}

    def event_code(expression: sp.Expr) -> str:
        # XPPAUT evaluates the forcing at the end of the step, not at the event
        return code(expression.xreplace(laws))

    part = f"region {comment_text(region)}" if region else "all regions"
    lines = [f"# {comment_text(', '.join(names))}, {part}"]
    where = "" if region is None else ", ".join(map(str, smooth.conditions))
    lines += [f"# where {comment_text(where)}"] if where else []
    lines += [f"#: {comment_text(line)}" for line in _structure(model, inside, region is None)]
    lines += [f"par {inside[n]}={value!r}" for n, value in parameters.items()]
    first = len(lines)
    lines += [f"{inside[n]}={code(law)}" for n, law in forcing.items()]
    lines += [f"{inside[n]}'={code(rates[n])}" for n in names]
    here = {real(n): v for n, v in {**initial, **parameters}.items()} | {TIME: 0.0}
    for name, switch in model.switches.items():
        lines.append(f"{inside[name]}'=0")
        if name not in {str(key) for key in state or {}}:
            # a relation that is true at the start decides
            initial[name] = float(bool(switch.watched(0).subs(here) > 0))
    lines += [f"{inside[n]}'=0" for n in olds]
    lines += [f"init {inside[n]}={value!r}" for n, value in initial.items()]
    lines += _events(model, inside, parameters, instants, jumps, event_code)
    lines += [f"aux {inside[n]}={code(e)}" for n, e in model.definitions.items()]
    lines[first:first] = [f"{n}(y)={printer.doprint(e)}" for n, e in helpers.used.items()]
    some = model.resets or model.switches or model.events
    options = f"@ total=100,dt={XPP_STEP}" if some else "@ total=100"
    return {f"{region or 'model'}.ode": "\n".join([*lines, options, "done"]) + "\n"}


def _structure(model: Model, inside: Mapping[str, str], whole: bool) -> list[str]:
    """Lines of comments by which the same model is read again: names, and what is slow."""
    names = [(safe, name) for name, safe in inside.items() if safe != name]
    lines = [f"name {safe} = {name}" for safe, name in names]
    lines += [f"slow {name}" for name in model.slow_states]
    lines += [f"forcing {name}" for name in model.forcing]
    first = len(model.resets) + 2 * len(model.switches)
    for number, (name, event) in enumerate(model.events.items(), start=first):
        said = {"event": name, "when": event.when, "values": event.values}
        lines += [f"{word} {number} = {meaning}" for word, meaning in said.items()]
    if whole:
        given = [i for i in model.structure.interfaces if i.name in model.structure.given]
        lines += [f"interface {i.name} = {i.function}" for i in given]
        lines += [f"region {name} = {where}" for name, where in model.structure.conditions.items()]
    return lines


def _count_of_clocks(model: Model) -> int:
    clocks = [reset.clock for reset in model.resets.values()]
    clocks += [clock for switch in model.switches.values() for clock in switch.clocks]
    return sum(clock is not None for clock in clocks)


def _in_order(
    jump: Mapping[str, sp.Expr], parameters: Collection[str] = ()
) -> list[tuple[str, sp.Expr]]:
    """Return assignments that, one after the other, have the effect of all at once.

    A value is assigned after all others that depend on its old one. Of values that depend on each
    other, one is kept under a name of its own. XPPAUT assigns parameters after all states.
    """
    left, found = dict(jump), []
    while left:
        needed = {
            name: [
                n
                for n, e in left.items()
                if n != name and name not in parameters and real(name) in e.free_symbols
            ]
            for name in left
        }
        name = min(left, key=lambda n: len(needed[n]))
        if needed[name]:
            old = f"old {name}"
            found.append((old, real(name)))
            left |= {n: left[n].xreplace({real(name): real(old)}) for n in needed[name]}
        found.append((name, left.pop(name)))
    return found


def _events(
    model: Model,
    inside: Mapping[str, str],
    parameters: Mapping[str, float],
    instants: Sequence[str],
    jumps: Sequence[Sequence[tuple[str, sp.Expr]]],
    code: Callable[[sp.Expr], str],
) -> list[str]:
    """Lines of the ``global`` events of resets, switches and events.

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

    changes = [[f"{inside[n]}={code(e)}" for n, e in jump] for jump in jumps]
    for reset, values in zip(model.resets.values(), changes, strict=False):
        event(reset.function, reset.clock, values)
    for switch in model.switches.values():
        for value, function, clock in zip((1, 0), switch.functions, switch.clocks, strict=True):
            event(function, clock, [f"{inside[switch.name]}={value}"])
    for (name, one), values in zip(model.events.items(), changes[len(model.resets) :], strict=True):
        event(_trigger(name, one), None, values)
    return lines


def _trigger(name: str, event: Event) -> sp.Expr:
    """Return the function that rises through zero where an event of XPPAUT happens.

    Raises
    ------
    ModelError
        For an event that XPPAUT does not have.
    """
    why = ""
    if event.delay != 0 or event.priority is not None or not event.initially:
        why = "a delay, a priority, or a condition that is false before the start"
    elif not isinstance(event.when, (sp.Gt, sp.Ge, sp.Lt, sp.Le)):
        why = "a condition of several inequalities"
    elif event.when.has(ClockFunction):
        why = "a condition with instants of time"
    if why:
        raise ModelError(
            f"event {name}: export to xpp cannot write {why}; expected events at one inequality "
            "such as x > 1"
        )
    return event.when.gts - event.when.lts


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

    def _print_Relational(self, expr: sp.Rel) -> str:
        # XPPAUT compares before it adds
        sign = "==" if isinstance(expr, sp.Eq) else "!=" if isinstance(expr, sp.Ne) else expr.rel_op
        return f"(({self._print(expr.lhs)}){sign}({self._print(expr.rhs)}))"

    def _print_Abs(self, expr: sp.Abs) -> str:
        return f"abs({self._print(expr.args[0])})"

    def _print_Float(self, expr: sp.Float) -> str:
        return repr(float(expr))

    def _print_floor(self, expr: sp.floor) -> str:
        return f"flr({self._print(expr.args[0])})"

    def _print_Function(self, expr: sp.Function) -> str:
        known = ELEMENTARY.get(expr.func)
        name = known.named("xpp") if known else expr.func.__name__
        return f"{name}({', '.join(map(self._print, expr.args))})"
