"""The compiled loops of this package, loaded when first used."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import cache
from typing import Any

from numpy.typing import NDArray

from fastslow.compiled.generic import load_loop

_ENGINE = "fastslow.continuation.engine"
_EVALUATION = "fastslow.continuation.evaluation"
_ISOLATION = "fastslow.continuation.isolation"
_ARGUMENTS = {
    "trace": (
        "address mode parameters signs weight lower upper low high middle periods smallest "
        "largest turn tolerance iterations closing rows tangents step progress"
    ),
    "evaluate": "address modes points parameters out",
    "refine": "address mode parameters u scale row normal point width m iterations",
    "survey": "address mode parameters points tangents scale reach width branching jacobians",
    "pairs": "jacobians result",
    "passing": "points scale u within found",
    "value_at": "address mode point parameters out",
    "newton_from": "address mode parameters states converged value unit width iterations",
    "isolate": (
        "power degrees low high logarithmic floor tolerance budget large small share "
        "stack solutions clusters progress"
    ),
}

# how `trace` ends, as in the engine, whose import would bring Numba with it
FULL, RANGE, INTERFACE, SMALL_STEP, WINDOW, CLOSED = range(6)

#: How a loop returns that is to be called again: its work is done, or a table is full.
PAUSED, TABLE_FULL = -1, -2

#: Work between two pauses, in products: some hundredths of a second.
WORK = 2**24


def blocks(count: int, cost: int) -> Iterator[slice]:
    """Slices of so many rows, each for one call of a loop that takes rows of some cost.

    Python handles signals between two calls, so that none may take long.

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
    """One of the loops by its name, compiled.

    None returns an array: to make one Numba runs Python, in which an interrupt would be
    raised and lost.
    """
    module = {"trace": _ENGINE, "isolate": _ISOLATION}.get(name, _EVALUATION)
    return load_loop(module, name, tuple(_ARGUMENTS[name].split()))


def writeable(array: NDArray[Any]) -> NDArray[Any]:
    """An array that a loop takes: of a read-only one a copy.

    To Numba a read-only array is another type, for which the loop would be compiled again.
    """
    return array if array.flags.writeable else array.copy()
