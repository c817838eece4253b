"""Certificates of diagrams: branch and prune of every region, and what the diagram lacks."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from functools import lru_cache
from itertools import pairwise
from typing import Any

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from fastslow.arguments import instance, mapping, validated
from fastslow.certification.boxes.intersections import open_intersections
from fastslow.certification.boxes.linking import (
    Arcs,
    IntervalProblem,
    curves_of,
    enclosed,
    nodes_of,
)
from fastslow.certification.boxes.missing import completed, doubled, lacking
from fastslow.certification.boxes.pruning import Pruned, prune_window
from fastslow.certification.equations import WEIGHT, ExactEquations, exact_equations
from fastslow.certification.points.listing import ProvedPoint, inaccurate, listed, repeated
from fastslow.certification.points.points import require_same_equations, with_enclosures
from fastslow.certification.settings import CERTIFICATION, Certification
from fastslow.certification.spectra.linearisations import Linearisation, linearisation
from fastslow.certification.spectra.stability import Examined, examined
from fastslow.errors import ArgumentError
from fastslow.kernels.intervals.printer import interval_program
from fastslow.model.known_functions import ELEMENTARY, formula_at
from fastslow.model.model import Model
from fastslow.results.branch.diagram import Diagram
from fastslow.results.branch.windows import state_window
from fastslow.results.certificates import (
    NOT_CONTINUED,
    NOT_SEPARATED,
    Certificate,
    OpenBoxes,
    ProvedCurve,
)
from fastslow.results.points import SpecialPoint, SpecialPoints
from fastslow.results.stored.operations import AT_TWO_FOLD

Array = NDArray[np.float64]

#: Distance of a box from a branch point, in units of the window, up to which it is around it.
AROUND_BRANCH_POINT = 1e-3


@validated(
    model=instance(Model),
    diagram=instance(Diagram),
    window=mapping,
    certification=instance(Certification),
)
def certify(
    model: Model,
    diagram: Diagram,
    *,
    window: Mapping[Any, tuple[float | None, float | None]],
    certification: Certification = CERTIFICATION,
) -> Certificate:
    """Prove all equilibria of a frozen model in a window, and add what its diagram lacks.

    Branch and prune in interval arithmetic over the states and the parameter: every box of the
    window is proved to contain no equilibrium, or exactly one curve of them (Krawczyk's operator
    with one unknown free), or it is left. The search covers the smooth extension of each region,
    whose curves are then divided into admissible and virtual ones, and pseudo-equilibria on each
    discontinuity. Floating-point numbers are the shortest decimals
    that are read as them.

    Along the curves the number of unstable eigenvalues is proved, and every fold, Hopf point and
    boundary equilibrium in the window is found: where two eigenvalues cross together or a point is
    degenerate, this is not decided and reported. Points that the diagram lacks are added to it.
    With python-flint (extra ``certified``) the points have an ``enclosure``, see `prove`.

    Parameters
    ----------
    model : Model
        The frozen model of the diagram.
    diagram : Diagram
        Its parameter and range are those of the certificate.
    window : mapping
        The range (low, high) of every state; of a periodic state at most a period long.
    certification : Certification, optional

    Returns
    -------
    Certificate

    Raises
    ------
    ArgumentError
        If the window of a state is missing or infinite, or the diagram is of another model.
    UnknownNameError
        If a name in the window is not a state.
    ModelError
        If the model is not frozen, has resets or switches, or a function in it has no interval
        arithmetic.

    See Also
    --------
    fastslow.prove, fastslow.continue_equilibria

    Examples
    --------
    >>> import fastslow as fs
    >>> gear = fs.systems.harmonic_gear().frozen()
    >>> diagram = fs.continue_equilibria(gear, "w", (-2, 6))
    >>> proof = fs.certify(gear, diagram, window={"x": (-2, 2), "v": (-3, 8)})
    >>> proof.complete, proof.diagram.completeness
    (True, 'proved')
    """
    name = diagram.parameter
    _check(model, diagram)
    ranges = _ranges(model, window) | {name: diagram.over}
    searches = []
    motions = exact_equations(model, name)
    require_same_equations("diagram", diagram.equations, model)
    for equations in motions:
        if equations.continuum:
            continue
        search = _searched(equations, ranges, certification)
        searches.append(search)
        if search.pruned.interrupted:
            break
    names = (*model.states, name)
    curves = tuple(c for s in searches for c in s.curves(names))
    left = tuple(b for s in searches for b in s.left(names))
    reasons = _reasons(model, searches, curves, left, certification, name, ranges)
    reasons += _not_searched(motions, {search.equations.region for search in searches}, diagram)
    unresolved = tuple(b for s in searches for b in s.unresolved(names))
    lacked = tuple(c for curve in curves if curve.admissible for c in lacking(curve, diagram))
    unit = np.array([high - low if high > low else 1.0 for low, high in ranges.values()])
    proved = [point for s in searches for point in s.points()]
    complete, labels, also = listed(model, completed(model, diagram, lacked, ranges), proved, unit)
    added, enclosed_points, notes = with_enclosures(model, complete)
    known = {label for label in labels if label is not None}
    notes = (*notes, *inaccurate(model, added, proved, labels, unit))
    again = repeated(model, added, proved, labels, unit)
    inside = {p.label for p in added.special if p.admissible and _within(p, ranges)}
    known |= (inside & {p.label for p in enclosed_points}) - again
    points = SpecialPoints(p for p in added.special if p.label in known)
    if None in labels:
        notes = (*notes, f"{labels.count(None)} proved special points are on no branch")
    all_points = not reasons and not unresolved and None not in labels
    if all_points:
        notes = (
            *notes,
            *(
                f"{p.label} of the diagram is none of the proved special points"
                for p in added.special
                if p.kind.certified and p.label in inside - known - again
            ),
        )
    notes = (*notes, *_around_branch_points(left, points, ranges))
    certificate = Certificate(
        states=model.states,
        parameter=name,
        window=ranges,
        curves=curves,
        missing=(*lacked, *(added.special[label] for label in also)),
        left=left,
        why="; ".join(reasons),
        diagram=added,
        points=points,
        searched=sum(s.pruned.searched for s in searches),
        parameters=dict(diagram.parameters),
        equations=diagram.equations,
        settings=asdict(certification),
        notes=notes,
        unresolved=unresolved,
        all_points=all_points,
    )
    if reasons or any(lacking(c, added) for c in curves if c.admissible):
        return certificate
    twice = doubled(certificate)
    if twice:
        return replace(certificate, notes=(*notes, twice))
    return replace(certificate, diagram=replace(added, completeness="proved"))


def _not_searched(
    motions: Sequence[ExactEquations], reached: set[str], diagram: Diagram
) -> list[str]:
    """Name the motions whose equilibria are not certified."""
    reasons = []
    unreached = [e.region for e in motions if not e.continuum and e.region not in reached]
    if unreached:
        reasons.append(f"{', '.join(unreached)} were not searched")
    continua = [equations.region for equations in motions if equations.continuum]
    if continua:
        reasons.append(
            f"equilibria on {', '.join(continua)} form continua, which are not certified "
            "(see the bands of the diagram)"
        )
    turning = sorted({b.region for b in diagram.bands if b.region.endswith(AT_TWO_FOLD)})
    if turning:
        reasons.append(
            f"the equilibria on {', '.join(turning)} are not certified (see the bands of the "
            "diagram)"
        )
    return reasons


def _within(point: SpecialPoint, ranges: Mapping[str, tuple[float, float]]) -> bool:
    """Return whether a point is in the window."""
    *_, name = ranges
    u = (*point.state.tolist(), point.parameters[name])
    return all(low <= v <= high for v, (low, high) in zip(u, ranges.values(), strict=True))


def _around_branch_points(
    left: Sequence[OpenBoxes],
    points: SpecialPoints,
    ranges: Mapping[str, tuple[float, float]],
) -> tuple[str, ...]:
    """Name the proved branch points, if what is not decided is around these alone."""
    low, high = np.array(list(ranges.values())).T
    crossings = [p for p in points if p.kind.branching and p.enclosure is not None]
    boxes = [boxes for boxes in left if boxes.why == "not decided"]
    if not crossings or not boxes:
        return ()
    places = np.array([[point[name] for name in ranges] for point in crossings])
    ends = np.concatenate([np.stack([b.low, b.high], axis=1) for b in boxes])
    away = np.abs(ends[:, None] - places[:, None]) / np.where(high > low, high - low, 1.0)
    nearest = away.max(axis=(2, 3))
    if nearest.min(axis=1).max() > AROUND_BRANCH_POINT:
        return ()
    labels = [crossings[k].label for k in np.unique(nearest.argmin(axis=1))]
    return (f"all of these boxes are around {' and '.join(labels)}, where two branches intersect",)


def _check(model: Model, diagram: Diagram) -> None:
    """Raise ArgumentError for the diagram of another model."""
    if diagram.states != model.states:
        raise ArgumentError(
            f"the diagram has the states {', '.join(diagram.states)} and the model "
            f"{', '.join(model.states)}; expected the diagram of this model"
        )
    for name, value in diagram.parameters.items():
        if name != diagram.parameter and model.parameters.get(name) != value:
            raise ArgumentError(
                f"the diagram has {name} = {value!r} and the model {model.parameters.get(name)!r}; "
                "expected the diagram of this model"
            )


def _ranges(model: Model, window: Mapping[Any, Any]) -> dict[str, tuple[float, float]]:
    """Validate the window: a finite range of every state."""
    given = state_window(model.states, window, model.periodic)
    ranges = dict(zip(model.states, zip(given.lower, given.upper, strict=True), strict=True))
    for name, (low, high) in ranges.items():
        if not (math.isfinite(low) and math.isfinite(high)):
            received = "no range" if (low, high) == (-math.inf, math.inf) else f"({low}, {high})"
            raise ArgumentError(
                f"window of {name}: received {received}; expected a finite range of every state, "
                f"as nothing outside the window is proved: window={{'{name}': (low, high), …}}"
            )
    return ranges


@dataclass(frozen=True, eq=False)
class _Search:
    """The search for the equilibria of one motion."""

    equations: ExactEquations
    problem: IntervalProblem
    pruned: Pruned
    linear: Linearisation
    found: Examined

    @property
    def _columns(self) -> list[int]:
        """The unknowns that are states or the parameter."""
        return [k for k, s in enumerate(self.equations.unknowns) if s != WEIGHT]

    def curves(self, names: Sequence[str]) -> list[ProvedCurve]:
        """The curves inside the window, admissible and virtual ones."""
        return [
            self._curve(names, part, admissible)
            for arcs in self.found.curves
            for part, admissible in _inside(self.problem, arcs)
        ]

    def _curve(self, names: Sequence[str], arcs: Arcs, admissible: bool) -> ProvedCurve:
        low, high = nodes_of(self.problem, arcs)
        kept = self._columns
        unknowns = ["weight" if s == WEIGHT else s.name for s in self.equations.unknowns]
        return ProvedCurve(
            states=tuple(names[:-1]),
            parameter=names[-1],
            region=self.equations.region,
            low=arcs.low[:, kept],
            high=arcs.high[:, kept],
            free=np.array(unknowns)[arcs.free],
            node_low=low[:, kept],
            node_high=high[:, kept],
            direction=arcs.direction,
            decided=arcs.position >= 0,
            admissible=admissible,
            closed=arcs.closed,
            ends=arcs.ends,
            unstable=arcs.unstable,
            neutral=self.linear.neutral,
        )

    def points(self) -> list[ProvedPoint]:
        """The folds, Hopf points and boundary equilibria."""
        kept, region = self._columns, self.equations.region
        return [
            ProvedPoint(
                c.code, region, c.interface, c.low[kept], c.high[kept], c.near_low[:, kept],
                c.near_high[:, kept],
            )
            for c in self.found.crossings
        ]  # fmt: skip

    def unresolved(self, names: Sequence[str]) -> list[OpenBoxes]:
        """The boxes in which special points may be that are not proved."""
        kept, region, extent = self._columns, self.equations.region, self.problem.unit
        low, high = (np.array([box[k] for box in self.found.undecided]) for k in (0, 1))
        if not len(low):
            return []
        share = float(np.prod((high - low) / extent, axis=1).sum())
        boxes = low[:, kept], high[:, kept]
        return [
            OpenBoxes(tuple(names[:-1]), names[-1], region, *boxes, "stability not decided", share)
        ]

    def left(self, names: Sequence[str]) -> list[OpenBoxes]:
        """The boxes in which nothing is proved."""
        found, extent = [], self.problem.unit
        for low, high, why in (
            (self.pruned.left_low, self.pruned.left_high, "not decided"),
            (self.pruned.open_low, self.pruned.open_high, "not searched"),
        ):
            possible = self.problem.position(low, high) != 0 if len(low) else np.empty(0, bool)
            if possible.any():
                low, high = low[possible], high[possible]
                share = float(np.prod((high - low) / extent, axis=1).sum())
                boxes = low[:, self._columns], high[:, self._columns]
                region = self.equations.region
                found.append(OpenBoxes(tuple(names[:-1]), names[-1], region, *boxes, why, share))
        return found


def _searched(
    equations: ExactEquations,
    ranges: Mapping[str, tuple[float, float]],
    certification: Certification,
) -> _Search:
    unknowns = equations.unknowns
    window = np.array([(-1.0, 1.0) if s == WEIGHT else ranges[s.name] for s in unknowns])
    heights = _heights(equations.heights, unknowns) if equations.heights else None
    problem = IntervalProblem(
        interval_program(equations.rows, unknowns),
        heights,
        equations.signs,
        window[:, 0].copy(),
        window[:, 1].copy(),
    )
    pruned = prune_window(
        problem.program,
        problem.low,
        problem.high,
        max_boxes=certification.max_boxes,
        width=certification.width,
    )
    linear = linearisation(equations)
    found = examined(problem, linear, equations.interfaces, curves_of(problem, pruned))
    return _Search(equations, problem, pruned, linear, found)


#: The program of the functions of all interfaces, which regions have in common.
_heights = lru_cache(maxsize=8)(interval_program)


def _inside(problem: IntervalProblem, arcs: Arcs) -> list[tuple[Arcs, bool]]:
    """Divide a curve at the edges of the window and of the region; arcs outside are left out."""
    outside = ((arcs.high < problem.low) | (arcs.low > problem.high)).any(axis=1)
    kind = np.where(outside, 2, np.where(arcs.position == 0, 0, 1))
    if arcs.closed and len(set(kind.tolist())) > 1:
        # begin where the kind changes
        turn = int(np.flatnonzero(np.diff(kind))[0]) + 1
        order = np.roll(np.arange(len(kind)), -turn)
        arcs, kind = arcs.rows(order), kind[order]
        arcs = replace(arcs, closed=False)
    ends = [0, *(np.flatnonzero(np.diff(kind)) + 1).tolist(), len(kind)]
    edge = NOT_SEPARATED if NOT_SEPARATED in arcs.ends else "edge"
    found = []
    for first, last in pairwise(ends):
        if kind[first] == 2:
            continue
        why = (
            arcs.ends[0] if first == 0 else edge,
            arcs.ends[1] if last == len(kind) else edge,
        )
        part = replace(arcs.rows(slice(first, last)), ends=why)
        found.append((part, bool(kind[first])))
    return found


def _reasons(
    model: Model,
    searches: Sequence[_Search],
    curves: Sequence[ProvedCurve],
    left: Sequence[OpenBoxes],
    certification: Certification,
    name: str,
    ranges: Mapping[str, tuple[float, float]],
) -> list[str]:
    """Why a certificate is not complete."""
    reasons = []
    if any(s.pruned.interrupted for s in searches):
        reasons.append("the search was interrupted")
    for boxes in left:
        where = f" in {boxes.region}" if len(model.regions) > 1 else ""
        (search,) = (s for s in searches if s.equations.region == boxes.region)
        if boxes.why == "not searched":
            reached = search.pruned.searched >= certification.max_boxes
            reasons.append(
                f"{len(boxes)} boxes{where}, {boxes.fraction:.2g} of the window, were not searched"
                + (f" (max_boxes = {certification.max_boxes})" if reached else "")
            )
        else:
            reasons.append(
                f"nothing is proved in {len(boxes)} small boxes{where} within "
                f"{_extent(boxes)}: {_singularity(search)}"
            )
    lost = sum(NOT_CONTINUED in curve.ends for curve in curves)
    if lost:
        reasons.append(f"{lost} curves end inside the window, where no piece continues them")
    close = sum(NOT_SEPARATED in curve.ends for curve in curves)
    if close:
        reasons.append(f"{close} curves are not separated from one another, and may be the same")
    several = open_intersections(model, name, ranges)
    if several:
        words = "; ".join(
            " = 0 and ".join(f"{model.interfaces[n].function}" for n in pair) + " = 0"
            for pair in several
        )
        reasons.append(
            "equilibria on intersections of discontinuities in the window are not certified: "
            f"{words}"
        )
    return reasons


def _extent(boxes: OpenBoxes) -> str:
    names = (*boxes.states, boxes.parameter)
    ends = zip(names, boxes.low.min(axis=0), boxes.high.max(axis=0), strict=True)
    return ", ".join(f"{name} in [{low:.6g}, {high:.6g}]" for name, low, high in ends)


def _singularity(search: _Search) -> str:
    """Name what has no bounds in the boxes that are left."""
    unknowns, rows = search.equations.unknowns, search.equations.rows
    for kind, expression in _critical(rows):
        below, above = _bounds([expression], unknowns, search.pruned)
        if np.any((below <= 0.0) & (above >= 0.0)):
            return f"{kind}, where {expression} = 0"
    below, above = _bounds(rows, unknowns, search.pruned)
    if not np.isfinite(below).all() or not np.isfinite(above).all():
        return "the rates have no bounds there, as at the edge of a domain or where they overflow"
    return "a branch point, a degenerate equilibrium, or curves closer together than the boxes"


def _bounds(
    expressions: Sequence[sp.Expr], unknowns: Sequence[sp.Symbol], pruned: Pruned
) -> tuple[Array, Array]:
    """Bounds of expressions in the boxes that are left, shapes (k, m)."""
    program = interval_program(expressions, unknowns)
    m = len(expressions)
    below, above = enclosed(program, pruned.left_low, pruned.left_high)
    return below[:, :m], above[:, :m]


def _critical(rows: Sequence[sp.Expr]) -> list[tuple[str, sp.Expr]]:
    """Denominators and poles of functions, and arguments of logarithms, roots and inverses."""
    powers = sorted(set().union(*(r.atoms(sp.Pow) for r in rows)), key=str)
    functions = sorted(set().union(*(r.atoms(*ELEMENTARY) for r in rows)), key=str)
    found = [("a pole", p.base) for p in powers if p.exp.is_negative]
    found += [("the edge of a domain", p.base) for p in powers if not p.exp.is_Integer]
    for f in functions:
        known = ELEMENTARY[f.func]
        texts = (("the edge of a domain", known.domain), ("a pole", known.poles))
        found += [(kind, formula_at(text, *f.args)) for kind, text in texts if text]
    return [(kind, e) for kind, e in found if e.free_symbols]
