"""Cycles of a frozen model: branches from the Hopf points of its diagram.

A planar focus that changes its stability across an interface has the trace zero at one q in
(0, 1) on the path between its Jacobians; cycles emanate from the boundary equilibrium in
proportion to the distance of the parameter (di Bernardo and others 2008, section 5.1). If the
equilibrium is a node on one side, a large cycle appears (a super-explosion; Desroches and others
2013).

References
----------
M. Desroches, E. Freire, S. J. Hogan, E. Ponce and P. Thota, Canards in piecewise-linear systems:
explosions and super-explosions, Proceedings of the Royal Society A 469, 20120603, 2013.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from fastslow.arguments import either, finite, instance, items, mapping, validated
from fastslow.continuation.marks import ValueMark
from fastslow.continuation.settings import Continuation
from fastslow.errors import ArgumentError
from fastslow.formulas.definitions import with_definitions_in
from fastslow.model.model import Model
from fastslow.orbits.endings import (
    BOUNDARY_EQUILIBRIUM,
    BOUNDARY_EQUILIBRIUM_ON_CYCLE,
    CYCLES_SHRINK,
    HOPF_POINT,
)
from fastslow.orbits.find.finding import find_orbit, unsolved
from fastslow.orbits.flow.problem import OrbitProblem
from fastslow.orbits.points.marks import OrbitMark, OrbitNames, read_orbit_marks
from fastslow.orbits.trace.branches import branch_away, continue_orbits, single_row
from fastslow.results.base.outcome import Outcome
from fastslow.results.branch.diagram import Diagram
from fastslow.results.orbits.orbit import Orbit
from fastslow.results.orbits.orbit_branch import OrbitBranch
from fastslow.results.orbits.special_orbit import SpecialOrbits
from fastslow.results.points import SpecialPoint
from fastslow.simulation.settings import Integration, integration_settings

#: Difference of the period and of the parameter, relative to the period and the range, between
#: the end of a branch and the Hopf point at which it ends.
NEAR_HOPF = 1e-2

#: The same where the branch has not located the point itself: cycles of a small amplitude r differ
#: from those of the point by r².
AT_HOPF = 1e-4

#: Distances from a boundary equilibrium, as fractions of the range, at which a cycle is sought in
#: order of trial; and at which a branch that ends there may stop.
BOUNDARY_DISTANCES, ENDS = (1e-2, -1e-2), 5e-2


@validated(
    diagram=instance(Diagram),
    continuation=instance(Continuation),
    integration=integration_settings,
    marks=either(mapping, items(finite)),
)
def continue_cycles(
    diagram: Diagram,
    *,
    continuation: Continuation | None = None,
    integration: Integration | None = None,
    marks: Sequence[float] | Mapping[Any, Any] = (),
) -> tuple[OrbitBranch, ...]:
    """Trace the cycles of a frozen model from the Hopf points of its diagram.

    Each branch is traced from a Hopf point in the direction in which the cycles grow, through
    folds, to a homoclinic orbit, another Hopf point or the end of the range. At a boundary
    equilibrium with Clarke-Hopf, a stable cycle is sought beside it, whose branch is traced in
    both directions. `overlay` and ``plot.diagram`` accept the branches as ``cycles=``.

    Parameters
    ----------
    diagram : Diagram
    continuation : Continuation, optional
    integration : Integration, optional
        Settings of the free runs; by default ``rtol=1e-13``.
    marks : sequence of float, or mapping
        Values of the parameter for rows of their own, and names to expressions such as
        ``{"level": "max(x) - 2"}`` whose zeros are special points, as in `continue_orbits`.

    Returns
    -------
    tuple of OrbitBranch
        One for each Hopf point and boundary equilibrium with Clarke-Hopf, except those at which
        another branch ends; none without such points. Where no cycle was found, it has one row,
        and its outcome states the reason.

    Raises
    ------
    ArgumentError
        For a diagram loaded from a file, or along a path; for a mark outside the range or whose
        name is that of a column or a code.
    UnknownNameError
        For an unknown name in an expression.

    See Also
    --------
    fastslow.continue_orbits, fastslow.find_orbit, fastslow.plot.diagram

    Examples
    --------
    >>> import fastslow as fs
    >>> model = fs.systems.van_der_pol()
    >>> diagram = fs.continue_equilibria(model.frozen(), "w", over=(-2, 2))
    >>> (cycles,) = fs.continue_cycles(diagram)  # from HB1 to HB2
    >>> round(float(cycles["max(x) - min(x)"].max()), 4)
    4.0172
    """
    if diagram.path:
        raise ArgumentError(
            f"the diagram is along a path over {diagram.parameter}; expected a diagram over a "
            "slow quantity or a parameter of the model"
        )
    found: list[OrbitBranch] = []
    settings = continuation or Continuation()
    names = (*diagram.parameters, diagram.parameter), diagram.states, len(diagram.states)
    marks = with_definitions_in(marks, diagram.definitions)
    wanted = read_orbit_marks(marks, OrbitNames(*names), {diagram.parameter: diagram.over})
    for point in diagram.special:
        found = [_shrinking_to(branch, point) for branch in found]
        if point.kind.starts_cycles and not any(_ends_at(branch, point) for branch in found):
            found.append(_cycles_from(diagram, point, settings, integration, wanted))
        changes = point.clarke is not None and point.clarke.q_hopf is not None
        if changes and not any(_ends_at_boundary(one, point, diagram.over) for one in found):
            found.append(_cycles_beside(diagram, point, settings, integration, marks))
    return _numbered(found)


def _numbered(branches: list[OrbitBranch]) -> tuple[OrbitBranch, ...]:
    """The branches, with labels of special points that are unique among them."""
    numbers: dict[str, int] = {}
    found = []
    for branch in branches:
        points = []
        for point in branch.special:
            numbers[point.stem] = numbers.get(point.stem, 0) + 1
            points.append(replace(point, label=f"{point.stem}{numbers[point.stem]}"))
        found.append(replace(branch, special=SpecialOrbits(points)))
    return tuple(found)


def _cycles_from(
    diagram: Diagram,
    point: SpecialPoint,
    settings: Continuation,
    integration: Integration | None,
    marks: tuple[ValueMark | OrbitMark, ...],
) -> OrbitBranch:
    """The branch of cycles from a Hopf point."""
    name = diagram.parameter
    orbit = find_orbit(_model_of(point), point, integration=integration)
    if not orbit.outcome:
        return single_row(orbit, name, orbit.outcome)
    problem = OrbitProblem.of(orbit.model, 1, None, integration, (name,))
    return branch_away(problem, orbit, diagram.over, settings, point, marks)


def _cycles_beside(
    diagram: Diagram,
    point: SpecialPoint,
    settings: Continuation,
    integration: Integration | None,
    marks: Sequence[float] | Mapping[Any, Any],
) -> OrbitBranch:
    """The branch of a stable cycle beside a boundary equilibrium."""
    name, (low, high) = diagram.parameter, diagram.over
    model = _model_of(point)
    orbits = []
    for share in BOUNDARY_DISTANCES:
        value = point[name] + share * (high - low)
        if low <= value <= high:
            near = model.with_parameters({name: value})
            orbit = _cycle_near(near, diagram, point, share, integration)
            if orbit.outcome:
                found: OrbitBranch = continue_orbits(
                    *(orbit, name, (low, high)),
                    continuation=settings,
                    integration=integration,
                    marks=marks,
                )
                return found
            orbits.append(orbit)
    return single_row(orbits[-1], name, orbits[-1].outcome)


def _cycle_near(
    model: Model,
    diagram: Diagram,
    point: SpecialPoint,
    share: float,
    integration: Integration | None,
) -> Orbit:
    """A stable cycle from the state of a boundary equilibrium, or from one beside it.

    If its interface alone moves with the parameter, the state remains an equilibrium.
    """
    columns = [np.concatenate([branch[s] for branch in diagram.branches]) for s in point.states]
    sizes = np.array([np.ptp(c) or np.abs(c).max() or 1.0 for c in columns])
    for moved in (0.0, share):
        state = np.asarray(point.state, dtype=float) + moved * sizes
        try:
            return find_orbit(model, state.tolist(), integration=integration)
        except ArgumentError as error:
            reason = Outcome("equilibrium", f"{error}.", False)
    return unsolved(model, state, reason, integration)


def _model_of(point: SpecialPoint) -> Model:
    """The model of a point, which a point from a file has not."""
    if point.source is None:
        raise ArgumentError(
            f"{point.label} of the diagram has no model (it was read from a file or another "
            "process); trace the diagram again with continue_equilibria"
        )
    model: Model = point.source.model
    return model


def _ends_at_boundary(branch: OrbitBranch, point: SpecialPoint, over: tuple[float, float]) -> bool:
    """Check whether a branch ends at a boundary equilibrium."""
    return any(
        outcome.code in (BOUNDARY_EQUILIBRIUM.code, BOUNDARY_EQUILIBRIUM_ON_CYCLE.code)
        and abs(branch.values[end] - point[branch.parameter]) <= ENDS * (over[1] - over[0])
        for end, outcome in zip((0, -1), branch.outcomes, strict=True)
    )


def _ends_at(branch: OrbitBranch, point: SpecialPoint) -> bool:
    """Check whether a branch ends at a Hopf point."""
    return branch.outcomes[-1].code == HOPF_POINT.code and _is_near(branch, point, NEAR_HOPF)


def _shrinking_to(branch: OrbitBranch, point: SpecialPoint) -> OrbitBranch:
    """Return a branch whose cycles shrink to a point, with the Hopf point that was located there.

    At its end rounding decides whether the branch locates the point itself.
    """
    shrinks = branch.outcomes[-1].code == CYCLES_SHRINK.code and point.kind.starts_cycles
    if not (shrinks and _is_near(branch, point, AT_HOPF)):
        return branch
    end = HOPF_POINT.at(how=f"shrink to {point.label}")
    return replace(branch, outcomes=(branch.outcomes[0], end))


def _is_near(branch: OrbitBranch, point: SpecialPoint, within: float) -> bool:
    """Check whether the last cycle has the parameter and the period of a Hopf point."""
    if point.frequency is None:
        return False
    low, high = branch.range
    period = 2.0 * np.pi / point.frequency
    near = abs(branch.values[-1] - point[branch.parameter]) <= within * (high - low)
    return bool(near and abs(branch.period[-1] - period) <= within * period)
