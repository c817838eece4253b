"""Functions of formulas: names, numbers of arguments and values."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from fastslow.formulas.elementary import ELEMENTARY
from fastslow.formulas.limits import ARGUMENTS, PIECES


@dataclass(frozen=True)
class Function:
    """A function of formulas.

    Parameters
    ----------
    symbolic : str
        The name in SymPy.
    values : callable, optional
        Elementwise evaluation on arrays; none for functions evaluated by SymPy only.
    least, most : int
        Number of arguments.
    """

    symbolic: str
    values: Callable[..., Any] | None = None
    least: int = 1
    most: int = 1


def _folded(function: Callable[[Any, Any], Any]) -> Callable[..., Any]:
    def values(first: Any, *rest: Any) -> Any:
        for other in rest:
            first = function(first, other)
        return first

    return values


def _step(x: Any, there: Any = 0.5) -> Any:
    return np.heaviside(x, there)


_OTHERS: dict[str, Callable[[Any], Any]] = {
    "Abs": np.abs,
    "cbrt": np.cbrt,
    "ceiling": np.ceil,
    "floor": np.floor,
    "frac": lambda x: x - np.floor(x),
    "sign": np.sign,
    "sinc": lambda x: np.sinc(x / np.pi),
    "sqrt": np.sqrt,
}

#: Special functions accepted in equations, with their numbers of arguments.
SPECIAL: dict[str, tuple[int, int]] = {
    "Chi": (1, 1),
    "Ci": (1, 1),
    "Ei": (1, 1),
    "LambertW": (1, 2),
    "Shi": (1, 1),
    "Si": (1, 1),
    "airyai": (1, 1),
    "airyaiprime": (1, 1),
    "airybi": (1, 1),
    "airybiprime": (1, 1),
    "besseli": (2, 2),
    "besselj": (2, 2),
    "besselk": (2, 2),
    "bessely": (2, 2),
    "beta": (2, 2),
    "elliptic_e": (1, 2),
    "elliptic_f": (2, 2),
    "elliptic_k": (1, 1),
    "erfcinv": (1, 1),
    "erfi": (1, 1),
    "erfinv": (1, 1),
    "expint": (2, 2),
    "factorial": (1, 1),
    "fresnelc": (1, 1),
    "fresnels": (1, 1),
    "gamma": (1, 1),
    "li": (1, 1),
    "loggamma": (1, 1),
    "lowergamma": (2, 2),
    "polygamma": (2, 2),
    "uppergamma": (2, 2),
    "zeta": (1, 1),
}

_NAMED: dict[str, Function] = {
    **{
        name: Function(name, one.values, one.arguments, one.arguments)
        for name, one in ELEMENTARY.items()
    },
    **{name: Function(name, values) for name, values in _OTHERS.items()},
    **{name: Function(name, None, *count) for name, count in SPECIAL.items()},
    "Heaviside": Function("Heaviside", _step, 1, 2),
    "Max": Function("Max", _folded(np.maximum), 2, ARGUMENTS),
    "Min": Function("Min", _folded(np.minimum), 2, ARGUMENTS),
    "Mod": Function("Mod", np.mod, 2, 2),
    # its arguments are pairs, evaluated separately by each consumer
    "Piecewise": Function("Piecewise", None, 1, PIECES),
    "log": Function("log", lambda x, base=np.e: np.log(x) / np.log(base), 1, 2),
}

#: Names in NumPy and Python, mapped to those in SymPy.
_ALIASES = {
    **{one.in_numpy: name for name, one in ELEMENTARY.items() if one.in_numpy},
    "abs": "Abs",
    "max": "Max",
    "min": "Min",
}

FUNCTIONS: dict[str, Function] = {
    **{name: _NAMED[meant] for name, meant in _ALIASES.items()},
    **_NAMED,
}

#: Operators of conditions that SymPy prints as functions.
RELATIONS = {"Eq": "==", "Ne": "!=", "Gt": ">", "Ge": ">=", "Lt": "<", "Le": "<="}
CONNECTIVES = {"And": "and", "Or": "or", "Not": "not"}

#: Constants, unless shadowed by a name of the model.
CONSTANTS = {"pi": math.pi, "E": math.e}
