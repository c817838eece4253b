"""Stable branch of the frozen model along the path of a shift."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fastslow.diagrams.solve.solving import equilibria
from fastslow.errors import ArgumentError
from fastslow.model.model import Model
from fastslow.passage.tipping.moving_equilibria import MovingEquilibrium
from fastslow.results.branch.branch import Branch
from fastslow.results.branch.diagram import Diagram
from fastslow.results.points import Equilibrium

Array = NDArray[np.float64]

#: Distance of a state from an equilibrium at which they are the same, relative to the range of the
#: states of all equilibria.
SAME_EQUILIBRIUM = 1e-6


@dataclass(frozen=True, eq=False)
class TrackedBranch:
    """The stable rows of a branch that are connected to a given equilibrium.

    Parameters
    ----------
    frozen : Model
    name : str
        The slow quantity.
    values : ndarray, shape (N,)
        Increasing.
    states : ndarray, shape (N, n)
    regions : ndarray of str, shape (N,)
    ends : (str, str)
        Label of the special point at which stability or the branch ends below and above, empty at
        the end of the range.
    """

    frozen: Model
    name: str
    values: Array
    states: Array
    regions: NDArray[np.str_]
    ends: tuple[str, str]

    @property
    def extent(self) -> tuple[float, float]:
        return float(self.values[0]), float(self.values[-1])

    def moving(self, value: float, frozen: Model | None = None) -> MovingEquilibrium:
        """The equilibrium near a value, also of a frozen model at other parameter values."""
        row = int(np.argmin(np.abs(self.values - value)))
        model = self.frozen if frozen is None else frozen
        return MovingEquilibrium(model, self.name, str(self.regions[row]), self.states[row])

    def point(self, value: float) -> Equilibrium | None:
        """The stable equilibrium at a value, None beyond the ends of the branch."""
        low, high = self.extent
        slack = 1e-9 * max(high - low, abs(low), abs(high))
        if not low - slack <= value <= high + slack:
            return None
        found = self.moving(value).point(value)
        return found if found is not None and found.stable else None


def tracked_branch(frozen: Model, diagram: Diagram, start: Equilibrium) -> TrackedBranch:
    """Return the stable interval of the branch through a stable equilibrium.

    Raises
    ------
    ArgumentError
        If no branch of the diagram passes through it.
    """
    name = diagram.parameter
    branch, row = _row_of(diagram, start)
    stable = branch.stable.copy()
    stable[row] = True
    values = branch.values
    rows = [row]
    reasons = {}
    for side in (-1, 1):
        # in both directions along the branch, as far as stability and direction remain
        k, way = row, 0.0
        while 0 <= k + side < len(values):
            change = float(values[k + side] - values[k])
            if not stable[k + side] or (way and change * way < 0.0):
                break
            way = way or change
            k += side
            rows.append(k)
        reasons[k] = _label_near(branch, k) if 0 < k < len(values) - 1 else _end_label(branch, k)
    chosen = np.array(sorted(rows))
    order = chosen[np.argsort(values[chosen], kind="stable")]
    ends = reasons.get(int(order[0]), ""), reasons.get(int(order[-1]), "")
    return TrackedBranch(
        frozen, name, values[order], branch.state[order], branch.region[order], ends
    )


def _row_of(diagram: Diagram, start: Equilibrium) -> tuple[Branch, int]:
    value = start.parameters[diagram.parameter]
    best: tuple[float, Branch, int] | None = None
    for branch in diagram.branches:
        for point_row in _rows_at(branch, value):
            away = float(np.abs(branch.state[point_row] - start.state).max())
            if best is None or away < best[0]:
                best = away, branch, point_row
    if best is None:
        raise ArgumentError(
            f"no branch over {diagram.parameter} passes through the start {start!r}; expected a "
            "stable equilibrium of the frozen model at the past limit of the shift"
        )
    return best[1], best[2]


def _rows_at(branch: Branch, value: float) -> list[int]:
    """Rows next to a value of the parameter on every piece of a branch."""
    values = branch.values
    found = []
    for piece in branch.monotone_pieces():
        part = values[piece.start : piece.stop]
        found.append(piece.start + int(np.argmin(np.abs(part - value))))
    return found or [int(np.argmin(np.abs(values - value)))]


def _label_near(branch: Branch, row: int) -> str:
    labels = list(zip(branch.special, branch.special_rows, strict=True))
    near = [
        p.label for p, k in labels if abs(k - row) <= 2 and (p.turns or p.kind.changes_stability)
    ]
    return near[0] if near else "a change of stability"


def _end_label(branch: Branch, row: int) -> str:
    """Empty at the end of the range; else the label of the end point."""
    outcome = branch.outcomes[0 if row == 0 else 1]
    if outcome.code == "end of range":
        return ""
    labels = [p.label for p, k in zip(branch.special, branch.special_rows, strict=True) if k == row]
    return labels[0] if labels else outcome.code


def stable_start(frozen: Model, name: str, value: float, branch: object, what: str) -> Equilibrium:
    """Return the stable equilibrium at which a shift starts.

    Parameters
    ----------
    frozen : Model
    name : str
        The slow quantity.
    value : float
        Its past limit.
    branch : Equilibrium, mapping, sequence or None
        The equilibrium, a state near it, or None for the only stable one.
    what : str
        Name of the argument, for errors.
    """
    known = [e for e in equilibria(frozen, {name: value}) if e.admissible and not e.continuum]
    stable = [e for e in known if e.stable]
    at = f"at {name} = {value:.6g}"
    if not stable:
        raise ArgumentError(
            f"the frozen model has no stable equilibrium {at}, where the shift starts"
        )
    listed = "; ".join(e._values() for e in stable)
    if branch is None:
        if len(stable) > 1:
            raise ArgumentError(
                f"the frozen model has {len(stable)} stable equilibria {at}: {listed}; give one as "
                f"{what}="
            )
        return stable[0]
    given = state_of(frozen, branch, what)
    reach = max(float(np.ptp([e.state for e in known], axis=0).max()), float(np.abs(given).max()))
    nearest = min(known, key=lambda e: float(np.abs(e.state - given).max()))
    if float(np.abs(nearest.state - given).max()) > 0.5 * reach or not nearest.stable:
        raise ArgumentError(
            f"{what}: {', '.join(f'{v:.6g}' for v in given)} is not on a stable branch {at}; "
            f"expected a state near one of {listed}"
        )
    return nearest


def state_of(model: Model, given: object, what: str) -> Array:
    """A state given as an equilibrium, by name, or in order."""
    from fastslow.simulation.arguments import initial_state

    if isinstance(given, Equilibrium):
        if given.states != model.states:
            raise ArgumentError(
                f"{what}: an equilibrium in {', '.join(given.states)}; expected the states "
                f"{', '.join(model.states)}"
            )
        return given.state
    return initial_state(model, given)
