"""Arguments of functions that saturate: where their Taylor series do not show what lies ahead.

Far from zero exp(−u), tanh(u) or erf(u) is constant up to rounding, as are u^n / (1 + u^n) and
cos(u)^n for a large n where the power is negligible or dominates. The last terms of such a series
allow a step that passes over a pulse or a transition. A step is therefore no longer than the one in
which the argument either changes by little, or certainly remains where the function saturates.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fastslow.formulas.elementary import ELEMENTARY
from fastslow.results.stored.operations import (
    FUNCTION,
    POWER,
    PRODUCT,
    REMOVABLE,
    ROOT,
    SUM,
    Operations,
    SeriesOperations,
)

#: Powers up to this exponent are polynomials of low degree, of which a series shows everything.
SHOWN_POWER = 8

#: Argument of the exponential function beyond which it saturates.
SATURATED_FROM = ELEMENTARY["exp"].saturated

#: Share of that argument by which it may change: over it the series of usual orders converges.
SHOWN_SHARE = 1.0 / 3.0

#: Share of its size by which a sum of squares may change that is the base of a root or of another
#: power singular at zero: sqrt(u² + δ²) is |u| up to rounding except near zero.
SHARE_OF_SQUARES = 0.95


class Saturation(NamedTuple):
    """An argument u of a function that saturates.

    Within a step u may change by at most ``change + share |u|``, but by any amount while it
    certainly remains smaller than ``low`` or larger than ``high`` in modulus.
    """

    row: int
    change: float
    share: float
    low: float
    high: float


def saturations(motion: SeriesOperations) -> list[Saturation]:
    """Arguments of the functions of a motion that saturate, with each of their limits once.

    Examples
    --------
    >>> import sympy as sp, fastslow as fs
    >>> x, y = sp.symbols("x y")
    >>> model = fs.Model({x: sp.tanh(100 * x) - y**20, y: -x})
    >>> [(s.change, round(s.share, 3)) for s in saturations(model.operations.motions[0])]
    [(10.0, 0.0), (0.0, 0.393)]
    """
    found: list[Saturation] = []
    powers: dict[int, float] = {}
    degrees: dict[int, tuple[int, int]] = {}
    # squares, and sums of squares with a constant
    squares, sums = set[int](), set[int]()
    for kind, row, *operands in motion.nodes:
        if kind == FUNCTION:
            value, slots = operands
            beyond = _saturated(value)
            if beyond < math.inf:
                found += [_of_function(argument, beyond) for argument, *_ in slots]
        elif kind == REMOVABLE:
            found.append(_of_function(operands[1], SATURATED_FROM))
        elif kind == SUM:
            if all(factor in squares and _number(f) > 0.0 for f, factor in operands[0]):
                sums.add(row)
        elif kind == PRODUCT:
            if operands[0] == operands[1]:
                squares.add(row)
            (base, a), (other, b) = (degrees.get(factor, (factor, 1)) for factor in operands)
            if base == other:
                degrees[row] = base, a + b
                powers[base] = max(powers.get(base, 0.0), float(a + b))
        elif kind in (ROOT, POWER):
            base = operands[1]
            if base in sums:
                found.append(Saturation(base, 0.0, SHARE_OF_SQUARES, -1.0, math.inf))
            powers[base] = max(powers.get(base, 0.0), abs(_number(operands[0])))
    found += [_of_power(row, n) for row, n in powers.items() if n > SHOWN_POWER]
    return list(dict.fromkeys(found))


def _saturated(value: str) -> float:
    """Size of the argument beyond which a function saturates, from its generated code."""
    called = (ELEMENTARY.get(name) for name in re.findall(r"\bmath\.(\w+)\(", value))
    return min((one.saturated for one in called if one is not None), default=math.inf)


def _of_function(row: int, beyond: float) -> Saturation:
    return Saturation(row, SHOWN_SHARE * beyond, 0.0, -1.0, beyond)


def _of_power(row: int, n: float) -> Saturation:
    """Limits of u in u^n = exp(n log u)."""
    exponent = SATURATED_FROM / n
    share = -math.expm1(-SHOWN_SHARE * exponent)
    return Saturation(row, 0.0, share, math.exp(-exponent), math.exp(exponent))


def _number(text: str) -> float:
    """The number in a text, 0 of one that contains parameters."""
    try:
        return float(text.strip("()") + "1" * (text == "+"))
    except ValueError:
        return 0.0


def saturation_arrays(
    operations: Operations, replaced: Sequence[Mapping[int, int]] = ()
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Rows of the arguments in every motion, −1 after the last, and their numbers.

    Parameters
    ----------
    operations : Operations
    replaced : sequence of mapping, optional
        Rows that stand for those of each motion in the code.

    Returns
    -------
    rows : ndarray of int64, shape (n_modes, k)
    limits : ndarray of float64, shape (n_modes, 4 k)
        Change, share, low and high of each.
    """
    lists = [
        saturations(motion) if isinstance(motion, SeriesOperations) else []
        for motion in operations.motions
    ]
    most = max((len(some) for some in lists), default=0)
    rows = np.full((len(lists), most), -1, dtype=np.int64)
    limits = np.zeros((len(lists), 4 * most))
    for mode, some in enumerate(lists):
        for k, one in enumerate(some):
            rows[mode, k] = replaced[mode][one.row] if replaced else one.row
            limits[mode, 4 * k : 4 * k + 4] = one[1:]
    return rows, limits
