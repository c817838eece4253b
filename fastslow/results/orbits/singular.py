"""A singular cycle: pieces of the slow flow on attracting sheets, and jumps between them."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fastslow.results.base.outcome import Outcome
from fastslow.results.base.table import ResultTable
from fastslow.results.points import _Point, coordinates

#: Types of pieces.
PIECE_TYPES = ("slow", "jump")


@dataclass(frozen=True, eq=False, repr=False)
class SingularPiece(_Point):
    """A piece of a singular cycle.

    Parameters
    ----------
    type : str
        ``"slow"`` along a sheet, ``"jump"`` by the frozen fast flow.
    sheet : str
        Region or, for sliding, both regions of the sheet, on which a jump lands.
    end : str
        Where it ends: ``"fold"``, ``"folded node"`` and so on, ``"corner"``, ``"sliding"`` where
        the same slow motion continues on another sheet, ``"lands"`` for a jump, or why it ends.
    states : tuple of str
        Fast states and slow variables.
    state, last : ndarray, shape (n + m,)
        Its start and its end.
    duration : float
        Slow time ∫ dy/g, in the unit of time of the model; 0 for a jump.
    parameters : mapping
    t, path : ndarray, shape (M,) and (M, n + m)
        Slow time from the start, and the piece at these times.
    """

    type: str
    sheet: str
    end: str
    states: tuple[str, ...]
    state: NDArray[np.float64]
    last: NDArray[np.float64]
    duration: float
    parameters: Mapping[str, float]
    t: NDArray[np.float64]
    path: NDArray[np.float64]

    def __repr__(self) -> str:
        last = ", ".join(f"{n} = {v:.6g}" for n, v in zip(self.states, self.last, strict=True))
        return f"SingularPiece({self.type}: {self._values()} to {last}, {self.end})"


class SingularCycle(ResultTable[SingularPiece]):
    """The pieces of a singular cycle in order, as a table.

    Attributes
    ----------
    period : float
        Sum of the slow times of all pieces, the limit of the period for rates that are separated
        ever farther; NaN if the cycle does not close.
    distance : float
        With two slow variables, distance of the landing from the strong canard of a folded node,
        in units of the ranges of the slow variables up to it: positive in the funnel; NaN
        without a folded node, and where no path along its sheet leads from the strong canard to
        the landing, as very near a folded saddle-node.
    parameter : str
        Parameter that is solved for, empty without one.
    value : float
        Its value at which the return lands on the strong canard.
    outcome : Outcome
        Whether the cycle closes, and whether it passes the funnel of a folded node.
    """

    period: float
    distance: float
    parameter: str
    value: float
    outcome: Outcome

    _row = "piece"
    _entry = "piece"

    def __new__(
        cls,
        items: Iterable[SingularPiece] = (),
        period: float = float("nan"),
        distance: float = float("nan"),
        parameter: str = "",
        value: float = float("nan"),
        outcome: Outcome = Outcome("closed", "", True),  # noqa: B008
    ) -> SingularCycle:
        made = super().__new__(cls, items)
        made.period, made.distance, made.outcome = period, distance, outcome
        made.parameter, made.value = parameter, value
        return made

    def _words(self) -> Mapping[str, Collection[str]]:
        return {"type": PIECE_TYPES}

    def to_dict(self) -> dict[str, NDArray[Any]]:
        """Return type, sheet and end, the states and parameters at the start, and the slow time."""
        return {
            "type": np.array([p.type for p in self], dtype=str),
            "sheet": np.array([p.sheet for p in self], dtype=str),
            "end": np.array([p.end for p in self], dtype=str),
            **coordinates(self),
            "duration": np.array([p.duration for p in self], dtype=float),
        }

    def _heading(self) -> str:
        return f"Singular cycle of {len(self)} pieces: {self.outcome}"
