"""Curves of special points in the plane of two parameters, stored as tables."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fastslow.arguments import finite, formula, validated
from fastslow.errors import ArgumentError, unknown_name
from fastslow.formulas.columns import column
from fastslow.results.base.display import Summarized
from fastslow.results.base.immutable import ImmutableSequence
from fastslow.results.base.outcome import Outcome
from fastslow.results.base.result import LIVE, Result
from fastslow.results.base.table import Table, numbered
from fastslow.results.branch.curve_intersections import intersections
from fastslow.results.branch.point_columns import labels_at
from fastslow.results.branch.point_lookup import points_at
from fastslow.results.io.html import Cells, points_cells
from fastslow.results.point_types import END_POINT, HOPF, POINT_TYPES, point_name
from fastslow.results.points import SpecialPoint, SpecialPoints

#: Solves for the point of a curve at a parameter value near a fraction of the step after a
#: row: (row, fraction, name, value) -> SpecialPoint.
PointCorrector = Callable[[int, float, str, float], SpecialPoint | None]


@dataclass(frozen=True, eq=False, repr=False)
class PointBranch(Summarized, Table, Result):
    """A curve of folds, Hopf points, branch points or boundary equilibria.

    Parameters
    ----------
    states : tuple of str
        State names.
    parameter_names : tuple of str
        The two parameters, in the given order.
    code : str
        The code of the curve: LP, HB, BP or BE.
    codes : ndarray of str, shape (N,)
        The code of each row: a curve of Hopf points continues as one of neutral
        saddles (NSD) beyond a Bogdanov-Takens point.
    state : ndarray, shape (N, n)
    values : ndarray, shape (N, 2)
    tangent : ndarray, shape (N, n + 2)
        Unit tangents (states, parameters), in the direction of tracing.
    eigenvalues : ndarray of complex, shape (N, n)
        Of the Jacobian in the curve's region.
    region : str
        The region whose rates vanish.
    admissible : ndarray of bool, shape (N,)
        False for virtual points, outside the region.
    coefficient : ndarray, shape (N,)
        Normal-form coefficient: a of folds, l₁ of Hopf points, else NaN.
    special : SpecialPoints
        In order along the curve; ``curve.special("CP")`` selects one code.
    special_rows : tuple of int
        The row of each special point.
    outcomes : tuple of Outcome
        The outcomes at the first and the last row.
    closed : bool
    parameters : mapping
        The values of all other parameters.
    equations : str
        The model as text.
    settings : mapping
        The settings of the continuation.
    corrector : callable, optional
        Solves for points between rows; not saved to files.
    """

    states: tuple[str, ...]
    parameter_names: tuple[str, str]
    code: str
    codes: NDArray[np.str_]
    state: NDArray[np.float64]
    values: NDArray[np.float64]
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
    corrector: PointCorrector | None = field(default=None, repr=False, metadata=LIVE)

    @property
    def outcome(self) -> Outcome:
        """The outcome of the tracing: the first unsuccessful one, else that at the last row."""
        return next((o for o in self.outcomes if not o.success), self.outcomes[-1])

    def __len__(self) -> int:
        return len(self.state)

    def __getitem__(self, name: object) -> NDArray[np.float64]:
        """Return a state, a parameter, or an expression in them, shape (N,)."""
        columns = {key: partial(self._column, k) for k, key in enumerate(self.point_names)}
        return column(name, columns, self.parameters, len(self))

    def _column(self, k: int) -> NDArray[np.float64]:
        n = len(self.states)
        return self.state[:, k] if k < n else self.values[:, k - n]

    @property
    def criticality(self) -> NDArray[np.str_]:
        """Supercritical, subcritical or degenerate for Hopf points, else empty, shape (N,)."""
        kinds = np.array(["supercritical", "degenerate", "subcritical"])
        hopf = (self.codes == HOPF) & np.isfinite(self.coefficient)
        signs = np.sign(np.where(hopf, self.coefficient, 0.0)).astype(int)
        return np.where(hopf, kinds[signs + 1], "")

    @property
    def points(self) -> NDArray[np.float64]:
        """States and parameters, shape (N, n + 2)."""
        return np.column_stack([self.state, self.values])

    @property
    def point_names(self) -> tuple[str, ...]:
        """The names of the columns of `points`."""
        return (*self.states, *self.parameter_names)

    def at(self, **value: float) -> SpecialPoints:
        """Return the points of the curve at one value of one of its parameters.

        If the model is attached, each point is solved for to rounding; on a curve loaded
        from a file it is interpolated by cubics, as its ``note`` states.

        Parameters
        ----------
        **value : float
            One of the two parameters by name, e.g. ``q=0.5``.

        Returns
        -------
        SpecialPoints
            In order along the curve; empty if it does not reach the value.

        Raises
        ------
        UnknownNameError
            For a name that is neither of the two parameters.
        ArgumentError
            For a number that is not finite, or for more or fewer than one value.

        Examples
        --------
        >>> import fastslow as fs
        >>> cusp = fs.systems.cusp().frozen()
        >>> fold = fs.continue_equilibria(cusp, "p", over=(-1, 1)).folds[0]
        >>> curve = fs.continue_points(fold, ("p", "q"), over={"p": (-1, 1), "q": (-1, 2)})
        >>> curve.at(q=0.75)["p"].round(12)
        array([-0.25,  0.25])
        """
        if len(value) != 1:
            raise ArgumentError(
                f"at: expected one value of {' or '.join(self.parameter_names)}, received "
                f"{', '.join(value) or 'none'}"
            )
        ((name, given),) = value.items()
        if name not in self.parameter_names:
            raise unknown_name("parameter of the curve", name, self.parameter_names)
        return points_at(self, name, finite(name, given))

    @validated(x=formula, y=formula)
    def intersections(
        self, other: PointBranch, x: object = None, y: object = None
    ) -> NDArray[np.float64]:
        """Compute intersections in the plane of two columns; see `Branch.intersections`.

        Parameters
        ----------
        other : PointBranch
        x, y : str, optional
            By default the two parameters.

        Raises
        ------
        ArgumentError
            If both curves are the same, also if it was traced twice.
        """
        first, second = self.parameter_names
        names = str(first if x is None else x), str(second if y is None else y)
        return intersections(self, other, names)

    def to_dict(self) -> dict[str, NDArray[Any]]:
        """Return parameters, states, code, admissibility, coefficient, eigenvalues and labels."""
        return {
            **{name: self[name] for name in (*self.parameter_names, *self.states)},
            "code": self.codes,
            "admissible": self.admissible,
            "coefficient": self.coefficient,
            **numbered("eigenvalue", self.eigenvalues),
            "label": labels_at(self.special, self.special_rows, len(self)),
        }

    def _cells(self) -> Cells:
        return points_cells(self.special, self.parameter_names)

    def _groups(self) -> list[list[str]]:
        first, second = self.parameter_names
        head = [
            f"Curve of {self.code} ({POINT_TYPES[self.code].name}) in {self.region} "
            f"over {first} and {second}, {len(self)} points",
            *(f"   ends: {outcome}" for outcome in dict.fromkeys(self.outcomes)),
        ]
        lines = []
        for point in self.special:
            at = ", ".join(f"{n} = {point.parameters[n]:.6g}" for n in self.parameter_names)
            if point.code != END_POINT:
                lines.append(f"   {point.label}: {at}, {point.description}")
        return [head, lines]


class PointCurves(Summarized, ImmutableSequence, tuple[PointBranch, ...]):
    """The curves of all special points of a diagram, without duplicates.

    Attributes
    ----------
    parameter_names : tuple of str
        The two parameters.
    isolated : SpecialPoints
        Points of the diagram from which no curve could be traced, such as branch
        points that do not persist without a symmetry.
    """

    parameter_names: tuple[str, str]
    isolated: SpecialPoints

    def __new__(
        cls,
        curves: Iterable[PointBranch],
        parameter_names: tuple[str, str],
        isolated: Iterable[SpecialPoint] = (),
    ) -> PointCurves:
        made = super().__new__(cls, curves)
        made.parameter_names = parameter_names
        made.isolated = SpecialPoints(isolated)
        return made

    @property
    def special(self) -> SpecialPoints:
        """The special points of all curves; a point on two curves is listed twice."""
        return SpecialPoints(point for curve in self for point in curve.special)

    def _cells(self) -> Cells:
        return points_cells(self.special, self.parameter_names)

    def _groups(self) -> list[list[str]]:
        head = [f"{len(self)} curves over {' and '.join(self.parameter_names)}"]
        if self.isolated:
            names = ", ".join(point.label for point in self.isolated)
            head.append(f"   no curve from {names}")
        lines = []
        for curve in self:
            codes = " ".join(p.label for p in curve.special)
            cut = "" if curve.outcome.success else f"; {curve.outcome.code}"
            lines.append(
                f"   {curve.code} {point_name(curve.code)} in {curve.region}, {len(curve)} points"
                + (f": {codes}" if codes else "")
                + cut
            )
        return [head, lines]
