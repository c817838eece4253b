"""Bifurcation diagrams: all branches of equilibria of a frozen model over one parameter."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from dataclasses import field as dataclass_field
from functools import lru_cache
from itertools import product
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from fastslow.arguments import (
    Name,
    either,
    finite,
    flag,
    formula,
    instance,
    interval,
    items,
    mapping,
    text,
    validated,
)
from fastslow.continuation.directions import both_ways
from fastslow.continuation.engine import FAR_UNIT
from fastslow.continuation.loops import loop, writeable
from fastslow.continuation.marks import Mark, read_marks
from fastslow.continuation.settings import Continuation
from fastslow.diagrams.correcting import corrections, point_at
from fastslow.diagrams.endings import ADMISSIBLE
from fastslow.diagrams.field import FrozenField, StoredFrozen, require_frozen
from fastslow.diagrams.on_interfaces import one_sided
from fastslow.diagrams.points.boundary_equilibria import BOUNDARY_EQUILIBRIA
from fastslow.diagrams.segments import BranchSegment, Window, on_normal_plane
from fastslow.diagrams.trace.across_regions import DirectedTrace, trace_across_regions
from fastslow.diagrams.trace.assembly import (
    EquilibriumCurve,
    branch_of,
    join_directions,
    oriented_upwards,
)
from fastslow.diagrams.trace.repeated_equilibria import repetitions
from fastslow.diagrams.trace.rounding_at_ends import rounded_ends, rounded_rows
from fastslow.diagrams.trace.seeds import Seeds
from fastslow.diagrams.trace.vanishing_tests import identical_zeros, unlocated_marks
from fastslow.errors import ArgumentError, ModelError, refuse_switches
from fastslow.formulas.definitions import definitions_of, with_definitions_in
from fastslow.results.angles import apart, copies, periods_of
from fastslow.results.base.outcome import Outcome, with_ends, with_notes
from fastslow.results.branch.branch import Branch
from fastslow.results.branch.diagram import SEARCHED, Diagram
from fastslow.results.branch.equilibrium_sets import EquilibriumBand
from fastslow.results.branch.windows import LEFT, StateWindow, state_window
from fastslow.results.point_types import CANDIDATE
from fastslow.results.points import Equilibrium, SpecialPoint, SpecialPoints
from fastslow.results.stored.model import StoredModel
from fastslow.simulation.arguments import simulated

if TYPE_CHECKING:
    from fastslow.diagrams.solve.starts import Starts
    from fastslow.model.model import Model

Array = NDArray[np.float64]

#: Largest distance from an interface, in units of the window, of a point on it.
INSIDE = 1e-9

#: Largest number of rows along which a branch outside the window is searched for its entries.
ENTRY_ROWS = 2000

#: First step along the branch that crosses at a branch point, in units of the window.
SWITCH = 1e-3


@validated(
    model=simulated,
    parameter=formula,
    over=interval,
    continuation=instance(Continuation),
    marks=either(mapping, items(finite)),
    virtual=flag,
    window=mapping,
    from_points=items(),
    regions=items(text),
)
def continue_equilibria(
    model: Model | StoredModel,
    parameter: Name,
    over: tuple[float, float],
    *,
    continuation: Continuation | None = None,
    marks: Sequence[float] | Mapping[Any, Any] = (),
    virtual: bool = False,
    window: Mapping[Any, tuple[float | None, float | None]] | None = None,
    from_points: Sequence[Any] | None = None,
    regions: Sequence[str] | None = None,
) -> Diagram:
    """Trace every branch of equilibria of a frozen model over a parameter range.

    At the wall of a reset a branch continues as the equilibria held against the wall, up to
    zero contact force. In a model with switches branches are traced in every state of the
    switches, in regions such as ``"S1 (q = 0)"``; they end at the thresholds of this state.

    Pseudo-arclength continuation (Keller 1977) in each region. At an interface the boundary
    equilibrium is computed and the branch continues in the region beyond: over the same
    direction of the parameter (persistence) or the opposite one (non-smooth fold). Across a
    discontinuity it continues as a branch of pseudo-equilibria of the sliding vector field,
    which ends at a two-fold. Equilibrium sets, such as the sticking states of a block under
    dry friction, are the ``bands`` of the diagram.

    Parameters
    ----------
    model : Model or StoredModel
        A frozen model with values of all parameters except ``parameter``. The model of a
        diagram read from a file is a StoredModel, whose branches are traced ``from_points``.
    parameter : str or Symbol
        The continuation parameter.
    over : (float, float)
        Its range, in its own units.
    continuation : Continuation, optional
    marks : sequence of float, or mapping
        Parameter values at which points UZ are computed. In a mapping of names to expressions in
        states and parameters, as text or in SymPy, such as ``{"level": "x - 2*y"}``, the zeros of
        each expression are special points labelled level1, level2, …; values are then given by
        the name of the parameter.
    virtual : bool
        Whether to trace virtual branches too.
    window : mapping, optional
        State to its range (low, high), in its own units. Only equilibria inside are computed,
        and a branch that leaves the window ends on its edge. None in place of a bound is the
        default, an infinite bound is none. By default the window is 10⁴ times the size of the
        equilibria from which branches are traced; see ``diagram.window``.
    from_points : sequence, optional
        Trace only the branches through these points, without a search for others: each an
        Equilibrium, a SpecialPoint (from a branch point both branches), or a mapping of
        every state and the parameter to values near an equilibrium.
    regions : sequence of str, optional
        Of a model of more than 1024 regions those to consider, with sliding motions, such as those
        of a run, ``run.modes``.

    Returns
    -------
    Diagram

    Raises
    ------
    UnknownNameError
        If the parameter does not belong to the model, or a name in the window is not a state.
    ModelError
        If the model is not frozen, or a slow quantity has no value.
    ArgumentError
        If a range is empty, reversed or not finite, a mark is outside the range or its name is
        that of a column or a code, or a given point is not an equilibrium or is outside the range
        or the window.

    See Also
    --------
    fastslow.equilibria, fastslow.continue_points, fastslow.derive, fastslow.plot.diagram

    Examples
    --------
    >>> import sympy as sp, fastslow as fs
    >>> x, w, t = sp.symbols("x w t")
    >>> model = fs.Model({x: w + x - x**3}, forcing={w: sp.sin(t)}).frozen()
    >>> diagram = continue_equilibria(model, "w", (-1, 1))
    >>> [round(p["w"], 12) for p in diagram.folds]
    [0.38490017946, -0.38490017946]
    """
    name = str(parameter)
    lower, upper = over
    require_frozen(model, "trace the branches of")
    if regions is not None:
        model = _restricted(model, regions)
    marks = with_definitions_in(marks, definitions_of(model))
    wanted = read_marks(
        marks, {name: (lower, upper)}, dict.fromkeys([*model.states, name, *model.parameters])
    )
    if not isinstance(model, StoredModel) and model.switches:
        if from_points is not None:
            refuse_switches(model.switches, "from_points= of continue_equilibria")
        from fastslow.diagrams.joined_states import joined_diagram
        from fastslow.model.every_switch_state import switch_states

        freed = model.with_free(name)
        parts = [
            continue_equilibria(
                one, name, over, continuation=continuation, marks=marks, virtual=virtual,
                window=window,
            )
            for one in switch_states(freed)
        ]  # fmt: skip
        return joined_diagram(freed, parts)
    field = _field(model, name)
    continuation = continuation or Continuation()
    requested = state_window(model.states, window, model.periodic)
    starts: Starts | Seeds | Outcome
    if from_points is None:
        starts = _searched(model, field, over, continuation, requested, virtual)
    else:
        starts = Seeds(field, (lower, upper), from_points, requested, virtual)
    if isinstance(starts, Outcome):
        return _made(field, over, continuation, starts)
    search = _BranchSearch(
        field, starts, Window(lower, upper, starts.scale, starts.window), continuation, wanted
    )
    for admissible in (True, False) if virtual else (True,):
        search.trace(admissible)
        if from_points is None:
            search.branches.extend(_switched(search, admissible))
    return _diagram(search, over, requested, from_points)


def _restricted(model: Model | StoredModel, regions: Sequence[str]) -> Model:
    """Return a model with some of its regions."""
    if isinstance(model, StoredModel):
        raise ArgumentError("regions: a stored model is traced in all its regions; expected None")
    from fastslow.model.restriction import restricted

    return restricted(model, regions)


def _searched(
    model: Model | StoredModel,
    field: FrozenField,
    over: tuple[float, float],
    continuation: Continuation,
    requested: StateWindow,
    virtual: bool,
) -> Starts | Outcome:
    """Search for starting equilibria; return an outcome if the model has no isolated ones."""
    if isinstance(model, StoredModel):
        raise ModelError(
            "this is a stored model, without the equations from which equilibria are computed: "
            "give from_points=, points on the branches to be traced"
        )
    from fastslow.diagrams.solve.starts import starts_of
    from fastslow.symbolic.closed_forms.conserved import conserved_quantities
    from fastslow.symbolic.closed_forms.symmetries import free_directions

    untraced = "no branch of equilibria is traced; {}."
    if free := free_directions(model):
        return Outcome("free direction", untraced.format(free[0]), False)
    if conserved := conserved_quantities(model):
        return Outcome("conserved quantity", untraced.format(conserved[0]), False)
    return starts_of(field, *over, continuation.starts, requested, virtual)


@dataclass(frozen=True, eq=False)
class _BranchSearch:
    """The branches found so far, and what is needed to trace others.

    Parameters
    ----------
    field : FrozenField
    starts : Starts or Seeds
    window : Window
    continuation : Continuation
    marks : sequence of Mark
    branches : list of Branch
    """

    field: FrozenField
    starts: Starts | Seeds
    window: Window
    continuation: Continuation
    marks: Sequence[Mark]
    branches: list[Branch] = dataclass_field(default_factory=list)

    @property
    def left(self) -> int:
        """The number of branches that may still be traced."""
        return self.continuation.max_branches - len(self.branches)

    def trace(self, admissible: bool) -> None:
        """Trace the branches through all starting points."""
        for value in self.starts.values(self.branches):
            if self.left <= 0:
                break
            for start in self.starts.at(value, admissible)[: self.left]:
                self._add(start, value, admissible)
        if admissible:
            for start, value in _entering(self.field, self.starts, self.window):
                if self.left <= 0:
                    break
                self._add(start, value, admissible)

    def _add(self, start: Equilibrium, value: float, admissible: bool) -> None:
        """Trace the branch through a point that is on no other one."""
        if not self.contain(start, value):
            self.branches.extend(self.through(start, value, admissible))

    def through(self, start: Equilibrium, value: float, admissible: bool) -> list[Branch]:
        """Trace the branch through a point; a virtual one may have several portions."""
        curve = _traced(self.field, start, value, self.window, self.continuation, admissible)
        return _branches(self.field, curve, self.window, self.marks, admissible)

    def contain(self, start: Equilibrium, value: float, others: Sequence[Branch] = ()) -> bool:
        """Return whether a branch contains a point."""
        return any(
            _contains_equilibrium(self.field, branch, start, value, self.window)
            for branch in (*self.branches, *others)
        )


def _diagram(
    search: _BranchSearch,
    over: tuple[float, float],
    requested: StateWindow,
    from_points: Sequence[Any] | None,
) -> Diagram:
    """Return the diagram of all branches that were found."""
    field, starts, branches = search.field, search.starts, search.branches
    scale, name, model = search.window.scale, field.parameter, field.model
    full, missed = search.left <= 0, starts.missed(branches)
    sound = all(o.success or o.code == LEFT for branch in branches for o in branch.outcomes)
    corrector = _Corrector(field)
    labelled = _labelled(branches, name, search.window, corrector)
    unexplained = sum(len(branch.unexplained) for branch in labelled)
    candidates = [p for branch in labelled for p in branch.special if p.type == CANDIDATE]
    repeated = list(repetitions(labelled, scale[:-1]))
    doubtful = full or missed or unexplained or candidates or repeated
    outcome = with_ends(
        _outcome(name, full, missed, search.continuation, from_points),
        [branch.outcomes for branch in branches],
        unexplained,
    )
    notes = [
        *dict.fromkeys(f"{p.label} is not decided: {p.note}." for p in candidates),
        *repeated,
        *one_sided(field, labelled),
        *(_not_traced(field) if from_points is None else ()),
        *rounded_ends(field, labelled, scale[:-1]),
        *rounded_rows(field, labelled, scale[:-1]),
        *identical_zeros(field, labelled, scale),
        *unlocated_marks(labelled, scale, search.marks),
    ]
    return _made(
        field,
        over,
        search.continuation,
        with_notes(outcome, notes),
        branches=labelled,
        completeness=("complete" if sound and not doubtful and starts.prove(branches) else "found"),
        corrector=corrector,
        window=starts.window,
        bands=_bands(field, *over, requested) if from_points is None else (),
        periods=dict(model.periodic),
    )


def _bands(
    field: FrozenField, lower: float, upper: float, requested: StateWindow
) -> tuple[EquilibriumBand, ...]:
    from fastslow.diagrams.solve.equilibrium_bands import bands_of

    return bands_of(field, lower, upper, requested)


def _not_traced(field: FrozenField) -> list[str]:
    """Return sentences on continua of equilibria that are neither branches nor bands."""
    from fastslow.diagrams.solve.equilibrium_bands import followed
    from fastslow.diagrams.solve.families import families_of
    from fastslow.diagrams.solve.many_regions import unexamined
    from fastslow.diagrams.solve.region_continua import implicit_continua

    left = [f for f in families_of(field) if not followed(f)]
    return [
        *(f"{sentence}." for sentence in (*implicit_continua(field), *unexamined(field))),
        *(
            f"sets of equilibria of {f.motion.name} of dimension {f.dimension} are not among the "
            "bands."
            for f in left
        ),
    ]


def _outcome(
    name: str,
    full: bool,
    missed: Sequence[tuple[str, float]],
    continuation: Continuation,
    from_points: Sequence[Any] | None,
) -> Outcome:
    """Return the outcome of the search for branches."""
    if full:
        return _too_many(continuation)
    if missed:
        return _continuum(name, missed)
    if from_points is None:
        return SEARCHED
    count = len(from_points)
    return Outcome(
        "from points",
        f"only branches through the {count} given point{'s' if count > 1 else ''} were traced; "
        "others were not searched for.",
        True,
    )


def _made(
    field: FrozenField,
    over: tuple[float, float],
    continuation: Continuation,
    outcome: Outcome,
    **found: Any,
) -> Diagram:
    """Return a diagram with its outcome, without branches unless they are given."""
    without: dict[str, Any] = {
        "branches": (),
        "completeness": "found",
        "corrector": _Corrector(field),
    }
    return Diagram(
        states=field.model.states,
        parameter=field.parameter,
        over=over,
        parameters=dict(field.model.parameters),
        interfaces=field.interfaces,
        regions=field.regions,
        interface_values=field.source.levels(),
        equations=_text(field.model),
        outcome=outcome,
        path=field.source.path(),
        settings=asdict(continuation),
        model=field.model,
        **(found or without),
    )


def _continuum(name: str, missed: Sequence[tuple[str, float]]) -> Outcome:
    places = "; ".join(f"{name} = {value:.6g} in {region}" for region, value in missed)
    return Outcome(
        "continuum",
        f"the equilibria form a continuum that is not on any branch: {places}.",
        False,
    )


def _too_many(continuation: Continuation) -> Outcome:
    return Outcome(
        "too many branches",
        f"{continuation.max_branches} branches were traced and more may exist; increase "
        "Continuation(max_branches=…) to trace them.",
        False,
    )


@lru_cache(maxsize=64)
def _field(model: Model | StoredModel, name: str) -> FrozenField:
    """Return the frozen field of a model, cached."""
    return FrozenField(model.with_free(name), name)


@lru_cache(maxsize=64)
def _text(model: Model | StoredModel) -> str:
    """Return the equations as text, cached."""
    return model.equations


def _traced(
    field: FrozenField,
    start: Equilibrium,
    value: float,
    window: Window,
    continuation: Continuation,
    bounded: bool,
) -> EquilibriumCurve:
    """Trace the whole branch through a starting point."""
    region = field.regions.index(start.region)
    u = np.append(window.states.shifted(start.state), value)
    tangent, _ = field.tangent(region, u, window.weight)
    if bounded and _along_interface(field, region, np.array([u]), window).any():
        # along an interface rounding would end the branch anywhere
        curve = _traced(field, start, value, window, continuation, False)
        rows = np.concatenate([segment.u for segment in curve.segments])
        if _along_interface(field, region, rows, window).any():
            return curve

    def trace(sign: float, _: DirectedTrace | None) -> DirectedTrace:
        return trace_across_regions(
            field, region, u, sign * tangent, window, continuation, bounded=bounded
        )

    return oriented_upwards(both_ways(trace, join_directions))


def _entering(
    field: FrozenField, starts: Starts | Seeds, window: Window
) -> Iterator[tuple[Equilibrium, float]]:
    """Yield points in the window on branches through starting points outside of it."""
    wide, outside = starts.outside
    around = replace(window, states=wide)
    coarse = Continuation(max_points=ENTRY_ROWS)
    for start, value in outside:
        region = field.regions.index(start.region)
        u = np.append(start.state, value)
        tangent, _ = field.tangent(region, u, window.weight)
        for side in (1, -1):
            for segment in trace_across_regions(
                field, region, u, side * tangent, around, coarse
            ).segments:
                for rows in _copies(segment.u, starts.shifts, window):
                    states = window.states.shifted(rows[:, :-1])
                    inside = window.states.contains(states, window.scale[:-1])
                    # the middle row of each interval inside
                    edges = np.flatnonzero(np.diff(np.concatenate([[False], inside, [False]])))
                    for first, last in zip(edges[::2], edges[1::2], strict=True):
                        row = rows[(first + last - 1) // 2]
                        # a copy of a row far away has its error, in units of its distance
                        near = window.states.shifted(row[:-1])
                        solved = corrections(field)[segment.region].corrected(near, float(row[-1]))
                        if solved is not None:
                            u = np.append(solved, row[-1])
                            yield point_at(field, segment.region, u), float(row[-1])


def _copies(rows: Array, shifts: Array, window: Window) -> Iterator[Array]:
    """Yield the rows of a curve, and those of its copies by whole shifts that enter the window."""
    low, high = np.array(window.states.lower), np.array(window.states.upper)
    states = rows[:, :-1]
    numbers = [
        range(math.ceil((a - top) / shift), math.floor((b - bottom) / shift) + 1)
        if shift
        else range(1)
        for a, b, bottom, top, shift in zip(
            low, high, states.min(axis=0), states.max(axis=0), shifts, strict=True
        )
    ]
    for number in product(*numbers):
        yield rows + np.append(shifts * number, 0.0)


def _along_interface(field: FrozenField, region: int, rows: Array, window: Window) -> Array:
    """Return which interfaces of a region contain all of the points."""
    _, _, values, slopes = field.evaluate(region, rows)
    near = np.abs(values) < INSIDE * np.abs(slopes * window.scale).max(axis=-1)
    return near.all(axis=0) & (field.signs[region] != 0)


def _switched(search: _BranchSearch, admissible: bool) -> list[Branch]:
    """Trace crossing branches at branch points that were not found otherwise."""
    field, window = search.field, search.window
    found: list[Branch] = []
    waiting = [
        p
        for b in search.branches
        if b.admissible == admissible
        for p in b.special
        if p.kind.branching
    ]
    while waiting:
        point = waiting.pop(0)
        if point.switch is None or len(found) >= search.left:
            continue
        region = field.regions.index(point.regions[0])
        u = np.append(point.state, point.parameters[field.parameter])
        for step in (SWITCH, -SWITCH):
            guess = u + step * point.switch
            near = on_normal_plane(
                field, region, guess, point.switch * window.weight, guess, window
            )
            value = float(near.u[-1])
            if not near.converged or not window.lower <= value <= window.upper:
                continue
            if not window.contains(near.u):
                continue
            if field.admissible(region, near.u, window.scale) != admissible:
                continue
            start = point_at(field, region, near.u, admissible)
            if not search.contain(start, value, found):
                fresh = search.through(start, value, admissible)
                found += fresh
                waiting += [p for b in fresh for p in b.special if p.kind.branching]
    return found


def _branches(
    field: FrozenField,
    curve: EquilibriumCurve,
    window: Window,
    marks: Sequence[Mark],
    admissible: bool,
) -> list[Branch]:
    """Return the branch of a curve; for a virtual one, its portions outside the region."""
    if admissible:
        return [branch_of(field, curve, window, marks, True)]
    found = []
    (segment,) = curve.segments
    inside = np.array([not field.virtual(segment.region, u, window.scale) for u in segment.u])
    edges = np.flatnonzero(np.diff(inside)) + 1
    for rows in np.split(np.arange(len(inside)), edges):
        if inside[rows[0]] or len(rows) < 2:
            continue
        part = BranchSegment(segment.region, segment.u[rows], segment.tangents[rows])
        first, last = curve.outcomes
        if rows[0] > 0:
            part = _extended_to_interface(field, part, segment.u[rows[0] - 1], 0, window)
            first = ADMISSIBLE.at()
        if rows[-1] < len(inside) - 1:
            part = _extended_to_interface(field, part, segment.u[rows[-1] + 1], -1, window)
            last = ADMISSIBLE.at()
        cut = EquilibriumCurve(
            (part,), (), (first, last), (None, None), curve.closed and not len(edges)
        )
        found.append(branch_of(field, cut, window, marks, False))
    return found


def _extended_to_interface(
    field: FrozenField, part: BranchSegment, inside: Array, end: int, window: Window
) -> BranchSegment:
    """Extend a virtual segment by the boundary equilibrium at its end."""
    outside = part.u[end]
    _, _, h0, _ = field.evaluate(part.region, outside)
    _, _, h1, _ = field.evaluate(part.region, inside)
    bounding = field.signs[part.region] != 0
    for interface in np.flatnonzero((h0 * h1 < 0) & bounding):
        share = h0[interface] / (h0[interface] - h1[interface])
        corner = BOUNDARY_EQUILIBRIA.met(
            field, part.region, int(interface), outside, inside, float(share), window
        )
        if corner.converged:
            place = 0 if end == 0 else len(part.u)
            u = np.insert(part.u, place, corner.u, axis=0)
            tangents = np.insert(part.tangents, place, part.tangents[end], axis=0)
            return BranchSegment(part.region, u, tangents)
    return part


def _contains_equilibrium(
    field: FrozenField, branch: Branch, start: Equilibrium, value: float, window: Window
) -> bool:
    """Return whether a branch contains an equilibrium."""
    if branch.admissible != start.admissible:
        return False
    rows = np.column_stack([branch.state, branch.values])
    if not field.periods.any():
        return _contains(field, branch, rows, np.append(start.state, value), window)
    low, high = branch.state.min(axis=0), branch.state.max(axis=0)
    ways = [copies(*entry) for entry in zip(start.state, low, high, field.periods, strict=True)]
    return any(
        _contains(field, branch, rows, np.array([*s, value]), window) for s in product(*ways)
    )


def _contains(field: FrozenField, branch: Branch, rows: Array, u: Array, window: Window) -> bool:
    """Return whether a branch contains a point."""
    if len(rows) < 2:
        # where the equations are singular along a line, one of its points is sufficient
        apart = np.abs((rows[0] - u) / window.scale)
        return bool(apart[:-1].max() < 1e-6)
    # the distance of rows grows with the distance from the origin
    scale = window.scale.copy()
    scale[:-1] = np.maximum(scale[:-1], FAR_UNIT * np.abs(u[:-1]))
    chords, apart = np.empty(len(rows) - 1, dtype=np.int64), np.empty(len(rows) - 1)
    for k in chords[: loop("nearby_chords")(writeable(rows), scale, u, 1e-2, chords, apart)]:
        chord = (rows[k + 1] - rows[k]) / scale
        length = max(float(chord @ chord), 1e-300)
        part = float(np.clip(((u - rows[k]) / scale) @ chord / length, 0.0, 1.0))
        near = rows[k] + part * (rows[k + 1] - rows[k])
        normal = chord / np.sqrt(length) / scale
        region = field.regions.index(str(branch.region[k]))
        # in units of the point, so that Newton's last corrections far away are rounding errors
        found = field.refined(region, near, scale, normal=normal, point=u)
        if found.converged and np.abs((found.u - u) / scale).max() < 1e-6:
            return True
    return False


def _labelled(
    branches: list[Branch], name: str, window: Window, corrector: _Corrector
) -> tuple[Branch, ...]:
    """Return the branches with their corrector and labelled special points.

    Labels LP1, LP2, … are in order along the branches; a shared branch point has one label.
    """

    def near(one: SpecialPoint, other: SpecialPoint) -> bool:
        here, there = (np.append(p.state, p.parameters[name]) for p in (one, other))
        periods = np.append(periods_of(one.states, branches[0].periods), 0.0)
        away = np.abs(apart(here, there, periods))
        return bool(np.all(away <= 1e-7 * np.maximum(window.scale, np.abs(here))))

    counts: dict[str, int] = {}
    shared: list[SpecialPoint] = []
    done = []
    for branch in branches:
        points = []
        for point in branch.special:
            known = next((s for s in shared if point.kind.branching and near(s, point)), None)
            if known is None:
                counts[point.stem] = counts.get(point.stem, 0) + 1
            label = known.label if known else f"{point.stem}{counts[point.stem]}"
            points.append(replace(point, label=label))
            if point.kind.branching:
                shared.append(points[-1])
        done.append(replace(branch, special=SpecialPoints(points), corrector=corrector))
    return tuple(done)


@dataclass(frozen=True, eq=False)
class _Corrector:
    """A `Corrector` that uses the equations of a field."""

    field: FrozenField

    @property
    def stored(self) -> StoredModel:
        """The model as stored with a diagram, with the data for tracing its branches."""
        source, model = self.field.source, self.field.model
        if isinstance(source, StoredFrozen):
            return source.model
        stored: StoredModel = model.stored
        return replace(stored, field=source.stored())

    def __call__(self, region: str, state: Array, value: float, /) -> Equilibrium | None:
        field = self.field
        number = field.regions.index(region)
        solved = corrections(field)[number].corrected(state, value)
        if solved is None:
            return None
        u = np.append(solved, value)
        return point_at(field, number, u, field.admissible(number, u))

    def many(
        self, region: str, states: Array, values: Array, /
    ) -> tuple[Array, NDArray[np.complex128]]:
        field = self.field
        number = field.regions.index(region)
        solved = corrections(field)[number].corrected_many(states, values)
        found = np.full(solved.shape, np.nan, dtype=complex)
        known = ~np.isnan(solved).any(axis=1)
        if known.any():
            found[known] = field.eigenvalues(
                number, np.column_stack([solved[known], values[known]])
            )
        return field.wrapped(solved), found
