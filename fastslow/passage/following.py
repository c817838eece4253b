"""Which stable sheet of a diagram a trajectory follows, and where it changes."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fastslow.errors import ArgumentError, unknown_name
from fastslow.results.branches import Branch
from fastslow.results.diagrams import Diagram, hermite
from fastslow.results.overlays import Overlay, StableSheet, Transition
from fastslow.results.points import SpecialPoint
from fastslow.results.trajectories import Trajectory

Array = NDArray[np.float64]

#: A new sheet is followed once it is nearer than this times the distance to the old one.
NEARER = 0.5

#: Codes at which a stable sheet can end.
ENDING = ("LP", "HB", "BP", "BE")


def overlay(diagram: Diagram, run: Trajectory) -> Overlay:
    """Lay a trajectory over the equilibrium diagram of its frozen model.

    At each time the followed sheet is the stable one nearest in state; past
    its end a sheet is continued by its end state, and another sheet takes over
    only when it is clearly nearer, so that the answer does not flicker while
    the trajectory is between two.

    Parameters
    ----------
    diagram : Diagram
        Over the slow quantity of the run.
    run : Trajectory
        Of the full model.

    Returns
    -------
    Overlay

    Raises
    ------
    UnknownNameError
        If the diagram's parameter is no slow quantity of the run, or a state is missing.
    ArgumentError
        If the other parameters of the two differ.
    """
    slow_name = diagram.parameter
    quantities = (*run.forcing, *(s for s in run.states if s not in diagram.states))
    if slow_name not in quantities:
        raise unknown_name("slow quantity of the trajectory", slow_name, quantities)
    for name in diagram.states:
        if name not in run.states:
            raise unknown_name("state of the trajectory", name, run.states)
    for name, value in diagram.parameters.items():
        if name in run.parameters and run.parameters[name] != value:
            raise ArgumentError(
                f"the diagram has {name} = {value:g}, the trajectory {run.parameters[name]:g}; "
                "expected the same parameters"
            )
    time, slow = run.t, run[slow_name]
    state = np.column_stack([run[name] for name in diagram.states])
    sheets = _stable_sheets(diagram)
    if not sheets:
        nothing = np.full(len(time), -1)
        far = np.full(len(time), np.inf)
        return Overlay(diagram, run, time, slow, state, far, (), nothing, ())
    apart, present = _distances(diagram, sheets, slow, state)
    followed = _followed(apart, present)
    changes = np.flatnonzero(np.diff(followed)) + 1
    transitions = tuple(
        _transition(diagram, sheets, int(k), time, slow, state, followed) for k in changes
    )
    distance = apart[np.arange(len(time)), followed]
    return Overlay(diagram, run, time, slow, state, distance, sheets, followed, transitions)


def _stable_sheets(diagram: Diagram) -> tuple[StableSheet, ...]:
    """Stable runs of every admissible branch, with the special points that end them."""
    found: list[tuple[int, int, int, str]] = []
    for number, branch in enumerate(diagram.branches):
        if not branch.admissible:
            continue
        stable = branch.stable
        for sheet in branch.sheets():
            rows = np.arange(sheet.start, sheet.stop)
            parts = np.split(rows, np.flatnonzero(np.diff(stable[rows].astype(int))) + 1)
            for part in parts:
                if stable[part[0]]:
                    start = max(sheet.start, int(part[0]) - 1)
                    stop = min(sheet.stop, int(part[-1]) + 2)
                    found.append((number, start, stop, sheet.region))
    counts = {r: sum(f[3] == r for f in found) for r in diagram.regions}
    seen: dict[str, int] = {}
    sheets = []
    for number, start, stop, region in found:
        seen[region] = seen.get(region, 0) + 1
        label = region if counts[region] == 1 else f"{region}.{seen[region]}"
        sheets.append(StableSheet(label, number, start, stop, region))
    return tuple(sheets)


def _distances(
    diagram: Diagram, sheets: tuple[StableSheet, ...], slow: Array, state: Array
) -> tuple[Array, NDArray[np.bool_]]:
    """Distance of each sample to each sheet, and whether the sheet exists there."""
    extent = np.ptp(state, axis=0)
    for sheet in sheets:
        rows = diagram.branches[sheet.branch].state[sheet.start : sheet.stop]
        extent = np.maximum(extent, np.ptp(rows, axis=0))
    extent[extent == 0] = 1.0
    apart = np.empty((len(slow), len(sheets)))
    present = np.empty((len(slow), len(sheets)), dtype=bool)
    for k, sheet in enumerate(sheets):
        branch = diagram.branches[sheet.branch]
        values = branch.parameter[sheet.start : sheet.stop]
        low, high = sorted((values[0], values[-1]))
        present[:, k] = (slow >= low) & (slow <= high)
        nearest = _on_sheet(branch, sheet, np.clip(slow, low, high))
        apart[:, k] = np.linalg.norm((state - nearest) / extent, axis=1)
    return apart, present


def _on_sheet(branch: Branch, sheet: StableSheet, slow: Array) -> Array:
    """States of a sheet at parameter values inside its range, shape (N, n)."""
    values = branch.parameter[sheet.start : sheet.stop]
    rising = values[-1] >= values[0]
    ordered = values if rising else values[::-1]
    place = np.clip(np.searchsorted(ordered, slow, side="right") - 1, 0, len(values) - 2)
    rows = sheet.start + (place if rising else len(values) - 2 - place)
    return hermite(branch, rows, slow)


def _followed(apart: Array, present: NDArray[np.bool_]) -> NDArray[np.intp]:
    """The followed sheet at each sample, with hysteresis."""
    candidate = np.where(present, apart, np.inf)
    first = candidate[0] if np.isfinite(candidate[0]).any() else apart[0]
    current = int(np.argmin(first))
    followed = np.empty(len(apart), dtype=np.intp)
    done = 0
    while done < len(apart):
        rivals = candidate[done:].copy()
        rivals[:, current] = np.inf
        nearer = rivals.min(axis=1) < NEARER * apart[done:, current]
        change = int(np.argmax(nearer)) if nearer.any() else len(nearer)
        followed[done : done + change] = current
        done += change
        if done < len(apart):
            current = int(np.argmin(rivals[change]))
    return followed


def _transition(
    diagram: Diagram,
    sheets: tuple[StableSheet, ...],
    row: int,
    time: Array,
    slow: Array,
    state: Array,
    followed: NDArray[np.intp],
) -> Transition:
    left, entered = sheets[followed[row - 1]], sheets[followed[row]]
    special = _responsible(diagram, left, float(slow[row]))
    drift = float(np.sign(slow[row] - slow[row - 1]))
    delay = drift * (float(slow[row]) - special[diagram.parameter]) if special else float("nan")
    return Transition(
        float(time[row]),
        float(slow[row]),
        state[row].copy(),
        left.label,
        entered.label,
        special,
        delay,
    )


def _responsible(diagram: Diagram, left: StableSheet, value: float) -> SpecialPoint | None:
    """The special point nearest to a value at which a sheet ends, else of the whole branch."""
    branch = diagram.branches[left.branch]
    points = [
        (point, left.start - 1 <= row <= left.stop)
        for point, row in zip(branch.special, branch.special_rows, strict=True)
        if point.code in ENDING
    ]
    ends = [p for p, at_end in points if at_end] or [p for p, _ in points]
    return min(ends, key=lambda p: abs(p[diagram.parameter] - value), default=None)
