"""Phases and transitions of a run along the arcs of attractors that it follows."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from fastslow.passage.overlay.excursions import Excursion, phase_of
from fastslow.passage.overlay.following import Distances, Episode
from fastslow.passage.slow_quantities import SlowQuantity
from fastslow.results.branch.diagram import Diagram
from fastslow.results.overlay.transitions import Phase, StableBranch, Transition
from fastslow.results.trajectory.queries.state_at import StatePoint


@dataclass(frozen=True, eq=False)
class OverlaidArcs(ABC):
    """A run over arcs of attractors, which know what it means to pass, leave and reach them.

    Parameters
    ----------
    diagram : Diagram
    slow : SlowQuantity
    m : Distances
    stable_branches : tuple of StableBranch
    followed : ndarray of int, shape (N,)
        Stable branch at each row of an episode, the last one past its end; −1 elsewhere.
    """

    diagram: Diagram
    slow: SlowQuantity
    m: Distances
    stable_branches: tuple[StableBranch, ...]
    followed: NDArray[np.intp]

    @abstractmethod
    def within(self, episode: Episode) -> Iterable[Transition]:
        """Transitions without a departure, in order of time."""

    @abstractmethod
    def departure(self, excursion: Excursion) -> Transition:
        """The transition that begins with the departure from a stable branch."""

    @abstractmethod
    def landed(self, episode: Episode, not_before: float) -> StatePoint:
        """State at the beginning of an episode."""

    @abstractmethod
    def away(self, excursion: Excursion, first: Transition) -> str:
        """Type of the phase after a departure, if it does not oscillate."""

    def label(self, row: int) -> str:
        """Label of the stable branch followed at a row."""
        return self.stable_branches[self.followed[row]].label

    def state_at(self, time: float) -> StatePoint:
        """State and slow quantity at a time."""
        value, state = self.slow.at(np.array([time]))
        run, name = self.slow.run, self.slow.name
        return StatePoint(
            float(time),
            self.slow.states,
            state[0].copy(),
            {name: float(value[0])},
            str(run.regions_at(np.array([time]))[0]),
            run.parameters,
            parameter=name,
        )


@dataclass(frozen=True, eq=False)
class Away:
    """An excursion with its phase.

    Parameters
    ----------
    excursion : Excursion
    phase : Phase
    first : Transition or None
        The departure; None at the start of the run and outside the diagram.
    outside : bool
        Whether it begins outside the diagram.
    """

    excursion: Excursion
    phase: Phase
    first: Transition | None
    outside: bool


@dataclass(frozen=True, eq=False)
class PhasesAlongArcs:
    """Phases and transitions in order of time, and the excursions with their last transition."""

    phases: list[Phase] = field(default_factory=list)
    transitions: list[Transition] = field(default_factory=list)
    ends: list[tuple[Excursion, Transition]] = field(default_factory=list)


def phases_along(
    p: OverlaidArcs,
    episodes: Sequence[Episode],
    excursions: Iterable[Excursion],
    closed: Callable[[Away], list[Transition]] | None = None,
) -> PhasesAlongArcs:
    """Return the phases and transitions of a run.

    Parameters
    ----------
    p : OverlaidArcs
    episodes : sequence of Episode
    excursions : iterable of Excursion
        Between the episodes, before the first and after the last.
    closed : callable, optional
        The transitions at the end of an excursion.
    """
    along = PhasesAlongArcs()
    after = {e.old: e for e in excursions}
    for episode in [None, *episodes]:
        labels: dict[str, None] = {}
        start = along.phases[-1].end if along.phases else float(p.m.t[0])
        if episode is not None:
            along.transitions.extend(p.within(episode))
            numbers, rows = np.unique(p.followed[episode.start : episode.stop], return_index=True)
            labels = dict.fromkeys(p.stable_branches[k].label for k in numbers[np.argsort(rows)])
        excursion = after.get(episode)
        away = None if excursion is None else _away(p, excursion)
        end = float(p.m.t[-1]) if away is None else away.phase.start
        if episode is not None:
            along.phases.append(Phase(start, end, "quasi-static", tuple(labels)))
        if away is not None:
            first = [] if away.first is None else [away.first]
            found = [*first, *(closed(away) if closed is not None else [])]
            along.transitions.extend(found)
            along.phases.append(away.phase)
            along.ends.extend((away.excursion, t) for t in found[-1:])
    return along


def _away(p: OverlaidArcs, e: Excursion) -> Away:
    """Return an excursion with its departure and its phase."""
    time = p.m.t
    start, _ = e.rows(p.m)
    outside = start < len(time) and not p.m.within[start]
    begin, end = float(time[0]), float(time[-1])
    first = None
    if e.old is not None and (outside or start >= len(time)):
        begin = float(time[min(start, len(time) - 1)])
    elif e.old is not None:
        first = p.departure(e)
        begin = first.leave.time
    if e.new is not None:
        end = p.landed(e.new, begin).time
    landed = "" if e.new is None else p.label(e.new.start)
    kind = "jump" if first is None else p.away(e, first)
    return Away(e, phase_of(p.m, e, begin, end, landed, kind), first, outside)
