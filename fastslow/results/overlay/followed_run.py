"""What overlays on equilibria and on periodic orbits share."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from fastslow.results.base.display import Summarized
from fastslow.results.base.immutable import ReadOnly
from fastslow.results.base.outcome import Outcome
from fastslow.results.overlay.transitions import StableBranch, Transitions
from fastslow.results.trajectory.trajectory import Trajectory

#: Transitions in a summary.
SUMMARY_TRANSITIONS = 12

#: The median lag is given where at least this fraction of the rows have one.
LAGGING = 0.5


class FollowedRun(ReadOnly, Summarized):
    """A run with the stable branches that it follows, row by row, and its transitions."""

    run: Trajectory
    stable_branches: tuple[StableBranch, ...]
    followed: NDArray[np.intp]
    lag: NDArray[np.float64]
    transitions: Transitions
    outcome: Outcome

    @property
    def delays(self) -> NDArray[np.float64]:
        """Delay of every transition, in units of the slow quantity."""
        return np.array([t.delay for t in self.transitions])

    @property
    def labels(self) -> NDArray[np.str_]:
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
