"""The compiled loops of this package, loaded when first used."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fastslow.continuation.spaces import (
    Boxes,
    CompiledCurve,
    Condition,
    CurveDomain,
    Isolated,
    IsolationSpace,
    Limits,
    NewtonSpace,
    Polynomials,
    RowTests,
    Stepping,
    Subdivision,
    Traced,
    TraceSpace,
)
from fastslow.kernels.compiler.records import ComplexMatrix, Flags, Integers, Matrix, Tensor, Vector
from fastslow.kernels.loops import Loop, load_loop

_ENGINE = "fastslow.continuation.engine"
_EVALUATION = "fastslow.continuation.evaluation"
_ISOLATION = "fastslow.continuation.isolation"


#: Name, module, arguments and results of each loop.
_LOOPS = [
    Loop(
        _ENGINE,
        "trace",
        {
            "curve": CompiledCurve, "region": CurveDomain, "stepping": Stepping, "traced": Traced,
            "space": TraceSpace,
        },
        results=(int,),
        kept=("space",),
    ),
    Loop(
        _EVALUATION,
        "evaluate",
        {"address": int, "modes": Integers, "points": Matrix, "parameters": Vector, "out": Matrix},
    ),
    Loop(
        _EVALUATION,
        "value_at",
        {"address": int, "mode": int, "point": Vector, "parameters": Vector, "out": Vector},
    ),
    Loop(
        _EVALUATION,
        "refine",
        {
            "curve": CompiledCurve, "u": Vector, "scale": Vector, "condition": Condition,
            "iterations": int, "space": NewtonSpace,
        },
        results=(float, float, bool),
        kept=("space",),
    ),
    Loop(
        _EVALUATION,
        "correct",
        {
            "curve": CompiledCurve, "points": Matrix, "scales": Matrix, "natural": Matrix,
            "limits": Limits, "iterations": int, "plain": Flags, "space": NewtonSpace,
        },
        kept=("space",),
    ),
    Loop(
        _EVALUATION,
        "survey",
        {
            "curve": CompiledCurve, "points": Matrix, "tangents": Matrix, "scale": Vector,
            "reach": float, "vertical": float, "tests": RowTests, "space": NewtonSpace,
        },
        kept=("space",),
    ),
    Loop(_EVALUATION, "eigenvalues_of_2x2", {"jacobians": Tensor, "result": ComplexMatrix}),
    Loop(
        _EVALUATION,
        "eigenvalue_pair_sums",
        {
            "values": ComplexMatrix, "rounding": float, "alike": float, "real": Vector,
            "result": Vector,
        },
    ),
    Loop(
        _EVALUATION,
        "possible_double_zeros",
        {"test": Vector, "length": Vector, "share": float, "found": Integers},
        results=(int,),
    ),
    Loop(
        _EVALUATION,
        "nearby_chords",
        {
            "points": Matrix, "scale": Vector, "u": Vector, "within": float, "found": Integers,
            "apart": Vector,
        },
        results=(int,),
    ),
    Loop(
        _EVALUATION,
        "newton_from",
        {
            "curve": CompiledCurve, "states": Matrix, "damped": Flags, "converged": Flags,
            "value": float, "unit": Vector, "iterations": int, "space": NewtonSpace,
        },
        kept=("space",),
    ),
    Loop(
        _ISOLATION,
        "isolate",
        {
            "polynomials": Polynomials, "subdivision": Subdivision, "stack": Boxes,
            "isolated": Isolated, "space": IsolationSpace,
        },
        results=(int,),
        kept=("space",),
    ),
]  # fmt: skip

#: The loops by their names.
LOOPS = {loop.function: loop for loop in _LOOPS}

#: Work between two pauses, in multiplications: some hundredths of a second.
WORK = 2**24


def blocks(count: int, cost: int) -> Iterator[slice]:
    """Divide rows into slices, each for one call of a loop with a given cost per row.

    Python handles signals between two calls, so that each must be short.

    Examples
    --------
    >>> [(s.start, s.stop) for s in blocks(5, WORK // 2)]
    [(0, 2), (2, 4), (4, 5)]
    """
    size = max(1, WORK // cost)
    for first in range(0, count, size):
        yield slice(first, min(first + size, count))


@cache
def loop(name: str) -> Callable[..., Any]:
    """Load a compiled loop by its name."""
    return load_loop(LOOPS[name])


def writeable(array: NDArray[Any]) -> NDArray[Any]:
    """The array, or a copy if it is read-only or not contiguous."""
    return array if array.flags.carray else np.array(array, order="C")
