"""Continuation of periodic orbits in one parameter, across changes of their itinerary."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fastslow.arguments import (
    Name,
    either,
    finite,
    formula,
    instance,
    interval,
    items,
    mapping,
    validated,
)
from fastslow.continuation import curves
from fastslow.continuation.directions import both_ways
from fastslow.continuation.settings import Continuation
from fastslow.errors import ArgumentError
from fastslow.formulas.definitions import with_definitions_in
from fastslow.model.model import Model
from fastslow.orbits.endings import HOPF_POINT
from fastslow.orbits.find.finding import find_orbit
from fastslow.orbits.find.orbit_curve import CurveSystem, OrbitCurve, Row
from fastslow.orbits.flow.events import OrbitError
from fastslow.orbits.flow.forming import motions_beside, with_formed_motions
from fastslow.orbits.flow.problem import FINE, OrbitProblem
from fastslow.orbits.flow.segments import segments_of, winding_of
from fastslow.orbits.flow.shooting import Shooting, sizes_of
from fastslow.orbits.points.marks import OrbitNames, read_orbit_marks
from fastslow.orbits.trace.branch_assembly import Marks, assembled
from fastslow.orbits.trace.restarts import early
from fastslow.orbits.trace.tracer import Tracer
from fastslow.results.base.outcome import Outcome
from fastslow.results.orbits.orbit import Orbit
from fastslow.results.orbits.orbit_arrays import OrbitArrays
from fastslow.results.orbits.orbit_branch import OrbitBranch, branch_of
from fastslow.results.points import SpecialPoint
from fastslow.simulation.one import simulate
from fastslow.simulation.settings import Integration, integration_settings

Array = NDArray[np.float64]


@validated(
    orbit=instance(Orbit),
    parameter=formula,
    over=interval,
    continuation=instance(Continuation),
    integration=integration_settings,
    marks=either(mapping, items(finite)),
)
def continue_orbits(
    orbit: Orbit,
    parameter: Name,
    over: tuple[float, float],
    *,
    continuation: Continuation | None = None,
    integration: Integration | None = None,
    marks: Sequence[float] | Mapping[Any, Any] = (),
) -> OrbitBranch:
    """Trace the branch of a periodic orbit in both directions of a parameter.

    Pseudo-arclength continuation of the equations of multiple shooting, through folds. Every
    orbit is confirmed by a free run. Where the orbit touches an interface, the contact is solved
    for and the branch continues with the itinerary beyond it, forwards or backwards in the
    parameter; so at a wall, where the speed of an impact vanishes, and at a corner collision, CC,
    where two events, or an event and an instant of a clock, exchange their order. A branch of
    cycles ends at a homoclinic orbit, HC, which is solved for without resets, extrapolated with
    resets, and not recognised with switches.

    Parameters
    ----------
    orbit : Orbit
        From `find_orbit`.
    parameter : str or Symbol
        Any parameter, the frequency of the forcing included.
    over : (float, float)
        Range of the parameter; it contains its value at the orbit.
    continuation : Continuation, optional
    integration : Integration, optional
        Settings of the free runs; by default ``rtol=1e-13``.
    marks : sequence of float, or mapping
        Values of the parameter for rows of their own. In a mapping of names to expressions, such
        as ``{"level": "max(x) - 2*a"}``, the zeros of each expression are special points labelled
        level1, level2, …; values are then given by the name of the parameter. An expression is in
        parameters, ``period``, the functionals min, max, mean and rms of columns or of
        expressions in them, and ``abs(multiplier_1)``, ``re(multiplier_1)``,
        ``im(multiplier_1)`` of the multipliers in the order of `Orbit`.

    Returns
    -------
    OrbitBranch
        Of one row for an orbit that was not found, or is not solved for with the parameter among
        the unknowns; its outcome states the reason.

    Raises
    ------
    ArgumentError
        For an orbit outside the range, for a mark outside it or whose name is that of a column or
        a code, or with forcing frequencies that are incommensurable at
        other values of the parameter.
    UnknownNameError
        For an unknown parameter, or an unknown name in an expression.

    See Also
    --------
    fastslow.find_orbit, fastslow.continue_cycles, fastslow.plot.response

    Examples
    --------
    >>> import sympy as sp, fastslow as fs
    >>> x, v, c, w, t = sp.symbols("x v c w t")
    >>> linear = fs.Model({x: v, v: sp.cos(w * t) - x - c * v}, parameters={c: 0.1, w: 1})
    >>> branch = fs.continue_orbits(fs.find_orbit(linear, [0, 0]), "w", over=(0.5, 2))
    >>> round(float(branch["max(x)"].max()), 4)  # the resonance: 1/(c sqrt(1 - c**2/4))
    10.0125
    """
    name = str(parameter)
    model = orbit.model
    if not isinstance(model, Model):
        raise ArgumentError(
            "the orbit is loaded from a file without its equations in SymPy; find it again with "
            "find_orbit(model, orbit)"
        )
    settings = continuation or Continuation()
    if not model.structure.formed:
        return _traced(orbit, name, over, settings, integration, marks)

    def of_motions(restricted: Model) -> OrbitBranch:
        near = orbit
        if restricted != model:
            span = orbit.t0, orbit.t0 + orbit.period
            start = orbit.trajectory(orbit.t0)
            run = simulate(restricted, start, t=span, integration=integration or FINE)
            multiple = orbit.multiple or 1
            near = find_orbit(restricted, run, multiple=multiple, integration=integration)
        return _traced(near, name, over, settings, integration, marks)

    return with_formed_motions(model, motions_beside(model, orbit.trajectory), of_motions)


def _traced(
    orbit: Orbit,
    name: str,
    over: tuple[float, float],
    settings: Continuation,
    integration: Integration | None,
    marks: Sequence[float] | Mapping[Any, Any],
) -> OrbitBranch:
    """Trace the branch of an orbit, whose model is not loaded from a file."""
    (low, high), model = over, orbit.model
    problem = OrbitProblem.of(model, orbit.multiple or 1, None, integration, (name,))
    value = model.parameters[name]
    if not low <= value <= high:
        raise ArgumentError(
            f"the orbit is at {name} = {value:g}, outside over = ({low:g}, {high:g})"
        )
    marks = with_definitions_in(marks, orbit.trajectory.definitions)
    wanted = read_orbit_marks(marks, OrbitNames.of(orbit), {name: (low, high)})
    if not orbit.outcome:
        return single_row(orbit, name, orbit.outcome)
    try:
        first, along, curve = _beginning(problem, orbit, over)
    except OrbitError as error:
        return single_row(orbit, name, error.outcome)
    along = along if along[-1] >= 0 else -along

    def trace(sign: float, other: Tracer | None) -> Tracer:
        tracer = Tracer(curve, settings, before=[] if other is None else other.rows[:0:-1])
        tracer.trace(first, sign * along)
        return tracer

    def joined(back: Tracer | None, ahead: Tracer) -> OrbitBranch:
        rows = [] if back is None else [replace(row, slope=-row.slope) for row in back.rows[:0:-1]]
        ends = (ahead if back is None else back).outcome, ahead.outcome
        return assembled(curve, settings, wanted, [*rows, *ahead.rows], ends, back is None)

    return both_ways(trace, joined)


def branch_away(
    problem: OrbitProblem,
    orbit: Orbit,
    over: tuple[float, float],
    settings: Continuation,
    point: SpecialPoint,
    marks: Marks = (),
) -> OrbitBranch:
    """Trace the branch of a small cycle in the direction in which it leaves a Hopf point.

    Parameters
    ----------
    problem : OrbitProblem
        With the parameter chosen.
    orbit : Orbit
        From `find_orbit`.
    over : (float, float)
    settings : Continuation
    point : SpecialPoint
    marks : tuple
    """
    try:
        first, along, curve = _beginning(problem, orbit, over)
    except OrbitError as error:
        return single_row(orbit, problem.variations.chosen[0], error.outcome)
    n = problem.variations.n
    states = orbit.trajectory.sampled_columns[:n].T
    outwards = (first.u[:n] - np.array(point.state)) / sizes_of(states, states) ** 2
    tracer = Tracer(curve, settings)
    tracer.trace(first, along if along[:n] @ outwards > 0 else -along)
    ends = HOPF_POINT.at(how=f"emanate from {point.label}"), tracer.outcome
    return assembled(curve, settings, marks, tracer.rows, ends, tracer.closed)


def single_row(orbit: Orbit, name: str, outcome: Outcome) -> OrbitBranch:
    """The branch of one orbit that states why it was not traced."""
    row = OrbitArrays.of(orbit, orbit, name)
    return branch_of([row], [None], (outcome, outcome), False, None)


def _beginning(
    problem: OrbitProblem, orbit: Orbit, over: tuple[float, float]
) -> tuple[Row, Array, OrbitCurve]:
    """The first row of a branch, its tangent, and the curve."""
    shooting, u, found = _first_orbit(problem, orbit)
    curve = OrbitCurve(problem, problem.variations.chosen[0], over, found)
    first = curve.row(shooting, u, found, 0.0, None)
    frame = curve.frame(shooting, u, found.trajectory)
    return first, curves.tangent(CurveSystem(shooting), u, frame), curve


def _first_orbit(problem: OrbitProblem, orbit: Orbit) -> tuple[Shooting, Array, Orbit]:
    """Solve for the orbit with the parameter among the unknowns."""
    run, period = orbit.trajectory, orbit.period
    winding = winding_of(run, orbit.t0, period)
    parts = problem.variations, problem.parameters
    segments = segments_of(run, orbit.t0, period, winding, *parts)
    shooting, solution = problem.solve(segments, period, winding, run)
    shooting = replace(shooting, form=early(shooting.form, period, problem))
    solved_segments, length = shooting.unpack(solution.u)
    found = problem.orbit(solved_segments, length, solution)
    if not found.outcome:
        raise OrbitError(found.outcome)
    return shooting, solution.u, found
