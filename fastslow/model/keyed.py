"""Keys of what is kept: a value under the content that a result depends on."""

from __future__ import annotations

from collections.abc import Hashable
from typing import Generic, TypeVar

V = TypeVar("V")


class Keyed(Generic[V]):
    """A value that is equal to others with the same key, for `functools.lru_cache`.

    Examples
    --------
    >>> Keyed("even", 2) == Keyed("even", 4), Keyed("even", 2) == Keyed("odd", 3)
    (True, False)
    """

    __slots__ = ("key", "value")

    def __init__(self, key: Hashable, value: V) -> None:
        self.key, self.value = key, value

    def __hash__(self) -> int:
        return hash(self.key)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Keyed) and bool(self.key == other.key)
