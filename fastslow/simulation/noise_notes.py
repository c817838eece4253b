"""Notes on states that leave zero by rounding: below their tolerance or underflowed."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fastslow.results.base.outcome import Outcome, with_notes
from fastslow.results.stored.arithmetic import UnknownOperationError, value_of
from fastslow.simulation.arguments import Simulated
from fastslow.simulation.settings import Resolved
from fastslow.simulation.stepper.scales import SMALLEST_SIZE

Floats = NDArray[np.float64]

#: Ratio to its noise from which a state counts as having left zero.
LEFT_ZERO = 1e3


def with_noise(
    outcome: Outcome,
    model: Simulated,
    resolved: Resolved,
    *,
    vanishing: tuple[str, ...],
    together: tuple[tuple[str, ...], ...],
    steps: Floats,
    columns: dict[str, Floats],
    modes: tuple[str, ...],
    direction: float = 1.0,
) -> Outcome:
    """Add a note to the outcome for every state that left zero by rounding.

    Parameters
    ----------
    outcome : Outcome
    model : Model
    resolved : Resolved
    vanishing : tuple of str
        States that are factors of their own rates: only these, and states that vanish
        together, have a known invariant plane.
    together : tuple of tuple of str
        See `jointly_invariant_states`.
    steps : ndarray, shape (N, 4)
        Time, length and mode of every step, and of the end.
    columns : dict
        Values of states and slow quantities at these times, each of shape (N,).
    modes : tuple of str
    direction : float
        −1 for a run backwards, with the negative time in its steps.
    """
    steps = steps * [direction, 1.0, 1.0, 1.0]
    found = []
    for name in (*vanishing, *dict.fromkeys(n for some in together for n in some)):
        absolute = resolved.atol[name] or 0.0
        size = np.abs(columns[name])
        below = np.flatnonzero(size < max(absolute, SMALLEST_SIZE))
        if not len(below):
            continue
        first, rest = below[0], size[below[0] :]
        time = f"t = {steps[first, 0]:.6g}"
        if absolute > SMALLEST_SIZE and rest.max() > LEFT_ZERO * absolute:
            found.append(
                f"{name} fell below its atol = {absolute:g} at {time} and grew again from there: "
                "the tolerance determines when; set atol=0."
            )
        elif (
            name in vanishing
            and size[0] >= SMALLEST_SIZE
            and any(_grows(model, name, columns, steps, modes, below, direction))
        ):
            found.append(
                f"{name} fell below {SMALLEST_SIZE:g}, the smallest number kept, at {time}: what "
                "it would grow to afterwards is lost; use its logarithm as a state."
            )
    for some in together:
        sizes = np.abs([columns[name] for name in some]).max(axis=0)
        gone = np.flatnonzero(sizes < SMALLEST_SIZE)
        if len(gone) and sizes[0] >= SMALLEST_SIZE:
            found.append(
                f"{' and '.join(some)} fell below {SMALLEST_SIZE:g}, the smallest number kept, at "
                f"t = {steps[gone[0], 0]:.6g}: what they might grow to afterwards is lost; use "
                "their logarithms as states."
            )
    return with_notes(outcome, found)


def _grows(
    model: Simulated,
    name: str,
    columns: dict[str, Floats],
    steps: Floats,
    modes: tuple[str, ...],
    below: NDArray[np.intp],
    direction: float,
) -> Iterator[bool]:
    """Signs of the growth rate at zero after a state underflowed, region by region."""
    traits, names = model.traits, (*model.states, *model.slow_states)
    values: dict[str, Any] = {f"y{k}": columns[n] for k, n in enumerate(names)}
    values["t"] = steps[:, 0]
    values = {n: column[below] for n, column in values.items()}
    values |= {f"p{k}": model.parameters[n] for k, n in enumerate(traits.names)}
    lost = np.array([modes[int(k)] for k in steps[below, 2]])
    rates = traits.growth[traits.vanishing.index(name)]
    for region, rate in zip(model.regions, rates, strict=True):
        rows = lost == region
        if rows.any():
            try:
                growth = direction * np.broadcast_to(value_of(rate, values), rows.shape)
                yield bool((growth[rows] > 0).any())
            except UnknownOperationError:
                # a special function: it may grow
                yield True


def notes_on_noise(
    names: tuple[str, ...],
    resolved: Resolved,
    vanishing: tuple[str, ...],
    start: Floats,
    smallest: Floats,
    largest: Floats,
    final: Floats,
) -> tuple[str, ...]:
    """Notes on an ensemble with states that may leave zero by rounding, as `with_noise`.

    Parameters
    ----------
    names : tuple of str
    resolved : Resolved
    vanishing : tuple of str
        States that are factors of their own rates, or that vanish together.
    start, smallest, largest, final : ndarray, shape (m, n)
    """
    found = []
    for i, name in enumerate(names):
        if name not in vanishing:
            continue
        absolute = resolved.atol[name] or 0.0
        low, high = smallest[:, i], largest[:, i]
        least = np.where(low > 0.0, low, np.where(high < 0.0, -high, 0.0))
        first, last = np.abs(start[:, i]), np.abs(final[:, i])
        least = np.fmin(np.fmin(least, first), last)
        left = int(np.count_nonzero((least < absolute) & (last > LEFT_ZERO * absolute)))
        if absolute > SMALLEST_SIZE and left:
            found.append(
                f"{name} fell below its atol = {absolute:g} in {left} of {len(start)} and grew "
                "again from there: the tolerance determines when; set atol=0."
            )
        lost = int(np.count_nonzero((first >= SMALLEST_SIZE) & (last < SMALLEST_SIZE)))
        if absolute <= SMALLEST_SIZE and lost:
            found.append(
                f"{name} fell below {SMALLEST_SIZE:g}, the smallest number kept, in {lost} of "
                f"{len(start)}: what it might grow to afterwards is lost; use its logarithm as "
                "a state."
            )
    return tuple(found)
