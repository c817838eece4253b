"""The slow manifold to second order in the rate, at the rows of an overlay."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fastslow.diagrams.field import FrozenField
from fastslow.errors import ArgumentError, ModelError
from fastslow.passage.overlay.attracting_branches import arcs_of
from fastslow.passage.slow_quantities import SlowQuantity, rates_and_jumps, slow_quantity
from fastslow.results.overlay.freezing import Freezing
from fastslow.results.overlay.overlay import Overlay, require_equilibria

Array = NDArray[np.float64]
Rows = NDArray[np.intp]

#: Offset of central differences of Jacobians, in units of the run: the cube root of rounding.
JACOBIAN_OFFSET = 6e-6

#: Relaxation times before and after a row, within which the largest first-order term counts: at an
#: extremum of the slow quantity it is zero, and the second one as large as the first one had been
#: one relaxation time before.
NEARBY = 40.0

#: Offset in time of differences of the parameter of a path, relative to the length of the run.
PATH_OFFSET = 1e-4


def freezing_of(overlay: Overlay) -> Freezing:
    """Compute the terms of the slow manifold along a run; see `Overlay.freezing`."""
    require_equilibria(overlay, "the band of freezing")
    if overlay.diagram.corrector is None:
        raise ModelError(
            "the diagram of this overlay has no model (it was read from a file); compute it again"
        )
    slow = slow_quantity(overlay.diagram, overlay.run)
    if not slow.dense:
        raise ArgumentError(
            "the band of freezing requires the rate of the slow quantity; simulate with dense=True"
        )
    field: FrozenField = overlay.diagram.corrector.field  # type: ignore[attr-defined]
    count, n = overlay.state.shape
    equilibrium, lag, second = np.full((3, count, n), np.nan)
    inside = np.full(count, np.nan)
    first, change = _drift(slow, overlay.t)
    _, jumps = rates_and_jumps(overlay.t, overlay.slow)
    branches, arcs = arcs_of(overlay.diagram)
    unit = np.append(overlay.extent, max(float(np.ptp(overlay.slow)), np.finfo(float).tiny))
    for arc in arcs:
        for number, (low, high) in zip(arc.stable_branches, arc.ranges.tolist(), strict=True):
            region = field.regions.index(branches[number].region)
            if region >= len(field.model.regions):
                continue
            within = (overlay.slow >= low) & (overlay.slow <= high) & ~jumps
            rows = np.flatnonzero(within & (overlay.followed == number))
            if overlay.band is not None:
                rows = rows[overlay.band[rows] < 0]
            if not len(rows):
                continue
            values = overlay.slow[rows]
            solved, _ = overlay.diagram.corrector.many(
                branches[number].region, arc.state(values), values
            )
            terms = _terms(field, region, np.column_stack([solved, values]), unit)
            speed, bend = first[rows, None], change[rows, None]
            c, along, jacobian, curved = terms
            lag[rows] = c * speed
            pushed = along * speed**2 + c * bend - curved * speed**2
            equilibrium[rows] = solved
            second[rows] = np.linalg.solve(jacobian, pushed[:, :, None])[:, :, 0]
            centre = np.column_stack([solved + lag[rows], values])
            inside[rows] = _inside(field, region, centre, np.abs(second[rows]))
    sizes = np.sqrt((lag / overlay.extent) ** 2 @ np.ones(n))
    reached = _largest_nearby(overlay.t, sizes, NEARBY * overlay.relaxation, overlay.followed)
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = np.sqrt((second / overlay.extent) ** 2 @ np.ones(n)) / reached
    # without a drift both terms are zero
    ratio[(reached == 0.0) & (np.abs(second).max(axis=1) == 0.0)] = 0.0
    return Freezing(
        parameter=overlay.parameter,
        states=overlay.states,
        t=overlay.t,
        slow=overlay.slow,
        followed=overlay.followed,
        state=overlay.state,
        equilibrium=equilibrium,
        lag=lag,
        second=second,
        ratio=ratio,
        inside=inside,
    )


def _drift(slow: SlowQuantity, times: Array) -> tuple[Array, Array]:
    """Return the first and second derivative of the slow quantity at times of a run, (N,) each."""
    run = slow.run
    if slow.laws:
        begin, end = float(run.t[0]), float(run.t[-1])
        step = PATH_OFFSET * (end - begin)
        middle = np.clip(times, begin + step, end - step)
        before, here, after = (slow.at(middle + side * step)[0] for side in (-1, 0, 1))
        change = (after - 2.0 * here + before) / step**2
        return (after - before) / (2.0 * step) + (times - middle) * change, change
    dense = run.dense
    row = np.maximum(np.searchsorted(dense.step_starts, times, side="right") - 1, 0)
    series = dense.series[row, run.columns.index(slow.name)]
    order, offset = np.arange(series.shape[1]), times - dense.steps[row, 0]
    found = []
    for _ in range(2):
        series, order = (series * order)[:, 1:], order[:-1]
        value = series[:, -1].copy()
        for power in series.T[-2::-1]:
            value = value * offset + power
        found.append(value)
    return found[0], found[1]


def _terms(
    field: FrozenField, region: int, points: Array, unit: Array
) -> tuple[Array, Array, Array, Array]:
    """Return what the terms are made of at equilibria: c with x₁ = c w', dc/dw, f_x, ½ f_xx[c, c].

    The derivatives of c follow from those of the Jacobian along the branch, which are central
    differences.
    """
    n = field.n
    _, slopes, _, _ = field.evaluate(region, points)
    jacobian, by_slow = slopes[:, :, :n], slopes[:, :, n]
    moved = -_solve(jacobian, by_slow)
    c = _solve(jacobian, moved)
    tangent = np.column_stack([moved, np.ones(len(points))])

    def change(direction: Array) -> Array:
        """Derivative of [f_x f_w] along directions, shape (N, n, n + 1)."""
        length = np.abs(direction / unit).max(axis=1)
        step = JACOBIAN_OFFSET / np.where(length > 0.0, length, 1.0)
        ahead, back = (
            field.evaluate(region, points + side * step[:, None] * direction)[1] for side in (1, -1)
        )
        return np.asarray((ahead - back) / (2.0 * step)[:, None, None])

    along = change(tangent)
    bent = -_solve(jacobian, _product(along[:, :, :n], moved) + along[:, :, n])
    slope = _solve(jacobian, bent - _product(along[:, :, :n], c))
    fixed = np.column_stack([c, np.zeros(len(points))])
    return c, slope, jacobian, 0.5 * _product(change(fixed)[:, :, :n], c)


def _solve(matrices: Array, vectors: Array) -> Array:
    return np.asarray(np.linalg.solve(matrices, vectors[:, :, None])[:, :, 0])


def _product(matrices: Array, vectors: Array) -> Array:
    return np.asarray((matrices @ vectors[:, :, None])[:, :, 0])


def _inside(field: FrozenField, region: int, centres: Array, widths: Array) -> Array:
    """Return the fraction of half-widths in the region, 0 where the centre is beyond it, (N,)."""
    _, _, h, gradients = field.evaluate(region, centres)
    signs = field.signs[region]
    away = h * signs
    reach = (np.abs(gradients[:, :, : field.n]) * widths[:, None, :]).sum(axis=2)
    with np.errstate(divide="ignore", invalid="ignore"):
        part = np.where(reach > 0.0, away / reach, np.where(away < 0.0, 0.0, np.inf))
    part[:, signs == 0] = np.inf
    return np.clip(part.min(axis=1, initial=1.0), 0.0, 1.0)


def _largest_nearby(times: Array, sizes: Array, within: Array, followed: Rows) -> Array:
    """Return the smaller of the largest sizes within a time before and after each row.

    Among rows that follow the same branch; a side on which the branch is not followed for so long
    counts only if the other one is short too.
    """
    found = np.full(len(times), np.nan)
    for rows in np.split(np.arange(len(times)), np.flatnonzero(np.diff(followed)) + 1):
        rows = rows[np.isfinite(sizes[rows]) & np.isfinite(within[rows])]
        if not len(rows):
            continue
        t, here = times[rows], np.arange(len(rows))
        first = np.searchsorted(t, t - within[rows], side="left")
        last = np.searchsorted(t, t + within[rows], side="right")
        levels = _levels(sizes[rows])
        before, after = _maxima(levels, first, here + 1), _maxima(levels, here, last)
        short, brief = t - within[rows] < t[0], t + within[rows] > t[-1]
        found[rows] = np.select(
            [short & ~brief, brief & ~short], [after, before], np.minimum(before, after)
        )
    return found


def _levels(sizes: Array) -> list[Array]:
    """Return the maxima of 2^k neighbouring sizes, for every k."""
    levels = [sizes]
    while 2 << (len(levels) - 1) <= len(sizes):
        half = 1 << (len(levels) - 1)
        levels.append(np.maximum(levels[-1][:-half], levels[-1][half:]))
    return levels


def _maxima(levels: list[Array], start: Rows, stop: Rows) -> Array:
    """Return the largest size from each start to each stop."""
    found = np.empty(len(start))
    power = np.floor(np.log2(stop - start)).astype(int)
    for k in np.unique(power).tolist():
        on = np.flatnonzero(power == k)
        found[on] = np.maximum(levels[k][start[on]], levels[k][stop[on] - (1 << k)])
    return found
