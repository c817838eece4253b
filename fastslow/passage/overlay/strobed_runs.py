"""Strobed states of a run, and their distances from arcs of periodic orbits."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fastslow.errors import ArgumentError
from fastslow.kernels.loops import load_loop
from fastslow.orbits.flow.forcing import SAME_PERIOD
from fastslow.passage.loops import BESIDE
from fastslow.passage.overlay.extents import of_moving
from fastslow.passage.overlay.following import Distances, Rows, resampled
from fastslow.passage.overlay.orbit_arcs import OrbitArc, ends_branch
from fastslow.passage.slow_quantities import rates_and_jumps
from fastslow.results.angles import nearest_copy, periods_of
from fastslow.results.branch.diagram import Diagram
from fastslow.results.orbits.orbit_branch import OrbitBranch
from fastslow.results.trajectory.trajectory import Trajectory

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

#: Relative rounding error of a time in periods.
TIME_ROUNDING = 1e-13


@dataclass(frozen=True, eq=False)
class FrozenOrbits:
    """The properties common to branches of orbits over one slow quantity.

    Parameters
    ----------
    diagram : Diagram
        Without branches, over the range of the orbits.
    covered : tuple of float
        This range, infinite where the orbits end at a special point and not at the range.
    period : float
        Of the forcing.
    multiple : int
        Number of these periods after which all orbits repeat.
    """

    diagram: Diagram
    covered: tuple[float, float]
    period: float
    multiple: int


@dataclass(frozen=True, eq=False)
class Strobed(Distances):
    """Distances of the strobed states of a run from arcs of orbits.

    Parameters
    ----------
    strobes : ndarray of int64, shape (N,)
        Numbers of the strobes, from time 0.
    """

    arcs: tuple[OrbitArc, ...]
    strobes: NDArray[np.int64]

    def beside(self, arc: int) -> Mask:
        one = self.arcs[arc]
        near = np.empty(len(self.t), dtype=bool)
        numbers = one.numbers(self.strobes)
        for number, states in enumerate(one.states):
            here = numbers == number
            curve = np.column_stack([states / self.extent, one.values / self.span])
            copies = nearest_copy(self.scaled[here], self.places[here, arc], self.periods)
            points = np.vstack([copies.T, self.slow[here] / self.span])
            found = np.empty(int(here.sum()), dtype=bool)
            load_loop(BESIDE)(points, resampled(curve), self.radius, found)
            near[here] = found
        return near

    def place(self, arc: int, rows: Rows, slow: Array) -> Array:
        return self.arcs[arc].at(self.strobes[rows], slow) / self.extent

    def slope(self, arc: int, rows: Rows) -> Array:
        return self.arcs[arc].slope(self.strobes[rows], self.slow[rows]) / self.extent


def common_properties(branches: Sequence[OrbitBranch]) -> FrozenOrbits:
    """The diagram over the parameter, and the period, that all branches share.

    Raises
    ------
    ArgumentError
        Without branches, for branches of different models or parameters, and for orbits
        without a constant period of a forcing.
    """
    if not branches:
        raise ArgumentError("diagram: expected branches of orbits, received none")
    first = branches[0]
    for branch in branches:
        if branch.multiple is None:
            raise ArgumentError(
                "the orbits are of an autonomous model, which has no phase at which a run is "
                "compared with them; expected orbits of model.frozen(fast=[...]), or the diagram "
                "of the equilibria of model.frozen() with these as cycles="
            )
        single = branch.period / branch.multiple
        if np.ptp(single) > SAME_PERIOD * single.max():
            raise ArgumentError(
                f"the period of the forcing varies along the branch, from {single.min():.6g} to "
                f"{single.max():.6g}; expected branches over a slow quantity"
            )
        same = (branch.parameter, branch.states, dict(branch.parameters), branch.equations)
        if same != (first.parameter, first.states, dict(first.parameters), first.equations):
            raise ArgumentError(
                "the branches differ in parameter, states, parameter values or equations; "
                "expected branches of one frozen model over one slow quantity"
            )
    assert first.multiple is not None
    over = min(b.range[0] for b in branches), max(b.range[1] for b in branches)
    path = getattr(first.template.model, "path", {})
    diagram = Diagram(
        states=first.states,
        parameter=first.parameter,
        over=over,
        parameters=dict(first.parameters),
        branches=(),
        completeness="found",
        interfaces=(),
        regions=(),
        interface_values={},
        equations=first.equations,
        path={name: str(law) for name, law in path.items()},
    )
    return FrozenOrbits(
        diagram,
        (_covered(branches, over[0], -np.inf), _covered(branches, over[1], np.inf)),
        float(first.period[0]) / first.multiple,
        math.lcm(*(branch.multiple or 1 for branch in branches)),
    )


def _covered(branches: Sequence[OrbitBranch], end: float, beyond: float) -> float:
    """An end of the range of branches, or infinity if it is a special point of orbits."""
    at = [
        point
        for branch in branches
        for point, row in zip(branch.special, branch.special_rows, strict=True)
        if branch.values[row] == end and ends_branch(point)
    ]
    return beyond if at else end


def strobes_of(run: Trajectory, period: float) -> NDArray[np.int64]:
    """Numbers of the whole periods within a run.

    Raises
    ------
    ArgumentError
        For less than three.
    """
    begin, end = (time / period for time in run.span)
    slack = TIME_ROUNDING * max(1.0, abs(begin), abs(end))
    strobes = np.arange(np.ceil(begin - slack), np.floor(end + slack) + 1)
    if len(strobes) < 3:
        raise ArgumentError(
            f"the trajectory contains {len(strobes)} whole multiples of the period of the fast "
            f"forcing, {period:.6g}; expected at least 3"
        )
    return strobes.astype(np.int64)


def measured_strobes(
    frozen: FrozenOrbits,
    run: Trajectory,
    arcs: tuple[OrbitArc, ...],
    rows: tuple[Array, NDArray[np.int64], Array, Array],
    radius: float,
) -> Strobed:
    """Distances of the strobes from all arcs, in units of the ranges of the states."""
    times, strobes, value, state = rows
    over, (low, high) = frozen.diagram.over, frozen.covered
    within = (value >= low) & (value <= high)
    places = np.empty((len(value), len(arcs), state.shape[1]))
    present = np.empty((len(value), len(arcs)), dtype=bool)
    extent = np.ptp(state, axis=0)
    for k, arc in enumerate(arcs):
        places[:, k] = arc.at(strobes, value)
        present[:, k] = arc.present(value) & within
        if present[:, k].any():
            extent = np.maximum(extent, np.ptp(places[present[:, k], k], axis=0))
    size = np.abs(state).max(axis=0)
    extent = of_moving(extent, size)
    periods = periods_of(frozen.diagram.states, run.periods)
    extent = np.where(periods > 0, np.minimum(extent, periods), extent)
    drift, jumps = rates_and_jumps(times, value)
    return Strobed(
        t=times,
        slow=value,
        strobes=strobes,
        scaled=state / extent,
        extent=extent,
        within=within,
        arcs=arcs,
        places=places / extent,
        present=present,
        span=max(float(np.ptp(value)), 1e-3 * (over[1] - over[0])) or 1.0,
        radius=radius,
        periods=periods / extent,
        drift=drift,
        jumps=jumps,
    )
