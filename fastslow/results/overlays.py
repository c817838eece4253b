"""A trajectory measured against an equilibrium diagram."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fastslow.results import formulas
from fastslow.results.diagrams import Diagram
from fastslow.results.points import SpecialPoint
from fastslow.results.result import Result
from fastslow.results.tables import Table
from fastslow.results.trajectories import Trajectory


@dataclass(frozen=True)
class StableSheet:
    """A stable run of a branch that a trajectory can follow.

    Parameters
    ----------
    label : str
        The region, numbered where a region has several: ``"S1"``, ``"S1b"``.
    branch : int
        Number of the branch in the diagram.
    start, stop : int
        Rows ``start`` to ``stop - 1`` of the branch.
    region : str
        The region of its equilibria.
    """

    label: str
    branch: int
    start: int
    stop: int
    region: str


@dataclass(frozen=True, eq=False)
class Transition:
    """A change of the followed sheet.

    Parameters
    ----------
    time : float
        When two thirds of the way from the old sheet to the new one were done.
    value : float
        The slow quantity at that time.
    state : ndarray, shape (n,)
        The state at that time.
    from_sheet, to_sheet : str
        Labels of the sheets.
    special : SpecialPoint or None
        The nearest special point that ends the old sheet.
    delay : float
        How far past the special point, away from the old sheet, the slow
        quantity is, in its own units; nan without a special point.
    """

    time: float
    value: float
    state: NDArray[np.float64]
    from_sheet: str
    to_sheet: str
    special: SpecialPoint | None
    delay: float

    @property
    def kind(self) -> str:
        """``"jump"`` at a fold, ``"crossing"`` at a boundary equilibrium, else ``"change"``."""
        code = self.special.code if self.special is not None else ""
        return {"LP": "jump", "BE": "crossing"}.get(code, "change")


@dataclass(frozen=True, eq=False)
class Overlay(Table, Result):
    """A trajectory laid over the equilibrium diagram of its frozen model.

    Parameters
    ----------
    diagram : Diagram
    run : Trajectory
    time, slow, distance : ndarray, shape (N,)
        Times, the slow quantity there, and the distance of the state from the
        followed sheet (each state in units of the extent it has in the run or the diagram).
    state : ndarray, shape (N, n)
        The fast states at those times.
    sheets : tuple of StableSheet
        All stable sheets of the diagram.
    followed : ndarray of int, shape (N,)
        Index into ``sheets``; −1 where the diagram has no stable sheet at all.
    transitions : tuple of Transition
        Every change of the followed sheet, in time.
    """

    diagram: Diagram
    run: Trajectory
    time: NDArray[np.float64]
    slow: NDArray[np.float64]
    state: NDArray[np.float64]
    distance: NDArray[np.float64]
    sheets: tuple[StableSheet, ...]
    followed: NDArray[np.intp]
    transitions: tuple[Transition, ...]

    _row = "t"
    _places = ("t",)

    def __len__(self) -> int:
        return len(self.time)

    def __getitem__(self, name: object) -> NDArray[np.float64]:
        """A state, the slow quantity, t, the distance, or an expression in them, shape (N,)."""
        columns: dict[str, Callable[[], NDArray[np.float64]]] = {
            "t": lambda: self.time,
            self.parameter: lambda: self.slow,
            "distance": lambda: self.distance,
            **{key: partial(self._state, k) for k, key in enumerate(self.diagram.states)},
        }
        return formulas.column(name, columns, self.diagram.parameters, len(self))

    def _state(self, k: int) -> NDArray[np.float64]:
        return self.state[:, k]

    def to_dict(self) -> dict[str, NDArray[Any]]:
        """Time t, the slow quantity, states, the distance, and the label of the sheet followed."""
        labels = np.array([*(sheet.label for sheet in self.sheets), ""])
        return {
            "t": self.time,
            self.parameter: self.slow,
            **{name: self.state[:, k] for k, name in enumerate(self.diagram.states)},
            "distance": self.distance,
            "sheet": labels[self.followed],
        }

    @property
    def parameter(self) -> str:
        """The slow quantity, the parameter of the diagram."""
        return self.diagram.parameter

    @property
    def delays(self) -> NDArray[np.float64]:
        """Delay of every transition, in the slow quantity's units."""
        return np.array([t.delay for t in self.transitions])

    def summary(self) -> str:
        """Share of time on each sheet and every transition, as text."""
        name = self.parameter
        weight = np.diff(self.time)
        total = float(weight.sum()) or 1.0
        lines = [
            f"{len(self.transitions)} transitions over t = {self.time[0]:g} to {self.time[-1]:g}"
        ]
        for index, sheet in enumerate(self.sheets):
            share = float(weight[self.followed[:-1] == index].sum()) / total
            if share > 0:
                lines.append(f"  on {sheet.label}: {share:.1%} of the time")
        for t in self.transitions:
            past = "no special point ends the sheet left"
            if t.special is not None:
                at = f"{name} = {t.special[name]:.6g}"
                past = f"{t.kind} at {t.special.label} ({at}), delay {t.delay:.3g}"
            change = f"{t.from_sheet} → {t.to_sheet} at {name} = {t.value:.6g}"
            lines.append(f"  t = {t.time:.6g}: {change}; {past}")
        return "\n".join(lines)

    def __repr__(self) -> str:
        return f"Overlay on {self.parameter}: {self.summary()}"
