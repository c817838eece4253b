"""Resets, events, motions at rest and instants of a model, for its motions between events."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from fastslow.model.clocks import ClockCount, ClockFunction
from fastslow.model.events import Event, expressions_of, rising_functions
from fastslow.model.model import Model
from fastslow.model.motion import Motion
from fastslow.model.motions import motions_of, rests_in
from fastslow.model.recurrences import scalar_code
from fastslow.model.resets import Reset
from fastslow.model.rests import Rest
from fastslow.model.structure import TIME, real
from fastslow.model.switches import Switch
from fastslow.model.tabulated import TableValue, Tabulated
from fastslow.results.stored.arithmetic import value_of

Array = NDArray[np.float64]
Integers = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Instants:
    """The clocks and tables of a model, and their values that are constant between instants.

    A clock has one such value, the number k of its last instant, which is at the time phase + k
    period. A table has its last knot, the coefficients of its polynomial, and its next knot.

    Parameters
    ----------
    clocks : tuple of (Expr, Expr)
        Period and time of instant 0.
    tables : tuple of Tabulated
    """

    clocks: tuple[tuple[sp.Expr, sp.Expr], ...]
    tables: tuple[Tabulated, ...]

    @classmethod
    def of(
        cls, expressions: Sequence[sp.Expr], events: Sequence[tuple[sp.Expr, sp.Expr]]
    ) -> Instants:
        """The instants of all expressions of a model, and the clocks of its events."""
        own = set().union(*(e.atoms(ClockFunction) for e in expressions))
        clocks = [one.clock for one in sorted(own, key=str)]
        clocks += events
        values = set().union(*(e.atoms(TableValue) for e in expressions))
        tables = (value.table for value in sorted(values, key=lambda v: v.sort_key()))
        return cls(tuple(dict.fromkeys(clocks)), tuple(dict.fromkeys(tables)))

    @property
    def count(self) -> int:
        """Number of clocks and tables."""
        return len(self.clocks) + len(self.tables)

    @cached_property
    def symbols(self) -> tuple[sp.Symbol, ...]:
        """The values that are constant between instants, as symbols."""
        n = len(self.clocks) + sum(2 + table.polynomial.n_terms for table in self.tables)
        return tuple(real(f"(constant {k})") for k in range(n))

    @cached_property
    def _symbols_of(self) -> dict[Any, tuple[sp.Symbol, ...]]:
        """The symbols of every clock and every table."""
        left = iter(self.symbols)
        found: dict[Any, tuple[sp.Symbol, ...]] = {clock: (next(left),) for clock in self.clocks}
        for table in self.tables:
            found[table] = tuple(next(left) for _ in range(2 + table.polynomial.n_terms))
        return found

    @cached_property
    def heights(self) -> tuple[sp.Expr, ...]:
        """Of every clock and table the time since its next instant."""
        symbols = self._symbols_of
        clocks = (
            TIME - phase - (symbols[period, phase][0] + 1) * period for period, phase in self.clocks
        )
        return (*clocks, *(TIME - symbols[table][-1] for table in self.tables))

    def replaced(self, expression: sp.Expr, laws: Mapping[sp.Symbol, sp.Expr]) -> sp.Expr:
        """Replace slow quantities by their laws, and clocks and tables by their symbols."""
        written = expression.xreplace(laws)
        if not self.count:
            return written
        parts = written.atoms(ClockFunction, TableValue)
        return written.xreplace({part: self._current(part) for part in parts})

    def _current(self, part: sp.Expr) -> sp.Expr:
        """A clock or a table between two instants."""
        if isinstance(part, ClockFunction):
            (count,) = self._symbols_of[part.clock]
            period, phase = part.clock
            return count if isinstance(part, ClockCount) else phase + count * period
        knot, *terms, _ = self._symbols_of[part.table]
        order, since = part.order, TIME - knot
        kept = [(k, term) for k, term in enumerate(terms) if k >= order]
        return sp.Add(*(sp.ff(k, order) * term * since ** (k - order) for k, term in kept))

    def codes(self, names: Sequence[str]) -> tuple[tuple[str, str], ...]:
        """Periods and phases as arithmetic of the parameter array."""
        rename = {real(name): real(f"p{k}") for k, name in enumerate(names)}
        return tuple(
            (scalar_code(period.xreplace(rename)), scalar_code(phase.xreplace(rename)))
            for period, phase in self.clocks
        )


@dataclass(frozen=True, eq=False)
class Jumps:
    """The motions of a model with its walls, and the states after its resets and events.

    Parameters
    ----------
    model : Model
    """

    model: Model

    @cached_property
    def resets(self) -> tuple[Reset, ...]:
        """Those at walls, then kicks."""
        return self.model.structure.resets

    @property
    def events(self) -> Mapping[str, Event]:
        """They are numbered after the resets."""
        return self.model.structure.events

    @cached_property
    def triggers(self) -> tuple[sp.Expr, ...]:
        """Functions at whose zeros the conditions of events become true."""
        found = (rising_functions(event.when) for event in self.events.values())
        return tuple(dict.fromkeys(function for functions in found for function in functions))

    @cached_property
    def triggers_of(self) -> tuple[tuple[int, ...], ...]:
        """Numbers of the functions in the condition of every event."""
        return tuple(
            tuple(sorted({self.triggers.index(h) for h in rising_functions(event.when)}))
            for event in self.events.values()
        )

    def decides(self, number: int, time: float, state: Array) -> bool:
        """Whether an event depends on the sign of one function of its condition at a state.

        Parameters
        ----------
        number : int
            Number of the function.
        time : float
        state : ndarray, shape (n,)
        """
        model, function = self.model, self.triggers[number]
        values = model.values | dict(zip(map(real, self.states), state.tolist(), strict=True))
        values |= {TIME: time}
        laws = {real(name): law.subs(values) for name, law in model.forcing.items()}
        for event, numbers in zip(self.events.values(), self.triggers_of, strict=True):
            if number not in numbers:
                continue
            truths = [
                {r: sp.true if (function in rising_functions(r)) == above else sp.false}
                for r in event.when.atoms(sp.core.relational.Relational)
                if function in {*rising_functions(r), *rising_functions(r, negated=True)}
                for above in (False, True)
            ]
            found = {event.when.xreplace(truth).subs(laws).subs(values) for truth in truths}
            if found != {sp.true} and found != {sp.false}:
                return True
        return False

    @property
    def states(self) -> tuple[str, ...]:
        """States, slow states, and parameters that events assign."""
        model = self.model
        return (*model.states, *model.slow_states, *model.assigned)

    @cached_property
    def walls(self) -> tuple[Reset, ...]:
        return tuple(reset for reset in self.resets if reset.clock is None)

    @cached_property
    def _motions(self) -> Any:
        return motions_of(self.model.partition, with_jumps=True)

    @cached_property
    def rests(self) -> tuple[Rest, ...]:
        return rests_in(self.model.partition)

    @cached_property
    def modes(self) -> tuple[Motion, ...]:
        """Regions, sliding motions, and motions at rest, as in runs."""
        rests = (rest.motion for rest in self.rests)
        return (*self._motions.regions, *self._motions.sliding, *rests)

    @cached_property
    def instants(self) -> Instants:
        written = [e for mode in self.modes for e in (*mode.rates, *mode.laws, *mode.bounds)]
        written += [i.function for i in self.model.interfaces.values()]
        written += [e for reset in self.resets for e in reset.expressions]
        written += [e for event in self.events.values() for e in expressions_of(event)]
        written += [e for rest in self.rests for e in rest.entry]
        written += [function for one in self.switches for function in one.functions]
        clocks = [clock for one in self.switches for clock in one.clocks]
        clocks += [reset.clock for reset in self.resets]
        # regions share most expressions
        different = tuple(dict.fromkeys(written))
        return Instants.of(different, [clock for clock in clocks if clock is not None])

    @property
    def switches(self) -> tuple[Switch, ...]:
        return self.model.structure.switches

    @property
    def watched(self) -> tuple[sp.Expr, ...]:
        """The functions at whose zeros the switches change, with the symbols of the switches."""
        symbols = [real(one.name) for one in self.switches]
        return tuple(
            (1 - q) * one.watched(0) + q * one.watched(1)
            for q, one in zip(symbols, self.switches, strict=True)
        )

    @cached_property
    def signs(self) -> Integers:
        """Sides of all switching functions in every mode, 0 for those it slides or rests on.

        These are interfaces, walls, instants, functions of switches and of conditions. The sign is
        −1 before walls, instants, changes of switches and events.
        """
        first = len(self.model.interfaces)
        more = len(self.walls) + self.instants.count + len(self.switches) + len(self.triggers)
        found = np.full((len(self.modes), first + more), -1)
        for k, mode in enumerate(self.modes):
            found[k, :first] = mode.signs
        for k, rest in enumerate(self.rests, start=len(self.modes) - len(self.rests)):
            found[k, [first + wall for wall in rest.walls]] = 0
        return found.astype(np.int64)

    def laws_of(self, mode: Motion) -> dict[sp.Symbol, sp.Expr]:
        """The laws of the slow quantities in a mode."""
        return {real(n): law for n, law in zip(self.model.forcing, mode.laws, strict=True)}

    @cached_property
    def _table(self) -> tuple[list[tuple[sp.Expr, ...]], dict[tuple[int, int, int], int]]:
        """Distinct jumps, and their numbers by reset, mode before, and rest after (-1: none)."""
        symbols = [real(n) for n in self.states]
        kept = [real(n) for n in self.model.assigned]
        assignments: list[Mapping[Any, Any]] = [reset.jump for reset in self.resets]
        assignments += [event.then for event in self.events.values()]
        first = len(self.modes) - len(self.rests)
        rows: dict[tuple[sp.Expr, ...], int] = {}
        numbers: dict[tuple[int, int, int], int] = {}

        def add(key: tuple[int, int, int], jump: Sequence[sp.Expr], laws: Any) -> None:
            row = tuple(self.instants.replaced(e, laws) for e in jump)
            numbers[key] = rows.setdefault(row, len(rows))

        for before, mode in enumerate(self.modes):
            laws = self.laws_of(mode)
            for r, assigned in enumerate(assignments):
                values = [assigned.get(s.name, s) for s in symbols]
                add((r, before, -1), values, laws)
                after = dict(zip(symbols, values, strict=True))
                for k, rest in enumerate(self.rests):
                    entry = [e.xreplace(laws).xreplace(after) for e in (*rest.entry, *kept)]
                    add((r, before, first + k), entry, laws)
        for k, rest in enumerate(self.rests):
            for before, mode in enumerate(self.modes):
                add((-1, before, first + k), (*rest.entry, *kept), self.laws_of(mode))
        return list(rows), numbers

    @property
    def rows(self) -> list[tuple[sp.Expr, ...]]:
        """The states after every jump."""
        return self._table[0]

    def rest_entry(self, mode: int) -> int:
        """Number of the jump onto the walls on which a mode rests, -1 for other modes."""
        return self._table[1].get((-1, mode, mode), -1)

    def number(self, reset: int, before: int, after: int) -> int:
        """Number of the jump between two modes; -1 if the state does not change.

        Parameters
        ----------
        reset : int
            Number of the reset or event, -1 without one.
        before, after : int
            Modes.
        """
        walls = slice(len(self.model.interfaces), None)
        rests = self.signs[after, walls] == 0
        begins = rests.any() and not (rests == (self.signs[before, walls] == 0)).all()
        if begins and reset < 0:
            # one of several walls is left
            begins = bool((rests & (self.signs[before, walls] != 0)).any())
        return self._table[1].get((reset, before, after if begins else -1), -1)


def constants_at(
    instants: Instants, codes: Sequence[tuple[str, str]], times: Array, parameters: Array
) -> Array:
    """Values of clocks and tables in the intervals that contain some times, shape (m, count)."""
    columns = []
    known = {f"p{k}": value for k, value in enumerate(parameters.tolist())}
    for length, offset in codes:
        period, phase = float(value_of(length, known)), float(value_of(offset, known))
        columns.append(np.floor((times - phase) / period))
    for table in instants.tables:
        rows, knots = table.polynomial.pieces(times), table.polynomial.knots
        shift = table.polynomial.cycles(times) * table.polynomial.length
        terms = table.polynomial.coefficients[rows].T
        columns += [knots[rows] + shift, *terms, knots[rows + 1] + shift]
    return np.array(columns).reshape(len(columns), len(times)).T.copy()


def instants_between(
    instants: Instants,
    codes: Sequence[tuple[str, str]],
    since: float,
    until: float,
    parameters: Array,
) -> list[tuple[float, int]]:
    """Times of all instants in an open interval, with the clock or table; in order."""
    found: list[tuple[float, int]] = []
    known = {f"p{k}": value for k, value in enumerate(parameters.tolist())}
    for number, (length, offset) in enumerate(codes):
        period, phase = float(value_of(length, known)), float(value_of(offset, known))
        first, last = np.ceil((since - phase) / period), np.floor((until - phase) / period)
        times = phase + np.arange(first, last + 1) * period
        found += [(time, number) for time in times.tolist() if since < time < until]
    for number, table in enumerate(instants.tables, start=len(codes)):
        one = table.polynomial
        first, last = one.cycles(np.array([since, until]))
        knots = one.knots[:-1] if one.periodic else one.knots
        times = (knots + np.arange(first, last + 1)[:, None] * one.length).reshape(-1)
        found += [(time, number) for time in times.tolist() if since < time < until]
    return sorted(found)
