"""Immutability of results: arrays, mappings and sequences are read-only.

An array stored in a result is copied unless it is read-only already, so that later changes
of the original do not affect the result. NumPy lets the owner of an array make it writeable
again (``array.flags.writeable = True``); this is not prevented.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import fields
from functools import cache, cached_property
from inspect import get_annotations, isfunction
from operator import is_
from typing import Any, Self

import numpy as np

from fastslow.arguments import like
from fastslow.results.base.display import LINES, Displayed
from fastslow.results.base.equality import content_hash, equal
from fastslow.results.base.html import Cells
from fastslow.results.base.named_mapping import NamedMapping

#: Immutable types, stored as they are.
PLAIN = frozenset({float, int, bool, str, type(None)})

#: Names in the return annotation of a method that returns arrays.
ARRAYS = ("Array", "Floats", "Integers", "Bits", "Any")


def fixed(name: str, value: Any) -> Any:
    """Return the value of a field as stored: read-only and not shared with a writable array.

    Examples
    --------
    >>> given = np.zeros(2)
    >>> kept = fixed("state", given)
    >>> given[0] = 1.0
    >>> kept, kept.flags.writeable
    (array([0., 0.]), False)
    >>> fixed("state", kept) is kept
    True
    """
    kind = type(value)
    if kind in PLAIN:
        return value
    if isinstance(value, np.ndarray):
        return value if _out_of_reach(value) else read_only(np.array(value))
    if kind is tuple and PLAIN.issuperset(map(type, value)):
        return value
    if kind in (list, tuple):
        items = [item if type(item) in PLAIN else fixed(name, item) for item in value]
        same = kind is tuple and all(map(is_, items, value))
        return value if same else tuple(items)
    if kind is NamedMapping:
        kept = {k: v if type(v) in PLAIN else fixed(k, v) for k, v in value.items()}
        same = all(kept[key] is item for key, item in value.items())
        return value if same else NamedMapping(value.type, kept)
    if isinstance(value, Mapping):
        kept = {k: v if type(v) in PLAIN else fixed(str(k), v) for k, v in value.items()}
        return NamedMapping(name.replace("_", " ").removesuffix("s"), kept)
    return value


def _out_of_reach(array: np.ndarray[Any, Any]) -> bool:
    """Return True if an array and every array it is a view of are read-only."""
    part: Any = array
    while isinstance(part, np.ndarray):
        if part.flags.writeable:
            return False
        part = part.base
    return part is None


def read_only(value: Any) -> Any:
    """Make the arrays of a new value (also those in tuples and mappings) read-only."""
    if isinstance(value, np.ndarray):
        value.flags.writeable = False
    elif isinstance(value, Mapping):
        for item in value.values():
            read_only(item)
    elif type(value) in (list, tuple):
        for item in value:
            read_only(item)
    return value


class ReadOnly:
    """Base class whose methods and properties annotated with arrays return them read-only."""

    def __init_subclass__(cls, **kwargs: Any) -> None:
        super().__init_subclass__(**kwargs)
        for name, member in list(vars(cls).items()):
            if isinstance(member, property) and _hands_out_arrays(member.fget):
                assert member.fget is not None
                setattr(cls, name, member.getter(_closed(member.fget)))
            elif isinstance(member, cached_property) and _hands_out_arrays(member.func):
                member.func = _closed(member.func)
            elif isfunction(member) and name != "__init__" and _hands_out_arrays(member):
                setattr(cls, name, _closed(member))


def _hands_out_arrays(function: Callable[..., Any] | None) -> bool:
    returned = str(getattr(function, "__annotations__", {}).get("return", ""))
    return any(word in returned for word in ARRAYS)


def _closed(function: Callable[..., Any]) -> Callable[..., Any]:
    close = read_only

    def closed(*args: Any, **kwargs: Any) -> Any:
        return close(function(*args, **kwargs))

    return like(function, closed)


class Immutable(ReadOnly, Displayed):
    """A frozen dataclass with read-only content, compared by content.

    Fields that exist only in this process (the model behind a diagram) are neither compared
    nor pickled. A copy is the object itself.
    """

    def __post_init__(self) -> None:
        own = self.__dict__
        for name, value in own.items():
            if type(value) not in PLAIN:
                own[name] = fixed(name, value)

    @classmethod
    def of_fixed(cls, shared: Mapping[str, Any], **own: Any) -> Self:
        """Return an instance whose fields, all of them given, are read-only already."""
        made = object.__new__(cls)
        made.__dict__.update(shared, **own)
        return made

    def __copy__(self) -> Self:
        return self

    def __deepcopy__(self, memo: object) -> Self:
        return self

    def __getstate__(self) -> dict[str, Any]:
        # neither cached properties nor fields that exist only in this process
        known = {entry.name: entry for entry in fields(self)}  # type: ignore[arg-type]
        return {
            name: None if known[name].metadata.get("live") else value
            for name, value in self.__dict__.items()
            if name in known
        }

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update({name: read_only(value) for name, value in state.items()})

    def _content(self) -> tuple[Any, ...]:
        known = fields(self)  # type: ignore[arg-type]
        return tuple(getattr(self, e.name) for e in known if not e.metadata.get("live"))

    def __eq__(self, other: object) -> bool:
        if type(other) is not type(self):
            return NotImplemented
        return self is other or equal(self._content(), other._content())

    def __hash__(self) -> int:
        return content_hash((type(self).__name__, self._content()))


class ImmutableSequence(ReadOnly, Displayed):
    """A tuple of results whose attributes are set once, in ``__new__``."""

    def _heading(self) -> str:
        """Return the first line of the repr."""
        return type(self).__name__

    def _caption(self) -> str:
        return self._heading()

    def _cells(self) -> Cells:
        items: tuple[Any, ...] = tuple(self)  # type: ignore[arg-type]
        return Cells(
            ("", ""), [(str(k), repr(item).split("\n")[0]) for k, item in enumerate(items)]
        )

    def __repr__(self) -> str:
        items: tuple[Any, ...] = tuple(self)  # type: ignore[arg-type]
        shown = LINES - 1 if len(items) < LINES else LINES - 2
        lines = [self._heading(), *(f"  {item!r}" for item in items[:shown])]
        if len(items) > shown:
            lines.append(f"  … {len(items) - shown} more")
        return "\n".join(lines)

    def __setattr__(self, name: str, value: object) -> None:
        if name in self.__dict__ or name not in self._attribute_names():
            raise AttributeError(f"cannot set '{name}' of {type(self).__name__}")
        super().__setattr__(name, value)

    def __delattr__(self, name: str) -> None:
        raise AttributeError(f"cannot delete '{name}' of {type(self).__name__}")

    @classmethod
    @cache
    def _attribute_names(cls) -> tuple[str, ...]:
        return tuple(
            n for c in reversed(cls.__mro__) for n in get_annotations(c) if not n.startswith("_")
        )

    def _attributes(self) -> dict[str, Any]:
        """Return the attributes, which are the further arguments of ``__new__``, by name."""
        return {name: getattr(self, name) for name in self._attribute_names()}

    def __getnewargs__(self) -> tuple[Any, ...]:
        return tuple(self), *self._attributes().values()  # type: ignore[arg-type]

    def __copy__(self) -> Self:
        return self

    def __deepcopy__(self, memo: object) -> Self:
        return self
