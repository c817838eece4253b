"""Code that few runs need: compiled, or read from the disk, when the first of them does.

It would otherwise be compiled into every loop, and optimised again with each of them. A
loop that comes to it pauses; what it needs is compiled outside, where an error or an
interrupt is as any other, and the loop goes on with its address.
"""

from __future__ import annotations

from functools import cache
from importlib import import_module

from fastslow.compiled.generated import compile_callback

_ENTRY = '''"""Entry to {function} of {module}."""
from {module} import {function} as called


def {function}({arguments}):
    return called({arguments})
'''


@cache
def address_of(module: str, function: str) -> int:
    """The address of a compiled function.

    Parameters
    ----------
    module, function : str
        Where the function is; ``SIGNATURE`` of that module is its type.
    """
    kind = import_module(module).SIGNATURE
    text = _ENTRY.format(
        module=module,
        function=function,
        arguments=", ".join(f"a{k}" for k in range(len(kind.args))),
    )
    return compile_callback(text, function, kind)
