"""Maps of tracking and tipping, and of basin instability along a branch."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fastslow.arguments import Name, StateLike, formula, instance, mapping, validated
from fastslow.diagrams.trace.tracing import continue_equilibria
from fastslow.errors import ArgumentError, unknown_name
from fastslow.model.model import Model
from fastslow.passage.tipping.ends_of_shifts import UNDECIDED_END, FutureSystem, ShiftRuns
from fastslow.passage.tipping.shifts import WHOLE_SHIFT, Shift, shift_of
from fastslow.passage.tipping.tracked_branches import (
    SAME_EQUILIBRIUM,
    TrackedBranch,
    stable_start,
    tracked_branch,
)
from fastslow.results.base.intervals import runs_of
from fastslow.results.branch.diagram import Diagram
from fastslow.results.maps.adaptive_map import RefinedMap
from fastslow.results.points import Equilibrium
from fastslow.simulation.arguments import require_values
from fastslow.simulation.settings import EXECUTION, Execution, Integration, map_settings
from fastslow.sweeps.refinement import refined_map
from fastslow.sweeps.settings import REFINEMENT, Refinement, refinement_settings

Array = NDArray[np.float64]

#: Labels of the maps.
TRACK, TIP, RETURN = "track", "tip", "return"
INSIDE, OUTSIDE, NO_BRANCH = "inside", "outside", "no branch"

#: Error control of the runs of maps.
MAPPING = Integration(rtol=1e-11)

#: Values of the slow quantity at which runs are compared with the branch while it returns, as
#: fractions of its way from where the branch exists again to its limit.
RETURN_LEVELS = (1e-3, 0.01, 0.03, 0.1, 0.2, 0.35, 0.5, 0.7, 0.9)

#: Samples of a shift among which the times of these values are interpolated.
RETURN_SAMPLES = 4001


@validated(
    model=instance(Model),
    rate=formula,
    over=mapping,
    refinement=refinement_settings,
    execution=map_settings,
)
def tipping_map(
    model: Model,
    rate: Name,
    over: Mapping[Any, tuple[float, float]],
    *,
    branch: Equilibrium | StateLike | None = None,
    refinement: Refinement = REFINEMENT,
    execution: Execution = EXECUTION,
) -> RefinedMap:
    """Compute where a shift is tracked and where it tips, over its rate and another parameter.

    The labels are ``"track"`` where the run ends on the continuation of its branch, ``"tip"`` where
    it ends on another attractor or is unbounded, and ``"return"`` where a shift that comes back
    ends on its branch, although the run was outside its basin at one of nine values on the way
    back, the first of them where the branch exists again. A run that reaches no known attractor
    has failed, as in any map.

    Parameters
    ----------
    model : Model
        As for `critical_rate`.
    rate : str or Symbol
        A parameter of the forcing.
    over : mapping
        The rate and another parameter, each with its range.
    branch : Equilibrium, mapping or sequence, optional
        The stable equilibrium from which the shift starts, or a state near it.
    refinement : Refinement
        Cells of the first level, their refinement, and the resolution of boundaries.
    execution : Execution
        As in `refined_map`.

    Returns
    -------
    RefinedMap

    Raises
    ------
    ArgumentError
        As for `critical_rate`, and if the rate is not one of the two parameters.
    UnknownNameError
        For a name that is no parameter.

    See Also
    --------
    fastslow.critical_rate, fastslow.refined_map, fastslow.plot.tipping_map

    Examples
    --------
    >>> import sympy as sp, fastslow as fs
    >>> x, w, t, r, D = sp.symbols("x w t r D")
    >>> ramp = {w: sp.Min(r * t, D)}
    >>> model = fs.Model({x: sp.Abs(x + w) - 1}, forcing=ramp, parameters={r: 2, D: 2.7})
    >>> coarse = fs.Refinement(cells=(4, 4), levels=1)
    >>> plane = fs.tipping_map(model, "r", {"r": (1.2, 4), "D": (1, 4)}, refinement=coarse)
    >>> plane.at(r=1.5, D=2), plane.at(r=3, D=3.9)
    ('track', 'tip')
    """
    require_values(model)
    names = [str(key) for key in over]
    for name in names:
        if name not in model.parameters:
            raise unknown_name("parameter", name, model.parameters)
    if str(rate) not in names:
        raise ArgumentError(f"over = {', '.join(names)}; expected the rate {rate} among them")
    shift = shift_of(model, str(rate), model.parameters[str(rate)])
    start = stable_start(model.frozen(), shift.name, shift.past, branch, "branch")
    labels = _ShiftLabels(model, str(rate), tuple(names), tuple(start.state.tolist()))
    return refined_map(labels, over, refinement=refinement, execution=execution)


@dataclass(frozen=True)
class _ShiftLabels:
    """Function of the rate and another parameter for the labels of runs, in any process."""

    model: Model
    rate: str
    names: tuple[str, ...]
    start: tuple[float, ...]

    def __call__(self, *columns: Array) -> NDArray[Any]:
        place = self.names.index(self.rate)
        rates, others = columns[place], columns[1 - place]
        found = np.empty(len(rates), dtype=object)
        for value in np.unique(others).tolist():
            chosen = others == value
            model = self.model.with_parameters({self.names[1 - place]: value})
            found[chosen] = self._labels(model, rates[chosen])
        return found

    def _labels(self, model: Model, rates: Array) -> list[str | None]:
        shift, frozen = shift_of(model, self.rate, float(rates[0])), model.frozen()
        start = stable_start(frozen, shift.name, shift.past, list(self.start), "branch")
        diagram = continue_equilibria(frozen, shift.name, over=shift.extent)
        tracked = tracked_branch(frozen, diagram, start)
        there = frozen.with_parameters({shift.name: shift.future})
        future = FutureSystem.of(there, MAPPING)
        runs = ShiftRuns(model, self.rate, tracked, shift, MAPPING, future)
        goal, ends = future.index_of(tracked.point(shift.future)), runs.ends(rates)
        labels = np.where(ends == goal, TRACK, TIP).astype(object)
        if shift.returns and goal is not None and (ends == goal).any():
            tracking = np.flatnonzero(ends == goal)
            left, known = _left_meanwhile(runs, tracked, rates[tracking])
            labels[tracking[left]] = RETURN
            labels[tracking[~left & ~known]] = None
        labels[ends == UNDECIDED_END] = None
        return list(labels)


def _left_meanwhile(
    runs: ShiftRuns, tracked: TrackedBranch, rates: Array
) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Whether the run at each rate is outside the basin of its branch while the shift returns.

    With it, whether the attractor that is reached is known at all values.
    """
    shift = runs.shift
    low, high = shift.extent
    far = high if high - shift.future > shift.future - low else low
    first = float(np.clip(far, *tracked.extent))
    levels = first + (shift.future - first) * np.array(RETURN_LEVELS)
    shifts = [runs.shift_at(rate) for rate in rates.tolist()]
    spans = np.array([(runs.begin(one), runs.end(one)) for one in shifts])
    starts = np.array([runs.start(s, t) for s, t in zip(shifts, spans[:, 0], strict=True)])
    times = np.array([_times_back(one, levels, far) for one in shifts])
    states = runs.sampled(starts, spans, {runs.rate: rates}, times)
    left, decided = np.zeros(len(rates), dtype=bool), np.ones(len(rates), dtype=bool)
    for k, level in enumerate(levels.tolist()):
        point = tracked.point(level)
        if point is None:
            continue
        system = FutureSystem.of(tracked.frozen.with_parameters({shift.name: level}), MAPPING)
        known = np.isfinite(states[:, :, k]).all(axis=1)
        codes = np.zeros(int(known.sum()), dtype=np.int64)
        reached = system.reached(states[known, :, k], codes)
        decided[known] &= reached != UNDECIDED_END
        left[known] |= (reached != system.index_of(point)) & (reached != UNDECIDED_END)
    return left, decided


def _times_back(shift: Shift, levels: Array, far: float) -> Array:
    """Times at which a shift that returns passes values on its way back."""
    times = np.linspace(shift.began(WHOLE_SHIFT), shift.settled(WHOLE_SHIFT), RETURN_SAMPLES)
    values = shift.at(times)
    last = int(np.argmin(np.abs(values - far)))
    back = np.abs(values[last:] - far)
    return np.interp(np.abs(levels - far), np.maximum.accumulate(back), times[last:])


@validated(
    diagram=instance(Diagram),
    point=instance(Equilibrium),
    refinement=refinement_settings,
    execution=map_settings,
)
def basin_instability(
    diagram: Diagram,
    *,
    point: Equilibrium | None = None,
    refinement: Refinement = REFINEMENT,
    execution: Execution = EXECUTION,
) -> RefinedMap:
    """Compute the pairs of parameter values between which the basin of a stable branch is left.

    At a pair (p₁, p₂) with the label ``"outside"`` the stable state at p₁ is outside the basin of
    its continuation at p₂: a sudden change from p₁ to p₂ tips (O'Keeffe and Wieczorek 2020).
    Otherwise it is ``"inside"``, or ``"no branch"`` where the branch does not exist at one of them;
    a pair whose run reaches no known attractor has failed, as in any map.

    Parameters
    ----------
    diagram : Diagram
        Of a frozen model over one parameter, p.
    point : Equilibrium, optional
        A stable equilibrium of the branch; needed if the diagram has several stable branches.
    refinement : Refinement
        Cells of the first level, their refinement, and the resolution of the boundary.
    execution : Execution
        As in `refined_map`.

    Returns
    -------
    RefinedMap
        Over ``p_1`` and ``p_2``, named after the parameter; ``boundary("inside", "outside")`` is
        the boundary curve.

    Raises
    ------
    ArgumentError
        For a diagram without a model or without a stable branch, for several without ``point``, and
        for a point that is not stable.

    See Also
    --------
    fastslow.critical_rate, fastslow.tipping_map, fastslow.edge_state

    Examples
    --------
    >>> import sympy as sp, fastslow as fs
    >>> x, w = sp.symbols("x w")
    >>> frozen = fs.Model({x: (x + w) ** 2 - 1}, parameters={w: 0})
    >>> diagram = fs.continue_equilibria(frozen, "w", over=(0, 4))
    >>> coarse = fs.Refinement(cells=(5, 5), levels=1)
    >>> plane = fs.basin_instability(diagram, refinement=coarse)
    >>> plane.at(w_1=0.1, w_2=1), plane.at(w_1=0.1, w_2=3)
    ('inside', 'outside')
    """
    model = diagram.model
    if not isinstance(model, Model):
        raise ArgumentError(
            "this diagram has no model (it was read from a file); continue the equilibria again"
        )
    branch = _branch_of(model, diagram, point)
    names = f"{diagram.parameter}_1", f"{diagram.parameter}_2"
    over = dict.fromkeys(names, branch.extent)
    return refined_map(_PairLabels(branch), over, refinement=refinement, execution=execution)


def _branch_of(model: Model, diagram: Diagram, point: Equilibrium | None) -> TrackedBranch:
    name = diagram.parameter
    if point is not None:
        if not point.stable:
            raise ArgumentError(f"point: {point!r} is not stable")
        return tracked_branch(model, diagram, point)
    found: list[TrackedBranch] = []
    for branch in diagram.branches:
        for begin, end in runs_of(branch.stable):
            one = branch[(begin + end) // 2]
            if not any(_contains(known, one) for known in found):
                found.append(tracked_branch(model, diagram, one))
    if len(found) != 1:
        listed = "; ".join(f"{name} from {a:.6g} to {b:.6g}" for a, b in (f.extent for f in found))
        raise ArgumentError(
            f"the diagram has {len(found)} stable branches{': ' * bool(listed)}{listed}; give an "
            "equilibrium of one as point="
        )
    return found[0]


def _contains(branch: TrackedBranch, point: Equilibrium) -> bool:
    here = branch.point(point.parameters[branch.name])
    size = SAME_EQUILIBRIUM * (1.0 + float(np.abs(point.state).max()))
    return here is not None and float(np.abs(here.state - point.state).max()) < size


@dataclass(frozen=True, eq=False)
class _PairLabels:
    """Function of two values of the parameter for the labels of pairs."""

    branch: TrackedBranch

    def __call__(self, first: Array, second: Array) -> NDArray[Any]:
        branch, found = self.branch, np.full(len(first), NO_BRANCH, dtype=object)
        states = {v: branch.point(v) for v in np.unique(np.concatenate([first, second])).tolist()}
        for value in np.unique(second).tolist():
            point = states[value]
            if point is None:
                continue
            rows = [k for k in np.flatnonzero(second == value) if states[float(first[k])]]
            system = FutureSystem.of(branch.frozen.with_parameters({branch.name: value}), MAPPING)
            starts = np.array([states[float(first[k])].state for k in rows])  # type: ignore[union-attr]
            if rows:
                reached = system.reached(starts, np.zeros(len(rows), dtype=np.int64))
                labels = np.where(reached == system.index_of(point), INSIDE, OUTSIDE).astype(object)
                labels[reached == UNDECIDED_END] = None
                found[rows] = labels
        return found
