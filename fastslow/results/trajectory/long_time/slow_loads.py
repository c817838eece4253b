"""Result of the slow-load criterion for a gap."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fastslow.results.base.result import Result
from fastslow.results.trajectory.long_time.regimes import NO_GAP

Floats = NDArray[np.float64]

#: Regime where the criterion does not apply.
UNDECIDED = "undecided"


@dataclass(frozen=True, eq=False, repr=False)
class SlowLoad(Result):
    """Prediction of whether a gap is crossed under a load B + C sin(ω t).

    All arrays have the shape of the given parameters, () for one set.

    Parameters
    ----------
    mean, amplitude, omega : ndarray
        B, C ≥ 0 and ω.
    damping : ndarray
        c in the gap, where x'' + c x' = B + C sin(ω t).
    stiffness : ndarray
        Contact stiffness at the interface on the loaded side.
    half_width : ndarray
        Half-width of the gap.
    widest : ndarray
        Largest half-width that is crossed; 0 if the state never separates from the
        near side, NaN if the criterion does not apply.
    exact : bool
        True for the closed-form solution in the gap, False for the expansion for
        ω → 0.
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
        """Predicted regime, with the labels of `Trajectory.regime`.

        ``"undecided"`` if the mean load is zero or the criterion does not apply,
        ``"no gap"`` if the half-width is not positive.
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
            regimes = ", ".join(f"{k}: {n}" for k, n in zip(kinds, counts, strict=True))
            return f"SlowLoad at {self.widest.size} parameter sets: {regimes}"
        load = f"{self.mean:.6g} ± {self.amplitude:.6g} at ω = {self.omega:.6g}"
        gap = f"half-width {self.half_width:.6g}, crossed up to {self.widest:.6g}"
        return f"SlowLoad {load}: {gap}: {self.regime}"
