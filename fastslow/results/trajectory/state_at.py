"""States at instants of a trajectory or an overlay."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from fastslow.errors import ArgumentError, unknown_name
from fastslow.results.points import _Point
from fastslow.results.trajectory.crossings import regions_at
from fastslow.results.trajectory.dense import columns_at

if TYPE_CHECKING:
    from fastslow.results.trajectory.trajectory import Trajectory

Array = NDArray[np.float64]

#: Number of samples evaluated at once by an iteration.
BLOCK = 1024


@dataclass(frozen=True, eq=False, repr=False)
class StatePoint(_Point):
    """The state of a trajectory at one instant; for an overlay also the branch it follows.

    ``point["x"]`` is a state, slow quantity or parameter by name, ``point["t"]`` the time.

    Parameters
    ----------
    time : float
    states : tuple of str
        States and slow states; for an overlay the fast states.
    state : ndarray, shape (n,)
        Their values; with ``time`` an initial state for `fastslow.simulate`.
    slow : mapping
        Values of the slow quantities.
    region : str
        The region; at a crossing the one entered.
    parameters : mapping
        Parameter values.
    interpolated : bool
        True if interpolated linearly between samples, without dense output.
    resting : bool
        True for an end of a time interval in which the quantity is constant at the level.
    parameter : str
        For an overlay, the slow quantity that is the parameter of its diagram.
    stable_branch : str
        For an overlay, the label of the stable branch followed, empty if there is none.
    branch : int or None
        The index of that branch in the diagram.
    distance : float
        For an overlay, the distance from that branch; see `fastslow.Overlay`.
    """

    time: float
    states: tuple[str, ...]
    state: Array
    slow: Mapping[str, float]
    region: str = ""
    parameters: Mapping[str, float] = field(default_factory=dict)
    interpolated: bool = False
    resting: bool = False
    parameter: str = ""
    stable_branch: str = ""
    branch: int | None = None
    distance: float = float("nan")

    @property
    def value(self) -> float:
        """The value of the parameter of an overlay's diagram, else NaN."""
        return self.slow.get(self.parameter, float("nan"))

    def __getitem__(self, name: object) -> float:
        key = str(name)
        known = {**self.parameters, **self.slow, "t": self.time}
        if key in known and key not in self.states:
            return known[key]
        if key not in self.states:
            raise unknown_name("state, slow quantity or parameter", key, [*self.states, *known])
        return float(self.state[self.states.index(key)])

    def __repr__(self) -> str:
        slow = "".join(f", {name} = {value:.6g}" for name, value in self.slow.items())
        more = f", on {self.stable_branch}" if self.stable_branch else ""
        more += "; interpolated" if self.interpolated else ""
        return f"StatePoint(t = {self.time:.9g}: {self._values()}{slow}; in {self.region}{more})"


def is_dense(run: Trajectory) -> bool:
    """Return True for a run with dense output."""
    return run.series is not None and len(run.steps) > 0 and run.span[0] < run.span[1]


def check_readable(run: Trajectory) -> None:
    """Raise ArgumentError for a run without dense output and samples."""
    if not is_dense(run) and not len(run):
        raise ArgumentError(
            "this run has no samples and no dense output; simulate with dense=True or samples="
        )


def state_points_at(run: Trajectory, times: Array) -> list[StatePoint]:
    """Return the states at times inside the run, in the given order."""
    if is_dense(run):
        columns, between = columns_at(run, times), np.zeros(len(times), dtype=bool)
    else:
        # without series a run may have samples of its states alone
        rows = run.sampled_columns
        # only the samples next to each time are evaluated
        after = np.clip(np.searchsorted(run.t, times), 1, max(len(run.t) - 1, 1))
        near = np.minimum(np.stack([after - 1, after]), len(run.t) - 1)
        low, high = run.t[near]
        weight = np.where(high > low, (times - low) / np.where(high > low, high - low, 1.0), 0.0)
        columns = (1 - weight) * rows[:, near[0]] + weight * rows[:, near[1]]
        between = (weight > 0.0) & (weight < 1.0)
    return _built(run, times, columns, between)


def sample(run: Trajectory, row: int) -> StatePoint:
    """Return the state at a sample."""
    (found,) = _samples(run, row, row + 1)
    return found


def in_blocks(run: Trajectory) -> Iterator[list[StatePoint]]:
    """Yield the states at all samples, in blocks."""
    return (_samples(run, row, row + BLOCK) for row in range(0, len(run), BLOCK))


def _samples(run: Trajectory, start: int, stop: int) -> list[StatePoint]:
    times = run.t[start:stop]
    columns = run.sampled_columns[:, start:stop]
    return _built(run, times, columns, np.zeros(len(times), dtype=bool))


def _built(
    run: Trajectory, times: Array, columns: Array, interpolated: NDArray[np.bool_]
) -> list[StatePoint]:
    """Return states at instants from columns, shape (n or n + n_forcing, N)."""
    n, regions = len(run.states), regions_at(run, times).tolist()
    states = np.ascontiguousarray(columns[:n].T)
    slow = columns[n:].T.tolist()
    return [
        StatePoint(
            time,
            run.states,
            states[k],
            dict(zip(run.forcing, slow[k], strict=False)),
            regions[k],
            run.parameters,
            guessed,
        )
        for k, (time, guessed) in enumerate(zip(times.tolist(), interpolated.tolist(), strict=True))
    ]
