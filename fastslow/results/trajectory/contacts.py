"""Contact statistics: numbers of crossings and time fractions in each region."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from fastslow.errors import unknown_name
from fastslow.results.base.result import Result
from fastslow.results.trajectory.section import period_of, window_of

if TYPE_CHECKING:
    from fastslow.results.trajectory.trajectory import Trajectory


@dataclass(frozen=True, eq=False)
class Contacts(Result):
    """Contact statistics over a time interval of a run.

    Parameters
    ----------
    interfaces : tuple of str
    since, until : float
        The time interval.
    hits : ndarray of int, shape (n_interfaces, 2)
        Crossings upwards and downwards.
    time_fractions : mapping
        The fraction of time in each region and sliding motion.
    period : float or None
        The period; None for a run without one.
    per_period : ndarray of int, shape (n_periods, n_interfaces, 2)
        Crossings in each whole period, counted back from ``until``.

    Examples
    --------
    >>> import sympy as sp, fastslow as fs
    >>> x, v = sp.symbols("x v")
    >>> run = fs.simulate(fs.Model({x: v, v: -sp.sign(x)}), [0.5, 0.0], t=(0, 8))
    >>> contacts = run.contacts(period=4)
    >>> contacts.per_period.tolist()
    [[[1, 1]], [[1, 1]]]
    >>> {name: round(share, 9) for name, share in contacts.time_fractions.items()}
    {'S1': 0.5, 'S2': 0.5}
    """

    interfaces: tuple[str, ...]
    since: float
    until: float
    hits: NDArray[np.int64]
    time_fractions: Mapping[str, float]
    period: float | None
    per_period: NDArray[np.int64]


def count_hits(
    run: Trajectory, interface: object, direction: int | None, window: tuple[float, float]
) -> int:
    """Count the crossings of an interface; see `Trajectory.hits`."""
    if str(interface) not in run.interfaces:
        raise unknown_name("interface", interface, run.interfaces)
    up, down = _counts(run, window)[run.interfaces.index(str(interface))]
    return int({1: up, -1: down, None: up + down}[direction])


def time_fractions_in(run: Trajectory, window: tuple[float, float]) -> dict[str, float]:
    """Return the fraction of a time interval in each region and sliding motion."""
    begin, end = window
    total = end - begin
    spent = dict.fromkeys(run.regions, 0.0)
    for segment in run.segments:
        inside = min(segment.end, end) - max(segment.start, begin)
        if inside > 0.0:
            spent[segment.region] = spent.get(segment.region, 0.0) + inside / total
    return spent


def contacts_of(run: Trajectory, period: float | None, window: tuple[float, float]) -> Contacts:
    """Return hits and time fractions, in total and by period; see `Trajectory.contacts`."""
    length = period_of(run, period) if (period or run.period) is not None else None
    begin, end = window
    per_period = np.zeros((0, len(run.interfaces), 2), dtype=np.int64)
    if length is not None:
        n = int((end - begin) / length + 1e-9)
        edges = np.clip(end - length * np.arange(n, -1, -1.0), begin, end)
        parts = [_counts(run, window_of(run, *pair)) for pair in pairwise(edges)]
        per_period = np.array(parts, dtype=np.int64).reshape(n, len(run.interfaces), 2)
    return Contacts(
        run.interfaces,
        begin,
        end,
        _counts(run, window),
        time_fractions_in(run, window),
        length,
        per_period,
    )


def _counts(run: Trajectory, window: tuple[float, float]) -> NDArray[np.int64]:
    """Count crossings in [since, until), closed at the end of the run, (n_interfaces, 2)."""
    begin, end = window
    time, interface, direction = run.crossing_table[:, :3].T
    inside = (time >= begin) & ((time < end) | (end == run.span[1]))
    counts = np.zeros((len(run.interfaces), 2), dtype=np.int64)
    for column, sign in enumerate((1, -1)):
        mine = interface[inside & (direction == sign)].astype(np.intp)
        np.add.at(counts[:, column], mine, 1)
    return counts
