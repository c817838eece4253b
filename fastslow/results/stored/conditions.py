"""Conditions of events in postfix notation: numbers of inequalities, and operations."""

from __future__ import annotations

from collections.abc import Iterable

#: Operations of the conditions of events, and the deepest of these conditions.
AND, OR, NEGATION, TRUE, FALSE = -1, -2, -3, -4, -5
DEEPEST_CONDITION = 60


def postfix_depth(program: Iterable[int], n_triggers: int) -> int:
    """Return the largest number of intermediate values of a condition, 0 if it has no value.

    Examples
    --------
    >>> postfix_depth([0, 1, AND, NEGATION], 2), postfix_depth([AND], 2)
    (2, 0)
    """
    size = deepest = 0
    for code in program:
        if 0 <= code < n_triggers or code in (TRUE, FALSE):
            size += 1
        elif code in (AND, OR) and size > 1:
            size -= 1
        elif code != NEGATION or size < 1:
            return 0
        deepest = max(deepest, size)
    return deepest if size == 1 else 0
