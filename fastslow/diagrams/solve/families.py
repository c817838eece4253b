"""Families of equilibrium sets of a field, and whether these are all."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import lru_cache

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from fastslow.diagrams.field import FrozenField
from fastslow.diagrams.modes import all_held, walls_of
from fastslow.diagrams.solve.equilibrium_sets import Family, heights_of, numbers_of
from fastslow.diagrams.solve.implicit_sets import ImplicitFamily
from fastslow.diagrams.solve.many_regions import solved_one_by_one
from fastslow.diagrams.solve.motion_equations import region_equations
from fastslow.diagrams.solve.region_continua import implicit_continua, region_families
from fastslow.model.expansion import expanded
from fastslow.model.motion import Motion
from fastslow.model.motions import motions_of, two_folds_of
from fastslow.model.rational import exact
from fastslow.model.structure import real
from fastslow.results.branch.equilibrium_sets import EquilibriumSet
from fastslow.results.stored.operations import AT_TWO_FOLD
from fastslow.symbolic.closed_forms.equilibrium_sets import solved_along

Array = NDArray[np.float64]


@lru_cache(maxsize=64)
def families_of(field: FrozenField) -> tuple[Family, ...]:
    """Return the families of non-isolated equilibria of a field, sliding and in regions.

    For sliding along several interfaces, and at the two-folds of an interface that is crossed at
    equal normal speeds, isolated equilibria too, which are not on branches.
    None of too many motions.
    """
    if not solved_one_by_one(field):
        return ()
    partition = field.model.partition
    motions = motions_of(partition, with_jumps=True).sliding
    found = (_family(field, motion) for motion in (*motions, *two_folds_of(partition)))
    sliding = (family for family in found if family is not None)
    return (*sliding, *region_families(field))


def _family(field: FrozenField, motion: Motion) -> Family | None:
    numbers = numbers_of(field)
    names = field.model.states
    functions = [exact(i.function).subs(numbers) for i in field.model.interfaces.values()]
    rates = [exact(r).subs(numbers) for r in motion.rates]
    equations = [*(functions[j] for j in motion.slides), *rates]
    parts = solved_along(equations[: len(motion.slides)], rates, names)
    alone = len(motion.slides) == 1 and not motion.name.endswith(AT_TWO_FOLD)
    if parts is None or (alone and not parts[1]):
        return None
    solved = parts[0]
    free = parts[1] if parts[1] is not None else _unsolved(solved, names)
    weights = [sp.cancel(exact(s).subs(numbers).subs(solved)) for s in motion.weights]
    if any(s.has(sp.zoo, sp.nan) for s in weights):
        # neither field jumps there
        return None
    others = [
        sp.expand(sign * functions[j].subs(solved)) for j, sign in enumerate(motion.signs) if sign
    ]
    if any(h == 0 for h in others):
        # the edge of a set on a further interface
        return None
    walls = (-exact(w.function).subs(numbers).subs(solved) for w in walls_of(field.model))
    others += [sp.expand(h) for h in walls]
    bounds = [e for s in weights for e in (1 - s, 1 + s)]
    symbols = {real(n): real(n) for n in names} | solved
    states = tuple(sp.expand(symbols[real(n)]) for n in names)
    if parts[1] is not None:
        return Family(field, motion, free, states, (*bounds, *others))
    left = [e for e in (_shorter(e.subs(solved)) for e in equations) if e != 0]
    return ImplicitFamily(field, motion, free, states, (*bounds, *others), tuple(left))


def _unsolved(solved: Mapping[sp.Symbol, sp.Expr], names: Sequence[str]) -> tuple[sp.Symbol, ...]:
    """Return the states that remain in equations without a closed form."""
    return tuple(real(n) for n in names if real(n) not in solved)


def _shorter(equation: sp.Expr) -> sp.Expr:
    """Return an equation multiplied out, or as it is where that is shorter."""
    return min(expanded(equation), equation, key=sp.count_ops)


def sets_of(field: FrozenField, value: float) -> list[EquilibriumSet]:
    """Return all equilibrium sets at a value of the parameter."""
    return [one for family in families_of(field) for one in family.sets(value)]


def all_known(field: FrozenField) -> bool:
    """Return whether the equilibria along several interfaces are provably complete.

    Not computed are those of implicit equations, sets whose ranges cannot be computed, and those
    without a derived sliding motion; sets that are not exact may be incomplete.
    """
    if not solved_one_by_one(field):
        return False
    exact_sets = all(f.exact for f in families_of(field))
    return exact_sets and not _left_out(field) and not implicit_continua(field)


@lru_cache(maxsize=64)
def _left_out(field: FrozenField) -> bool:
    """Return whether motions along several interfaces are implicit, or not derived."""
    numbers = numbers_of(field)
    motions = motions_of(field.model.partition, with_jumps=True)
    if motions.undecided or not all_held(field.model):
        return True
    for motion in (*motions.sliding, *two_folds_of(field.model.partition)):
        if len(motion.slides) > 1 or motion.name.endswith(AT_TWO_FOLD):
            heights = [exact(h).subs(numbers) for h in heights_of(field, motion)]
            rates = [exact(r).subs(numbers) for r in motion.rates]
            parts = solved_along(heights, rates, field.model.states)
            if parts is not None and parts[1] is None:
                return True
    return False


def covered(field: FrozenField, lower: float, upper: float) -> set[int]:
    """Return the numbers of modes whose equilibria are all in exact sets.

    A region is included if its single equilibrium, in closed form, is always an edge of a set.
    """
    names = {family.motion.name for family in families_of(field) if family.exact}
    if not names:
        return set()
    found = set()
    for equations in region_equations(field):
        mode = field.modes[equations.region]
        if mode.sides is not None:
            if mode.name in names:
                found |= {equations.region, equations.region + 1}
        elif not equations.unknowns:
            values = np.linspace(lower, upper, 7)
            points = [(s, v) for v in values for s in equations.solutions(v)[0][:1]]
            inside = [in_a_set(field, np.append(s, v), np.abs(s).max()) for s, v in points]
            if all(inside) and len(points) == len(values):
                found.add(equations.region)
    return found


def in_a_set(field: FrozenField, u: Array, unit: Array | float) -> bool:
    """Return whether a point (states, parameter) is in an equilibrium set.

    ``unit`` is the size of every state, the scale of rounding errors.
    """
    return any(family.contains(u, unit) for family in families_of(field))
