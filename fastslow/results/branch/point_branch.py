"""Curves of special points in the plane of two parameters, stored as tables."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fastslow.arguments import Condition, Name, flag, formula, instance, text, validated
from fastslow.errors import unknown_name
from fastslow.results.base.display import Summarized
from fastslow.results.base.html import Cells
from fastslow.results.base.outcome import Outcome
from fastslow.results.base.result import LIVE
from fastslow.results.base.table import ResultTable, at_values, joined, named_value, numbered
from fastslow.results.branch.curve import TracedCurve
from fastslow.results.branch.curve_intersections import intersections, step_slopes
from fastslow.results.branch.nearest import nearest_place
from fastslow.results.branch.point_lookup import places_on_cubics
from fastslow.results.branch.table import Place
from fastslow.results.point_types import kind_of, point_name
from fastslow.results.points import SpecialPoint, SpecialPoints

#: Solves for the point of a curve at a parameter value near a fraction of the step after a
#: row: (row, fraction, name, value) -> SpecialPoint.
PointCorrector = Callable[[int, float, str, float], SpecialPoint | None]


@dataclass(frozen=True, eq=False, repr=False)
class PointBranch(Summarized, TracedCurve[SpecialPoint]):
    """A curve of folds, Hopf points, branch points, boundary equilibria or folded singularities.

    Parameters
    ----------
    states : tuple of str
        State names.
    parameter_names : tuple of str
        The two parameters, in the given order; of folded singularities one.
    code : str
        The code of the curve: LP, HB, BP or BE; of folded singularities that of the first point.
    codes : ndarray of str, shape (N,)
        The code of each row: a curve of Hopf points continues as one of neutral
        saddles (NSD) beyond a Bogdanov-Takens point, one of folded nodes as one of saddles.
        Empty where no attracting sheet ends at the fold.
    state : ndarray, shape (N, n)
    values : ndarray, shape (N, k)
        Of the k = 1 or 2 parameters.
    tangent : ndarray, shape (N, n + k)
        Unit tangents (states, parameters), in the direction of tracing.
    eigenvalues : ndarray of complex, shape (N, n)
        Of the Jacobian in the curve's region; of folded singularities, shape (N, 2), those of the
        desingularised slow flow.
    region : str
        The region whose rates vanish.
    admissible : ndarray of bool, shape (N,)
        False for virtual points, outside the region.
    coefficient : ndarray, shape (N,)
        Normal-form coefficient: a of folds, l₁ of Hopf points, μ of folded nodes, else NaN.
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
    mark, expression : str
        For zeros of an expression given in ``marks=``, its name and the expression.
    corrector : callable, optional
        Solves for points between rows; not saved to files.
    """

    states: tuple[str, ...]
    parameter_names: tuple[str, ...]
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
    mark: str = ""
    expression: str = ""
    corrector: PointCorrector | None = field(default=None, repr=False, metadata=LIVE)

    @property
    def title(self) -> str:
        """What the points of the curve are: code and name, or a name and an expression."""
        return f"{self.mark} ({self.expression} = 0)" if self.mark else kind_of(self.code).title

    @property
    def _free(self) -> tuple[str, ...]:
        return self.parameter_names

    @property
    def _words(self) -> str:
        return self.title if self.mark else f"{self.code} ({point_name(self.code)})"

    @property
    def criticality(self) -> NDArray[np.str_]:
        """Supercritical, subcritical or degenerate for Hopf points, else empty, shape (N,)."""
        kinds = np.array(["supercritical", "degenerate", "subcritical"])
        known = [kind_of(code).coefficient == "lyapunov" for code in self.codes.tolist()]
        hopf = np.array(known, dtype=bool) & np.isfinite(self.coefficient)
        signs = np.sign(np.where(hopf, self.coefficient, 0.0)).astype(int)
        return np.where(hopf, kinds[signs + 1], "")

    def _item(self, row: int) -> SpecialPoint:
        return self._interpolated(row, 0.0)

    def _rows(self, rows: Any) -> PointBranch:
        part = super()._rows(rows)
        if part is self or self.corrector is None:
            return part
        first = rows.indices(len(self))[0]
        return replace(part, corrector=partial(_from_row, self.corrector, first))

    def _point(self, place: Place, name: str) -> SpecialPoint:
        """Return the point at a place, solved for at the value of a parameter if possible."""
        row, part, value, _ = place
        solved = None if self.corrector is None else self.corrector(row, part, name, value)
        return solved or self._interpolated(row, part)

    def _interpolated(self, row: int, part: float) -> SpecialPoint:
        """Return a point interpolated by the cubic of a step, marked as such in its note."""
        points, n = self.points, len(self.states)
        other = min(row + 1, len(self) - 1)
        nearest = row if part < 0.5 else other
        at = points[row]
        if part > 0:
            leaving, arriving = (table[row] for table in step_slopes(self.table))
            chord = points[other] - points[row]
            bend, twist = 3 * chord - 2 * leaving - arriving, leaving + arriving - 2 * chord
            at = points[row] + part * (leaving + part * (bend + part * twist))
        weights = np.array([1.0 - part, part])
        pair = self.eigenvalues[[row, other]]
        code = str(self.codes[nearest])
        coefficient = float(weights @ self.coefficient[[row, other]])
        known = None if np.isnan(coefficient) else coefficient
        entries = {kind_of(code).coefficient: known}
        return SpecialPoint(
            code=code,
            label=code,
            states=self.states,
            state=at[:n].copy(),
            parameters={
                **self.parameters,
                **dict(zip(self.parameter_names, map(float, at[n:]), strict=True)),
            },
            regions=(self.region,),
            eigenvalues=weights @ pair.real + 1j * (weights @ pair.imag),
            tangent=self.tangent[nearest].copy(),
            residual=0.0 if part == 0 else float("nan"),
            converged=part == 0,
            coefficient=entries.get("coefficient"),
            lyapunov=entries.get("lyapunov"),
            admissible=bool(self.admissible[nearest]),
            note="" if part == 0 else "interpolated between rows of the curve",
        )

    def at(self, **value: Any) -> Any:
        """Return the points of the curve at values of one of its parameters.

        If the model is attached, each point is solved for to rounding; on a curve loaded
        from a file it is interpolated by cubics, as its ``note`` states.

        Parameters
        ----------
        **value : float or array_like, shape (m,)
            One of the two parameters by name, e.g. ``q=0.5``.

        Returns
        -------
        SpecialPoints, or list of m SpecialPoints
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
        name, given = named_value("curve parameter", self.parameter_names, value)
        return at_values(name, given, partial(self._at, name))

    def _at(self, name: str, value: float) -> SpecialPoints:
        places = places_on_cubics(self.table, name, value)
        return SpecialPoints(self._point(place, name) for place in places)

    @validated(code=text, admissible=flag)
    def select(
        self,
        condition: Condition | None = None,
        /,
        *,
        code: str | None = None,
        admissible: bool | None = None,
    ) -> tuple[PointBranch, ...]:
        """Return the slices of the curve whose rows satisfy all conditions, in order.

        Parameters
        ----------
        condition : str or Expr, optional
            A condition in states and parameters, such as ``"p > 0 and q < 1"``.
        code : str, optional
            Select slices with a special point of this code.
        admissible : bool, optional
            Select rows that are admissible, or virtual.

        Returns
        -------
        tuple of PointBranch

        Raises
        ------
        UnknownNameError
            For an unknown column or code.
        ArgumentError
            For text that is not a condition.
        """
        if code is not None:
            self.special._check_code(code)
        wanted = self._where(condition)
        if admissible is not None:
            wanted = wanted & (self.admissible == admissible)
        return self._slices(wanted, code)

    def nearest(self, **values: float) -> SpecialPoint:
        """Return the point of the curve nearest to given values of states and parameters.

        Distances are measured in units of each column's range. A point between rows is
        interpolated and, if the model is attached, corrected at its second parameter.

        Parameters
        ----------
        **values : float
            At least one, e.g. ``p=0.1, q=0.5``.

        Raises
        ------
        UnknownNameError
            For a name that is neither a state nor one of the two parameters.
        ArgumentError
            For a number that is not finite, or without any value.
        """
        place = nearest_place([self.table], values)[1]
        return self._point(place, self.parameter_names[-1])

    @validated(x=formula, y=formula)
    def intersections(
        self, other: PointBranch, x: Name | None = None, y: Name | None = None
    ) -> NDArray[np.float64]:
        """Compute intersections in the plane of two columns; see `Branch.intersections`.

        Parameters
        ----------
        other : PointBranch
        x, y : str, optional
            By default the two parameters; of one parameter, it and the first state.

        Raises
        ------
        ArgumentError
            If both curves are the same, also if it was traced twice.
        """
        first, second = (*self.parameter_names, *self.states)[:2]
        names = str(first if x is None else x), str(second if y is None else y)
        instance(PointBranch)("other", other)
        return intersections(self.table, other.table, names)

    def to_dict(self) -> dict[str, NDArray[Any]]:
        """Return parameters, states, code, admissibility, coefficient, eigenvalues and labels."""
        return {
            **{name: self[name] for name in (*self.parameter_names, *self.states)},
            "code": self.codes,
            "admissible": self.admissible,
            "coefficient": self.coefficient,
            **numbered("eigenvalue", self.eigenvalues),
            "label": self.table.labels,
        }

    def _cells(self) -> Cells:
        return self.special._cells(self.parameter_names)

    def _groups(self) -> list[list[str]]:
        head = [
            f"Curve of {self._words} in {self.region} "
            f"over {' and '.join(self.parameter_names)}, {len(self)} points",
            *(f"   ends: {outcome}" for outcome in dict.fromkeys(self.outcomes)),
        ]
        lines = []
        for point in self.special:
            at = ", ".join(f"{n} = {point.parameters[n]:.6g}" for n in self.parameter_names)
            if not point.kind.end:
                lines.append(f"   {point.label}: {at}, {point.description}")
        return [head, lines]


def _from_row(
    corrector: PointCorrector, first: int, row: int, part: float, name: str, value: float
) -> SpecialPoint | None:
    """Solve for a point on a slice of a curve that begins at a row of the curve."""
    return corrector(first + row, part, name, value)


class PointCurves(Summarized, ResultTable[PointBranch]):
    """The curves of all special points of a diagram, without duplicates.

    ``curves[0]`` and iteration return curves, ``curves["p"]`` the concatenated column of all
    of them, and ``curves["CP1"]`` a special point.

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

    @property
    def parameters(self) -> Mapping[str, float]:
        """The values of all other parameters."""
        return self[0].parameters if len(self) else {}

    def _columns(self) -> Mapping[str, Callable[[], NDArray[np.float64]]]:
        names = self[0].point_names if len(self) else ()
        return {name: partial(self._joined, name) for name in names}

    def _joined(self, name: str) -> NDArray[np.float64]:
        return np.concatenate([curve[name] for curve in self])

    def _count(self) -> int:
        return sum(map(len, self))

    def _labelled(self) -> Mapping[str, SpecialPoint]:
        return {**self.isolated._labelled(), **self.special._labelled()}

    def at(self, **value: Any) -> Any:
        """Return the points of all curves at values of a parameter; see `PointBranch.at`."""
        name, given = named_value("curve parameter", self.parameter_names, value)

        def query(number: float) -> SpecialPoints:
            return SpecialPoints(point for curve in self for point in curve._at(name, number))

        return at_values(name, given, query)

    def select(self, condition: Condition | None = None, /, **matching: Any) -> PointCurves:
        """Return the slices of curves whose rows satisfy conditions; see `PointBranch.select`."""
        for name in matching:
            if name not in ("code", "admissible"):
                raise unknown_name("column to select by", name, ["code", "admissible"])
        parts = (part for curve in self for part in curve.select(condition, **matching))
        return PointCurves(parts, self.parameter_names)

    def nearest(self, **values: float) -> SpecialPoint:
        """Return the point of any curve nearest to given values; see `PointBranch.nearest`."""
        number, place = nearest_place([curve.table for curve in self], values)
        return self[number]._point(place, self.parameter_names[1])

    def to_dict(self) -> dict[str, NDArray[Any]]:
        """Return the columns of `PointBranch.to_dict`, with the index of each row's curve."""
        return joined("curve", [curve.to_dict() for curve in self])

    def _cells(self) -> Cells:
        return self.special._cells(self.parameter_names)

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
                f"   {curve.title} in {curve.region}, {len(curve)} points"
                + (f": {codes}" if codes else "")
                + cut
            )
        return [head, lines]
