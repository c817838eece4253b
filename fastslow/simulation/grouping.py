"""Grouping of parameter sets with the same regions, which share one compiled series."""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from fastslow.model.clocks import ClockFunction
from fastslow.model.functions import FUNCTIONS_KEPT, function_of
from fastslow.model.model import Model
from fastslow.model.reading import factorise, switching_expressions
from fastslow.model.structure import Structure, real
from fastslow.results.stored.sign_patterns import possible_patterns

Values = Mapping[str, NDArray[np.float64]]

#: Number of parameter sets whose regions are compared at a time.
COMPARED_AT_ONCE = 16384


def same_regions(model: Model, values: Values, count: int) -> list[tuple[Model, NDArray[np.intp]]]:
    """Group parameter sets with the same regions, each group with its model.

    Empty regions, and the sense of a condition with a factor of parameters alone, depend
    on parameter values. In most cases there is one group, with the given model.

    Parameters
    ----------
    model : Model
    values : mapping
        Parameter to its values, all of shape (m,).
    count : int
        m.

    Returns
    -------
    list of (Model, ndarray of int)
        For each group a model at the values of its first set, and the indices of its sets.
    """
    everything = np.arange(count)
    if not values:
        return [(model, everything)]
    if count > COMPARED_AT_ONCE and _all_as_the_model(model, values, count):
        return [(model, everything)]
    own = {name: value for name, value in model.parameters.items() if name not in values}
    complete = all(name in model.parameters for name in values)
    if complete:
        # the model's own values are one more set, whose group uses the given model
        values = {n: np.append(v, model.parameters[n]) for n, v in values.items()}
    key = _signs(model, values, own)
    if complete and (key == key[-1]).all():
        return [(model, everything)]
    _, first, which = np.unique(key, axis=0, return_index=True, return_inverse=True)
    which = which.reshape(-1)
    groups = []
    current = model
    for number in np.argsort(first):
        members = everything[which[:count] == number]
        if not len(members):
            continue
        if complete and which[-1] == number:
            groups.append((model, members))
            continue
        # each from the previous one, so that regions keep their names
        current = current.with_parameters({n: v[members[0]] for n, v in values.items()})
        groups.append((current, members))
    return groups


def _all_as_the_model(model: Model, values: Values, count: int) -> bool:
    """Return whether all parameter sets have the regions of the model, without large tables."""
    parts = (slice(start, start + COMPARED_AT_ONCE) for start in range(0, count, COMPARED_AT_ONCE))
    groups = (
        same_regions(model, {n: v[part] for n, v in values.items()}, len(range(count)[part]))
        for part in parts
    )
    return all(len(group) == 1 and group[0][0] is model for group in groups)


def _signs(model: Model, values: Values, own: Mapping[str, float]) -> NDArray[np.float64]:
    """Keys that are equal for parameter sets with the same regions, shape (m, any)."""
    structure = model.structure
    count = len(next(iter(values.values())))
    swept = {real(name) for name in values}

    def numbers(expression: sp.Expr) -> NDArray[np.float64]:
        put_in = tuple((s, own[s.name]) for s in expression.free_symbols if s.name in own)
        used, function = function_of(expression, tuple(sorted(put_in, key=str)))
        return np.broadcast_to(function(*(values[s.name] for s in used)), (count,)).astype(float)

    moving = [s for s in structure.moving if s not in swept]
    columns: list[NDArray[np.float64]] = []
    for scale in _scales(structure, tuple(moving)):
        if scale.free_symbols & swept:
            columns.append(np.sign(numbers(scale)))
    rows = []
    for h, slopes, offset in _linear_parts(structure, tuple(moving)):
        if h.has(ClockFunction) or any(s.free_symbols & set(moving) for s in slopes):
            # a nonlinear function excludes no region, unless a vanishing parameter makes it
            # affine: such a rare set forms its own group
            for symbol in h.free_symbols & swept:
                gone = values[symbol.name] == 0.0
                columns += [gone, *(np.where(gone, values[s.name], 0.0) for s in swept)]
            continue
        rows.append([*slopes, offset])
    if any(e.free_symbols & swept for row in rows for e in row):
        table = np.stack([np.stack([numbers(e) for e in row], axis=-1) for row in rows], axis=1)
        columns += list(_patterns(table).T)
    return np.stack(columns, axis=1) if columns else np.zeros((count, 1))


@lru_cache(maxsize=FUNCTIONS_KEPT)
def _scales(structure: Structure, moving: tuple[sp.Symbol, ...]) -> tuple[sp.Expr, ...]:
    """Factors of the switching expressions that contain parameters alone."""
    written = (*structure.rates.values(), *structure.forcing.values())
    found: list[sp.Expr] = []
    for expression in written:
        for switching in switching_expressions(expression):
            parts = factorise(switching, list(moving))
            for factor, _ in parts.scales:
                if factor not in found:
                    found.append(factor)
    return tuple(found)


@lru_cache(maxsize=FUNCTIONS_KEPT)
def _linear_parts(
    structure: Structure, moving: tuple[sp.Symbol, ...]
) -> list[tuple[sp.Expr, list[sp.Expr], sp.Expr]]:
    """Every switching function with its derivatives by what moves, and its value at 0."""
    functions = [interface.function for interface in structure.interfaces]
    return [(h, [h.diff(z) for z in moving], h.subs(dict.fromkeys(moving, 0))) for h in functions]


def _patterns(table: NDArray[np.float64]) -> NDArray[np.float64]:
    """Keys for affine functions a·z + b alone, given as (m, functions, moving + 1)."""
    slopes, offsets = table[..., :-1], table[..., -1]
    count, n = offsets.shape
    still = np.all(slopes == 0.0, axis=2)
    key = [np.sign(slopes).reshape(count, -1), np.where(still, np.sign(offsets), 0.0)]
    moving = [j for j in range(n) if not still[:, j].any()]
    if len(moving) + np.count_nonzero(still.all(axis=0)) < n:
        return np.hstack([*key, _one_by_one(table)])
    # for parallel functions the order of the edges decides; if one function per direction are
    # linearly independent, the directions do not exclude each other's sides
    leaders: list[int] = []
    edges: list[list[NDArray[np.float64]]] = []
    for j in moving:
        for k, leader in enumerate(leaders):
            first = slopes[:, leader]
            along = (slopes[:, j] * first).sum(axis=1) / (first * first).sum(axis=1)
            if np.allclose(slopes[:, j], along[:, None] * first, rtol=0, atol=1e-14):
                edges[k].append(-offsets[:, j] / along)
                break
        else:
            leaders.append(j)
            edges.append([-offsets[:, j]])
    if len(leaders) > 1 and np.any(np.linalg.matrix_rank(slopes[:, leaders]) < len(leaders)):
        return np.hstack([*key, _one_by_one(table)])
    for together in edges:
        edge = np.stack(together, axis=1)
        key.append(np.sign(edge[:, :, None] - edge[:, None, :]).reshape(count, -1))
    return np.hstack(key)


def _one_by_one(table: NDArray[np.float64]) -> NDArray[np.float64]:
    """An index for each set of possible sign patterns."""
    unique, which = np.unique(table, axis=0, return_inverse=True)
    seen: dict[tuple[tuple[int, ...], ...], int] = {}
    numbers = []
    for rows in unique:
        sizes = np.abs(rows[:, :-1]).max(axis=1, initial=0.0)
        scaled = rows / np.where(sizes > 0.0, sizes, 1.0)[:, None]
        numbers.append(seen.setdefault(tuple(possible_patterns(list(scaled))), len(seen)))
    return np.array(numbers, dtype=float)[which.reshape(-1), None]
