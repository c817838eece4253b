"""Keys of caches: a value compared by the content that a result depends on."""

from __future__ import annotations

from collections.abc import Hashable
from typing import Generic, TypeVar

V = TypeVar("V")


class Keyed(Generic[V]):
    """A value compared and hashed by a key, for `functools.lru_cache`.

    Examples
    --------
    >>> Keyed("even", 2) == Keyed("even", 4), Keyed("even", 2) == Keyed("odd", 3)
    (True, False)
    """

    __slots__ = ("_hash", "key", "value")

    def __init__(self, key: Hashable, value: V) -> None:
        # stored: a dictionary hashes again at interpreter exit, when SymPy is gone
        self.key, self.value, self._hash = key, value, hash(key)

    def __hash__(self) -> int:
        return self._hash

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Keyed) and bool(self.key == other.key)
