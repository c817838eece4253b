"""Passages of a drifting parameter through piecewise-linear rates, in closed form."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: A step resolves the fastest motion; after this many it doubles at every further tenth of them.
FINE = 2000

#: Steps in all: the last ones are 2^90 times the first.
STEPS = 20_000


@dataclass(frozen=True, eq=False)
class LinearFlow:
    """y' = J y + b μ, μ' = rate, as one linear flow of z = (y, μ, 1).

    Parameters
    ----------
    jacobian : ndarray, shape (n, n)
    slope : ndarray, shape (n,)
        b.
    rate : float
    """

    jacobian: Array
    slope: Array
    rate: float

    @property
    def matrix(self) -> Array:
        n = len(self.slope)
        whole = np.zeros((n + 2, n + 2))
        whole[:n, :n] = self.jacobian
        whole[:n, n] = self.slope
        whole[n, n + 1] = self.rate
        return whole

    def quasi_static(self) -> tuple[Array, Array]:
        """The bounded motion y = first·μ + second: −J⁻¹b and −J⁻²b·rate."""
        first = np.linalg.solve(-self.jacobian, self.slope)
        second = np.linalg.solve(self.jacobian, self.rate * first)
        return np.asarray(first, dtype=float), np.asarray(second, dtype=float)

    def at(self, start: Array, time: float) -> Array:
        """Give z at a time after it was ``start``."""
        from scipy.linalg import expm

        return np.asarray(expm(self.matrix * time) @ start)

    def _height(self, row: Array, start: Array, time: float) -> float:
        return float(row @ self.at(start, time))

    def reaches(self, start: Array, row: Array, bound: Array | None = None) -> tuple[float, bool]:
        """When row·z first vanishes, and whether bound·z has turned negative before.

        Parameters
        ----------
        start : ndarray, shape (n + 2,)
        row : ndarray, shape (n + 2,)
        bound : ndarray, shape (n + 2,), optional

        Returns
        -------
        time : float
            nan if never.
        left : bool
            The search ends there, with a time of nan.
        """
        from scipy.linalg import expm
        from scipy.optimize import brentq

        reached = 1e-12 * float(np.abs(row).max()) * float(np.abs(start[:-1]).max())
        if abs(float(row @ start)) <= reached:
            return 0.0, False
        speed = float(np.abs(np.linalg.eigvals(self.jacobian)).max(initial=0.0))
        step = 0.1 / max(speed, 1e-300)
        through = expm(self.matrix * step)
        z, side, time = start, math.copysign(1.0, float(row @ start)), 0.0
        for count in range(1, STEPS + 1):
            with np.errstate(over="ignore", invalid="ignore"):
                following = through @ z
            if not np.isfinite(following).all():
                break
            if bound is not None and float(bound @ following) < 0.0:
                return math.nan, True
            if side * float(row @ following) <= 0.0:
                part = brentq(partial(self._height, row, z), 0.0, step, xtol=1e-15 * step)
                return time + float(part), False
            z, time = following, time + step
            if count >= FINE and count % (FINE // 10) == 0:
                step *= 2.0
                with np.errstate(over="ignore", invalid="ignore"):
                    through = through @ through
        return math.nan, False
