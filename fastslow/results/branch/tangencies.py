"""Tangency points: points at which a vector field is tangent to an interface."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fastslow.results.base.table import ResultTable
from fastslow.results.points import _Point, coordinates

#: Words for `Tangency.visible`.
VISIBILITY = {True: "visible", False: "invisible", None: "degenerate"}


@dataclass(frozen=True, eq=False, repr=False)
class Tangency(_Point):
    """A point of an interface h = 0 at which the vector field of one side is tangent to it.

    There the Lie derivative L h = ∇h·f along the region's vector field vanishes; the
    sign of the second one determines the side of the orbit through the point (Filippov
    1988).

    Parameters
    ----------
    interface : str
        The interface.
    region : str
        The region with the tangent vector field; the point is in its closure.
    states : tuple of str
        State names.
    state : ndarray, shape (n,)
        The point.
    parameters : mapping
        All parameter values.
    second_derivative : float
        L²h, the second time derivative of h along the region's vector field.
    visible : bool or None
        True if the orbit through the point remains in the region: L²h has the sign of
        h there. None if L²h vanishes (a cusp, or a boundary equilibrium).
    two_fold : bool
        True if the vector field on the other side, a different one, is tangent too.
    residual : float
        The larger of |h| and |L h| at the point.
    """

    interface: str
    region: str
    states: tuple[str, ...]
    state: NDArray[np.float64]
    parameters: Mapping[str, float]
    second_derivative: float
    visible: bool | None
    two_fold: bool
    residual: float = 0.0

    def __repr__(self) -> str:
        kind = VISIBILITY[self.visible]
        more = ", two-fold" if self.two_fold else ""
        return f"Tangency({self._values()}; of {self.region} to {self.interface}; {kind}{more})"


class Tangencies(ResultTable[Tangency]):
    """The tangency points at given parameter values, as a table.

    Attributes
    ----------
    completeness : str
        ``"complete"`` if it is proved that these are all of them, else ``"found"``.
    """

    completeness: str

    _row = "point"
    _entry = "tangency point"

    def __new__(cls, items: Iterable[Tangency] = (), completeness: str = "found") -> Tangencies:
        made = super().__new__(cls, items)
        made.completeness = completeness
        return made

    def _words(self) -> Mapping[str, Collection[str]]:
        return {"visibility": VISIBILITY.values()}

    def to_dict(self) -> dict[str, NDArray[Any]]:
        """Return interface, region, states, parameters, the second derivative and flags."""
        return {
            **{n: np.array([getattr(t, n) for t in self], str) for n in ("interface", "region")},
            **coordinates(self),
            "second_derivative": np.array([t.second_derivative for t in self], dtype=float),
            "visibility": np.array([VISIBILITY[t.visible] for t in self], dtype=str),
            "two_fold": np.array([t.two_fold for t in self], dtype=bool),
        }

    def _heading(self) -> str:
        many = "point" if len(self) == 1 else "points"
        return f"{len(self)} tangency {many} ({self.completeness})"
