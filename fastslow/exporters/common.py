"""Parameter values, supported functions and identifiers, for every export format."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import Any

import sympy as sp

from fastslow.errors import ArgumentError, unknown_name
from fastslow.model.clocks import ClockFunction
from fastslow.model.interfaces import Region
from fastslow.model.known_functions import ELEMENTARY, in_functions_of, refusal
from fastslow.model.model import Model
from fastslow.model.removable import REMOVABLE, Removable, in_pieces
from fastslow.model.resets import refuse_clocks
from fastslow.model.structure import TIME
from fastslow.model.tabulated import TableValue
from fastslow.results.stored.model import finite_number


def region_values(
    model: Model,
    region: str | None,
    values: Mapping[Any, float] | None,
    state: Mapping[Any, float] | None,
) -> tuple[Region, dict[str, float], dict[str, float]]:
    """Return the region, all parameter values and the initial state, with the switches.

    Without a region the first one is returned.
    """
    parameters = dict.fromkeys(model.free, 0.0) | dict(model.parameters)
    names = (*model.states, *model.slow_states, *model.switches)
    initial = dict.fromkeys(names, 0.0)
    for given, known, kind in ((values, parameters, "parameter"), (state, initial, "state")):
        for name, value in (given or {}).items():
            if str(name) not in known:
                raise unknown_name(kind, name, known)
            known[str(name)] = finite_number(f"{kind} {name}", value)
    regions = model.regions
    return regions[next(iter(regions)) if region is None else region], parameters, initial


def supported(
    expression: sp.Expr, program: str, *, clocks: bool = False, pieces: bool = False
) -> sp.Expr:
    """Return an expression in functions of a program, and clocks if it has them.

    Elementary functions that the program lacks are written by others.

    Parameters
    ----------
    expression : Expr
    program : str
        ``"auto"``, ``"xpp"`` or ``"numpy"``.
    clocks, pieces : bool

    Raises
    ------
    ModelError
        For a table of values in time, and for a clock without ``clocks``.
    ArgumentError
        For any other function.

    Examples
    --------
    >>> x = sp.Symbol("x", real=True)
    >>> supported(sp.sech(x) + sp.asinh(x), "auto"), supported(sp.atanh(x), "xpp")
    (asinh(x) + 1/cosh(x), log((x + 1)/(1 - x))/2)
    """
    if not clocks:
        refuse_clocks([expression], "this export")
    exported = [f for f, one in ELEMENTARY.items() if one.named(program) or one.written]
    known = (*exported, Removable, *([ClockFunction] * clocks), *([sp.Piecewise] * pieces))
    wrong = [f for f in expression.atoms(sp.Function) if not isinstance(f, known)]
    if any(isinstance(f, TableValue) for f in wrong):
        raise refusal([expression])
    if wrong:
        names = ", ".join(sorted({f.func.__name__ for f in wrong}))
        accepted = ", ".join(sorted(f.__name__ for f in exported))
        raise ArgumentError(f"cannot export {names} to {program}; expected {accepted}")
    return in_functions_of(expression, program)


class Helpers:
    """Functions that exported code defines: quotients with a removable singularity.

    Their names are those of the quotients, shortened, with the order of the derivative.
    """

    #: Argument of every function.
    argument = sp.Symbol("y", real=True)

    def __init__(self) -> None:
        self.used: dict[str, sp.Piecewise] = {}

    @staticmethod
    def reserved(name: str) -> bool:
        """Return True for the names of such functions, in lower case."""
        stem = name.lower().rstrip("0123456789")
        return stem in {_short(quotient) for quotient in REMOVABLE}

    def called(self, expression: sp.Expr) -> sp.Expr:
        """Return an expression that calls the functions instead of its quotients."""
        return expression.replace(lambda e: isinstance(e, Removable), self._call)

    def _call(self, quotient: Removable) -> sp.Expr:
        y, order = quotient.args
        name = f"{_short(quotient.func)}{order}"
        self.used[name] = in_pieces(quotient.func(self.argument, order))
        return sp.Function(name, real=True)(y)


def _short(quotient: type[Removable]) -> str:
    return quotient.stored.replace("_quotient", "q")


def comment_text(text: str) -> str:
    """One line without quotes, safe within a comment or a docstring."""
    line = "".join(c if c.isprintable() else " " for c in text)
    return line.replace("\\", "/").replace('"', "'")


def identifiers(
    wanted: Iterable[str],
    taken: Callable[[str], bool],
    fold: Callable[[str], str],
    length: int = 60,
) -> dict[str, str]:
    """Assign an identifier to each name, distinct after folding and not reserved in the target."""
    result: dict[str, str] = {}
    used: set[str] = {TIME.name, "state", "parameters", "numpy"}
    for name in wanted:
        plain = "".join(c if c.isascii() and c.isalnum() else "_" for c in name)
        plain = plain if plain[0].isalpha() else f"p{plain}"
        safe, count = plain[:length], 1
        while fold(safe) in used or taken(fold(safe)):
            count += 1
            safe = f"{plain[: length - 3]}_{count}"
        used.add(fold(safe))
        result[name] = safe
    return result
