"""Loops that serve every model, compiled once and kept on disk.

Numba stores a function's code under the file it stands in and does not see
changes in the functions of other files. So the stored entry is a generated
module whose text carries a digest of all sources that the loop is made of.
"""

from __future__ import annotations

import hashlib
import importlib.util
from collections.abc import Callable, Sequence
from functools import cache, partial
from pathlib import Path
from typing import Any, cast

from fastslow.compiled.signals import deferring_signals
from fastslow.compiled.store import load_generated

_ENTRY = '''"""Entry to {function} of {module}, sources {digest}."""
from numba import njit

from {module} import {function} as loop


@njit(cache=True, nogil=True)
def entry({arguments}):
    return loop({arguments})
'''


@cache
def load_loop(
    module: str, function: str, arguments: tuple[str, ...], sources: tuple[str, ...]
) -> Callable[..., Any]:
    """The compiled form of a Numba function, read from the disk where it is there already.

    Parameters
    ----------
    module, function : str
        Where the function is, e.g. ``"fastslow.simulation.driver"`` and ``"drive"``.
    arguments : tuple of str
        Names of its arguments.
    sources : tuple of str
        Every module whose code is compiled into it.

    Returns
    -------
    callable
    """
    text = _ENTRY.format(
        module=module,
        function=function,
        digest=digest_of((module, *sources)),
        arguments=", ".join(arguments),
    )
    loaded = load_generated(text, function).entry
    # what Numba calls for arguments of types that are new to it
    loaded.compile = partial(deferring_signals, loaded.compile)
    return cast("Callable[..., Any]", loaded)


def digest_of(modules: Sequence[str]) -> str:
    """Digest of the sources of modules."""
    digest = hashlib.sha256()
    for name in modules:
        spec = importlib.util.find_spec(name)
        if spec is not None and spec.origin is not None:
            digest.update(Path(spec.origin).read_bytes())
    return digest.hexdigest()[:24]
