"""Bit-exact encoding of results as JSON text and arrays, and decoding.

Text and numbers are encoded as JSON; large arrays are stored separately under names such
as ``branches/0/state``, small ones in the text itself. Only classes of `fastslow.results`
are instantiated.
"""

from __future__ import annotations

import math
import struct
import warnings
from collections.abc import Callable, Iterator, Mapping
from dataclasses import MISSING, Field, fields, is_dataclass
from functools import cache
from importlib import import_module
from pkgutil import walk_packages
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fastslow.errors import ArgumentError, raised_by_handler
from fastslow.results.base.immutable import ImmutableSequence
from fastslow.results.base.named_mapping import NamedMapping
from fastslow.results.base.outcome import Outcome

Array = NDArray[Any]

#: Returns an array by name and type.
Arrays = Callable[[str, str], Array]

#: Largest size of arrays that are stored in the text.
STORED_IN_TEXT = 16

#: Types of arrays that are stored in the text.
INLINE = ("<f8", "<c16", "<i8", "|b1")

_NUMBERS = {"nan": math.nan, "-nan": -math.nan, "inf": math.inf, "-inf": -math.inf}


class BrokenError(Exception):
    """The content of a file is not a valid result of this version."""


@cache
def classes() -> dict[str, type[Any]]:
    """Return every dataclass of the results by name."""
    return {name: one for name, one in _public() if is_dataclass(one)}


@cache
def _sequences() -> dict[str, type[Any]]:
    """Return every type of sequence by name."""
    tables = {name: one for name, one in _public() if issubclass(one, ImmutableSequence)}
    leaves = {name: one for name, one in tables.items() if not one.__subclasses__()}
    return {"list": list, "tuple": tuple, **leaves}


def _public() -> Iterator[tuple[str, type[Any]]]:
    """Yield every public class of the results with its name."""
    package = "fastslow.results"
    for entry in walk_packages(import_module(package).__path__, f"{package}."):
        module = import_module(entry.name)
        for name, value in vars(module).items():
            own = isinstance(value, type) and value.__module__ == module.__name__
            if own and not name.startswith("_"):
                yield name, value


def encoded(value: Any, path: str, arrays: dict[str, Array]) -> Any:
    """Encode a result as a JSON tree; its large arrays are added to ``arrays``.

    Parameters
    ----------
    value : object
    path : str
        Where it is in the result, the name of its array.
    arrays : dict
        Filled.

    Raises
    ------
    ArgumentError
        For something that cannot be kept, with its place.
    """
    if isinstance(value, np.generic):
        value = value.item()
    if value is None or isinstance(value, bool | int | str):
        return value
    if isinstance(value, float):
        return value if math.isfinite(value) else {"float": _name(value)}
    if isinstance(value, complex):
        return {"complex": [encoded(v, path, arrays) for v in (value.real, value.imag)]}
    if isinstance(value, np.ndarray):
        return _array(value, path, arrays)
    if isinstance(value, list | tuple):
        items = [encoded(v, f"{path}/{k}", arrays) for k, v in enumerate(value)]
        node = _sequence(value, items, path)
        attributes = value._attributes() if isinstance(value, ImmutableSequence) else {}
        for name, part in attributes.items():
            # the outcome of a failure is false
            if isinstance(part, np.ndarray | Outcome) or part:
                node[name] = encoded(part, f"{path}/{name}", arrays)
        return node
    if isinstance(value, Mapping):
        return _mapping(value, path, arrays)
    if classes().get(type(value).__name__) is type(value):
        return _record(value, path, arrays)
    raise ArgumentError(f"{path or 'this'} is a {type(value).__name__}, which no file can keep")


def _array(value: Array, path: str, arrays: dict[str, Array]) -> Any:
    if value.dtype.hasobject or value.dtype.kind not in "biufcU":
        raise ArgumentError(f"{path} is an array of {value.dtype}, which no file can keep")
    if value.size <= STORED_IN_TEXT and value.dtype.str in INLINE:
        flat = np.ascontiguousarray(value).reshape(-1)
        plain = flat.view(np.float64) if value.dtype.kind == "c" else flat
        numbers = [v if math.isfinite(v) else repr(v) for v in plain.tolist()]
        node = {"numbers": numbers, "dtype": value.dtype.str, "shape": list(value.shape)}
        if _small(node).tobytes() == flat.tobytes():
            return node
    arrays[path] = value
    return {"array": path, "dtype": value.dtype.str, "shape": list(value.shape)}


def _name(value: float) -> str:
    """Return the key in `_NUMBERS` of a non-finite float, or the bytes of another NaN."""
    known = (name for name, one in _NUMBERS.items() if _bits(one) == _bits(value))
    return next(known, _bits(value).hex())


def _bits(value: float) -> bytes:
    return struct.pack("<d", value)


def _float(name: str) -> float:
    return _NUMBERS[name] if name in _NUMBERS else struct.unpack("<d", bytes.fromhex(name))[0]


def _small(node: dict[str, Any]) -> Array:
    numbers = [_NUMBERS[v] if isinstance(v, str) else v for v in node["numbers"]]
    if node["dtype"] not in INLINE:
        raise BrokenError(f"it holds numbers of type {str(node['dtype'])[:40]}")
    kind = np.dtype(node["dtype"])
    if kind.kind == "c":
        return np.array(numbers, dtype=np.float64).view(kind).reshape(node["shape"])
    return np.array(numbers, dtype=kind).reshape(node["shape"])


def _sequence(value: Any, items: list[Any], path: str) -> Any:
    name = type(value).__name__
    if _sequences().get(name) is not type(value):
        raise ArgumentError(f"{path or 'this'} is a {name}, which no file can keep")
    return {name: items}


def _mapping(value: Mapping[Any, Any], path: str, arrays: dict[str, Array]) -> Any:
    for key in value:
        if type(key) is not str:
            raise ArgumentError(f"{path} has the key {key!r}; files keep names only")
    entries = [[key, encoded(v, f"{path}/{_safe(key)}", arrays)] for key, v in value.items()]
    if isinstance(value, NamedMapping):
        return {"named": value.type, "entries": entries}
    return {"mapping": entries}


def _safe(name: str) -> str:
    """Escape a name for use in the name of an array."""
    return "".join(c if c.isalnum() or c in "_-" else f"%{ord(c):x}" for c in name) or "%"


def _record(value: Any, path: str, arrays: dict[str, Array]) -> Any:
    kept = {}
    for entry in fields(value):
        if entry.metadata.get("live") and not _is_stored(entry):
            continue
        part = getattr(value, entry.name)
        if _is_stored(entry):
            part = _stored(value)
            if part is None:
                continue
        where = f"{path}/{entry.name}" if path else entry.name
        kept[entry.name] = encoded(part, where, arrays)
    return {"class": type(value).__name__, "fields": kept}


def _stored(value: Any) -> Any:
    """Return the stored model of a result, None without one.

    Where it cannot be made the result is kept without it, with a warning: numbers are not lost
    because of equations.
    """
    try:
        found = value.stored_model
    except Exception as error:
        if raised_by_handler(error):
            raise
        warnings.warn(
            f"the model of this {type(value).__name__} is not kept in the file: {error}",
            RuntimeWarning,
            stacklevel=2,
        )
        return None
    return found if _is_model(found) else None


def _is_model(value: Any) -> bool:
    return isinstance(value, classes()["StoredModel"])


def _is_stored(entry: Field[Any]) -> bool:
    return bool(entry.metadata.get("stored"))


def decoded(node: Any, arrays: Arrays) -> Any:
    """Decode a result from a JSON tree.

    Parameters
    ----------
    node : object
    arrays : callable
        Gives an array by name and type.

    Raises
    ------
    BrokenError
        For anything that `encoded` does not write.
    """
    if not isinstance(node, dict):
        return node
    try:
        return _built(node, arrays)
    except (KeyError, TypeError, ValueError, AttributeError, IndexError, struct.error) as error:
        raise BrokenError(f"it does not read as a result ({error!r})") from None


def _built(node: dict[str, Any], arrays: Arrays) -> Any:
    if "class" in node:
        return _object(node, arrays)
    if "array" in node:
        array = arrays(node["array"], node["dtype"])
        if array.dtype.str != node["dtype"] or list(array.shape) != node["shape"]:
            raise BrokenError(f"the array {node['array']} is not as its description says")
        return array
    if "numbers" in node:
        return _small(node)
    if "float" in node:
        return _float(node["float"])
    if "complex" in node:
        return complex(*(decoded(part, arrays) for part in node["complex"]))
    if "mapping" in node:
        return {key: decoded(value, arrays) for key, value in node["mapping"]}
    if "named" in node:
        pairs = [(key, decoded(value, arrays)) for key, value in node["entries"]]
        return NamedMapping(node["named"], pairs)
    for name, build in _sequences().items():
        if name in node:
            items = [decoded(value, arrays) for value in node[name]]
            return build(items, **{k: decoded(v, arrays) for k, v in node.items() if k != name})
    raise BrokenError(f"it holds something unknown ({', '.join(node)})")


def _object(node: dict[str, Any], arrays: Arrays) -> Any:
    name = node["class"]
    if name not in classes():
        raise BrokenError(f"it holds a {name}, which this version does not know")
    known = {entry.name: entry for entry in fields(classes()[name])}
    values = {key: decoded(value, arrays) for key, value in node["fields"].items()}
    for key in values:
        live = key in known and known[key].metadata.get("live") and not _is_stored(known[key])
        if key not in known or live:
            raise BrokenError(f"its {name} has a field {key}, which this version does not know")
    for key, entry in known.items():
        optional = entry.default is not MISSING or entry.default_factory is not MISSING
        if key not in values and not optional:
            raise BrokenError(f"its {name} lacks the field {key}")
        if _is_stored(entry) and not (values.get(key) is None or _is_model(values[key])):
            raise BrokenError(f"the {key} of its {name} is no stored model")
    built = classes()[name](**values)
    if _is_model(built):
        built.check()
    return built
