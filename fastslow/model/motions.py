"""Smooth motions of a piecewise-smooth model: flows in regions, and Filippov sliding."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache, lru_cache
from itertools import product
from math import prod

import sympy as sp

from fastslow.errors import refuse_resets, refuse_switches
from fastslow.model.expansion import expanded, without_cancellation
from fastslow.model.interfaces import vanishes_on
from fastslow.model.motion import Motion, drift, drift_as_written, fixed_state, shortened
from fastslow.model.motions_by_signs import motion_by_signs, rests_by_signs
from fastslow.model.rational import exact
from fastslow.model.resets import refuse_clocks
from fastslow.model.rests import Rest, rests_of
from fastslow.model.structure import TIME, Partition, real
from fastslow.results.base.named_mapping import NamedMapping
from fastslow.results.stored.operations import AT_TWO_FOLD

#: Number of motions up to which sliding on one more interface at a time is derived: every
#: motion is compiled, and m contacts with dry friction have 3**m.
MOST_MOTIONS = 128

#: Number of partitions whose motions are cached.
PARTITIONS_KEPT = 256


@dataclass(frozen=True, eq=False)
class Motions:
    """All smooth motions of a model: regions, then sliding along one, two, … interfaces.

    Parameters
    ----------
    regions, sliding : tuple of Motion
    undecided : tuple of (str, str)
        Intersections of discontinuities for which no sliding motion is derived, with the reason.
    """

    regions: tuple[Motion, ...]
    sliding: tuple[Motion, ...]
    undecided: tuple[tuple[str, str], ...] = ()


def regions_of(partition: Partition) -> tuple[Motion, ...]:
    """Return the motion in every region of a model."""
    structure = partition.structure
    partition.require_all("an analysis of its motions")
    return tuple(
        Motion(
            region.name,
            tuple(region.signs[i] for i in partition.interfaces),
            tuple(
                without_cancellation(region.rates[n])
                for n in (*structure.states, *structure.slow_states)
            ),
            tuple(region.forcing[n] for n in structure.forcing),
            (number,),
        )
        for number, region in enumerate(partition.regions.values())
    )


@lru_cache(maxsize=PARTITIONS_KEPT)
def continuity(partition: Partition) -> NamedMapping[bool]:
    """Return the continuity of the rates across each interface, decided symbolically."""
    whole = partition.structure.continuous
    return NamedMapping(
        "interface", {name: whole or _continuous(partition, name) for name in partition.interfaces}
    )


def _continuous(partition: Partition, name: str) -> bool:
    if partition.pieces is not None:
        return partition.pieces.continuous([*partition.interfaces].index(name))
    function, regions = partition.interfaces[name].function, partition.regions.values()
    for one, other in product(regions, regions):
        differ = [i for i in partition.interfaces if one.signs[i] != other.signs[i]]
        if differ != [name] or one.signs[name] < 0:
            continue
        for state in one.rates:
            if not vanishes_on(one.rates[state] - other.rates[state], function):
                return False
    return True


@lru_cache(maxsize=PARTITIONS_KEPT)
def motions_of(
    partition: Partition,
    *,
    max_sliding: int | None = None,
    max_motions: int = MOST_MOTIONS,
    with_jumps: bool = False,
) -> Motions:
    """Derive the smooth motions of a model.

    Parameters
    ----------
    partition : Partition
        The regions of the model.
    max_sliding : int, optional
        Largest number of interfaces of one sliding motion.
    max_motions : int
        Number of motions beyond which sliding on more interfaces at once is not derived.
    with_jumps : bool
        Whether the caller treats resets and clocks; otherwise models with them are refused.

    Raises
    ------
    ModelError
        For a model with resets or clocks.

    Examples
    --------
    >>> from fastslow.model.model import Model
    >>> x, y, v = sp.symbols("x y v")
    >>> both = motions_of(Model({x: -sp.sign(x) + y, y: -2 * sp.sign(y)}).partition)
    >>> [m.name for m in both.sliding]
    ['S1|S3', 'S2|S4', 'S1|S2', 'S3|S4', 'S1|S4']
    >>> both.sliding[-1].weights
    (y, 0)

    A continuous interface, or one crossed at equal normal speeds, has no sliding motion:

    >>> motions_of(Model({x: -sp.Abs(x)}).partition).sliding
    ()
    """
    if not with_jumps:
        refuse_jumps(partition, "an analysis of its motions")
    if partition.structure.formed:
        return _formed_motions(partition)
    return _Derivation(partition, max_motions).motions(max_sliding)


def _formed_motions(partition: Partition) -> Motions:
    """Return the motions of a restricted model."""
    regions = regions_of(partition)
    numbers = {region.signs: k for k, region in enumerate(regions)}
    sliding = []
    for signs in partition.structure.formed:
        if 0 in signs and len(signs) == len(partition.interfaces):
            sides = (1, -1) if signs.count(0) == 1 else ()
            beside = (numbers.get(tuple(side if s == 0 else s for s in signs)) for side in sides)
            corners = tuple(k for k in beside if k is not None)
            sliding.append(replace(motion_by_signs(partition, signs), corners=corners))
    return Motions(regions, tuple(sliding))


def rests_in(partition: Partition) -> tuple[Rest, ...]:
    """Return the motions at rest on walls; of a restricted model those that are among its own."""
    structure = partition.structure
    if structure.formed:
        return rests_by_signs(partition)
    names = (*structure.states, *structure.slow_states)
    return rests_of(regions_of(partition), structure.walls, names, tuple(structure.forcing))


@lru_cache(maxsize=PARTITIONS_KEPT)
def two_folds_of(partition: Partition) -> tuple[Motion, ...]:
    """Return the motions at the two-folds of interfaces that are crossed at equal normal speeds.

    Without sliding, both vector fields are tangent where the normal speed vanishes. There a convex
    combination of both may be zero, an equilibrium in the sense of Filippov (1988). Its weight is
    determined by one rate that jumps, and the other rates are those with this weight.

    Examples
    --------
    >>> from fastslow.model.model import Model
    >>> x, v = sp.symbols("x v")
    >>> (relay,) = two_folds_of(Model({x: v, v: -sp.sign(x) - v / 5}).partition)
    >>> relay.name, relay.weights, relay.rates
    ('S1|S2 (two-fold)', (-v/5,), (v, 0))
    """
    return _Derivation(partition, MOST_MOTIONS).two_folds()


def refuse_jumps(partition: Partition, task: str) -> None:
    """Raise ModelError for a model with resets or clocks; ``task`` is the subject of a sentence."""
    structure = partition.structure
    refuse_resets([r.name for r in structure.resets], task)
    refuse_switches(structure.switch_names, task)
    heights = (i.function for i in partition.interfaces.values())
    refuse_clocks([*structure.rates.values(), *structure.forcing.values(), *heights], task)


class _Derivation:
    """Derivation of the sliding motions of one model from the sign patterns of its regions."""

    def __init__(self, partition: Partition, most: int) -> None:
        structure = partition.structure
        self.names, self.forcing = (*structure.states, *structure.slow_states), structure.forcing
        self.continuous, self.most = continuity(partition), most
        self.functions = tuple(i.function for i in partition.interfaces.values())
        self.regions = regions_of(partition)
        self.numbers = {region.signs: k for k, region in enumerate(self.regions)}
        self.undecided: list[tuple[str, str]] = []
        # of many regions most rates are the same
        self._expanded, self._short = cache(expanded), cache(shortened)

    def motions(self, max_sliding: int | None) -> Motions:
        jumping = [j for j, name in enumerate(self.continuous) if self._jumps(j, name)]
        sliding: list[Motion] = []
        together: list[tuple[int, ...]] = [(j,) for j in jumping]
        for m in range(1, min(len(jumping), max_sliding or len(jumping)) + 1):
            faces = [
                (along, corners) for along in together for corners in self._adjacent_regions(along)
            ]
            if m > 1 and len(self.regions) + len(sliding) + len(faces) > self.most:
                why = f"more than {self.most} smooth motions; {m} interfaces at once are too many"
                self.undecided.append((f"{m} of {len(jumping)} interfaces", why))
                break
            sliding += [s for face in faces if (s := self._slide(*face)) is not None]
            # interfaces intersect only where any of them but one do
            meeting = dict.fromkeys(along for along, _ in faces)
            together = [
                (*along, j)
                for along in meeting
                for j in jumping
                if j > along[-1]
                and all((*along[:k], *along[k + 1 :], j) in meeting for k in range(m))
            ]
        return Motions(self.regions, tuple(sliding), tuple(self.undecided))

    def _jumps(self, j: int, name: str) -> bool:
        """Check whether any rate may jump across an interface."""
        pairs = list(self._adjacent_regions((j,)))
        alike = all(
            self.regions[a].rates == self.regions[b].rates
            and self.regions[a].laws == self.regions[b].laws
            for a, b in pairs
        )
        return bool(pairs) and not alike and not self.continuous[name]

    def _adjacent_regions(self, along: tuple[int, ...]) -> Iterator[tuple[int, ...]]:
        """Yield the regions adjacent to each intersection of some interfaces, + before −."""
        for signs in self.numbers:
            if all(signs[j] > 0 for j in along):
                corners = []
                for side in product((1, -1), repeat=len(along)):
                    corner = list(signs)
                    for j, s in zip(along, side, strict=True):
                        corner[j] = s
                    corners.append(self.numbers.get(tuple(corner)))
                if None not in corners:
                    yield tuple(k for k in corners if k is not None)

    def _slide(self, along: tuple[int, ...], corners: tuple[int, ...]) -> Motion | None:
        if len(along) == 1:
            return self._along_one(along[0], corners)
        return self._along_several(along, corners)

    def _drift(self, j: int, rates: Sequence[sp.Expr], laws: Sequence[sp.Expr]) -> sp.Expr:
        by_name = dict(zip(self.forcing, laws, strict=True))
        return self._expanded(drift_as_written(self.functions[j], self.names, rates, by_name))

    def _along_one(self, j: int, corners: tuple[int, ...]) -> Motion | None:
        """Filippov's convex combination (1 − α) f₁ + α f₂ with α = a/(a − b)."""
        above, below = (self.regions[k] for k in corners)
        a, b = (self._drift(j, side.rates, side.laws) for side in (above, below))
        if _vanishes(a - b, [self.functions[j]]):
            # the flow crosses wherever it is transversal to the interface
            return None
        share = self._short(a / (a - b))
        rates = [
            f if f == g else self._short(f + share * (g - f))
            for f, g in zip(above.rates, below.rates, strict=True)
        ]
        return self._sliding((j,), corners, rates, (a, b), (self._short(1 - 2 * share),))

    def two_folds(self) -> tuple[Motion, ...]:
        """Return the motions at two-folds; see `two_folds_of`."""
        found = (
            self._at_two_fold(j, corners)
            for j, name in enumerate(self.continuous)
            if self._jumps(j, name)
            for corners in self._adjacent_regions((j,))
        )
        return tuple(motion for motion in found if motion is not None)

    def _at_two_fold(self, j: int, corners: tuple[int, ...]) -> Motion | None:
        height = [exact(self.functions[j])]
        above, below = (self.regions[k] for k in corners)
        a, b = (exact(self._drift(j, side.rates, side.laws)) for side in (above, below))
        pairs = [(exact(f), exact(g)) for f, g in zip(above.rates, below.rates, strict=True)]
        jumps = [expanded(f - g) / 2 for f, g in pairs]
        means = [expanded(f + g) / 2 for f, g in pairs]
        moving = [k for k, jump in enumerate(jumps) if not _vanishes(jump, height)]
        if not _vanishes(a - b, height) or not moving:
            return None
        # where the jump of this rate vanishes the others are not balanced: one that is constant
        first = min(moving, key=lambda k: len(jumps[k].free_symbols & set(map(real, self.names))))
        weight = shortened(-means[first] / jumps[first])
        rates = [shortened(m + weight * jump) for m, jump in zip(means, jumps, strict=True)]
        rates[first] = sp.Integer(0)
        signs = tuple(0 if k == j else sign for k, sign in enumerate(above.signs))
        name = f"{above.name}|{below.name}{AT_TWO_FOLD}"
        return Motion(name, signs, tuple(rates), above.laws, corners, (a, b), (weight,))

    def _along_several(self, along: tuple[int, ...], corners: tuple[int, ...]) -> Motion | None:
        """The rates f₀ + Σ bᵢ sᵢ with the weights that keep every hᵢ, by Cramer's rule."""
        count = len(along)
        sides = list(product((1, -1), repeat=count))
        # sums of floats vanish to rounding only, those of the decimal numbers written exactly
        heights = [exact(self.functions[j]) for j in along]
        values = [
            [exact(e) for e in (*self.regions[k].rates, *self.regions[k].laws)] for k in corners
        ]
        parts: dict[tuple[int, ...], list[sp.Expr]] = {}
        for used in product((0, 1), repeat=count):
            factors = [prod(s for s, u in zip(side, used, strict=True) if u) for side in sides]
            columns = zip(*values, strict=True)
            parts[used] = [_mean(factors, column) for column in columns]
        mixed = [part for used, part in parts.items() if sum(used) > 1]
        if not all(_vanishes(e, heights) for part in mixed for e in part):
            self._undecided(along, "the rates are not a sum of one jump for each interface")
            return None
        units = [tuple(int(i == k) for i in range(count)) for k in range(count)]
        n = len(self.names)
        base, laws = parts[(0,) * count][:n], self.regions[corners[0]].laws
        jumps = [parts[unit][:n] for unit in units]
        a = sp.Matrix([exact(self._drift(j, base, laws)) for j in along])
        matrix = sp.Matrix(
            [[drift(h.subs(TIME, 0), self.names, b) for b in jumps] for h in heights]
        )
        whole = _determinant(matrix)
        if _vanishes(whole, heights):
            self._undecided(along, "the matrix of the jumps of their Lie derivatives is singular")
            return None
        weights, bounds = [], []
        for i in range(count):
            replaced = matrix.copy()
            replaced[:, i] = -a
            share = _determinant(replaced)
            others = [k for k in range(count) if k != i]
            minor = _determinant(matrix.extract(others, others))
            over = 1 if _vanishes(minor, heights) else minor
            weights.append(shortened(share / whole))
            if over == 1:
                bounds += [shortened(share / whole - 1), shortened(share / whole + 1)]
            else:
                bounds += [shortened((whole - share) / over), shortened((-whole - share) / over)]
        rates = [
            shortened(sp.Add(f, *(b[k] * s for b, s in zip(jumps, weights, strict=True))))
            for k, f in enumerate(base)
        ]
        return self._sliding(along, corners, rates, tuple(bounds), tuple(weights))

    def _undecided(self, along: tuple[int, ...], why: str) -> None:
        names = list(self.continuous)
        entry = (" and ".join(f"{names[j]} = 0" for j in along), why)
        if entry not in self.undecided:
            self.undecided.append(entry)

    def _sliding(
        self,
        along: tuple[int, ...],
        corners: tuple[int, ...],
        rates: list[sp.Expr],
        bounds: tuple[sp.Expr, ...],
        weights: tuple[sp.Expr, ...],
    ) -> Motion:
        first, last = self.regions[corners[0]], self.regions[corners[-1]]
        for j in along:
            fixed = fixed_state(self.functions[j], self.names, self.forcing)
            if fixed is not None:
                # the interface fixes one state, whose rate is zero
                rates[fixed] = sp.Integer(0)
        signs = tuple(0 if j in along else sign for j, sign in enumerate(first.signs))
        name = f"{first.name}|{last.name}"
        return Motion(name, signs, tuple(rates), first.laws, corners, bounds, weights)


def _mean(factors: Sequence[int], values: Sequence[sp.Expr]) -> sp.Expr:
    first = values[0]
    if all(value == first for value in values):
        return first if all(f == 1 for f in factors) else sp.Integer(0)
    total = sp.Add(*(f * v for f, v in zip(factors, values, strict=True)))
    total = total / len(values)
    return expanded(total)


def _vanishes(expression: sp.Expr, heights: Sequence[sp.Expr]) -> bool:
    """Check that an expression vanishes where some functions do, each solved for one symbol."""
    expression = expanded(expression)
    if expression == 0:
        return True
    left = list(heights)
    while len(left) > 1 and (solved := _solved(left)) is not None:
        number, symbol, root = solved
        del left[number]
        expression = expression.subs(symbol, root)
        left = [h.subs(symbol, root) for h in left]
    return any(vanishes_on(expression, height) for height in left)


def _solved(heights: Sequence[sp.Expr]) -> tuple[int, sp.Symbol, sp.Expr] | None:
    """The first function that is affine in a symbol: its index, the symbol, and its root."""
    for number, height in enumerate(heights):
        for symbol in sorted(height.free_symbols, key=lambda s: s.name):
            slope = height.diff(symbol)
            if slope != 0 and symbol not in slope.free_symbols:
                return number, symbol, expanded(symbol - height / slope)
    return None


def _determinant(matrix: sp.Matrix) -> sp.Expr:
    if matrix.is_diagonal() or matrix.is_upper or matrix.is_lower:
        return sp.Mul(*matrix.diagonal())
    value = matrix.det(method="berkowitz")
    return expanded(value)
