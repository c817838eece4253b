"""Packages of the optional extras."""

from __future__ import annotations

from importlib import import_module
from typing import Any

from fastslow.errors import MissingPackageError


def extra(name: str, group: str = "data") -> Any:
    """Import a package of an optional extra.

    Raises
    ------
    MissingPackageError
        If it is not installed.
    """
    try:
        return import_module(name)
    except ImportError:
        raise MissingPackageError(
            f"this needs {name}, of the extra '{group}': pip install 'fastslow[{group}]'"
        ) from None
