"""How the functions that a generic loop is made of are compiled."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

from numba import njit

F = TypeVar("F", bound=Callable[..., Any])

#: Wrappers for calls from Python would double the time to compile what only loops call.
#: Products and sums are fused, which is faster and rounds once less; nothing is reordered.
#: Nothing is allocated, and no array is counted: to count them took half of the time.
_OPTIONS: dict[str, Any] = {
    "no_cpython_wrapper": True,
    "no_cfunc_wrapper": True,
    "_nrt": False,
    "error_model": "numpy",
    "fastmath": {"contract"},
}


def unfused_part(function: F) -> F:
    """As `part`, with every product rounded before it is added to anything."""
    options = {name: option for name, option in _OPTIONS.items() if name != "fastmath"}
    decorated: F = njit(**options)(function)
    return decorated


def part(function: F) -> F:
    """Let a function be compiled into the loops that call it; it is not called from Python."""
    decorated: F = njit(**_OPTIONS)(function)
    return decorated
