"""How a computation ended, as data that reads as a sentence."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from fastslow.results.trajectories import Trajectory


@dataclass(frozen=True)
class Outcome:
    """The way a branch or a trajectory ended.

    Parameters
    ----------
    code : str
        Short stable name that programs can compare, e.g. ``"end of range"``.
    message : str
        One sentence: what happened and, where something can be done, what to try.
    success : bool
        Whether the computation reached what it was asked for.

    Examples
    --------
    >>> print(Outcome("end of range", "reached w = 6, the end of the range.", True))
    reached w = 6, the end of the range.
    """

    code: str
    message: str
    success: bool

    def __str__(self) -> str:
        return self.message

    def __bool__(self) -> bool:
        return self.success


def stopped_early(run: Trajectory) -> str:
    """What a result read off a run adds when the run stopped before its end, else nothing."""
    return "" if run.outcome.success else f" The run ended early: {run.outcome}"


def early_end(run: Trajectory) -> str:
    """The code of the outcome of a run that ended early, else empty."""
    return "" if run.outcome.success else run.outcome.code
