"""Objects that are registered by their module being in a folder."""

from __future__ import annotations

from importlib import import_module
from pkgutil import iter_modules
from types import ModuleType
from typing import Any


def registered(folder: ModuleType, name: str) -> tuple[Any, ...]:
    """Return the object of one name of every module of a package, in the order of the modules.

    Examples
    --------
    >>> from fastslow.passage.delays import laws
    >>> [law.name for law in registered(laws, "LAW")]
    ['boundary', 'branch point', 'fold', 'boundary', 'hopf']
    """
    modules = sorted(f"{folder.__name__}.{module.name}" for module in iter_modules(folder.__path__))
    return tuple(getattr(import_module(module), name) for module in modules)
