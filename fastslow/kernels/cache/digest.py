"""What compiled code is made of: the modules that its source imports, and those that they import.

Numba compiles functions of other modules into a function, and the numbers that they import,
and does not see when these change. So their sources are part of the key of compiled code.
"""

from __future__ import annotations

import ast
import hashlib
import os
import re
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path

_PACKAGE = Path(__file__).parents[2]


@dataclass(frozen=True)
class _Source:
    """The file of a module as it was when it was imported."""

    path: str
    written: int
    size: int

    @property
    def changed(self) -> bool:
        status = Path(self.path).stat()
        return (status.st_mtime_ns, status.st_size) != (self.written, self.size)


def _sources(folder: str, package: str) -> Iterator[tuple[str, _Source]]:
    """Every module below a folder by its name; strings, as paths would take ten times as long."""
    for entry in os.scandir(folder):
        name = entry.name
        if entry.is_dir():
            yield from _sources(entry.path, f"{package}.{name}")
        elif name.endswith(".py"):
            status = entry.stat()
            module = package if name == "__init__.py" else f"{package}.{name[:-3]}"
            yield module, _Source(entry.path, status.st_mtime_ns, status.st_size)


_SOURCES = dict(_sources(str(_PACKAGE), _PACKAGE.name))

#: An import of this package. Parsing whole files instead would take a hundred times as long.
_IMPORT = re.compile(r"^[ \t]*((?:from|import)[ \t]+fastslow\b[^\n(]*(?:\([^)]*\))?)", re.MULTILINE)

#: What is imported for its types alone is not compiled.
_FOR_TYPES = re.compile(r"^if TYPE_CHECKING:\n(?:[ \t]+.*\n|\n)+", re.MULTILINE)


def digest_of_imports(source: str) -> str:
    """Digest of all modules of this package that a source imports, directly or not.

    Imports inside functions count, as the function may be one that is compiled. Packages
    count where a name is imported from them; those above a module hold no code of loops.

    Parameters
    ----------
    source : str
        Python source.

    Returns
    -------
    str
    """
    digest = hashlib.sha256()
    for module in sorted(import_closure(source)):
        digest.update(f"{module}\n{_digest(module)}\n".encode())
    return digest.hexdigest()


def import_closure(source: str) -> set[str]:
    """Names of all modules of this package that a source imports, directly or not.

    Examples
    --------
    >>> sorted(import_closure("from fastslow.kernels import special"))
    ['fastslow.kernels', 'fastslow.kernels.native', 'fastslow.kernels.special']
    """
    found: set[str] = set()
    new = set(imported(source))
    while new:
        found |= new
        new = {name for module in new for name in _imports(module)} - found
    return found


def imported(source: str) -> Iterator[str]:
    """Names of the modules of this package that a source imports itself."""
    for statement in _IMPORT.findall(_FOR_TYPES.sub("", source)):
        (node,) = ast.parse(statement).body
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module:
            yield node.module
            inside = (f"{node.module}.{alias.name}" for alias in node.names)
            yield from (name for name in inside if name in _SOURCES)


@cache
def _imports(module: str) -> tuple[str, ...]:
    return tuple(imported(_read(module).decode("utf-8")))


@cache
def _digest(module: str) -> str:
    """Digest of a module's source; of no use to another process where the file has changed.

    What is compiled here is not what the file says now.
    """
    digest = hashlib.sha256(_read(module)).hexdigest()
    return digest + os.urandom(16).hex() if _SOURCES[module].changed else digest


@cache
def _read(module: str) -> bytes:
    if module not in _SOURCES:
        raise ModuleNotFoundError(f"there is no source of {module} in {_PACKAGE}", name=module)
    return Path(_SOURCES[module].path).read_bytes()
