"""Assembly of traced segments into a Branch with its special points."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fastslow.continuation.marks import Mark
from fastslow.diagrams.endings import TWO_FOLD
from fastslow.diagrams.field import FrozenField, Source
from fastslow.diagrams.points.boundary_equilibria import BOUNDARY_EQUILIBRIA
from fastslow.diagrams.points.on_branches import Detected
from fastslow.diagrams.points.two_fold_points import TWO_FOLDS
from fastslow.diagrams.segments import BranchSegment, Window
from fastslow.diagrams.trace.across_regions import DirectedTrace
from fastslow.diagrams.trace.detection import special_points
from fastslow.diagrams.two_folds import two_fold_residual
from fastslow.formulas.definitions import definitions_of
from fastslow.results.angles import principal
from fastslow.results.base.immutable import read_only
from fastslow.results.base.outcome import Outcome
from fastslow.results.branch.branch import Branch
from fastslow.results.point_types import END_POINT, NON_SMOOTH_FOLD
from fastslow.results.points import NEUTRAL_REAL_PART, ClarkePath, SpecialPoint, SpecialPoints
from fastslow.results.stored.model import StoredModel

Array = NDArray[np.float64]

#: A determinant below this multiple of the product of its row norms is zero to rounding.
ZERO_DETERMINANT = 1e-10

#: Kind of a boundary equilibrium by the product of the signs of both determinants.
KINDS = {1: "persistence", 0: "degenerate", -1: NON_SMOOTH_FOLD}


@dataclass(frozen=True, eq=False)
class EquilibriumCurve:
    """Both directions of a branch: its segments, the interfaces between, and both ends."""

    segments: tuple[BranchSegment, ...]
    joins: tuple[int, ...]
    outcomes: tuple[Outcome, Outcome]
    ends: tuple[int | None, int | None]
    closed: bool


def join_directions(backward: DirectedTrace | None, forward: DirectedTrace) -> EquilibriumCurve:
    """Join the traces in both directions from a starting point."""
    if backward is None:
        return EquilibriumCurve(
            forward.segments, forward.joins, (forward.outcome, forward.outcome), (None, None), True
        )
    left = [p.reversed() for p in reversed(backward.segments)]
    first, second = left[-1], forward.segments[0]
    middle = BranchSegment(
        second.region,
        np.concatenate([first.u, second.u[1:]]),
        np.concatenate([first.tangents[:-1], second.tangents]),
    )
    return EquilibriumCurve(
        (*left[:-1], middle, *forward.segments[1:]),
        (*reversed(backward.joins), *forward.joins),
        (backward.outcome, forward.outcome),
        (backward.last, forward.last),
        False,
    )


def oriented_upwards(curve: EquilibriumCurve) -> EquilibriumCurve:
    """Orient a curve such that the parameter at its end is not below that at its start."""
    if curve.closed or curve.segments[0].u[0, -1] <= curve.segments[-1].u[-1, -1]:
        return curve
    return EquilibriumCurve(
        tuple(p.reversed() for p in reversed(curve.segments)),
        tuple(reversed(curve.joins)),
        (curve.outcomes[1], curve.outcomes[0]),
        (curve.ends[1], curve.ends[0]),
        False,
    )


def branch_of(
    field: FrozenField,
    curve: EquilibriumCurve,
    window: Window,
    marks: Sequence[Mark],
    admissible: bool,
) -> Branch:
    """Return the branch of a curve, with special points computed and inserted as rows."""
    special: list[SpecialPoint] = []
    at_row: list[int] = []
    tables: list[tuple[Array, Array, NDArray[np.complex128], int]] = []
    rows = 0
    for number, raw in enumerate(curve.segments):
        found, segment, finite = special_points(
            field, raw, window, marks, opening=number == 0 and not curve.closed
        )
        u, tangents = segment.u, segment.tangents
        eigenvalues = field.with_infinite(segment.region, finite)
        if found:
            largest = np.abs(finite).max(axis=-1, initial=0.0)
            points = [_point(field, segment, d, window, float(largest[d.row])) for d in found]
            new = [(d.row + 1, p) for d, p in zip(found, points, strict=True) if not d.at_row]
            places = [place for place, _ in new]
            between = [d.located.u for d in found if not d.at_row]
            if new:
                u = np.insert(u, places, between, axis=0)
                tangents = np.insert(tangents, places, [p.tangent for _, p in new], axis=0)
                eigenvalues = np.insert(
                    eigenvalues, places, [p.eigenvalues for _, p in new], axis=0
                )
            special += points
            before = 0
            for detected in found:
                at_row.append(rows + detected.row + before + (not detected.at_row))
                before += not detected.at_row
        tables.append((u, tangents, eigenvalues, segment.region))
        rows += len(u)
        if number < len(curve.joins):
            special.append(boundary_equilibrium(field, curve, number))
            at_row.append(rows - 1)
    u = _centred(field, np.concatenate([t[0] for t in tables]), window)
    # not shared: a read-only array is not copied
    tangents = read_only(np.concatenate([t[1] for t in tables]))
    eigenvalues = read_only(np.concatenate([t[2] for t in tables]))
    names = np.array(field.regions)[[t[3] for t in tables]]
    region = np.repeat(names, [len(t[0]) for t in tables])
    if not curve.closed:
        special, at_row = _with_ends(field, curve, special, at_row, rows)
    size = _sizes(u[:, :-1], window.scale[:-1])
    # two-parameter continuation needs equations
    stored = isinstance(field.model, StoredModel)
    source = None if stored else Source(field.model, size, window.states)
    return Branch(
        states=field.model.states,
        parameter=field.parameter,
        state=u[:, :-1],
        values=u[:, -1],
        tangent=tangents,
        eigenvalues=eigenvalues,
        region=region,
        special=SpecialPoints(replace(p, source=source, admissible=admissible) for p in special),
        special_rows=tuple(at_row),
        outcomes=curve.outcomes,
        closed=curve.closed,
        admissible=admissible,
        parameters=dict(field.model.parameters),
        periods=dict(field.model.periodic),
        definitions=definitions_of(field.model),
    )


def _sizes(states: Array, scale: Array) -> Array:
    """Return the typical size of each state on a branch; its unit if it is mostly zero."""
    typical = np.median(np.abs(states), axis=0)
    return np.where(typical > 1e-12 * scale, typical, scale)


def _centred(field: FrozenField, u: Array, window: Window) -> Array:
    """Shift rows by whole periods so that angles without a window are near zero."""
    if not field.periods.any():
        return u
    low, high = u[:, :-1].min(axis=0), u[:, :-1].max(axis=0)
    middle = window.states.shifted(principal(0.5 * (low + high), field.periods))
    turns = field.periods > 0
    u[:, :-1][:, turns] += (middle - 0.5 * (low + high))[turns]
    return u


def special_point(
    field: FrozenField, code: str, region: int, u: Array, tangent: Array, **more: object
) -> SpecialPoint:
    """Return a special point of a region.

    Parameters
    ----------
    u, tangent : ndarray, shape (n + 1,)
        States and parameter, and the tangent of the branch there.
    **more
        Other entries of `SpecialPoint`.
    """
    rates, _ = field.residual_and_jacobian(region, u)
    entries: dict[str, object] = {
        "label": code,
        "regions": (field.regions[region],),
        "residual": float(np.abs(rates).max()),
        "converged": True,
        "eigenvalues": field.eigenvalues(region, u),
        **more,
    }
    return SpecialPoint(
        code=code,
        states=field.model.states,
        state=field.wrapped(u[:-1]),
        parameters={**field.model.parameters, field.parameter: float(u[-1])},
        tangent=tangent.copy(),
        **entries,  # type: ignore[arg-type]
    )


def _point(
    field: FrozenField,
    segment: BranchSegment,
    detected: Detected,
    window: Window,
    largest_before: float,
) -> SpecialPoint:
    """Return a special point; ``largest_before`` is the largest eigenvalue at the row before."""
    located = detected.located
    tangent, single = field.tangent(segment.region, located.u, window.weight)
    before = segment.tangents[detected.row]
    if not single:
        tangent = before
    elif (tangent * window.weight) @ before < 0:
        tangent = -tangent
    eigenvalues = field.eigenvalues(segment.region, located.u)
    finite = np.isfinite(eigenvalues)
    if np.all(np.abs(eigenvalues[finite]) <= NEUTRAL_REAL_PART * largest_before):
        # rounding errors only, as for a single eigenvalue at a fold: its sign is undetermined
        eigenvalues = np.where(finite, 0.0, eigenvalues)
    return special_point(
        field,
        detected.kind.code,
        segment.region,
        located.u,
        tangent,
        eigenvalues=eigenvalues,
        residual=located.residual,
        converged=located.converged,
        accuracy=located.correction,
        type=detected.type,
        note=detected.note,
        **detected.form,
    )


def boundary_equilibrium(field: FrozenField, curve: EquilibriumCurve, number: int) -> SpecialPoint:
    """Return the boundary equilibrium between segment ``number`` of a curve and the next one."""
    # a closed branch may start on an interface
    before, after = curve.segments[number], curve.segments[(number + 1) % len(curve.segments)]
    u, interface = before.u[-1], curve.joins[number]
    names = (field.regions[before.region], field.regions[after.region])
    sliding = [field.modes[p.region].sides is not None for p in (before, after)]
    active = after.region if sliding[0] and not sliding[1] else before.region
    if sliding[0] != sliding[1]:
        type_, clarke = _filippov(field, active, interface, u), None
    else:
        type_, clarke = _by_determinants(field, before.region, after.region, interface, u)
    rates, _, h, _ = field.evaluate(active, u)
    return special_point(
        field,
        BOUNDARY_EQUILIBRIA.code,
        before.region,
        u,
        before.tangents[-1],
        regions=names,
        residual=float(max(np.abs(rates).max(), abs(h[interface]))),
        interface=field.interfaces[interface],
        type=type_,
        clarke=clarke,
    )


def _by_determinants(
    field: FrozenField, region: int, beyond: int, interface: int, u: Array
) -> tuple[str, ClarkePath | None]:
    """Classify a boundary equilibrium of two regions by the determinants of their Jacobians.

    Their product is positive at a persistence, negative at a non-smooth fold (Leine & Nijmeijer
    2004, chapter 8). The Clarke path exists between two regions with rates that are continuous at
    the interface. As in closed forms, q = 1 is the region where the interface function is
    positive, and the nonsingular one if the other is singular.
    """
    modes = (region, beyond)
    jacobians = np.array([field.residual_and_jacobian(k, u)[1][:, : field.n] for k in modes])
    first, second = (_determinant_sign(j) for j in jacobians)
    smooth = field.modes[region].sides is None and not field.is_wall(interface)
    if not smooth:
        return KINDS[first * second], None
    names = (field.regions[region], field.regions[beyond])
    backwards = field.signs[region, interface] < 0 if (first == 0) == (second == 0) else first == 0
    if backwards:
        names, jacobians = (names[1], names[0]), jacobians[::-1]
    return KINDS[first * second], ClarkePath(names, jacobians)


def _determinant_sign(matrix: Array) -> int:
    """Return the sign of a determinant, 0 if it vanishes to rounding."""
    size = float(np.prod(np.maximum(np.linalg.norm(matrix, axis=1), 1e-300)))
    value = float(np.linalg.det(matrix))
    return 0 if abs(value) <= ZERO_DETERMINANT * size else int(np.sign(value))


def _filippov(field: FrozenField, region: int, interface: int, u: Array) -> str | None:
    """Classify a boundary equilibrium at a discontinuity: persistence or non-smooth fold.

    With N the Jacobian of the region whose equilibrium it is, E the jump of the rates and C
    the gradient of h towards that region, C·N⁻¹E < 0 is persistence and C·N⁻¹E > 0 a
    non-smooth fold (di Bernardo et al. 2008, chapter 5). None for a sliding motion, whose
    branch ends there.
    """
    if field.modes[region].sides is not None or field.is_wall(interface):
        return None
    beyond = field.neighbour(region, interface)
    if beyond is None:
        return "degenerate"
    active, slopes, _, gradients = field.evaluate(region, u)
    other, _ = field.residual_and_jacobian(beyond, u)
    matrix = slopes[:, : field.n]
    if _determinant_sign(matrix) == 0:
        return "degenerate"
    toward = field.signs[region, interface] * gradients[interface, : field.n]
    moved = np.linalg.solve(matrix, other - active)
    value = float(toward @ moved)
    if abs(value) <= ZERO_DETERMINANT * float(np.abs(toward) @ np.abs(moved)):
        return "degenerate"
    return "persistence" if value < 0 else NON_SMOOTH_FOLD


def _with_ends(
    field: FrozenField,
    curve: EquilibriumCurve,
    special: list[SpecialPoint],
    at_row: list[int],
    rows: int,
) -> tuple[list[SpecialPoint], list[int]]:
    """Add the end points, as boundary equilibria where the branch ends on an interface."""
    ends = []
    for side, segment in ((0, curve.segments[0]), (-1, curve.segments[-1])):
        u, tangent, interface = segment.u[side], segment.tangents[side], curve.ends[side]
        note = curve.outcomes[side].message
        if interface is None:
            outcome = curve.outcomes[side]
            reason = None if outcome.success else outcome.code
            point = special_point(
                field, END_POINT, segment.region, u, tangent, note=note, type=reason
            )
            sides = field.modes[segment.region].sides
            if curve.outcomes[side].code == TWO_FOLD.code and sides is not None:
                point = replace(point, residual=two_fold_residual(field, segment.region, u))
                name = field.interfaces[sides.interface]
                ends.append(
                    [
                        replace(point, code=TWO_FOLDS.code, label=TWO_FOLDS.code, interface=name),
                        point,
                    ]
                )
            else:
                ends.append([point])
            continue
        beyond = field.neighbour(segment.region, interface)
        names: tuple[str, ...] = (field.regions[segment.region],)
        type_, clarke = _filippov(field, segment.region, interface, u), None
        if beyond is not None:
            names = (*names, field.regions[beyond])
            if field.continuous(field.interfaces[interface]) and not field.is_wall(interface):
                # the jump of the rates is a rounding error
                type_, clarke = _by_determinants(field, segment.region, beyond, interface, u)
        point = special_point(
            field,
            BOUNDARY_EQUILIBRIA.code,
            segment.region,
            u,
            tangent,
            regions=names,
            interface=field.interfaces[interface],
            type=type_,
            clarke=clarke,
            note=note,
        )
        ends.append([point, special_point(field, END_POINT, segment.region, u, tangent, note=note)])
    first, last = ends[0][::-1], ends[1]
    return (
        [*first, *special, *last],
        [*([0] * len(first)), *at_row, *([rows - 1] * len(last))],
    )
