"""Decorators of the functions that are compiled into loops.

Numba is imported only when one of them is compiled, which few processes do.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property, update_wrapper
from typing import Any, TypeVar, cast

F = TypeVar("F", bound=Callable[..., Any])

#: Options of all of them. Wrappers for calls from Python would double the compilation time.
#: Nothing is allocated and arrays are not reference-counted, which took half of the time.
OPTIONS: dict[str, Any] = {
    "no_cpython_wrapper": True,
    "no_cfunc_wrapper": True,
    "_nrt": False,
    "error_model": "numpy",
}


class _Kernel:
    """A function that Numba compiles into the loops that call it; Python calls its source."""

    def __init__(self, function: Callable[..., Any], **options: Any) -> None:
        update_wrapper(self, function)
        self.source, self.options = function, options

    def __call__(self, *arguments: Any) -> Any:
        return self.source(*arguments)

    @cached_property
    def _dispatcher(self) -> Any:
        from numba import njit

        return njit(**OPTIONS, **self.options)(self.source)

    @property
    def _numba_type_(self) -> Any:
        """Type of this function, which Numba requests for global names."""
        return self._dispatcher._numba_type_


class _Intrinsic:
    """A function of loops whose instructions are written by hand, for Numba."""

    def __init__(self, function: Callable[..., Any], literal: bool) -> None:
        self.__name__, self.__doc__ = function.__name__, function.__doc__
        self.typing, self.literal = function, literal

    @cached_property
    def _made(self) -> Any:
        from numba.extending import intrinsic

        return intrinsic(prefer_literal=self.literal)(self.typing)

    @property
    def _numba_type_(self) -> Any:
        from numba.core.registry import cpu_target

        made, context = self._made, cpu_target.typing_context
        # it may be new to a compilation in progress
        context.refresh()
        return context.resolve_value_type(made)


def kernel(function: F) -> F:
    """Declare a function that is compiled into the loops that call it.

    Products and sums are fused, which is faster and rounds once less; nothing is reordered.
    """
    return cast(F, _Kernel(function, fastmath={"contract"}))


def inlined_kernel(function: F) -> F:
    """As `kernel`, inlined: passing large records took a tenth of a short run."""
    return cast(F, _Kernel(function, fastmath={"contract"}, forceinline=True))


def unfused_kernel(function: F) -> F:
    """As `kernel`, with every product and sum rounded separately."""
    return cast(F, _Kernel(function))


def instructions(function: F) -> F:
    """As `numba.extending.intrinsic`, which is not imported before it is needed."""
    return cast(F, _Intrinsic(function, literal=False))


def literal_instructions(function: F) -> F:
    """As `instructions`, with literal types for numbers and strings where given."""
    return cast(F, _Intrinsic(function, literal=True))
