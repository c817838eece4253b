"""Validation of the arguments of `simulate`."""

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
from fastslow.results.stored.operations import PiecewisePolynomial

if TYPE_CHECKING:
    from fastslow.model.model import Model

#: Models that can be simulated.
Simulated: TypeAlias = "Model | StoredModel"

#: Maximum number of evenly spaced samples of a run.
MOST_SAMPLES = 10**8


def simulated(name: str, value: Any) -> Simulated:
    """Validate a model to be simulated: a `Model` or a `StoredModel`.

    Raises
    ------
    ArgumentError
        For anything else.
    """
    # without its import there are no instances
    module = sys.modules.get("fastslow.model.model")
    if isinstance(value, StoredModel) or (module and isinstance(value, module.Model)):
        return value
    received = shown(value) if value is None else class_of(value)
    raise ArgumentError(f"{name}: expected a Model, received {received}")


def initial_state(model: Simulated, state: Any) -> NDArray[np.float64]:
    """Validate the initial state; return states, slow states, and parameters that events assign.

    The latter have the values of the model unless they are given.

    Parameters
    ----------
    model : Model
    state : sequence of float or mapping
        Values in order, or by name.

    Raises
    ------
    ArgumentError
        For a wrong number of values, or a missing or non-finite value.
    UnknownNameError
        For an unknown state.
    """
    names = (*model.states, *model.slow_states)
    assigned = {name: model.parameters[name] for name in model.assigned}
    if isinstance(state, Mapping):
        given = {str(k): v for k, v in state.items()}
        for key in given:
            if key not in names and key not in model.switches and key not in assigned:
                raise unknown_name("state", key, (*names, *model.switches, *assigned))
        missing = [n for n in names if n not in given]
        if missing:
            raise ArgumentError(
                f"the initial state has no value for {', '.join(missing)}; expected one for each "
                f"of {', '.join(names)}"
            )
        state = [given[n] for n in names] + [given.get(n, v) for n, v in assigned.items()]
    values = numbers("the initial state", state)
    if assigned and values.shape == (len(names),):
        values = np.array([*values.tolist(), *assigned.values()])
    if values.shape != (len(names) + len(assigned),):
        raise ArgumentError(
            f"the initial state has shape {values.shape}; expected {len(names)} values, for "
            + ", ".join(names)
        )
    for name, value in zip((*names, *assigned), values.tolist(), strict=False):
        if not math.isfinite(value):
            raise ArgumentError(f"initial {name} = {value}; expected a finite number")
    return values


def initial_switches(model: Simulated, state: Any) -> NDArray[np.float64]:
    """Return the states of switches given in an initial state, NaN for none.

    Parameters
    ----------
    model : Model
    state : sequence of float or mapping

    Raises
    ------
    ArgumentError
        For a value other than 0 or 1.
    """
    if not model.switches:
        return np.empty(0)
    given = {str(k): v for k, v in state.items()} if isinstance(state, Mapping) else {}
    return np.array([switch_value(n, given[n]) if n in given else np.nan for n in model.switches])


def no_switch_state(name: str, which: str = "") -> str:
    """Return the message for a switch without a state at the start of a run."""
    return (
        f"the switch {name} has no value at the start{which}, where neither of its relations is "
        f'true; give the states by name, with "{name}": 0 or 1'
    )


def start_values(model: Simulated, state: Any) -> dict[str, float]:
    """Validate the initial state; return states, slow states and given switches by name."""
    names = (*model.states, *model.slow_states, *model.assigned, *model.switches)
    values = [*initial_state(model, state), *initial_switches(model, state)]
    return {n: float(v) for n, v in zip(names, values, strict=True) if not math.isnan(v)}


def switch_value(name: str, value: Any) -> float:
    """Validate the state of a switch, 0 or 1."""
    number = numbers(f"initial {name}", value)
    if number.ndim or number not in (0.0, 1.0):
        raise ArgumentError(f"initial {name} = {shown(value)}; expected 0 or 1, as of a switch")
    return float(number)


#: Minimum number of representable times in a span, so that steps and crossings are resolved.
INSTANTS = 1e5


def time_span(
    t: Any,
    periods: Any,
    t0: float,
    period: float | None,
    own_period: Callable[[], float | None],
    *,
    backwards: bool = False,
) -> tuple[tuple[float, float], float | None]:
    """Validate the time span; return it with the period, by default that of the model.

    With ``backwards`` its end may be before its start.

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
        if t0 != 0:
            raise ArgumentError("t0= goes with periods=; with t=(start, end) it is in t")
        values = numbers("t", t)
        if values.shape != (2,):
            raise ArgumentError(f"t = {t!r}; expected a pair (start, end)")
        first, last = values.tolist()
        ordered = first < last or (backwards and first > last)
        if not (math.isfinite(first) and math.isfinite(last) and ordered):
            expected = "two different finite times" if backwards else "finite times, start < end"
            raise ArgumentError(f"t = ({first:g}, {last:g}); expected {expected}")
        _check_resolution(min(first, last), max(first, last))
        return (first, last), period if period is not None else own_period()
    count = positive("periods", periods)
    if period is None:
        period = own_period()
    if period is None:
        raise ArgumentError(
            f"periods={periods!r}, but nothing in this model has a common period; give "
            "t=(start, end), or the period as period="
        )
    _check_resolution(t0, t0 + count * period)
    return (t0, t0 + count * period), period


def is_backwards(t: Any) -> bool:
    """Check whether a time span is a pair whose end is before its start."""
    try:
        first, last = t
        return bool(first > last)
    except (TypeError, ValueError):
        # none, or refused by `time_span`
        return False


def _check_resolution(first: float, last: float) -> None:
    """Raise if a span contains too few representable times."""
    spacing = math.ulp(max(abs(first), abs(last)))
    if last - first < INSTANTS * spacing:
        raise ArgumentError(
            f"t = ({first:.17g}, {last:.17g}): in double precision times here are {spacing:.3g} "
            f"apart, too coarse for a span of {last - first:.3g}; shift the origin of time"
        )


def sample_times(
    samples: int | Sequence[float] | NDArray[np.float64] | None, span: tuple[float, float]
) -> NDArray[np.float64]:
    """Validate sample times: none, a number of evenly spaced ones, or given times.

    Raises
    ------
    ArgumentError
        For fewer than two, or for times that do not increase within the span.
    """
    if samples is None:
        return np.empty(0)
    if isinstance(samples, (int, np.integer)) and not isinstance(samples, bool):
        # linspace returns a view
        return np.linspace(*span, whole(2, MOST_SAMPLES)("samples", samples)).copy()
    times = np.atleast_1d(numbers("samples", samples))
    # finite ends suffice: NaN fails every comparison of order
    ends = times[:: max(1, len(times) - 1)]
    if times.ndim != 1 or not (np.isfinite(ends).all() and (times[:-1] <= times[1:]).all()):
        raise ArgumentError("samples: expected increasing, finite times")
    if len(times) and (times[0] < span[0] or times[-1] > span[1]):
        raise ArgumentError(
            f"samples from {times[0]:g} to {times[-1]:g} are outside the run, "
            f"[{span[0]:g}, {span[1]:g}]"
        )
    return np.ascontiguousarray(times)


def require_values(model: Simulated) -> None:
    """Raise unless all parameters have values."""
    missing = [name for name in model.free if name not in model.parameters]
    if missing:
        example = f"{missing[0]}=0.5"
        raise ArgumentError(
            f"{', '.join(missing)} of this frozen model has no value; give one with "
            f"with_parameters({example}), or simulate the full model"
        )


def require_tables(tables: Sequence[PiecewisePolynomial], first: float, last: float) -> None:
    """Raise unless every table of a model without a period covers a time span."""
    for table in tables:
        if table.periodic:
            continue
        begin, end = float(table.knots[0]), float(table.knots[-1])
        if first < begin or last > end:
            raise ArgumentError(
                f"the time span ({first:g}, {last:g}) is not inside a table of this model, "
                f"{begin:g} ≤ t ≤ {end:g}; tables are not extrapolated"
            )
