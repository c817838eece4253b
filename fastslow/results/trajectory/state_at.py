"""A state at a time: of a trajectory, and of an overlay with what is followed then."""

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

#: Samples that are read at once by an iteration.
BLOCK = 1024


@dataclass(frozen=True, eq=False, repr=False)
class StatePoint(_Point):
    """A trajectory at one time; of an overlay also what it follows then.

    ``moment["x"]`` is a state, slow quantity or parameter by name, ``moment["t"]`` the time.

    Parameters
    ----------
    time : float
    states : tuple of str
        States and slow states; of an overlay the fast states.
    state : ndarray, shape (n,)
        Their values: of a trajectory with ``time`` a start for `fastslow.simulate`.
    slow : mapping
        Slow quantities then.
    region : str
        The region then; at a crossing the one that is entered.
    parameters : mapping
        Parameter values.
    interpolated : bool
        Whether it was read between samples on a straight line, for want of dense output.
    resting : bool
        Whether it is an end of a stretch of time that stays on the level asked for.
    parameter : str
        Of an overlay the slow quantity that its diagram is over.
    sheet : str
        Of an overlay the label of the sheet followed, empty where none is.
    branch : int or None
        The number of that sheet's branch in the diagram.
    distance : float
        Of an overlay the distance from the sheet; see `fastslow.Overlay`.
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
    sheet: str = ""
    branch: int | None = None
    distance: float = float("nan")

    @property
    def value(self) -> float:
        """Of an overlay, the slow quantity that its diagram is over; else nan."""
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
        more = f", on {self.sheet}" if self.sheet else ""
        more += "; interpolated" if self.interpolated else ""
        return f"StatePoint(t = {self.time:.9g}: {self._values()}{slow}; in {self.region}{more})"


def is_dense(run: Trajectory) -> bool:
    """Whether there is a series to read between samples."""
    return run.series is not None and len(run.steps) > 0 and run.span[0] < run.span[1]


def check_readable(run: Trajectory) -> None:
    """Refuse a run that kept neither series nor samples."""
    if not is_dense(run) and not len(run):
        raise ArgumentError(
            "this run kept no samples and no dense output; simulate with dense=True or samples="
        )


def state_points_at(run: Trajectory, times: Array) -> list[StatePoint]:
    """The moments at times inside the run, in the order given."""
    if is_dense(run):
        columns, between = columns_at(run, times), np.zeros(len(times), dtype=bool)
    else:
        # without series a run may have samples of its states alone
        rows = run.sampled_columns
        # a few times of many samples: only the neighbours are looked at
        after = np.clip(np.searchsorted(run.t, times), 1, max(len(run.t) - 1, 1))
        near = np.minimum(np.stack([after - 1, after]), len(run.t) - 1)
        low, high = run.t[near]
        part = np.where(high > low, (times - low) / np.where(high > low, high - low, 1.0), 0.0)
        columns = (1 - part) * rows[:, near[0]] + part * rows[:, near[1]]
        between = (part > 0.0) & (part < 1.0)
    return _built(run, times, columns, between)


def sample(run: Trajectory, row: int) -> StatePoint:
    """The moment of a sample."""
    (found,) = _samples(run, row, row + 1)
    return found


def in_blocks(run: Trajectory) -> Iterator[list[StatePoint]]:
    """The moments of all samples, many at once."""
    return (_samples(run, row, row + BLOCK) for row in range(0, len(run), BLOCK))


def _samples(run: Trajectory, start: int, stop: int) -> list[StatePoint]:
    times = run.t[start:stop]
    columns = run.sampled_columns[:, start:stop]
    return _built(run, times, columns, np.zeros(len(times), dtype=bool))


def _built(
    run: Trajectory, times: Array, columns: Array, interpolated: NDArray[np.bool_]
) -> list[StatePoint]:
    """Moments from columns, shape (n or n + n_forcing, N)."""
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
