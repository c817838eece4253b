"""Code that loops call by a symbol, compiled or read from the disk when it is first called.

What few runs need would otherwise be compiled into every loop, and optimised
again with each of them.
"""

from __future__ import annotations

import ctypes
import math
import warnings
from functools import cache
from typing import Any

import llvmlite.binding as llvm
from numba import types

from fastslow.compiled.generated import compile_callback

_ENTRY = '''"""Entry to {function} of {module}."""
from {module} import {function} as called


def {function}({arguments}):
    return called({arguments})
'''

_C_TYPES: dict[Any, Any] = {types.int64: ctypes.c_int64, types.float64: ctypes.c_double}

_callbacks: list[Any] = []


def late_function(module: str, function: str, kind: Any) -> Any:
    """A function for compiled code to call, that is not compiled yet.

    Compiled code that was read from the disk finds it as well, once the module
    that calls this has been imported. Where it cannot be compiled it warns and gives NaN.

    Parameters
    ----------
    module, function : str
        Where the function is.
    kind : numba signature
        Its type: numbers and pointers, and a number as result.

    Returns
    -------
    numba.types.ExternalFunction
    """
    arguments = [_C_TYPES.get(argument, ctypes.c_void_p) for argument in kind.args]
    prototype = ctypes.CFUNCTYPE(_C_TYPES[kind.return_type], *arguments)

    @cache
    def loaded() -> Any:
        text = _ENTRY.format(
            module=module,
            function=function,
            arguments=", ".join(f"a{k}" for k in range(len(arguments))),
        )
        return prototype(compile_callback(text, function, kind))

    def called(*given: Any) -> float:
        # an exception does not pass through compiled code, which would go on with any number
        try:
            return float(loaded()(*given))
        except Exception as error:
            warnings.warn(f"{function} was not compiled: {error}", RuntimeWarning, stacklevel=2)
            return math.nan

    callback = prototype(called)
    _callbacks.append(callback)
    symbol = f"fastslow_{function}"
    llvm.add_symbol(symbol, ctypes.cast(callback, ctypes.c_void_p).value)
    return types.ExternalFunction(symbol, kind)
