"""Loops that serve every model, compiled once and kept on disk.

Each has a generated module for its entry, whose key has all that the loop is made of.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any

from fastslow.compiled.generated import compile_loop
from fastslow.compiled.records import construction, records_within, types_within

_SOURCE = '''"""Entry to {function} of {module}."""
{imports}from {module} import {function} as loop


def {function}({arguments}):
    return loop({given})
'''


@cache
def load_loop(module: str, function: str, arguments: tuple[str, ...]) -> Callable[..., Any]:
    """The compiled form of a Numba function, read from the disk where it is there already.

    Parameters
    ----------
    module, function : str
        Where the function is, e.g. ``"fastslow.continuation.engine"`` and ``"trace"``.
    arguments : tuple of str
        Names of its arguments.

    Returns
    -------
    callable
    """
    listed = ", ".join(arguments)
    source = _SOURCE.format(
        imports="", module=module, function=function, arguments=listed, given=listed
    )
    return compile_loop(source, function)


@cache
def load_loop_of_records(
    module: str, function: str, arguments: tuple[type, ...]
) -> Callable[..., Any]:
    """The compiled form of a Numba function of records and numbers, given all of their fields.

    Numba takes long to find the type of a record that comes from Python, so that the entry is
    given its fields in the order of `flattened`, and makes it again.

    Parameters
    ----------
    module, function : str
    arguments : tuple of type
        What each argument is: a record, or ``int``.

    Returns
    -------
    callable
    """
    types = [kind for record in arguments for kind in types_within(record)]
    names = [f"a{k}" for k in range(len(types))]
    left = iter(names)
    given = ", ".join(construction(record, left) for record in arguments)
    used = {r for kind in arguments for r in records_within(kind)}
    imports = sorted(f"from {record.__module__} import {record.__name__}\n" for record in used)
    source = _SOURCE.format(
        imports="".join(imports),
        module=module,
        function=function,
        arguments=", ".join(names),
        given=given,
    )
    return compile_loop(source, function, tuple(types))
