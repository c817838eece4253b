"""Points at which a field is tangent to an interface."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fastslow.results.base.immutable import ImmutableSequence
from fastslow.results.points import _Point


@dataclass(frozen=True, eq=False)
class Tangency(_Point):
    """A point of an interface h = 0 at which the field of one of its sides is tangent to it.

    There the Lie derivative L h = ∇h·f of the region's rates vanishes; the second
    one says to which side the orbit through the point bends (Filippov 1988).

    Parameters
    ----------
    interface : str
        The interface.
    region : str
        The region whose field is tangent; the point lies in its closure.
    states : tuple of str
        State names.
    state : ndarray, shape (n,)
        The point.
    parameters : mapping
        Every parameter value at which it was found.
    second_derivative : float
        L²h, the second derivative of h in time along the region's field.
    visible : bool or None
        Whether the orbit bends into the region, so that it is one of the model's:
        L²h has the sign of h there. None where L²h vanishes (a cusp, or a boundary
        equilibrium).
    two_fold : bool
        Whether the field across the interface, a different one, is tangent there too.
    residual : float
        Larger of |h| and |L h| at the point.
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
    """The tangency points at given values, as a tuple that says how sure it is.

    Attributes
    ----------
    completeness : str
        ``"complete"`` when the tuple is proved to hold all of them, else ``"found"``.
    """

    completeness: str

    def __new__(cls, items: Iterable[Tangency] = (), completeness: str = "found") -> Tangencies:
        made = super().__new__(cls, items)
        made.completeness = completeness
        return made

    def __getnewargs__(self) -> tuple[Any, ...]:
        return tuple(self), self.completeness
