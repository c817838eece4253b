"""Sliders: parameters and initial values with their ranges."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fastslow.arguments import interval
from fastslow.errors import ArgumentError, unknown_name
from fastslow.interactive.views import around
from fastslow.model.model import Model

#: Default number of values of a slider in a page.
SLIDER_VALUES = 11


@dataclass(frozen=True)
class Slider:
    """A variable parameter or initial value of a state.

    Parameters
    ----------
    name : str
    low, high : float
    value : float
        Initial value.
    state : bool
        Whether it is the initial value of a state.
    """

    name: str
    low: float
    high: float
    value: float
    state: bool = False

    @property
    def label(self) -> str:
        """The name; for an initial value followed by (0)."""
        return f"{self.name}(0)" if self.state else self.name

    def values(self, wanted: Any = SLIDER_VALUES) -> NDArray[np.float64]:
        """Values of the slider: a number of equidistant ones, or the given ones, sorted.

        Raises
        ------
        ArgumentError
            For fewer than one value, or one that is not finite.

        Examples
        --------
        >>> Slider("D", 0.0, 1.0, 0.5).values(3)
        array([0. , 0.5, 1. ])
        """
        if isinstance(wanted, int | np.integer) and not isinstance(wanted, bool):
            if wanted < 1:
                raise ArgumentError(f"{self.name}: expected at least one value, received {wanted}")
            return np.linspace(self.low, self.high, int(wanted)) if wanted > 1 else self._here()
        try:
            values = np.unique(np.asarray(wanted, dtype=float))
        except (TypeError, ValueError):
            values = np.empty(0)
        if not values.size or not np.isfinite(values).all():
            raise ArgumentError(
                f"{self.name}: expected a number of values, or finite values, received {wanted!r}"
            )
        return values

    def _here(self) -> NDArray[np.float64]:
        return np.array([self.value])


def sliders_of(
    model: Model, start: Mapping[str, float], ranges: Mapping[Any, Any] | None = None
) -> tuple[Slider, ...]:
    """Create the sliders of a model, by default one for each parameter.

    Parameters
    ----------
    model : Model
    start : mapping
        Initial values of the states.
    ranges : mapping, optional
        Parameter, or state for its initial value, to its range (low, high).

    Returns
    -------
    tuple of Slider

    Raises
    ------
    UnknownNameError
        For a name that is neither a parameter nor a state.
    ArgumentError
        For an invalid range, or one that does not contain the value.

    Examples
    --------
    >>> import fastslow as fs
    >>> [slider] = sliders_of(fs.systems.harmonic_gear(), {"x": 0.0, "v": 0.0}, {"D": (0.1, 0.5)})
    >>> slider
    Slider(name='D', low=0.1, high=0.5, value=0.25, state=False)
    """
    if ranges is None:
        given = {name: around(value) for name, value in model.parameters.items()}
    else:
        given = {str(name): limits for name, limits in ranges.items()}
    made = []
    for name, limits in given.items():
        if name not in model.parameters and name not in start:
            raise unknown_name("parameter or state", name, [*model.parameters, *start])
        state = name not in model.parameters
        value = float(start[name] if state else model.parameters[name])
        low, high = interval(f"the range of slider {name}", limits)
        if not low <= value <= high:
            raise ArgumentError(
                f"slider {name} = ({low:g}, {high:g}) does not contain its value, {value:g}"
            )
        made.append(Slider(name, low, high, value, state))
    return tuple(made)
