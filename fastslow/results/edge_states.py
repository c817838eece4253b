"""Edge states: the attractors of the boundary between two basins."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fastslow.arguments import formula, validated
from fastslow.errors import unknown_name
from fastslow.results.base.outcome import Outcome
from fastslow.results.base.result import Result
from fastslow.results.orbits.orbit import Orbit
from fastslow.results.points import Equilibrium


@dataclass(frozen=True, eq=False, repr=False)
class EdgeState(Result):
    """What separates the basins of two attractors.

    ``edge["x"]`` is a state.

    Parameters
    ----------
    type : str
        The type of the equilibrium, such as ``"saddle"`` or ``"pseudo-saddle"``; ``"orbit"``;
        ``"visible tangency"``, ``"grazing"`` or ``"escaping"`` where the runs on both sides part at
        an event; ``"not settled"`` for a chaotic or slow edge.
    states : tuple of str
    state : ndarray, shape (n,)
        The equilibrium, a state of the orbit, or the state at which the runs part.
    point : Equilibrium, optional
        If the edge is an equilibrium or a pseudo-equilibrium.
    orbit : Orbit, optional
        If it is a periodic orbit.
    interface : str
        The interface, or the relation of the reset, at which runs part.
    between : tuple
        The two attractors.
    track : ndarray, shape (k, n)
        States on the boundary that were followed.
    parameters : mapping
    outcome : Outcome
        Unsuccessful if the tracking has not settled.
    """

    type: str
    states: tuple[str, ...]
    state: NDArray[np.float64]
    point: Equilibrium | None
    orbit: Orbit | None
    interface: str
    between: tuple[Equilibrium | Orbit, Equilibrium | Orbit]
    track: NDArray[np.float64]
    parameters: Mapping[str, float]
    outcome: Outcome

    @validated(name=formula)
    def __getitem__(self, name: Any) -> float:
        """Return a state.

        Raises
        ------
        UnknownNameError
            For a name that is no state.
        """
        if str(name) not in self.states:
            raise unknown_name("state", str(name), self.states)
        return float(self.state[self.states.index(str(name))])

    def __repr__(self) -> str:
        at = ", ".join(f"{n} = {v + 0.0:.6g}" for n, v in zip(self.states, self.state, strict=True))
        where = f"; in {self.point.region}" if self.point is not None else ""
        where += f" of {self.interface}" if self.interface else ""
        where += f", period {self.orbit.period:.6g}" if self.orbit is not None else ""
        between = " and ".join(map(_brief, self.between))
        return f"EdgeState({self.type} at {at}{where}; between {between})"


def _brief(one: Equilibrium | Orbit) -> str:
    return one._values() if isinstance(one, Equilibrium) else f"orbit of period {one.period:.6g}"
