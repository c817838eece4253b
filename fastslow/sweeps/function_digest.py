"""Identity of a function: all code and all values that it reaches."""

from __future__ import annotations

import builtins
import copyreg
import enum
import functools
import hashlib
import inspect
import platform
import sys
import types
from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields, is_dataclass
from functools import cached_property, partial
from importlib import import_module
from importlib.util import resolve_name
from typing import Any

import numpy as np
import sympy as sp

from fastslow.errors import raised_by_handler
from fastslow.model.model import Model
from fastslow.model.tabulated import TableAtom, Tabulated
from fastslow.sweeps.code_references import codes_within, references
from fastslow.sweeps.libraries import PACKAGE, library_of, library_of_file, version_of

#: Entries of a class that do not determine what its methods compute, or that Python derives.
DERIVED = (
    "__abstractmethods__", "__annotations__", "__annotations_cache__", "__classcell__",
    "__dataclass_params__", "__dict__", "__doc__", "__firstlineno__", "__match_args__",
    "__module__", "__orig_bases__", "__parameters__", "__slotnames__", "__static_attributes__",
    "__weakref__", "_abc_impl",
)  # fmt: skip

#: Types of C code that is found by name.
NAMED = (
    types.BuiltinFunctionType, types.WrapperDescriptorType, types.MethodDescriptorType,
    types.ClassMethodDescriptorType, types.GetSetDescriptorType, types.MemberDescriptorType,
    types.MethodWrapperType, np.ufunc,
)  # fmt: skip

#: Attributes of a code object that determine what it computes, besides its constants.
OF_CODE = (
    "co_code", "co_exceptiontable", "co_flags", "co_argcount", "co_posonlyargcount",
    "co_kwonlyargcount", "co_names", "co_varnames", "co_freevars", "co_cellvars",
)  # fmt: skip

#: Values that are their own representation.
PLAIN = (bool, int, float, complex, str, bytes, types.NoneType, types.EllipsisType, range)


@dataclass(frozen=True)
class FunctionIdentity:
    """What a stored sweep records of its function.

    Parameters
    ----------
    name : str
        Module and qualified name.
    digest : str
        Of the byte code and all values that it reaches: defaults, closures, globals, attributes
        of modules, classes with their bases, and the state of objects. Installed packages
        are not followed.
    equations : str
        The models among them, as text.
    undigested : tuple of str
        Values that are not part of the digest: what cannot be known before the function is called,
        and compiled code of the user.
    libraries : mapping
        Versions of the installed packages that it reaches.
    """

    name: str
    digest: str
    equations: str
    undigested: tuple[str, ...]
    libraries: Mapping[str, str]


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
    try:
        walk.add("", function)
        walk.add_modules()
    except RecursionError:
        walk.undigested.append("values that are nested too deeply")
    plain = function
    while isinstance(plain, partial):
        plain = plain.func
    named = plain if hasattr(plain, "__qualname__") else type(plain)
    return FunctionIdentity(
        f"{named.__module__}.{named.__qualname__}",
        walk.hash.hexdigest(),
        "\n\n".join(dict.fromkeys(walk.equations)),
        tuple(dict.fromkeys(walk.undigested)),
        dict(sorted(walk.libraries.items())),
    )


def versions(identity: FunctionIdentity) -> dict[str, str]:
    """Return the versions on which the outputs of a function may depend."""
    fastslow = str(import_module("fastslow").__version__)
    python = ".".join(platform.python_version_tuple()[:2])
    known = {"fastslow": fastslow, "numpy": np.__version__, "python": python}
    return {**identity.libraries, **known}


def undigested_notes(identity: FunctionIdentity) -> tuple[str, ...]:
    """Return a sentence on the values that are not part of a digest, if there are any."""
    if not identity.undigested:
        return ()
    return (
        "A store cannot verify that these values of the function are unchanged: "
        f"{', '.join(identity.undigested)}.",
    )


class _Walk:
    """Feeds a digest with a value and all that it reaches."""

    def __init__(self) -> None:
        self.hash = hashlib.sha256()
        self.equations: list[str] = []
        self.undigested: list[str] = []
        self.libraries: dict[str, str] = {}
        #: Position and value by its address: values are kept, so that no address is used twice.
        self.seen: dict[int, tuple[int, Any]] = {}
        self.modules: dict[str, types.ModuleType] = {}
        self.names: set[str] = set()

    def put(self, *words: object) -> None:
        for word in words:
            content = word if isinstance(word, bytes) else str(word).encode()
            self.hash.update(b"%d:" % len(content) + content)

    def leave(self, name: str, value: Any) -> None:
        """Record a value that is not part of the digest."""
        self.put("undigested", type(value).__name__)
        self.undigested.append(f"{name or 'the function'} ({type(value).__name__})")

    def add(self, name: str, value: Any) -> None:
        """Add a value; ``name`` is where it was found."""
        if type(value) in PLAIN:
            self.put(type(value).__name__, repr(value))
        elif isinstance(value, np.generic | np.ndarray | Model | Tabulated | sp.Basic):
            self._constant(name, value)
        elif id(value) in self.seen:
            self.put("seen", self.seen[id(value)][0])
        else:
            self.seen[id(value)] = len(self.seen), value
            if not self._container(name, value) and not self._code_object(name, value):
                self._state(name, value)

    def add_modules(self) -> None:
        """Add the entries of the user's modules that have names used anywhere in the code."""
        added: set[tuple[str, str]] = set()
        while True:
            found = [
                (module, name)
                for module in self.modules
                for name in sorted(self.names & vars(self.modules[module]).keys())
                if (module, name) not in added
            ]
            if not found:
                return
            for module, name in found:
                added.add((module, name))
                self.put("entry", module, name)
                self.add(f"{module}.{name}", vars(self.modules[module])[name])

    def _constant(self, name: str, value: Any) -> None:
        """Add an array, a model or an expression, also where equal ones are one object."""
        if isinstance(value, np.generic | np.ndarray):
            self.put(type(value).__name__, value.dtype.str, value.shape)
            if isinstance(value, np.ma.MaskedArray):
                self.add(name, np.ma.getmaskarray(value))
                value = value.filled(value.dtype.type(0))
            if value.dtype.hasobject:
                self.add(name, value.tolist())
            else:
                self.put(value.dtype.descr, np.ascontiguousarray(value).tobytes())
        elif isinstance(value, Model):
            self.equations.append(value.equations)
            self.put("model", value.equations, value.parameters)
            self.put(self._apart(name, value.structure, {}))
        elif isinstance(value, Tabulated):
            self.put("table", value.interpolation)
            self.add(name, value.times)
            self.add(name, value.values)
        else:
            self.put("sympy", sp.srepr(value))
            for atom in sp.preorder_traversal(value):
                if isinstance(atom, TableAtom):
                    self.add(name, atom.table)

    def _container(self, name: str, value: Any) -> bool:
        """Add a container of Python; False for everything else."""
        if type(value) in (tuple, list):
            self.put(type(value).__name__, len(value))
            if all(type(item) in PLAIN for item in value):
                self.put(repr(value))
                return True
            for k, item in enumerate(value):
                self.add(f"{name}[{k}]", item)
        elif type(value) in (set, frozenset):
            plain = all(type(item) in PLAIN for item in value)
            self.put("set", *sorted(repr(v) if plain else self._apart(name, v) for v in value))
        elif type(value) in (dict, types.MappingProxyType):
            self.put("mapping", len(value))
            for key, item in value.items():
                self.add(f"a key of {name}", key)
                self.add(f"{name}[{key!r}]", item)
        else:
            return False
        return True

    def _apart(self, name: str, value: Any, seen: dict[int, tuple[int, Any]] | None = None) -> str:
        """Return the digest of one value: those of a set have no order."""
        walk = _Walk()
        walk.seen = dict(self.seen) if seen is None else seen
        walk.add(name, value)
        walk.add_modules()
        self.undigested += walk.undigested
        self.libraries |= walk.libraries
        return walk.hash.hexdigest()

    def _code_object(self, name: str, value: Any) -> bool:
        """Add a function, a method, a class or a module; False for everything else."""
        if isinstance(value, types.FunctionType):
            self._function(name, value)
        elif isinstance(value, types.CodeType):
            self._code(value)
        elif isinstance(value, type):
            self._class(name, value)
        elif isinstance(value, types.ModuleType):
            self._module(value)
        elif isinstance(value, types.MethodType):
            self._parts(name, value.__func__, value.__self__)
        elif isinstance(value, partial | functools.partialmethod):
            self._parts(name, value.func, value.args, value.keywords)
        elif isinstance(value, staticmethod | classmethod):
            self._parts(name, value.__func__)
        elif isinstance(value, property):
            self._parts(name, value.fget, value.fset, value.fdel)
        elif isinstance(value, cached_property):
            self._parts(name, value.func)
        elif isinstance(value, functools._lru_cache_wrapper):
            self._parts(name, value.__wrapped__)
        elif type(value).__module__.startswith("numba.") and hasattr(value, "py_func"):
            self._parts(name, value.py_func)
        elif isinstance(value, NAMED) or type(value).__name__ == "cython_function_or_method":
            self._named(name, value)
        else:
            return False
        return True

    def _parts(self, name: str, *parts: Any) -> None:
        self.put(len(parts))
        for part in parts:
            self.add(name, part)

    def _named(self, name: str, value: Any) -> None:
        """Add C code, which has a module, belongs to a class, or is bound to an object."""
        self.put(type(value).__name__, value.__name__)
        bound = getattr(value, "__self__", None)
        if bound is not None and not isinstance(bound, types.ModuleType):
            self.add(name, bound)
        elif (owner := getattr(value, "__objclass__", None)) is not None:
            self.add(name, owner)
        elif isinstance(value, np.ufunc):
            module = _module_of_ufunc(value)
            if module is None:
                self.leave(name, value)
            else:
                self._library(name, module, value)
        else:
            self._library(name, value.__module__, value)

    def _library(self, name: str, module: str | None, value: Any) -> bool:
        """Record the version of an installed package; False for a module of the user."""
        library = library_of(module)
        if library is None:
            if not isinstance(value, types.FunctionType | type | types.ModuleType):
                self.leave(name, value)
            return False
        self.put("library", module)
        self._version(library)
        return True

    def _version(self, library: str) -> None:
        if library not in ("fastslow", "python"):
            version = version_of(library)
            if version is None:
                self.undigested.append(f"{library} (a package without a version)")
            else:
                self.libraries[library] = version

    def _module(self, module: types.ModuleType) -> None:
        self.put("module", module.__name__)
        if not self._library(module.__name__, module.__name__, module):
            file = getattr(module, "__file__", None) or ""
            if file and not file.endswith((".py", ".pyc")):
                self.leave(module.__name__, module)
            self.modules.setdefault(module.__name__, module)

    def _class(self, name: str, value: type) -> None:
        self.put("class", value.__module__, value.__qualname__)
        if self._library(name, value.__module__, value):
            return
        if not value.__flags__ & HEAP:
            self.leave(name, value)  # compiled code of the user
            return
        for base in (*value.__bases__, type(value)):
            self.add(name, base)
        if isinstance(value, enum.EnumMeta):
            members: Mapping[str, enum.Enum] = value.__members__
            self.add(name, {key: one.value for key, one in members.items()})
        for key, entry in vars(value).items():
            slot = isinstance(entry, types.MemberDescriptorType)
            member = isinstance(entry, value) and isinstance(value, enum.EnumMeta)
            if key in DERIVED or slot or member or key.startswith(("_member", "_value2member")):
                continue
            self.put(key)
            if getattr(entry, "__objclass__", None) is value:
                self.leave(f"{value.__qualname__}.{key}", entry)  # compiled code of the user
                continue
            if key == "__dataclass_fields__":
                for one in entry.values():
                    self.put(one.name)
                    self._parts(f"{name}.{one.name}", one.default, one.default_factory)
            else:
                self.add(f"{value.__qualname__}.{key}", entry)

    def _state(self, name: str, value: Any) -> None:
        """Add the class of an object and its state, as for a copy of it."""
        kind = type(value)
        self.add(name, kind)
        if isinstance(value, enum.Enum):
            self.put(value.name)
            return
        if library_of(kind.__module__) == PACKAGE.name and is_dataclass(value):
            for entry in fields(value):
                if not entry.metadata.get("live"):
                    self.add(f"{name}.{entry.name}", getattr(value, entry.name))
            return
        try:
            reducer = copyreg.dispatch_table.get(kind)
            reduced = reducer(value) if reducer else value.__reduce_ex__(4)
        except Exception as error:
            if raised_by_handler(error):
                raise
            self.leave(name, value)
            return
        if isinstance(reduced, str):
            self.put(reduced)
            return
        maker, given, state, items, pairs = (*reduced, None, None, None)[:5]
        own = any({"__reduce__", "__reduce_ex__"} & vars(c).keys() for c in kind.__mro__[:-1])
        if hasattr(value, "__dict__") and not (own and library_of(kind.__module__)):
            for key, item in value.__dict__.items():
                if not isinstance(inspect.getattr_static(kind, key, None), cached_property):
                    self.put(key)
                    self.add(f"{name}.{key}", item)
            # the rest of the state are slots
            state = state[1] if isinstance(state, tuple) and len(state) == 2 else None
        self.add(name, maker)
        for part in (given, state, items and list(items), pairs and list(pairs)):
            self.add(name, part)

    def _function(self, name: str, function: types.FunctionType) -> None:
        self.put("function", function.__module__, function.__qualname__)
        if _is_installed(function):
            self._library(name, function.__module__, function)
            return
        library = library_of_file(function.__code__.co_filename)
        if library is None:
            self._code(function.__code__)
            self._globals(function)
        else:
            self._version(library)  # a wrapper, whose closure has a function of the user
        place = function.__qualname__
        self._parts(f"a default of {place}", function.__defaults__, function.__kwdefaults__)
        self.add(place, function.__dict__)
        for free, cell in zip(
            function.__code__.co_freevars, function.__closure__ or (), strict=True
        ):
            try:
                self.add(free, cell.cell_contents)
            except ValueError:
                self.put("empty", free)

    def _globals(self, function: types.FunctionType) -> None:
        """Add the globals that a function names, and the modules that it imports."""
        found = references(function.__code__)
        self.names.update(found.names)
        for call in found.dynamic:
            name = call.split()[0]
            known = getattr(builtins, name, import_module)
            if function.__globals__.get(name, known) is known:
                self.put(call)
                self.undigested.append(f"{call} of {function.__module__}")
        for given, level in found.imports:
            self._import(given, level, function.__globals__.get("__package__") or "")
        for name in found.names:
            if name in function.__globals__:
                self.put(name)
                self.add(name, function.__globals__[name])
            elif hasattr(builtins, name):
                self.put(name)

    def _import(self, given: str, level: int, package: str) -> None:
        """Add a module that is imported when a function is called, and its packages."""
        try:
            name = resolve_name("." * level + given, package)
            import_module(name)
        except Exception as error:
            if raised_by_handler(error):
                raise
            self.put("absent", given)
            return
        parts = name.split(".")
        for k in range(len(parts)):
            self.add(name, sys.modules[".".join(parts[: k + 1])])

    def _code(self, code: types.CodeType) -> None:
        for part in codes_within(code):
            self.put(*(getattr(part, name) for name in OF_CODE))
            for constant in part.co_consts:
                if not isinstance(constant, types.CodeType):
                    self.add("constant", constant)


#: The flag of classes that are created at run time, as all classes of Python code are.
HEAP = 1 << 9


def _is_installed(function: types.FunctionType) -> bool:
    """Return True for a function of an installed module, found there by its name."""
    if library_of(function.__module__) is None:
        return False
    found: Any = sys.modules.get(function.__module__)
    for part in function.__qualname__.split("."):
        found = inspect.getattr_static(found, part, None)
    unwrapped: Callable[..., Any] = getattr(found, "__func__", found)
    return unwrapped is function or isinstance(found, property | cached_property)


def _module_of_ufunc(value: np.ufunc) -> str | None:
    """Return the module that has a ufunc; those made by ``numpy.frompyfunc`` have none."""
    for module in ("numpy", "scipy.special"):
        if getattr(sys.modules.get(module), value.__name__, None) is value:
            return module
    return None
