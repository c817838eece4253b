"""Smooth motions of single sign patterns: in a region, or sliding along any number of interfaces.

Where the regions are too many to form them all, a motion is derived from the pieces of the
equations alone, not from the regions beside it. With the rates f₀ + Σ bᵢ sᵢ, affine in the weights
sᵢ of the sliding interfaces, 0 = a + B s is solved for each group of interfaces that the matrix B
connects: m independent contacts cost m.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from functools import lru_cache

import sympy as sp
from sympy.polys.matrices import DomainMatrix

from fastslow.errors import ModelError
from fastslow.model.expansion import cancelled, expanded, without_cancellation
from fastslow.model.motion import Motion, drift, fixed_state, shortened
from fastslow.model.pieces import outermost
from fastslow.model.rests import Rest, RestOnWall, contacts_of, on_walls
from fastslow.model.structure import Partition, real
from fastslow.results.stored.sign_names import name_at_rest, name_of_signs
from fastslow.results.stored.sign_patterns import Pattern

#: Interfaces of one group, connected by the rates, along which sliding is derived.
LARGEST_GROUP = 64

#: Partitions whose rests are kept.
CONTACTS_KEPT = 16


def motion_by_signs(partition: Partition, signs: Pattern) -> Motion:
    """Return the motion of a sign pattern of a model whose regions are named by their signs.

    Parameters
    ----------
    partition : Partition
        With pieces.
    signs : tuple of int
        Of all interfaces, and of walls where it rests on any; 0 for interfaces along which the
        motion slides, and for walls on which it rests. The signs of the motion are those of
        interfaces.

    Raises
    ------
    ModelError
        If no sliding motion is derived.

    Examples
    --------
    >>> from fastslow.model.model import Model
    >>> x = sp.symbols("x:11")
    >>> many = Model({one: 1 - 2 * sp.sign(one) for one in x})
    >>> motion = motion_by_signs(many.partition, (1, 0, *[-1] * 9))
    >>> motion.rates[:3], motion.weights, motion.bounds
    ((-1, 0, 3), (1/2,), (-1, 3))
    """
    structure, pieces = partition.structure, partition.pieces
    assert pieces is not None
    names = (*structure.states, *structure.slow_states)
    laws = tuple(pieces.in_region(law, signs) for law in structure.forcing.values())
    slides = tuple(j for j, sign in enumerate(signs) if sign == 0)
    if not slides:
        rates = (pieces.in_region(structure.rates[n], signs) for n in names)
        return Motion(name_of_signs(signs), signs, tuple(map(without_cancellation, rates)), laws)
    return _Sliding(partition, signs, slides, laws).motion()


@lru_cache(maxsize=CONTACTS_KEPT)
def contacts_by_number(partition: Partition) -> Mapping[int, RestOnWall]:
    """Return the rest on each wall, by the numbers of walls after those of interfaces."""
    structure = partition.structure
    names = (*structure.states, *structure.slow_states)
    rates = [structure.rates[n] for n in names]
    found = contacts_of(structure.walls, names, rates, structure.forcing)
    return {len(partition.interfaces) + k: contact for k, contact in found.items()}


def rests_by_signs(partition: Partition) -> tuple[Rest, ...]:
    """Return the motions at rest of a restricted model."""
    structure, count = partition.structure, len(partition.interfaces)
    symbols = [real(n) for n in (*structure.states, *structure.slow_states)]
    found = []
    for signs in structure.formed:
        if len(signs) == count:
            continue
        motion = motion_by_signs(partition, signs)
        numbers = [j for j in range(count, len(signs)) if signs[j] == 0]
        contacts = [contacts_by_number(partition)[j] for j in numbers]
        speeds = [one.speed for one in contacts]
        entries = [[_rate_along(speed, one.push, symbols) for one in contacts] for speed in speeds]
        inverse = _inverse(entries)
        assert inverse is not None
        pushes = [
            tuple(
                cancelled(
                    sp.Add(
                        *(row[k] * one.push[i] for row, one in zip(inverse, contacts, strict=True))
                    )
                )
                for i in range(len(symbols))
            )
            for k in range(len(contacts))
        ]
        entry = [
            cancelled(z - sp.Add(*(p[i] * v for p, v in zip(pushes, speeds, strict=True))))
            for i, z in enumerate(symbols)
        ]
        walls = tuple(j - count for j in numbers)
        onto = on_walls(entry, [structure.walls[k] for k in walls], symbols)
        found.append(Rest(motion, walls, tuple(onto), tuple(speeds), tuple(pushes)))
    return tuple(found)


class _Sliding:
    """Derivation of sliding along some interfaces."""

    def __init__(
        self,
        partition: Partition,
        signs: Pattern,
        slides: tuple[int, ...],
        laws: tuple[sp.Expr, ...],
    ) -> None:
        structure = partition.structure
        assert partition.pieces is not None
        self.pieces, self.signs, self.slides, self.laws = partition.pieces, signs, slides, laws
        self.names = (*structure.states, *structure.slow_states)
        self.forcing = tuple(structure.forcing)
        self.written = [structure.rates[n] for n in self.names]
        self.weights = {j: sp.Dummy(f"s{j}", real=True) for j in slides}
        self.count = len(partition.interfaces)
        self.walls = [reset.wall for reset in structure.walls] if len(signs) > self.count else []
        known = contacts_by_number(partition) if self.walls else {}
        self.contacts = {j: known[j] for j in slides if j >= self.count}

    def motion(self) -> Motion:
        rates = [self._affine(e) for e in self.written]
        for j, contact in self.contacts.items():
            for i, push in enumerate(contact.push):
                rates[i] -= self.weights[j] * push
        base = [e.xreplace(dict.fromkeys(self.weights.values(), sp.S.Zero)) for e in rates]
        jumps = {j: self._jump(rates, weight) for j, weight in self.weights.items()}
        heights = {
            j: self.contacts[j].speed if j in self.contacts else self.pieces.interfaces[j].function
            for j in self.slides
        }
        laws = dict(zip(self.forcing, self.laws, strict=True))
        a = {j: drift(h, self.names, base, laws) for j, h in heights.items()}
        matrix = {
            (j, k): slope
            for j, h in heights.items()
            for k, jump in jumps.items()
            if (slope := _along(h, self.names, jump)) != 0
        }
        found: dict[int, tuple[sp.Expr, sp.Expr, sp.Expr]] = {}
        for group in _groups(self.slides, matrix):
            found |= self._solved(group, a, matrix)
        for j in self.contacts:
            # the acceleration without contact
            found[j] = (found[j][0], sp.S.NegativeOne, found[j][0])
        weights = {self.weights[j]: found[j][0] for j in self.slides}
        fixed = {
            place
            for h in heights.values()
            if (place := fixed_state(h, self.names, self.forcing)) is not None
        }
        return Motion(
            name_at_rest(self.signs, self.walls),
            self.signs[: self.count],
            tuple(
                sp.S.Zero if i in fixed else shortened(rate.xreplace(weights))
                for i, rate in enumerate(rates)
            ),
            self.laws,
            bounds=tuple(bound for j in self.slides for bound in found[j][1:]),
            weights=tuple(found[j][0] for j in self.slides),
        )

    def _affine(self, expression: sp.Expr) -> sp.Expr:
        """A rate with weights, in which it is affine."""
        values = {}
        for written in outermost(expression):
            number = self.pieces.numbers[written]
            parts = self.pieces.parts(number, self.pieces.pieces[number].own(self.signs))
            if parts is None:
                raise self._undecided("the rates are not a sum of one jump for each interface")
            values[written] = sp.Add(
                *(part * (1 if j is None else self.weights[j]) for j, part in parts.items())
            )
        replaced = expression.xreplace(values)
        own = replaced.free_symbols & set(self.weights.values())
        if any(replaced.diff(weight).free_symbols & own for weight in own):
            raise self._undecided("the rates are not a sum of one jump for each interface")
        return replaced

    def _jump(self, rates: Sequence[sp.Expr], weight: sp.Symbol) -> dict[str, sp.Expr]:
        """Derivatives of the rates by a weight, of the states whose rate depends on it."""
        return {
            name: rate.diff(weight)
            for name, rate in zip(self.names, rates, strict=True)
            if weight in rate.free_symbols
        }

    def _solved(
        self,
        group: tuple[int, ...],
        a: Mapping[int, sp.Expr],
        matrix: Mapping[tuple[int, int], sp.Expr],
    ) -> dict[int, tuple[sp.Expr, sp.Expr, sp.Expr]]:
        """Weight and bounds of the interfaces of a group."""
        if len(group) == 1:
            (j,) = group
            slope = matrix.get((j, j), sp.S.Zero)
            if slope == 0:
                raise self._undecided("the flow crosses it wherever it is transversal")
            # Lie derivatives on both sides
            return {j: (shortened(-a[j] / slope), shortened(a[j] + slope), shortened(a[j] - slope))}
        if len(group) > LARGEST_GROUP:
            raise self._undecided(f"more than {LARGEST_GROUP} interfaces depend on each other")
        entries = [[matrix.get((j, k), sp.S.Zero) for k in group] for j in group]
        inverse = _inverse(entries)
        if inverse is None:
            raise self._undecided("the matrix of the jumps of their Lie derivatives is singular")
        found = {}
        for i, j in enumerate(group):
            terms = (-inverse[i][k] * a[other] for k, other in enumerate(group))
            weight = sp.Add(*terms)
            own = inverse[i][i]
            bounds = (
                (weight - 1, weight + 1) if own == 0 else ((1 - weight) / own, (-1 - weight) / own)
            )
            found[j] = (weight, *bounds)
        return found

    def _undecided(self, why: str) -> ModelError:
        heights = (f"{i.name} = 0" for i in self.pieces.interfaces)
        names = " and ".join([*heights, *self.walls][j] for j in self.slides)
        return ModelError(f"no sliding motion is derived where {names}: {why}")


def _rate_along(
    function: sp.Expr, direction: Sequence[sp.Expr], symbols: Sequence[sp.Symbol]
) -> sp.Expr:
    pairs = zip(symbols, direction, strict=True)
    return cancelled(sp.Add(*(function.diff(z) * one for z, one in pairs if one != 0)))


def _along(function: sp.Expr, names: Sequence[str], jump: Mapping[str, sp.Expr]) -> sp.Expr:
    """The rate of change of a function along a jump of the rates."""
    slopes = ((function.diff(real(name)), rate) for name, rate in jump.items())
    return expanded(sp.Add(*(slope * rate for slope, rate in slopes if slope != 0)))


def _groups(
    slides: tuple[int, ...], matrix: Mapping[tuple[int, int], sp.Expr]
) -> Iterator[tuple[int, ...]]:
    """Interfaces that the matrix connects."""
    left = dict.fromkeys(slides)
    while left:
        first = next(iter(left))
        del left[first]
        group, pending = [first], [first]
        while pending:
            one = pending.pop()
            beside = [k for k in left if (one, k) in matrix or (k, one) in matrix]
            for k in beside:
                del left[k]
            group += beside
            pending += beside
        yield tuple(sorted(group))


def _inverse(entries: list[list[sp.Expr]]) -> list[list[sp.Expr]] | None:
    """The inverse of a matrix, by exact fractions in its symbols; None if it is singular."""
    matrix = DomainMatrix.from_Matrix(sp.Matrix(entries)).to_field()
    try:
        inverse = matrix.inv()
    except sp.polys.matrices.exceptions.DMNonInvertibleMatrixError:
        return None
    return [list(row) for row in inverse.to_Matrix().tolist()]
