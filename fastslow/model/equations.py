"""Equations, conditions and names as a user writes them, read into the structure of a model."""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import count
from typing import Any, NamedTuple, TypeVar

import sympy as sp
from sympy.core.function import AppliedUndef
from sympy.logic.boolalg import Boolean

from fastslow.arguments import shown
from fastslow.errors import ArgumentError, ModelError, unknown_name
from fastslow.formulas.grammar import normalised
from fastslow.formulas.symbolic import read
from fastslow.model.clocks import with_clocks
from fastslow.model.definitions import resolved
from fastslow.model.events import Event, expressions_of, read_events
from fastslow.model.expansion import expanded
from fastslow.model.interfaces import Interface
from fastslow.model.reading import (
    LONG,
    as_written,
    continuous,
    factorise,
    switching_expressions,
    with_piecewise,
)
from fastslow.model.removable import with_removable
from fastslow.model.resets import Reset, read_resets
from fastslow.model.structure import TIME, Structure, real, shape_of
from fastslow.model.switches import Switch, read_switches, with_inequalities
from fastslow.model.tabulated import TableAtom, TableValue, Tabulated
from fastslow.results.base.named_mapping import NamedMapping

R = TypeVar("R")

#: Functions with infinitely many jumps.
STEP_FUNCTIONS = (sp.floor, sp.ceiling, sp.frac, sp.Mod)

#: Smallest positive floating-point number.
LEAST = math.ulp(0.0)


def name_of(key: object, what: str = "a name") -> str:
    """Return the normalised name of a symbol or text.

    Raises
    ------
    ModelError
        For an empty name, or one that cannot be encoded in a file.

    Examples
    --------
    >>> name_of(sp.Symbol("x")), name_of("µ") == "μ"
    ('x', True)
    """
    name = normalised(str(key))
    if not name.strip() or (not name.isascii() and any("\ud800" <= c <= "\udfff" for c in name)):
        raise ModelError(f"{what}: expected a name of letters, such as x, received {name!a}")
    return name


def read_structure(
    rates: Mapping[Any, Any],
    forcing: Mapping[Any, Any],
    slow: Mapping[Any, Any],
    parameters: tuple[str, ...],
    interfaces: Mapping[Any, Any],
    free: tuple[str, ...],
    regions: Mapping[Any, Any],
    resets: Mapping[Any, Any],
    switches: Mapping[Any, Any],
    events: Mapping[Any, Any],
    definitions: Mapping[Any, Any],
) -> Structure:
    """Validate the equations of a model and extract their interfaces.

    Raises
    ------
    ModelError
        If a symbol is unknown, a name is used twice, or an expression is not finite and real.
    """
    groups = {
        "state": [name_of(n, "state") for n in rates],
        "slow state": [name_of(n, "slow state") for n in slow],
        "slow quantity": [name_of(n, "slow quantity") for n in forcing],
        "switch": [name_of(n, "switch") for n in switches],
        "parameter": [*parameters, *free],
        "definition": [name_of(n, "definition") for n in definitions],
    }
    kinds = _kinds_of(groups)
    known, constant = {*kinds, "t"}, {*map(real, parameters)}
    named = _definitions(definitions, known)
    reader = _EquationReader(kinds, constant, named, {*map(real, groups["switch"])})
    laws = _named_by(
        "law of", forcing, lambda what, e: _law(what, e, {*parameters, "t"}, constant, named)
    )
    equations = _named_by("rate of", {**rates, **slow}, reader.expression)
    moving = _moving(groups)
    for what, written in (("rate of", equations), ("law of", laws)):
        for name, expression in written.items():
            _reject_step_functions(f"{what} {name}", [expression], moving)
    listed = _named_by("interface", interfaces, reader.expression)
    found = _interfaces(listed, (*equations.values(), *laws.values()), moving, known)
    conditions = _named_by("region", regions, reader.condition)
    jumps = _read_jumps(reader, groups, moving, resets, switches, events)
    _check_jumps(*jumps, moving)
    _check_assigned(jumps.events, laws)
    return Structure(
        tuple(groups["state"]),
        tuple(groups["slow state"]),
        NamedMapping("state", equations),
        NamedMapping("slow quantity", laws),
        free,
        tuple(found),
        frozenset(listed),
        NamedMapping("region", conditions),
        continuous=all(
            continuous(read_expression(f"rate of {n}", e, known).xreplace(named))
            for n, e in {**rates, **slow}.items()
        ),
        **jumps._asdict(),
        definitions=NamedMapping("definition", {s.name: e for s, e in named.items()}),
    )


@dataclass(frozen=True)
class _EquationReader:
    """Reads expressions, conditions and relations in the names of a model.

    Parameters
    ----------
    kinds : mapping
        The kind of every name.
    constants : set of Symbol
        Parameters.
    definitions : mapping
    switches : set of Symbol
    """

    kinds: Mapping[str, str]
    constants: set[sp.Symbol]
    definitions: Mapping[sp.Symbol, sp.Expr]
    switches: set[sp.Symbol]

    @cached_property
    def known(self) -> set[str]:
        """All names, and time."""
        return {*self.kinds, TIME.name}

    def expression(self, what: str, given: Any) -> sp.Expr:
        written = _checked(what, given, self.known, self.constants, self.definitions)
        return with_inequalities(written, self.switches)

    def condition(self, what: str, given: Any) -> Boolean:
        written = _checked_condition(what, given, self.known, self.definitions)
        return with_inequalities(written, self.switches)

    def relation(self, what: str, given: Any) -> Any:
        written = _checked_condition(what, given, self.known, self.definitions)
        return with_clocks(written, TIME, self.constants)

    def trigger(self, what: str, given: Any) -> Any:
        return with_clocks(self.condition(what, given), TIME, self.constants)


class _WrittenJumps(NamedTuple):
    """What a run meets besides interfaces, by the fields of a `Structure`."""

    resets: tuple[Reset, ...]
    switches: tuple[Switch, ...]
    events: NamedMapping[Event]


def _read_jumps(
    reader: _EquationReader,
    groups: Mapping[str, Sequence[str]],
    moving: Sequence[sp.Symbol],
    resets: Mapping[Any, Any],
    switches: Mapping[Any, Any],
    events: Mapping[Any, Any],
) -> _WrittenJumps:
    """Return resets, switches and events as given by a user."""
    states = (*groups["state"], *groups["slow state"])
    along = {*moving} - reader.switches
    return _WrittenJumps(
        resets=read_resets(
            resets,
            states,
            along - {TIME},
            reader.relation,
            reader.expression,
            lambda n: name_of(n, "state"),
        ),
        switches=read_switches(switches, along, reader.relation, lambda n: name_of(n, "switch")),
        events=read_events(
            events,
            reader.kinds,
            reader.trigger,
            reader.expression,
            lambda n: name_of(n, "event"),
        ),
    )


def _interfaces(
    listed: Mapping[str, sp.Expr],
    expressions: Sequence[sp.Expr],
    moving: tuple[sp.Symbol, ...],
    known: Collection[str],
) -> list[Interface]:
    """Return the interfaces that are given, and those of expressions that switch."""
    found = [Interface(n, _irreducible(n, h, moving)) for n, h in listed.items()]
    shapes = {shape_of(i.function, moving) for i in found}
    for expression in expressions:
        for switching in switching_expressions(expression):
            for factor, _ in factorise(switching, moving).factors:
                if shape_of(factor, moving) not in shapes:
                    shapes.add(shape_of(factor, moving))
                    whole = as_written(switching, moving)
                    function = factor if whole is None else whole
                    taken = {*known, *(i.name for i in found)}
                    found.append(Interface(_name(function, moving, taken), function))
    return found


def _definitions(given: Mapping[Any, Any], known: set[str]) -> dict[sp.Symbol, sp.Expr]:
    """Return definitions in terms of the known names that are none of theirs."""
    written = _named_by("definition", given, lambda _, expression: expression)
    found = resolved(written, lambda what, expression: read_expression(what, expression, known))
    for symbol, expression in found.items():
        _require_known(f"definition {symbol}", expression, {*known} - {*written})
    return found


def _kinds_of(groups: Mapping[str, Sequence[str]]) -> dict[str, str]:
    """Return the kind of every name.

    Raises
    ------
    ModelError
        For a name of two kinds, and without states.
    """
    seen: dict[str, str] = {}
    for kind, names in groups.items():
        for name in names:
            if name == TIME.name:
                raise ModelError(f"'t' is time; it cannot be a {kind}")
            if name in seen:
                raise ModelError(f"'{name}' is both a {seen[name]} and a {kind}")
            seen[name] = kind
    if not groups["state"]:
        raise ModelError("a model needs at least one state with its rate")
    return seen


def _moving(groups: Mapping[str, Sequence[str]]) -> tuple[sp.Symbol, ...]:
    """Return the symbols of all names that may change along a solution, and time."""
    fixed = ("parameter", "definition")
    names = (n for kind, names in groups.items() if kind not in fixed for n in names)
    return (*map(real, names), TIME)


def _check_jumps(
    resets: Iterable[Reset],
    switches: Iterable[Switch],
    events: Mapping[str, Event],
    moving: Sequence[sp.Symbol],
) -> None:
    """Raise for functions with infinitely many jumps in resets, switches and events."""
    jumping = {f"reset {r.name}": r.expressions for r in resets}
    jumping |= {f"switch {s.name}": s.expressions for s in switches}
    jumping |= {f"event {n}": expressions_of(e) for n, e in events.items()}
    for what, expressions in jumping.items():
        _reject_step_functions(what, expressions, moving)


def _check_assigned(events: Mapping[str, Event], laws: Mapping[str, sp.Expr]) -> None:
    """Check that no law of a slow quantity contains a parameter that an event assigns.

    Raises
    ------
    ModelError
    """
    for name, event in events.items():
        for target in event.then:
            for quantity, law in laws.items():
                if real(target) in law.free_symbols:
                    raise ModelError(
                        f"event {name} assigns {target}, which occurs in the law of {quantity}, a "
                        f"function of time; write that law in the rates in place of {quantity}"
                    )


def _named_by(
    what: str, given: Mapping[Any, Any], read_one: Callable[[str, Any], R]
) -> dict[str, R]:
    """Given expressions by their normalised names."""
    names = {name_of(key, what.removesuffix(" of")): value for key, value in given.items()}
    if len(names) < len(given):
        raise ModelError(f"{what} {', '.join(map(str, given))}: two have one name")
    return {name: read_one(f"{what} {name}", value) for name, value in names.items()}


def sympified(
    what: str, given: Any, known: Collection[str] = (), *, exact: bool = False
) -> sp.Expr:
    """Return a SymPy expression, or parse one from text.

    Parameters
    ----------
    what : str
        Description for the error message.
    given : Expr, number or str
    known : collection of str
        Names that a text may contain; any other name may be a constant.
    exact : bool
        Convert decimal numbers in a text to fractions.

    Raises
    ------
    ModelError
        If it is not an expression.
    """
    expression = _sympified(what, given, known, exact)
    if not isinstance(expression, sp.Expr) or expression.is_Matrix:
        raise ModelError(f"{what}: expected an expression, received {shown(given)}")
    return expression


def _sympified(what: str, given: Any, known: Collection[str], exact: bool = False) -> Any:
    """Convert an object to SymPy; None if it cannot be converted."""
    if isinstance(given, str):
        try:
            return read(given, real, known, exact)
        except ArgumentError as error:
            raise ModelError(f"{what}: {error}") from error
    try:
        # strict: SymPy would evaluate the text of other objects as Python
        return sp.sympify(given, strict=True)
    except (sp.SympifyError, TypeError, ValueError, AttributeError):
        return None


def read_expression(what: str, expression: Any, known: Collection[str] = ()) -> sp.Expr:
    """Return an expression in real symbols.

    Raises
    ------
    ModelError
        If it is not an expression, or not finite and real.
    """
    written = sympified(what, expression, known)
    written = written.xreplace({s: real(s.name) for s in written.free_symbols})
    if written.has(sp.nan, sp.zoo, sp.oo, -sp.oo, sp.I):
        raise ModelError(f"{what}: expected a finite real expression, received {written}")
    for number in written.atoms(sp.Number):
        if abs(number) > sys.float_info.max or 0 < abs(number) < LEAST:
            raise ModelError(
                f"{what}: the number {sp.N(number, 3)} is not in the range of floating-point "
                "numbers, from 1e-307 to 1e308; change the units"
            )
    return written


def read_condition(
    what: str, condition: Any, known: Collection[str] = (), *, exact: bool = False
) -> Boolean:
    """Return a SymPy condition, or parse one from text; parameters as for `sympified`.

    Raises
    ------
    ModelError
        If it is not a condition.
    """
    written = _sympified(what, condition, known, exact)
    if not isinstance(written, Boolean):
        raise ModelError(f"{what}: expected a condition such as x > D, received {shown(condition)}")
    return written


def _checked(
    what: str,
    expression: Any,
    known: set[str],
    constants: set[sp.Symbol],
    definitions: Mapping[sp.Symbol, sp.Expr],
) -> sp.Expr:
    written = read_expression(what, expression, {*known, *(s.name for s in definitions)})
    written = written.xreplace(definitions)
    _require_known(what, written, known)
    return with_piecewise(with_removable(with_clocks(written, TIME, constants)), constants)


def _require_known(what: str, written: sp.Expr, known: set[str]) -> None:
    """Raise ModelError for functions without a definition and unknown symbols."""
    for function in sorted(written.atoms(AppliedUndef), key=str):
        raise ModelError(
            f"{what}: {function} is a function without a definition; expected symbols for states "
            "and slow quantities, such as x, and not x(t)"
        )
    for symbol in sorted(written.free_symbols, key=lambda s: s.name):
        if symbol.name not in known:
            reason = unknown_name("symbol", symbol.name, sorted(known))
            raise ModelError(
                f"{what}: {reason}; every symbol is a state, a slow quantity, "
                "a parameter with a value, or t"
            )


def _law(
    what: str,
    given: Any,
    known: set[str],
    constants: set[sp.Symbol],
    definitions: Mapping[sp.Symbol, sp.Expr],
) -> sp.Expr:
    """Return the law of a slow quantity: a table, or a checked expression."""
    if isinstance(given, Tabulated):
        return TableValue(TableAtom(given), 0, TIME)
    return _checked(what, given, known, constants, definitions)


def _reject_step_functions(
    what: str, expressions: Iterable[sp.Expr], moving: Sequence[sp.Symbol]
) -> None:
    """Raise for functions with infinitely many jumps along a solution."""
    found = {part for written in expressions for part in written.atoms(*STEP_FUNCTIONS)}
    for part in sorted(found, key=str):
        if part.free_symbols & set(moving):
            raise ModelError(
                f"{what}: {part} jumps at infinitely many values, each of which would be an "
                "interface; expected a Piecewise with the few jumps that are reached"
            )


def _irreducible(name: str, function: sp.Expr, moving: Sequence[sp.Symbol]) -> sp.Expr:
    """The only factor with zeros of a given interface function, oriented as given."""
    parts = factorise(function, moving)
    if len(parts.factors) != 1:
        names = ", ".join(str(factor) for factor, _ in parts.factors) or "no moving symbol"
        raise ModelError(
            f"interface {name}: expected one irreducible switching function, received "
            f"{function}, which vanishes where one of these does: {names}"
        )
    written = as_written(function, moving)
    if written is not None:
        return function
    return expanded(parts.sign * parts.factors[0][0])


def _checked_condition(
    what: str, condition: Any, known: set[str], definitions: Mapping[sp.Symbol, sp.Expr]
) -> Boolean:
    written = read_condition(what, condition, known)
    for symbol in sorted(written.free_symbols, key=lambda s: s.name):
        if symbol.name not in known:
            raise ModelError(f"{what}: {unknown_name('symbol', symbol.name, sorted(known))}")
    return written.xreplace({s: real(s.name) for s in written.free_symbols}).xreplace(definitions)


def _written(function: sp.Expr, moving: Sequence[sp.Symbol]) -> str:
    """Print a function with moving symbols first."""
    if not isinstance(function, sp.Add):
        return str(function)
    rank = {s: k for k, s in enumerate(moving)}
    terms = sorted(
        function.args,
        key=lambda a: (min((rank[s] for s in a.free_symbols if s in rank), default=99), str(a)),
    )
    text = str(terms[0])
    for term in terms[1:]:
        minus = term.could_extract_minus_sign()
        text += f" - {-term}" if minus else f" + {term}"
    return text


def _name(function: sp.Expr, moving: Sequence[sp.Symbol], taken: set[str]) -> str:
    """The printed function if it is short, else a letter with the next free number."""
    text = _written(function, moving)
    if len(text) <= LONG:
        return text
    return next(n for n in (f"h{k}" for k in count(1)) if n not in taken)
