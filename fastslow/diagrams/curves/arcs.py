"""Curves traced from one of their points to both ends, with points inserted between the rows."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from fastslow.continuation import curves
from fastslow.continuation.curve_points import CurvePoint
from fastslow.continuation.curves import Frame
from fastslow.continuation.directions import both_ways
from fastslow.continuation.settings import Continuation
from fastslow.results.base.outcome import Outcome

Array = NDArray[np.float64]


class EndedSystem(Protocol):
    """What the outcome of a curve is worded by."""

    @property
    def n(self) -> int:
        """Number of states."""

    @property
    def width(self) -> int:
        """Number of states and free parameters."""

    @property
    def unit(self) -> Array:
        """Unit of every state."""

    @property
    def region_name(self) -> str:
        """The region whose rates vanish."""

    def end(self, status: str, z: Array, where: str) -> Outcome | None:
        """Return the outcome of a curve with these equations, None for the usual one."""


@dataclass(frozen=True, eq=False)
class CurveArc:
    """Rows of a trace, tangents, and the kinds of end."""

    rows: Array
    tangents: Array
    first: str
    last: str

    @property
    def closed(self) -> bool:
        """Whether the curve returned to its start."""
        return self.last == curves.CLOSED

    def with_points(
        self, system: curves.System, found: list[CurvePoint], frame: Frame
    ) -> tuple[Array, Array, list[int]]:
        """Return rows and tangents with points between them, and the row of each point."""
        rows, tangents = self.rows, self.tangents
        places = [f.row + 1 for f in found]
        if found:
            rows = np.insert(rows, places, [f.z for f in found], axis=0)
            own = [_tangent_at(system, f.z, tangents[f.row], frame) for f in found]
            tangents = np.insert(tangents, places, own, axis=0)
        return rows, tangents, [place + k for k, place in enumerate(places)]

    def in_order(self, found: list[CurvePoint], frame: Frame) -> list[CurvePoint]:
        """Return points in their order along the curve."""

        def place(f: CurvePoint) -> tuple[int, float]:
            return f.row, float((f.z - self.rows[f.row]) * frame.weight @ self.tangents[f.row])

        return sorted(found, key=place)


def arc(
    system: curves.System,
    start: Array,
    direction: Array,
    frame: Frame,
    settings: Continuation,
    stop: Callable[[Array], bool] = lambda _: False,
    bounds: Callable[[Array], Array] | None = None,
) -> CurveArc:
    """Trace a curve from a point in both directions.

    Parameters
    ----------
    system : System
    start, direction : ndarray, shape (N + 1,)
    frame : Frame
    settings : Continuation
    stop, bounds : callable
        As of `curves.follow`.
    """

    def trace(sign: float, _: CurveArc | None) -> CurveArc:
        along = sign * direction
        rows, tangents, end = curves.follow(system, start, along, frame, settings, stop, bounds)
        return CurveArc(rows, tangents, end, end)

    return both_ways(trace, _joined)


def _joined(back: CurveArc | None, ahead: CurveArc) -> CurveArc:
    if back is None:
        return ahead
    rows = np.concatenate([back.rows[:0:-1], ahead.rows])
    tangents = np.concatenate([-back.tangents[:0:-1], ahead.tangents])
    return CurveArc(rows, tangents, back.last, ahead.last)


def _tangent_at(system: curves.System, z: Array, before: Array, frame: Frame) -> Array:
    """Return the tangent at a point between rows, oriented as at the row before."""
    tangent = curves.tangent(system, z, frame)
    return tangent if (tangent * frame.weight) @ before >= 0 else -tangent
