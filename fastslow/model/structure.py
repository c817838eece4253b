"""The symbolic structure of a model, independent of its parameter values."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache, partial
from itertools import product
from typing import Any
from weakref import WeakValueDictionary

import numpy as np
import sympy as sp
from numpy.typing import NDArray
from sympy.logic.boolalg import Boolean

from fastslow.errors import ModelError
from fastslow.formulas.grammar import normalised
from fastslow.model.clocks import ClockFunction
from fastslow.model.events import Event, expressions_of, with_changed
from fastslow.model.expansion import expanded
from fastslow.model.interfaces import Interface, Region
from fastslow.model.keyed import Keyed
from fastslow.model.pieces import Pieces
from fastslow.model.rational import exact
from fastslow.model.reading import (
    factorise,
    signs_of_factors,
    smooth,
    switching_expressions,
)
from fastslow.model.regions_by_signs import RegionsBySigns
from fastslow.model.resets import Reset
from fastslow.model.switches import Switch
from fastslow.results.base.named_mapping import NamedMapping
from fastslow.results.stored.sign_names import name_of_signs
from fastslow.results.stored.sign_patterns import (
    MOST_REGIONS,
    Pattern,
    fewest_patterns,
    possible_patterns,
    scaled_row,
)

TIME = sp.Symbol("t", real=True)

Cell = frozenset[tuple[sp.Expr, int]]
Values = Mapping[sp.Symbol, float]


@lru_cache(maxsize=4096)
def real(name: str) -> sp.Symbol:
    """Return the real symbol with a name, as used in all expressions of models."""
    return sp.Symbol(normalised(name), real=True)


def exact_values(
    values: Mapping[str, float], without: Collection[str | None] = ()
) -> dict[sp.Symbol, sp.Rational]:
    """Return the exact values of parameters, which are decimals, except those without one."""
    return {real(name): exact(value) for name, value in values.items() if name not in without}


#: Number of regions up to which they are named by numbers, beyond it by their signs.
MOST_NUMBERED = 64

#: Numbers of cached partitions and frozen structures.
PARTITIONS, FROZEN = 256, 64


@dataclass(frozen=True)
class Partition:
    """The interfaces and regions of a model at some parameter values, without these values.

    Parameters
    ----------
    structure : Structure
        Includes the names of these regions.
    interfaces : NamedMapping of Interface
    regions : NamedMapping of Region
        Of a model with more than `MOST_REGIONS`, those that are asked for.
    pieces : Pieces, optional
        Of such a model, from which its motions are formed.
    """

    structure: Structure
    interfaces: NamedMapping[Interface]
    regions: NamedMapping[Region]
    pieces: Pieces | None = None

    @property
    def content(self) -> tuple[Any, ...]:
        """Content by which partitions are compared."""
        own = () if self.pieces is None else self.pieces.pieces
        some = () if isinstance(self.regions, RegionsBySigns) else tuple(self.regions.items())
        return (self.structure, tuple(self.interfaces.items()), some, own)

    @cached_property
    def _hash(self) -> int:
        return hash((self.structure, tuple(self.interfaces)))

    def require_all(self, what: str) -> None:
        """Raise ModelError if the regions are too many to form them all."""
        if isinstance(self.regions, RegionsBySigns):
            raise ModelError(f"{what} needs all regions: {self.regions.too_many}")

    def __hash__(self) -> int:
        return self._hash

    def __getstate__(self) -> dict[str, Any]:
        return fields_to_pickle(self)


def fields_to_pickle(one: Any) -> dict[str, Any]:
    """Return the fields to pickle, without cached values: hashes differ between processes."""
    return {n: v for n, v in one.__dict__.items() if n in one.__dataclass_fields__}


@dataclass(frozen=True, eq=False)
class Structure:
    """Equations with their interfaces, and the names assigned to regions so far.

    ``continuous`` is True if the rates are continuous by the way they are written;
    otherwise continuity is decided from the regions on both sides of an interface.
    ``formed`` are the signs of the regions, sliding motions and rests of a restricted model, which
    has no others; empty for all. Those of rests are followed by the signs of the walls.
    Structures are equal when all fields are, including order.
    """

    states: tuple[str, ...]
    slow_states: tuple[str, ...]
    rates: NamedMapping[sp.Expr]
    forcing: NamedMapping[sp.Expr]
    free: tuple[str, ...]
    interfaces: tuple[Interface, ...]
    given: frozenset[str]
    conditions: NamedMapping[Boolean]
    names: tuple[tuple[Cell, str], ...] = ()
    path: NamedMapping[sp.Expr] = field(default_factory=partial(NamedMapping, "slow quantity"))
    periodic: NamedMapping[sp.Expr] = field(default_factory=partial(NamedMapping, "periodic state"))
    continuous: bool = False
    resets: tuple[Reset, ...] = ()
    switches: tuple[Switch, ...] = ()
    events: NamedMapping[Event] = field(default_factory=partial(NamedMapping, "event"))
    definitions: NamedMapping[sp.Expr] = field(default_factory=partial(NamedMapping, "definition"))
    formed: tuple[Pattern, ...] = ()

    @cached_property
    def content(self) -> tuple[Any, ...]:
        """Content by which structures are compared."""
        mappings = (self.rates, self.forcing, self.conditions, self.path, self.periodic)
        return (
            self.states,
            self.slow_states,
            self.free,
            self.interfaces,
            self.given,
            self.names,
            self.continuous,
            self.formed,
            tuple((r.name, r.function, tuple(r.jump.items())) for r in self.resets),
            self.switches,
            tuple((n, e.content) for n, e in self.events.items()),
            *(tuple(one.items()) for one in (*mappings, self.definitions)),
        )

    @cached_property
    def _hash(self) -> int:
        return hash(self.content)

    def __hash__(self) -> int:
        return self._hash

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Structure):
            return NotImplemented
        return self is other or (self._hash == other._hash and self.content == other.content)

    def __getstate__(self) -> dict[str, Any]:
        return fields_to_pickle(self)

    @cached_property
    def lengths(self) -> NamedMapping[float]:
        """The periods as numbers."""
        return NamedMapping("periodic state", {n: float(p) for n, p in self.periodic.items()})

    @cached_property
    def moving(self) -> tuple[sp.Symbol, ...]:
        """Symbols that change along a solution or have no value."""
        names = (*self.states, *self.slow_states, *self.forcing, *self.switch_names, *self.free)
        return (*(real(n) for n in dict.fromkeys((*names, *self.assigned))), TIME)

    @cached_property
    def definition_texts(self) -> dict[str, str]:
        """The definitions as text."""
        return {name: str(expression) for name, expression in self.definitions.items()}

    @cached_property
    def assigned(self) -> tuple[str, ...]:
        """Names of the parameters that events assign."""
        states = {*self.states, *self.slow_states}
        targets = dict.fromkeys(n for event in self.events.values() for n in event.then)
        return tuple(n for n in targets if n not in states)

    @cached_property
    def walls(self) -> tuple[Reset, ...]:
        """The resets at walls, which are before those at instants of time."""
        return tuple(reset for reset in self.resets if reset.clock is None)

    @cached_property
    def switch_names(self) -> tuple[str, ...]:
        """Names of the switches."""
        return tuple(switch.name for switch in self.switches)

    @cached_property
    def deciding(self) -> tuple[str, ...]:
        """Names of all symbols whose values determine which regions exist."""
        used = set().union(*(i.function.free_symbols for i in self.interfaces))
        used |= set().union(*(c.free_symbols for c in self.conditions.values()))
        for expression in (*self.rates.values(), *self.forcing.values()):
            for piecewise in expression.atoms(sp.Piecewise):
                used |= set().union(*(c.free_symbols for _, c in piecewise.args))
        return tuple(sorted(s.name for s in used))

    @cached_property
    def sloping(self) -> tuple[str, ...]:
        """Names of all symbols in the slopes of the interfaces."""
        slopes = (i.function.diff(z) for i in self.interfaces for z in self.moving)
        return tuple(sorted({s.name for slope in slopes for s in slope.free_symbols}))

    @cached_property
    def written(self) -> tuple[sp.Expr, ...]:
        """All expressions that may depend on time: laws, rates, resets, switches and events."""
        resets = (e for reset in self.resets for e in reset.expressions)
        switches = (e for switch in self.switches for e in switch.expressions)
        events = (e for event in self.events.values() for e in expressions_of(event))
        return (*self.forcing.values(), *self.rates.values(), *resets, *switches, *events)

    @cached_property
    def timed(self) -> tuple[str, ...]:
        """Names of all symbols in time-dependent rates and laws."""
        written = (e.free_symbols for e in self.written)
        return tuple(sorted({s.name for symbols in written if TIME in symbols for s in symbols}))

    def partition(self, values: Mapping[str, float]) -> Partition:
        """Return the interfaces and regions at parameter values, cached by the deciding ones."""
        known = [(n, values[n]) for n in self.deciding if n in values and n not in self.assigned]
        return _partition(self, tuple(known))

    @cached_property
    def scales(self) -> tuple[sp.Expr, ...]:
        """Factors of switching expressions in parameters alone, on whose signs branches depend."""
        found = (factorise(s, self.moving).scales for s in self._switching)
        return tuple(dict.fromkeys(factor for scales in found for factor, _ in scales))

    def freed(self, name: str, values: Mapping[str, float]) -> Structure:
        """Return the structure with one more free parameter.

        Where a branch depends on the sign of an expression in the parameter, its zero set becomes
        an interface. The regions at the given values keep their names.
        """
        free = replace(self, free=(*self.free, name))
        found = (
            factor
            for scale in self.scales
            if real(name) in scale.free_symbols
            for factor, _ in factorise(scale, free.moving).factors
        )
        known = {i.function for i in self.interfaces}
        added = [Interface(str(f), f) for f in dict.fromkeys(found) if f not in known]
        numbers = {real(n): value for n, value in values.items()}
        sides = {(i.function, s) for i in added if (s := _sign(i.function.subs(numbers)))}
        names = tuple((cell | sides, region) for cell, region in self.names)
        here = tuple(_sign(i.function.subs(numbers)) or 1 for i in added)
        count = len(self.interfaces)
        formed = tuple((*f[:count], *here, *f[count:]) for f in self.formed)
        return replace(free, interfaces=(*self.interfaces, *added), names=names, formed=formed)

    @cached_property
    def _branching(self) -> tuple[sp.Expr, ...]:
        """All expressions whose branches are regions."""
        conditions = map(_indicator, self.conditions.values())
        return (*self.rates.values(), *self.forcing.values(), *conditions)

    @cached_property
    def _switching(self) -> tuple[sp.Expr, ...]:
        """The functions of the interfaces, and all expressions whose signs select branches."""
        switching = [s for written in self._branching for s in switching_expressions(written)]
        return (*(i.function for i in self.interfaces), *switching)

    @cached_property
    def _constants(self) -> tuple[sp.Expr, ...]:
        """Parts of switching expressions in parameters alone that are not finite everywhere."""
        moving = {*self.moving}
        parts = {
            part
            for switching in self._switching
            for part in sp.preorder_traversal(switching)
            if isinstance(part, (sp.Pow, sp.Function))
            and part.free_symbols
            and not part.free_symbols & moving
        }
        return tuple(sorted(parts, key=sp.default_sort_key))

    def check_finite(self, values: Values) -> None:
        """Check that the expressions whose signs select regions are finite and real.

        Raises
        ------
        ModelError
            If one that selects a region at these parameter values is not.
        """
        wrong = [c for c in self._constants if _undefined(c.subs(values))]
        if wrong and any(_undefined_at(written, values) for written in self._branching):
            used = sorted(s.name for s in wrong[0].free_symbols if s in values)
            where = ", ".join(f"{name} = {values[real(name)]:g}" for name in used)
            raise ModelError(
                f"{wrong[0]}, on which the regions depend, is not finite and real at {where}; "
                "expected parameter values at which it is"
            )

    def patterns(self, values: Values) -> tuple[Pattern, ...]:
        """Return the nonempty sign patterns of the interfaces at parameter values."""
        used = set().union(*(i.function.free_symbols for i in self.interfaces))
        deciding = [q for n in self.switch_names if (q := real(n)) in used]
        found = {
            pattern
            for states in product((0.0, 1.0), repeat=len(deciding))
            for pattern in self._patterns({**values, **dict(zip(deciding, states, strict=True))})
        }
        return tuple(sorted(found, reverse=True))

    def _patterns(self, values: Values) -> Sequence[Pattern]:
        return possible_patterns(self.rows(values))

    def rows(self, values: Values) -> list[NDArray[np.float64] | None]:
        """Return slopes and constant of every interface at parameter values, None if not affine."""
        loose = [z for z in self.moving if z not in values]
        rows: list[NDArray[np.float64] | None] = []
        for interface, row in zip(self.interfaces, _rows(self, tuple(values)), strict=True):
            try:
                found = None if row is None else scaled_row(row(*values.values()))
            except (ArithmeticError, ValueError, TypeError, NameError):
                # a value outside the domain, or a function that only SymPy evaluates
                found = None
            if found is None:
                rows.append(_affine_row(interface.function.subs(values), loose))
            else:
                rows.append(found)
        return rows

    def count(self, values: Values) -> tuple[int, bool]:
        """Return a number of regions that is not too large, and whether it is their number."""
        if 2 ** len(self.interfaces) <= MOST_REGIONS or self.conditions:
            return 0, False
        return fewest_patterns(self.rows(values))

    def partition_by_signs(self, values: Values) -> Partition:
        """Return a partition whose regions are formed from pieces, by their signs."""
        expressions = (*self.rates.values(), *self.forcing.values())
        pieces = Pieces.of(expressions, self.interfaces, self.moving, self.rows(values), values)
        interfaces = NamedMapping("interface", {i.name: i for i in self.interfaces})

        def form(signs: Pattern) -> Region | None:
            if not self.formed and not pieces.possible(signs):
                return None
            return Region(
                name_of_signs(signs),
                NamedMapping("interface", zip(interfaces, signs, strict=True)),
                tuple(self._condition(i, s) for i, s in zip(self.interfaces, signs, strict=True)),
                NamedMapping(
                    "state", {n: pieces.in_region(e, signs) for n, e in self.rates.items()}
                ),
                NamedMapping(
                    "slow quantity",
                    {n: pieces.in_region(e, signs) for n, e in self.forcing.items()},
                ),
            )

        regions: NamedMapping[Region]
        if self.formed:
            whole = (f for f in self.formed if len(f) == len(self.interfaces))
            some = (form(signs) for signs in whole if 0 not in signs)
            regions = NamedMapping("region", {r.name: r for r in some if r is not None})
        else:
            count, exact = self.count(values)
            regions = RegionsBySigns(form, len(self.interfaces), count, exact=exact)
        return _interned_partition(Partition(self, interfaces, regions, pieces))

    def partition_of(self, patterns: Sequence[Pattern], values: Values) -> Partition:
        """Return the interfaces and regions of sign patterns; values give the signs of `scales`."""
        functions = [i.function for i in self.interfaces]
        contents = {p: self._contents(functions, p, values) for p in patterns}
        keep = [
            j
            for j, interface in enumerate(self.interfaces)
            if interface.name in self.given or not _redundant(j, contents)
        ]
        interfaces = tuple(self.interfaces[j] for j in keep)
        cells: dict[Pattern, dict[str, sp.Expr]] = {}
        whole: dict[Pattern, list[Cell]] = {}
        for pattern in patterns:
            kept = tuple(pattern[j] for j in keep)
            cells[kept] = contents[pattern]
            whole.setdefault(kept, []).append(_cell(self.interfaces, pattern))
        named = self._named(interfaces, whole, values)
        regions = tuple(
            Region(
                name,
                NamedMapping("interface", zip((i.name for i in interfaces), pattern, strict=True)),
                tuple(self._condition(i, s) for i, s in zip(interfaces, pattern, strict=True)),
                NamedMapping("state", {n: cells[pattern][n] for n in self.rates}),
                NamedMapping("slow quantity", {n: cells[pattern][n] for n in self.forcing}),
            )
            for pattern, name in named.items()
        )
        cells_named = {_cell(interfaces, pattern): name for pattern, name in named.items()}
        names = tuple({**dict(self.names), **cells_named}.items())
        return _interned_partition(
            Partition(
                self if names == self.names else interned(replace(self, names=names)),
                NamedMapping("interface", {i.name: i for i in interfaces}),
                NamedMapping("region", {r.name: r for r in regions}),
            )
        )

    def _condition(self, interface: Interface, sign: int) -> sp.Rel:
        """The condition of one side of an interface: a state of a switch, or an inequality."""
        for switch in map(real, self.switch_names):
            if interface.function.free_symbols == {switch}:
                on = bool(interface.function.subs(switch, 1) * sign > 0)
                return sp.Eq(switch, int(on), evaluate=False)
        return _inequality(interface, sign)

    def _contents(
        self, functions: Sequence[sp.Expr], pattern: Pattern, values: Values
    ) -> dict[str, sp.Expr]:
        signs = signs_of_factors(zip(functions, pattern, strict=True), self.moving, values)
        written = {**self.rates, **self.forcing}
        return {n: smooth(e, signs, self.moving, values) for n, e in written.items()}

    def _named(
        self,
        interfaces: Sequence[Interface],
        patterns: Mapping[Pattern, list[Cell]],
        values: Values,
    ) -> dict[Pattern, str]:
        """Name of each pattern: given by the user, assigned before, or the next free number.

        Of many regions its signs take the place of a number.
        """
        named: dict[Pattern, str] = {}
        for pattern, whole in patterns.items():
            signs = signs_of_factors(_cell(interfaces, pattern), self.moving, values)
            asked = []
            for region, condition in self.conditions.items():
                try:
                    if smooth(_indicator(condition), signs, self.moving, values) == 1:
                        asked.append(region)
                except ModelError as error:
                    raise ModelError(
                        f"region {region!r} ({condition}): {error}; regions are bounded by "
                        f"interfaces: {', '.join(i.name for i in interfaces) or 'none'}"
                    ) from error
            if len(asked) > 1:
                raise ModelError(
                    f"regions {asked[0]!r} and {asked[1]!r} overlap; expected one condition "
                    "for each region"
                )
            kept = next((n for c, n in self.names if any(c <= w for w in whole)), None)
            name = asked[0] if asked else kept
            if name is not None and name not in named.values():
                named[pattern] = name
            elif asked:
                raise ModelError(
                    f"region {name!r} ({self.conditions[asked[0]]}) contains more than one sign "
                    "pattern of the interfaces; expected one condition for each region"
                )
        known = {name for _, name in self.names}
        unused = set(self.conditions) - set(named.values()) - known
        if unused:
            name = min(unused)
            raise ModelError(f"region {name!r} ({self.conditions[name]}) is empty or unknown")
        taken = {*named.values(), *known}
        number, by_signs = 0, len(patterns) > MOST_NUMBERED
        for pattern in patterns:
            name = name_of_signs(pattern)
            if pattern not in named and by_signs and 0 not in pattern and name not in taken:
                named[pattern] = name
            elif pattern not in named:
                number += 1
                while f"S{number}" in taken:
                    number += 1
                named[pattern] = f"S{number}"
        return {pattern: named[pattern] for pattern in patterns}

    def frozen(
        self, path: Mapping[str, sp.Expr], values: Mapping[str, float], fast: Sequence[str] = ()
    ) -> tuple[Structure, dict[str, float]]:
        """Return the fast structure with free slow quantities, and the values it still uses.

        The forcings in ``fast`` remain functions of time.
        """
        structure, used = _frozen(self, tuple(path.items()), tuple(values), tuple(fast))
        return structure, {n: v for n, v in values.items() if n in used}

    def with_fast(self, names: Sequence[str]) -> Structure:
        """Return the structure with some of the slow states as states."""
        slow = tuple(n for n in self.slow_states if n not in names)
        return interned(replace(self, states=(*self.states, *names), slow_states=slow))

    def with_slow(self, names: Sequence[str]) -> Structure:
        """Return the structure with some of the states as slow states."""
        states = tuple(n for n in self.states if n not in names)
        return interned(replace(self, states=states, slow_states=(*self.slow_states, *names)))

    def _frozen(
        self, path: Mapping[str, sp.Expr], values: Sequence[str], fast: Sequence[str]
    ) -> tuple[Structure, frozenset[str]]:
        along = {real(name): law for name, law in path.items()}
        rates = {n: self.rates[n].xreplace(along) for n in self.states}
        known = {*map(real, values), *map(real, self.states)}
        kept = {n: law for n, law in self.forcing.items() if n in fast}
        slow = (n for n in (*self.forcing, *self.slow_states, *self.free) if n not in kept)
        left = [n for n in slow if n not in path]
        fresh: list[str] = []
        for law in path.values():
            for symbol in sorted(law.free_symbols - known, key=lambda s: s.name):
                if symbol.name not in (*fresh, *left):
                    fresh.append(symbol.name)
        free = (*fresh, *left)
        timed = self._timed_interfaces((*rates.values(), *kept.values())) if fast else ()
        interfaces = tuple(
            replace(i, function=i.function.xreplace(along))
            for i in self.interfaces
            if TIME not in i.function.free_symbols or i.function in timed
        )
        used = set().union(*(e.free_symbols for e in (*rates.values(), *kept.values())))
        used |= set().union(set(), *(i.function.free_symbols for i in interfaces))
        used |= set().union(set(), *(c.free_symbols for c in self.conditions.values()))
        resets = tuple(r.replaced(lambda e: e.xreplace(along)) for r in self.resets)
        switches = tuple(s.replaced(lambda e: e.xreplace(along)) for s in self.switches)
        for name, event in self.events.items():
            for target in event.then:
                if target in path:
                    raise ModelError(
                        f"event {name} assigns {target}, which slow= replaces by {path[target]}; "
                        "freeze it without a path"
                    )
        events = {n: with_changed(e, lambda v: v.xreplace(along)) for n, e in self.events.items()}
        # what depends on time is known along runs alone
        named = {n: e.xreplace(along) for n, e in self.definitions.items()}
        named = {n: e for n, e in named.items() if TIME not in e.free_symbols or fast}
        used |= set().union(*(e.free_symbols for e in named.values()))
        used |= {real(n) for n in self.assigned}
        used |= set().union(*(e.free_symbols for v in events.values() for e in expressions_of(v)))
        used |= set().union(set(), *(e.free_symbols for r in resets for e in r.expressions))
        used |= set().union(set(), *(e.free_symbols for s in switches for e in s.expressions))
        names = (*self.states, *free, *kept, *self.switch_names)
        moving = (*map(real, names), *([TIME] if timed else []))
        left_over = tuple(i for i in interfaces if i.function.free_symbols & set(moving))
        interfaces = left_over if path else interfaces
        numbers = [
            k for k, i in enumerate(self.interfaces) if i.name in {j.name for j in interfaces}
        ]
        structure = replace(
            self,
            slow_states=(),
            resets=resets,
            switches=switches,
            events=NamedMapping("event", events),
            definitions=NamedMapping("definition", named),
            rates=NamedMapping("state", rates),
            forcing=NamedMapping("slow quantity", kept),
            free=free,
            path=NamedMapping("slow quantity", {**self.path, **path}),
            interfaces=interfaces,
            formed=tuple(
                dict.fromkeys(
                    (*(f[k] for k in numbers), *f[len(self.interfaces) :]) for f in self.formed
                )
            ),
            names=tuple(
                {
                    frozenset(
                        (h.xreplace(along), s)
                        for h, s in cell
                        if TIME not in h.free_symbols or h in timed
                    ): n
                    for cell, n in reversed(self.names)
                }.items()
            ),
        )
        return interned(structure), frozenset(s.name for s in used)

    def with_switches(self, values: Mapping[str, int]) -> Structure:
        """Return the structure with some switches in constant states."""
        fixed = {real(name): sp.Integer(value) for name, value in values.items()}

        def change(expression: Any) -> Any:
            return expression.xreplace(fixed)

        kept = tuple(s.replaced(change) for s in self.switches if s.name not in values)
        names = (*self.states, *self.slow_states, *self.forcing, *self.free)
        moving = {*map(real, names), *(real(s.name) for s in kept), TIME}
        interfaces: dict[sp.Expr, Interface] = {}
        for one in self.interfaces:
            function = change(one.function)
            if function.free_symbols & moving:
                interfaces.setdefault(function, replace(one, function=function))
        cells: dict[Cell, str] = {}
        for cell, name in self.names:
            changed = [(change(h), sign) for h, sign in cell]
            inside = [(h, sign) for h, sign in changed if h in interfaces]
            constant = [(h, sign) for h, sign in changed if h not in interfaces]
            if all(not h.is_number or h * sign > 0 for h, sign in constant):
                cells.setdefault(frozenset(inside), name)
        return interned(
            replace(
                self,
                rates=NamedMapping("state", {n: change(e) for n, e in self.rates.items()}),
                interfaces=tuple(interfaces.values()),
                given=self.given & {one.name for one in interfaces.values()},
                conditions=NamedMapping(
                    "region",
                    {n: c for n, e in self.conditions.items() if (c := change(e)).free_symbols},
                ),
                names=tuple(cells.items()),
                formed=(),
                resets=tuple(reset.replaced(change) for reset in self.resets),
                switches=kept,
                events=NamedMapping(
                    "event", {n: with_changed(e, change) for n, e in self.events.items()}
                ),
                definitions=NamedMapping(
                    "definition", {n: change(e) for n, e in self.definitions.items()}
                ),
            )
        )

    def _timed_interfaces(self, written: Iterable[sp.Expr]) -> tuple[sp.Expr, ...]:
        """Functions of the interfaces in time that are listed, or decide branches of equations."""
        deciding = {
            shape_of(factor, self.moving)
            for expression in written
            for switching in switching_expressions(expression)
            for factor, _ in factorise(switching, self.moving).factors
        }
        return tuple(
            i.function
            for i in self.interfaces
            if TIME in i.function.free_symbols
            and (i.name in self.given or shape_of(i.function, self.moving) in deciding)
        )


_structures: WeakValueDictionary[Keyed[None], Structure] = WeakValueDictionary()
_partitions: WeakValueDictionary[Keyed[None], Partition] = WeakValueDictionary()


def interned(structure: Structure) -> Structure:
    """Return the existing structure equal to this one, so that comparison is by identity."""
    return _structures.setdefault(Keyed(structure.content, None), structure)


def _interned_partition(one: Partition) -> Partition:
    return _partitions.setdefault(Keyed(one.content, None), one)


@lru_cache(maxsize=PARTITIONS)
def _partition(structure: Structure, values: tuple[tuple[str, float], ...]) -> Partition:
    numbers = {real(name): value for name, value in values}
    structure.check_finite(numbers)
    if structure.formed or structure.count(numbers)[0] > MOST_REGIONS:
        return structure.partition_by_signs(numbers)
    patterns = structure.patterns(numbers)
    signs = tuple(_sign(scale.subs(numbers)) for scale in structure.scales)
    return _partition_of(structure, Keyed((patterns, signs), (patterns, numbers)))


@lru_cache(maxsize=PARTITIONS)
def _partition_of(
    structure: Structure, given: Keyed[tuple[tuple[Pattern, ...], Values]]
) -> Partition:
    return structure.partition_of(*given.value)


def _sign(number: sp.Expr) -> int | None:
    known = number.is_number and number.is_real and number.is_finite
    return int(np.sign(float(number))) if known else None


def _undefined(expression: sp.Expr) -> bool:
    return bool(expression.has(sp.zoo, sp.nan, sp.oo, -sp.oo, sp.I)) or expression.is_real is False


def _undefined_at(expression: sp.Expr, values: Values) -> bool:
    """Check if an expression is undefined in a branch that exists at these values."""
    try:
        written = expression.subs(values)
    except (TypeError, ValueError):  # a relation between numbers that are not real
        return True
    numbers = (e for e in sp.preorder_traversal(written) if isinstance(e, sp.Expr) and e.is_number)
    return any(map(_undefined, numbers))


def _affine_row(function: sp.Expr, moving: Sequence[sp.Symbol]) -> NDArray[np.float64] | None:
    """Coefficients (a, b) of a function a·z + b of the moving symbols, None if not affine."""
    slopes = [function.diff(z) for z in moving]
    if any(slope.free_symbols for slope in slopes) or function.has(ClockFunction):
        return None
    rest = function.subs(dict.fromkeys(moving, 0))
    return scaled_row([*map(float, slopes), float(rest)])


@lru_cache(maxsize=PARTITIONS)
def _rows(
    structure: Structure, known: tuple[sp.Symbol, ...]
) -> tuple[Callable[..., list[float]] | None, ...]:
    """Functions of the known symbols that return slopes and constant of each affine interface."""
    loose = [z for z in structure.moving if z not in known]
    found: list[Callable[..., list[float]] | None] = []
    for interface in structure.interfaces:
        inside = interface.function.free_symbols
        slopes = [interface.function.diff(z) if z in inside else sp.S.Zero for z in loose]
        clocked = interface.function.has(ClockFunction)
        if clocked or any(slope.free_symbols & set(loose) for slope in slopes):
            # may be affine at some values
            found.append(None)
        else:
            rest = interface.function.subs(dict.fromkeys(loose, 0))
            found.append(sp.lambdify(known, [*slopes, rest], "math"))
    return tuple(found)


@lru_cache(maxsize=FROZEN)
def _frozen(
    structure: Structure,
    path: tuple[tuple[str, sp.Expr], ...],
    parameters: tuple[str, ...],
    fast: tuple[str, ...],
) -> tuple[Structure, frozenset[str]]:
    return structure._frozen(dict(path), parameters, fast)


def shape_of(function: sp.Expr, moving: Sequence[sp.Symbol]) -> sp.Expr:
    """Canonical expression of all functions that are equal up to sign and factor."""
    factors = factorise(function, moving).factors
    return sp.Mul(*(factor for factor, _ in factors)) if factors else function


def _cell(interfaces: Sequence[Interface], pattern: Pattern) -> Cell:
    return frozenset((i.function, s) for i, s in zip(interfaces, pattern, strict=True))


def _redundant(j: int, contents: Mapping[Pattern, dict[str, sp.Expr]]) -> bool:
    """Check that no expression changes across interface j."""
    pairs = 0
    for pattern, content in contents.items():
        across = (*pattern[:j], -pattern[j], *pattern[j + 1 :])
        if across in contents:
            pairs += 1
            if contents[across] != content:
                return False
    return pairs > 0


@lru_cache(maxsize=1024)
def _inequality(interface: Interface, sign: int) -> sp.Rel:
    h = interface.function
    for symbol in sorted(h.free_symbols, key=lambda s: s.name):
        if h.diff(symbol) == 1 and interface.name.startswith(symbol.name):
            level = expanded(symbol - h)
            return sp.Gt(symbol, level) if sign > 0 else sp.Lt(symbol, level)
    return sp.Gt(h, 0) if sign > 0 else sp.Lt(h, 0)


def _indicator(condition: Boolean) -> sp.Expr:
    return sp.Piecewise((sp.Integer(1), condition), (sp.Integer(0), True))
