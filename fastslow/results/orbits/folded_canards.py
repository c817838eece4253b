"""Canards at folded singularities: intersections of slow manifolds of two slow variables."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fastslow.results.base.immutable import fixed
from fastslow.results.base.outcome import Outcome
from fastslow.results.base.table import ResultTable
from fastslow.results.point_types import FOLDED_NODE
from fastslow.results.points import _Point, coordinates

#: Types of canards, in order from the strong one to the weak one.
CANARD_TYPES = ("strong", "secondary", "weak", "saddle")


@dataclass(frozen=True, eq=False, repr=False)
class FoldedCanard(_Point):
    """A canard at a folded singularity, where it passes the section.

    Parameters
    ----------
    type : str
        ``"strong"``, ``"secondary"`` or ``"weak"`` at a folded node, ``"saddle"`` at a folded
        saddle.
    states : tuple of str
        Fast state and slow variables.
    state : ndarray, shape (3,)
        The intersection of both slow manifolds on the section.
    parameters : mapping
    path : ndarray, shape (M, 3)
        The canard, from its start on the attracting sheet to that on the repelling one.
    residual : float
        Distance of the two manifolds there, in units of the range of their curves.
    merged : int
        Number of crossings that are one to rounding, near the weak canard.
    """

    type: str
    states: tuple[str, ...]
    state: NDArray[np.float64]
    parameters: Mapping[str, float]
    path: NDArray[np.float64]
    residual: float
    merged: int = 1

    def __repr__(self) -> str:
        return f"FoldedCanard({self.type}: {self._values()})"


class Canards(ResultTable[FoldedCanard]):
    """The canards at a folded singularity, from the strong to the weak one, as a table.

    Attributes
    ----------
    code : str
        Of the folded singularity, FN or FS.
    ratio : float
        μ of a folded node, else NaN.
    expected : int
        s + 1 at a folded node, s = ⌊(μ + 1)/(2μ)⌋, which holds if the square root of the ratio of
        the rates is small beside μ; 1 at a folded saddle.
    contraction : float
        K = ∫|Re λ| dt along the strong canard, on each side of the section: deviations of the
        starts decay by exp(−K).
    attracting, repelling : numpy.ndarray
        The curves of both slow manifolds on the section: the fast state, and the distance across
        the fold curve, in N rows of two.
    outcome : Outcome
        Whether the number of canards is the expected one.
    """

    code: str
    ratio: float
    expected: int
    contraction: float
    attracting: NDArray[np.float64]
    repelling: NDArray[np.float64]
    outcome: Outcome

    _row = "canard"
    _entry = "canard"

    def __new__(
        cls,
        items: Iterable[FoldedCanard] = (),
        code: str = FOLDED_NODE,
        ratio: float = float("nan"),
        expected: int = 0,
        contraction: float = float("nan"),
        attracting: NDArray[np.float64] | None = None,
        repelling: NDArray[np.float64] | None = None,
        outcome: Outcome = Outcome("found", "", True),  # noqa: B008
    ) -> Canards:
        made = super().__new__(cls, items)
        made.code, made.ratio, made.expected = code, ratio, expected
        made.contraction, made.outcome = contraction, outcome
        none = np.zeros((0, 2))
        made.attracting = fixed("attracting", none if attracting is None else attracting)
        made.repelling = fixed("repelling", none if repelling is None else repelling)
        return made

    def _words(self) -> Mapping[str, Collection[str]]:
        return {"type": CANARD_TYPES}

    def to_dict(self) -> dict[str, NDArray[Any]]:
        """Return the type, the states on the section, the parameters and the residual."""
        return {
            "type": np.array([c.type for c in self], dtype=str),
            **coordinates(self),
            "residual": np.array([c.residual for c in self], dtype=float),
            "merged": np.array([c.merged for c in self], dtype=int),
        }

    def _heading(self) -> str:
        return f"{len(self)} canards at a {self.code}: {self.outcome}"
