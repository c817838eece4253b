"""Source of the Taylor series of many motions: operations that several of them share stand once.

Of k independent conditions 2^k regions follow, whose rates consist of few different terms. An
operation that enough motions have in common is computed for all of them, and tables choose the rows
of rates and outputs; the others are computed in their motion alone. The size of the code is then
that of the different operations, not of all regions.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Hashable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any

from fastslow.kernels.compiler.chains import chosen
from fastslow.kernels.taylor.recurrences import Recurrences
from fastslow.results.stored.operations import Operations, SeriesOperations, renamed

#: Numbers of motions from which operations are shared.
FEWEST_MOTIONS = 33

#: Number of motions and rates from which operations of fewer motions are shared: of 28 motions of
#: 60 states, most rates are the same in all.
FEWEST_OF_LARGE, MANY_RATES = 4, 500

#: An operation of at least this fraction of all motions is computed for all of them.
SHARED_BY = 1 / 16


@dataclass(frozen=True)
class ManyMotions:
    """Operations of many motions with common rows.

    Parameters
    ----------
    scalars : tuple of str
        Expressions in parameters.
    common : tuple of tuple
        Nodes that are computed for all motions.
    own : tuple of tuple of tuple
        Other nodes of each motion.
    rows : tuple of dict
        For each motion, the row that replaces each of its rows.
    """

    scalars: tuple[str, ...]
    common: tuple[tuple[Any, ...], ...]
    own: tuple[tuple[tuple[Any, ...], ...], ...]
    rows: tuple[dict[int, int], ...]


def are_many(motions: int, rates: int) -> bool:
    """Check whether operations of some motions are shared, of which each has some rates."""
    large = motions >= FEWEST_OF_LARGE and motions * rates >= MANY_RATES
    return motions >= FEWEST_MOTIONS or large


def shared(operations: Operations) -> ManyMotions | None:
    """Operations of a model with many motions with common rows, None for other models.

    Examples
    --------
    >>> import sympy as sp, fastslow as fs
    >>> x = sp.symbols("x:6")
    >>> model = fs.Model({one: 1 - one + sp.Max(one, 0) for one in x})
    >>> many = shared(model.operations)
    >>> len(many.own), len(many.common) < 30, {len(own) for own in many.own}
    (64, True, {0})
    """
    motions = [m for m in operations.motions if isinstance(m, SeriesOperations)]
    m = operations.sizes[0]
    if len(motions) < len(operations.motions) or not are_many(len(motions), m):
        return None
    scalars: dict[str, int] = {}
    numbers: dict[Hashable, int] = {}
    nodes: dict[int, tuple[Any, ...]] = {}
    users: Counter[int] = Counter()
    every: list[dict[int, int]] = []
    for motion in motions:
        rows = {i: i for i in range(m)}
        names = [scalars.setdefault(text, len(scalars)) for text in motion.scalars]
        new = []
        for node in motion.nodes:
            key = renamed(node, rows, names, without_slopes=True)
            number = numbers.setdefault(key, m + len(numbers))
            rows[node[1]] = number
            users[number] += 1
            if number not in nodes:
                nodes[number] = ()
                new.append(node)
        # the slope of a function may be a later row
        nodes |= {rows[node[1]]: renamed(node, rows, names) for node in new}
        every.append(rows)
    least = SHARED_BY * len(motions)
    first = operations.first_free
    place = {i: i for i in range(m)}
    common = [number for number in nodes if users[number] >= least]
    place |= {number: first + k for k, number in enumerate(common)}
    first += len(common)
    names = list(range(len(scalars)))
    own, replaced = [], []
    for rows in every:
        alone = [number for number in dict.fromkeys(rows.values()) if number not in place]
        here = place | {number: first + k for k, number in enumerate(alone)}
        own.append(tuple(_placed(nodes[number], number, here, names) for number in alone))
        replaced.append({row: here[number] for row, number in rows.items()})
    return ManyMotions(
        tuple(scalars),
        tuple(_placed(nodes[number], number, place, names) for number in common),
        tuple(own),
        tuple(replaced),
    )


def _placed(
    node: tuple[Any, ...], number: int, rows: dict[int, int], names: Sequence[int]
) -> tuple[Any, ...]:
    kind, *rest = renamed((node[0], number, *node[1:]), rows, names)
    return kind, rows[number], *rest


def source_of(
    operations: Operations, many: ManyMotions, order: int
) -> tuple[list[str], list[str], int]:
    """Tables, source lines that fill the series of the motion ``mode``, and the number of rows.

    The lines are those of `fastslow.kernels.taylor.series.motion_source` otherwise.
    """
    m, columns = operations.sizes[0], order + 1
    motions = [motion for motion in operations.motions if isinstance(motion, SeriesOperations)]
    pairs = list(zip(motions, many.rows, strict=True))
    rates = [[rows[r] for r in motion.rates] for motion, rows in pairs]
    outputs = [[rows[r] for r in motion.outputs] for motion, rows in pairs]
    width = max(map(len, outputs))
    # an output that a motion lacks is a copy of its own row
    held = [[*some, *range(m + len(some), m + width)] for some in outputs]
    tables = [f"RATE_ROWS = {_table(rates, columns)}", f"OUTPUT_ROWS = {_table(held, columns)}"]
    work = Recurrences(many.common, order, "clock")
    alone = [Recurrences((*many.common, *own), order, "clock") for own in many.own]
    # an operation of one motion alone needs common ones to the last coefficient
    needed = set().union(*(one.needed_by(some) for one, some in zip(alone, outputs, strict=True)))
    body = ["t = inputs[0]"]
    body += [f"{work.at(i, '0')} = inputs[{i + 1}]" for i in range(m)]
    lines, (always, below) = work.values(), work.general(needed)
    body += [*_scalars(many, [*lines, *always, *below]), *lines]
    body += _in_motions(
        many, lambda k: [*_scalars(many, own := alone[k].values(many.own[k])), *own]
    )
    rate = f"W[RATE_ROWS[mode * {m} + i]"
    body += ["if clock != 0.0:", f"    for i in range({m}):"]
    body += [f"        W[i * {columns} + 1] = {rate}]"]
    body += ["for k in range(1, n + 1):", "    q = 1.0 / k", *(f"    {line}" for line in always)]
    if below:
        body += ["    if k < n:", *(f"        {line}" for line in below)]

    def own_lines(k: int) -> list[str]:
        first, last = alone[k].general({*outputs[k]}, many.own[k])
        lines = [*first, "if k < n:", *(f"    {line}" for line in last)] if last else first
        return [*_scalars(many, lines), *lines]

    body += [f"    {line}" for line in _in_motions(many, own_lines)]
    body += ["    if k < n:", "        r = 1.0 / (k + 1)", f"        for i in range({m}):"]
    body += [f"            W[i * {columns} + k + 1] = {rate} + k] * r"]
    if width:
        body += ["for k in range(n + 1):", f"    for i in range({width}):"]
        body += [f"        W[({m} + i) * {columns} + k] = W[OUTPUT_ROWS[mode * {width} + i] + k]"]
    return tables, body, max(operations.first_free, *(one.n_rows for one in alone))


def _scalars(many: ManyMotions, lines: Iterable[str]) -> list[str]:
    """Source lines of the scalars in some lines."""
    used = {int(number) for line in lines for number in re.findall(r"\bc(\d+)\b", line)}
    return [f"c{k} = {many.scalars[k]}" for k in sorted(used)]


def _in_motions(many: ManyMotions, lines: Callable[[int], list[str]]) -> list[str]:
    """Source lines that each motion has alone."""
    bodies = ((f"mode == {k}", lines(k)) for k, own in enumerate(many.own) if own)
    return [line.removeprefix("    ") for line in chosen(bodies)]


def _table(rows: Sequence[Sequence[int]], columns: int) -> str:
    """Source of the first places of rows, motion by motion."""
    return f"({', '.join(str(row * columns) for some in rows for row in some)},)"
