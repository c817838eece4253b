"""Validation of the types of fields against their annotations, for content from files."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from functools import cache
from types import UnionType
from typing import Any, get_args, get_origin, get_type_hints

import numpy as np


def has_types(value: Any) -> bool:
    """Return True if all fields of a dataclass, recursively, have exactly their annotated types.

    Examples
    --------
    >>> from fastslow.results.base.outcome import Outcome
    >>> has_types(Outcome("end", "all is done.", True)), has_types(Outcome("end", [], True))
    (True, False)
    """
    kind: Any = type(value)
    hints = _hints(kind)
    return all(_is(getattr(value, entry.name), hints[entry.name]) for entry in fields(value))


@cache
def _hints(kind: Any) -> dict[str, Any]:
    return get_type_hints(kind)


def _is(value: Any, hint: Any) -> bool:
    origin, inner = get_origin(hint), get_args(hint)
    if hint is Any:
        return True
    if origin is UnionType:
        return any(_is(value, one) for one in inner)
    if origin is tuple:
        if type(value) is not tuple:
            return False
        if inner[1:] == (...,):
            return all(_is(item, inner[0]) for item in value)
        return len(value) == len(inner) and all(map(_is, value, inner))
    if origin is np.ndarray:
        return isinstance(value, np.ndarray)
    if origin is Mapping:
        kind, of = inner
        return isinstance(value, Mapping) and all(
            _is(key, kind) and _is(item, of) for key, item in value.items()
        )
    if type(value) is not hint:
        return False
    return has_types(value) if is_dataclass(hint) else True
