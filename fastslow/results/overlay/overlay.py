"""A trajectory measured against an equilibrium diagram."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import chain
from typing import Any, overload

import numpy as np
from numpy.typing import NDArray

from fastslow.arguments import among, position, text, validated
from fastslow.formulas.columns import by_value, evaluated
from fastslow.results.base.outcome import Outcome
from fastslow.results.base.result import Result
from fastslow.results.base.table import Table
from fastslow.results.branch.diagram import Diagram
from fastslow.results.overlay import queries
from fastslow.results.overlay.delays import BranchPointExit, HopfExit
from fastslow.results.overlay.transitions import (
    Bursting,
    Phase,
    StableSheet,
    Transition,
    Transitions,
)
from fastslow.results.trajectory.crossings import regions_at
from fastslow.results.trajectory.state_at import StatePoint, in_blocks, sample
from fastslow.results.trajectory.trajectory import Trajectory

#: The usual outcome of an overlay.
MEASURED = Outcome("measured", "the diagram covers the whole run.", True)


#: The median lag is given where at least this fraction of the samples have one.
LAGGING = 0.5

#: Transitions that a summary lists; all are in ``transitions``.
SHOWN = 12


@dataclass(frozen=True, eq=False)
class Overlay(Table, Result):
    """A trajectory laid over the equilibrium diagram of its frozen model.

    ``lay["distance"]`` is a column and ``lay["x - w"]`` an expression, sample by sample;
    ``lay[3]`` and iteration give the moments of samples, with the sheet followed then, and
    ``lay[10:50]`` is the overlay of those samples.

    Parameters
    ----------
    diagram : Diagram
    run : Trajectory
    time, slow : ndarray, shape (N,)
        Times, and the diagram's parameter there: a slow quantity of the run, or the
        parameter of the path along which the model was frozen.
    state : ndarray, shape (N, n)
        The fast states at those times.
    extent : ndarray, shape (n,)
        Unit of each state in distances: its extent in the run or on the sheets that the run
        can follow, whichever is larger, if that is within reason of what the branches span;
        of a velocity at least that of its state times |λ|.
    radius : float
        What counts as near, in those units.
    sheets : tuple of StableSheet
        All stable sheets of the diagram.
    followed : ndarray of int, shape (N,)
        Index into ``sheets``; −1 where none is followed: before the first and after the last
        sheet, while oscillating on a cycle, and outside the diagram's range.
    distance : ndarray, shape (N,)
        From the followed sheet (past a Hopf point its unstable continuation, past a fold the
        fold); where none is followed from the nearest stable one, infinite without any.
    lag : ndarray, shape (N,)
        How much time the motion is behind the sheet that it follows, X(w(t − lag)) ≈ x(t):
        the deviation along the sheet over the speed at which the sheet drifts. nan where no
        sheet is followed, or where the sheet or the slow quantity stands still.
    relaxation : ndarray, shape (N,)
        Relaxation time 1/|Re λ| of the followed sheet; nan where it is not stable.
    phases : tuple of Phase
        All of the run, in time.
    transitions : tuple of Transition
        Every leaving of a sheet and end of an oscillation, in time.
    bursting : Bursting or None
        What the rhythm is called; None without one.
    turning : tuple of StatePoint
        Where the slow quantity turns back.
    outcome : Outcome
        Whether the diagram covers the run.
    band : ndarray of int, shape (N,), optional
        Index into the diagram's ``bands`` where the run rests in one, as a block that
        sticks by dry friction does, or slips along its edge; else −1.
    """

    diagram: Diagram
    run: Trajectory
    time: NDArray[np.float64]
    slow: NDArray[np.float64]
    state: NDArray[np.float64]
    extent: NDArray[np.float64]
    radius: float
    sheets: tuple[StableSheet, ...]
    followed: NDArray[np.intp]
    distance: NDArray[np.float64]
    lag: NDArray[np.float64]
    relaxation: NDArray[np.float64]
    phases: tuple[Phase, ...]
    transitions: tuple[Transition, ...]
    bursting: Bursting | None
    turning: tuple[StatePoint, ...]
    outcome: Outcome = MEASURED
    band: NDArray[np.intp] | None = None

    _row = "t"
    _places = ("t",)

    def __len__(self) -> int:
        return len(self.time)

    def __iter__(self) -> Iterator[StatePoint]:
        return chain.from_iterable(queries.measured(self, block) for block in in_blocks(self.run))

    def to_dict(self) -> dict[str, NDArray[Any]]:
        """Time t, the slow quantity, states, distance, lag, and what is followed."""
        return {
            "t": self.time,
            self.parameter: self.slow,
            **{name: self.state[:, k] for k, name in enumerate(self.diagram.states)},
            "distance": self.distance,
            "lag": self.lag,
            "sheet": self.labels,
        }

    @property
    def parameter(self) -> str:
        """The slow quantity, the parameter of the diagram."""
        return self.diagram.parameter

    @property
    def labels(self) -> NDArray[np.str_]:
        """What is followed at each sample, "" for nothing.

        The label of a sheet; ``"S1|S2 (sticking)"`` where the run rests in a band of
        equilibria, and ``"edge of S1|S2"`` where it slips along the edge of the band.
        """
        labels = np.array([*(sheet.label for sheet in self.sheets), ""])[self.followed]
        if self.band is None or not self.diagram.bands:
            return labels
        names = np.array([band.name for band in self.diagram.bands])
        edges = np.array([band.edge for band in self.diagram.bands])
        regions = np.array([band.region for band in self.diagram.bands])
        rests = regions_at(self.run, self.time) == regions[self.band]
        kept = np.where(rests, names[self.band], edges[self.band])
        return np.where(self.band >= 0, kept, labels)

    @property
    def delays(self) -> NDArray[np.float64]:
        """Delay of every transition, in the slow quantity's units."""
        return np.array([t.delay for t in self.transitions])

    @property
    def special(self) -> Transitions:
        """The transitions; ``lay.special("jump")`` those of one kind."""
        return Transitions(self.transitions)

    @overload
    def __getitem__(self, key: slice) -> Overlay: ...
    @overload
    def __getitem__(self, key: int) -> StatePoint: ...
    @overload
    def __getitem__(self, key: str) -> NDArray[np.float64]: ...
    def __getitem__(self, key: object) -> Overlay | StatePoint | NDArray[np.float64]:
        """A column or expression, shape (N,); the moment of a sample; the overlay of some samples.

        Columns are states, slow quantities, t, distance and lag. Parameters may
        stand in an expression too.

        Raises
        ------
        UnknownNameError
            For a name that is none of these.
        ArgumentError
            For what is no expression, or a slice that holds no sample or leaves some out.
        OutOfRangeError
            For a sample that there is not.
        """
        if isinstance(key, slice):
            return queries.rows_of(self, key)
        if isinstance(key, int | np.integer) and not isinstance(key, bool):
            row = position(key, len(self), "sample")
            return queries.measured(self, [sample(self.run, row)])[0]
        known = {
            "t": self.time,
            "distance": self.distance,
            "lag": self.lag,
            **self.run.parameters,
            **self.diagram.parameters,
            **{name: self.run[name] for name in self.run.columns},
            self.parameter: self.slow,
        }
        return np.broadcast_to(evaluated(key, known, by_value("t", key)), self.time.shape)

    @validated(region=text, sheet=text, direction=among(-1, 0, 1, None))
    def at(
        self,
        *,
        region: str | None = None,
        sheet: str | None = None,
        direction: int | None = None,
        **value: float,
    ) -> list[StatePoint]:
        """The moments at one value of a column, with the sheet followed then.

        As `Trajectory.at`; the parameter of a path is read between samples.

        Parameters
        ----------
        region : str, optional
            Keep only those in one region.
        sheet : str, optional
            Keep only those on the sheet of this label; ``""`` those on none.
        direction : int, optional
            Keep only passages upwards (+1), downwards (−1), or touches (0).
        **value : float
            A state, slow quantity or ``t`` by name, e.g. ``w=0.1``.

        Returns
        -------
        list of StatePoint
            In order of time.

        Raises
        ------
        UnknownNameError
            For a name that is no column, no region or no sheet.
        ArgumentError
            If the run does not reach the value.

        Examples
        --------
        >>> import fastslow as fs
        >>> model = fs.systems.cusp(omega=0.002)
        >>> diagram = fs.continue_equilibria(model.frozen(), "p", over=(-1.2, 1.2))
        >>> lay = fs.overlay(diagram, fs.simulate(model, [-1.0], periods=1))
        >>> [(moment.sheet, round(moment["x"], 3)) for moment in lay.at(p=0)]
        [('S1.1', -1.0), ('S1.2', 1.0), ('S1.1', -1.0)]
        >>> [part.special("jump")[0].to_sheet for part in lay.select(kind="jump")]
        ['S1.2', 'S1.1']
        """
        return queries.moments_of(self, value, direction, sheet, region)

    @validated(region=text, sheet=text, kind=text)
    def select(
        self,
        *,
        region: str | None = None,
        sheet: str | None = None,
        kind: str | None = None,
        between: tuple[float, float] | None = None,
    ) -> tuple[Overlay, ...]:
        """The parts of the overlay whose samples all fulfil the conditions, in order.

        Parameters
        ----------
        region : str, optional
            Samples in one region.
        sheet : str, optional
            Samples on the sheet of this label; ``""`` those on none.
        kind : str, optional
            Samples in a phase of this kind; see `fastslow.results.overlay.transitions.Phase`.
        between : (float, float), optional
            Samples between two times, ends included.

        Returns
        -------
        tuple of Overlay
            Each with its part of the run, phases and transitions, and without ``bursting``.

        Raises
        ------
        UnknownNameError
            For a region, sheet or kind that there is not.
        ArgumentError
            For a range that is none.
        """
        return queries.parts_of(self, sheet, region, kind, between)

    def nearest(self, **values: float) -> StatePoint:
        """The moment nearest to some values of columns, with the sheet followed then.

        As `Trajectory.nearest`; the parameter of a path is read between samples.

        Parameters
        ----------
        **values : float
            At least one of the states, slow quantities and ``t``, e.g. ``w=0.1, x=0.3``.

        Returns
        -------
        StatePoint

        Raises
        ------
        UnknownNameError
            For a name that is no column.
        ArgumentError
            For a number that is not finite, or none at all.
        """
        return queries.nearest_on(self, values)

    def shares(self) -> dict[str, float]:
        """Part of the time on each sheet or in each band, and in ``""`` on none."""
        weight = np.diff(self.time)
        total = float(weight.sum()) or 1.0
        labels = self.labels[:-1]
        known = [s.label for s in self.sheets]
        known += [name for band in self.diagram.bands for name in (band.name, band.edge)]
        times = {k: weight[labels == k].sum() / total for k in dict.fromkeys(["", *known])}
        return {k: float(v) for k, v in times.items() if v > 0}

    def summary(self) -> str:
        """The story in words and numbers: sheets, phases, rhythm, and every transition."""
        return "\n".join(self._lines())

    def _lines(self) -> Iterator[str]:
        name, count = self.parameter, len(self.transitions)
        yield (
            f"{count} transition{'' if count == 1 else 's'} over "
            f"t = {self.time[0]:g} to {self.time[-1]:g}, "
            f"{name} from {self.slow.min():.6g} to {self.slow.max():.6g}"
        )
        if not self.outcome:
            yield f"  {self.outcome}"
        if not self.run.outcome and self.outcome.code != "cut short":
            yield f"  the run ended early: {self.run.outcome}"
        if not self.sheets and not self.diagram.bands:
            yield "  the diagram has no stable sheet"
        elif not self.diagram.folds:
            yield "  the diagram has no fold"
        for label, share in self.shares().items():
            yield f"  on {label or 'no sheet'}: {share:.1%} of the time{self._behind(label)}"
        yield from self._sticking()
        yield from self._oscillating()
        if self.bursting is not None:
            yield f"  {self.bursting}"
            yield from (f"    {sentence}" for sentence in self.bursting.evidence)
        yield from (f"  {t.describe(name)}" for t in self.transitions[:SHOWN])
        if count > SHOWN:
            yield f"  and {count - SHOWN} more, in transitions"
        lost = {
            f"  {t.law.point.label}: {t.law.validity}": None
            for t in self.transitions
            if isinstance(t.law, HopfExit | BranchPointExit) and t.law.forgotten
        }
        yield from lost

    def _behind(self, label: str) -> str:
        """The median lag behind a sheet, where most samples on it have one."""
        numbers = [k for k, sheet in enumerate(self.sheets) if sheet.label == label]
        lags = self.lag[np.isin(self.followed, numbers)]
        known = lags[np.isfinite(lags)]
        if not len(known) or len(known) < LAGGING * len(lags):
            return ""
        # the places of the samples, and so the third digit, depend on the processor's rounding
        return f", median lag {float(np.median(known)):.2g}"

    def _sticking(self) -> Iterator[str]:
        """How often the run rests in each band."""
        met = [phase for phase in self.phases if phase.kind == "sticking"]
        for name in dict.fromkeys(phase.sheets[0] for phase in met):
            lengths = [phase.duration for phase in met if phase.sheets[0] == name]
            count = len(lengths)
            yield f"  in {name}: {count} time{'' if count == 1 else 's'}, {_range(lengths)} long"

    def _oscillating(self) -> Iterator[str]:
        """Oscillating phases that are alike, in one line each."""
        groups: dict[tuple[str, tuple[str, ...]], list[Phase]] = {}
        for phase in self.phases:
            if phase.kind == "oscillating":
                groups.setdefault((phase.attractor, phase.sheets), []).append(phase)
        for (attractor, sheets), met in groups.items():
            counts, lengths = [p.oscillations for p in met], [p.duration for p in met]
            what = "on a cycle" if attractor == "cycle" else f"settling on {sheets[0]}"
            yield (
                f"  {len(met)} oscillating phase{'' if len(met) == 1 else 's'} {what}: "
                f"{_range(counts)} oscillations, {_range(lengths)} long"
            )

    def __repr__(self) -> str:
        return f"Overlay on {self.parameter}: {self.summary()}"


def _range(values: Sequence[float]) -> str:
    """The values from least to largest, to three digits."""
    low, high = (f"{v:.3g}" if v < 1000 else f"{v:.0f}" for v in (min(values), max(values)))
    return low if low == high else f"{low} to {high}"
