"""Installed packages, whose code is identified by a version, and modules of the user."""

from __future__ import annotations

import sys
import sysconfig
from functools import cache
from importlib import metadata
from pathlib import Path

#: Folders of the standard library.
STANDARD = tuple({Path(sysconfig.get_path(name)) for name in ("stdlib", "platstdlib")})

#: Folder of this package, which may be installed from a checkout.
PACKAGE = Path(__file__).parents[1]

#: The package of everything that has the version of Python.
PYTHON = "python"


def library_of(module: str | None) -> str | None:
    """Return the installed package of a module, None for modules of the user.

    Examples
    --------
    >>> import numpy.linalg
    >>> library_of("numpy.linalg"), library_of("math"), library_of("__main__")
    ('numpy', 'python', None)
    """
    if module is None or module == "__main__":
        return None
    top = module.partition(".")[0]
    found = sys.modules.get(module) or sys.modules.get(top)
    if top in sys.builtin_module_names:
        return PYTHON
    spec = getattr(found, "__spec__", None)
    if getattr(spec, "origin", None) in ("built-in", "frozen"):
        return PYTHON
    file = getattr(found, "__file__", None) or getattr(spec, "origin", None)
    return library_of_file(file, top) if isinstance(file, str) else None


def library_of_file(file: str, top: str = "") -> str | None:
    """Return the installed package of a source file, None for files of the user."""
    path = Path(file)
    if PACKAGE in path.parents:
        return PACKAGE.name
    folders = {"site-packages", "dist-packages"}
    place = next((k for k, part in enumerate(path.parts) if part in folders), None)
    if place is not None:
        return top or path.parts[place + 1].removesuffix(".py")
    if any(folder in path.parents for folder in STANDARD) or file.startswith("<frozen"):
        return PYTHON
    return None


@cache
def version_of(library: str) -> str | None:
    """Return the version of an installed package, None where it has none."""
    stated = getattr(sys.modules.get(library), "__version__", None)
    if isinstance(stated, str):
        return stated
    names = [library, *metadata.packages_distributions().get(library, ())]
    for name in names:
        try:
            return metadata.version(name)
        except metadata.PackageNotFoundError:
            continue
    return None
