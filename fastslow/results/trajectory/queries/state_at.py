"""States at instants of a trajectory or an overlay."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from fastslow.errors import unknown_name
from fastslow.results.points import _Point

Array = NDArray[np.float64]


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
