"""Free directions: translations of the states under which all rates are invariant."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache, lru_cache
from typing import Any

import numpy as np
import sympy as sp

from fastslow.errors import ArgumentError
from fastslow.model.derived import cached_by_partition
from fastslow.model.differentiation import derivative
from fastslow.model.functions import numpy_function
from fastslow.model.model import Model
from fastslow.model.rational import exact
from fastslow.model.structure import real
from fastslow.results.base.display import Displayed
from fastslow.results.base.named_mapping import NamedMapping
from fastslow.symbolic.algebra import rational_form
from fastslow.symbolic.reduction import reduce_states

#: Largest number of states for which free directions are computed.
MOST_STATES = 24

#: Least number of states at which rows are evaluated; in total at least 2n rows are formed.
EVALUATED_STATES = 3

#: About this number of rows of many are examined before all.
FIRST_ROWS = 64

#: Singular values below this, relative to the largest, count as zero.
NULL_SINGULAR_VALUE = 1e-11


@dataclass(frozen=True)
class FreeDirection(Displayed):
    """A translation of the states under which all rates and interfaces are invariant.

    Equilibria of such a system are not isolated, and there is none if the states drift
    along the direction (a rigid-body mode). The invariant combinations of the states form
    a reduced system.

    Parameters
    ----------
    shift : NamedMapping of sympy.Expr
        State to its component of the translation.
    combinations : NamedMapping of sympy.Expr
        States of the reduced system, without free directions, in terms of the old ones.

    Examples
    --------
    >>> a, b, k = sp.symbols("a b k")
    >>> pair = Model({a: k * (b - a), b: k * (a - b)}, parameters={k: 1})
    >>> (free,) = free_directions(pair)
    >>> free.shift, free.combinations
    ({a: 1, b: 1}, {u1: a - b})
    """

    shift: NamedMapping[sp.Expr]
    combinations: NamedMapping[sp.Expr]

    def __str__(self) -> str:
        c = next(n for n in ("c", "s", "shift") if n not in self.shift)
        moved = ", ".join(f"{n} + {sp.Symbol(c) * e}" for n, e in self.shift.items())
        given = ", ".join(f'"{n}": {e}' for n, e in self.combinations.items())
        return (
            f"free direction: all rates are invariant under {moved}, so no equilibrium "
            f"is isolated; fs.reduce_states(model.rates, {{{given}}}) returns the reduced system"
        )


@lru_cache(maxsize=64)
def free_directions(model: Model) -> tuple[FreeDirection, ...]:
    """Return the free directions of a frozen model with at most `MOST_STATES` states.

    Parameters
    ----------
    model : Model

    Examples
    --------
    >>> x, y = sp.symbols("x y")
    >>> free_directions(Model({x: y - x, y: -y}))
    ()
    """
    states = [real(n) for n in model.states]
    if not 1 < len(states) <= MOST_STATES:
        return ()
    values = {real(n): v for n, v in model.parameters.items()}
    shifts = constant_null_space(_slopes_of(model), states, values)
    if not shifts:
        return ()
    combinations = _reduced(model, states, values)
    if not combinations:
        return ()
    return tuple(
        FreeDirection(
            NamedMapping(
                "state", {s.name: e for s, e in zip(states, shift, strict=True) if e != 0}
            ),
            combinations,
        )
        for shift in shifts
    )


@cached_by_partition
def _slopes_of(model: Model) -> list[list[sp.Expr]]:
    """Gradients of all rates, interface functions, walls and changes by resets."""
    functions = [r.rates[n] for r in model.regions.values() for n in model.states]
    functions += [i.function for i in model.interfaces.values()]
    for reset in model.resets.values():
        functions += [reset.function, *(value - real(n) for n, value in reset.jump.items())]
    # regions share most of their rates
    return _slopes([*dict.fromkeys(functions)], [real(n) for n in model.states])


def _reduced(
    model: Model, states: Sequence[sp.Symbol], values: Mapping[sp.Symbol, float]
) -> NamedMapping[sp.Expr]:
    """Invariant combinations, reduced repeatedly until no free direction remains."""
    whole: dict[sp.Symbol, sp.Expr] = {s: s for s in states}
    rates = {s: model.rates[s.name] for s in states}
    while True:
        smooth = [b for e in rates.values() for b in _branches(e)]
        shifts = constant_null_space(_slopes(smooth, list(rates)), list(rates), values)
        if not shifts:
            break
        taken = {s.name for s in (*states, *rates)} | {s.name for s in values}
        fresh = (n for k in range(1, 999) if (n := f"u{k}") not in taken)
        new = {real(next(fresh)): e for e in _invariants(shifts, list(rates))}
        if not new:
            break
        try:
            reduced = reduce_states(rates, new)
        except ArgumentError:
            break
        whole = {s: sp.expand(e.subs(whole, simultaneous=True)) for s, e in new.items()}
        rates = {s: reduced[s.name] for s in new}
    if len(whole) == len(states):
        return NamedMapping("state", {})
    return NamedMapping("state", {f"u{k}": e for k, e in enumerate(whole.values(), 1)})


def _branches(expression: sp.Expr) -> list[sp.Expr]:
    """All smooth branches of a rate with Piecewise, and the expressions that select them."""
    pieces = [p for p in sp.preorder_traversal(expression) if isinstance(p, sp.Piecewise)]
    if not pieces:
        return [expression]
    inner = next(p for p in pieces if not any(a.has(sp.Piecewise) for a in p.args))
    found = [r.lhs - r.rhs for _, c in inner.args for r in c.atoms(sp.core.relational.Relational)]
    for value, _ in inner.args:
        found += _branches(expression.xreplace({inner: value}))
    return found


def _slopes(functions: Sequence[sp.Expr], states: Sequence[sp.Symbol]) -> list[list[sp.Expr]]:
    return [[derivative(f, s) for s in states] for f in functions]


def constant_null_space(
    rows: Sequence[Sequence[sp.Expr]],
    states: Sequence[sp.Symbol],
    values: Mapping[sp.Symbol, float],
) -> list[list[sp.Expr]]:
    """Return constant vectors that are orthogonal to every row at every state.

    Parameters
    ----------
    rows : sequence of sequence of sympy.Expr
        Each with as many entries as there are states.
    states : sequence of Symbol
    values : mapping
        Parameter to its value, for a numerical preselection.

    Examples
    --------
    >>> x, y, k = map(real, "xyk")
    >>> constant_null_space([[k * x * y, -x * y]], [x, y], {k: 2})
    [[1, k]]
    """
    distinct = _distinct(tuple(map(tuple, rows)))
    if not distinct:
        return []
    # some rows of many usually exclude all vectors; an odd step varies all conditions of regions
    some = distinct[:: len(distinct) // FIRST_ROWS | 1]
    for rows in dict.fromkeys((some, distinct)):
        _, sizes, right = np.linalg.svd(_numbers(rows, states, values))
        null = right[int(np.sum(sizes > NULL_SINGULAR_VALUE * sizes[0])) :]
        if not len(null):
            return []
    # only the columns involved are treated symbolically
    moving = [k for k in range(len(states)) if np.abs(null[:, k]).max() > 1e-9]
    few = [[exact(row[k]) for k in moving] for row in _few(distinct, moving)]
    matrix = sp.Matrix([part for row in few for part in _by_kernels(row, states)])
    found = []
    for vector in matrix.nullspace(simplify=rational_form):
        scale = next(e for e in vector if e != 0)
        constant = [sp.S.Zero] * len(states)
        for k, entry in zip(moving, vector, strict=True):
            constant[k] = rational_form(entry / scale)
        along = [
            rational_form(sum(e * c for e, c in zip(r, constant, strict=True))) for r in distinct
        ]
        if not any(e.free_symbols & set(states) for e in constant) and not any(along):
            found.append(constant)
    return found


@lru_cache(maxsize=64)
def _distinct(rows: tuple[tuple[sp.Expr, ...], ...]) -> tuple[tuple[sp.Expr, ...], ...]:
    """Distinct nonzero rows."""
    return tuple(row for row in dict.fromkeys(rows) if any(e != 0 for e in row))


def _by_kernels(row: Sequence[sp.Expr], states: Sequence[sp.Symbol]) -> list[list[sp.Expr]]:
    """Split a row into one row of coefficients for each function of the states in it.

    A constant vector is orthogonal to the row if and only if it is to all of these.
    """
    found: dict[sp.Expr, list[sp.Expr]] = {}
    for k, entry in enumerate(row):
        for term in sp.Add.make_args(sp.expand(entry, power_exp=False, log=False)):
            inside = set(states) & term.free_symbols
            coefficient, kernel = term.as_independent(*inside, as_Add=False)
            if not inside:
                coefficient, kernel = term, sp.S.One
            line = found.setdefault(kernel, [sp.S.Zero] * len(row))
            line[k] += coefficient
    return list(found.values())


def _few(slopes: Sequence[Sequence[sp.Expr]], columns: Sequence[int]) -> list[Sequence[sp.Expr]]:
    """Rows with entries in the columns, the shortest first."""
    inside = [row for row in slopes if any(row[k] != 0 for k in columns)]
    return sorted(inside, key=lambda row: sum(sp.count_ops(row[k]) for k in columns))[:12]


@lru_cache(maxsize=64)
def _function_of(
    slopes: tuple[tuple[sp.Expr, ...], ...],
) -> tuple[list[sp.Symbol], Callable[..., Any]]:
    """Symbols of the gradients, and the gradients as a function of these."""
    symbols = sorted(set().union(*(e.free_symbols for r in slopes for e in r)), key=str)
    return symbols, numpy_function(symbols, [list(r) for r in slopes])


@cache
def _number(point: int, place: int) -> float:
    """A quotient of primes for each coordinate of a point."""
    return float(sp.prime(3 * point + 2 * place + 5)) / float(sp.prime(place + 4))


def _numbers(
    slopes: tuple[tuple[sp.Expr, ...], ...],
    states: Sequence[sp.Symbol],
    values: Mapping[sp.Symbol, float],
) -> np.ndarray:
    """Gradients at a few states, each row scaled to its largest entry."""
    symbols, function = _function_of(slopes)
    rows = []
    for k in range(max(EVALUATED_STATES, -(-2 * len(states) // len(slopes)))):
        # in the order of states and free parameters
        place = [values[s] if s in values else _number(k, j) for j, s in enumerate(symbols)]
        with np.errstate(all="ignore"):
            # as NumPy numbers, for which a division by zero raises nothing
            rows.append(np.array(function(*map(np.float64, place)), dtype=float))
    numbers = np.vstack(rows)
    numbers = numbers[np.isfinite(numbers).all(axis=1)]
    size = np.abs(numbers).max(axis=1, initial=0.0)
    return np.vstack([numbers[size > 0] / size[size > 0, None], np.zeros((1, len(states)))])


def _invariants(shifts: Sequence[Sequence[sp.Expr]], states: Sequence[sp.Symbol]) -> list[sp.Expr]:
    """Linear combinations invariant under all translations, in the order of the states."""
    matrix = sp.Matrix([list(s) for s in shifts])
    reduced, pivots = matrix.rref(simplify=True)
    found = []
    for k, state in enumerate(states):
        if k not in pivots:
            rest = [reduced[row, k] * states[p] for row, p in enumerate(pivots)]
            whole = state - sum(rest, sp.S.Zero)
            slope = next(c for s in states if (c := whole.coeff(s)) != 0)
            found.append(sp.expand(whole / slope))
    return found
