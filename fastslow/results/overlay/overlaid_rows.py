"""Rows of an overlay: what differs between samples and strobes of a run."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from fastslow.results.overlay.followed_run import FollowedRun
from fastslow.results.trajectory.queries.state_at import StatePoint

Array = NDArray[np.float64]

#: Columns of numbers, as functions.
Columns = Mapping[str, Callable[[], NDArray[Any]]]


@dataclass(frozen=True, eq=False)
class OverlaidRows(ABC):
    """The rows of an overlay.

    Parameters
    ----------
    of : FollowedRun
    """

    of: FollowedRun

    #: The noun of what rows are a fraction of.
    share_of: ClassVar[str]

    @abstractmethod
    def columns(self) -> Columns:
        """Columns of numbers, for expressions and conditions."""

    def read(self, key: Any) -> tuple[Any, Columns]:
        """An expression or condition, and the columns for the names in it."""
        return key, self.columns()

    @property
    @abstractmethod
    def names(self) -> tuple[str, ...]:
        """Columns by whose values states are found."""

    def labels(self) -> NDArray[np.str_]:
        """Label of what is followed at each row, "" where there is nothing."""
        return self.of._branch_labels

    @property
    def known_labels(self) -> tuple[str, ...]:
        """All labels that rows may have."""
        return tuple(dict.fromkeys(s.label for s in self.of.stable_branches))

    @abstractmethod
    def point(self, row: int) -> StatePoint:
        """The state at a row."""

    @abstractmethod
    def points(self) -> Iterator[StatePoint]:
        """The states at all rows."""

    @abstractmethod
    def at(
        self, name: str, level: float, region: str | None, direction: int | None
    ) -> list[StatePoint]:
        """The states at which a column takes a value, in order of time."""

    @abstractmethod
    def nearest(self, values: Mapping[str, float]) -> StatePoint:
        """The state nearest to values of columns."""

    @abstractmethod
    def weights(self) -> Array:
        """Weights of the rows in fractions; without the last one, or for all."""

    @abstractmethod
    def part(self, start: int, stop: int) -> Mapping[str, Any]:
        """Fields of the overlay of consecutive rows that are not those of the whole one."""

    @abstractmethod
    def count(self) -> str:
        """The number of rows in a summary, where it is given."""

    @abstractmethod
    def lacking(self) -> str:
        """What the diagram lacks, "" if nothing."""

    def named(self, label: str) -> str:
        """A description of the stable branch with a label."""
        return ""

    @abstractmethod
    def doubts(self) -> list[str]:
        """What is not predicted, or depends on noise or rounding."""
