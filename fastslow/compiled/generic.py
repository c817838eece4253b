"""Loops that serve every model, compiled once and kept on disk.

Each has a generated module for its entry, whose key has all that the loop is made of.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any

from fastslow.compiled.generated import compile_loop

_SOURCE = '''"""Entry to {function} of {module}."""
from {module} import {function} as loop


def {function}({arguments}):
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
    listed = ", ".join(arguments)
    source = _SOURCE.format(module=module, function=function, arguments=listed)
    return compile_loop(source, function)
