"""A trajectory compared with the equilibria, or the periodic orbits, of its frozen model."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fastslow.arguments import Condition, Name, among, formula, text, validated, word
from fastslow.errors import ArgumentError, unknown_name
from fastslow.formulas.columns import rows_where
from fastslow.results.base.intervals import limits_of, runs_of
from fastslow.results.base.named_mapping import NamedMapping
from fastslow.results.base.outcome import Outcome
from fastslow.results.base.result import Result
from fastslow.results.base.table import Table, at_values, named_value
from fastslow.results.base.upper_layers import computed
from fastslow.results.branch.diagram import Diagram
from fastslow.results.orbits.orbit_branch import OrbitBranch
from fastslow.results.overlay.followed_run import FollowedRun
from fastslow.results.overlay.freezing import Freezing
from fastslow.results.overlay.overlaid_rows import Columns, OverlaidRows
from fastslow.results.overlay.samples import Samples
from fastslow.results.overlay.strobes import Strobes
from fastslow.results.overlay.transitions import (
    PHASES,
    Bursting,
    Phase,
    Phases,
    StableBranch,
    Transition,
    Transitions,
    clipped,
)
from fastslow.results.trajectory.queries.state_at import StatePoint
from fastslow.results.trajectory.steps.slicing import slice_bounds
from fastslow.results.trajectory.trajectory import Trajectory

#: The usual outcome of an overlay.
MEASURED = Outcome("measured", "the diagram covers the whole run.", True)


@dataclass(frozen=True, eq=False, repr=False)
class Overlay(FollowedRun, Table[StatePoint], Result):
    """A trajectory compared with the equilibria, or the periodic orbits, of its frozen model.

    ``overlay["distance"]`` is a column and ``overlay["x - w"]`` an expression, one value per
    row; ``overlay[3]`` and iteration return the state at single rows with the stable
    branch followed there, and ``overlay[10:50]`` the overlay of those rows.

    Over equilibria the rows are the samples of the run. Over orbits of a fast periodic forcing
    they are its states at whole periods of the forcing (strobes), which are compared with the
    orbits at the same phase and the same value of the slow quantity; ``"max(x)"`` and
    ``"min(x)"`` are extremes of the run over the period of the orbits that begins at each strobe,
    NaN where the run ends before, and form its envelope.

    Parameters
    ----------
    diagram : Diagram
        Of equilibria; over orbits without branches.
    run : Trajectory
    t, slow : ndarray, shape (N,)
        Times and the diagram's parameter there: a slow quantity of the run, or the
        parameter of the path along which the model was frozen.
    state : ndarray, shape (N, n)
        States of the frozen model at those times.
    extent : ndarray, shape (n,)
        Unit of each state in distances: its range in the run or on the stable branches that
        the run can follow, whichever is larger, bounded by multiples of the range of all
        branches; for a velocity at least the extent of its state times |λ|. Over orbits its
        range over the strobes and over the stable orbits at values of the slow quantity in
        the run.
    radius : float
        Distance, in those units, below which the state counts as near a stable branch.
    stable_branches : tuple of StableBranch
        All stable branches of the diagram, or the stable slices of the branches of orbits with
        monotone parameter, ``"O1"``, ``"O2"`` and so on.
    followed : ndarray of int, shape (N,)
        Index into ``stable_branches``; −1 where none is followed: before the first and after
        the last one, during oscillations on a cycle, and outside the diagram's range.
    distance : ndarray, shape (N,)
        Distance from the followed stable branch (past a Hopf point from its unstable
        continuation, past a fold from the fold); where none is followed, from the nearest
        stable equilibrium, infinite if there is none. Over orbits at the same phase.
    lag : ndarray, shape (N,)
        Time lag behind the followed stable branch X, X(w(t − lag)) ≈ x(t): the deviation
        along the branch divided by the speed at which the equilibrium drifts. nan where no
        branch is followed, or where the equilibrium or the slow quantity does not move.
    relaxation : ndarray, shape (N,)
        Relaxation time 1/|Re λ| of the followed branch, or −T / log|μ| for the largest
        multiplier μ of an orbit; nan where it is not stable.
    phases : Phases
        All phases of the run, in order of time.
    transitions : Transitions
        Departures from a stable branch and ends of oscillations, in order of time;
        a table, of which ``overlay.transitions.select(type="jump")`` returns some. Over orbits
        departures and passages of contacts with interfaces, resolved to one period; their
        delays are measured, not predicted.
    bursting : Bursting or None
        Classification of the recurrent pattern; None if there is none, and over orbits.
    turning : tuple of StatePoint
        Extrema of the slow quantity; none over orbits.
    outcome : Outcome
        Whether the diagram, or the branches of orbits, cover the run.
    band : ndarray of int, shape (N,), optional
        Index into the diagram's ``bands`` where the state is at rest in a band of
        equilibria, as a block held by dry friction, or slips along its edge; else −1.
    cycles : tuple of OrbitBranch
        Traced cycles of the frozen model.
    branches : tuple of OrbitBranch
        Branches of forced orbits over the slow quantity, with which the run is compared.
    period : float or None
        Period of the fast forcing of these orbits.
    """

    diagram: Diagram
    run: Trajectory
    t: NDArray[np.float64]
    slow: NDArray[np.float64]
    state: NDArray[np.float64]
    extent: NDArray[np.float64]
    radius: float
    stable_branches: tuple[StableBranch, ...]
    followed: NDArray[np.intp]
    distance: NDArray[np.float64]
    lag: NDArray[np.float64]
    relaxation: NDArray[np.float64]
    phases: Phases
    transitions: Transitions
    bursting: Bursting | None
    turning: tuple[StatePoint, ...]
    outcome: Outcome = MEASURED
    band: NDArray[np.intp] | None = None
    cycles: tuple[OrbitBranch, ...] = ()
    branches: tuple[OrbitBranch, ...] = ()
    period: float | None = None

    _row = "t"
    _places = ("t",)

    @cached_property
    def _of_rows(self) -> OverlaidRows:
        return Samples(self) if self.period is None else Strobes(self, self.period)

    def __iter__(self) -> Iterator[StatePoint]:
        return self._of_rows.points()

    def to_dict(self) -> dict[str, NDArray[Any]]:
        """Columns: time t, slow quantity, states, distance, lag, stable branch and phase."""
        found = {
            "t": self.t,
            self.parameter: self.slow,
            **{name: self.state[:, k] for k, name in enumerate(self.states)},
            "distance": self.distance,
            "lag": self.lag,
            "stable_branch": self.labels,
        }
        # a state may have this name
        return {**found, "phase": found.get("phase", self._phase_types())}

    @property
    def labels(self) -> NDArray[np.str_]:
        """Label of the stable branch followed at each row, "" where there is none.

        ``"S1|S2 (sticking)"`` where the state is at rest in a band of equilibria, and
        ``"edge of S1|S2"`` where it slips along the edge of the band.
        """
        return self._of_rows.labels()

    @validated(name=formula)
    def gradient(self, transition: int | Transition, name: Name) -> NamedMapping[float]:
        """Compute the derivatives of a measured delay with respect to a parameter or initial state.

        They are those of the run by its variational equations, minus those of the special point
        (`SpecialPoint.gradient`). The event is that of ``transition.time``: the crossing of an
        interface; the extremum of the slow quantity; the distance from the branch that is left,
        kept at its present value; or, of a jump, the state that changes most, at its present
        level.

        Parameters
        ----------
        transition : int or Transition
            A departure from a stable branch, one of ``transitions`` or its index.
        name : str or Symbol
            A parameter of the model, also of its forcing, or a state, for its initial value; of
            the overlay of a slice that at the start of the slice.

        Returns
        -------
        NamedMapping of float
            Of ``time``, ``value`` and, with a special point, ``delay``; in a gap crossing
            also of ``duration`` and ``width``, between its two interfaces.

        Raises
        ------
        UnknownNameError
            For another name.
        ArgumentError
            Where there is no derivative: after a tangential crossing, at a level that is touched,
            at an exit that rounding or the tolerance determines; at the end of an oscillation;
            for a run without dense output; over periodic orbits.
        ModelError
            For an overlay read from a file.

        Examples
        --------
        >>> import fastslow as fs
        >>> model = fs.systems.cusp(omega=0.002)
        >>> diagram = fs.continue_equilibria(model.frozen(), "p", over=(-1.2, 1.2))
        >>> overlay = fs.overlay(diagram, fs.simulate(model, [-1.0], periods=1))
        >>> [*overlay.gradient(0, "omega")]
        ['time', 'value', 'delay']
        """
        require_equilibria(self, "the derivative of a transition")
        found: NamedMapping[float] = computed(
            "fastslow.passage.overlay.transition_gradients", "gradient_of_transition"
        )(self, transition, name)
        return found

    @cached_property
    def freezing(self) -> Freezing:
        """The slow manifold to second order along the run: where freezing is valid.

        Computed on first use, from the equations of the diagram and the dense output of the run.

        Raises
        ------
        ArgumentError
            Over periodic orbits, or for a run without dense output.
        ModelError
            For an overlay read from a file.

        Examples
        --------
        >>> import fastslow as fs
        >>> model = fs.systems.cusp(omega=0.002)
        >>> diagram = fs.continue_equilibria(model.frozen(), "p", over=(-1.2, 1.2))
        >>> overlay = fs.overlay(diagram, fs.simulate(model, [-1.0], periods=1))
        >>> valid = overlay.freezing["ratio"] < 0.1
        """
        found: Freezing = computed("fastslow.passage.overlay.freezing_bands", "freezing_of")(self)
        return found

    def _item(self, row: int) -> StatePoint:
        return self._of_rows.point(row)

    def _rows(self, rows: Any) -> Overlay:
        """Return the overlay of consecutive rows."""
        start, stop = slice_bounds(rows, len(self), "an overlay")
        if stop - start == len(self):
            return self
        begin, end = float(self.t[start]), float(self.t[stop - 1])
        columns = ("t", "slow", "state", "followed", "distance", "lag", "relaxation")
        return replace(
            self,
            **{name: getattr(self, name)[start:stop] for name in columns},
            phases=clipped(self.phases, begin, end),
            transitions=Transitions(t for t in self.transitions if begin <= t.time <= end),
            # bursting is classified for the whole run only
            bursting=None,
            turning=tuple(m for m in self.turning if begin <= m.time <= end),
            **self._of_rows.part(start, stop),
        )

    def _constants(self) -> Mapping[str, float]:
        return {**self.run.parameters, **self.diagram.parameters}

    def _columns(self) -> Columns:
        return self._of_rows.columns()

    def _read(self, key: Any) -> tuple[Any, Columns]:
        return self._of_rows.read(key)

    @validated(region=text, stable_branch=text, direction=among(-1, 0, 1, None))
    def at(
        self,
        *,
        region: str | None = None,
        stable_branch: str | None = None,
        direction: int | None = None,
        **value: Any,
    ) -> list[Any]:
        """Return the states at which a column takes a value, with the stable branch followed.

        As `Trajectory.at`; the parameter of a path is interpolated between samples. Over orbits
        the strobes nearest to the passages of a column through a value.

        Parameters
        ----------
        region : str, optional
            Keep only those in one region.
        stable_branch : str, optional
            Keep only those on the stable branch with this label; ``""`` for none.
        direction : int, optional
            Keep only upward crossings (+1), downward crossings (−1), or tangencies (0).
        **value : float or array_like, shape (m,)
            Name of a state, a slow quantity or ``t``, e.g. ``w=0.1``.

        Returns
        -------
        list of StatePoint, or list of m such lists
            In order of time; a list for each value of an array.

        Raises
        ------
        UnknownNameError
            For an unknown column, region or stable branch.
        ArgumentError
            If the column does not take the value.

        Examples
        --------
        >>> import fastslow as fs
        >>> model = fs.systems.cusp(omega=0.002)
        >>> diagram = fs.continue_equilibria(model.frozen(), "p", over=(-1.2, 1.2))
        >>> overlay = fs.overlay(diagram, fs.simulate(model, [-1.0], periods=1))
        >>> [(point.stable_branch, round(point["x"], 3)) for point in overlay.at(p=0)]
        [('S1.1', -1.0), ('S1.2', 1.0), ('S1.1', -1.0)]
        >>> [part.transitions[0].to_branch for part in overlay.select(type="jump")]
        ['S1.2', 'S1.1']
        """
        name, given = named_value("column", self._of_rows.names, value)
        self._check_branch(stable_branch)
        self.run._check_region(region)

        def query(level: float) -> list[StatePoint]:
            found = self._of_rows.at(name, level, region, direction)
            return [p for p in found if stable_branch in (None, p.stable_branch)]

        return at_values(name, given, query)

    def _check_branch(self, stable_branch: str | None) -> None:
        """Raise for the label of no stable branch; "" means that none is followed."""
        labels = self._of_rows.known_labels
        if stable_branch and stable_branch not in labels:
            raise unknown_name("stable branch", stable_branch, labels)

    @validated(region=text, stable_branch=text, type=text)
    def select(
        self,
        condition: Condition | None = None,
        /,
        *,
        region: str | None = None,
        stable_branch: str | None = None,
        type: str | None = None,
        between: tuple[float, float] | None = None,
    ) -> tuple[Overlay, ...]:
        """Return the intervals of the overlay on which all conditions hold, in order.

        Parameters
        ----------
        condition : str or Expr, optional
            Rows at which a condition in columns and parameters is true, such as
            ``"distance > 0.1 and x > 0"``.
        region : str, optional
            Rows in one region.
        stable_branch : str, optional
            Rows on the stable branch with this label; ``""`` for none.
        type : str, optional
            Rows in a phase of this type; see `fastslow.results.overlay.transitions.Phase`.
        between : (float, float), optional
            Rows between two times, ends included.

        Returns
        -------
        tuple of Overlay
            Each with its phases, transitions and, over equilibria, its interval of the run;
            ``bursting`` is None.

        Raises
        ------
        UnknownNameError
            For an unknown column, region, stable branch or type of phase.
        ArgumentError
            For an invalid condition or range.
        """
        wanted = np.ones(len(self), dtype=bool)
        if condition is not None:
            wanted &= rows_where(condition, self._columns(), self._constants(), len(self))
        if stable_branch is not None:
            self._check_branch(stable_branch)
            wanted &= self.labels == stable_branch
        if region is not None:
            self.run._check_region(region)
            wanted &= self.run.regions_at(self.t) == region
        if type is not None:
            word("type of phase", PHASES)("type", type)
            wanted &= self._phase_types() == type
        if between is not None:
            low, high = limits_of(between)
            wanted &= (self.t >= low) & (self.t <= high)
        return tuple(self._rows(slice(*ends)) for ends in runs_of(wanted))

    def nearest(self, **values: float) -> StatePoint:
        """Return the state nearest to given values of columns, with the stable branch followed.

        As `Trajectory.nearest`; the parameter of a path is interpolated between samples. Over
        orbits the nearest strobe.

        Parameters
        ----------
        **values : float
            Values of at least one state, slow quantity or ``t``, e.g. ``w=0.1, x=0.3``.

        Returns
        -------
        StatePoint

        Raises
        ------
        UnknownNameError
            For an unknown column.
        ArgumentError
            For a number that is not finite, or without values.
        """
        return self._of_rows.nearest(values)

    def shares(self) -> dict[str, float]:
        """Return the fraction of time, or of strobes, on each stable branch and in each band.

        The key ``""`` stands for none.
        """
        weight = self._of_rows.weights()
        total = float(weight.sum()) or 1.0
        labels = self.labels[: len(weight)]
        known = dict.fromkeys(["", *self._of_rows.known_labels])
        found = {label: float(weight[labels == label].sum() / total) for label in known}
        return {label: share for label, share in found.items() if share > 0}

    def _groups(self) -> list[list[str]]:
        doubts = [f"  {sentence}" for sentence in self._of_rows.doubts()]
        return [list(self._head()), list(self._phases()), list(self._events()), doubts]

    def _head(self) -> Iterator[str]:
        """Yield the range of the overlay and its limitations."""
        name, count = self.parameter, len(self.transitions)
        yield (
            f"Overlay on {name}: {count} transition{'' if count == 1 else 's'}"
            f"{self._of_rows.count()} over t = {self.t[0]:g} to {self.t[-1]:g}, "
            f"{name} from {self.slow.min():.6g} to {self.slow.max():.6g}"
        )
        yield from self._endings()
        if self._of_rows.lacking():
            yield f"  {self._of_rows.lacking()}"

    def _phases(self) -> Iterator[str]:
        """Yield the fractions on the branches, the phases and the bursting."""
        rows = self._of_rows
        for label, share in self.shares().items():
            words = f"{label or 'no stable branch'}: {share:.1%} of the {rows.share_of}"
            yield f"  on {words}{rows.named(label)}{self._lag(label)}"
        yield from self._sticking()
        yield from self._oscillating()
        if self.bursting is not None:
            yield f"  {self.bursting}"
            yield from (f"    {sentence}" for sentence in self.bursting.evidence)

    def _sticking(self) -> Iterator[str]:
        """Number and durations of the sticking phases in each band."""
        sticking = [phase for phase in self.phases if phase.type == "sticking"]
        for name in dict.fromkeys(phase.stable_branches[0] for phase in sticking):
            lengths = [phase.duration for phase in sticking if phase.stable_branches[0] == name]
            count = len(lengths)
            times = "time" if count == 1 else "times"
            yield f"  in {name}: {count} {times}, duration {_range(lengths)}"

    def _oscillating(self) -> Iterator[str]:
        """Oscillating phases, one line for each attractor."""
        groups: dict[tuple[str, tuple[str, ...]], list[Phase]] = {}
        for phase in self.phases:
            if phase.type == "oscillating":
                groups.setdefault((phase.attractor, phase.stable_branches), []).append(phase)
        for (attractor, stable_branches), phases in groups.items():
            counts, lengths = [p.oscillations for p in phases], [p.duration for p in phases]
            what = "on a cycle" if attractor == "cycle" else f"settling on {stable_branches[0]}"
            yield (
                f"  {len(phases)} oscillating phase{'' if len(phases) == 1 else 's'} {what}: "
                f"{_range(counts)} oscillations, duration {_range(lengths)}"
            )


def require_equilibria(overlay: Overlay, task: str) -> None:
    """Raise ArgumentError over orbits, for what is defined over equilibria only."""
    if overlay.branches:
        raise ArgumentError(
            f"{task} takes an overlay of equilibria; received one of periodic orbits"
        )


def _range(values: Sequence[float]) -> str:
    """Format the range of some values with three digits."""
    low, high = (f"{v:.3g}" if v < 1000 else f"{v:.0f}" for v in (min(values), max(values)))
    return low if low == high else f"{low} to {high}"
