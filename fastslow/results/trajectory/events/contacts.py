"""Contact statistics: numbers of crossings and time fractions in each region."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from fastslow.results.base.result import Result
from fastslow.results.trajectory.events.crossings import Segment


@dataclass(frozen=True, eq=False, repr=False)
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


def time_fractions_in(
    segments: Sequence[Segment], regions: tuple[str, ...], window: tuple[float, float]
) -> dict[str, float]:
    """Return the fraction of a time interval in each region and motion, by switch states."""
    begin, end = window
    total = end - begin
    spent = dict.fromkeys(regions, 0.0)
    for segment in segments:
        inside = min(segment.end, end) - max(segment.start, begin)
        if inside > 0.0:
            spent[segment.name] = spent.get(segment.name, 0.0) + inside / total
    return spent


def contacts_of(
    crossings: NDArray[np.float64],
    interfaces: tuple[str, ...],
    time_fractions: Mapping[str, float],
    *,
    window: tuple[float, float],
    period: float | None,
    last: float,
) -> Contacts:
    """Return hits and time fractions, in total and by period; see `Trajectory.contacts`."""
    begin, end = window
    count = len(interfaces)
    per_period = np.zeros((0, count, 2), dtype=np.int64)
    if period is not None:
        n = int((end - begin) / period + 1e-9)
        edges = np.clip(end - period * np.arange(n, -1, -1.0), begin, end)
        parts = [count_hits(crossings, count, pair, last) for pair in pairwise(edges)]
        per_period = np.array(parts, dtype=np.int64).reshape(n, count, 2)
    hits = count_hits(crossings, count, window, last)
    return Contacts(interfaces, begin, end, hits, time_fractions, period, per_period)


def count_hits(
    crossings: NDArray[np.float64], count: int, window: tuple[float, float], last: float
) -> NDArray[np.int64]:
    """Count crossings in [since, until), closed at the end of the run, (n_interfaces, 2)."""
    begin, end = window
    time, interface, direction = crossings[:, :3].T
    inside = (time >= begin) & ((time < end) | (end == last))
    counts = np.zeros((count, 2), dtype=np.int64)
    for column, sign in enumerate((1, -1)):
        mine = interface[inside & (direction == sign)].astype(np.intp)
        np.add.at(counts[:, column], mine, 1)
    return counts
