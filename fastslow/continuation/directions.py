"""A curve traced from one of its points in both directions, and joined there."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol, TypeVar


class OneWay(Protocol):
    """The trace of a curve in one direction."""

    @property
    def closed(self) -> bool:
        """Whether it returned to its start."""


Trace = TypeVar("Trace", bound=OneWay)
Joined = TypeVar("Joined")


def both_ways(
    trace: Callable[[float, Trace | None], Trace],
    joined: Callable[[Trace | None, Trace], Joined],
) -> Joined:
    """Trace a curve in both directions and join the two traces; a closed curve in one.

    Parameters
    ----------
    trace : callable
        (1, None) -> the trace along the tangent; (−1, that trace) -> the trace against it.
    joined : callable
        (backward, forward) -> the curve, of which ``backward`` is None if it is closed. The first
        row of both is the start.

    Examples
    --------
    >>> from types import SimpleNamespace
    >>> def trace(sign, _):
    ...     return SimpleNamespace(rows=[0, sign, 2 * sign], closed=False)
    >>> both_ways(trace, lambda back, ahead: [*back.rows[:0:-1], *ahead.rows])
    [-2.0, -1.0, 0, 1.0, 2.0]
    """
    forward = trace(1.0, None)
    return joined(None if forward.closed else trace(-1.0, forward), forward)
