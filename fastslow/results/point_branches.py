"""A curve of special points in the plane of two parameters, as a table."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fastslow.errors import unknown_name
from fastslow.results.outcome import Outcome
from fastslow.results.points import CODE_NAMES, SpecialPoints


@dataclass(frozen=True, eq=False)
class PointBranch:
    """A curve of folds, Hopf points, branch points or boundary equilibria.

    Parameters
    ----------
    states : tuple of str
        State names.
    parameter_names : tuple of str
        The two parameters, as they were asked for.
    code : str
        What the curve was asked to be made of: LP, HB, BP or BE.
    codes : ndarray of str, shape (N,)
        What each row is: a curve of Hopf points goes on as one of neutral
        saddles (NSD) beyond a Bogdanov-Takens point.
    state : ndarray, shape (N, n)
    parameter : ndarray, shape (N, 2)
    tangent : ndarray, shape (N, n + 2)
        Unit tangents (states, parameters), in the direction of tracing.
    eigenvalues : ndarray of complex, shape (N, n)
        Of the Jacobian in the curve's region.
    region : str
        The region whose rates vanish.
    admissible : ndarray of bool, shape (N,)
        Whether each row lies in its region; the others are virtual.
    coefficient : ndarray, shape (N,)
        Normal-form coefficient: a of folds, l₁ of Hopf points, else NaN.
    special : SpecialPoints
        In order along the curve; ``curve.special("CP")`` gives those of one code.
    special_rows : tuple of int
        The row of each special point.
    outcomes : tuple of Outcome
        Why the curve stopped at its first and its last row.
    closed : bool
    """

    states: tuple[str, ...]
    parameter_names: tuple[str, str]
    code: str
    codes: NDArray[np.str_]
    state: NDArray[np.float64]
    parameter: NDArray[np.float64]
    tangent: NDArray[np.float64]
    eigenvalues: NDArray[np.complex128]
    region: str
    admissible: NDArray[np.bool_]
    coefficient: NDArray[np.float64]
    special: SpecialPoints
    special_rows: tuple[int, ...]
    outcomes: tuple[Outcome, Outcome]
    closed: bool = False

    @property
    def outcome(self) -> Outcome:
        """How the tracing ended: the first unsuccessful end, else the last one."""
        return next((o for o in self.outcomes if not o.success), self.outcomes[-1])

    def __len__(self) -> int:
        return len(self.state)

    def __getitem__(self, name: object) -> NDArray[np.float64]:
        """Column of a state or of a parameter, shape (N,)."""
        key = str(name)
        if key in self.states:
            return self.state[:, self.states.index(key)]
        if key in self.parameter_names:
            return self.parameter[:, self.parameter_names.index(key)]
        raise unknown_name("column", key, [*self.states, *self.parameter_names])

    def __repr__(self) -> str:
        first, second = self.parameter_names
        lines = [
            f"Curve of {self.code} ({CODE_NAMES[self.code]}) in {self.region} "
            f"over {first} and {second}, {len(self)} points"
        ]
        for point in self.special:
            at = ", ".join(f"{n} = {point.parameters[n]:.6g}" for n in self.parameter_names)
            if point.code != "EP":
                lines.append(f"   {point.label}: {at}, {point.description}")
        lines += [f"   ends: {outcome}" for outcome in dict.fromkeys(self.outcomes)]
        return "\n".join(lines)
