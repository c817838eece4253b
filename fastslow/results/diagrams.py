"""All branches of one frozen model over one parameter."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fastslow.errors import ArgumentError, unknown_name
from fastslow.results.branches import Branch
from fastslow.results.outcome import Outcome
from fastslow.results.points import Equilibrium, SpecialPoints

#: Solves for the equilibrium of a region near a state: (region, state, value) -> Equilibrium.
Corrector = Callable[[str, NDArray[np.float64], float], Equilibrium | None]


#: The usual end of the search for branches.
SEARCHED = Outcome("searched", "every start was followed.", True)


@dataclass(frozen=True, eq=False)
class Diagram:
    """The branches of equilibria of a frozen model over one parameter.

    Parameters
    ----------
    states : tuple of str
        State names.
    parameter : str
        The continuation parameter.
    over : tuple of float
        The range asked for, (low, high).
    parameters : mapping
        The values of all other parameters.
    branches : tuple of Branch
        Every branch found.
    coverage : str
        ``"complete"`` when every branch in the range is proved found, else ``"found"``.
    interfaces, regions : tuple of str
        Names, in the model's order.
    interface_values : mapping
        For every interface that is a plain value of one state, (state, value).
    equations : str
        The model as text.
    outcome : Outcome
        How the search for branches ended.
    path : mapping
        Of a model frozen along a path, each slow quantity as text in the parameter.
    """

    states: tuple[str, ...]
    parameter: str
    over: tuple[float, float]
    parameters: Mapping[str, float]
    branches: tuple[Branch, ...]
    coverage: str
    interfaces: tuple[str, ...]
    regions: tuple[str, ...]
    interface_values: Mapping[str, tuple[str, float]]
    equations: str
    corrector: Corrector | None = field(default=None, repr=False)
    outcome: Outcome = SEARCHED
    path: Mapping[str, str] = field(default_factory=dict)

    def __getstate__(self) -> dict[str, Any]:
        return {**self.__dict__, "corrector": None}

    @property
    def special(self) -> SpecialPoints:
        """Every special point, branch by branch; ``diagram.special("BE")`` those of one code."""
        return SpecialPoints(point for branch in self.branches for point in branch.special)

    @property
    def folds(self) -> SpecialPoints:
        return self.special("LP")

    @property
    def boundary_equilibria(self) -> SpecialPoints:
        return self.special("BE")

    def at(
        self, *, stable: bool | None = None, region: str | None = None, **value: float
    ) -> list[Equilibrium]:
        """Equilibria at one value of the parameter, one per passage of a branch.

        Where the branch is vertical at that value its two ends are given, with
        ``continuum=True``. With the model attached each is solved for to
        rounding; a diagram read from a file interpolates and says so
        (``interpolated=True``).

        Parameters
        ----------
        stable : bool, optional
            Keep only the stable (or only the others).
        region : str, optional
            Keep only those of one region.
        **value : float
            The parameter by name, e.g. ``w=1.0``.

        Returns
        -------
        list of Equilibrium

        Raises
        ------
        UnknownNameError
            If the name is not the diagram's parameter.
        ArgumentError
            If the value is outside the range of the diagram.
        """
        if list(value) != [self.parameter]:
            wrong = next((name for name in value if name != self.parameter), "nothing")
            raise unknown_name("diagram parameter", wrong, [self.parameter])
        where = float(value[self.parameter])
        low, high = self.over
        if not low <= where <= high:
            raise ArgumentError(
                f"{self.parameter} = {where:g} is outside this diagram's range [{low:g}, {high:g}]"
            )
        if region is not None and region not in self.regions:
            raise unknown_name("region", region, self.regions)
        found = [e for branch in self.branches for e in self._passages(branch, where)]
        return [
            e
            for e in found
            if (stable is None or e.stable == stable) and (region is None or e.region == region)
        ]

    def _passages(self, branch: Branch, where: float) -> list[Equilibrium]:
        values = branch.parameter
        found: list[Equilibrium] = []
        near = 1e-12 * max(1.0, abs(where))
        level = np.flatnonzero(np.abs(values - where) <= near)
        runs = np.split(level, np.flatnonzero(np.diff(level) > 1) + 1) if level.size else []
        for run in runs:
            vertical = np.ptp(branch.state[run], axis=0).max() > 1e-9 if len(run) > 1 else False
            for row in (run[0], run[-1]) if vertical else run[:1]:
                found.append(self._stored(branch, int(row), bool(vertical)))
        inside = (values[:-1] - where) * (values[1:] - where) < 0
        inside &= (np.abs(values[:-1] - where) > near) & (np.abs(values[1:] - where) > near)
        for row in np.flatnonzero(inside):
            found.append(self._between(branch, int(row), where))
        if branch.closed and runs and runs[0][0] == 0 and runs[-1][-1] == len(values) - 1:
            found.pop()
        return found

    def _stored(self, branch: Branch, row: int, continuum: bool) -> Equilibrium:
        return Equilibrium(
            self.states,
            branch.state[row].copy(),
            {**self.parameters, self.parameter: float(branch.parameter[row])},
            str(branch.region[row]),
            branch.admissible,
            branch.eigenvalues[row].copy(),
            continuum=continuum,
        )

    def _between(self, branch: Branch, row: int, where: float) -> Equilibrium:
        state = hermite(branch, np.array([row]), np.array([where]))[0]
        region = str(branch.region[row])
        if self.corrector is not None:
            solved = self.corrector(region, state, where)
            if solved is not None:
                return solved
        low, high = branch.parameter[row], branch.parameter[row + 1]
        part = (where - low) / (high - low)
        pair = branch.eigenvalues[row : row + 2]
        # apart, because a complex number times an infinite one (of sliding) is not a number
        real, imaginary = (np.array([1 - part, part]) @ p for p in (pair.real, pair.imag))
        eigenvalues = real + 1j * imaginary
        return Equilibrium(
            self.states,
            state,
            {**self.parameters, self.parameter: where},
            region,
            branch.admissible,
            eigenvalues,
            residual=float("nan"),
            interpolated=True,
        )

    def __repr__(self) -> str:
        low, high = self.over
        lines = [
            f"Diagram of {', '.join(self.states)} over {self.parameter} in [{low:g}, {high:g}] "
            f"({self.coverage})"
        ]
        if not self.outcome:
            lines.append(f"   {self.outcome}")
        for number, branch in enumerate(self.branches):
            last = number == len(self.branches) - 1
            lines.append(("└─ " if last else "├─ ") + repr(branch))
            stem = "   " if last else "│  "
            for point in branch.special:
                if point.code != "EP":
                    at = f"{self.parameter} = {point.parameters[self.parameter]:.6g}"
                    lines.append(f"{stem}   {point.label}: {at}, {point.description}")
        return "\n".join(lines)


def hermite(
    branch: Branch, rows: NDArray[np.intp], values: NDArray[np.float64]
) -> NDArray[np.float64]:
    """States between rows ``rows`` and ``rows + 1`` at parameter values, shape (m, n).

    Cubic Hermite in the parameter where both end slopes are finite and mild,
    linear otherwise (beside a fold the slope dx/dp grows without bound).
    """
    p0, p1 = branch.parameter[rows], branch.parameter[rows + 1]
    x0, x1 = branch.state[rows], branch.state[rows + 1]
    width = p1 - p0
    part = ((values - p0) / width)[:, None]
    chord = x1 - x0
    straight = x0 + part * chord
    with np.errstate(divide="ignore", invalid="ignore"):
        m0 = branch.tangent[rows, :-1] / branch.tangent[rows, -1:] * width[:, None]
        m1 = branch.tangent[rows + 1, :-1] / branch.tangent[rows + 1, -1:] * width[:, None]
        cubic = (
            x0 + part * m0 + part**2 * (3 * chord - 2 * m0 - m1) + part**3 * (m0 + m1 - 2 * chord)
        )
    bound = 3.0 * np.abs(chord) + 1e-12
    mild = np.all((np.abs(m0) <= bound) & (np.abs(m1) <= bound), axis=1, keepdims=True)
    return np.where(mild, cubic, straight)
