"""Bifurcation diagrams: the branches of equilibria of a frozen model over one parameter."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fastslow.arguments import Condition, flag, text, validated, whole
from fastslow.errors import ArgumentError, IncompleteWarning
from fastslow.results.base.display import Summarized
from fastslow.results.base.html import Cells
from fastslow.results.base.intervals import limits_of
from fastslow.results.base.outcome import CUT_SHORT, Outcome
from fastslow.results.base.result import LIVE, STORED, Result
from fastslow.results.base.table import Table, at_values, inside, joined, named_value
from fastslow.results.branch import stability_intervals
from fastslow.results.branch.branch import Branch, check_region, filtered
from fastslow.results.branch.equilibrium_sets import EquilibriumBand
from fastslow.results.branch.nearest import nearest_place
from fastslow.results.branch.unexplained import UnexplainedChange, unexplained_changes
from fastslow.results.branch.windows import LEFT, StateWindow
from fastslow.results.point_types import BOUNDARY_EQUILIBRIUM, FOLD
from fastslow.results.points import Corrector, Equilibrium, SpecialPoint, SpecialPoints
from fastslow.results.stored.model import StoredModel

#: The outcome of a completed search for branches.
SEARCHED = Outcome("searched", "every start was followed.", True)

#: The outcome of a diagram to which a certificate added branches.
ADDED = Outcome("added", "branches through the equilibria of a certificate were added.", True)

#: Code of a search that was stopped at the maximal number of branches.
TOO_MANY = "too many branches"


@dataclass(frozen=True, eq=False, repr=False)
class Diagram(Summarized, Table[Branch], Result):
    """A bifurcation diagram: branches of equilibria of a frozen model over one parameter.

    ``diagram[0]`` and iteration return branches, ``diagram["x"]`` the concatenated
    column of all of them, and ``diagram["LP1"]`` a special point.

    Parameters
    ----------
    states : tuple of str
        State names.
    parameter : str
        The continuation parameter.
    over : tuple of float
        The range of the parameter, (low, high).
    parameters : mapping
        The values of all other parameters.
    branches : tuple of Branch
        The branches found.
    completeness : str
        ``"complete"`` if it is proved that all branches in the range were found,
        ``"proved"`` if `certify` has proved it in interval arithmetic for a window, else
        ``"found"``.
    interfaces, regions : tuple of str
        Names, in the model's order.
    interface_values : mapping
        For each interface at a constant value of one state, (state, value); for a wall, with
        the side beyond it, 1 above and −1 below.
    equations : str
        The model equations as text.
    corrector : callable, optional
        Solves for equilibria between rows; not saved to files.
    outcome : Outcome
        The outcome of the search for branches.
    path : mapping
        For a model frozen along a path, each slow quantity as text in the parameter.
    settings : mapping
        The settings of the continuation.
    bands : tuple of EquilibriumBand
        Sets of equilibria on discontinuities over the parameter, such as the sticking
        band of dry friction.
    window : StateWindow, optional
        The ranges of the states within which branches were traced; ``"complete"``
        refers to this window only.
    periods : mapping
        The period of each periodic state.
    model : Model or StoredModel, optional
        The frozen model, in which the parameter has no value; for a diagram loaded from
        a file a stored model, which can be simulated and does not require SymPy.

    Examples
    --------
    >>> import fastslow as fs
    >>> gear = fs.systems.harmonic_gear(A=-0.6)
    >>> diagram = fs.continue_equilibria(gear.frozen(), "w", over=(-0.5, 0.5))
    >>> diagram.bistable().round(6)
    array([[-0.08944,  0.08944]])
    >>> diagram.nearest(w=0.1, x=0.9).region
    'S1'
    """

    states: tuple[str, ...]
    parameter: str
    over: tuple[float, float]
    parameters: Mapping[str, float]
    branches: tuple[Branch, ...]
    completeness: str
    interfaces: tuple[str, ...]
    regions: tuple[str, ...]
    interface_values: Mapping[str, tuple[str, float] | tuple[str, float, int]]
    equations: str
    corrector: Corrector | None = field(default=None, repr=False, metadata=LIVE)
    outcome: Outcome = SEARCHED
    path: Mapping[str, str] = field(default_factory=dict)
    settings: Mapping[str, float] = field(default_factory=dict)
    window: StateWindow | None = None
    bands: tuple[EquilibriumBand, ...] = ()
    periods: Mapping[str, float] = field(default_factory=dict)
    model: Any = field(default=None, repr=False, metadata=STORED)

    @property
    def stored_model(self) -> StoredModel | None:
        """The model as stored in files."""
        source = self.model if self.corrector is None else self.corrector
        return getattr(source, "stored", None)

    @property
    def definitions(self) -> dict[str, str]:
        """The named definitions of the model as text."""
        return dict(self.branches[0].definitions) if self.branches else {}

    def __len__(self) -> int:
        return len(self.branches)

    _entry = "branch"

    def _coordinate(self) -> str:
        return self.parameter

    def _count(self) -> int:
        return sum(map(len, self.branches))

    def _item(self, row: int) -> Branch:
        return self.branches[row]

    def _rows(self, rows: Any) -> Diagram:
        raise ArgumentError(
            "a diagram cannot be sliced; expected the index of a branch, a name or an "
            "expression (or slice its branches: diagram.branches[0:2])"
        )

    def _columns(self) -> Mapping[str, Callable[[], NDArray[np.float64]]]:
        return {name: partial(self._joined, name) for name in (*self.states, self.parameter)}

    def _labelled(self) -> Mapping[str, SpecialPoint]:
        return self.special._labelled()

    def _joined(self, name: str) -> NDArray[np.float64]:
        return np.concatenate([np.empty(0), *(branch[name] for branch in self.branches)])

    @property
    def special(self) -> SpecialPoints:
        """The special points, branch by branch; ``diagram.special("BE")`` selects one code.

        A point common to several branches, such as a branch point, is listed once.
        """
        points = SpecialPoints(point for branch in self.branches for point in branch.special)
        return SpecialPoints(points._labelled().values())

    @cached_property
    def unexplained(self) -> tuple[UnexplainedChange, ...]:
        """Changes of the number of unstable eigenvalues that no special point explains.

        The number of eigenvalues with positive real part changes by one at a fold or
        branch point, by two at a Hopf point, and by any number between regions. Any
        other change indicates a missed special point, or a stability that is decided
        by rounding.
        """
        return tuple(
            change
            for number, branch in enumerate(self.branches)
            for change in unexplained_changes(branch.table, number)
        )

    def _warn(self, query: str, level: int) -> None:
        """Warn that a query may be incomplete; its caller is ``level`` frames up."""
        cut = sum(any(o.code in CUT_SHORT for o in b.outcomes) for b in self.branches)
        reasons = []
        if cut:
            reasons.append(f"{cut} of {len(self)} branches were cut short")
        if self.outcome.code == TOO_MANY:
            reasons.append("there may be more branches")
        if self.unexplained:
            reasons.append("a change of stability is unexplained")
        if reasons:
            warnings.warn(
                f"{query} may be incomplete: {' and '.join(reasons)}; see diagram.outcome",
                IncompleteWarning,
                stacklevel=level,
            )

    @property
    def folds(self) -> SpecialPoints:
        return self.special(FOLD)

    @property
    def boundary_equilibria(self) -> SpecialPoints:
        return self.special(BOUNDARY_EQUILIBRIUM)

    @validated(stable=flag, region=text)
    def at(
        self, *, stable: bool | None = None, region: str | None = None, **value: Any
    ) -> list[Any]:
        """Return the equilibria at values of the parameter.

        A vertical segment of a branch is represented by its two ends, with
        ``continuum=True``, and a set of equilibria (see ``bands``) by its ends or
        corners. If the model is attached, each equilibrium is solved for to rounding;
        otherwise it is interpolated (``interpolated=True``).

        Parameters
        ----------
        stable : bool, optional
            Select the stable equilibria, or those that are not stable.
        region : str, optional
            Select those of one region.
        **value : float or array_like, shape (m,)
            The parameter by name, e.g. ``w=1.0``.

        Returns
        -------
        list of Equilibrium, or list of m such lists
            A list for each value of an array.

        Raises
        ------
        UnknownNameError
            If the name is not the parameter of the diagram.
        ArgumentError
            If a value is outside the range of the diagram.
        """
        name, given = named_value("diagram parameter", [self.parameter], value)
        check_region(region, self._known_regions)
        self._warn("at()", 5)

        def query(number: float) -> list[Equilibrium]:
            inside("diagram", name, number, self.over)
            found = [e for b in self.branches for e in b._at(number, stable, region)]
            sets = (band.set_at(number) for band in self.bands)
            corners = [corner for one in sets if one is not None for corner in one.equilibria]
            return found + filtered(corners, stable, region)

        return at_values(name, given, query)

    @property
    def _known_regions(self) -> tuple[str, ...]:
        # pseudo-equilibria belong to no region of the model
        sliding = (*(r for b in self.branches for r in b.regions), *(b.region for b in self.bands))
        return tuple(dict.fromkeys([*self.regions, *sliding]))

    @validated(stable=flag, region=text, code=text)
    def select(
        self,
        condition: Condition | None = None,
        /,
        *,
        stable: bool | None = None,
        region: str | None = None,
        code: str | None = None,
        between: tuple[float, float] | None = None,
    ) -> Diagram:
        """Return the diagram of the slices of branches whose rows satisfy all conditions.

        Parameters
        ----------
        condition : str or Expr, optional
            A condition in states and parameters, such as ``"x > 0"``.
        stable, region, code, between
            As for `Branch.select`; ``between`` becomes the range of the diagram.

        Returns
        -------
        Diagram
            With the special points on these slices; without ``bands`` for a condition or
            code.

        Raises
        ------
        UnknownNameError
            For an unknown region or code.
        ArgumentError
            For an invalid interval, or one outside the range of the diagram.
        """
        check_region(region, self._known_regions)
        if code is not None:
            self.special._check_code(code)
        over = self.over
        if between is not None:
            low, high = limits_of(between)
            over = max(low, over[0]), min(high, over[1])
            if over[0] > over[1]:
                raise ArgumentError(
                    f"between=({low:g}, {high:g}) is outside this diagram's range "
                    f"[{self.over[0]:g}, {self.over[1]:g}]"
                )
        branches = tuple(
            part
            for branch in self.branches
            if region is None or region in branch.regions
            for part in branch._selected(condition, stable, region, code, between)
        )
        rows_alone = condition is not None or code is not None
        bands = [b for b in self.bands if region in (None, b.region) and not rows_alone]
        cut = (band.between(*over) for band in bands if stable in (None, band.is_stable))
        kept = tuple(band for band in cut if band is not None)
        return replace(self, branches=branches, over=over, bands=kept)

    @validated(min_count=whole(1))
    def bistable(self, min_count: int = 2) -> NDArray[np.float64]:
        """Return the intervals of the parameter with several stable equilibria, shape (k, 2).

        An interval bounded by a special point ends exactly there. Virtual branches
        are not counted.

        Parameters
        ----------
        min_count : int
            Smallest number of coexisting stable equilibria.

        Raises
        ------
        ArgumentError
            For a number below one.
        """
        self._warn("bistable()", 5)
        if min_count not in self._multistable:
            tables = [branch.table for branch in self.branches if branch.admissible]
            self._multistable[min_count] = stability_intervals.multistable(tables, min_count)
        return self._multistable[min_count]

    @cached_property
    def _multistable(self) -> dict[int, NDArray[np.float64]]:
        return {}

    def nearest(self, **values: float) -> Equilibrium:
        """Return the point of any branch nearest to given values; see `Branch.nearest`."""
        self._warn("nearest()", 3)
        number, place = nearest_place([branch.table for branch in self.branches], values)
        return self.branches[number]._equilibrium(place)

    def to_dict(self) -> dict[str, NDArray[Any]]:
        """Return the columns of `Branch.to_dict`, with the index of the branch of each row."""
        return joined("branch", [branch.to_dict() for branch in self.branches])

    def _cells(self) -> Cells:
        points = SpecialPoints(p for branch in self.branches for p in branch.special)
        cells = points._cells((self.parameter,))
        numbers = [str(k) for k, branch in enumerate(self.branches) for _ in branch.special]
        rows = [[number, *row] for number, row in zip(numbers, cells.rows, strict=True)]
        return Cells(["branch", *cells.head], rows)

    @property
    def _within(self) -> str:
        """The window as text, if it was given or a branch ends at one of its bounds."""
        cut = any(o.code == LEFT for branch in self.branches for o in branch.outcomes)
        return f", {self.window}" if self.window and (self.window.chosen or cut) else ""

    def _groups(self) -> list[list[str]]:
        low, high = self.over
        head = [
            f"Diagram of {', '.join(self.states)} over {self.parameter} in [{low:g}, {high:g}]"
            f"{self._within} ({self.completeness})"
        ]
        if self.outcome.code != SEARCHED.code:
            head.append(f"   {self.outcome}")
        else:
            head += [f"   {note}" for note in self.outcome.notes]
        changes = [f"   {change}" for change in self.unexplained]
        lines = []
        for number, branch in enumerate(self.branches):
            last = number == len(self.branches) - 1
            lines.append(("└─ " if last else "├─ ") + repr(branch))
            stem = "   " if last else "│  "
            for point in branch.special:
                if not point.kind.end:
                    at = f"{self.parameter} = {point.parameters[self.parameter]:.6g}"
                    lines.append(f"{stem}   {point.label}: {at}, {point.description}")
        return [[*head, *changes], lines, [f"   {band!r}" for band in self.bands]]
