"""Digests of the sources of compiled code: the modules that it imports, directly or not.

Numba compiles functions and constants of other modules into a function without tracking their
changes. Their sources are therefore part of the key of compiled code.
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
    """File of a module at the time of its import."""

    path: str
    written: int
    size: int

    @property
    def changed(self) -> bool:
        status = Path(self.path).stat()
        return (status.st_mtime_ns, status.st_size) != (self.written, self.size)


def _sources(folder: str, package: str) -> Iterator[tuple[str, _Source]]:
    """All modules below a folder by name; path objects would take ten times as long."""
    for entry in os.scandir(folder):
        name = entry.name
        if entry.is_dir():
            yield from _sources(entry.path, f"{package}.{name}")
        elif name.endswith(".py"):
            status = entry.stat()
            module = package if name == "__init__.py" else f"{package}.{name[:-3]}"
            yield module, _Source(entry.path, status.st_mtime_ns, status.st_size)


_SOURCES = dict(_sources(str(_PACKAGE), _PACKAGE.name))

#: Import statement of this package; parsing whole files would take a hundred times as long.
_IMPORT = re.compile(r"^[ \t]*((?:from|import)[ \t]+fastslow\b[^\n(]*(?:\([^)]*\))?)", re.MULTILINE)

#: Imports for type annotations alone are not compiled.
_FOR_TYPES = re.compile(r"^if TYPE_CHECKING:\n(?:[ \t]+.*\n|\n)+", re.MULTILINE)


def digest_of_imports(source: str) -> str:
    """Digest of all modules of this package that a source imports, directly or not.

    Imports inside functions count, since the function may be compiled. Packages count if a
    name is imported from them; parent packages contain no code of loops.

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
    >>> sorted(import_closure("from fastslow.kernels.special import names"))
    ['fastslow.formulas.elementary', 'fastslow.kernels.compiler.native', 'fastslow.kernels.special',
     'fastslow.quotients']
    """
    found: set[str] = set()
    new = set(imported(source))
    while new:
        found |= new
        new = {name for module in new for name in _imports(module)} - found
    return found


def imported(source: str) -> Iterator[str]:
    """Names of the modules of this package that a source imports directly."""
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
    """Digest of the source of a module, unique to this process if the file has changed since.

    The imported code then differs from the file.
    """
    digest = hashlib.sha256(_read(module)).hexdigest()
    return digest + os.urandom(16).hex() if _SOURCES[module].changed else digest


@cache
def _read(module: str) -> bytes:
    if module not in _SOURCES:
        raise ModuleNotFoundError(f"there is no source of {module} in {_PACKAGE}", name=module)
    return Path(_SOURCES[module].path).read_bytes()
