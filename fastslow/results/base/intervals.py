"""Ranges of consecutive rows, and intervals given by their ends."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fastslow.arguments import real_number, refusal


def runs_of(wanted: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """Return start and stop of every run of True.

    Examples
    --------
    >>> runs_of(np.array([True, False, True, True]))
    [(0, 1), (2, 4)]
    """
    edges = np.flatnonzero(np.diff(wanted.astype(np.int8), prepend=0, append=0))
    return [(int(start), int(stop)) for start, stop in edges.reshape(-1, 2)]


def limits_of(between: tuple[float, float]) -> tuple[float, float]:
    """Validate an interval: two numbers in increasing order.

    Raises
    ------
    ArgumentError
        For any other value.
    """
    sequence = isinstance(between, tuple | list) or getattr(between, "ndim", 0) == 1
    ends = [real_number(end) for end in between] if sequence else []
    low, high = ends if len(ends) == 2 else (None, None)
    if low is None or high is None or not low <= high:
        raise refusal("between", between, "two numbers, the lower one first")
    return low, high
