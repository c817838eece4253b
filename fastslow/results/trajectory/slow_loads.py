"""What the slow-load criterion says of a gap."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fastslow.results.base.result import Result
from fastslow.results.trajectory.regimes import NO_GAP

Floats = NDArray[np.float64]

#: Regime where the criterion does not apply.
UNDECIDED = "undecided"


@dataclass(frozen=True, eq=False, repr=False)
class SlowLoad(Result):
    """A gap under a load B + C sin(ω t), and the widest gap that the load carries the state across.

    All arrays have the shape of the parameters asked for, () for one set.

    Parameters
    ----------
    mean, amplitude, omega : ndarray
        B, C ≥ 0 and ω.
    damping : ndarray
        In the gap, c in x'' + c x' = B + C sin(ω t).
    stiffness : ndarray
        At the interface on the loaded side, in contact.
    half_width : ndarray
        Of the gap.
    widest : ndarray
        The half-width up to which the far side is reached; 0 where the load
        never lets go of the near side, NaN where the criterion says nothing.
    exact : bool
        Whether it is from the motion in the gap in closed form, else from the
        expansion for ω → 0.
    """

    mean: Floats
    amplitude: Floats
    omega: Floats
    damping: Floats
    stiffness: Floats
    half_width: Floats
    widest: Floats
    exact: bool

    @property
    def regime(self) -> NDArray[np.str_]:
        """The regime predicted, in the words of `Trajectory.regime`.

        ``"undecided"`` where the mean load is zero or the criterion says
        nothing, and ``"no gap"`` where the interfaces have met.
        """
        side = np.where(self.mean > 0.0, "upper", "lower")
        words = np.where(self.half_width <= self.widest, "bilateral", "unilateral ")
        words = np.where(words == "bilateral", words, np.char.add(words, side))
        words = np.where(self.widest == 0.0, np.char.add("meshed ", side), words)
        words = np.where(np.isnan(self.widest) | (self.mean == 0.0), UNDECIDED, words)
        return np.where(self.half_width > 0.0, words, NO_GAP)

    def __repr__(self) -> str:
        if self.widest.ndim:
            kinds, counts = np.unique(self.regime, return_counts=True)
            told = ", ".join(f"{k}: {n}" for k, n in zip(kinds, counts, strict=True))
            return f"SlowLoad at {self.widest.size} parameter sets: {told}"
        load = f"{self.mean:.6g} ± {self.amplitude:.6g} at ω = {self.omega:.6g}"
        gap = f"half-width {self.half_width:.6g}, crossed up to {self.widest:.6g}"
        return f"SlowLoad {load}: {gap}: {self.regime}"
