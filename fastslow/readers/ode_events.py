"""Events of .ode files (``global``): as resets, as steps in time, or as stops.

XPPAUT carries out the assignments of an event in order, so that each sees the values of those
before it. A reset assigns all values at once; the values are rewritten to that.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import sympy as sp

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
    scheduled : dict
        States and parameters that change at times alone, with their expressions.
    held : dict
        Parameters that events change, which are states with rate 0.
    initial : dict
        Values that are assigned at the start.
    stops : list of str
    """

    resets: dict[sp.Basic, dict[sp.Symbol, sp.Expr]] = field(default_factory=dict)
    scheduled: dict[str, sp.Expr] = field(default_factory=dict)
    held: list[str] = field(default_factory=list)
    initial: dict[str, sp.Expr] = field(default_factory=dict)
    stops: list[str] = field(default_factory=list)


@dataclass(frozen=True)
class _Read:
    """An event with its expressions, and the time at which it happens if that is known."""

    event: GlobalEvent
    condition: sp.Expr
    jump: Mapping[str, sp.Expr]
    time: sp.Expr | None


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
        For an event that is neither a reset at a wall nor at a time, with its line.
    """
    found = ReadEvents()
    read = [_read(statements, quantities, event, found) for event in statements.events]
    changed = [{*one.jump} for one in read]
    scheduled = []
    for k, one in enumerate(read):
        if not one.jump:
            continue
        others = set().union(*(c for i, c in enumerate(changed) if read[i].time is None))
        rests = all(rates.get(name, sp.S.Zero) == 0 for name in one.jump)
        fixed = all(quantities.number(value) is not None for value in one.jump.values())
        if one.event.sign == 0 and one.time is not None and _at(quantities, one.time) == start:
            found.initial |= one.jump
        elif one.time is not None and rests and fixed and not changed[k] & others:
            scheduled.append(one)
        else:
            _reset(statements, quantities, rates, one, found)
    _schedule(quantities, scheduled, start, found)
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
    return _Read(event, condition, names, _time_of(condition, quantities))


def _time_of(condition: sp.Expr, quantities: Quantities) -> sp.Expr | None:
    """Return the time at which a condition linear in time alone changes its sign upwards."""
    if TIME not in condition.free_symbols:
        return None
    slope = condition.diff(TIME)
    if TIME in slope.free_symbols or quantities.number(slope) in (None, 0.0):
        return None
    rest = sp.expand(condition - slope * TIME)
    if TIME in rest.free_symbols or quantities.number(rest) is None:
        return None
    return -rest / slope


def _at(quantities: Quantities, time: sp.Expr) -> float:
    value = quantities.number(time)
    assert value is not None
    return value


def _schedule(quantities: Quantities, events: list[_Read], start: float, found: ReadEvents) -> None:
    """Write what changes at known times as pieces in time."""
    pieces: dict[str, list[tuple[sp.Expr, sp.Expr]]] = {}
    last: dict[str, sp.Expr] = {}
    for one in sorted(events, key=lambda e: _at(quantities, e.time)):
        time = one.time
        assert time is not None
        slope = quantities.number(one.condition.diff(TIME))
        assert slope is not None
        if _at(quantities, time) <= start or slope * (one.event.sign or slope) < 0:
            quantities.note(f"{one.event.line.place()}: this event does not happen in a run")
            continue
        for key, value in one.jump.items():
            own = quantities.symbols[key]
            before = last.get(key, own)
            pieces.setdefault(key, []).append((before, time > TIME))
            last[key] = value.xreplace({own: before})
    for key, parts in pieces.items():
        found.scheduled[key] = sp.Piecewise(*parts, (last[key], True))


def _reset(
    statements: Statements,
    quantities: Quantities,
    rates: Mapping[str, sp.Expr],
    one: _Read,
    found: ReadEvents,
) -> None:
    """Add an event as resets, if it is one at a wall."""
    event = one.event
    signs = [event.sign]
    if event.sign not in (1, -1):
        quantities.note(f"{event.line.place()}: the sign {event.sign} is read as either direction")
        signs = [1, -1]
    jump = {quantities.symbols[key]: value for key, value in one.jump.items()}
    for sign in signs:
        height = sign * one.condition
        if not _is_wall(quantities, rates, height, jump):
            raise event.line.refused(
                "an event that is no reset at a wall: after it the condition "
                f"{event.condition.text} is not on the side from which it was reached; read the "
                'file without events by without=["global"]'
            )
        relation = one.condition >= 0 if sign > 0 else one.condition <= 0
        if not isinstance(relation, sp.core.relational.Relational):
            raise event.line.refused(
                f"the condition {event.condition.text} does not change its sign"
            )
        found.resets[relation] = jump
    for key in one.jump:
        if key not in statements.states and key not in found.held:
            found.held.append(key)


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
