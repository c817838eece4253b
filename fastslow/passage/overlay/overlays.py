"""Overlay of a trajectory and a diagram: stable branches followed, and transitions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fastslow.arguments import Name, finite, formula, instance, validated
from fastslow.errors import ArgumentError, refuse_switches, unknown_name
from fastslow.passage.overlay.agreement import (
    require_one_model,
    require_same_values,
    require_same_walls,
)
from fastslow.passage.overlay.attracting_branches import arcs_of
from fastslow.passage.overlay.bursting import Burst, bursting_of
from fastslow.passage.overlay.cycle_ends import cycle_end, ending, slowly
from fastslow.passage.overlay.excursions import (
    Excursion,
    excursions_of,
    oscillation_of,
    switching_of,
)
from fastslow.passage.overlay.following import episodes_of, measured, stable_branches_at
from fastslow.passage.overlay.lags import distances_and_lags
from fastslow.passage.overlay.orbit_overlays import overlay_of_orbits
from fastslow.passage.overlay.outcomes import held_quantity, outcome_of
from fastslow.passage.overlay.overlaid_arcs import Away, phases_along
from fastslow.passage.overlay.predictions import with_laws
from fastslow.passage.overlay.spikes import extrema_of, refined
from fastslow.passage.overlay.sticking import along_edges, bands_at, with_sticking
from fastslow.passage.overlay.traced_cycles import TracedEnd
from fastslow.passage.overlay.transitions import OverlaidRun
from fastslow.passage.slow_quantities import JUMP_DURATION, slow_quantity
from fastslow.results.base.outcome import with_notes
from fastslow.results.branch.diagram import Diagram
from fastslow.results.orbits.orbit_branch import OrbitBranch, branches_of_orbits
from fastslow.results.overlay.overlay import Overlay
from fastslow.results.overlay.transitions import Phase, Phases, Transition, Transitions
from fastslow.results.trajectory.queries.state_at import StatePoint
from fastslow.results.trajectory.trajectory import Trajectory

Array = NDArray[np.float64]

#: Relative prominence below which an extremum of the slow quantity is ignored.
SLOW_WIGGLE = 0.02


def _diagram_or_orbits(name: str, value: Any) -> Any:
    """Accept a diagram, a branch of orbits, or a sequence of such branches."""
    if isinstance(value, tuple | list):
        return branches_of_orbits(name, value)
    return instance(Diagram, OrbitBranch)(name, value)


@validated(
    diagram=_diagram_or_orbits,
    run=instance(Trajectory),
    radius=finite,
    observed=formula,
    cycles=branches_of_orbits,
)
def overlay(
    diagram: Diagram | OrbitBranch | Sequence[OrbitBranch],
    run: Trajectory,
    *,
    radius: float = 0.1,
    observed: Name | None = None,
    cycles: OrbitBranch | Sequence[OrbitBranch] = (),
) -> Overlay:
    """Compare a trajectory with the equilibria, or the periodic orbits, of its frozen model.

    A stable branch is followed from the time at which the state is near it for at least half a
    relaxation time, up to the time at which the state is no longer near, or has covered two
    thirds of the distance to another stable branch. Nearness refers to the distance from the
    branch as a curve over the slow quantity, so that a lag along a steep branch does not
    count as a departure. Stable branches that join at a boundary equilibrium are treated as
    one, so that a persistent equilibrium is followed across the interface, and from contact with
    the wall of a reset to lift-off; past a Hopf point
    the unstable branch is followed while the state remains near it (delayed loss of
    stability), past a fold the fold point. The interval between two such episodes is a jump
    or, with at least two oscillations, an oscillating phase.

    A frozen model with fast periodic terms, ``model.frozen(fast=[...])``, has periodic orbits in
    place of equilibria. Their branches are compared with the states of the run at whole periods
    of the fast forcing.

    Parameters
    ----------
    diagram : Diagram, OrbitBranch or sequence of OrbitBranch
        Diagram over the slow quantity of the run, or over the parameter of a path
        along which the model was frozen; or branches of forced orbits over it.
    run : Trajectory
        Trajectory of the full model.
    radius : float
        Distance that counts as near, with each state in units of its extent.
    observed : str or Symbol, optional
        State whose maxima are counted, by default the first that is not periodic;
        for a periodic one the maxima of its sine. Not for orbits.
    cycles : OrbitBranch or sequence of OrbitBranch, optional
        Cycles of the frozen model from `continue_cycles`, or from `continue_orbits` over the
        same parameter. Their special points name the ends of oscillations. Not for orbits.

    Returns
    -------
    Overlay

    Raises
    ------
    UnknownNameError
        If the diagram's parameter is no slow quantity of the run, or a state is missing.
    ArgumentError
        If diagram and run belong to different models or parameter values, the run leaves
        the path along which the model was frozen or has no samples, the radius is not
        between 0 and 1, or orbits have no constant period of a forcing; if ``cycles`` are those
        of a forced model, over another parameter, or given with orbits.

    See Also
    --------
    fastslow.continue_equilibria, fastslow.simulate, fastslow.predict_delay,
    fastslow.plot.overlay, fastslow.plot.panel

    Examples
    --------
    >>> import fastslow as fs
    >>> model = fs.systems.cusp(omega=0.002)
    >>> diagram = fs.continue_equilibria(model.frozen(), "p", over=(-1.2, 1.2))
    >>> overlay = fs.overlay(diagram, fs.simulate(model, [-1.0], periods=2))
    >>> [(t.type, t.from_branch, t.to_branch) for t in overlay.transitions[:2]]
    [('jump', 'S1.1', 'S1.2'), ('jump', 'S1.2', 'S1.1')]
    >>> print(overlay.bursting)
    relaxation oscillation (symmetric fold/fold)
    """
    if not 0.0 < radius < 1.0:
        raise ArgumentError(f"radius = {radius:g}; expected a number between 0 and 1")
    if not isinstance(diagram, Diagram):
        branches = (diagram,) if isinstance(diagram, OrbitBranch) else tuple(diagram)
        if observed is not None:
            raise ArgumentError(
                "observed= is the state whose maxima are counted over equilibria; periodic orbits "
                "are compared at one phase of the forcing"
            )
        if cycles:
            raise ArgumentError("cycles= belong to a diagram of equilibria; received orbits")
        refuse_switches(run.switch_names, "an overlay of orbits")
        return overlay_of_orbits(branches, run, radius)
    require_same_walls(diagram, run)
    state_number = _checked(diagram, run, observed)
    return _overlay_of_equilibria(
        diagram, run, radius, state_number, _traced(diagram, run, tuple(cycles))
    )


def _overlay_of_equilibria(
    diagram: Diagram,
    run: Trajectory,
    radius: float,
    state_number: int,
    traced: tuple[OrbitBranch, ...],
) -> Overlay:
    """Overlay of a run and a diagram, with a state whose maxima are counted."""
    compared = require_one_model(diagram, run)
    slow = slow_quantity(diagram, run)
    stable_branches, arcs = arcs_of(diagram)
    m = measured(slow, arcs, diagram.over, radius)
    episodes = episodes_of(m)
    p = OverlaidRun(diagram, slow, m, stable_branches, stable_branches_at(m, episodes), traced)
    swings = oscillation_of(m, state_number), switching_of(run, diagram.states[state_number])
    cycles = _Cycles(p)
    along = phases_along(p, episodes, excursions_of(m, episodes, *swings), cycles.closed)
    phases, followed = along.phases, p.followed.copy()
    for excursion, last in along.ends:
        _divide_jump(p, excursion, last.time, followed)
    transitions = [t for t in along.transitions if not _relaxes(p, t)]
    held = held_quantity(diagram, run)
    arc_of = np.full(len(stable_branches) + 1, -1)
    for number, arc in enumerate(arcs):
        arc_of[list(arc.stable_branches)] = number
    distance, lag, relaxation = distances_and_lags(m, arc_of[followed], _jumping(p, phases))
    rests = bands_at(diagram, run, m.slow, m.extent)
    band, away = along_edges(diagram, run, m.slow, rests, m.extent, radius)
    band[(rests < 0) & (followed >= 0)] = -1
    followed[rests >= 0], lag[rests >= 0] = -1, np.nan
    distance = np.where(band >= 0, away, distance)
    return Overlay(
        diagram=diagram,
        run=run,
        t=m.t,
        slow=m.slow,
        state=np.column_stack([run[name] for name in diagram.states]),
        extent=m.extent,
        radius=radius,
        stable_branches=stable_branches,
        followed=followed,
        distance=distance,
        lag=lag,
        relaxation=relaxation,
        phases=Phases(
            with_sticking([q for q in phases if q.end > q.start], diagram, run, rests, band)
        ),
        transitions=Transitions(
            with_laws(p, transitions) if held is None else map(_elsewhere, transitions)
        ),
        bursting=bursting_of(cycles.bursts, transitions),
        turning=_turning(p),
        outcome=with_notes(outcome_of(diagram, run, slow.table, compared, "equilibria"), _jumps(p)),
        band=band,
        cycles=traced,
    )


@dataclass(frozen=True, eq=False)
class _Cycles:
    """The ends of oscillations on cycles, and bursts.

    Parameters
    ----------
    p : OverlaidRun
    bursts : list of Burst
        Filled.
    """

    p: OverlaidRun
    bursts: list[Burst] = field(default_factory=list)
    known: dict[tuple[str, str], TracedEnd | None] = field(default_factory=dict)

    def closed(self, away: Away) -> list[Transition]:
        e, closing = away.excursion, None
        if e.cycle and e.new is not None and not away.outside:
            closing = cycle_end(self.p, e, self.known)
        complete = e.new is not None and away.phase.type == "oscillating"
        if away.first is not None and complete and slowly(self.p, e):
            self.bursts.append(Burst(away.phase, away.first, closing))
        return [] if closing is None else [ending(self.p, e, closing)]


def _traced(diagram: Diagram, run: Trajectory, cycles: Sequence[Any]) -> tuple[OrbitBranch, ...]:
    """Check the cycles against the diagram and the run."""
    for branch in cycles:
        if branch.multiple is not None or branch.parameter != diagram.parameter:
            kind = "a forced" if branch.multiple is not None else "an autonomous"
            raise ArgumentError(
                f"cycles: a branch of orbits of {kind} model over {branch.parameter}; expected "
                f"cycles of the frozen model over {diagram.parameter}, as from continue_cycles"
            )
        if branch.states != diagram.states:
            raise ArgumentError(
                f"cycles: a branch with the states {', '.join(branch.states)}; the diagram has the "
                f"states {', '.join(diagram.states)}"
            )
        require_same_values(branch, run)
    return tuple(cycles)


def _checked(diagram: Diagram, run: Trajectory, observed: object) -> int:
    """Check the arguments against each other; return the index of the observed state."""
    require_same_values(diagram, run)
    if not len(run.t):
        raise ArgumentError("the trajectory has no samples; simulate with dense=True or samples=")
    plain = [n for n in diagram.states if n not in run.periods]
    name = [*plain, *diagram.states][0] if observed is None else str(observed)
    if name not in diagram.states:
        raise unknown_name("state", name, diagram.states)
    return diagram.states.index(name)


def _relaxes(p: OverlaidRun, t: Transition) -> bool:
    """Whether the run leaves its branch by a jump of the slow quantity alone, and returns."""
    if t.type != "excursion" or t.special is not None:
        return False
    near = np.abs(p.m.t[p.m.jumps] - t.leave.time) <= JUMP_DURATION * (p.m.t[-1] - p.m.t[0])
    return bool(near.any())


def _jumps(p: OverlaidRun) -> list[str]:
    """A note on the jumps of the slow quantity."""
    together = np.diff(p.m.t) <= JUMP_DURATION * (p.m.t[-1] - p.m.t[0])
    count = int((p.m.jumps[:-1] & p.m.jumps[1:] & together).sum())
    if not count:
        return []
    times = f"{count} times" if count > 1 else "once"
    return [
        f"{p.slow.name} jumps {times} in the run, where it has no rate; relaxation to the same "
        "branch after a jump is no transition."
    ]


def _divide_jump(p: OverlaidRun, e: Excursion, time: float, followed: NDArray[np.intp]) -> None:
    """Assign the samples of a jump to the old branch before a time, else to the new."""
    if e.old is None or e.new is None or e.cycle:
        return
    start, stop = e.rows(p.m)
    rows = np.arange(start, stop)
    old = p.m.t[rows] < time
    followed[rows] = np.where(old, p.followed[start - 1], p.followed[e.new.start])


def _elsewhere(t: Transition) -> Transition:
    """Remove the delay where another slow quantity has moved the special point."""
    return replace(t, delay=float("nan"))


def _jumping(p: OverlaidRun, phases: list[Phase]) -> NDArray[np.bool_]:
    """Samples outside all quasi-static phases, shape (N,)."""
    away = np.zeros(len(p.m.t), dtype=bool)
    for phase in phases:
        if phase.type != "quasi-static":
            away |= (p.m.t > phase.start) & (p.m.t < phase.end)
    return away


def _turning(p: OverlaidRun) -> tuple[StatePoint, ...]:
    slow, time = p.m.slow, p.m.t
    reach = float(np.ptp(slow))
    if len(slow) < 3 or reach <= 1e-9 * float(np.abs(slow).max()):
        return ()
    turns = extrema_of(slow, SLOW_WIGGLE * reach)
    return tuple(p.state_at(float(t)) for t in refined(time, slow, turns.rows))
