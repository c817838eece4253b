"""Events of .ode files (``global``): as resets, as events, or as stops.

XPPAUT carries out the assignments of an event in order, so that each sees the states, not the
parameters, that those before it have assigned. Here all values are assigned at once; they are
rewritten to that. An event of XPPAUT triggers others by its assignments, as an `Event` does.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import sympy as sp

from fastslow.model.events import AT_EXECUTION, AT_TRIGGER, Event
from fastslow.model.structure import TIME
from fastslow.readers.ode_expressions import Quantities
from fastslow.readers.ode_statements import GlobalEvent, Named, Statements

#: Words in place of a name: what happens at the event.
STOP, PLOTTED, AT_STEP = "arret", "out_put", "no_interp"


@dataclass
class ReadEvents:
    """What the events of a file become.

    Attributes
    ----------
    resets : dict
        Relation to the values of states after it.
    events : dict
        Name to event.
    initial : dict
        Values that are assigned at the start.
    stops : list of str
    """

    resets: dict[sp.Basic, dict[sp.Symbol, sp.Expr]] = field(default_factory=dict)
    events: dict[str, Event] = field(default_factory=dict)
    initial: dict[str, sp.Expr] = field(default_factory=dict)
    stops: list[str] = field(default_factory=list)


@dataclass(frozen=True)
class _Read:
    """An event with its expressions; its values are those of states and parameters after it."""

    event: GlobalEvent
    condition: sp.Expr
    jump: Mapping[str, sp.Expr]


def read_events(
    statements: Statements,
    quantities: Quantities,
    rates: Mapping[str, sp.Expr],
    start: float,
) -> ReadEvents:
    """Read the events of a file.

    Parameters
    ----------
    statements : Statements
    quantities : Quantities
    rates : mapping
        Rates of the states by lower case.
    start : float
        Start of time.

    Raises
    ------
    ModelError
        For an event that assigns neither a state nor a parameter, or whose condition never
        changes its sign, with its line.
    """
    found = ReadEvents()
    read = [_read(statements, quantities, event, found) for event in statements.events]
    named = statements.structure.get("event", {})
    for number, one in enumerate(read):
        if not one.jump:
            continue
        if one.event.sign == 0 and _time_of(one.condition, quantities) == start:
            found.initial |= one.jump
        elif str(number) in named or not _added_reset(statements, quantities, rates, one, found):
            _add_events(statements, quantities, number, read, found)
    return found


def _read(
    statements: Statements, quantities: Quantities, event: GlobalEvent, found: ReadEvents
) -> _Read:
    """Build the expressions of an event, with assignments in order rewritten to all at once."""
    what = "global"
    condition = quantities.of(Named(what, event.condition), f"{what}: the condition")
    jump: dict[sp.Symbol, sp.Expr] = {}
    names: dict[str, sp.Expr] = {}
    for one in event.assignments:
        if one.key in (PLOTTED, AT_STEP):
            quantities.note(f"{event.line.place()}: {one.name} is dropped")
            continue
        value = quantities.of(one, f"{what}: {one.name}").xreplace(jump)
        if one.key == STOP:
            if value == 0:
                continue
            if value.free_symbols:
                raise event.line.refused("a stop (arret) on a further condition")
            sides = {1: [">"], -1: ["<"]}.get(event.sign, [">", "<"])
            found.stops += [f"{condition} {side} 0" for side in sides]
            continue
        if one.key not in statements.states and one.key not in statements.values:
            raise one.line.refused(f"{one.name} is neither a state nor a parameter")
        names[one.key] = value
        if one.key in statements.states:
            jump[quantities.symbols[one.key]] = value
    return _Read(event, condition, names)


def _time_of(condition: sp.Expr, quantities: Quantities) -> float | None:
    """Return the time at which a condition linear in time alone changes its sign."""
    if TIME not in condition.free_symbols:
        return None
    slope = condition.diff(TIME)
    if TIME in slope.free_symbols or quantities.number(slope) in (None, 0.0):
        return None
    return quantities.number(-sp.expand(condition - slope * TIME) / slope)


def _added_reset(
    statements: Statements,
    quantities: Quantities,
    rates: Mapping[str, sp.Expr],
    one: _Read,
    found: ReadEvents,
) -> bool:
    """Add an event as a reset if it is one of states at a wall; return whether it is."""
    sign, jump = one.event.sign, {quantities.symbols[key]: value for key, value in one.jump.items()}
    if sign not in (1, -1) or not {*one.jump} <= {*statements.states}:
        return False
    relation = one.condition >= 0 if sign > 0 else one.condition <= 0
    wall = _is_wall(quantities, rates, sign * one.condition, jump)
    if not wall or not isinstance(relation, sp.core.relational.Relational):
        return False
    found.resets[relation] = jump
    return True


def _add_events(
    statements: Statements,
    quantities: Quantities,
    number: int,
    every: Sequence[_Read],
    found: ReadEvents,
) -> None:
    """Add an event in the direction of its sign, or in both."""
    one, event = every[number], every[number].event
    signs = {1: (1,), -1: (-1,)}.get(event.sign, (1, -1))
    if len(signs) > 1:
        quantities.note(f"{event.line.place()}: the sign {event.sign} is read as either direction")
    used = {s for value in one.jump.values() for s in value.free_symbols}
    others = {quantities.symbols[key] for other in every if other is not one for key in other.jump}
    # an exported file says how they are written
    names, conditions, when_computed = (
        statements.structure.get(what, {}) for what in ("event", "when", "values")
    )
    for sign in signs:
        when = one.condition > 0 if sign > 0 else one.condition < 0
        if not isinstance(when, sp.core.relational.Relational):
            raise event.line.refused(
                f"the condition {event.condition.text} does not change its sign"
            )
        name = names.get(str(number), str(when))
        while name in found.events:
            name += f", {event.line.place()}"
        found.events[name] = Event(
            conditions.get(str(number), when),
            {quantities.symbols[key]: value for key, value in one.jump.items()},
            # of events at one instant each sees what those before it have assigned
            values=when_computed.get(str(number), AT_EXECUTION if used & others else AT_TRIGGER),
        )


def _is_wall(
    quantities: Quantities,
    rates: Mapping[str, sp.Expr],
    height: sp.Expr,
    jump: Mapping[sp.Symbol, sp.Expr],
) -> bool:
    """Check that the motion is on the near side of a wall after a reset, or returns from it."""
    velocity = sum(
        (height.diff(s) * rates[k] for k, s in quantities.symbols.items() if k in rates),
        start=height.diff(TIME),
    )
    after = height.xreplace(dict(jump))
    if sp.expand(after - height) != 0:
        # on the wall one of its quantities is known
        beyond = quantities.number(after)
        return beyond is not None and beyond < 0
    if velocity.has(sp.Piecewise, sp.Heaviside, sp.Abs) or velocity == 0:
        return False
    share = quantities.number(sp.cancel(velocity.xreplace(dict(jump)) / velocity))
    return share is not None and share < 0
