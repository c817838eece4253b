"""A model's equations as lists of operations, from which code is generated without SymPy."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import Any
from weakref import WeakValueDictionary

import sympy as sp

from fastslow.errors import ModelError
from fastslow.model.clocks import ClockCount, ClockFunction, ClockTime
from fastslow.model.events import AT_TRIGGER, Event, triggers_of
from fastslow.model.known_functions import without_recurrence
from fastslow.model.motion import Motion, drift
from fastslow.model.motions import (
    PARTITIONS_KEPT,
    continuity,
    motions_of,
    regions_of,
    rests_in,
)
from fastslow.model.recurrences import ListedOperations, scalar_code
from fastslow.model.structure import TIME, Partition, real
from fastslow.model.switches import Switch
from fastslow.model.tabulated import TableValue, Tabulated
from fastslow.results.stored.operations import (
    CLOCK_VALUES,
    SWITCH_VALUES,
    EventOperations,
    Operations,
    SeriesOperations,
    ValueOperations,
)


@dataclass(frozen=True)
class Equations:
    """The expressions that the operations depend on.

    ``interfaces`` are followed by the walls of the resets, by the functions of the switches, and by
    those of ``triggers``, symbols that are 1 where an inequality of an event is true, ``closed`` if
    it includes equality; ``jumps`` are the values of all states after each reset, and those in
    which each motion at rest begins; ``events`` are names, programs, expressions (values of all
    states, delay, any priority) and flags, and the parameters that they assign are the last of the
    states; ``clocks`` are pairs of period and time of instant 0, with the number of the jump at
    their instants, -1 for none; ``switches`` are the last of the quantities.
    """

    states: tuple[sp.Symbol, ...]
    quantities: tuple[sp.Symbol, ...]
    interfaces: tuple[sp.Expr, ...]
    modes: tuple[Motion, ...]
    jumps: tuple[tuple[sp.Expr, ...], ...] = ()
    clocks: tuple[tuple[tuple[sp.Expr, sp.Expr], int], ...] = ()
    switches: tuple[sp.Symbol, ...] = ()
    triggers: tuple[sp.Symbol, ...] = ()
    closed: tuple[bool, ...] = ()
    events: tuple[tuple[Any, ...], ...] = ()

    def with_own_clocks(self) -> Equations:
        """Return the equations with the clocks of their expressions before those of resets."""
        found = set().union(*(e.atoms(ClockFunction) for e in self._written))
        own = sorted({one.clock for one in found}, key=str)
        return replace(self, clocks=(*((clock, -1) for clock in own), *self.clocks))

    @cached_property
    def parameters(self) -> tuple[str, ...]:
        """Sorted names of all parameters that occur."""
        read = [*self.interfaces, *self._assigned]
        read += [e for mode in self.modes for e in (*mode.rates, *mode.laws)]
        read += [e for jump in self.jumps for e in jump]
        read += [e for clock, _ in self.clocks for e in clock]
        used = set().union(*(e.free_symbols for e in dict.fromkeys(read)))
        return tuple(sorted(s.name for s in used - self.moving))

    @cached_property
    def replacements(self) -> dict[sp.Expr, sp.Expr]:
        """Symbols that are valid in any source, y0, w0, p0, …, for all others."""
        groups = {"y": self.states, "w": self.quantities, "p": map(real, self.parameters)}
        names: dict[sp.Expr, sp.Expr] = {
            s: real(f"{g}{i}") for g, symbols in groups.items() for i, s in enumerate(symbols)
        }
        return {**names, **self._current_pieces()}

    def renamed(self) -> Equations:
        """Return the same equations with the symbols of `replacements`."""
        new = self.replacements
        changed = {e: e.xreplace(new) for e in self._written}

        def rename(expressions: tuple[sp.Expr, ...]) -> tuple[sp.Expr, ...]:
            return tuple(changed[e] for e in expressions)

        modes = tuple(
            replace(
                mode, rates=rename(mode.rates), laws=rename(mode.laws), bounds=rename(mode.bounds)
            )
            for mode in self.modes
        )
        return Equations(
            tuple(real(f"y{i}") for i in range(len(self.states))),
            tuple(real(f"w{i}") for i in range(len(self.quantities))),
            rename(self.interfaces),
            modes,
            tuple(map(rename, self.jumps)),
            tuple(((c[0].xreplace(new), c[1].xreplace(new)), jump) for c, jump in self.clocks),
            events=tuple((name, code, rename(e), *flags) for name, code, e, *flags in self.events),
        )

    @cached_property
    def _written(self) -> tuple[sp.Expr, ...]:
        """All different expressions that are evaluated in a run; regions share most of them."""
        written = [e for mode in self.modes for e in (*mode.rates, *mode.laws, *mode.bounds)]
        jumps = (e for jump in self.jumps for e in jump)
        return tuple(dict.fromkeys((*written, *self.interfaces, *jumps, *self._assigned)))

    @property
    def _assigned(self) -> list[sp.Expr]:
        """Values, delays and priorities of the events."""
        return [e for _, _, expressions, *_ in self.events for e in expressions]

    @property
    def _table_values(self) -> set[TableValue]:
        """All values and derivatives of tables."""
        return set().union(*(e.atoms(TableValue) for e in self._written))

    @property
    def tables(self) -> tuple[Tabulated, ...]:
        """The tables, in the order of the slow quantities."""
        laws = (law for mode in self.modes for law in mode.laws)
        return tuple(dict.fromkeys(v.table for law in laws for v in law.atoms(TableValue)))

    def _current_pieces(self) -> dict[sp.Expr, sp.Expr]:
        """Polynomials in time for tables, constants for clocks and switches: current parameters."""
        found: dict[sp.Expr, sp.Expr] = {}
        first, values = len(self.parameters), self._table_values
        for table in self.tables:
            n_terms = table.polynomial.n_terms
            knot, *terms = (real(f"p{first + 1 + k}") for k in range(1 + n_terms))
            since = TIME - knot
            for value in values:
                if value.table == table:
                    order = value.order
                    found[value] = sp.Add(
                        *(
                            sp.ff(k, order) * term * since ** (k - order)
                            for k, term in enumerate(terms)
                            if k >= order
                        )
                    )
            first += 2 + n_terms
        for clock, _ in self.clocks:
            count, time = (real(f"p{first + k}") for k in range(2))
            found.setdefault(ClockCount(*clock, TIME), count)
            found.setdefault(ClockTime(*clock, TIME), time)
            first += CLOCK_VALUES
        for switch in (*self.switches, *self.triggers):
            found[switch], found[_complement(switch)] = (real(f"p{first + k}") for k in range(2))
            first += SWITCH_VALUES
        return found

    @cached_property
    def n_bounds(self) -> int:
        """Number of rows for the sliding bounds, equal in all modes."""
        return max(2, *(len(mode.bounds) for mode in self.modes), 0)

    @property
    def moving(self) -> set[sp.Symbol]:
        """Symbols that change with time."""
        switches = (*self.switches, *self.triggers)
        return {*self.states, *self.quantities, *switches, *map(_complement, switches), TIME}

    @property
    def without_recurrence(self) -> tuple[str, ...]:
        """Names of functions for which a Taylor series cannot be generated."""
        used = [*self.interfaces]
        for mode in self.modes:
            used += [*mode.rates, *mode.laws, *mode.bounds]
        found = (without_recurrence(e, self.moving) for e in dict.fromkeys(used))
        return tuple(sorted(set().union(*found)))


#: Operations in use, by what they are derived from.
_derived: WeakValueDictionary[tuple[Equations, tuple[bool, ...], tuple[str, ...]], Operations] = (
    WeakValueDictionary()
)


@lru_cache(maxsize=PARTITIONS_KEPT)
def operations_of(partition: Partition) -> Operations:
    """Return the operations of a model, in its regions and in sliding.

    Parameters
    ----------
    partition : Partition
        The regions of the model.

    Raises
    ------
    ModelError
        If a function in the equations cannot be compiled.
    """
    structure, unmoved = partition.structure, written_equations(partition)
    count, added = len(unmoved.interfaces) - len(partition.interfaces), len(structure.assigned)
    signs, switches = [-1] * count, unmoved.switches
    modes = (_motion(region, signs, switches, added) for region in regions_of(partition))
    equations = replace(unmoved, modes=tuple(modes))
    # models with equal equations share their operations
    names = tuple(reset.name for reset in structure.resets)
    key = equations, tuple(continuity(partition).values()), names
    derived = _derived.get(key)
    if derived is None:
        motions = motions_of(partition, with_jumps=True)
        states, rests = (*structure.states, *structure.slow_states), rests_in(partition)
        sliding = (_motion(motion, signs, switches, added) for motion in motions.sliding)
        resting = (
            _motion(rest.motion, [-(k not in rest.walls) for k in range(count)], switches, added)
            for rest in rests
        )
        entries = ((*rest.entry, *unmoved.states[len(states) :]) for rest in rests)
        whole = replace(
            equations,
            modes=(*equations.modes, *sliding, *resting),
            jumps=(*equations.jumps, *entries),
        ).with_own_clocks()
        derived = _derived[key] = _operations(whole, *key[1:], motions.undecided)
    return derived


def written_equations(partition: Partition) -> Equations:
    """Return the equations of a model without motions."""
    structure = partition.structure
    resets, walls = structure.resets, structure.walls
    kicks = enumerate(resets[len(walls) :], start=len(walls))
    names = (*structure.states, *structure.slow_states, *structure.assigned)
    states = tuple(map(real, names))
    atoms, programs = triggers_of([*structure.events.values()])
    triggers = tuple(real(f"condition {k} of events") for k in range(len(atoms)))
    switches = tuple(map(real, structure.switch_names))
    heights = (_watched(switch) for switch in structure.switches)
    settings = (
        (clock, len(resets) + 2 * k + value)
        for k, switch in enumerate(structure.switches)
        for value, clock in zip((1, 0), switch.clocks, strict=True)
        if clock is not None
    )
    return Equations(
        states=states,
        quantities=(*map(real, structure.forcing), *switches),
        interfaces=(
            *(i.function for i in partition.interfaces.values()),
            *(r.function for r in walls),
            *heights,
            *(_signed(q, h) for q, (h, _) in zip(triggers, atoms, strict=True)),
        ),
        modes=(),
        jumps=tuple(tuple(r.jump.get(s.name, s) for s in states) for r in resets),
        clocks=(*((r.clock, number) for number, r in kicks if r.clock is not None), *settings),
        switches=switches,
        triggers=triggers,
        closed=tuple(closed for _, closed in atoms),
        events=tuple(
            _event(name, event, program, states)
            for (name, event), program in zip(structure.events.items(), programs, strict=True)
        ),
    )


def _motion(
    motion: Motion, signs: Sequence[int], switches: Sequence[sp.Symbol], added: int
) -> Motion:
    """Return a motion with the signs of further functions, switches, and constant states."""
    return replace(
        motion,
        signs=(*motion.signs, *signs),
        laws=(*motion.laws, *switches),
        rates=(*motion.rates, *[sp.S.Zero] * added),
    )


def _event(
    name: str, event: Event, program: tuple[int, ...], states: Sequence[sp.Symbol]
) -> tuple[Any, ...]:
    """Return an event as in `Equations`."""
    values = tuple(event.then.get(s.name, s) for s in states)
    ordered = () if event.priority is None else (event.priority,)
    flags = event.persistent, event.initially, event.values == AT_TRIGGER
    kept = tuple(i for i, s in enumerate(states) if event.then.get(s.name) == s)
    return (name, program, (*values, event.delay, *ordered), *flags, kept)


def _complement(switch: sp.Symbol) -> sp.Symbol:
    """Return the symbol of 1 − q for a switch q."""
    return real(f"not {switch.name}")


def _watched(switch: Switch) -> sp.Expr:
    return _either(real(switch.name), (switch.watched(0), switch.watched(1)))


def _either(symbol: sp.Symbol, functions: tuple[sp.Expr, sp.Expr]) -> sp.Expr:
    """Return (1 − q) h₁ + q h₀ term by term, whose rounding error is that of the terms."""
    return sp.Add(
        *(
            factor * term
            for factor, function in zip((_complement(symbol), symbol), functions, strict=True)
            for term in sp.Add.make_args(function)
        )
    )


def _signed(symbol: sp.Symbol, function: sp.Expr) -> sp.Expr:
    """Return (1 − 2q) h term by term: h, or −h where it is positive."""
    sign = _complement(symbol) - symbol
    return sp.Add(*(sign * term for term in sp.Add.make_args(function)))


def _operations(
    written: Equations,
    continuous: tuple[bool, ...],
    resets: tuple[str, ...],
    undecided: tuple[tuple[str, str], ...],
) -> Operations:
    equations, alone = written.renamed(), written.without_recurrence
    if alone and (resets or written.switches or written.events):
        raise ModelError(
            f"{', '.join(alone)} has no Taylor recurrence; models with resets, switches or events "
            "need one for every function"
        )
    one = _value_operations if alone else _series_operations
    return replace(
        common_operations(written, equations, continuous, resets, undecided),
        motions=tuple(one(equations, mode) for mode in equations.modes),
        values_only=alone,
    )


def common_operations(
    written: Equations,
    equations: Equations,
    continuous: tuple[bool, ...],
    resets: tuple[str, ...],
    undecided: tuple[tuple[str, str], ...],
) -> Operations:
    """Return the operations of a model without its motions; ``equations`` are the renamed ones."""
    return Operations(
        sizes=(len(equations.states), len(equations.quantities), len(equations.interfaces)),
        parameters=written.parameters,
        motions=(),
        gradients=tuple(_gradient(equations, h) for h in equations.interfaces),
        continuous=(*continuous, *[False] * (len(equations.interfaces) - len(continuous))),
        undecided=undecided,
        tables=tuple(table.polynomial for table in written.tables),
        resets=resets,
        jumps=tuple(tuple(map(scalar_code, jump)) for jump in equations.jumps),
        clocks=tuple((scalar_code(c[0]), scalar_code(c[1]), jump) for c, jump in equations.clocks),
        switches=tuple(switch.name for switch in written.switches),
        triggers=written.closed,
        events=tuple(
            _event_operations(len(equations.states), *event) for event in equations.events
        ),
    )


def _event_operations(
    n_states: int,
    name: str,
    program: tuple[int, ...],
    expressions: tuple[sp.Expr, ...],
    persistent: bool,
    initially: bool,
    at_trigger: bool,
    kept: tuple[int, ...],
) -> EventOperations:
    codes = tuple(map(scalar_code, expressions))
    return EventOperations(
        name=name,
        program=program,
        values=codes[:n_states],
        delay=codes[n_states],
        priority="".join(codes[n_states + 1 :]),
        persistent=persistent,
        initially=initially,
        at_trigger=at_trigger,
        kept=kept,
    )


def _series_operations(equations: Equations, mode: Motion) -> SeriesOperations:
    m, q, p = (len(g) for g in (equations.states, equations.quantities, equations.interfaces))
    targets = [*mode.laws, *equations.interfaces, *mode.bounds]
    symbols = {s: i for i, s in enumerate(equations.states)}
    outputs = dict(enumerate(targets, start=m))
    reserved: dict[sp.Expr, int] = {}
    for row, expression in outputs.items():
        if expression not in symbols:
            reserved.setdefault(expression, row)
    work = ListedOperations(symbols, TIME, reserved, m + q + p + equations.n_bounds)
    for symbol, law in zip(equations.quantities, mode.laws, strict=True):
        work.name(symbol, work.row(law))
    rates = tuple(work.row(rate) for rate in mode.rates)
    held = tuple(work.row(expression) for expression in targets)
    return SeriesOperations(
        mode.name, mode.signs, tuple(work.scalars), tuple(work.nodes), rates, held
    )


def _value_operations(equations: Equations, mode: Motion) -> ValueOperations:
    """Operations of a mode without recurrences: values, and rates of states and interfaces."""
    names = [s.name for s in equations.states]
    laws = dict(zip((s.name for s in equations.quantities), mode.laws, strict=True))
    outputs = [*mode.rates]
    for h in equations.interfaces:
        outputs += [h, drift(h, names, mode.rates, laws)]
    outputs += mode.bounds
    shared, results = sp.cse(outputs, symbols=sp.numbered_symbols("s", real=True), list=True)
    codes = [scalar_code(value) for value in results]
    m, p = len(equations.states), len(equations.interfaces)
    heights = codes[m : m + 2 * p]
    return ValueOperations(
        mode.name,
        mode.signs,
        tuple(map(scalar_code, mode.laws)),
        tuple(scalar_code(value) for _, value in shared),
        tuple(codes[:m]),
        tuple(zip(heights[::2], heights[1::2], strict=True)),
        tuple(codes[m + 2 * p :]),
    )


def _gradient(equations: Equations, function: sp.Expr) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """The terms of a function, and its gradient with respect to the states."""
    return (
        tuple(scalar_code(term) for term in sp.Add.make_args(function)),
        tuple(
            scalar_code(function.diff(s)) if s in function.free_symbols else "0.0"
            for s in equations.states
        ),
    )
