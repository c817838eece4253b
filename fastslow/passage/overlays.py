"""Which stable sheet of a diagram a trajectory follows, and where it changes."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fastslow.errors import ArgumentError, unknown_name
from fastslow.results.branches import Branch
from fastslow.results.diagrams import Diagram
from fastslow.results.interpolation import hermite
from fastslow.results.overlays import Overlay, StableSheet, Transition
from fastslow.results.points import SpecialPoint
from fastslow.results.trajectories import Trajectory

Array = NDArray[np.float64]

#: A new sheet is followed once this part of the way to it from the old one is done.
WAY = 2.0 / 3.0

#: Codes at which a stable sheet can end.
ENDING = ("LP", "HB", "BP", "BE")


def overlay(diagram: Diagram, run: Trajectory) -> Overlay:
    """Lay a trajectory over the equilibrium diagram of its frozen model.

    At first the followed sheet is the stable one nearest in state. Past its
    end a sheet is continued by its end state, and another one takes over when
    two thirds of the way to it are done, measured along the line between the
    two: what the state has off that line, such as the velocity of the drift,
    does not count, and the answer does not flicker halfway.

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
    extent = _extent(diagram, sheets, state)
    places, present = _places(diagram, sheets, slow, extent)
    followed = _followed(state / extent, places, present)
    transitions = []
    for row in np.flatnonzero(np.diff(followed)) + 1:
        left, entered = sheets[followed[row - 1]], sheets[followed[row]]
        times = np.array([time[row - 1], time[row]])
        if run.series is not None:
            times = _narrowed(diagram, run, (left, entered), extent, times)
            columns = run.dense_columns(times)
            slow_now = columns[run.columns.index(slow_name)]
            state_now = columns[[run.columns.index(n) for n in diagram.states], 1]
        else:
            slow_now, state_now = slow[row - 1 : row + 1], state[row].copy()
        transitions.append(
            _transition(diagram, left, entered, float(times[1]), float(slow_now[1]), state_now)
        )
    distance = np.linalg.norm(state / extent - places[np.arange(len(time)), followed], axis=1)
    return Overlay(diagram, run, time, slow, state, distance, sheets, followed, tuple(transitions))


def _extent(diagram: Diagram, sheets: tuple[StableSheet, ...], state: Array) -> Array:
    """Unit of each state: the larger of its extents in the run and on any sheet."""
    extent = np.ptp(state, axis=0)
    for sheet in sheets:
        rows = diagram.branches[sheet.branch].state[sheet.start : sheet.stop]
        extent = np.maximum(extent, np.ptp(rows, axis=0))
    extent[extent == 0] = 1.0
    return extent


def _narrowed(
    diagram: Diagram,
    run: Trajectory,
    pair: tuple[StableSheet, StableSheet],
    extent: Array,
    times: Array,
) -> Array:
    """Two times, close to rounding, between which the second sheet takes over."""
    for _ in range(9):
        fine = np.linspace(times[0], times[1], 33)
        columns = run.dense_columns(fine)
        slow = columns[run.columns.index(diagram.parameter)]
        state = columns[[run.columns.index(n) for n in diagram.states]].T
        places, present = _places(diagram, pair, slow, extent)
        over = present[:, 1] & (_way(state / extent, places[:, 0], places[:, 1]) > WAY)
        over[0], over[-1] = False, True
        k = int(np.argmax(over))
        times = fine[k - 1 : k + 1]
    return times


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


def _places(
    diagram: Diagram, sheets: tuple[StableSheet, ...], slow: Array, extent: Array
) -> tuple[Array, NDArray[np.bool_]]:
    """Scaled state of each sheet at each sample (N, sheets, n), and whether it exists there."""
    places = np.empty((len(slow), len(sheets), len(extent)))
    present = np.empty((len(slow), len(sheets)), dtype=bool)
    for k, sheet in enumerate(sheets):
        branch = diagram.branches[sheet.branch]
        values = branch.parameter[sheet.start : sheet.stop]
        low, high = sorted((values[0], values[-1]))
        present[:, k] = (slow >= low) & (slow <= high)
        places[:, k] = _on_sheet(branch, sheet, np.clip(slow, low, high)) / extent
    return places, present


def _on_sheet(branch: Branch, sheet: StableSheet, slow: Array) -> Array:
    """States of a sheet at parameter values inside its range, shape (N, n)."""
    values = branch.parameter[sheet.start : sheet.stop]
    rising = values[-1] >= values[0]
    ordered = values if rising else values[::-1]
    place = np.clip(np.searchsorted(ordered, slow, side="right") - 1, 0, len(values) - 2)
    rows = sheet.start + (place if rising else len(values) - 2 - place)
    return hermite(branch, rows, slow)


def _way(scaled: Array, old: Array, new: Array) -> Array:
    """Which part of the way from the old sheet to the new one a state has done."""
    chord = new - old
    length = (chord**2).sum(axis=-1)
    done = ((scaled - old) * chord).sum(axis=-1)
    return np.asarray(done / np.where(length > 0, length, np.inf))


def _first_of(first: Array, candidate: Array) -> int:
    """The nearest sheet at the start; of several as near, the one that the motion turns to."""
    # sheets are interpolated, to about four digits of their distance
    tied = np.flatnonzero(first <= 1.001 * first.min())
    if len(tied) > 1:
        later = candidate[:, tied]
        present = np.isfinite(later).all(axis=1)
        later = later[present]
        split = np.flatnonzero(later.min(axis=1) < 0.5 * later.max(axis=1))
        if len(split):
            return int(tied[np.argmin(later[split[0]])])
    return int(tied[0])


def _followed(scaled: Array, places: Array, present: NDArray[np.bool_]) -> NDArray[np.intp]:
    """The followed sheet at each sample."""
    apart = np.linalg.norm(scaled[:, None] - places, axis=2)
    candidate = np.where(present, apart, np.inf)
    first = candidate[0] if np.isfinite(candidate[0]).any() else apart[0]
    current = _first_of(first, candidate)
    followed = np.empty(len(apart), dtype=np.intp)
    done = 0
    while done < len(apart):
        rivals = candidate[done:].copy()
        rivals[:, current] = np.inf
        best = np.argmin(rivals, axis=1)
        ahead = np.arange(done, len(apart))
        way = _way(scaled[done:], places[done:, current], places[ahead, best])
        over = np.isfinite(rivals.min(axis=1)) & (way > WAY)
        change = int(np.argmax(over)) if over.any() else len(over)
        followed[done : done + change] = current
        done += change
        if done < len(apart):
            current = int(best[change])
    return followed


def _transition(
    diagram: Diagram,
    left: StableSheet,
    entered: StableSheet,
    time: float,
    value: float,
    state: Array,
) -> Transition:
    special = _responsible(diagram, left, value)
    delay = float("nan")
    if special is not None:
        branch = diagram.branches[left.branch]
        middle = branch.parameter[(left.start + left.stop - 1) // 2]
        end = special[diagram.parameter]
        delay = float(np.sign(end - middle) * (value - end))
    return Transition(time, value, state, left.label, entered.label, special, delay)


def _responsible(diagram: Diagram, left: StableSheet, value: float) -> SpecialPoint | None:
    """Of the special points at which a sheet ends, the one nearest to a value."""
    branch = diagram.branches[left.branch]
    ends = [
        point
        for point, row in zip(branch.special, branch.special_rows, strict=True)
        if point.code in ENDING and left.start - 1 <= row <= left.stop
    ]
    return min(ends, key=lambda p: abs(p[diagram.parameter] - value), default=None)
