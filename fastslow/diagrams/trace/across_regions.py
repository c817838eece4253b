"""Continuation of a curve of equilibria across regions."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fastslow.continuation import loops, spaces
from fastslow.continuation.endings import (
    CLOSED_LOOP,
    END_OF_RANGE,
    SINGULAR_CURVE,
    STEP_TOO_SMALL,
    TOO_MANY_POINTS,
)
from fastslow.continuation.location import Located, branch_point
from fastslow.continuation.settings import Continuation
from fastslow.diagrams.endings import (
    DISCONTINUOUS_SLIDING,
    EDGE_OF_DOMAIN,
    INTERFACES_MEET,
    NO_REGION_BEYOND,
    NO_SLIDING,
    NOT_HELD,
    RESET,
    SINGULAR_AT_INTERFACE,
    SWITCH,
    TOO_MANY_FOLDS,
    TWO_FOLD,
)
from fastslow.diagrams.field import FrozenField
from fastslow.diagrams.points.boundary_equilibria import BOUNDARY_EQUILIBRIA
from fastslow.diagrams.segments import ALONG_EDGE, BranchSegment, Window
from fastslow.diagrams.two_folds import cut_at_two_fold, two_fold_ahead
from fastslow.results.angles import apart, nearest_copy
from fastslow.results.base.outcome import Outcome
from fastslow.results.branch.windows import ON_EDGE, left_window
from fastslow.results.stored.switch_state_names import CHANGES

Array = NDArray[np.float64]

#: Distances from the end of the range, as fractions of it, at which an end point is searched for.
INSETS = (0.0, 1e-9, 1e-6, 1e-3)

#: Rows nearer than this, in units of the scale, are the same.
SAME_ROW = 1e-13

#: Repetition of a failed last step: factor of the step length, number of repetitions, and number
#: of rows with short steps.
FINER, FINEST, CHUNK = 16.0, 3, 64

#: Least component across an edge of the window, in its unit, of a chord that leaves it.
ACROSS = 1e-3

#: Largest distance, in steps, of a branch point on an edge from the point found there.
EDGE_POINT_DISTANCE = 0.1

#: Folds in one region, at most: along waves without end, as of sin(x)/x, rows do not increase.
MOST_FOLDS = 200

#: Pieces (regions in order) of a branch, at most.
SEGMENTS = 1000


@dataclass(frozen=True, eq=False)
class DirectedTrace:
    """A curve traced in one direction: segments, interfaces between them, and its outcome.

    ``last`` is the interface on which the curve ends, if it does.
    """

    segments: tuple[BranchSegment, ...]
    joins: tuple[int, ...]
    outcome: Outcome
    last: int | None = None
    closed: bool = False


def trace_across_regions(
    field: FrozenField,
    region: int,
    start: Array,
    tangent: Array,
    window: Window,
    continuation: Continuation,
    *,
    bounded: bool = True,
) -> DirectedTrace:
    """Trace a curve of equilibria in one direction, across interfaces.

    Parameters
    ----------
    region : int
        Region whose rates vanish at the starting point.
    start, tangent : ndarray, shape (n + 1,)
        A point on the curve and the direction.
    bounded : bool
        Whether interfaces bound the regions; False traces virtual equilibria.
    """
    segments: list[BranchSegment] = []
    joins: list[int] = []
    first = BranchSegment(region, start[None], tangent[None])
    periods = field.periods
    step = continuation.step
    while len(segments) < SEGMENTS:
        signs = field.signs[region] if bounded else np.zeros(field.compiled.m)
        u, tangents, status, step, again = _traced(
            field, region, start, tangent, signs, window, continuation, step, closing=not joins
        )
        joined = bool(joins) or again
        back = _returned(region, u, tangents, first, window, periods) if joined else None
        if back is not None:
            segments.append(back)
            return DirectedTrace(tuple(segments), tuple(joins), _closed(), closed=True)
        crossing = None
        if status in (spaces.INTERFACE, spaces.SMALL_STEP):
            end = two_fold_ahead(field, region, u, window.scale)
            inside = end is not None and window.lower <= end[-1] <= window.upper
            if end is not None and inside and window.contains(end):
                ended = cut_at_two_fold(u, tangents, end, window.scale)
                segments.append(BranchSegment(region, *ended))
                return DirectedTrace(tuple(segments), tuple(joins), _two_fold(field, region, end))
        if status == spaces.INTERFACE:
            crossing = BOUNDARY_EQUILIBRIA.first_met(field, region, u, tangents, window)
            if crossing is None:
                status = spaces.SMALL_STEP
                u, tangents = u[:-1], tangents[:-1]
            elif not window.contains(crossing[1]):
                status = spaces.WINDOW
            elif not window.lower <= crossing[1][-1] <= window.upper:
                status = spaces.RANGE
        if status in (spaces.RANGE, spaces.WINDOW):
            u, tangents, status = _cut(field, region, u, tangents, window, status)
        if status != spaces.INTERFACE or crossing is None:
            segments.append(BranchSegment(region, u, tangents))
            closed = status == spaces.CLOSED
            if closed:
                u[-1] = nearest_copy(first.u[0], u[-1], np.append(periods, 0.0))
                tangents[-1] = first.tangents[0]
            outcome = _outcome(status, field, u[-1], window, continuation)
            return DirectedTrace(tuple(segments), tuple(joins), outcome, closed=closed)
        row, corner = crossing
        interface = field.surface_of(region, row)
        end, single = field.tangent(region, corner, window.weight)
        if not single:
            # at a branch point, that of the curve
            chord = corner - u[-2]
            end = chord / np.sqrt(chord @ (chord * window.weight))
        u[-1], tangents[-1] = corner, _oriented(end, tangents[-1], window)
        if len(u) > 2 and np.abs((corner - u[-2]) / window.scale).max() < SAME_ROW:
            # the last step ended on the interface by accident
            u, tangents = np.delete(u, -2, axis=0), np.delete(tangents, -2, axis=0)
        segments.append(BranchSegment(region, u, tangents))
        beyond, outcome = _region_beyond(field, region, row, corner, window)
        if beyond is None:
            # a branch of pseudo-equilibria ends at a two-fold, which is not a boundary
            inner = outcome.code == TWO_FOLD.code and field.modes[region].sides is not None
            last = None if inner else interface
            return DirectedTrace(tuple(segments), tuple(joins), outcome, last=last)
        if window.leads_out(corner, beyond[1]):
            return DirectedTrace(
                tuple(segments), tuple(joins), _left(field, corner, window), last=interface
            )
        joins.append(interface)
        region, tangent = beyond
        start = corner
        moved = apart(start, first.u[0], np.append(periods, 0.0))
        away = np.abs(moved / window.scale).max()
        home = region == first.region and away < 1e-9
        if home:
            return DirectedTrace(tuple(segments), tuple(joins), _closed(), closed=True)
    return DirectedTrace(tuple(segments), tuple(joins), _full(field, start, continuation))


def _traced(
    field: FrozenField,
    region: int,
    start: Array,
    tangent: Array,
    signs: Array,
    window: Window,
    continuation: Continuation,
    step: float,
    *,
    closing: bool,
) -> tuple[Array, Array, int, float, bool]:
    """Trace rows in one region; return them, tangents, status, step, and whether it was divided.

    If the last step left the range and no equilibrium is found at the end of the range, the
    step may have missed a fold: it is repeated with shorter steps.
    """
    low, high = np.array(window.states.lower), np.array(window.states.upper)
    rows: list[Array] = []
    tangents: list[Array] = []
    finer = 0
    while True:
        largest = continuation.max_step / FINER**finer
        left = continuation.max_points - sum(map(len, rows))
        count = min(left, CHUNK) if finer else left
        u, along = np.empty((count, len(start))), np.empty((count, len(start)))
        u[0], along[0] = start, tangent
        in_use = np.array([max(step, 10 * continuation.min_step)])
        progress = np.array([1, 0])
        status = spaces.PAUSED
        space = spaces.trace_space(len(start) - 1, len(signs))
        curve = spaces.CompiledCurve(field.compiled.address, region, field.values)
        limits = spaces.CurveDomain(
            signs, window.weight, window.lower, window.upper, low, high,
            window.states.middle(), field.periods,
        )  # fmt: skip
        stepping = spaces.Stepping(
            continuation.min_step, largest, continuation.max_turn,
            continuation.tolerance, continuation.max_iterations, closing and not rows,
        )  # fmt: skip
        traced = spaces.Traced(u, along, in_use, progress)
        while status == spaces.PAUSED:
            progress[1] = max(1, loops.WORK // (8 * len(start) ** 3 + 16 * field.compiled.size))
            status = loops.loop("trace")(curve, limits, stepping, traced, space)
        u, along, step = u[: progress[0]], along[: progress[0]], float(in_use[0])
        missed = False
        if status == spaces.RANGE:
            end, _, ended = _cut(field, region, u.copy(), along.copy(), window, status)
            missed = ended == spaces.RANGE and not _at_end(end[-1], window)
        if missed and finer < FINEST and len(u) > 1:
            finer += 1
            step = continuation.max_step / FINER**finer
            kept = len(u) - 2
        elif status == spaces.FULL and finer and len(u) < left:
            finer, kept = 0, len(u) - 1
        else:
            break
        rows.append(u[:kept])
        tangents.append(along[:kept])
        start, tangent = u[kept], along[kept]
    u, along = np.concatenate([*rows, u]), np.concatenate([*tangents, along])
    folds = np.flatnonzero(along[1:, -1] * along[:-1, -1] < 0)
    if len(folds) > MOST_FOLDS:
        status, left = spaces.MANY_FOLDS, int(folds[MOST_FOLDS]) + 1
        u, along = u[:left], along[:left]
    return u, along, status, step, bool(rows)


def _at_end(u: Array, window: Window) -> bool:
    """Return whether a row is at an end of the range, to which its parameter was set."""
    return bool(u[-1] in (window.lower, window.upper))


def _returned(
    region: int, u: Array, tangents: Array, first: BranchSegment, window: Window, periods: Array
) -> BranchSegment | None:
    """Return the rows up to the start of a curve that has returned to its first region."""
    if region != first.region:
        return None
    start, direction = first.u[0], first.tangents[0]
    chords = np.linalg.norm(np.diff(u, axis=0) / window.scale, axis=1)
    gaps = apart(start, u[:-1], np.append(periods, 0.0)) / window.scale
    along = tangents[:-1] / window.scale
    ahead = (gaps * along).sum(axis=1)
    aside = np.linalg.norm(gaps - ahead[:, None] * along, axis=1)
    alike = along @ (direction / window.scale) > 0.9
    passed = np.flatnonzero((ahead > 0) & (ahead <= chords) & (aside < 0.2 * chords) & alike)
    if not passed.size:
        return None
    stop = int(passed[0]) + 1
    start = nearest_copy(start, u[stop - 1], np.append(periods, 0.0))
    return BranchSegment(
        region, np.vstack([u[:stop], start]), np.vstack([tangents[:stop], direction])
    )


def _region_beyond(
    field: FrozenField, region: int, row: int, corner: Array, window: Window
) -> tuple[tuple[int, Array] | None, Outcome]:
    """Return the region (or sliding or held motion) beyond a row, with the tangent."""
    sides = field.modes[region].sides
    if sides is None or row < len(field.interfaces):
        return _region_across(field, region, row, corner, window)
    _, _, h, slopes = field.evaluate(region, corner)
    size = np.abs(slopes) @ window.size(corner)
    if np.all(np.abs(h[-2:]) <= 1e-9 * size[-2:]):
        return None, _two_fold(field, region, corner)
    # the first drift is that of the region above, whose equilibrium this is
    beyond = sides.above if row == len(h) - 2 else sides.below
    return _tangent_into(field, beyond, sides.interface, sides.interface, corner, window)


def _region_across(
    field: FrozenField, region: int, row: int, corner: Array, window: Window
) -> tuple[tuple[int, Array] | None, Outcome]:
    """Return the region beyond an interface, or sliding along a discontinuity, with the tangent.

    Beyond a wall is the motion held against it, and beyond zero contact force the free one.
    """
    interface = field.surface_of(region, row)
    name, where = field.surface(interface), _where(field, corner)
    _, _, h, gradients = field.evaluate(region, corner)
    size = np.abs(gradients * window.scale).max(axis=1)
    near = (np.abs(h) <= 1e-9 * size) & (field.signs[region] != 0)
    if field.modes[region].sides is not None:
        # drifts
        near[-2:] = False
    interfaces = {interface, *(field.surface_of(region, int(k)) for k in np.flatnonzero(near))}
    if not interfaces <= set(field.coinciding[interface]):
        meeting = [field.interfaces[k] for k in sorted(interfaces)]
        return None, INTERFACES_MEET.at(interfaces=" and ".join(meeting), where=where)
    beyond = field.neighbour(region, interface)
    if beyond is None and field.is_wall(interface):
        return None, _at_reset(field, interface, where)
    if beyond is None:
        return None, NO_REGION_BEYOND.at(interface=name, where=where)
    rates, slopes = field.residual_and_jacobian(beyond, corner)
    size = 1e-8 * (np.abs(slopes) @ window.size(corner))
    if np.all(np.abs(rates) <= size):
        bound = field.bound_at(beyond, interface)
        return _tangent_into(field, beyond, bound, interface, corner, window)
    if field.modes[region].sides is not None:
        return None, DISCONTINUOUS_SLIDING.at(interface=name, where=where)
    along = field.slides_into(region, beyond, corner, window.scale)
    if along is None:
        return None, NO_SLIDING.at(interface=name, where=where)
    # the branch leaves the bound at which the drift of this region's field vanishes
    sides = field.modes[along].sides
    drift = -2 if sides is not None and sides.above == region else -1
    return _tangent_into(field, along, len(h) + drift, interface, corner, window)


def _tangent_into(
    field: FrozenField, beyond: int, row: int, interface: int, corner: Array, window: Window
) -> tuple[tuple[int, Array] | None, Outcome]:
    """Return a region and the tangent along which one of its bounds increases."""
    tangent, single = field.tangent(beyond, corner, window.weight)
    _, _, _, gradients = field.evaluate(beyond, corner)
    size = float(np.abs(gradients[row] * window.scale).max())
    ahead = field.signs[beyond, row] * float(gradients[row] @ tangent)
    if not single or abs(ahead) < 1e-9 * size:
        return None, SINGULAR_AT_INTERFACE.at(
            region=field.regions[beyond],
            interface=field.surface(interface),
            where=_where(field, corner),
        )
    return (beyond, tangent if ahead > 0 else -tangent), _closed()


def _cut(
    field: FrozenField, region: int, u: Array, tangents: Array, window: Window, status: int
) -> tuple[Array, Array, int]:
    """Replace the last row, outside the range or the window, by the first point on an edge."""
    if not window.contains(u[-1]):
        edge = _on_window(field, region, u, tangents, window)
        if edge is None and status == spaces.WINDOW:
            return u[:-1], tangents[:-1], spaces.WINDOW
        if edge is not None and window.lower <= edge[-1] <= window.upper:
            if np.abs((edge - u[-2]) / window.scale).max() < SAME_ROW:
                return u[:-1], tangents[:-1], spaces.WINDOW
            tangent, chord = field.tangent(region, edge, window.weight)[0], edge - u[-2]
            chord /= np.sqrt(chord @ (chord * window.weight))
            reached = window.at_bounds(edge) & (np.abs(chord[:-1]) > ACROSS * window.scale[:-1])
            if np.any(np.abs(tangent[:-1]) <= ALONG_EDGE * window.scale[:-1], where=reached):
                # at a branch point, that of the curve within the edge
                tangent = chord
            u[-1], tangents[-1] = edge, _oriented(tangent, chord, window)
            return u, tangents, spaces.WINDOW
    u, tangents = _cut_at_range(field, region, u, tangents, window)
    return u, tangents, spaces.RANGE


def _on_window(
    field: FrozenField, region: int, u: Array, tangents: Array, window: Window
) -> Array | None:
    """Return the point at which the last step leaves the window of the states."""
    before, after = u[-2], u[-1]
    length = float(np.linalg.norm((after - before) / window.scale))
    best: tuple[float, Array] | None = None
    for k in range(field.n):
        for bound, side in ((window.states.lower[k], -1.0), (window.states.upper[k], 1.0)):
            if not side * (after[k] - bound) > 0:
                continue
            part = float(np.clip((bound - before[k]) / (after[k] - before[k]), 0.0, 1.0))
            normal = np.zeros(len(after))
            normal[k] = 1.0
            guess = before + part * (after - before)
            found = field.refined(region, guess, window.scale, normal=normal, point=bound * normal)
            ahead = float(((found.u - before) * window.weight) @ tangents[-2])
            if found.converged and -1e-6 <= ahead <= 1.5 * length:
                crossed = _branch_point_on_edge(field, region, k, bound, found.u, window)
                if (
                    crossed is not None
                    and window.distance(crossed.u, found.u) < EDGE_POINT_DISTANCE * length
                ):
                    found = crossed
                found.u[k] = bound
                if window.contains(found.u) and (best is None or ahead < best[0]):
                    best = ahead, found.u
    return None if best is None else best[1]


def _branch_point_on_edge(
    field: FrozenField, region: int, k: int, bound: float, u: Array, window: Window
) -> Located | None:
    """Return the branch point near a point of another curve, which is within an edge.

    If an edge is invariant, as that of a species which is absent, a branch leaves the window where
    it meets the equilibria within the edge, all of which solve F = 0 on the edge.
    """
    tangent, single = field.tangent(region, u, window.weight)
    if single and abs(tangent[k]) > ALONG_EDGE * window.scale[k]:
        return None
    found = branch_point(lambda z: field.residual_and_jacobian(region, z), u, window.scale)
    on_edge = abs(found.u[k] - bound) <= ON_EDGE * window.scale[k]
    return found if found.converged and found.extra[0] == 0 and on_edge else None


def _cut_at_range(
    field: FrozenField, region: int, u: Array, tangents: Array, window: Window
) -> tuple[Array, Array]:
    """Replace the last row, outside the range, by the point at its end.

    If the rates are not defined there, by the nearest point found inside.
    """
    beyond, before = u[-1], u[-2]
    below = beyond[-1] < window.lower
    bound = window.lower if below else window.upper
    along = np.zeros(u.shape[1])
    along[-1] = 1.0
    for short in INSETS:
        target = bound + (short if below else -short) * (window.upper - window.lower)
        if not min(before[-1], beyond[-1]) <= target <= max(before[-1], beyond[-1]):
            break
        part = (target - before[-1]) / (beyond[-1] - before[-1]) if beyond[-1] != before[-1] else 0
        guess = before + part * (beyond - before)
        found = field.refined(region, guess, window.scale, normal=along, point=target * along)
        if found.converged and np.all(np.isfinite(found.u)):
            end = found.u
            end[-1] = target
            if np.abs((end - before) / window.scale).max() < SAME_ROW:
                u[-2, -1] = target
                break
            tangent = field.tangent(region, end, window.weight)[0]
            u[-1], tangents[-1] = end, _oriented(tangent, tangents[-1], window)
            return u, tangents
    return u[:-1], tangents[:-1]


def _oriented(tangent: Array, along: Array, window: Window) -> Array:
    return tangent if (tangent * window.weight) @ along >= 0 else -tangent


def _where(field: FrozenField, u: Array) -> str:
    names = (*field.model.states, field.parameter)
    return "(" + ", ".join(f"{n} = {v:.6g}" for n, v in zip(names, u, strict=True)) + ")"


def _two_fold(field: FrozenField, region: int, u: Array) -> Outcome:
    sides = field.modes[region].sides
    name = field.interfaces[sides.interface] if sides is not None else ""
    return TWO_FOLD.at(interface=name, where=_where(field, u), region=field.regions[region])


def _at_reset(field: FrozenField, wall: int, where: str) -> Outcome:
    """Return the outcome of a branch at a wall against which no motion is held."""
    if any(wall in mode.held for mode in field.modes):
        ending = NOT_HELD
    else:
        ending = SWITCH if CHANGES in field.interfaces[wall] else RESET
    return ending.at(interface=field.interfaces[wall], where=where)


def _closed() -> Outcome:
    return CLOSED_LOOP.at(curve="branch")


def _full(field: FrozenField, u: Array, continuation: Continuation) -> Outcome:
    return TOO_MANY_POINTS.at(curve="branch", count=continuation.max_points, where=_where(field, u))


def _left(field: FrozenField, u: Array, window: Window) -> Outcome:
    """Return the outcome of a branch that ends on an edge of the window."""
    where = f"{field.parameter} = {u[-1]:.6g}"
    return left_window(window.states, u[:-1], window.scale[:-1], where)


def _outcome(
    status: int,
    field: FrozenField,
    u: Array,
    window: Window,
    continuation: Continuation,
) -> Outcome:
    where = _where(field, u)
    if status == spaces.RANGE and not _at_end(u, window):
        return EDGE_OF_DOMAIN.at(where=where)
    if status == spaces.RANGE:
        return END_OF_RANGE.at(where=f"{field.parameter} = {u[-1]:g}")
    if status == spaces.CLOSED:
        return _closed()
    if status == spaces.WINDOW:
        return _left(field, u, window)
    if status == spaces.FULL:
        return _full(field, u, continuation)
    if status == spaces.MANY_FOLDS:
        return TOO_MANY_FOLDS.at(count=MOST_FOLDS, where=where)
    return STEP_TOO_SMALL.at(where=where, step=continuation.min_step, why=SINGULAR_CURVE)
