"""Loops that serve every model, compiled once and kept on disk.

Each has a generated module for its entry, whose key has all that the loop is made of.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache, partial
from typing import Any, cast

from fastslow.compiled.signals import deferring_signals
from fastslow.compiled.store import load_generated

_ENTRY = '''"""Entry to {function} of {module}."""
from numba import njit

from {module} import {function} as loop


@njit(cache=True, nogil=True)
def entry({arguments}):
    return loop({arguments})
'''


@cache
def load_loop(module: str, function: str, arguments: tuple[str, ...]) -> Callable[..., Any]:
    """The compiled form of a Numba function, read from the disk where it is there already.

    Parameters
    ----------
    module, function : str
        Where the function is, e.g. ``"fastslow.simulation.driver"`` and ``"drive"``.
    arguments : tuple of str
        Names of its arguments.

    Returns
    -------
    callable
    """
    text = _ENTRY.format(
        module=module,
        function=function,
        arguments=", ".join(arguments),
    )
    loaded = load_generated(text, function).entry
    # what Numba calls for arguments of types that are new to it
    loaded.compile = partial(deferring_signals, loaded.compile)
    return cast("Callable[..., Any]", loaded)
