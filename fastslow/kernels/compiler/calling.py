"""Calls of machine code with numbers, arrays and records."""

from __future__ import annotations

import ctypes
import struct
from collections.abc import Callable, Collection, Mapping, Sequence
from textwrap import indent
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fastslow.kernels.compiler.records import Leaf, construction, leaves, records_within
from fastslow.kernels.compiler.slots import fields_of_arrays

#: Kind of each argument of a loop by its name.
Arguments = Mapping[str, Any]

_ENTRY = '''"""Entry to {function} of {module}."""
from fastslow.kernels.compiler.slots import slot
{imports}from {module} import {function} as loop


def {function}(slots):
    return loop({given})
'''

_CALL = """def {function}({names}):
    _copies = []
{parts}    _results = _create()
    _code = _entry(_results, _error, {slots})
    for _array, _copy in _copies:
        _array[...] = _copy
    if _code not in _ended:
        raise RuntimeError(f"the compiled loop '{function}' failed ({{_code}})")
{end}"""

_CHECK = """    {name} = {path}
    if not (
        {name}.__class__ is _ndarray
        and ({name}.dtype is {dtype} or {name}.dtype == {dtype})
        and {name}.ndim == {axes}
        and {flags}
    ):
        {name} = _taken({name}, {path!r}, {kind!r}, {axes}, {copies})
"""

#: A kept record is checked and written to slots only if it differs from that of the last call.
_KEPT = """    _slots_{name} = _kept_{name}[0]
    if _slots_{name}[0] is not {name}:
{checks}        _slots_{name} = _kept_{name}[0] = ({name}, {pack})
"""

#: Return codes of a function compiled by Numba that has ended, with or without a result.
_ENDED = (0, -2)

_SIGNATURE = ctypes.CFUNCTYPE(ctypes.c_int32, ctypes.c_char_p, ctypes.c_void_p, ctypes.c_char_p)

_FORMATS = {int: "q", float: "d", bool: "?7x"}


def entry_source(module: str, function: str, arguments: Arguments) -> str:
    """Source of the entry function, which calls a function of a module with slots."""
    given = [leaf for name, kind in arguments.items() for leaf in leaves(name, kind)]
    readers = iter(
        f"slot(slots, {place}, {leaf.kind!r}, {leaf.axes})" for place, leaf in enumerate(given, 1)
    )
    records = {record for _, kind in arguments.items() for record in records_within(kind)}
    return _ENTRY.format(
        imports="".join(sorted(f"from {r.__module__} import {r.__name__}\n" for r in records)),
        module=module,
        function=function,
        given=", ".join([construction(kind, readers) for _, kind in arguments.items()]),
    )


def caller(
    function: str,
    arguments: Arguments,
    results: Sequence[type],
    address: int,
    kept: Collection[str] = (),
    read: Collection[str] = (),
) -> Callable[..., Any]:
    """Create a Python function that calls code at an address with slots.

    Parameters
    ----------
    function : str
        Name of the function.
    arguments : mapping
        As for `entry_source`.
    results : sequence of type
        Numbers that the code returns.
    address : int
    kept : collection of str, optional
        Records that are usually those of the last call.
    read : collection of str, optional
        Arguments that the code does not write to.

    Returns
    -------
    callable
        With positional arguments. Arrays of other types raise TypeError; strided arrays, and
        read-only ones that the code may write to, are copied. The GIL is released.
    """
    returned = struct.Struct("<" + "".join(_FORMATS[kind] for kind in results))
    known: dict[str, Any] = {
        "_create": ctypes.c_char * max(returned.size, 8),
        # the code is loaded as long as its address is referenced
        "_address": address,
        "_entry": _SIGNATURE(address),
        "_error": ctypes.create_string_buffer(8),
        "_ended": _ENDED,
        "_unpack": returned.unpack_from,
        "_ndarray": np.ndarray,
        "_taken": _taken,
        "_first": struct.pack("q", fields_of_arrays()),
    }
    parts, slots = [], ["_first"]
    for argument, kind in arguments.items():
        fields = list(leaves(argument, kind))
        known |= {_dtype_name(leaf): leaf.dtype for leaf in fields}
        known[f"_pack_{argument}"] = struct.Struct("".join(map(_letter, fields))).pack
        names = {leaf: f"_{argument}_{k}" for k, leaf in enumerate(fields)}
        stays = argument in kept
        writes = argument not in read
        checks = "".join(
            _check(leaf, name, stays, writes) for leaf, name in names.items() if leaf.axes
        )
        words = ", ".join(f"id({name})" if f.axes else f.path for f, name in names.items())
        pack = f"_pack_{argument}({words})"
        if argument in kept:
            known[f"_kept_{argument}"] = [(None, b"")]
            parts.append(_KEPT.format(name=argument, checks=indent(checks, "    "), pack=pack))
            slots.append(f"_slots_{argument}[1]")
        else:
            parts.append(checks)
            slots.append(pack)
    source = _CALL.format(
        function=function,
        names=", ".join(arguments),
        parts="".join(parts),
        slots=" + ".join(slots),
        end=_end(len(results)),
    )
    exec(compile(source, f"<call of {function}>", "exec"), known)
    made: Callable[..., Any] = known[function]
    return made


def _letter(leaf: Leaf) -> str:
    return "d" if leaf.kind == "float64" and not leaf.axes else "q"


def _dtype_name(leaf: Leaf) -> str:
    return f"_dtype_{leaf.kind}"


def _check(leaf: Leaf, name: str, kept: bool, writes: bool) -> str:
    flags = ("carray",) if writes else ("c_contiguous", "aligned")
    return _CHECK.format(
        name=name,
        flags=" and ".join(f"{name}.flags.{flag}" for flag in flags),
        path=leaf.path,
        dtype=_dtype_name(leaf),
        axes=leaf.axes,
        kind=leaf.kind,
        copies=None if kept else "_copies",
    )


def _end(results: int) -> str:
    if not results:
        return ""
    return "    return _unpack(_results)\n" if results > 1 else "    return _unpack(_results)[0]\n"


def _taken(value: Any, path: str, kind: str, axes: int, copies: list[Any] | None) -> NDArray[Any]:
    """Copy an array that is strided or read-only.

    The copy is written back after the call unless the array is read-only.
    """
    wanted = f"expected an array of {kind} with {axes} axes for {path}"
    if not isinstance(value, np.ndarray):
        raise TypeError(f"{wanted}; received {type(value).__name__}")
    if value.dtype != Leaf(path, kind, axes).dtype or value.ndim != axes:
        raise TypeError(f"{wanted}; received {value.dtype} with {value.ndim} axes")
    if copies is None:
        raise TypeError(f"{wanted}, contiguous and writeable, which this one is not")
    copy = np.array(value, order="C")
    if value.flags.writeable:
        copies.append((value, copy))
    return copy
