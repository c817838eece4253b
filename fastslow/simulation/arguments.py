"""What `simulate` is given, checked before anything is computed."""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from fastslow.arguments import class_of, numbers, positive, shown, whole
from fastslow.errors import ArgumentError, unknown_name
from fastslow.results.stored.model import StoredModel

if TYPE_CHECKING:
    from fastslow.model.model import Model

#: What a trajectory is simulated of.
Simulated: TypeAlias = "Model | StoredModel"

#: Samples of one run that can be asked for by their number.
MOST_SAMPLES = 10**8


def simulated(name: str, value: Any) -> Simulated:
    """The check of a model that is simulated: equations, or what was stored of them.

    Raises
    ------
    ArgumentError
        For anything else.
    """
    # of a class that was not imported there is no object
    module = sys.modules.get("fastslow.model.model")
    if isinstance(value, StoredModel) or (module and isinstance(value, module.Model)):
        return value
    received = shown(value) if value is None else class_of(value)
    raise ArgumentError(f"{name}: expected a Model, received {received}")


def initial_state(model: Simulated, start: Any) -> NDArray[np.float64]:
    """The initial state as an array in the order states, slow states.

    Parameters
    ----------
    model : Model
    start : sequence of float or mapping
        Values in order, or by name.

    Raises
    ------
    ArgumentError
        For a wrong number of values, a missing or a non-finite one.
    UnknownNameError
        For a name that is no state.
    """
    names = (*model.states, *model.slow_states)
    if isinstance(start, Mapping):
        given = {str(k): v for k, v in start.items()}
        for key in given:
            if key not in names:
                raise unknown_name("state", key, names)
        missing = [n for n in names if n not in given]
        if missing:
            raise ArgumentError(
                f"the initial state has no value for {', '.join(missing)}; expected one for each "
                f"of {', '.join(names)}"
            )
        start = [given[n] for n in names]
    values = numbers("the initial state", start)
    if values.shape != (len(names),):
        raise ArgumentError(
            f"the initial state has shape {values.shape}; expected {len(names)} values, for "
            + ", ".join(names)
        )
    for name, value in zip(names, values.tolist(), strict=True):
        if not math.isfinite(value):
            raise ArgumentError(f"initial {name} = {value}; expected a finite number")
    return values


#: Instants that a span must hold, so that steps and crossings within it have some digits.
INSTANTS = 1e5


def time_span(
    t: Any, periods: Any, start: float, period: float | None, own_period: Callable[[], float | None]
) -> tuple[tuple[float, float], float | None]:
    """Start and end of time, and the common period: the given one, else the model's own.

    Raises
    ------
    ArgumentError
        For none or both of ``t`` and ``periods``, an empty or non-finite span, or
        ``periods`` without a common period.
    """
    if (t is None) == (periods is None):
        received = "both" if t is not None else "neither"
        raise ArgumentError(f"expected t=(start, end) or periods=, received {received}")
    if t is not None:
        if start != 0:
            raise ArgumentError("start= goes with periods=; with t=(start, end) it is in t")
        values = numbers("t", t)
        if values.shape != (2,):
            raise ArgumentError(f"t = {t!r}; expected a pair (start, end)")
        first, last = values.tolist()
        if not (math.isfinite(first) and math.isfinite(last) and first < last):
            raise ArgumentError(f"t = ({first:g}, {last:g}); expected finite times, start < end")
        _check_resolution(first, last)
        return (first, last), period if period is not None else own_period()
    count = positive("periods", periods)
    if period is None:
        period = own_period()
    if period is None:
        raise ArgumentError(
            f"periods={periods!r}, but nothing in this model has a common period; give "
            "t=(start, end), or the period as period="
        )
    _check_resolution(start, start + count * period)
    return (start, start + count * period), period


def _check_resolution(first: float, last: float) -> None:
    """Refuse a span within which too few times can be told apart."""
    spacing = math.ulp(max(abs(first), abs(last)))
    if last - first < INSTANTS * spacing:
        raise ArgumentError(
            f"t = ({first:.17g}, {last:.17g}): in double precision times here are {spacing:.3g} "
            f"apart, too far for a span of {last - first:.3g}; measure time from a later origin"
        )


def sample_times(
    samples: int | Sequence[float] | NDArray[np.float64] | None, span: tuple[float, float]
) -> NDArray[np.float64]:
    """Times to sample at: none, a number of them evenly over the span, or as given.

    Raises
    ------
    ArgumentError
        For fewer than two, or for times that do not increase within the span.
    """
    if samples is None:
        return np.empty(0)
    if isinstance(samples, (int, np.integer)) and not isinstance(samples, bool):
        # what NumPy gives is a view
        return np.linspace(*span, whole(2, MOST_SAMPLES)("samples", samples)).copy()
    times = np.atleast_1d(numbers("samples", samples))
    # the largest and the smallest are finite, and what is no number is in no order with others
    ends = times[:: max(1, len(times) - 1)]
    if times.ndim != 1 or not (np.isfinite(ends).all() and (times[:-1] <= times[1:]).all()):
        raise ArgumentError("samples: expected increasing, finite times")
    if len(times) and (times[0] < span[0] or times[-1] > span[1]):
        raise ArgumentError(
            f"samples from {times[0]:g} to {times[-1]:g} leave the run, [{span[0]:g}, {span[1]:g}]"
        )
    return np.ascontiguousarray(times)


def require_values(model: Simulated) -> None:
    """Raise unless every parameter has a value."""
    missing = [name for name in model.free if name not in model.parameters]
    if missing:
        example = f"{missing[0]}=0.5"
        raise ArgumentError(
            f"{', '.join(missing)} of this frozen model has no value; give one with "
            f"with_parameters({example}), or simulate the full model"
        )


def gap_regions(model: Simulated, gap: str | None) -> tuple[str, str, str] | None:
    """The regions below, inside and above the gap, None for a model without one.

    Parameters
    ----------
    model : Model
    gap : str, optional
        The region inside; otherwise it is found: three regions between two
        interfaces that differ by a constant.

    Raises
    ------
    UnknownNameError
        If the named region does not exist.
    ArgumentError
        If the named region does not lie between two others.
    """
    if gap is not None and str(gap) not in model.regions:
        raise unknown_name("region", gap, model.regions)
    sides = model.operations.regions
    if gap is None and not (len(sides) == 3 and model.traits.parallel):
        return None
    for inside in sides if gap is None else (str(gap),):
        below: list[str] = []
        above: list[str] = []
        for name, signs in sides.items():
            differ = [j for j, s in enumerate(signs) if s != sides[inside][j]]
            if len(differ) == 1:
                j = differ[0]
                rising = signs[j] * model.traits.rising[j] > 0
                (above if rising else below).append(name)
        if len(below) == len(above) == 1:
            return below[0], inside, above[0]
    if gap is None:
        return None
    raise ArgumentError(f"gap = {gap!r}; expected a region with one region below and one above it")
