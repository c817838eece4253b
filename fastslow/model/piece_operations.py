"""One list of operations for all regions of a model, and for sliding along any interfaces.

Every piece of the equations is a row, which the signs of its own interfaces choose among the rows
of its values: k independent conditions cost k. Along sliding interfaces a piece is the mean of its
values, and its jumps are multiplied by weights sᵢ, which keep every hᵢ zero: with the rates
f₀ + Σ bᵢ sᵢ they solve 0 = a + B s, where a = ∂h/∂t + ∇h·f₀ and B_ij = ∇hᵢ·b_j. At rest on a wall
the speed into it is such an h, and the contact force such a weight.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import lru_cache
from itertools import product

import sympy as sp

from fastslow.errors import ModelError
from fastslow.model.expansion import expanded
from fastslow.model.interfaces import vanishes_on
from fastslow.model.known_functions import without_recurrence
from fastslow.model.motion import Motion, drift, fixed_state
from fastslow.model.motions import PARTITIONS_KEPT, continuity
from fastslow.model.motions_by_signs import contacts_by_number
from fastslow.model.operations import (
    Equations,
    common_operations,
    written_equations,
)
from fastslow.model.pieces import MOST_DECIDING, Pieces
from fastslow.model.recurrences import ListedOperations
from fastslow.model.structure import TIME, Partition, real
from fastslow.model.tabulated import TableValue
from fastslow.results.stored.operations import CHOSEN, WEIGHTS, Operations
from fastslow.results.stored.sign_patterns import Pattern
from fastslow.results.stored.signed_operations import Choice, SignedOperations

#: Largest number of sliding interfaces that decide one piece.
MOST_SLIDING_IN_ONE = 3


@lru_cache(maxsize=PARTITIONS_KEPT)
def operations_by_signs(partition: Partition) -> SignedOperations:
    """Return the operations of a model whose regions are too many to form them all.

    Raises
    ------
    ModelError
        For laws of slow quantities with several pieces, functions without a Taylor recurrence, and
        pieces that too many conditions decide.
    """
    pieces = partition.pieces
    assert pieces is not None
    _require_series(partition, pieces)
    return _Listing(partition, pieces).operations()


def _require_series(partition: Partition, pieces: Pieces) -> None:
    """Raise for what is not simulated with regions formed from pieces."""
    structure = partition.structure
    if any(e.has(sp.Piecewise) for e in structure.forcing.values()):
        raise ModelError(
            "a model of so many regions cannot have slow quantities with several pieces: each "
            "region is formed when a run reaches it; write some of the switching as smooth "
            "functions"
        )
    functions = written_equations(partition).interfaces
    written = [*structure.rates.values(), *structure.forcing.values(), *functions]
    moving = {*structure.moving}
    alone = sorted(set().union(*(without_recurrence(e, moving) for e in written)))
    if alone:
        raise ModelError(
            f"{', '.join(alone)} has no Taylor recurrence; a model of so many regions needs one "
            "for every function"
        )
    for piece in pieces.pieces:
        if len(piece.deciding) > MOST_DECIDING:
            raise ModelError(
                f"{len(piece.deciding)} interfaces decide one piece of the rates, "
                f"{str(piece.expression)[:80]}; expected at most {MOST_DECIDING} in a model of so "
                "many regions"
            )


def _as_written(partition: Partition) -> Equations:
    """The equations with one motion, whose rates have their pieces.

    Along interfaces and at rest on walls there are derivatives of tables besides.
    """
    structure, written = partition.structure, written_equations(partition)
    names = (*structure.states, *structure.slow_states)
    rates = (*(structure.rates[n] for n in names), *[sp.S.Zero] * len(structure.assigned))
    laws = (*structure.forcing.values(), *written.switches)
    slopes = tuple(law.diff(TIME, k) for law in laws for k in (1, 2) if law.has(TableValue))
    motion = Motion("", (), rates, laws, bounds=slopes)
    return replace(written, modes=(motion,)).with_own_clocks()


class _Listing:
    """The operations of one model."""

    def __init__(self, partition: Partition, pieces: Pieces) -> None:
        structure = partition.structure
        self.structure, self.pieces = structure, pieces
        self.states = (*structure.states, *structure.slow_states)
        self.continuous = tuple(continuity(partition).values())
        self.functions = [i.function for i in pieces.interfaces]
        self.rates = [structure.rates[n] for n in self.states]
        self.laws = dict(structure.forcing)
        self.written = _as_written(partition)
        self.names = self.written.replacements
        self.choices: list[Choice] = []
        self.undecided: list[tuple[str, str]] = []
        heights = [h.xreplace(self.names) for h in self.written.interfaces]
        n_states = len(self.written.states)
        first = n_states + len(self.written.quantities)
        self.walls = structure.walls
        self.contacts = contacts_by_number(partition)
        self.sliding = (*self._sliding(), *self.contacts)
        rows = {h: first + j for j, h in reversed([*enumerate(heights)])}
        n_bounds = max(2, 2 * len(self.sliding))
        symbols_of_states = {real(f"y{k}"): k for k in range(n_states)}
        reserved = {h: row for h, row in rows.items() if h not in symbols_of_states}
        after = first + len(heights) + n_bounds
        self.work = ListedOperations(symbols_of_states, TIME, reserved, after)
        self.heights = heights

    def operations(self) -> SignedOperations:
        work = self.work
        laws = []
        for k, law in enumerate(self.written.modes[0].laws):
            laws.append(work.row(law.xreplace(self.names)))
            work.name(real(f"w{k}"), laws[-1])
        heights = [work.row(h) for h in self.heights]
        bases = {p.expression: real(f"mean {k}") for k, p in enumerate(self.pieces.pieces)}
        base = [rate.xreplace(bases) for rate in self.rates]
        for number in range(len(self.pieces.pieces)):
            self._choose(number, real(f"mean {number}"), None)
        jumps = self._weights(base, bases)
        pieces = {}
        for number, piece in enumerate(self.pieces.pieces):
            terms = [real(f"weight {j}") * jumps[number, j] for j in self._slides(number)]
            pieces[piece.expression] = sp.Add(bases[piece.expression], *terms)
        rates = [rate.xreplace(pieces) for rate in self.rates]
        for j, contact in self.contacts.items():
            for i, push in enumerate(contact.push):
                rates[i] -= real(f"weight {j}") * push
        found = [work.row(rate.xreplace(self.names)) for rate in rates]
        for j in self.sliding:
            # the side of a wall on which a motion is has the sign −1
            place = fixed_state(self._height(j), self.states, self.structure.forcing)
            if place is not None:
                rows: dict[Pattern, int] = {(1,): found[place], (-1,): found[place]}
                rows[0,] = work.row(sp.S.Zero)
                found[place] = self._add(f"rate of {place} along {j}", (j,), rows)
        found += [work.row(sp.S.Zero)] * (len(self.written.states) - len(found))
        return SignedOperations(
            common=self._common(),
            walls=tuple(wall.wall for wall in self.walls),
            scalars=tuple(work.scalars),
            nodes=tuple(work.nodes),
            rates=tuple(found),
            outputs=(*laws, *heights),
            choices=tuple(self.choices),
            sliding=self.sliding,
            held={j: tuple(self._held(contact.speed)) for j, contact in self.contacts.items()},
        )

    def _held(self, speed: sp.Expr) -> Iterator[int]:
        """Interfaces that a motion does not leave while the speed into a wall is zero."""
        moving = {*self.structure.moving}
        used = speed.free_symbols & moving
        for j, function in enumerate(self.functions):
            if function.free_symbols & moving == used and vanishes_on(function, speed):
                yield j

    def _common(self) -> Operations:
        """All but the motions, with a jump onto each wall."""
        own = self.written.states[len(self.states) :]
        entries = []
        for j in range(len(self.functions), len(self.functions) + len(self.walls)):
            contact = self.contacts.get(j)
            onto = self.written.states if contact is None else (*contact.entry, *own)
            entries.append(onto)
        written = replace(self.written, jumps=(*self.written.jumps, *entries))
        names = tuple(reset.name for reset in self.structure.resets)
        undecided = tuple(self.undecided)
        return common_operations(written, written.renamed(), self.continuous, names, undecided)

    def _height(self, j: int) -> sp.Expr:
        """What is zero along an interface, or the speed into a wall at rest on it."""
        return self.contacts[j].speed if j in self.contacts else self.functions[j]

    def _slides(self, number: int) -> list[int]:
        """Interfaces of a piece along which a motion may slide."""
        return [j for j in self.pieces.pieces[number].deciding if j in self.sliding]

    def _sliding(self) -> tuple[int, ...]:
        """Interfaces across which the rates jump, in which they are affine."""
        found = []
        for j, continuous in enumerate(self.continuous):
            own = self.pieces.deciding[j]
            if continuous or not own:
                continue
            dummies = {self.pieces.pieces[k].expression: sp.Dummy(f"q{k}") for k in own}
            rates = (
                rate.xreplace(dummies)
                for rate in self.structure.rates.values()
                if rate.has(*dummies)
            )
            mixed = any(
                rate.diff(one).free_symbols & {*dummies.values()}
                for rate in rates
                for one in dummies.values()
                if one in rate.free_symbols
            )
            if mixed:
                why = "the rates are not affine in what jumps there"
                self.undecided.append((f"{self.pieces.interfaces[j].name} = 0", why))
            else:
                found.append(j)
        return tuple(found)

    def _choose(self, number: int, symbol: sp.Symbol, jump: int | None) -> None:
        """List the mean of a piece by the signs of its interfaces, or its jump across one."""
        piece, slides = self.pieces.pieces[number], set(self._slides(number))
        places = [k for k, j in enumerate(piece.deciding) if j in slides]
        rows: dict[Pattern, int] = {}
        for pattern in piece.patterns:
            for some in product((False, True), repeat=len(places)):
                zeros = [k for k, zero in zip(places, some, strict=True) if zero]
                own = tuple(0 if k in zeros else s for k, s in enumerate(pattern))
                if own in rows or len(zeros) > MOST_SLIDING_IN_ONE:
                    continue
                parts = self.pieces.parts(number, own)
                if parts is not None:
                    value = parts.get(jump, sp.S.Zero)
                    rows[own] = self.work.row(value.xreplace(self.names))
        self.work.name(symbol, self._add(symbol.name, piece.deciding, rows))

    def _add(self, name: str, deciding: tuple[int, ...], rows: dict[Pattern, int]) -> int:
        """List a row that is one of several."""
        place = len(self.choices)
        self.choices.append((deciding, rows))
        among = tuple(dict.fromkeys(rows.values()))
        return self.work.add(real(f"chosen {name}"), CHOSEN, place, among)

    def _weights(
        self, base: Sequence[sp.Expr], bases: Mapping[sp.Expr, sp.Symbol]
    ) -> dict[tuple[int, int], sp.Symbol]:
        """List the weights of sliding; return the symbols of the jumps of all pieces."""
        jumps: dict[tuple[int, int], sp.Symbol] = {}
        for number in range(len(self.pieces.pieces)):
            for j in self._slides(number):
                jumps[number, j] = symbol = real(f"jump {number} {j}")
                self._choose(number, symbol, j)
        vectors: dict[int, dict[str, sp.Expr]] = {
            j: {
                name: -push
                for name, push in zip(self.states, contact.push, strict=True)
                if push != 0
            }
            for j, contact in self.contacts.items()
        }
        for j in self.sliding:
            if j in self.contacts:
                continue
            own = self.pieces.deciding[j]
            symbols = [(bases[self.pieces.pieces[k].expression], jumps[k, j]) for k in own]
            vectors[j] = {
                name: sp.Add(*(rate.diff(q) * jump for q, jump in symbols))
                for name, rate in zip(self.states, base, strict=True)
                if rate.free_symbols & {q for q, _ in symbols}
            }
        drifts, entries = [], []
        for place, i in enumerate(self.sliding):
            function = self._height(i)
            drifts.append(self._row(drift(function, self.states, base, self.laws)))
            for other, j in enumerate(self.sliding):
                used = function.free_symbols
                terms = [
                    function.diff(real(name)) * rate
                    for name, rate in vectors[j].items()
                    if real(name) in used
                ]
                slope = expanded(sp.Add(*terms))
                if slope != 0:
                    entries.append((place, other, self._row(slope)))
        first = self.work.next
        for place, j in enumerate(self.sliding):
            row = self.work.add(
                real(f"row of weight {j}"), WEIGHTS, place, tuple(drifts), tuple(entries)
            )
            self.work.name(real(f"weight {j}"), row)
        assert not self.sliding or self.work.next == first + len(self.sliding)
        return jumps

    def _row(self, expression: sp.Expr) -> int:
        return self.work.row(expression.xreplace(self.names))
