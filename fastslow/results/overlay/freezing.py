"""Validity of freezing: the run beside the slow manifold to second order in the rate."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fastslow.results.base.display import Summarized
from fastslow.results.base.result import Result
from fastslow.results.base.table import Row, RowTable

Array = NDArray[np.float64]

#: Second-order term, as a fraction of the first-order term nearby, above which the expansion in
#: the rate is doubtful.
DOUBTFUL_TERM = 0.1


@dataclass(frozen=True, eq=False, repr=False)
class Freezing(Summarized, RowTable[Row], Result):
    """The slow manifold to second order in the rate, along a run.

    While the slow quantity w drifts, the state follows x* + x₁ + x₂ + … with the equilibrium
    x*(w), the lag x₁ = f_x⁻¹ (dx*/dw) w', and x₂ = f_x⁻¹ (dx₁/dt − ½ f_xx[x₁, x₁]). The band
    x* + x₁ ± |x₂| contains the state, up to terms of third order. |x₂|/|x₁| predicts the relative
    error of the lag; the size of the lag does not.

    Parameters
    ----------
    parameter : str
        The slow quantity.
    states : tuple of str
        States of the frozen model.
    t, slow : ndarray, shape (N,)
        Rows of the overlay.
    followed : ndarray of int, shape (N,)
        The stable branch that the run follows, −1 for none.
    state : ndarray, shape (N, n)
        The run.
    equilibrium, lag, second : ndarray, shape (N, n)
        x*, x₁ and x₂; NaN where no stable equilibrium in a region is followed, at jumps of the
        slow quantity, and where the run slides along an interface or is held by a wall.
    ratio : ndarray, shape (N,)
        |x₂| over the largest |x₁| within 40 relaxation times before or after, whichever is smaller,
        in units of the extents of the overlay.
    inside : ndarray, shape (N,)
        Fraction of the half-width |x₂| that is inside the region: below 1 the band is cut at an
        interface, and 0 where x* + x₁ is beyond it. There the law of the boundary equilibrium
        applies.
    """

    parameter: str
    states: tuple[str, ...]
    t: Array
    slow: Array
    followed: NDArray[np.int64]
    state: Array
    equilibrium: Array
    lag: Array
    second: Array
    ratio: Array
    inside: Array

    _row = "t"
    _places = ("t",)

    def __len__(self) -> int:
        return len(self.t)

    @property
    def lower(self) -> Array:
        """Lower edge of the band, x* + x₁ − |x₂|, shape (N, n); NaN beyond an interface."""
        return self._edge(-1.0)

    @property
    def upper(self) -> Array:
        """Upper edge of the band, x* + x₁ + |x₂|, shape (N, n); NaN beyond an interface."""
        return self._edge(1.0)

    def _edge(self, side: float) -> Array:
        width = np.where(self.inside > 0.0, self.inside, np.nan)[:, None] * np.abs(self.second)
        return self.equilibrium + self.lag + side * width

    @property
    def known(self) -> NDArray[np.bool_]:
        """Rows with a band, shape (N,)."""
        return np.asarray(np.isfinite(self.second).all(axis=1))

    @property
    def cut(self) -> NDArray[np.bool_]:
        """Rows at which the band meets an interface, shape (N,)."""
        return self.known & (self.inside < 1.0)

    @property
    def doubtful(self) -> NDArray[np.bool_]:
        """Rows whose second-order term is not small, or whose band is cut, shape (N,)."""
        return self.known & ((self.ratio > DOUBTFUL_TERM) | self.cut)

    def to_dict(self) -> dict[str, NDArray[Any]]:
        """Columns: t, slow quantity, states, the terms and edges of the band, ratio, flags."""
        parts = {
            "": self.state,
            "equilibrium ": self.equilibrium,
            "lag ": self.lag,
            "second ": self.second,
            "lower ": self.lower,
            "upper ": self.upper,
        }
        return {
            "t": self.t,
            self.parameter: self.slow,
            **{f"{w}{n}": a[:, k] for w, a in parts.items() for k, n in enumerate(self.states)},
            "ratio": self.ratio,
            "inside": self.inside,
            "doubtful": self.doubtful,
            "cut": self.cut,
        }

    def _rows(self, rows: slice | NDArray[np.intp]) -> Freezing:
        names = ("t", "slow", "followed", "state", "equilibrium", "lag", "second", "ratio")
        columns: Mapping[str, Any] = {n: getattr(self, n)[rows] for n in (*names, "inside")}
        return Freezing(parameter=self.parameter, states=self.states, **columns)

    def _groups(self) -> list[list[str]]:
        known, total = self.known, len(self)
        name = self.parameter
        lines = [f"Freezing of {name}: band x* + x₁ ± |x₂| at {known.sum()} of {total} rows"]
        if known.any():
            largest = int(np.nanargmax(np.where(known, self.ratio, np.nan)))
            lines.append(
                f"  |x₂|/|x₁| at most {self.ratio[largest]:.3g}, "
                f"at {name} = {self.slow[largest]:.6g}"
            )
        large = known & (self.ratio > DOUBTFUL_TERM)
        if large.any():
            lines.append(
                f"  |x₂| > {DOUBTFUL_TERM:g} |x₁| at {large.sum()} rows, {name} from "
                f"{self.slow[large].min():.6g} to {self.slow[large].max():.6g}: fast and slow "
                "rates are not separated there"
            )
        if self.cut.any():
            lines.append(
                f"  cut by an interface at {self.cut.sum()} rows: the law of its boundary "
                "equilibrium applies there"
            )
        return [lines]
