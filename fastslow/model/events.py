"""Events: assignments of states and parameters when a condition becomes true."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import KW_ONLY, dataclass, replace
from typing import Any

import sympy as sp
from sympy.logic.boolalg import And, Boolean, BooleanFalse, BooleanTrue, Not, Or, Xor

from fastslow.arguments import flag, mapping, real_number, refusal, settings, word
from fastslow.errors import ModelError
from fastslow.model.clocks import ClockTime
from fastslow.model.reading import with_piecewise
from fastslow.model.resets import instants
from fastslow.results.base.display import Displayed
from fastslow.results.base.named_mapping import NamedMapping
from fastslow.results.stored.conditions import (
    AND,
    DEEPEST_CONDITION,
    FALSE,
    NEGATION,
    OR,
    TRUE,
    postfix_depth,
)

#: When the assigned values are computed.
AT_TRIGGER, AT_EXECUTION = "trigger", "execution"

#: Time, as in `fastslow.model.structure`, which imports this module.
TIME = sp.Symbol("t", real=True)

_ABOVE, _BELOW = (sp.Gt, sp.Ge), (sp.Lt, sp.Le)


def _condition(name: str, value: Any) -> Any:
    """Validate a condition, whose symbols are not yet known."""
    if not isinstance(value, str | Boolean):
        raise refusal(name, value, "a condition such as x > 1")
    return value


def _expression(name: str, value: Any) -> Any:
    """Validate an expression, whose symbols are not yet known, or None."""
    known = value is None or isinstance(value, str | sp.Expr) or real_number(value) is not None
    if not known:
        raise refusal(name, value, "an expression or a number")
    return value


@settings(
    when=_condition,
    then=mapping,
    delay=_expression,
    priority=_expression,
    persistent=flag,
    initially=flag,
    values=word("time of values", (AT_TRIGGER, AT_EXECUTION)),
)
@dataclass(frozen=True, repr=False)
class Event(Displayed):
    """Assignments to states and parameters, carried out once when a condition becomes true.

    The semantics are those of SBML Level 3. Of several events at one instant the one of highest
    priority is executed first, among equal priorities the one written first. After each
    execution all conditions are evaluated again, so that further events may become due.

    Parameters
    ----------
    when : condition or str
        Inequalities, joined by And, Or and Not, in states, slow quantities, switches, parameters
        and t; ``Eq(Mod(t, T), 0)`` is true at every multiple of T.
    then : mapping
        State or parameter to its new value. All values are computed before the first one is
        assigned.
    delay : Expr or float
        Time between trigger and execution, computed at the trigger.
    priority : Expr or float, optional
        Computed when the event is due; events without a priority follow those with one.
    persistent : bool
        Whether a delayed event is executed although its condition has become false meanwhile.
    initially : bool
        Whether the condition counts as true before the start of a run; if not, an event whose
        condition is true at the start is triggered there.
    values : {"trigger", "execution"}
        Whether the new values are computed at the trigger or at the execution.

    Raises
    ------
    ArgumentError
        For an argument of another kind.

    Examples
    --------
    >>> import fastslow as fs
    >>> neuron = fs.Model(
    ...     {"V": "1 - V"}, events={"spike": Event("V > 1/2", {"V": 0})}
    ... )
    >>> fs.simulate(neuron, [0], t=(0, 2)).events
    2 events
      Occurrence(t = 0.693147181, spike)
      Occurrence(t = 1.38629436, spike)
    """

    when: Any
    then: Mapping[Any, Any]
    _: KW_ONLY
    delay: Any = 0
    priority: Any = None
    persistent: bool = True
    initially: bool = True
    values: str = AT_TRIGGER

    def __str__(self) -> str:
        written = ", ".join(f"{n} → {e}" for n, e in self.then.items())
        settings = [f"delay {self.delay}"] * (self.delay != 0)
        settings += [f"priority {self.priority}"] * (self.priority is not None)
        settings += ["not persistent"] * (not self.persistent)
        settings += ["false before the start"] * (not self.initially)
        settings += ["with values as of the execution"] * (self.values != AT_TRIGGER)
        return f"when {self.when}: {written}" + "".join(f"; {one}" for one in settings)

    @property
    def content(self) -> tuple[Any, ...]:
        """Content by which events are compared."""
        fixed = (self.persistent, self.initially, self.values)
        return (self.when, tuple(self.then.items()), self.delay, self.priority, *fixed)


def expressions_of(event: Event) -> tuple[sp.Expr, ...]:
    """Functions of the condition, new values, delay and priority of an event that is read."""
    atoms, _ = triggers_of([event])
    rest = (event.delay, *([] if event.priority is None else [event.priority]))
    return (*(function for function, _ in atoms), *event.then.values(), *rest)


def with_changed(event: Event, change: Callable[[Any], Any]) -> Event:
    """Return an event with all expressions changed."""
    return replace(
        event,
        when=change(event.when),
        then=NamedMapping("assignment", {n: change(e) for n, e in event.then.items()}),
        delay=change(event.delay),
        priority=None if event.priority is None else change(event.priority),
    )


def read_events(
    given: Mapping[Any, Any],
    assignable: Mapping[str, str],
    read_condition: Callable[[str, Any], Boolean],
    read_value: Callable[[str, Any], sp.Expr],
    name_of: Callable[[Any], str],
) -> NamedMapping[Event]:
    """Validate the events of a model.

    Parameters
    ----------
    given : mapping
        Name to `Event`, or condition to a mapping of states and parameters to their new values.
    assignable : mapping
        Every name of the model to its kind.
    read_condition, read_value, name_of : callable
        Readers of conditions, of expressions and of names.

    Raises
    ------
    ModelError
    """
    found: dict[str, Event] = {}
    for key, value in given.items():
        event = value if isinstance(value, Event) else None
        if event is None and isinstance(value, Mapping):
            event = Event(key if isinstance(key, str | Boolean) else str(key), value)
        if event is None:
            raise ModelError(
                f"event {key}: expected fs.Event(when=condition, then=assignments), or a condition "
                f"with its assignments such as {{x > 1: {{x: 0}}}}, received {value!r}"
            )
        name = name_of(key)
        what = f"event {name}"
        if not event.then:
            raise ModelError(f"{what}: expected at least one assignment, such as {{x: 0}}")
        if name in found:
            raise ModelError(f"{what} is given twice")
        then: dict[str, sp.Expr] = {}
        for target, new in event.then.items():
            assigned = name_of(target)
            kind = assignable.get(assigned, "name of the model")
            if kind not in ("state", "slow state", "parameter"):
                hint = (
                    "; a switch is changed by its relations: switches={name: (on, off)}"
                    if kind == "switch"
                    else ""
                )
                is_kind = f"a {kind}" if assigned in assignable else f"no {kind}"
                raise ModelError(
                    f"{what}: {assigned} is {is_kind}; an event assigns states and parameters{hint}"
                )
            if assigned in then:
                raise ModelError(f"{what}: {assigned} has two values")
            then[assigned] = read_value(f"{what}: {assigned}", new)
        priority = event.priority
        read = Event(
            _smooth(read_condition(what, event.when)),
            NamedMapping("assignment", then),
            delay=read_value(f"{what}: delay", event.delay),
            priority=None if priority is None else read_value(f"{what}: priority", priority),
            persistent=event.persistent,
            initially=event.initially,
            values=event.values,
        )
        _check_condition(what, read.when)
        (program,) = triggers_of([read])[1]
        if postfix_depth(program, len(program)) > DEEPEST_CONDITION:
            raise ModelError(
                f"{what}: the condition has more than {DEEPEST_CONDITION} alternatives inside one "
                "another; expected a shorter one"
            )
        found[name] = read
    return NamedMapping("event", found)


def _smooth(condition: Any) -> Boolean:
    """Return a condition between smooth functions: pieces become alternatives.

    ``Eq(Mod(t, T), 0)`` becomes ``Mod(t, T) < T/2``, which becomes true at the same instants.
    """
    if isinstance(condition, (And, Or, Not, Xor)):
        return condition.func(*map(_smooth, condition.args))
    if isinstance(condition, sp.Eq):
        clock = instants(condition)
        if clock is None:
            return condition
        return sp.Lt(TIME - ClockTime(*clock, TIME), clock[0] / 2)
    if not isinstance(condition, (*_ABOVE, *_BELOW)):
        return condition
    difference = with_piecewise(condition.lhs - condition.rhs)
    if not difference.has(sp.Piecewise):
        return condition
    folded = sp.piecewise_fold(difference)
    if not isinstance(folded, sp.Piecewise):
        return condition.func(folded, 0)
    before: Boolean = sp.true
    parts = []
    for value, where in folded.args:
        parts.append(And(before, _smooth(where), _smooth(condition.func(value, 0))))
        before = And(before, Not(_smooth(where)))
    return Or(*parts)


def _check_condition(what: str, condition: Boolean) -> None:
    """Check that a condition consists of inequalities between smooth functions.

    Raises
    ------
    ModelError
    """
    if isinstance(condition, (And, Or, Not, Xor)):
        for part in condition.args:
            _check_condition(what, part)
    elif isinstance(condition, (sp.Eq, sp.Ne)):
        raise ModelError(
            f"{what}: {condition} is no inequality; expected a condition that is true for some "
            "time, such as x > 1, or Eq(Mod(t - phase, T), 0) for instants of time"
        )
    elif not isinstance(condition, (*_ABOVE, *_BELOW, BooleanTrue, BooleanFalse)):
        raise ModelError(
            f"{what}: expected inequalities joined by And, Or and Not, received {condition}"
        )


def rising_functions(condition: Boolean, *, negated: bool = False) -> Iterator[sp.Expr]:
    """Yield the functions of which one rises through zero where a condition becomes true.

    Examples
    --------
    >>> x, y = sp.symbols("x y")
    >>> list(rising_functions((x > 1) & ~(y > 0)))
    [-y, x - 1]
    """
    if isinstance(condition, Not):
        yield from rising_functions(condition.args[0], negated=not negated)
    elif isinstance(condition, (And, Or, Xor)):
        for part in sorted(condition.args, key=sp.default_sort_key):
            yield from rising_functions(part, negated=negated)
            if isinstance(condition, Xor):
                yield from rising_functions(part, negated=not negated)
    elif isinstance(condition, (*_ABOVE, *_BELOW)):
        difference = sp.expand(condition.lhs - condition.rhs)
        yield difference if isinstance(condition, _ABOVE) != negated else sp.expand(-difference)


def refuse_delays(events: Mapping[str, Event], task: str) -> None:
    """Raise ModelError if an event is executed later than it is triggered.

    Parameters
    ----------
    events : mapping
    task : str
        What was to be done, as the subject of a sentence.
    """
    for name, event in events.items():
        if event.delay != 0:
            raise ModelError(
                f"{task} would need the derivatives across the event {name}, which is executed "
                f"with a delay of {event.delay}; they are known for events that are executed when "
                "they are triggered, delay=0"
            )


def refuse_memory(events: Mapping[str, Event], assigned: Sequence[str], task: str) -> None:
    """Raise ModelError if states alone do not determine how a run with events goes on.

    Parameters
    ----------
    events : mapping
    assigned : sequence of str
        Parameters that they assign.
    task : str
        What was to be done, as the subject of a sentence.
    """
    why = ""
    for name, event in events.items():
        if event.delay != 0:
            why = f"waiting event {name}, which has a delay"
        elif not event.initially:
            why = f"condition of the event {name}, which is false before the start of a run"
    if assigned:
        why = f"value of {assigned[0]}, a parameter that an event assigns"
    if why:
        raise ModelError(
            f"{task} continues runs from their states alone, and would lose the {why}; expected "
            "events without delay that assign states"
        )


def triggers_of(
    events: Sequence[Event],
) -> tuple[tuple[tuple[sp.Expr, bool], ...], tuple[tuple[int, ...], ...]]:
    """Return the inequalities of some events, and their conditions as programs.

    Returns
    -------
    atoms : tuple of (sympy.Expr, bool)
        A function h, and whether the inequality h > 0 includes equality.
    programs : tuple of tuple of int
        For each event its condition in postfix notation: numbers of inequalities, and the
        operations of `fastslow.results.stored.operations`.

    Examples
    --------
    >>> x, y = sp.symbols("x y")
    >>> triggers_of([Event((x > 1) & ~(y < 0), {})])
    (((y, True), (x - 1, False)), ((0, 1, -1),))
    """
    atoms: dict[tuple[sp.Expr, bool], int] = {}

    def number(function: sp.Expr, closed: bool) -> list[int]:
        opposite = (sp.expand(-function), not closed)
        if opposite in atoms:
            return [atoms[opposite], NEGATION]
        return [atoms.setdefault((function, closed), len(atoms))]

    def program(condition: Any) -> list[int]:
        if isinstance(condition, Not):
            return [*program(condition.args[0]), NEGATION]
        if isinstance(condition, Xor):
            first, *others = condition.args
            rest = Xor(*others) if len(others) > 1 else others[0]
            return program(Or(And(first, Not(rest)), And(Not(first), rest)))
        if isinstance(condition, (And, Or)):
            first, *others = sorted(condition.args, key=sp.default_sort_key)
            found = program(first)
            for other in others:
                found += [*program(other), AND if isinstance(condition, And) else OR]
            return found
        if isinstance(condition, (BooleanTrue, BooleanFalse)):
            return [TRUE if condition == sp.true else FALSE]
        difference = sp.expand(condition.lhs - condition.rhs)
        above = isinstance(condition, _ABOVE)
        closed = isinstance(condition, (sp.Ge, sp.Le))
        return number(difference if above else sp.expand(-difference), closed)

    programs = tuple(tuple(program(event.when)) for event in events)
    return tuple(atoms), programs
