"""Tables, clocks and events as arrays of the stepping loop, and parameters at a start."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fastslow.errors import ArgumentError
from fastslow.kernels.taylor.series import CompiledSeries
from fastslow.results.stored.arithmetic import value_of
from fastslow.results.stored.operations import CLOCK_VALUES
from fastslow.simulation.stepper.instants import ROUNDING
from fastslow.simulation.stepper.queued_events import (
    AT_TRIGGER,
    END_OF_CONDITION,
    INITIALLY,
    PERSISTENT,
    PRIORITISED,
    PROGRAM,
)


def instants_of(compiled: CompiledSeries) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Return the rows of `Problem.instants` and of `Problem.knots` of a model."""
    tables, clocks = compiled.tables, compiled.clocks
    width = max((table.n_terms for table in tables), default=0)
    instants = np.zeros((len(tables) + len(clocks), 5), dtype=np.int64)
    knots = np.zeros((sum(len(table.knots) for table in tables), 1 + width))
    place, row = len(compiled.parameters), 0
    for k, table in enumerate(tables):
        last = row + len(table.coefficients)
        instants[k] = place, 1 + table.n_terms, row, last - 1, -1
        knots[row:last, 0] = table.knots[:-1]
        knots[last, 0] = table.knots[-1] if table.periodic else np.inf
        knots[row:last, 1 : 1 + table.n_terms] = table.coefficients
        place, row = place + 2 + table.n_terms, last + 1
    for k, (_, _, jump) in enumerate(clocks, start=len(tables)):
        instants[k] = place, 0, -1, -1, jump
        place += CLOCK_VALUES
    return instants, knots


def fill_switches(
    compiled: CompiledSeries, values: NDArray[np.float64], given: NDArray[np.float64] | None
) -> None:
    """Fill in the given states of switches, shape (m, n_switches), NaN for none, in place."""
    if compiled.switches:
        found = np.nan if given is None else given
        first, last = compiled.switch_place, compiled.switch_place + 2 * len(compiled.switches)
        values[:, first:last:2] = found
        values[:, first + 1 : last : 2] = 1.0 - found


def events_of(compiled: CompiledSeries) -> NDArray[np.int64]:
    """Return the rows of `Problem.events` of a model."""
    width = max((len(event.program) for event in compiled.events), default=0)
    table = np.full((len(compiled.events), PROGRAM + width), END_OF_CONDITION, dtype=np.int64)
    for row, event in zip(table, compiled.events, strict=True):
        row[PERSISTENT], row[INITIALLY] = event.persistent, event.initially
        row[AT_TRIGGER], row[PRIORITISED] = event.at_trigger, bool(event.priority)
        row[PROGRAM : PROGRAM + len(event.program)] = event.program
    return table


def fill_instants(
    compiled: CompiledSeries, values: NDArray[np.float64], times: NDArray[np.float64]
) -> None:
    """Fill in the parameters of tables and clocks at the starts of several runs.

    Parameters
    ----------
    compiled : CompiledSeries
    values : ndarray, shape (m, n_values)
        Parameter values of each run; those of tables and clocks are filled in.
    times : ndarray, shape (m,)

    Raises
    ------
    ArgumentError
        For a clock whose period is not positive.
    """
    place = len(compiled.parameters)
    for table in compiled.tables:
        rows, last = table.pieces(times), place + 2 + table.n_terms
        cycles = table.cycles(times)
        values[:, place] = rows + cycles * len(table.coefficients)
        values[:, place + 1] = table.knots[rows] + cycles * table.length
        values[:, place + 2 : last] = table.coefficients[rows]
        place = last
    known = {f"p{k}": values[:, k] for k in range(len(compiled.parameters))}
    for length, offset, _ in compiled.clocks:
        period, phase = (np.broadcast_to(value_of(e, known), times.shape) for e in (length, offset))
        wrong = np.flatnonzero(~(np.isfinite(period) & (period > 0) & np.isfinite(phase)))
        if len(wrong):
            raise ArgumentError(
                f"a clock of this model has the period {period[wrong[0]]:g}; expected a positive "
                "number: Mod and floor of an argument that increases with time"
            )
        count = np.floor((times - phase) / period)
        # the last instant at or before the start, up to rounding as in the stepping loop
        size = np.abs(times) + period + np.abs(phase)
        rounding = np.minimum(ROUNDING * size, 0.25 * period)
        count += phase + (count + 1.0) * period - times < rounding
        count -= phase + count * period - times >= rounding
        values[:, place] = count
        values[:, place + 1] = np.minimum(phase + count * period, times)
        values[:, place + 2], values[:, place + 3] = period, phase
        place += CLOCK_VALUES
