"""Functions out of generated source, compiled and kept on disk."""

from __future__ import annotations

import hashlib
import linecache
import platform
import sys
import threading
from collections.abc import Callable
from functools import cache, partial
from types import ModuleType
from typing import Any

from fastslow.compiled.closure import digest_of_imports

#: How functions are compiled; what changes here changes the key.
_CALLBACK: dict[str, Any] = {"error_model": "numpy", "_nrt": False}
_LOOP: dict[str, Any] = {"nogil": True, "_nrt": False}

_compiled: dict[str, Any] = {}

#: Every loop that was begun. Numba forgets one in a finaliser, which loses an interrupt that comes
#: while garbage is collected; so those whose compilation was interrupted are kept as well.
_begun: list[Any] = []

_lock = threading.RLock()


def compile_callback(source: str, function: str, signature: Any) -> int:
    """Compile a function that compiled code calls by its address.

    Parameters
    ----------
    source : str
        Source of a module.
    function : str
        Name of the function in it.
    signature : numba signature
        Its type.

    Returns
    -------
    int
        Its address. It is read from the disk where it is there already.
    """

    def compiled(python: Callable[..., Any]) -> int:
        from numba import cfunc

        from fastslow.compiled.compiler import KeptCompiler
        from fastslow.compiled.signals import deferring_signals

        decorate = cfunc(signature, pipeline_class=KeptCompiler, **_CALLBACK)
        made: Any = deferring_signals(decorate, python)
        return int(made.address)

    return int(_once(source, function, compiled))


def compile_loop(
    source: str, function: str, types: tuple[Any, ...] | None = None
) -> Callable[..., Any]:
    """Prepare a function for calls from Python.

    Nothing can be allocated in it, and arrays are not counted: the caller is to keep them.

    Parameters
    ----------
    source : str
        Source of a module.
    function : str
        Name of the function in it.
    types : tuple, optional
        Those of its arguments to Numba, for which it is compiled here. No others are then taken.

    Returns
    -------
    callable
        Compiled here, or when it is called, or read from the disk where it is there already.
    """

    def compiled(python: Callable[..., Any]) -> Any:
        from numba import njit

        from fastslow.compiled.compiler import KeptCompiler
        from fastslow.compiled.signals import deferring_signals

        made: Any = njit(pipeline_class=KeptCompiler, **_LOOP)(python)
        _begun.append(made)
        # what Numba calls for arguments of types that are new to it
        made.compile = partial(deferring_signals, made.compile)
        if types is not None:
            made.compile(types)
            made.disable_compile()
        return made

    loop: Callable[..., Any] = _once(source, function, compiled)
    return loop


def _once(source: str, function: str, compiled: Callable[[Callable[..., Any]], Any]) -> Any:
    """What becomes of a function, made once in a process."""
    with _lock:
        name = _module_name(source, function)
        if name not in _compiled:
            _compiled[name] = compiled(getattr(_module(name, source), function))
        return _compiled[name]


def _module_name(source: str, function: str) -> str:
    """Name of a generated module, which says all that its compiled code depends on."""
    options = f"{_CALLBACK} {_LOOP}"
    key = "\n".join((_platform_key(), options, digest_of_imports(source), source))
    return f"fastslow_{function}_{hashlib.sha256(key.encode()).hexdigest()[:24]}"


@cache
def _platform_key() -> str:
    """What compiled code depends on beside sources: versions, settings and the processor."""
    import llvmlite
    import numba
    import numpy as np
    import scipy
    from numba.core import config
    from numba.core.registry import cpu_target

    settings = ("OPT", "LOOP_VECTORIZE", "SLP_VECTORIZE", "BOUNDSCHECK", "DEBUGINFO_DEFAULT")
    return "|".join(
        map(
            str,
            (
                *(package.__version__ for package in (numba, llvmlite, np, scipy)),
                platform.python_implementation(),
                platform.python_version(),
                *cpu_target.target_context.codegen().magic_tuple(),
                *(getattr(config, name, None) for name in settings),
            ),
        )
    )


def _module(name: str, source: str) -> ModuleType:
    """Make a module of a source; what is read back from the disk looks it up by its name."""
    file = f"<{name}>"
    module = ModuleType(name)
    module.__file__ = file
    linecache.cache[file] = (len(source), None, source.splitlines(keepends=True), file)
    exec(compile(source, file, "exec"), module.__dict__)
    sys.modules[name] = module
    return module
