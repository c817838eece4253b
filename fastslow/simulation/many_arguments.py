"""Validation of the arguments of `simulate_many`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fastslow.arguments import numbers, positive, whole
from fastslow.errors import ArgumentError, unknown_name
from fastslow.model.model import Model
from fastslow.model.periods import common_periods
from fastslow.model.structure import TIME, real
from fastslow.results.base.immutable import read_only
from fastslow.simulation.arguments import MOST_SAMPLES, switch_value

Floats = NDArray[np.float64]


def starts_and_parameters(
    model: Model, states: Any, parameters: Any
) -> tuple[Floats, dict[str, Floats]]:
    """Validate initial states (m, n) and varying parameters, each (m,).

    Parameters that events assign are the last of the states.

    Raises
    ------
    ArgumentError
        For different lengths, wrong shapes, or numbers that are not finite.
    UnknownNameError
        For an unknown state or parameter.
    """
    names = (*model.states, *model.slow_states)
    assigned = model.assigned
    given = {str(k): numbers(f"parameter {k}", v) for k, v in (parameters or {}).items()}
    valid = [*model.parameters, *(n for n in model.free if n not in model.parameters)]
    for name, values in given.items():
        if name not in valid:
            raise unknown_name("parameter", name, valid)
        if values.ndim > 1:
            raise ArgumentError(f"parameter {name} has shape {values.shape}; expected (m,)")
    missing = [n for n in model.free if n not in model.parameters and n not in given]
    if missing:
        raise ArgumentError(
            f"{', '.join(missing)} of this frozen model has no value; give one in parameters="
        )
    _one_length("parameters", given)
    if isinstance(states, Mapping):
        columns = {str(k): numbers(f"initial {k}", v) for k, v in states.items()}
        for name, values in columns.items():
            if name not in names and name not in model.switches and name not in assigned:
                raise unknown_name("state", name, (*names, *model.switches, *assigned))
            if values.ndim > 1:
                raise ArgumentError(f"initial {name} has shape {values.shape}; expected (m,)")
        missing = [n for n in names if n not in columns]
        if missing:
            raise ArgumentError(
                f"the initial states have no value for {', '.join(missing)}; expected one for "
                f"each of {', '.join(names)}"
            )
        _one_length("initial states", columns)
        names = (*names, *(n for n in assigned if n in columns))
        table = np.stack(np.broadcast_arrays(*(columns[n] for n in names)), axis=-1)
    else:
        table = numbers("the initial states", states)
    if table.ndim not in (1, 2) or table.shape[-1] != len(names):
        raise ArgumentError(
            f"the initial states have shape {table.shape}; expected (m, {len(names)}) or "
            f"({len(names)},), for {', '.join(names)}"
        )
    lengths = {len(v) for v in given.values() if v.ndim} - {1}
    if table.ndim == 2 and len(table) != 1:
        lengths.add(len(table))
    if len(lengths) > 1:
        received = [f"states {table.shape}", *(f"{n} {v.shape}" for n, v in given.items())]
        raise ArgumentError(
            "states and parameters broadcast to one length: received " + ", ".join(received)
        )
    count = lengths.pop() if lengths else 1
    if count == 0:
        raise ArgumentError("received no trajectory: the states or parameters have length 0")
    # results are read-only, and would otherwise copy them
    swept = {
        n: np.ascontiguousarray(np.broadcast_to(read_only(v), count)) for n, v in given.items()
    }
    starts = repeated(table.reshape(-1), count) if table.size == len(names) else read_only(table)
    for name, values in (*swept.items(), *zip(names, starts.T, strict=True)):
        wrong = np.flatnonzero(~np.isfinite(values))
        if len(wrong):
            raise ArgumentError(
                f"{name} = {values[wrong[0]]} of trajectory {wrong[0]}; expected a finite number"
            )
    if assigned:
        every = {**model.parameters, **swept, **dict(zip(names, starts.T, strict=True))}
        rest = [np.broadcast_to(every[n], count) for n in assigned]
        first = len(model.states) + len(model.slow_states)
        starts = np.column_stack([starts[:, :first], *rest])
    return starts, swept


def repeated(row: ArrayLike, count: int) -> Floats:
    """Return a number of equal rows, kept once: of many trajectories they would be megabytes.

    Examples
    --------
    >>> repeated([1.0, 2.0], 3).tolist()
    [[1.0, 2.0], [1.0, 2.0], [1.0, 2.0]]
    """
    one: Floats = read_only(np.array(row, dtype=float))
    return np.broadcast_to(one, (count, *one.shape))


def starts_of_switches(model: Model, states: Any, count: int) -> Floats:
    """Validate the given initial states of switches; return them, NaN for none.

    Returns
    -------
    ndarray, shape (count, n_switches)

    Raises
    ------
    ArgumentError
        For a value other than 0 or 1, or another number of values.
    """
    found = np.full((count, len(model.switches)), np.nan)
    given = {str(k): v for k, v in states.items()} if isinstance(states, Mapping) else {}
    for k, name in enumerate(model.switches):
        if name in given:
            values = numbers(f"initial {name}", given[name])
            if values.size not in (1, count):
                raise ArgumentError(
                    f"initial {name} has shape {values.shape}; expected one value, or ({count},)"
                )
            for value in np.unique(values).tolist():
                switch_value(name, value)
            found[:, k] = values
    return found


def _one_length(what: str, given: Mapping[str, Floats]) -> None:
    if len({len(v) for v in given.values() if v.ndim} - {1}) > 1:
        received = ", ".join(f"{n} {v.shape}" for n, v in given.items())
        raise ArgumentError(f"{what} broadcast to one length: received {received}")


def periods_of_trajectories(
    model: Model, period: Any, count: int, swept: Mapping[str, Floats]
) -> Floats:
    """Period of every trajectory, shape (m,), NaN without one."""
    if period is not None:
        given = numbers("period", period)
        if given.ndim > 1 or given.size not in (1, count):
            raise ArgumentError(f"period has shape {given.shape}; expected one, or ({count},)")
        for value in given.reshape(-1):
            positive("period", float(value))
        return repeated(given.item(), count) if given.size == 1 else given
    laws = [e for e in model.structure.written if e.has(TIME)]
    if not any(real(name) in law.free_symbols for name in swept for law in laws):
        own = model.period()
        return repeated(np.nan if own is None else own, count)
    values = {real(n): np.full(count, v) for n, v in model.parameters.items()}
    values.update((real(n), v) for n, v in swept.items())
    return common_periods(laws, TIME, values)


def spans_of(t: Any, periods: Any, t0: float, settle: float, own: Floats) -> tuple[Floats, Floats]:
    """Validate time spans (m, 2), and the times from which each trajectory counts (m,).

    Raises
    ------
    ArgumentError
        For none or both of ``t`` and ``periods``, an empty or non-finite span, a trajectory
        without a period, or a ``settle`` as long as the run.
    """
    if (t is None) == (periods is None):
        received = "both" if t is not None else "neither"
        raise ArgumentError(f"expected t=(start, end) or periods=, received {received}")
    if settle < 0:
        raise ArgumentError(f"settle = {settle:g}; expected a number from 0")
    if t is not None:
        if t0 != 0:
            raise ArgumentError("t0= goes with periods=; with t=(start, end) it is in t")
        values = numbers("t", t)
        if values.shape != (2,):
            raise ArgumentError(f"t = {t!r}; expected a pair (start, end)")
        if not (np.isfinite(values).all() and values[0] < values[1]):
            raise ArgumentError(
                f"t = ({values[0]:g}, {values[1]:g}); expected finite times, start < end"
            )
        length, unit = values[1] - values[0], repeated(1.0, len(own))
        spans = repeated(values, len(own))
    else:
        length = positive("periods", periods)
        without = np.flatnonzero(np.isnan(own))
        if len(without):
            raise ArgumentError(
                f"periods={periods!r}, but nothing in trajectory {without[0]} has a common "
                "period; give t=(start, end), or the period as period="
            )
        unit = own
        if own.strides == (0,):
            spans = repeated([t0, t0 + length * own[0]], len(own))
        else:
            spans = read_only(np.stack([np.full(len(own), t0), t0 + length * own], axis=1))
    if settle >= length:
        raise ArgumentError(
            f"settle = {settle:g}; expected less than the length of the run, {length:g}"
        )
    if unit.strides == (0,):
        return spans, repeated(spans[0, 0] + settle * unit[0], len(own))
    return spans, read_only(spans[:, 0] + settle * unit)


def times_of(samples: Any, spans: Floats, since: Floats) -> Floats:
    """Validate sample times: (1, N) for all, or (m, N); N = 0 for none.

    Raises
    ------
    ArgumentError
        For fewer than two, or for times that do not increase within every span.
    """
    if samples is None:
        return np.empty((1, 0))
    common = bool(np.all(spans == spans[0]) and np.all(since == since[0]))
    if isinstance(samples, (int, np.integer)) and not isinstance(samples, bool):
        count = whole(2, MOST_SAMPLES)("samples", samples)
        rows = slice(0, 1) if common else slice(None)
        times = np.linspace(since[rows], spans[rows, 1], count, axis=1)
        return np.ascontiguousarray(times)
    times = np.atleast_1d(numbers("samples", samples))
    if times.ndim != 1 or not np.isfinite(times).all() or np.any(np.diff(times) < 0):
        raise ArgumentError("samples: expected increasing, finite times")
    low, high = spans[:, 0].max(), spans[:, 1].min()
    if len(times) and (times[0] < low or times[-1] > high):
        raise ArgumentError(
            f"samples from {times[0]:g} to {times[-1]:g} are outside the runs, whose common span "
            f"is [{low:g}, {high:g}]"
        )
    return np.ascontiguousarray(times[None, :])
