"""The period of a forced model as a function of its parameters, with derivatives."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from fastslow.continuation.loops import loop
from fastslow.errors import ArgumentError
from fastslow.kernels.field_code import CompiledField
from fastslow.model.model import Model
from fastslow.model.periods import frequencies
from fastslow.model.structure import TIME, real
from fastslow.orbits.flow.variations import Variations

Array = NDArray[np.float64]

#: Relative difference up to which two periods agree: they are computed from the same constants.
SAME_PERIOD = 1e-9


@dataclass(frozen=True, eq=False)
class Forcing:
    """The period of a forcing as a function of the parameters.

    Parameters
    ----------
    compiled : CompiledField
        The period as a function of the unknowns (states, time, chosen parameters).
    places : list of int
        Indices of the chosen parameters in the parameter array.
    """

    compiled: CompiledField
    places: list[int]

    def period(self, parameters: Array) -> tuple[float, Array]:
        """Return the period and its derivatives by the chosen parameters."""
        chosen = parameters[self.places]
        point, out = np.zeros(self.compiled.k), np.empty(self.compiled.size)
        point[self.compiled.k - len(chosen) :] = chosen
        loop("value_at")(self.compiled.address, 0, point, parameters, out)
        return float(out[0]), out[len(out) - len(chosen) :]


@lru_cache(maxsize=64)
def forcing_of(model: Model, variations: Variations, given: float | None) -> Forcing | None:
    """Return the forcing of a model, None if it is autonomous.

    Parameters
    ----------
    model : Model
    variations : Variations
        Of the model, with the parameters to be varied.
    given : float, optional
        The period if the time-dependent terms have no period that can be derived.

    Raises
    ------
    ArgumentError
        Without a period, or if the frequencies are incommensurable at other values of the
        chosen parameters.

    Examples
    --------
    >>> from fastslow.orbits.flow.variations import variations_of
    >>> x, w, t = sp.symbols("x w t")
    >>> model = Model({x: sp.cos(w * t)}, parameters={w: 2})
    >>> forcing = forcing_of(model, variations_of(model, ("w",)), None)
    >>> value, slopes = forcing.period(np.array([2.0]))
    >>> float(value / np.pi), (slopes / np.pi).tolist()
    (1.0, [-0.5])
    """
    if TIME.name not in model.structure.timed:
        return None
    period = model.period()
    found = frequencies(model.structure.written, TIME)
    if period is None or found is None:
        if given is None:
            raise ArgumentError(
                "the rates depend on time, but have no common period; give it as period="
            )
        value = sp.Float(given, 17)
    else:
        first = next(f for f in found if f.subs(model.values) != 0)
        for name in variations.chosen:
            if any((f / first).diff(real(name)).subs(model.values) != 0 for f in found):
                raise ArgumentError(
                    "the frequencies of the forcing have no common period at other values of "
                    f"{name}"
                )
        frequency = float(first.subs(model.values))
        cycles = round(period * abs(frequency) / (2.0 * np.pi))
        value = 2 * sp.pi * int(np.sign(frequency)) * cycles / first
    return Forcing(variations.compile_function(value), variations.places)
