"""How accurately rounding allows a critical multiplier to be known."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from fastslow.orbits.flow.multipliers import Multipliers
from fastslow.orbits.flow.problem import growth_of
from fastslow.orbits.flow.shooting import Shooting
from fastslow.orbits.points.multiplier_signs import multipliers_at

Array = NDArray[np.float64]

#: Perturbations of the unknowns by rounding that are tried.
ROUNDING_TRIALS = 4


def rounding_of(
    shooting: Shooting, u: Array, scale: Array, number: Callable[[Multipliers], float]
) -> float:
    """Measure the change of a number of the multipliers by rounding.

    The unknowns of a solved orbit are known to rounding, amplified along a segment and at its
    event. They are perturbed by as much, with random signs.

    Parameters
    ----------
    shooting : Shooting
    u, scale : ndarray
        An orbit, and the units of its unknowns.
    number : callable
        Of the multipliers, such as the distance of one of them from the unit circle.

    Returns
    -------
    float
        The largest change; NaN where multipliers are not resolved.
    """
    last, signs = shooting.linearised(u), np.random.default_rng(0)
    segments, _ = shooting.unpack(u)
    growth = float(growth_of(last, segments, scale[: shooting.variations.n]).max())
    found = multipliers_at(shooting, u, last)
    event, _ = found.largest_event(scale[: shooting.variations.n])
    size, known = np.finfo(float).eps * max(1.0, growth) * max(1.0, event), number(found)
    changes = []
    for _ in range(ROUNDING_TRIALS):
        step = size * scale * signs.choice([-1.0, 1.0], len(u))
        moved = u + step
        changes.append(number(multipliers_at(shooting, moved, shooting.linearised(moved))) - known)
    return float(np.abs(changes).max())
