"""Loops that serve every model, compiled once and kept on disk.

Each has a generated module for its entry, whose key has all that the loop is made of.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from itertools import count
from typing import Any

from fastslow.compiled.generated import compile_loop
from fastslow.compiled.records import construction, records_within, types_within

_SOURCE = '''"""Entry to {function} of {module}."""
{imports}from {module} import {function} as loop


def {function}({arguments}):
    return loop({given})
'''


@cache
def load_loop(
    module: str, function: str, arguments: tuple[type | str, ...], typed: bool = False
) -> Callable[..., Any]:
    """The compiled form of a Numba function, read from the disk where it is there already.

    Of records it is given all fields, in the order of `flattened`, and makes them again: Numba
    takes long to find the type of a record that comes from Python.

    Parameters
    ----------
    module, function : str
        Where the function is, e.g. ``"fastslow.continuation.engine"`` and ``"trace"``.
    arguments : tuple
        What each argument is: a record, a number (``int``), or of any type, by a name.
    typed : bool
        Whether nothing is of any type, so that it is compiled here.

    Returns
    -------
    callable
    """
    records = [kind for kind in arguments if not isinstance(kind, str)]
    names = (f"a{k}" for k in count())
    parts = [construction(kind, names) for kind in arguments]
    used = {record for kind in records for record in records_within(kind)}
    source = _SOURCE.format(
        imports="".join(sorted(f"from {r.__module__} import {r.__name__}\n" for r in used)),
        module=module,
        function=function,
        arguments=", ".join(f"a{k}" for k in range(int(next(names)[1:]))),
        given=", ".join(parts),
    )
    types = tuple(kind for record in records for kind in types_within(record)) if typed else None
    return compile_loop(source, function, types)
