"""The compiled loops of this package, loaded when first used."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any

from fastslow.compiled.generic import load_loop

_ENGINE = "fastslow.continuation.engine"
_EVALUATION = "fastslow.continuation.evaluation"
_ISOLATION = "fastslow.continuation.isolation"
_ARGUMENTS = {
    "trace": (
        "address mode parameters start tangent signs weight lower upper low high middle "
        "periods step smallest largest turn tolerance iterations points closing"
    ),
    "evaluate": "address modes points parameters width",
    "refine": "address mode parameters start scale row normal point width m iterations",
    "survey": "address mode parameters points tangents scale reach width",
    "pairs": "jacobians",
    "passing": "points scale u within",
    "value_at": "address mode point parameters width",
    "newton_from": "address mode parameters starts value unit width iterations",
    "isolate": ("power degrees low high logarithmic floor tolerance budget large small share"),
}

# how `trace` ends, as in the engine, whose import would bring Numba with it
FULL, RANGE, INTERFACE, SMALL_STEP, WINDOW, CLOSED = range(6)


@cache
def loop(name: str) -> Callable[..., Any]:
    """One of the loops by its name, compiled."""
    module = {"trace": _ENGINE, "isolate": _ISOLATION}.get(name, _EVALUATION)
    return load_loop(module, name, tuple(_ARGUMENTS[name].split()))
