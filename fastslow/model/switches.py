"""Hysteretic switches: discrete states that are set by two relations."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, NamedTuple

import sympy as sp

from fastslow.arguments import shown
from fastslow.errors import ModelError
from fastslow.model.clocks import ClockFunction
from fastslow.model.rational import exact
from fastslow.model.reading import SWITCHING
from fastslow.model.resets import threshold
from fastslow.results.base.display import Displayed

Clock = tuple[sp.Expr, sp.Expr]


@dataclass(frozen=True)
class Switch(Displayed):
    """A discrete state q: 1 once the first of two relations has become true, 0 once the second has.

    Parameters
    ----------
    name : str
        q.
    relations : tuple of str
        The relations that set it to 1 and to 0, as written.
    functions : tuple of sympy.Expr
        h₁ and h₀, each positive where its relation is true. The function of instants of time is
        the time since the last one.
    clocks : tuple
        For each relation that is true at instants of time, the period and the time of
        instant 0, else None.
    """

    name: str
    relations: tuple[str, str]
    functions: tuple[sp.Expr, sp.Expr]
    clocks: tuple[Clock | None, Clock | None] = (None, None)

    def __str__(self) -> str:
        on, off = self.relations
        return f"{self.name}: 1 when {on}, 0 when {off}"

    def watched(self, value: int) -> sp.Expr:
        """Return the function whose next zero upwards changes the switch from a value, 0 or 1.

        It is −1 if the next change is at an instant of time.
        """
        return sp.S.NegativeOne if self.clocks[value] else self.functions[value]

    @property
    def expressions(self) -> tuple[sp.Expr, ...]:
        """All functions and clocks."""
        return *self.functions, *(e for clock in self.clocks if clock for e in clock)

    def replaced(self, change: Callable[[sp.Expr], sp.Expr]) -> Switch:
        """Return the switch with all expressions changed."""
        on, off = self.functions
        clocks = [c and (change(c[0]), change(c[1])) for c in self.clocks]
        return Switch(self.name, self.relations, (change(on), change(off)), (clocks[0], clocks[1]))


def with_inequalities(expression: Any, switches: Collection[sp.Symbol]) -> Any:
    """Replace the conditions Eq(q, 1), Ne(q, 0), … of switches by inequalities.

    Examples
    --------
    >>> q, x = sp.symbols("q x", real=True)
    >>> with_inequalities(sp.Piecewise((x, sp.Eq(q, 0)), (1, True)), [q])
    Piecewise((x, q < 1/2), (1, True))
    """
    changes = {}
    for relation in expression.atoms(sp.Eq, sp.Ne):
        symbol, value = sorted(relation.args, key=lambda side: side.is_number)
        if symbol in switches and value in (0, 1):
            on = (value == 1) == isinstance(relation, sp.Eq)
            changes[relation] = symbol > sp.S.Half if on else symbol < sp.S.Half
    return expression.xreplace(changes)


def read_switches(
    given: Mapping[Any, Any],
    moving: set[sp.Symbol],
    read_relation: Callable[[str, Any], Any],
    name_of: Callable[[Any], str],
) -> tuple[Switch, ...]:
    """Validate the switches of a model.

    Parameters
    ----------
    given : mapping
        Name to a pair of relations.
    moving : set of Symbol
        States, slow states, slow quantities and time.
    read_relation, name_of : callable
        Readers of conditions and of names.

    Raises
    ------
    ModelError
    """
    found = []
    for key, pair in given.items():
        name = name_of(key)
        if isinstance(pair, str) or not isinstance(pair, Sequence) or len(pair) != 2:
            raise ModelError(
                f"switch {name}: expected two relations, that which sets it to 1 and that which "
                f"sets it to 0, such as (x < -1, x > 1), received {shown(pair)}"
            )
        relations = [read_relation(f"switch {name}", one) for one in pair]
        functions, clocks = zip(
            *(threshold(f"switch {name}", one) for one in relations), strict=True
        )
        for relation, function, clock in zip(pair, functions, clocks, strict=True):
            used = function.free_symbols
            if clock is None and not used & moving:
                raise ModelError(
                    f"switch {name}: {relation} contains no state; expected a relation that "
                    "becomes true by the motion"
                )
            if name in {symbol.name for symbol in used}:
                raise ModelError(
                    f"switch {name}: {relation} contains the switch itself; expected relations "
                    "of states, one for each value"
                )
            if function.has(sp.Piecewise, *SWITCHING):
                raise ModelError(
                    f"switch {name}: {relation} is not smooth; expected one inequality between "
                    "smooth functions, or two events, which accept And, Or, Abs and Max: "
                    f"Event(when=…, then={{{name}: 1}}) and {{{name}: 0}}, with {name} a parameter"
                )
        texts = [
            str(relation if clock is None else one)
            for relation, clock, one in zip(relations, clocks, pair, strict=True)
        ]
        found.append(Switch(name, (texts[0], texts[1]), functions, clocks))
    return tuple(found)


def check_switches(
    switches: Sequence[Switch],
    groups: tuple[tuple[sp.Symbol, ...], ...],
    values: Mapping[Any, float],
) -> None:
    """Check that the two relations of a switch are never true at the same time.

    This is decided if both are affine in the states, or if a multiple of one function differs
    from the other by a quantity that does not change; overlapping relations of other form end a
    run with an endless cascade.

    Parameters
    ----------
    switches : sequence of Switch
    groups : tuple of tuple of Symbol
        States with slow states, then slow quantities, then time.
    values : mapping
        Parameter values by symbol.

    Raises
    ------
    ModelError
        For relations that touch or overlap.
    """
    for switch in switches:
        test = _test_of(switch, groups)
        if test is None or not values.keys() >= {*test.parameters}:
            continue
        factor, distance = test.numbers(*(values[name] for name in test.parameters))
        if factor > 0 and test.parallel:
            if test.constant and distance == 0:
                on, off = switch.relations
                raise ModelError(
                    f"switch {switch.name}: its relations {on} and {off} touch, so that it has no "
                    f"hysteresis; write Piecewise((1, {on}), (0, True)) in the rates, an interface"
                )
            if test.constant and distance > 0:
                raise _overlap(switch)
        elif test.affine:
            raise _overlap(switch)


class _Test(NamedTuple):
    """Numbers that decide whether the relations of a switch overlap.

    Parameters
    ----------
    parameters : tuple of Symbol
    numbers : callable
        Of their values: the factor c with which h₁ + c h₀ loses its first symbol, 0 if there is
        none, and the value of this sum, 0 where it is not constant.
    affine : bool
        Whether both functions are affine in the states.
    parallel, constant : bool
        Whether the sum is free of states, and whether it contains parameters alone.
    """

    parameters: tuple[sp.Symbol, ...]
    numbers: Callable[..., tuple[float, float]]
    affine: bool
    parallel: bool
    constant: bool


@lru_cache(maxsize=256)
def _test_of(switch: Switch, groups: tuple[tuple[sp.Symbol, ...], ...]) -> _Test | None:
    if any(switch.clocks):
        return None
    on, off = map(exact, switch.functions)
    used = on.free_symbols | off.free_symbols
    shared = next((group for group in groups if used & {*group}), None)
    if shared is None:
        return None
    slopes = [(on.diff(z), off.diff(z)) for z in shared]
    factor = next((sp.cancel(-a / b) for a, b in slopes if b != 0), sp.S.Zero)
    total = sp.expand(on + factor * off)
    if all(sp.cancel(a + factor * b) == 0 for a, b in slopes):
        total = total.subs(dict.fromkeys(shared, 0))
    moving = {z for group in groups for z in group}
    parallel = not total.free_symbols & {*shared}
    constant = parallel and not total.free_symbols & moving and not total.has(ClockFunction)
    if factor.free_symbols & moving:
        # the functions are not affine, nor multiples of each other up to a constant
        factor, constant = sp.S.Zero, False
    affine = not any(slope.free_symbols & moving for pair in slopes for slope in pair)
    numbers = [factor, total if constant else sp.S.Zero]
    parameters = tuple(sorted(set().union(*(n.free_symbols for n in numbers)), key=str))
    return _Test(parameters, sp.lambdify(parameters, numbers, "math"), affine, parallel, constant)


def _overlap(switch: Switch) -> ModelError:
    on, off = switch.relations
    return ModelError(
        f"switch {switch.name}: its relations {on} and {off} may be true at the same time; "
        "expected relations with a distance between them, such as (x < -1, x > 1)"
    )
