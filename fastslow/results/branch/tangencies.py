"""Tangency points: points at which a vector field is tangent to an interface."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fastslow.results.base.immutable import ImmutableSequence
from fastslow.results.points import _Point


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
        kind = {True: "visible", False: "invisible", None: "degenerate"}[self.visible]
        more = ", two-fold" if self.two_fold else ""
        return f"Tangency({self._values()}; of {self.region} to {self.interface}; {kind}{more})"


class Tangencies(ImmutableSequence, tuple[Tangency, ...]):
    """The tangency points at given parameter values, as a tuple.

    Attributes
    ----------
    completeness : str
        ``"complete"`` if it is proved that these are all of them, else ``"found"``.
    """

    completeness: str

    def __new__(cls, items: Iterable[Tangency] = (), completeness: str = "found") -> Tangencies:
        made = super().__new__(cls, items)
        made.completeness = completeness
        return made

    def _heading(self) -> str:
        many = "point" if len(self) == 1 else "points"
        return f"{len(self)} tangency {many} ({self.completeness})"
