"""Calling convention of compiled loops: an array of 64-bit slots.

Every loop has the C signature ``int32 (results*, error**, int64* slots)``. A slot contains a
number, or the address of a NumPy array object, whose data, shape and strides the loop reads
according to NumPy's C interface (``PyArrayObject_fields``). The first slot contains the offset
of these fields in the object, which depends on the build of Python.
"""

from __future__ import annotations

import ctypes
from functools import cache
from typing import Any

import numpy as np
from llvmlite import ir
from numpy.typing import NDArray

from fastslow.kernels.compiler.decorators import literal_instructions

_WORD = ir.IntType(64)

#: Byte offsets of the number of axes and of the pointers to shape and strides from the pointer
#: to the data.
_AXES, _SHAPE, _STRIDES = 8, 16, 24


@cache
def fields_of_arrays() -> int:
    """Byte offset of the fields in an array object.

    Raises
    ------
    RuntimeError
        If this Python has another layout, so that no compiled loop can be called.
    """
    arrays = [np.zeros((2, 3)), np.zeros((5, 7))[1:, ::2]]
    for offset in range(8, np.ndarray.__basicsize__ - _STRIDES, 8):
        if all(_begin_at(id(array) + offset, array) for array in arrays):
            return offset
    raise RuntimeError("the memory of NumPy's arrays is not laid out as in CPython")


def _begin_at(address: int, array: NDArray[np.float64]) -> bool:
    """Check whether the fields of an array begin at an address within it."""
    if (_word(address), _word(address + _AXES) & 0xFFFFFFFF) != (array.ctypes.data, array.ndim):
        return False
    rows = (_word(address + field) for field in (_SHAPE, _STRIDES))
    found = [tuple(_word(row + 8 * k) for k in range(array.ndim)) for row in rows]
    return found == [array.shape, array.strides]


def _word(address: int) -> int:
    return ctypes.c_int64.from_address(address).value


@literal_instructions
def slot(typingctx: Any, slots: Any, place: Any, name: Any, axes: Any) -> Any:
    """Read the number or array of a slot, given its index, type name, and number of axes."""
    from numba import types
    from numba.core import cgutils
    from numba.np.arrayobj import populate_array

    kind = getattr(types, name.literal_value)
    number, dimensions = place.literal_value, axes.literal_value
    result = types.Array(kind, dimensions, "C") if dimensions else kind

    def codegen(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        words = builder.bitcast(args[0], _WORD.as_pointer())

        def word(index: int) -> Any:
            return builder.gep(words, [ir.Constant(_WORD, index)])

        if not dimensions:
            if kind == types.float64:
                return builder.load(builder.bitcast(word(number), ir.DoubleType().as_pointer()))
            value = builder.load(word(number))
            return builder.trunc(value, ir.IntType(1)) if kind == types.boolean else value
        fields = builder.add(builder.load(word(number)), builder.load(word(0)))

        def pointer(offset: int, target: ir.Type) -> Any:
            place = builder.add(fields, ir.Constant(_WORD, offset))
            return builder.load(builder.inttoptr(place, target.as_pointer().as_pointer()))

        def row(offset: int) -> list[Any]:
            begin = pointer(offset, _WORD)
            places = (builder.gep(begin, [ir.Constant(_WORD, k)]) for k in range(dimensions))
            return [builder.load(place) for place in places]

        array = context.make_array(result)(context, builder)
        data = context.get_data_type(kind)
        populate_array(
            array,
            data=pointer(0, data),
            shape=cgutils.pack_array(builder, row(_SHAPE), _WORD),
            strides=cgutils.pack_array(builder, row(_STRIDES), _WORD),
            itemsize=context.get_constant(types.intp, context.get_abi_sizeof(data)),
            meminfo=None,
        )
        return array._getvalue()

    return result(slots, place, name, axes), codegen
