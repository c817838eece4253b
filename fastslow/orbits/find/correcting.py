"""Points of a branch of orbits, solved for by the compiled Newton's method."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fastslow.orbits.flow.blocks import BLOCKS_FROM
from fastslow.orbits.flow.equations import (
    ACCURACY,
    DEFECT,
    DIVERGENT_CORRECTION,
    GROWTH,
    LARGEST_ROUNDED,
    LINEARISED_STEP,
    LIOUVILLE,
    POINT_RESIDUAL,
    RESIDUAL,
    SCALE,
    STAGNANT,
    USED,
)
from fastslow.orbits.flow.flows import (
    Fields,
    completed,
    factors_for,
    newton_for,
    problem_of,
    segments_for,
)
from fastslow.orbits.flow.problem import growth_of
from fastslow.orbits.flow.shooting import EXACT, BlockInverse, Linearised, Shooting
from fastslow.orbits.flow.stepping import BEGUN, FINISHED, ITERATION

Array = NDArray[np.float64]


class Corrected(NamedTuple):
    """A solved point of a branch.

    Parameters
    ----------
    u : ndarray, shape (N + 1,)
    used : int
        Newton steps.
    tangent : ndarray, shape (N + 1,)
        A unit vector in units of the scales.
    residual, accuracy : float
        Largest residual in units of the rows, and the last correction in units of the scales.
    growth : float
        Largest growth of a perturbation along a segment.
    product : ndarray, shape (n, n), or None
        Product of all matrices along the orbit, divided by exp(scale); None of many unknowns.
    scale : float
    liouville : float
        Logarithm of the determinant of the product by Liouville's formula.
    defect : float
        Largest difference of a logarithm of a determinant of a segment from Liouville's formula.
    slowest : float
        Smallest approach speed of a reset at a wall, infinite without one.
    last : Linearised or None
        The equations before the last correction; None if multipliers follow from the product, and
        of many unknowns, for which they would take much memory.
    """

    u: Array
    used: int
    tangent: Array
    residual: float
    accuracy: float
    growth: float
    product: Array | None
    scale: float
    liouville: float
    defect: float
    slowest: float
    last: Linearised | None


class ShootingCorrector:
    """Newton's method for the equations of a branch, with memory of its own.

    Parameters
    ----------
    shooting : Shooting
        With one chosen parameter.
    scale : ndarray, shape (N + 1,)
        Units of the unknowns.
    tolerance : float
        Newton correction in these units at which a point is accepted.
    iterations : int
        Largest number of Newton steps.
    """

    def __init__(self, shooting: Shooting, scale: Array, tolerance: float, iterations: int) -> None:
        self.shooting = shooting
        size = shooting.size + 1
        self._problem = problem_of(shooting.variations, shooting.parameters)
        self._segments = segments_for(
            shooting.variations, shooting.form.modes, shooting.form.constants
        )
        self._factors = factors_for(self._segments)
        self._linear = shooting.linear_at(np.zeros(size))
        self._newton = newton_for(size, shooting.variations.n, iterations, tolerance)
        self._newton.scale[:] = scale

    def __call__(
        self, guess: Array, direction: Array, start: Array | None = None
    ) -> Corrected | None:
        """Solve in the plane through a guess normal to a direction; None without convergence.

        Newton's method starts at the guess, or at ``start``.
        """
        shooting, newton, progress = self.shooting, self._newton, self._segments.progress
        equations = shooting.equations
        if shooting.forcing is None:
            equations = shooting.with_phase(guess).equations
        newton.guess[:], newton.normal[:] = guess, direction / newton.scale**2
        self._linear.u[:] = guess if start is None else start
        progress[BEGUN] = progress[ITERATION] = 0
        code, self._factors = completed(
            self._problem, equations, self._segments, self._linear, newton, self._factors
        )
        if code != FINISHED:
            return None
        numbers, last = newton.numbers.tolist(), None
        if shooting.forcing is None or shooting.slides:
            last = shooting.linearisation(self._linear, self._segments, self._factors)
        return Corrected(
            u=shooting.on_interfaces(self._linear.u.copy()),
            used=int(numbers[USED]),
            tangent=newton.tangent.copy(),
            residual=numbers[RESIDUAL],
            accuracy=numbers[ACCURACY],
            growth=numbers[GROWTH],
            product=newton.product.copy(),
            scale=numbers[SCALE],
            liouville=numbers[LIOUVILLE],
            defect=numbers[DEFECT],
            slowest=shooting.slowest(Fields.of(self._linear.known, shooting.variations)),
            last=last,
        )


class BlockCorrector:
    """Newton's method of very many unknowns, whose equations are kept as blocks.

    As `ShootingCorrector`.
    """

    def __init__(self, shooting: Shooting, scale: Array, tolerance: float, iterations: int) -> None:
        self.shooting, self._scale = shooting, scale.copy()
        self._tolerance, self._iterations = tolerance, iterations

    @np.errstate(all="ignore")
    def __call__(
        self, guess: Array, direction: Array, start: Array | None = None
    ) -> Corrected | None:
        """Solve in the plane through a guess, see `ShootingCorrector`."""
        scale = self._scale
        shooting = self.shooting.with_phase(guess)
        u, normal = (guess if start is None else start).copy(), direction / scale
        used, before = 0, np.inf
        for iteration in range(1, self._iterations + 2):
            last = shooting.linearised(u)
            inverse = BlockInverse.of(last, scale)
            if inverse is None:
                return None
            height = float((guess - u) / scale @ normal)
            step, along = inverse.step_in_plane(last.residual, normal, height)
            size, residual = float(np.abs(step).max()), inverse.residual(last.residual)
            if not size <= DIVERGENT_CORRECTION:
                return None
            # one step more than is needed, as the compiled iteration
            done = size <= LINEARISED_STEP or used > 0
            rounded = STAGNANT * before <= size and max(size, before) <= LARGEST_ROUNDED
            if not used and (size <= self._tolerance or (rounded and residual <= EXACT)):
                used = iteration
            before = size
            if done:
                break
            if not used and iteration >= self._iterations:
                return None
            u = u + step * scale
        if max(residual, size) > POINT_RESIDUAL:
            return None
        segments, _ = shooting.unpack(u)
        n = shooting.variations.n
        traces, growth = last.flows.traces, growth_of(last, segments, scale[:n])
        return Corrected(
            u=shooting.on_interfaces(u + step * scale),
            used=used or iteration,
            tangent=along * scale,
            residual=residual,
            accuracy=size,
            growth=float(growth.max()),
            product=None,
            scale=0.0,
            liouville=float(traces.sum()),
            defect=0.0,
            slowest=shooting.slowest(last.fields),
            last=None,
        )


def corrector_of(
    shooting: Shooting, scale: Array, tolerance: float, iterations: int
) -> ShootingCorrector | BlockCorrector:
    """Newton's method that suits the number of unknowns."""
    kind = BlockCorrector if shooting.size >= BLOCKS_FROM else ShootingCorrector
    return kind(shooting, scale, tolerance, iterations)
