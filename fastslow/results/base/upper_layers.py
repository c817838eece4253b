"""Methods of results that are computed by upper layers, which are imported when they are called."""

from __future__ import annotations

from importlib import import_module
from typing import Any


def computed(module: str, name: str) -> Any:
    """Return a function of an upper layer.

    A result is data, and needs NumPy alone; what is computed from it anew, with the compiled
    equations of its model, is a method for the reader and a function of the layer that computes it.

    Examples
    --------
    >>> computed("fastslow.orbits.derivatives.run_sensitivities", "sensitivity_of").__name__
    'sensitivity_of'
    """
    return getattr(import_module(module), name)
