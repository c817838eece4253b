"""The compiled loops of `fastslow.continuation.engine`, loaded when first used."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any

from fastslow.compiled.generic import load_loop

_ENGINE = "fastslow.continuation.engine"
_SOURCES = ("fastslow.compiled.pointers",)
_ARGUMENTS = {
    "trace": (
        "address mode parameters start tangent signs weight lower upper window step smallest "
        "largest turn tolerance iterations points closing"
    ),
    "evaluate": "address modes points parameters width",
    "newton_from": "address mode parameters starts value width iterations",
}

# how `trace` ends, as in the engine, whose import would bring Numba with it
FULL, RANGE, INTERFACE, SMALL_STEP, WINDOW, CLOSED = range(6)


@cache
def loop(name: str) -> Callable[..., Any]:
    """One of the engine's loops, compiled: ``trace``, ``evaluate`` or ``newton_from``."""
    return load_loop(_ENGINE, name, tuple(_ARGUMENTS[name].split()), _SOURCES)
