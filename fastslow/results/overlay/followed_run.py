"""A run with the stable branches that it follows, row by row."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from fastslow.results.base.display import Summarized
from fastslow.results.base.immutable import ReadOnly
from fastslow.results.base.outcome import Outcome
from fastslow.results.branch.diagram import Diagram
from fastslow.results.orbits.orbit_branch import OrbitBranch
from fastslow.results.overlay.transitions import Phases, StableBranch, Transitions
from fastslow.results.trajectory.trajectory import Trajectory

#: Transitions in a summary.
SUMMARY_TRANSITIONS = 12

#: The median lag is given where at least this fraction of the rows have one.
LAGGING = 0.5


class FollowedRun(ReadOnly, Summarized):
    """The record of an overlay, whose fields are described there."""

    diagram: Diagram
    run: Trajectory
    t: NDArray[np.float64]
    slow: NDArray[np.float64]
    state: NDArray[np.float64]
    stable_branches: tuple[StableBranch, ...]
    followed: NDArray[np.intp]
    distance: NDArray[np.float64]
    lag: NDArray[np.float64]
    phases: Phases
    transitions: Transitions
    outcome: Outcome
    band: NDArray[np.intp] | None
    branches: tuple[OrbitBranch, ...]
    period: float | None

    def __len__(self) -> int:
        return len(self.t)

    @property
    def parameter(self) -> str:
        """Name of the slow quantity, which is the parameter of the diagram."""
        return self.diagram.parameter

    @property
    def states(self) -> tuple[str, ...]:
        """States of the frozen model."""
        return self.diagram.states

    def _phase_types(self) -> NDArray[np.str_]:
        """Type of the phase in which each row is, "" where it is in none."""
        starts = np.array([phase.start for phase in self.phases])
        types = np.array([*(phase.type for phase in self.phases), ""])
        return types[np.searchsorted(starts, self.t, side="right") - 1]

    @property
    def delays(self) -> NDArray[np.float64]:
        """Delay of every transition, in units of the slow quantity."""
        return np.array([t.delay for t in self.transitions])

    @property
    def _branch_labels(self) -> NDArray[np.str_]:
        """Label of the stable branch followed at each row, "" where there is none."""
        return np.array([*(s.label for s in self.stable_branches), ""])[self.followed]

    def _endings(self) -> Iterator[str]:
        """Yield what is missing of the overlay and of the run."""
        if not self.outcome:
            yield f"  {self.outcome}"
        if not self.run.outcome and self.outcome.code != "cut short":
            yield f"  the run ended early: {self.run.outcome}"
        elif self.run.outcome:
            yield from (f"  the run: {note}" for note in self.run.outcome.notes)

    def _events(self) -> Iterator[str]:
        """Yield the first transitions."""
        yield from (f"  {t.description}" for t in self.transitions[:SUMMARY_TRANSITIONS])
        if len(self.transitions) > SUMMARY_TRANSITIONS:
            yield f"  … {len(self.transitions) - SUMMARY_TRANSITIONS} more, see transitions"

    def _lag(self, label: str) -> str:
        """Return the median lag behind a stable branch if most rows on it have one."""
        numbers = [k for k, s in enumerate(self.stable_branches) if s.label == label]
        lags = self.lag[np.isin(self.followed, numbers)]
        known = lags[np.isfinite(lags)]
        if not len(known) or len(known) < LAGGING * len(lags):
            return ""
        # sample times, and so the third digit, depend on the processor's rounding
        return f", median lag {float(np.median(known)):.2g}"
