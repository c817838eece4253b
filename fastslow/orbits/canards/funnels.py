"""Canards at folded nodes and saddles: intersections of the slow manifolds on a section."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fastslow.arguments import instance, validated
from fastslow.errors import ArgumentError
from fastslow.model.model import Model
from fastslow.orbits.canards.folded_sections import SHIFT_TO_FOLD, FoldedSection
from fastslow.results.base.named_mapping import NamedMapping
from fastslow.results.base.outcome import Outcome
from fastslow.results.orbits.folded_canards import Canards, FoldedCanard
from fastslow.simulation.arguments import require_values
from fastslow.symbolic.folded_points import FoldedPoint

Array = NDArray[np.float64]

#: Starts on each sheet, and their range in units of those of the strong and of the weak canard.
FUNNEL_STARTS, FUNNEL_RANGE = 1500, (0.5, 1.2)

#: Fraction of the starts below which they are taken anew where some reach the section.
PARTLY_REACHED = 0.7

#: Tolerance of the curves, and of the corrected intersections.
CURVE_RTOL, CORRECTED_RTOL = 1e-12, 1e-14

#: Distance of the curves, in units of their range, up to which they are one to rounding, and to
#: the chords between their points.
COINCIDENT = 1e-7

#: Most intersections of a group that are corrected one by one.
MOST_CORRECTED = 40

#: Least ∫|Re λ| dt along the strong canard to which starts are moved towards the fold.
LEAST_CONTRACTION = 8.0

#: Segments compared at once.
SEGMENT_BLOCK = 128

#: Distance of two canards on the section, in units of the range of the curves, up to which they are
#: one; largest change of the logarithm of a start by the correction.
DIFFERENT_CANARDS, FARTHEST_INTERSECTION = 1e-8, 0.1

#: Newton steps to an intersection, change of a start for its derivative, and largest last step.
INTERSECTION_STEPS, START_CHANGE, INTERSECTION_FOUND = 12, 1e-6, 1e-6


class Meeting(NamedTuple):
    """Fractional rows of two curves at an intersection."""

    one: float
    other: float


@validated(model=instance(Model), point=instance(FoldedPoint))
def find_canards(model: Model, point: FoldedPoint) -> Canards:
    """Compute all canards at a folded node or a folded saddle.

    Starts along a line on the attracting sheet are followed forwards, and along one on the
    repelling sheet backwards, to a section through the singularity transverse to the fold. There
    both slow manifolds are curves, whose intersections are the canards, corrected by Newton's
    method in the two starts. Near the weak canard both curves collapse to rounding; intersections
    between which they coincide are one.

    Parameters
    ----------
    model : Model
        With one fast state and two slow variables, one of which may be the phase of a forcing.
    point : FoldedPoint
        A folded node (FN) with a funnel, or a folded saddle (FS), of ``slow_flow(model)``.

    Returns
    -------
    Canards

    Raises
    ------
    ArgumentError
        For another model or point.

    See Also
    --------
    fastslow.slow_flow, fastslow.find_canard, fastslow.continue_points

    Notes
    -----
    At a folded node there are s + 1 canards with s = ⌊(μ + 1)/(2μ)⌋ if √ε ≪ μ (Wechselberger, SIAM
    J. Appl. Dyn. Syst. 4, 101-139, 2005): the strong one, the weak one, and s − 1 secondary
    canards. At a folded saddle there is one, besides a faux canard.

    Examples
    --------
    >>> import sympy as sp, fastslow as fs
    >>> x, y, z, mu = sp.symbols("x y z mu")
    >>> slow = {x: mu * y / 2 - (mu + 1) * z, y: 1}
    >>> model = fs.Model({z: x + z**2}, slow=slow, parameters={mu: 0.22})
    >>> (node,) = fs.slow_flow(model).points
    >>> [(one.type, round(one["x"], 6)) for one in fs.find_canards(model, node)]
    [('strong', 0.5), ('secondary', 0.041804), ('weak', 0.11)]
    """
    require_values(model)
    count = len(model.states), len(point.state) - len(model.states)
    if count != (1, 2) or set(model.states) - set(point.state):
        raise ArgumentError(
            f"find_canards: {count[0]} fast and {count[1]} slow variables; expected one fast and "
            "two slow ones. With one slow variable find_canard computes the maximal canard"
        )
    if not math.isnan(point.ratio) and not point.funnel:
        raise ArgumentError("point: a folded node without a funnel, which has faux canards only")
    if not point.canards:
        name = point.words if point.code else point.note or "a point without a code"
        raise ArgumentError(
            f"point: {name}; expected a folded node (FN) or a folded saddle (FS), at which there "
            "are canards"
        )
    section = FoldedSection(model, point).turned()
    section, lengths, one, other = funnel_curves(section)
    known = [rows[np.isfinite(rows).all(axis=1)] for rows in (one, other)]
    if min(map(len, known)) < 2:
        raise ArgumentError("find_canards: the slow manifolds do not reach the section")
    size = np.maximum(*(np.ptp(rows, axis=0) for rows in known))
    size = np.where(size > 0.0, size, 1.0)
    groups = grouped(list(crossings(one / size, other / size)), one / size, other / size)
    kept: list[FoldedCanard] = []
    for group in groups:
        for canard in _canards(section, lengths, size, group):
            apart = [canard.state - k.state for k in kept]
            away = [max(abs(d[0]) / size[0], np.linalg.norm(d[1:]) / size[1]) for d in apart]
            if all(a > DIFFERENT_CANARDS for a in away):
                kept.append(canard)
    missed = _missed(groups, one, other)
    expected = point.canards
    return Canards(
        _typed(kept, point.funnel, missed),
        code=point.code,
        ratio=point.ratio,
        expected=expected,
        contraction=section.contraction,
        attracting=one,
        repelling=other,
        outcome=_outcome(len(kept), expected, point, any(missed)),
    )


def _missed(groups: list[list[Meeting]], one: Array, other: Array) -> tuple[bool, bool]:
    """Whether starts before the first and beyond the last intersection miss the section."""
    if not groups:
        return False, False
    first, last = groups[0][0], groups[-1][-1]
    before = [np.isnan(c[: math.floor(k)]).any() for c, k in zip((one, other), first, strict=True)]
    after = [np.isnan(c[math.ceil(k) :]).any() for c, k in zip((one, other), last, strict=True)]
    return any(before), any(after)


def _outcome(count: int, expected: int, point: FoldedPoint, missed: bool) -> Outcome:
    more = "; some starts miss the section, so that canards are left out" if missed else ""
    if count == expected:
        return Outcome("found", f"as many as expected, {expected}.", True)
    return Outcome(
        "another number",
        f"{expected} were expected for well separated rates, √ε ≪ μ = {point.ratio:.3g}; the rates "
        f"are not separated so far, or intersections were not resolved{more}.",
        False,
    )


def crossings(one: Array, other: Array) -> Iterator[Meeting]:
    """Yield the intersections of two polylines, in order along the first."""
    first, second = one[:-1], other[:-1]
    along, beside = np.diff(one, axis=0), np.diff(other, axis=0)
    for start in range(0, len(first), SEGMENT_BLOCK):
        block = slice(start, start + SEGMENT_BLOCK)
        d, e = along[block, None], beside[None]
        apart = second[None] - first[block, None]
        with np.errstate(all="ignore"):
            denominator = _cross(d, e)
            s, t = _cross(apart, e) / denominator, _cross(apart, d) / denominator
        rows, columns = np.nonzero((s >= 0.0) & (s < 1.0) & (t >= 0.0) & (t < 1.0))
        places = sorted(
            (start + k + s[k, j], j + t[k, j])
            for k, j in zip(rows.tolist(), columns.tolist(), strict=True)
        )
        yield from (Meeting(float(a), float(b)) for a, b in places)


def _cross(one: Array, other: Array) -> Array:
    return np.asarray(one[..., 0] * other[..., 1] - one[..., 1] * other[..., 0])


def grouped(found: list[Meeting], one: Array, other: Array) -> list[list[Meeting]]:
    """Group intersections between which the curves coincide, to rounding and chords."""
    groups: list[list[Meeting]] = []
    far = np.array([_away(place, other) > COINCIDENT for place in one])
    for meeting in found:
        if groups:
            last = groups[-1][-1]
            between = slice(math.ceil(last.one), math.floor(meeting.one) + 1)
            if not far[between].any():
                groups[-1].append(meeting)
                continue
        groups.append([meeting])
    return groups


def _away(place: Array, curve: Array) -> float:
    """Distance of a place from a polyline; infinite if it is not known."""
    start, step = curve[:-1], np.diff(curve, axis=0)
    with np.errstate(all="ignore"):
        length = np.maximum((step**2).sum(axis=1), np.finfo(float).tiny)
        part = np.clip(((place - start) * step).sum(axis=1) / length, 0.0, 1.0)
        away = np.sqrt(((start + part[:, None] * step - place) ** 2).sum(axis=1))
    known = away[np.isfinite(away)]
    return float(known.min()) if len(known) else math.inf


def _canards(
    section: FoldedSection, lengths: Array, size: Array, group: list[Meeting]
) -> list[FoldedCanard]:
    """Return the canards at a group of intersections: one where the curves have collapsed."""
    rows, logs = np.arange(lengths.shape[1]), np.log(lengths)
    begun = [
        np.array([np.interp(at, rows, log) for at, log in zip(meeting, logs, strict=True)])
        for meeting in group
    ]
    tried = begun if len(group) <= MOST_CORRECTED else []
    solved = [u for u in (_corrected(section, u, size) for u in tried) if u is not None]
    distinct: list[Array] = []
    places: list[Array] = []
    for u in solved:
        place = _places(section, u[:, None])[0][0]
        if all(np.abs((place - p) / size).max() > DIFFERENT_CANARDS for p in places):
            distinct.append(u)
            places.append(place)
    if not distinct and len(group) > 1:
        number = min(range(len(group)), key=lambda k: abs(group[k].one - group[k].other))
        distinct = [begun[number]]
    found = []
    for u in distinct:
        one, other = _places(section, u[:, None])
        ends = np.exp(u).tolist()
        found.append(
            FoldedCanard(
                type="",
                states=(*section.model.states, *section.slow),
                state=section.on_section(0.5 * (one[0] + other[0])),
                parameters=NamedMapping("parameter", dict(section.model.parameters)),
                path=section.path((ends[0], ends[1])),
                residual=float(np.abs((one[0] - other[0]) / size).max()),
                merged=len(group) if len(distinct) == 1 else 1,
            )
        )
    return found


def _places(section: FoldedSection, logs: Array) -> tuple[Array, Array]:
    """Return the points of both manifolds on the section, for logarithms of |σ| at the starts."""
    sides = section.attracting, -section.attracting
    one, other = (
        section.curve(side, np.exp(row), CORRECTED_RTOL)
        for side, row in zip(sides, logs, strict=True)
    )
    return one, other


def _corrected(section: FoldedSection, begun: Array, size: Array) -> Array | None:
    """Solve for an intersection by Newton's method in the two starts; None without convergence."""
    step = np.array([0.0, -START_CHANGE, START_CHANGE])
    u, change = begun, math.inf
    for _ in range(INTERSECTION_STEPS):
        one, other = _places(section, u[:, None] + step)
        gap = (one[0] - other[0]) / size
        slopes = np.column_stack([(one[2] - one[1]) / size, (other[1] - other[2]) / size])
        if not (np.isfinite(gap).all() and np.isfinite(slopes).all()):
            return None
        moved = np.linalg.lstsq(slopes / (2 * START_CHANGE), -gap, rcond=None)[0]
        before, change = change, float(np.abs(moved).max())
        u = u + moved * min(1.0, FARTHEST_INTERSECTION / change if change else 1.0)
        if change <= 1e-12 or (change <= INTERSECTION_FOUND and change >= 0.5 * before):
            break
    good = change <= INTERSECTION_FOUND and np.abs(u - begun).max() <= FARTHEST_INTERSECTION
    return u if good else None


def funnel_curves(section: FoldedSection) -> tuple[FoldedSection, Array, Array, Array]:
    """Return the curves of both manifolds, from starts near enough to reach the section.

    Those of the weak canard are farthest; where they meet an equilibrium or another fold on the
    way, starts are moved towards the fold, which shortens the decay of their deviations.
    """
    _, slopes = section.slopes
    # passed from the attracting to the repelling sheet as σ increases
    passed = [abs(float(k)) for k in slopes if k * section.attracting < 0.0]
    sides = section.attracting, -section.attracting
    while True:
        starts = [section.distance / k for k in passed]
        last = np.array([1.0, FUNNEL_RANGE[1]]) * max(starts)
        ends = [section.curve(side, last, CURVE_RTOL) for side in sides]
        nearer = section.moved(SHIFT_TO_FOLD)
        if np.isfinite(ends).all() or nearer.contraction < LEAST_CONTRACTION:
            break
        section = nearer
    first = np.geomspace(FUNNEL_RANGE[0] * min(starts), float(last[1]), FUNNEL_STARTS)
    lengths, curves = [], []
    for side in sides:
        used, curve = first, section.curve(side, first, CURVE_RTOL)
        reached = np.flatnonzero(np.isfinite(curve).all(axis=1))
        if 1 < len(reached) < PARTLY_REACHED * len(first):
            # all starts where some reach the section
            ends = np.clip([reached[0] - 1, reached[-1] + 1], 0, len(first) - 1)
            low, high = first[ends].tolist()
            used = np.geomspace(low, high, FUNNEL_STARTS)
            curve = section.curve(side, used, CURVE_RTOL)
        lengths.append(used)
        curves.append(curve)
    return section, np.array(lengths), curves[0], curves[1]


def _typed(
    canards: list[FoldedCanard], funnel: bool, missed: tuple[bool, bool]
) -> Iterator[FoldedCanard]:
    """Yield the canards with their types, from the strong to the weak one.

    The first and the last are secondary if starts beyond them miss the section.
    """
    last = len(canards) - 1
    for k, canard in enumerate(canards):
        name = "secondary"
        if k == 0 and not missed[0]:
            name = "strong"
        elif k == last and not missed[1]:
            name = "weak"
        name = name if funnel else "saddle"
        yield replace(canard, type=name)
