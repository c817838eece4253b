"""Identity of a function: its code, defaults and the values that it refers to."""

from __future__ import annotations

import builtins
import hashlib
import inspect
import platform
import types
from collections.abc import Mapping
from dataclasses import dataclass, fields, is_dataclass
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import sympy as sp

from fastslow.model.model import Model
from fastslow.model.tabulated import TableAtom, Tabulated

#: The folder of this package.
PACKAGE = Path(__file__).parents[1]


@dataclass(frozen=True)
class FunctionIdentity:
    """What a stored sweep records of its function.

    Parameters
    ----------
    name : str
        Module and qualified name.
    digest : str
        Of the byte code, defaults, and values of the closure and of globals that it names;
        functions outside installed packages are followed.
    equations : str
        The models among them, as text.
    undigested : tuple of str
        Values that are not part of the digest.
    """

    name: str
    digest: str
    equations: str
    undigested: tuple[str, ...]


def identity_of(function: Any) -> FunctionIdentity:
    """Return the identity of a function.

    Examples
    --------
    >>> def shifted(c):
    ...     return lambda x: x + c
    >>> identity_of(shifted(1)).digest == identity_of(shifted(1)).digest
    True
    >>> identity_of(shifted(1)).digest == identity_of(shifted(2)).digest
    False
    """
    walk = _Walk()
    walk.add("", function)
    plain = function
    while isinstance(plain, partial):
        plain = plain.func
    named = plain if hasattr(plain, "__qualname__") else type(plain)
    return FunctionIdentity(
        f"{named.__module__}.{named.__qualname__}",
        walk.hash.hexdigest(),
        "\n\n".join(dict.fromkeys(walk.equations)),
        tuple(dict.fromkeys(walk.undigested)),
    )


def versions() -> dict[str, str]:
    """Return the versions on which the outputs may depend."""
    fastslow = str(import_module("fastslow").__version__)
    python = ".".join(platform.python_version_tuple()[:2])
    return {"fastslow": fastslow, "numpy": np.__version__, "python": python}


def undigested_notes(identity: FunctionIdentity) -> tuple[str, ...]:
    """Return a sentence on the values that are not part of a digest, if there are any."""
    if not identity.undigested:
        return ()
    return (
        "A store cannot verify that these values of the function are unchanged: "
        f"{', '.join(identity.undigested)}.",
    )


class _Walk:
    """Feeds a digest with a value and all that it refers to."""

    def __init__(self) -> None:
        self.hash = hashlib.sha256()
        self.equations: list[str] = []
        self.undigested: list[str] = []
        self.seen: dict[int, Any] = {}

    def put(self, *words: object) -> None:
        for word in words:
            content = word if isinstance(word, bytes) else str(word).encode()
            self.hash.update(b"%d:" % len(content) + content)

    def add(self, name: str, value: Any) -> None:
        """Add a value; ``name`` is where it was found."""
        if value is None or isinstance(value, bool | int | float | complex | str | bytes):
            self.put(type(value).__name__, repr(value))
        elif isinstance(value, np.generic | np.ndarray) and not value.dtype.hasobject:
            self.put("array", value.dtype.str, value.shape, np.ascontiguousarray(value).tobytes())
        elif id(value) in self.seen:
            self.put("seen", list(self.seen).index(id(value)))
        else:
            self.seen[id(value)] = value
            self._compound(name, value)

    def _compound(self, name: str, value: Any) -> None:
        if isinstance(value, tuple | list):
            self.put(type(value).__name__, len(value))
            for k, item in enumerate(value):
                self.add(f"{name}[{k}]", item)
        elif isinstance(value, set | frozenset):
            self.put("set", *sorted(map(repr, value)))
        elif isinstance(value, Mapping):
            self.put("mapping", len(value))
            for key, item in value.items():
                self.put(key)
                self.add(f"{name}[{key!r}]", item)
        elif isinstance(value, Model):
            self.equations.append(value.equations)
            self.put("model", value.equations)
            self.add(name, dict(value.parameters))
            self.add(name, value.structure)
        elif isinstance(value, Tabulated):
            self.put("table", value.interpolation)
            self.add(name, value.times)
            self.add(name, value.values)
        elif isinstance(value, partial):
            for part in (value.func, value.args, value.keywords):
                self.add(name, part)
        elif isinstance(value, types.MethodType):
            self.add(name, value.__func__)
            self.add(name, value.__self__)
        elif isinstance(value, types.ModuleType):
            self.put("module", value.__name__)
        elif callable(getattr(value, "py_func", None)):
            self.add(name, value.py_func)  # compiled by Numba
        elif isinstance(value, types.FunctionType):
            self._function(value)
        elif isinstance(value, type | types.BuiltinFunctionType | np.ufunc):
            self.put("named", getattr(value, "__module__", ""), value.__name__)
            for method in vars(value).values() if isinstance(value, type) else ():
                if isinstance(method, types.FunctionType):
                    self._function(method)
        elif is_dataclass(value):
            self.put(type(value).__module__, type(value).__qualname__)
            for entry in fields(value):
                if not entry.metadata.get("live"):
                    self.add(f"{name}.{entry.name}", getattr(value, entry.name))
            self._called(value)
        elif isinstance(value, sp.Basic):
            self.put("sympy", value)
            for atom in sp.preorder_traversal(value):
                if isinstance(atom, TableAtom):
                    self.add(name, atom.table)
        elif callable(value) and hasattr(value, "__dict__"):
            self.put(type(value).__module__, type(value).__qualname__)
            self.add(name, vars(value))
            self._called(value)
        else:
            self.put("undigested", type(value).__name__)
            self.undigested.append(f"{name} ({type(value).__name__})")

    def _called(self, value: Any) -> None:
        call = inspect.getattr_static(type(value), "__call__", None)
        if isinstance(call, types.FunctionType):
            self._function(call)

    def _function(self, function: types.FunctionType) -> None:
        self.put("function", function.__module__, function.__qualname__)
        if _installed(function):
            return
        self._code(function.__code__)
        self.add("defaults", function.__defaults__)
        self.add("defaults", function.__kwdefaults__)
        for name, cell in zip(
            function.__code__.co_freevars, function.__closure__ or (), strict=True
        ):
            try:
                self.add(name, cell.cell_contents)
            except ValueError:
                self.put("empty", name)
        for name in _names(function.__code__):
            if name in function.__globals__:
                self.put(name)
                self.add(name, function.__globals__[name])
            elif hasattr(builtins, name):
                self.put(name)

    def _code(self, code: types.CodeType) -> None:
        self.put(code.co_code, code.co_names, code.co_varnames, code.co_freevars)
        for constant in code.co_consts:
            if isinstance(constant, types.CodeType):
                self._code(constant)
            else:
                self.add("constant", constant)


def _installed(function: types.FunctionType) -> bool:
    """Return True for functions of installed packages, which have versions."""
    path = Path(function.__code__.co_filename)
    return PACKAGE in path.parents or not {"site-packages", "dist-packages"}.isdisjoint(path.parts)


def _names(code: types.CodeType) -> list[str]:
    """Return the names of globals that a code refers to, also in functions inside it."""
    found = list(code.co_names)
    for constant in code.co_consts:
        if isinstance(constant, types.CodeType):
            found += _names(constant)
    return list(dict.fromkeys(found))
