"""Calling compiled code by address, so that generic loops are compiled once for all models.

Every generated function has the one signature
``void (int64 mode, double* inputs, double* parameters, double* outputs)``.
A first-class function argument would halve the speed of a series step;
a raw address costs a few per cent.
"""

from __future__ import annotations

import math
from typing import Any

from llvmlite import ir

from fastslow.kernels.compiler.decorators import instructions
from fastslow.kernels.compiler.records import type_of

_POINTER = ir.IntType(8).as_pointer()


@instructions
def call_address(  # type: ignore[no-untyped-def]
    typingctx, address, mode, inputs, parameters, outputs
):
    """Call the generated function at an address with a mode and three float64 arrays."""
    from numba import types
    from numba.core import cgutils

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


@instructions
def call_with(typingctx, address, record):  # type: ignore[no-untyped-def]
    """Call the function at an address with a record and return its float64 result.

    The result is NaN if the function has failed.
    """
    from numba import types
    from numba.core import cgutils
    from numba.core.errors import TypingError

    if record != type_of(record.instance_class):
        raise TypingError(f"{record}; expected {type_of(record.instance_class)}")

    def codegen(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        result = cgutils.alloca_once_value(builder, ir.Constant(ir.DoubleType(), math.nan))
        error = cgutils.alloca_once(builder, _POINTER)
        place = builder.bitcast(cgutils.alloca_once_value(builder, args[1]), _POINTER)
        arguments = (result, error, place)
        kind = ir.FunctionType(ir.IntType(32), [value.type for value in arguments])
        builder.call(builder.inttoptr(args[0], kind.as_pointer()), arguments)
        return builder.load(result)

    return types.float64(types.int64, record), codegen


def loader(record: type) -> Any:
    """A Numba function that loads the record passed by `call_with`."""
    kind = type_of(record)

    @instructions
    def load(typingctx, pointer):  # type: ignore[no-untyped-def]
        def codegen(context: Any, builder: Any, sig: Any, args: Any) -> Any:
            place = context.get_value_type(sig.return_type).as_pointer()
            return builder.load(builder.bitcast(args[0], place))

        return kind(pointer), codegen

    return load
