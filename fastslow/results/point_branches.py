"""A curve of special points in the plane of two parameters, as a table."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import partial
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from fastslow.arguments import formula, takes
from fastslow.results import formulas
from fastslow.results.markup import points_html
from fastslow.results.meetings import intersections
from fastslow.results.outcome import Outcome
from fastslow.results.point_columns import labels_at
from fastslow.results.point_types import POINT_TYPES
from fastslow.results.points import SpecialPoints
from fastslow.results.result import Result
from fastslow.results.tables import Table, numbered


@dataclass(frozen=True, eq=False)
class PointBranch(Table, Result):
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
    parameters : mapping
        The values of all other parameters.
    equations : str
        The model as text.
    settings : mapping
        How the curve was traced.
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
    parameters: Mapping[str, float] = field(default_factory=dict)
    equations: str = ""
    settings: Mapping[str, float] = field(default_factory=dict)

    @property
    def outcome(self) -> Outcome:
        """How the tracing ended: the first unsuccessful end, else the last one."""
        return next((o for o in self.outcomes if not o.success), self.outcomes[-1])

    #: Numbers are no columns, and rows no points: there is nothing to go through one by one.
    __iter__: ClassVar[None] = None

    def __len__(self) -> int:
        return len(self.state)

    def __getitem__(self, name: object) -> NDArray[np.float64]:
        """A state, a parameter, or an expression in them, shape (N,)."""
        columns = {key: partial(self._column, k) for k, key in enumerate(self.point_names)}
        return formulas.column(name, columns, self.parameters, len(self))

    def _column(self, k: int) -> NDArray[np.float64]:
        n = len(self.states)
        return self.state[:, k] if k < n else self.parameter[:, k - n]

    @property
    def points(self) -> NDArray[np.float64]:
        """States and parameters, shape (N, n + 2)."""
        return np.column_stack([self.state, self.parameter])

    @property
    def point_names(self) -> tuple[str, ...]:
        """The columns of `points`."""
        return (*self.states, *self.parameter_names)

    @takes(x=formula, y=formula)
    def intersections(
        self, other: PointBranch, x: object = None, y: object = None
    ) -> NDArray[np.float64]:
        """Where two curves meet in the plane of two columns; see `Branch.intersections`.

        Parameters
        ----------
        other : PointBranch
        x, y : str, optional
            By default the two parameters.
        """
        first, second = self.parameter_names
        names = str(first if x is None else x), str(second if y is None else y)
        return intersections(self, other, names)

    def to_dict(self) -> dict[str, NDArray[Any]]:
        """Parameters, states, code, admissibility, coefficient, eigenvalues, labels of points."""
        return {
            **{name: self[name] for name in (*self.parameter_names, *self.states)},
            "code": self.codes,
            "admissible": self.admissible,
            "coefficient": self.coefficient,
            **numbered("eigenvalue", self.eigenvalues),
            "label": labels_at(self.special, self.special_rows, len(self)),
        }

    def _repr_html_(self) -> str:
        return points_html(self.special, repr(self).split("\n")[0], self.parameter_names)

    def __repr__(self) -> str:
        first, second = self.parameter_names
        lines = [
            f"Curve of {self.code} ({POINT_TYPES[self.code].name}) in {self.region} "
            f"over {first} and {second}, {len(self)} points"
        ]
        for point in self.special:
            at = ", ".join(f"{n} = {point.parameters[n]:.6g}" for n in self.parameter_names)
            if point.code != "EP":
                lines.append(f"   {point.label}: {at}, {point.description}")
        lines += [f"   ends: {outcome}" for outcome in dict.fromkeys(self.outcomes)]
        return "\n".join(lines)
