"""The period of a forced model as a function of its parameters, with derivatives."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from fastslow.errors import ArgumentError
from fastslow.model.functions import numpy_function
from fastslow.model.model import Model
from fastslow.model.periods import frequencies
from fastslow.model.structure import TIME, real

Array = NDArray[np.float64]

#: Relative difference up to which two periods agree.
SAME = 1e-9


@dataclass(frozen=True, eq=False)
class Forcing:
    """The period of a forcing as a function of the parameters.

    Parameters
    ----------
    places : ndarray of int64
        Indices in the parameter array of the parameters on which the period depends.
    function : callable
        Of their values: the period and its derivatives.
    """

    places: NDArray[np.int64]
    function: Callable[..., Any]

    def period(self, parameters: Array) -> tuple[float, Array]:
        """Return the period and its derivatives by all parameters."""
        value, *slopes = self.function(*parameters[self.places])
        gradient = np.zeros(len(parameters))
        gradient[self.places] = slopes
        return float(value), gradient


def forcing_of(
    model: Model, names: tuple[str, ...], given: float | None, chosen: tuple[str, ...] = ()
) -> Forcing | None:
    """Return the forcing of a model, None if it is autonomous.

    Parameters
    ----------
    model : Model
    names : tuple of str
        Order of the parameter array.
    given : float, optional
        The period if the time-dependent terms have no period that can be derived.
    chosen : tuple of str
        Parameters to be varied.

    Raises
    ------
    ArgumentError
        Without a period, or if the frequencies are incommensurable at other values of the
        chosen parameters.

    Examples
    --------
    >>> x, w, t = sp.symbols("x w t")
    >>> forcing = forcing_of(Model({x: sp.cos(w * t)}, parameters={w: 2}), ("w",), None)
    >>> value, slopes = forcing.period(np.array([2.0]))
    >>> float(value / np.pi), (slopes / np.pi).tolist()
    (1.0, [-0.5])
    """
    if TIME.name not in model.structure.timed:
        return None
    period = model.period()
    written = [*model.structure.forcing.values(), *model.structure.rates.values()]
    found = frequencies(written, TIME)
    if period is None or found is None:
        if given is None:
            raise ArgumentError(
                "the rates depend on time, but have no common period; give it as period="
            )
        return Forcing(np.empty(0, dtype=np.int64), lambda: (given,))
    first = next(f for f in found if f.subs(model.values) != 0)
    for name in chosen:
        if any((f / first).diff(real(name)).subs(model.values) != 0 for f in found):
            raise ArgumentError(
                f"the frequencies of the forcing have no common period at other values of {name}"
            )
    cycles = round(period * abs(float(first.subs(model.values))) / (2.0 * np.pi))
    value = 2 * sp.pi * cycles / sp.Abs(first)
    used = sorted((s for s in first.free_symbols if s.name in names), key=lambda s: s.name)
    slopes = [-value / first * first.diff(s) for s in used]
    places = np.array([names.index(s.name) for s in used], dtype=np.int64)
    return Forcing(places, numpy_function(used, [value, *slopes]))
