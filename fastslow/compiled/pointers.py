"""Calling compiled code by address, so that generic loops are compiled once for all models.

Every generated function has the one signature
``void (int64 mode, double* inputs, double* parameters, double* outputs)``.
A first-class function argument would cost half the speed of a series step;
a raw address costs a few per cent.
"""

from __future__ import annotations

from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

DOUBLES = types.CPointer(types.float64)

#: Signature of every generated function.
SIGNATURE = types.void(types.int64, DOUBLES, DOUBLES, DOUBLES)


@intrinsic
def call_address(  # type: ignore[no-untyped-def]
    typingctx, address, mode, inputs, parameters, outputs
):
    """Call the generated function at an address with a mode and three float64 arrays."""
    signature = types.void(types.int64, types.int64, inputs, parameters, outputs)

    def codegen(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        double_pointer = ir.DoubleType().as_pointer()
        kind = ir.FunctionType(
            ir.VoidType(), [ir.IntType(64), double_pointer, double_pointer, double_pointer]
        )
        function = builder.inttoptr(args[0], kind.as_pointer())
        data = [
            cgutils.create_struct_proxy(t)(context, builder, value=v).data
            for t, v in zip(sig.args[2:], args[2:], strict=True)
        ]
        builder.call(function, [args[1], *data])
        return context.get_dummy_value()

    return signature, codegen


@intrinsic
def call_number(typingctx, address, arguments):  # type: ignore[no-untyped-def]
    """Call the function at an address with numbers and arrays, given to it by their pointers.

    The arguments are a tuple of int64, float64 and arrays of float64; the result is a float64.
    """
    signature = types.float64(types.int64, arguments)

    def codegen(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        values = []
        for k, kind in enumerate(sig.args[1]):
            value = builder.extract_value(args[1], k)
            if isinstance(kind, types.Array):
                value = cgutils.create_struct_proxy(kind)(context, builder, value=value).data
            values.append(value)
        function = ir.FunctionType(ir.DoubleType(), [value.type for value in values])
        return builder.call(builder.inttoptr(args[0], function.as_pointer()), values)

    return signature, codegen
