"""Resets: jumps of the state when a relation becomes true."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import sympy as sp

from fastslow.errors import ModelError
from fastslow.model.clocks import ClockCount, ClockFunction, ClockTime
from fastslow.results.base.display import Displayed
from fastslow.results.base.named_mapping import NamedMapping

_BELOW, _ABOVE = (sp.Lt, sp.Le), (sp.Gt, sp.Ge)


@dataclass(frozen=True)
class Reset(Displayed):
    """A jump of the state, applied when a relation becomes true.

    Parameters
    ----------
    name : str
        The relation as written.
    function : sympy.Expr
        h, which is positive where the relation is true; the wall is h = 0.
    jump : NamedMapping of sympy.Expr
        State to its value after the reset; other states keep theirs.
    clock : tuple of sympy.Expr, optional
        Of a reset at instants of time, the period and the time of instant 0. Its function is
        the time since the last instant.
    """

    name: str
    function: sp.Expr
    jump: NamedMapping[sp.Expr]
    clock: tuple[sp.Expr, sp.Expr] | None = None

    def __str__(self) -> str:
        return f"{self.name}: " + ", ".join(f"{n} → {e}" for n, e in self.jump.items())

    @property
    def wall(self) -> str:
        """The wall as an equation."""
        return re.sub("[<>]=?", "=", self.name)

    @property
    def expressions(self) -> tuple[sp.Expr, ...]:
        """The wall and all values after the reset."""
        return self.function, *self.jump.values()

    def replaced(self, change: Callable[[sp.Expr], sp.Expr]) -> Reset:
        """Return the reset with all expressions changed."""
        jump = {n: change(e) for n, e in self.jump.items()}
        clock = None if self.clock is None else (change(self.clock[0]), change(self.clock[1]))
        return Reset(self.name, change(self.function), NamedMapping("state", jump), clock)


def refuse_clocks(expressions: Iterable[sp.Expr], task: str) -> None:
    """Raise ModelError if an expression contains a clock; ``task`` as for resets."""
    found = sorted({str(c.written()) for e in expressions for c in e.atoms(ClockFunction)})
    if found:
        raise ModelError(
            f"{task} would ignore the clock of this model ({', '.join(found)}); models with Mod, "
            "floor or frac of time are accepted by simulations and by functions for periodic orbits"
        )


def read_resets(
    given: Mapping[Any, Any],
    states: Sequence[str],
    moving: set[sp.Symbol],
    read_relation: Callable[[str, Any], Any],
    read_value: Callable[[str, Any], sp.Expr],
    name_of: Callable[[Any], str],
) -> tuple[Reset, ...]:
    """Validate the resets of a model.

    Parameters
    ----------
    given : mapping
        Relation to a mapping of states to their values after the reset.
    states : sequence of str
        States and slow states.
    moving : set of Symbol
        States, slow states and slow quantities.
    read_relation, read_value, name_of : callable
        Readers of conditions, of expressions, and of names.

    Raises
    ------
    ModelError
    """
    found: list[Reset] = []
    for key, changes in given.items():
        relation = read_relation(f"reset {key}", key)
        function, clock = threshold(f"reset {key}", relation)
        if clock is None and not function.free_symbols & moving:
            raise ModelError(
                f"reset {key}: the relation contains no state; expected one that becomes true by "
                "the motion"
            )
        if not isinstance(changes, Mapping) or not changes:
            raise ModelError(
                f"reset {key}: expected a mapping of states to their values after the reset, such "
                f"as {{v: -r*v}}, received {changes!r}"
            )
        jump: dict[str, sp.Expr] = {}
        for state, value in changes.items():
            name = name_of(state)
            if name not in states:
                raise ModelError(
                    f"reset {key}: {name} is no state; a reset changes states: {', '.join(states)}"
                )
            if name in jump:
                raise ModelError(f"reset {key}: {name} has two values")
            jump[name] = read_value(f"reset {key}: {name}", value)
        name = str(relation if clock is None else key)
        one = Reset(name, function, NamedMapping("state", jump), clock)
        for expression in one.expressions:
            if expression.has(sp.Piecewise):
                raise ModelError(
                    f"reset {key}: {expression} is not smooth; expected one reset for each case"
                )
        if any(one.name == other.name for other in found):
            raise ModelError(f"reset {key} is given twice")
        found.append(one)
    # walls first
    return tuple(sorted(found, key=lambda reset: reset.clock is not None))


def threshold(what: str, relation: Any) -> tuple[sp.Expr, tuple[sp.Expr, sp.Expr] | None]:
    """Return the function that is positive where a relation is true, and its clock if it has one.

    Parameters
    ----------
    what : str
        Description for the error message.
    relation : Boolean
        An inequality, or Eq(Mod(t, T), 0), whose function is the time since the last instant.

    Raises
    ------
    ModelError
        For any other relation.
    """
    clock = instants(relation)
    if clock is None and not isinstance(relation, (*_BELOW, *_ABOVE)):
        raise ModelError(
            f"{what}: expected one inequality such as x >= sigma, or Eq(Mod(t - phase, T), 0) for "
            f"instants of time, received {relation}"
        )
    difference = relation.lhs - relation.rhs
    if clock is not None:
        return difference, clock
    return sp.expand(difference if isinstance(relation, _ABOVE) else -difference), None


def instants(relation: Any) -> tuple[sp.Expr, sp.Expr] | None:
    """Return period and phase of Eq(Mod(t, T), 0), None for any other relation."""
    if not isinstance(relation, sp.Eq) or relation.rhs != 0:
        return None
    counts = {
        n: (ClockTime(*n.args) - n.args[1]) / n.args[0] for n in relation.lhs.atoms(ClockCount)
    }
    sawtooth = sp.expand(relation.lhs.xreplace(counts))
    clocks = sawtooth.atoms(ClockTime)
    if len(clocks) != 1:
        return None
    (one,) = clocks
    share = sawtooth / (one.args[2] - one)
    return one.clock if not sp.cancel(share).has(ClockTime, one.args[2]) else None
