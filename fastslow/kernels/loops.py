"""Loops that serve every model: machine code that Python calls with numbers, arrays and records.

The code of a loop is looked for in three places: among what this package brings with it, on the
user's disk, and, where neither has it, it is compiled by Numba and kept on disk. All three are
objects of one form, so that only the last one imports Numba.
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
from typing import Any

from fastslow.kernels.cache import shipped, store
from fastslow.kernels.cache.digest import digest_of_imports
from fastslow.kernels.calling import caller, entry_source
from fastslow.kernels.loop_target import ENTRY, platform_name
from fastslow.kernels.machine_code import load_object
from fastslow.kernels.signals import between_passes, deferring_signals

#: Where everything is that loops are made by.
_MAKER = "from fastslow.kernels import loop_compiler\n"

_lock = threading.RLock()


@dataclass(frozen=True, eq=False)
class Entry(ABC):
    """A function of this package that is compiled once for all models.

    Parameters
    ----------
    module, function : str
        Where its source is, e.g. ``"fastslow.continuation.engine"`` and ``"trace"``.
    """

    module: str
    function: str

    @property
    @abstractmethod
    def source(self) -> str:
        """The module that Numba compiles: a function of a pointer that calls this one."""

    @property
    def key(self) -> str:
        """All that its code depends on but the versions of what compiles it."""
        source = self.source
        return "\n".join((platform_name(), digest_of_imports(_MAKER + source), source))

    @property
    def name(self) -> str:
        """Name of its object in an installation."""
        return f"{self.function}_{_digest(self.key)}"


@dataclass(frozen=True, eq=False)
class Loop(Entry):
    """A function that Python calls.

    Parameters
    ----------
    arguments : mapping
        Kind of each argument by its name: ``int``, ``float``, ``bool``, an array or a record of
        `fastslow.kernels.records`.
    results : tuple of type
        Numbers that it returns: one, several as a tuple, or none.
    kept : tuple of str
        Records that are most often the ones of the last call, and stay in memory.
    read : tuple of str
        Arguments that it writes nothing to; their arrays may be read-only.
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
    """A loop in the form that is called from Python, with its arguments by their positions.

    See `fastslow.kernels.calling.caller`.
    """
    address = load_address(loop)
    return caller(loop.function, loop.arguments, loop.results, address, loop.kept, loop.read)


@cache
def load_address(entry: Entry) -> int:
    """The address of a function, which is compiled if its code is not at hand."""
    with _lock:
        return deferring_signals(_loaded, entry)


def _loaded(entry: Entry) -> int:
    return load_object(code_of(entry), ENTRY, {})


def code_of(entry: Entry) -> bytes:
    """The object of a function: what is brought, else what is kept, else compiled now."""
    code = shipped.read(entry.name)
    return _kept(entry) if code is None else code


def _kept(entry: Entry) -> bytes:
    """The code on the user's disk, compiled if it is not there."""
    name = f"fastslow_{entry.function}_{_digest(entry.key + _versions())}"
    code = store.read(name)
    if code is None:
        with store.exclusively(name, between_passes):
            # by now another process may have compiled it
            code = store.read(name)
            if code is None:
                code = compiled(entry, shipped.missing())
                store.write(name, code)
    return code


def compiled(entry: Entry, reason: str) -> bytes:
    """The code of a function, compiled here and now, which is said in one line.

    Parameters
    ----------
    entry : Entry
    reason : str
        Why it is.
    """

    def say(text: str) -> None:
        print(text, end="", file=sys.stderr, flush=True)

    began = time.monotonic()
    say(f"fastslow compiles {entry.module}.{entry.function} ({reason})")
    try:
        from fastslow.kernels.loop_compiler import compiled_object

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
