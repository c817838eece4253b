"""Closed-form passages of a drifting parameter through piecewise-linear rates."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import cached_property, partial

import numpy as np
from numpy.typing import NDArray

from fastslow.passage.roots import sign_change

Array = NDArray[np.float64]

#: Number of steps that resolve the fastest mode; then the step doubles every tenth of them.
FINE_STEPS = 2000
COARSER = FINE_STEPS // 10

#: Largest number of steps; the last ones are 2^90 times the first.
FLOW_STEPS = 20_000

#: Number of steps in one block.
STEPS_IN_BLOCK = 64

#: Norm of the halved matrix whose exponential is summed, and the number of terms.
HALVED, EXPONENTIAL_TERMS = 0.5, 16

#: Fixed-point and Newton steps for the slow manifold, which converge by the time-scale ratio.
MANIFOLD_ITERATIONS = 60


@dataclass(frozen=True, eq=False)
class LinearFlow:
    """Linear flow of z = (y, μ, t, 1).

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

    @cached_property
    def feedback(self) -> Array:
        """``by_state``, shape (n,)."""
        return self.by_state if self.by_state.size else np.zeros(len(self.slope))

    @cached_property
    def drift(self) -> Array:
        """Row whose product with z is μ', shape (n + 3,)."""
        return np.concatenate([self.feedback, [self.by_value, self.change, self.rate]])

    @cached_property
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
        """Rows (X, Y₁, Y₀) of the slow manifold y = X μ + Y₁ t + Y₀, shape (3, n).

        Invariance gives X λ = J X + b with λ = by_value + by_state·X, and two linear
        equations for the rest; without feedback X = −J⁻¹b and Y₀ = −J⁻²b·rate. None
        if the drift is not slow compared with the other modes.
        """
        pace = math.nan
        along = np.linalg.solve(-self.jacobian, self.slope)
        for _ in range(MANIFOLD_ITERATIONS):
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
        """Return z on the slow manifold at a time, with μ = 0 at t = 0."""
        along, in_time, offset = manifold
        whole = np.zeros((3, 3))
        whole[0] = [
            self.by_value + self.feedback @ along,
            self.change + self.feedback @ in_time,
            self.rate + self.feedback @ offset,
        ]
        whole[1, 2] = 1.0
        mu = float(exponential(whole * time)[0, 2])
        return np.concatenate([along * mu + in_time * time + offset, [mu, time, 1.0]])

    def slow_crossing(self, manifold: Array, row: Array) -> float:
        """Time of row·z = 0 on the slow manifold near μ = 0; nan if Newton's method fails."""
        time = 0.0
        for _ in range(MANIFOLD_ITERATIONS):
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
        """Return z at a time, with z = ``start`` at t = 0."""
        return np.asarray(exponential(self.matrix * time) @ start)

    def _height(self, row: Array, start: Array, time: float) -> float:
        return float(row @ self.at(start, time))

    def reaches(self, start: Array, rows: Array) -> tuple[float, int]:
        """First time at which one of the products rows·z becomes negative, and its row.

        Parameters
        ----------
        start : ndarray, shape (n + 3,)
        rows : ndarray, shape (m, n + 3)
            Rows whose products are nonnegative at the start, up to rounding.

        Returns
        -------
        time : float
            nan if never.
        row : int
            −1 if never.
        """
        speed = float(np.abs(np.linalg.eigvals(self.jacobian)).max(initial=0.0))
        step = 0.1 / max(speed, 1e-300)
        with np.errstate(over="ignore", invalid="ignore"):
            through = exponential(self.matrix * step)
            powers = _powers(through)
            z, time, count = start, 0.0, 0
            while count < FLOW_STEPS:
                following = powers @ z
                lost = ~np.isfinite(following).all(axis=1)
                passed = (following @ rows.T < 0.0) & ~np.logical_or.accumulate(lost)[:, None]
                if passed.any():
                    k = int(np.argmax(passed.any(axis=1)))
                    z = following[k - 1] if k else z
                    part, row = min(
                        (self._root(rows[j], z, step), int(j)) for j in np.flatnonzero(passed[k])
                    )
                    return time + k * step + part, row
                if lost.any():
                    break
                z, time, count = following[-1], time + STEPS_IN_BLOCK * step, count + STEPS_IN_BLOCK
                if count >= FINE_STEPS:
                    for _ in range(
                        (count - FINE_STEPS) // COARSER
                        - (count - STEPS_IN_BLOCK - FINE_STEPS) // COARSER
                    ):
                        step, through = 2.0 * step, through @ through
                    powers = _powers(through)
        return math.nan, -1

    def _root(self, row: Array, start: Array, step: float) -> float:
        """Time within a step at which row·z becomes negative."""
        if float(row @ start) <= 0.0:
            return 0.0
        return sign_change(partial(self._height, row, start), 0.0, step, 1e-15 * step)


def exponential(matrix: Array) -> Array:
    """Exponential of a small matrix, by scaling and squaring of its series.

    Examples
    --------
    >>> turn = exponential(np.array([[0.0, -10.0], [10.0, 0.0]]))
    >>> np.allclose(turn, [[np.cos(10), -np.sin(10)], [np.sin(10), np.cos(10)]], atol=1e-13)
    True
    """
    size = float(np.abs(matrix).sum(axis=1).max(initial=0.0))
    halvings = max(0, math.ceil(math.log2(size / HALVED))) if 0.0 < size < math.inf else 0
    scaled = matrix * 0.5**halvings
    unit = np.eye(len(matrix))
    result = unit + scaled / EXPONENTIAL_TERMS
    for k in range(EXPONENTIAL_TERMS - 1, 0, -1):
        result = unit + scaled @ result / k
    for _ in range(halvings):
        result = result @ result
    return np.asarray(result)


def _powers(matrix: Array) -> Array:
    """Powers 1, 2, …, `STEPS_IN_BLOCK` of a matrix."""
    found = matrix[None]
    while len(found) < STEPS_IN_BLOCK:
        found = np.concatenate([found, found[-1] @ found])
    return found
