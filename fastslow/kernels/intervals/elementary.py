"""Elementary functions in interval arithmetic: their operations and enclosures.

The records of the functions are in `fastslow.formulas.elementary`. One without an operation here is
enclosed as its record writes it by functions that have one; certificates refuse the others.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from types import MappingProxyType

from fastslow.kernels.compiler.decorators import unfused_kernel
from fastslow.kernels.intervals import arithmetic as interval

# operations: the target is …
EXPONENTIAL = 32
LOGARITHM = 33
SINE = 34  # sin(a + bπ/2)
TANGENT = 35
ARCTANGENT = 36
ARCSINE = 37
HYPERBOLIC_SINE = 38
HYPERBOLIC_COSINE = 39
HYPERBOLIC_TANGENT = 40

#: Operation of each function of one argument by its name in SymPy, with the number in place of a
#: second argument.
FUNCTIONS: Mapping[str, tuple[int, int]] = MappingProxyType(
    {
        "exp": (EXPONENTIAL, 0),
        "log": (LOGARITHM, 0),
        "sin": (SINE, 0),
        "cos": (SINE, 1),
        "tan": (TANGENT, 0),
        "atan": (ARCTANGENT, 0),
        "asin": (ARCSINE, 0),
        "sinh": (HYPERBOLIC_SINE, 0),
        "cosh": (HYPERBOLIC_COSINE, 0),
        "tanh": (HYPERBOLIC_TANGENT, 0),
    }
)


@unfused_kernel
def enclosed(operation, a, count):  # type: ignore[no-untyped-def]
    """Enclose a function of an interval; the whole line for an unknown operation."""
    if operation == EXPONENTIAL:
        return interval.exponential(a)
    if operation == LOGARITHM:
        return interval.logarithm(a)
    if operation == SINE:
        return interval.sine(a, count)
    if operation == TANGENT:
        return interval.tangent(a)
    if operation == ARCTANGENT:
        return interval.arctangent(a)
    if operation == ARCSINE:
        return interval.arcsine(a)
    if operation == HYPERBOLIC_SINE:
        return interval.hyperbolic_sine(a)
    if operation == HYPERBOLIC_COSINE:
        return interval.hyperbolic_cosine(a)
    if operation == HYPERBOLIC_TANGENT:
        return interval.hyperbolic_tangent(a)
    return -math.inf, math.inf
