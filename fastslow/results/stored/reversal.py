"""Reversal of time: the operations of a model in the time τ = −t."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace
from functools import lru_cache
from typing import Any

import numpy as np

from fastslow.results.stored.operations import (
    CLOCK_VALUES,
    FUNCTION,
    MULTIPLE,
    SUM,
    TIME,
    Operations,
    PiecewisePolynomial,
    SeriesOperations,
    ValueOperations,
)

#: Replaces names in a text.
_Change = Callable[[str], str]

_MINUS = "(-1.0)"


@lru_cache(maxsize=64)
def in_reversed_time(operations: Operations) -> Operations:
    """Return the operations of a model without resets in the time τ = −t.

    Rates and bounds of sliding change their signs, laws and interfaces are evaluated at −τ, and
    tables and clocks have their instants in the opposite order.

    Parameters
    ----------
    operations : Operations
    """
    values: dict[str, str] = {}
    place = len(operations.parameters)
    for table in operations.tables:
        values[f"p{place + 1}"] = f"(-p{place + 1})"
        place += 2 + table.n_terms
    for _ in operations.clocks:
        # between −(k + 1) T and −k T the last instant of the model is kT
        values[f"p{place}"] = f"(-1.0 - p{place})"
        values[f"p{place + 1}"] = f"(-p{place + 1} - p{place + 2})"
        place += CLOCK_VALUES

    def parameters(text: str) -> str:
        return re.sub(r"\bp\d+\b", lambda name: values.get(name[0], name[0]), text)

    def moving(text: str) -> str:
        return re.sub(r"\bt\b", "(-t)", parameters(text))

    first_bound = sum(operations.sizes[1:])
    return replace(
        operations,
        motions=tuple(
            _series(motion, parameters, first_bound, operations.first_free)
            if isinstance(motion, SeriesOperations)
            else _values(motion, moving)
            for motion in operations.motions
        ),
        gradients=tuple(
            (tuple(map(moving, terms)), tuple(map(moving, slopes)))
            for terms, slopes in operations.gradients
        ),
        tables=tuple(map(_table, operations.tables)),
        clocks=tuple((period, f"(-({phase}))", jump) for period, phase, jump in operations.clocks),
    )


def _series(
    motion: SeriesOperations, change: _Change, first_bound: int, first_free: int
) -> SeriesOperations:
    nodes: list[tuple[Any, ...]] = []
    free = max([first_free, *(node[1] + 1 for node in motion.nodes)])

    def negative(row: int) -> int:
        nonlocal free
        nodes.append((MULTIPLE, free, _MINUS, row))
        free += 1
        return free - 1

    for kind, row, *operands in motion.nodes:
        match (kind, *operands):
            case (str(),) if kind == TIME:
                nodes.append((TIME, free))
                nodes.append((MULTIPLE, row, _MINUS, free))
                free += 1
            case (str(), terms, constant) if kind == SUM:
                parts = tuple(
                    (factor if factor in "+-" else change(factor), r) for factor, r in terms
                )
                nodes.append((SUM, row, parts, change(constant)))
            case (str(), text, slots) if kind == FUNCTION:
                # the rates of arguments that are linear in time
                moved = tuple(
                    (a, g, f"(-({change(rate)}))" if rate else "") for a, g, rate in slots
                )
                nodes.append((FUNCTION, row, change(text), moved))
            case _:
                changed = tuple(change(o) if isinstance(o, str) else o for o in operands)
                nodes.append((kind, row, *changed))
    rates = tuple(map(negative, motion.rates))
    outputs = (
        *motion.outputs[:first_bound],
        *map(negative, motion.outputs[first_bound:]),
    )
    return replace(
        motion,
        scalars=tuple(map(change, motion.scalars)),
        nodes=tuple(nodes),
        rates=rates,
        outputs=outputs,
    )


def _values(motion: ValueOperations, change: _Change) -> ValueOperations:
    def negative(text: str) -> str:
        return f"-({change(text)})"

    return replace(
        motion,
        laws=tuple(map(change, motion.laws)),
        shared=tuple(map(change, motion.shared)),
        rates=tuple(map(negative, motion.rates)),
        heights=tuple((change(height), negative(rate)) for height, rate in motion.heights),
        bounds=tuple(map(negative, motion.bounds)),
    )


def _table(table: PiecewisePolynomial) -> PiecewisePolynomial:
    """Return a table with its pieces about their last knots, in powers of the original time."""
    knots, coefficients = table.knots, table.coefficients.copy()
    length = np.diff(knots)
    for i in range(table.n_terms):
        for k in range(table.n_terms - 2, i - 1, -1):
            coefficients[:, k] += length * coefficients[:, k + 1]
    return replace(table, knots=0.0 - knots[::-1], coefficients=coefficients[::-1].copy())
