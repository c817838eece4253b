"""Loops shared by all models: machine code called with numbers, arrays and records.

The code of a loop is shipped with this package, else read from the cache of the user, else
compiled by Numba and stored in the cache. All three are object files of one format, so that
only compilation imports Numba.
"""

from __future__ import annotations

import hashlib
import os
import platform
import sys
import threading
import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from importlib.metadata import version
from importlib.util import find_spec
from typing import Any

from fastslow.errors import MissingPackageError
from fastslow.kernels.compiler import shipped, store
from fastslow.kernels.compiler.calling import caller, entry_source
from fastslow.kernels.compiler.digest import digest_of_imports
from fastslow.kernels.compiler.loop_target import ENTRY, platform_name
from fastslow.kernels.compiler.machine_code import Address, load_object
from fastslow.kernels.compiler.signals import between_passes, deferring_signals

#: Import of the compiler, part of the key of every loop.
_MAKER = "from fastslow.kernels.compiler import loop_compiler\n"

_lock = threading.RLock()


@dataclass(frozen=True, eq=False)
class Entry(ABC):
    """A function that is compiled once for all models.

    Parameters
    ----------
    module, function : str
        Its source, e.g. ``"fastslow.continuation.engine"`` and ``"trace"``.
    """

    module: str
    function: str

    @property
    @abstractmethod
    def source(self) -> str:
        """Source of the compiled module: an entry function that calls this one."""

    @property
    def key(self) -> str:
        """Everything that the code depends on except the versions of the compilers."""
        source = self.source
        return "\n".join((platform_name(), digest_of_imports(_MAKER + source), source))

    @property
    def name(self) -> str:
        """Name of the object in an installation."""
        return f"{self.function}_{_digest(self.key)}"


@dataclass(frozen=True, eq=False)
class Loop(Entry):
    """A compiled function called from Python.

    Parameters
    ----------
    arguments : mapping
        Kind of each argument by its name: ``int``, ``float``, ``bool``, an array or a record of
        `fastslow.kernels.compiler.records`.
    results : tuple of type
        Types of the returned numbers: one, several as a tuple, or none.
    kept : tuple of str
        Records that are usually those of the last call, which stay in memory.
    read : tuple of str
        Arguments that it does not write to; their arrays may be read-only.
    """

    arguments: Mapping[str, Any]
    results: tuple[type, ...] = ()
    kept: tuple[str, ...] = ()
    read: tuple[str, ...] = ()

    @property
    def source(self) -> str:
        return entry_source(self.module, self.function, self.arguments)


def _digest(key: str) -> str:
    return hashlib.sha256(key.encode()).hexdigest()[:24]


@cache
def load_loop(loop: Loop) -> Callable[..., Any]:
    """Load a loop as a Python function of positional arguments.

    See `fastslow.kernels.compiler.calling.caller`.
    """
    address = load_address(loop)
    return caller(loop.function, loop.arguments, loop.results, address, loop.kept, loop.read)


@cache
def load_address(entry: Entry) -> Address:
    """Load a function, compiled if necessary, and return its address."""
    with _lock:
        return deferring_signals(_loaded, entry)


def _loaded(entry: Entry) -> Address:
    return load_object(code_of(entry), ENTRY, {})


def code_of(entry: Entry) -> bytes:
    """Object of a function: shipped, else cached, else compiled now."""
    code = shipped.read(entry.name)
    return _kept(entry) if code is None else code


def _kept(entry: Entry) -> bytes:
    """Code from the cache of the user, compiled if missing.

    Raises
    ------
    MissingPackageError
        If Numba is not installed.
    """
    if find_spec("numba") is None:
        raise MissingPackageError(
            f"{shipped.missing()}, so that {entry.module}.{entry.function} must be compiled by "
            "Numba, which is not installed: pip install numba"
        )
    name = f"fastslow_{entry.function}_{_digest(entry.key + _versions())}"
    code = store.read(name)
    if code is None:
        with store.exclusively(name, between_passes):
            # another process may have compiled it meanwhile
            code = store.read(name)
            if code is None:
                code = compiled(entry, shipped.missing())
                store.write(name, code)
    return code


def compiled(entry: Entry, reason: str) -> bytes:
    """Compile a function, and report it in one line on standard error.

    Parameters
    ----------
    entry : Entry
    reason : str
        Reason of the compilation, for the report.
    """

    def say(text: str) -> None:
        print(text, end="", file=sys.stderr, flush=True)

    began = time.monotonic()
    say(f"fastslow compiles {entry.module}.{entry.function} ({reason})")
    try:
        from fastslow.kernels.compiler.loop_compiler import compiled_object

        code = compiled_object(entry.source, entry.function)
    except BaseException:
        say(": not finished\n")
        raise
    say(f": {time.monotonic() - began:.1f} s\n")
    return code


@cache
def _versions() -> str:
    packages = (f"{name} {version(name)}" for name in ("numba", "llvmlite", "numpy"))
    settings = sorted(f"{k}={v}" for k, v in os.environ.items() if k.startswith("NUMBA_"))
    return "|".join((*packages, platform.python_version(), *settings))
