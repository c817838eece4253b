"""SIMD instructions for loops that LLVM does not vectorise by itself."""

from __future__ import annotations

from typing import Any

from llvmlite import ir

from fastslow.kernels.compiler.decorators import instructions

_WORD, _FOUR = ir.IntType(64), ir.VectorType(ir.DoubleType(), 4)


@instructions
def horner_of_four(  # type: ignore[no-untyped-def]
    typingctx, W, last, count, s, c, out, place
):
    """Evaluate a polynomial at four numbers s[c], s[c + 1], …, into ``out`` from a place on.

    The coefficients are ``count`` entries of ``W``, the last of which is the highest. Each
    result equals that of Horner's rule for one number, with products and sums fused.
    """
    from numba import types
    from numba.core import cgutils

    signature = types.void(W, types.int64, types.int64, s, types.int64, out, types.int64)

    def codegen(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        coefficients, numbers, values = (
            context.make_array(sig.args[k])(context, builder, args[k]).data for k in (0, 3, 5)
        )
        last, count, c, place = (args[k] for k in (1, 2, 4, 6))

        def four(data: Any, index: Any) -> Any:
            return builder.bitcast(builder.gep(data, [index]), _FOUR.as_pointer())

        def coefficient(index: Any) -> Any:
            number = builder.load(builder.gep(coefficients, [index]))
            first = ir.Constant(ir.IntType(32), 0)
            alone = builder.insert_element(ir.Constant(_FOUR, ir.Undefined), number, first)
            everywhere = ir.Constant(ir.VectorType(ir.IntType(32), 4), [0] * 4)
            return builder.shuffle_vector(alone, alone, everywhere)

        fused = cgutils.get_or_insert_function(
            builder.module, ir.FunctionType(_FOUR, [_FOUR] * 3), "llvm.fmuladd.v4f64"
        )
        x = builder.load(four(numbers, c), align=8)
        value = cgutils.alloca_once_value(builder, coefficient(last))
        below = builder.sub(count, ir.Constant(_WORD, 1))
        with cgutils.for_range(builder, below, intp=_WORD) as loop:
            index = builder.sub(builder.sub(last, loop.index), ir.Constant(_WORD, 1))
            value_now = builder.load(value)
            builder.store(builder.call(fused, [value_now, x, coefficient(index)]), value)
        builder.store(builder.load(value), four(values, place), align=8)
        return context.get_dummy_value()

    return signature, codegen
