"""Equality of results by content: arrays elementwise, NaN equal to NaN."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np


def equal(one: Any, other: Any) -> bool:
    """Return True if two values have the same content.

    Examples
    --------
    >>> equal({"x": np.array([1.0, np.nan])}, {"x": np.array([1.0, np.nan])})
    True
    >>> equal((np.arange(2),), (np.arange(3),))
    False
    """
    if one is other:
        return True
    if isinstance(one, np.ndarray) or isinstance(other, np.ndarray):
        if type(one) is not type(other) or one.shape != other.shape:
            return False
        return np.array_equal(one, other) or _equal_with_nan(one, other)
    if isinstance(one, float | complex) and isinstance(other, float | complex):
        return bool(one == other or (one != one and other != other))
    if isinstance(one, Mapping) and isinstance(other, Mapping):
        return one.keys() == other.keys() and all(equal(v, other[k]) for k, v in one.items())
    if type(one) is type(other) and type(one) in (list, tuple):
        return len(one) == len(other) and all(map(equal, one, other))
    return bool(one == other)


def _equal_with_nan(one: Any, other: Any) -> bool:
    numeric = one.dtype.kind in "fc" and other.dtype.kind in "fc"
    return numeric and np.array_equal(one, other, equal_nan=True)


def content_hash(value: Any) -> int:
    """Return a hash that agrees for equal content; arrays are hashed by shape alone."""
    if isinstance(value, np.ndarray):
        return hash(value.shape)
    if isinstance(value, float | complex) and value != value:
        return hash("nan")
    if isinstance(value, Mapping):
        return hash(frozenset((key, content_hash(v)) for key, v in value.items()))
    if type(value) in (list, tuple):
        return hash(tuple(map(content_hash, value)))
    return hash(value)
