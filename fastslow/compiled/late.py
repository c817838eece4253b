"""Code that few runs need: compiled, or read from the disk, when the first of them does.

It would otherwise be compiled into every loop, and optimised again with each of them. A
loop that comes to it pauses; what it needs is compiled outside, where an error or an
interrupt is as any other, and the loop goes on with its address.
"""

from __future__ import annotations

from functools import cache

from fastslow.compiled.generated import compile_callback

_ENTRY = '''"""Entry to {function} of {module}."""
from {module} import {record}, {function} as called
from fastslow.compiled.pointers import loader

load = loader({record})


def {function}(pointer):
    return called(load(pointer))
'''


@cache
def address_of(module: str, function: str, record: str) -> int:
    """The address of a function of one record, compiled for `call_with`.

    Parameters
    ----------
    module, function, record : str
        Where the function and the type of its argument are, e.g.
        ``"fastslow.simulation.radau"``, ``"radau_step"`` and ``"RadauStep"``.
    """
    from numba import types

    text = _ENTRY.format(module=module, function=function, record=record)
    return compile_callback(text, function, types.float64(types.voidptr))
