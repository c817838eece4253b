"""Equilibria of models with so many regions that these cannot be solved one by one."""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from fastslow.diagrams.correcting import corrections
from fastslow.diagrams.field import FrozenField
from fastslow.diagrams.solve.equations import RegionEquations, among
from fastslow.symbolic.solving.elimination import is_affine

Array = NDArray[np.float64]

#: Most nonlinear equations, of all regions, sliding and held motions, that are solved one by one:
#: those of 128 motions of ten states.
EQUATIONS_SOLVED = 1280

#: Starting points of Newton's method across all regions, and its iterations.
STARTS_ACROSS, ITERATIONS_ACROSS = 400, 60

#: Decades of the starting points, in natural units.
DECADES_ACROSS = (-1.5, 1.0)

#: Longest step of an iteration, relative to the size of the state.
LONGEST_ACROSS = 3.0

#: Corrections, relative to the size of the state, below which an iteration has converged.
CONVERGED_ACROSS = 1e-9


@lru_cache(maxsize=64)
def solved_one_by_one(field: FrozenField) -> bool:
    """Return whether the equations of every motion are solved.

    Of more than `EQUATIONS_SOLVED` only if all are of regions with affine rates.
    """
    if len(field.modes) * field.n <= EQUATIONS_SOLVED:
        return True
    if any(mode.sides is not None or mode.held for mode in field.modes):
        return False
    every = (RegionEquations(field, k).equations for k in range(len(field.modes)))
    return all(is_affine(equations) for equations in every)


def unexamined(field: FrozenField) -> list[str]:
    """Return a sentence on the motions that are not examined one by one, if there are any."""
    if solved_one_by_one(field):
        return []
    slides = sum(mode.sides is not None or bool(mode.held) for mode in field.modes)
    others = f"; those of {slides} sliding and held motions are not computed" if slides else ""
    return [
        f"{len(field.modes) - slides} regions are too many to solve the equations of each: "
        f"equilibria were searched for across all of them, by Newton's method from {STARTS_ACROSS} "
        f"starting points{others}"
    ]


def found_across(
    field: FrozenField, value: float, bounds: Mapping[str, float] | None
) -> list[tuple[int, Array]]:
    """Search for equilibria in all regions at once at a value of the parameter.

    Each iteration of Newton's method uses the rates of the region in which the point is. Half of
    the iterations take half of each step, since full ones may alternate between two regions.

    Returns
    -------
    list of (int, ndarray of shape (n,))
        Numbers of regions, and states in their closures within the bounds.
    """
    n, count = field.n, len(field.interfaces)
    natural = field.units_at(abs(value))[:n]
    most = np.array([(bounds or {}).get(name, np.inf) for name in field.model.states])
    numbers = [k for k, one in enumerate(field.modes) if one.sides is None and not one.held]
    patterns = field.signs[numbers][:, :count] > 0
    regions_of = {row.tobytes(): k for row, k in zip(patterns, numbers, strict=True)}

    def regions_at(points: Array) -> NDArray[np.int64]:
        """Return the region of every point, −1 for signs that no region has."""
        heights = field.evaluate(numbers[0], points)[2][:, :count]
        return np.array([regions_of.get(row.tobytes(), -1) for row in heights > 0], dtype=np.int64)

    generator = np.random.default_rng(20231)
    sizes = 10.0 ** generator.uniform(*DECADES_ACROSS, (STARTS_ACROSS, n))
    side = generator.choice([-1.0, 1.0], (STARTS_ACROSS, n))
    points = np.column_stack([natural * sizes * side, np.full(STARTS_ACROSS, value)])
    points[0, :n] = 0.0
    part = np.where(np.arange(STARTS_ACROSS) % 2, 0.5, 1.0)
    done = np.zeros(STARTS_ACROSS, dtype=bool)
    for _ in range(ITERATIONS_ACROSS):
        left = np.flatnonzero(~done & np.isfinite(points).all(axis=1))
        if not len(left):
            break
        regions = regions_at(points[left])
        points[left[regions < 0]] = np.nan
        left, regions = left[regions >= 0], regions[regions >= 0]
        rates, slopes = field.evaluate_each(regions, points[left])
        step = _steps(slopes[:, :, :n], rates)
        size = np.maximum(natural, np.abs(points[left, :n]))
        long = (np.abs(step) / size).max(axis=1, initial=0.0)
        done[left] = long <= CONVERGED_ACROSS
        factor = part[left] * np.minimum(1.0, LONGEST_ACROSS / np.maximum(long, LONGEST_ACROSS))
        points[left, :n] -= np.where(done[left], 1.0, factor)[:, None] * step
    found: list[tuple[int, Array]] = []
    distinct = np.empty((0, n))
    converged = points[done & np.isfinite(points).all(axis=1)]
    for point, region in zip(converged, regions_at(converged), strict=True):
        if region < 0 or among(point[:n], distinct, natural, field.periods, 1e-5):
            continue
        state = corrections(field)[region].corrected(point[:n], value)
        if state is None or np.any(np.abs(state) > most):
            continue
        distinct = np.vstack([distinct, state])
        found.append((int(region), state))
    return found


def _steps(slopes: Array, rates: Array) -> Array:
    """Return the steps of Newton's method, NaN where the matrix is singular."""
    with np.errstate(all="ignore"):
        every = np.concatenate([slopes, rates[..., None]], axis=2)
        finite: NDArray[np.bool_] = np.asarray(np.isfinite(every).all(axis=(1, 2)))
        regular = np.linalg.det(np.where(finite[:, None, None], slopes, 0.0)) != 0
    sound = np.flatnonzero(finite & regular)
    steps = np.full(rates.shape, np.nan)
    steps[sound] = np.linalg.solve(slopes[sound], rates[sound][..., None])[..., 0]
    return steps
