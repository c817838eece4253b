"""An immutable mapping with names, or symbols identified by their names, as keys."""

from __future__ import annotations

from collections.abc import ItemsView, Iterable, Iterator, Mapping
from typing import Any, Generic, TypeVar

from fastslow.errors import unknown_name
from fastslow.formulas.grammar import normalised
from fastslow.results.base.display import Displayed, value_text
from fastslow.results.base.equality import content_hash, equal
from fastslow.results.base.html import Cells

V = TypeVar("V")


class NamedMapping(Displayed, Mapping[str, V], Generic[V]):
    """An ordered, immutable mapping from names to values.

    A key is a name or an object that prints as one (a SymPy symbol); identifiers are
    normalised as in Python. An unknown key raises an error that suggests the nearest name.

    Parameters
    ----------
    type : str
        The kind of the entries, used in error messages.
    items : mapping or iterable of (name, value)
        The entries.

    Examples
    --------
    >>> values = NamedMapping("parameter", {"A": 1.0, "omega": 0.1})
    >>> values["A"]
    1.0
    >>> values["omga"]  # doctest: +ELLIPSIS
    Traceback (most recent call last):
    ...
    fastslow.errors.UnknownNameError: unknown parameter 'omga'; did you mean 'omega'? ...
    """

    __slots__ = ("_items", "type")

    type: str
    _items: dict[str, V]

    def __init__(self, type: str, items: Mapping[str, V] | Iterable[tuple[str, V]] = ()) -> None:
        pairs = items.items() if isinstance(items, Mapping) else items
        _set_type(self, type)
        _set_items(self, {normalised(str(key)): value for key, value in pairs})

    def __setattr__(self, name: str, value: object) -> None:
        raise AttributeError(f"cannot set '{name}': a mapping of names cannot be changed")

    def __delattr__(self, name: str) -> None:
        raise AttributeError(f"cannot delete '{name}': a mapping of names cannot be changed")

    def __copy__(self) -> NamedMapping[V]:
        return self

    def __reduce__(self) -> tuple[Any, ...]:
        return NamedMapping, (self.type, self._items)

    def __getitem__(self, key: object) -> V:
        try:
            return self._items[normalised(str(key))]
        except KeyError:
            raise unknown_name(self.type, key, self._items) from None

    def items(self) -> ItemsView[str, V]:
        """Return names and values in order."""
        return self._items.items()

    def get(self, key: object, default: V | None = None) -> V | None:  # type: ignore[override]
        """Return the value of a name, or the default."""
        return self._items.get(normalised(str(key)), default)

    def __contains__(self, key: object) -> bool:
        return normalised(str(key)) in self._items

    def __iter__(self) -> Iterator[str]:
        return iter(self._items)

    def __len__(self) -> int:
        return len(self._items)

    def __repr__(self) -> str:
        return "{" + ", ".join(f"{k}: {v}" for k, v in self._items.items()) + "}"

    def _caption(self) -> str:
        return ""

    def _cells(self) -> Cells:
        return Cells((self.type, "value"), [(k, value_text(v)) for k, v in self._items.items()])

    def __eq__(self, other: object) -> bool:
        if self is other:
            return True
        if isinstance(other, Mapping):
            given = {str(k): v for k, v in other.items()}
            return self._items.keys() == given.keys() and all(
                equal(value, given[key]) for key, value in self._items.items()
            )
        return NotImplemented

    def __hash__(self) -> int:
        return content_hash(self._items)

    def index(self, key: object) -> int:
        """Return the position of a name among the keys."""
        self[key]
        return list(self._items).index(normalised(str(key)))


# the descriptors of the slots, which bypass __setattr__
_set_type, _set_items = (vars(NamedMapping)[name].__set__ for name in ("type", "_items"))
