"""Passages of a drifting parameter through piecewise-linear rates, in closed form."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import partial

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: A step resolves the fastest motion; after this many it doubles at every further tenth of them.
FINE = 2000

#: Steps in all: the last ones are 2^90 times the first.
STEPS = 20_000

#: Fixed-point and Newton steps for the slow manifold: it converges by the ratio of time scales.
ITERATIONS = 60


@dataclass(frozen=True, eq=False)
class LinearFlow:
    """A linear flow of z = (y, μ, t, 1).

    y' = J y + b μ + f, μ' = rate + change·t + by_value·μ + by_state·y.

    Parameters
    ----------
    jacobian : ndarray, shape (n, n)
    slope : ndarray, shape (n,)
        b.
    rate, change, by_value : float
    by_state : ndarray, shape (n,)
        Empty for zero.
    offset : ndarray, shape (n,)
        f, empty for zero.
    """

    jacobian: Array
    slope: Array
    rate: float
    change: float = 0.0
    by_value: float = 0.0
    by_state: Array = field(default_factory=lambda: np.empty(0))
    offset: Array = field(default_factory=lambda: np.empty(0))

    @property
    def feedback(self) -> Array:
        """``by_state``, shape (n,)."""
        return self.by_state if self.by_state.size else np.zeros(len(self.slope))

    @property
    def drift(self) -> Array:
        """Row whose product with z is μ', shape (n + 3,)."""
        return np.concatenate([self.feedback, [self.by_value, self.change, self.rate]])

    @property
    def matrix(self) -> Array:
        n = len(self.slope)
        whole = np.zeros((n + 3, n + 3))
        whole[:n, :n] = self.jacobian
        whole[:n, n] = self.slope
        if self.offset.size:
            whole[:n, n + 2] = self.offset
        whole[n] = self.drift
        whole[n + 1, n + 2] = 1.0
        return whole

    def slow_manifold(self) -> Array | None:
        """The rows (X, Y₁, Y₀) of y = X μ + Y₁ t + Y₀, invariant and slow, shape (3, n).

        Invariance gives X λ = J X + b with λ = by_value + by_state·X, and two linear
        equations for the rest; without feedback X = −J⁻¹b and Y₀ = −J⁻²b·rate. None
        where the drift is not slow beside the other motions.
        """
        pace = math.nan
        along = np.linalg.solve(-self.jacobian, self.slope)
        for _ in range(ITERATIONS):
            before, pace = pace, self.by_value + float(self.feedback @ along)
            if abs(pace - before) <= 1e-15 * abs(pace):
                break
            along = np.linalg.solve(self.jacobian - pace * np.eye(len(along)), -self.slope)
        else:
            return None
        held = self.jacobian - np.outer(along, self.feedback)
        in_time = np.linalg.solve(held, self.change * along)
        offset = np.linalg.solve(held, self.rate * along + in_time)
        return np.array([along, in_time, offset])

    def slow_motion(self, manifold: Array, time: float) -> Array:
        """Give z on the slow manifold at a time, with μ = 0 at t = 0."""
        from scipy.linalg import expm

        along, in_time, offset = manifold
        whole = np.zeros((3, 3))
        whole[0] = [
            self.by_value + self.feedback @ along,
            self.change + self.feedback @ in_time,
            self.rate + self.feedback @ offset,
        ]
        whole[1, 2] = 1.0
        mu = float((expm(whole * time) @ np.array([0.0, 0.0, 1.0]))[0])
        return np.concatenate([along * mu + in_time * time + offset, [mu, time, 1.0]])

    def slow_crossing(self, manifold: Array, row: Array) -> float:
        """When row·z vanishes on the slow manifold, near where μ = 0; nan if Newton's fails."""
        time = 0.0
        for _ in range(ITERATIONS):
            z = self.slow_motion(manifold, time)
            speed = float(row @ (self.matrix @ z))
            if speed == 0.0:
                return math.nan
            step = -float(row @ z) / speed
            time += step
            if abs(step) <= 1e-13 * abs(time):
                return time
        return math.nan

    def at(self, start: Array, time: float) -> Array:
        """Give z at a time after it was ``start``."""
        from scipy.linalg import expm

        return np.asarray(expm(self.matrix * time) @ start)

    def _height(self, row: Array, start: Array, time: float) -> float:
        return float(row @ self.at(start, time))

    def reaches(self, start: Array, rows: Array) -> tuple[float, int]:
        """When the first of some rows·z turns negative, and which.

        Parameters
        ----------
        start : ndarray, shape (n + 3,)
        rows : ndarray, shape (m, n + 3)
            Of products that are not negative at the start, but for rounding.

        Returns
        -------
        time : float
            nan if never.
        row : int
            −1 if never.
        """
        from scipy.linalg import expm

        speed = float(np.abs(np.linalg.eigvals(self.jacobian)).max(initial=0.0))
        step = 0.1 / max(speed, 1e-300)
        through = expm(self.matrix * step)
        z, time = start, 0.0
        for count in range(1, STEPS + 1):
            with np.errstate(over="ignore", invalid="ignore"):
                following = through @ z
            if not np.isfinite(following).all():
                break
            passed = np.flatnonzero(rows @ following < 0.0)
            if len(passed):
                part, row = min((self._root(rows[k], z, step), int(k)) for k in passed)
                return time + part, row
            z, time = following, time + step
            if count >= FINE and count % (FINE // 10) == 0:
                step *= 2.0
                with np.errstate(over="ignore", invalid="ignore"):
                    through = through @ through
        return math.nan, -1

    def _root(self, row: Array, start: Array, step: float) -> float:
        """When row·z turns negative within a step."""
        from scipy.optimize import brentq

        if float(row @ start) <= 0.0:
            return 0.0
        return float(brentq(partial(self._height, row, start), 0.0, step, xtol=1e-15 * step))
