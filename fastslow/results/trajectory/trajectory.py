"""Trajectories: the solution in time, its crossings of interfaces and its itinerary."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import pairwise
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from fastslow.arguments import (
    Expression,
    Name,
    among,
    finite,
    formula,
    items,
    positive,
    text,
    validated,
    whole,
    within,
)
from fastslow.errors import ArgumentError, unknown_name
from fastslow.results.base.html import Cells
from fastslow.results.base.outcome import early_end, stopped_early
from fastslow.results.base.result import STORED
from fastslow.results.base.upper_layers import computed
from fastslow.results.stored.model import StoredModel
from fastslow.results.trajectory.events.contacts import (
    Contacts,
    contacts_of,
    count_hits,
    time_fractions_in,
)
from fastslow.results.trajectory.events.crossings import (
    Crossing,
    Crossings,
    Segment,
)
from fastslow.results.trajectory.events.occurrences import Occurrence, Occurrences
from fastslow.results.trajectory.events.resets import ResetEvent, Resets
from fastslow.results.trajectory.events.switches import Switches, SwitchEvent
from fastslow.results.trajectory.long_time.mixed_modes import MixedMode, mixed_mode_of
from fastslow.results.trajectory.long_time.periodicity import (
    INTEGRATION_ERRORS,
    LATE,
    Periodicity,
    periodicity_of,
)
from fastslow.results.trajectory.long_time.regimes import (
    REPEATING,
    Regimes,
    bits_of,
    edges_of_periods,
    gap_regions,
    regimes_of,
    touched_in,
)
from fastslow.results.trajectory.long_time.section import (
    Section,
    level_section,
    selected,
    stroboscopic_section,
)
from fastslow.results.trajectory.long_time.spectrum import Spectrum, spectrum_of
from fastslow.results.trajectory.sensitivity import Sensitivity
from fastslow.results.trajectory.solution import Solution

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class Trajectory(Solution):
    """A solution in time.

    ``run["x"]`` is a column and ``run["x**2 + v"]`` an expression at the samples ``run.t``;
    ``run[3]`` and iteration return the states at samples, ``run[10:50]`` is the trajectory
    of those samples, with its crossings, and ``run(t)`` returns the states at any time.

    Parameters
    ----------
    states : tuple of str
        States, slow states, then parameters that events assign: the order of every state vector.
    forcing : tuple of str
        Slow quantities, then switches.
    interfaces, regions : tuple of str
        Names in the model's order.
    parameters : mapping
        Parameter values.
    period : float or None
        Common period of all forcing.
    gap : tuple of str or None
        For a model with a gap, the regions below, inside and above it.
    outcome : Outcome
        The outcome at the end of the run.
    end : ndarray, shape (1 + n,)
        Time and state reached.
    method : str
        The integration method.
    steps : ndarray, shape (n_steps, 4)
        Time, length, mode and method of every step: 0 Taylor series, 1 collocation,
        2 an implicit method.
    modes : tuple of str
        Names of the modes in ``steps`` and ``crossing_table``: regions, then sliding motions.
    crossing_table : ndarray, shape (n_crossings, 6 + n)
        Time, interface, direction, mode before, mode after, near-tangential, state.
    series : ndarray, shape (n_steps, n + n_forcing, order + 1), optional
        Taylor coefficients of every step.
    sampled : tuple of ndarray, optional
        Times of the samples (N,) and their columns (n or n + n_forcing, N).
    span : tuple of float
        First and last time.
    equations : str
        The model as text.
    settings : mapping
        The settings of the integration.
    periods : mapping
        The period of each periodic state. Its column is unwrapped, that is, continuous
        beyond one period; distances are taken modulo the period.
    model : Model or StoredModel, optional
        The simulated model; for a run loaded from a file a stored model, which can be
        simulated again and does not require SymPy.
    reset_names : tuple of str
        The resets of the model.
    reset_table : ndarray, shape (n_resets, 2 + 2 n), optional
        Time, reset, state before, state after.
    n_periods : float, optional
        The length of the run in periods, if it was given so.
    backwards : bool
        Whether the run was integrated backwards, from its last time to its first.
    switch_names : tuple of str
        The switches of the model, whose columns are 0 or 1.
    switch_table : ndarray, shape (n_changes, 3 + n), optional
        Time, switch, new value, state.
    end_switches : ndarray, shape (n_switches,), optional
        Values of the switches at the end.
    earliest : ndarray, shape (n,), optional
        Of a run backwards, the state at its first time, which it reached.
    event_names : tuple of str
        The events of the model.
    event_table : ndarray, shape (n_executions, 2 + 2 n), optional
        Time, event, state before, state after.

    Examples
    --------
    >>> import sympy as sp, fastslow as fs
    >>> x, v = sp.symbols("x v")
    >>> run = fs.simulate(fs.Model({x: v, v: -sp.sign(x)}), [0.5, 0.0], t=(0, 3))
    >>> run.crossings
    1 crossing
      Crossing(t = 1, x downwards, S1 → S2)
    >>> run.itinerary
    ('S1', 'S2')
    >>> run(3.0).round(12)
    array([0., 1.])
    """

    interfaces: tuple[str, ...]
    period: float | None
    gap: tuple[str, str, str] | None
    method: str
    crossing_table: Array
    equations: str = ""
    settings: Mapping[str, Any] = field(default_factory=dict)
    model: Any = field(default=None, repr=False, metadata=STORED)
    reset_names: tuple[str, ...] = ()
    reset_table: Array | None = None
    n_periods: float | None = None
    backwards: bool = False
    switch_names: tuple[str, ...] = ()
    switch_table: Array | None = None
    end_switches: Array | None = None
    earliest: Array | None = None
    event_names: tuple[str, ...] = ()
    event_table: Array | None = None

    @property
    def stored_model(self) -> StoredModel | None:
        """The model as stored in files."""
        return None if self.model is None else self.model._stored_for(self.modes)

    @property
    def symbolic_model(self) -> Any:
        """The model with its SymPy equations, None for a run loaded from a file."""
        return None if isinstance(self.model, StoredModel) else self.model

    @property
    def _computed_here(self) -> bool:
        return self.symbolic_model is not None

    @cached_property
    def crossings(self) -> Crossings:
        """Crossings in order of time; ``run.crossings("x - D", direction=+1)`` selects some."""
        found = (
            Crossing(
                float(row[0]),
                row[6:].copy(),
                self.interfaces[int(row[1])],
                int(row[2]),
                self.modes[int(row[3])],
                self.modes[int(row[4])],
                bool(row[5]),
            )
            for row in self.crossing_table
        )
        return Crossings(found, self.interfaces, self.states)

    @cached_property
    def resets(self) -> Resets:
        """Resets in order of time, with the states before and after.

        Examples
        --------
        >>> import sympy as sp, fastslow as fs
        >>> x, v = sp.symbols("x v")
        >>> ball = fs.Model({x: v, v: -1}, resets={x <= 0: {v: -v / 2}})
        >>> run = fs.simulate(ball, [0.5, 0.0], t=(0, 2))
        >>> run.resets
        1 reset
          ResetEvent(t = 1, x <= 0)
        >>> run.resets[0].before.round(12), run.resets[0].after.round(12)
        (array([ 0., -1.]), array([0. , 0.5]))
        """
        found = (ResetEvent(*one) for one in self._jumps(self.reset_table, self.reset_names))
        return Resets(found, self.reset_names, self.states)

    @cached_property
    def events(self) -> Occurrences:
        """Executions of events in order of time, with the states before and after.

        Examples
        --------
        >>> import fastslow as fs
        >>> model = fs.Model({"x": "k"}, parameters={"k": 1}, events={"x > 1": {"k": -2}})
        >>> run = fs.simulate(model, [0], t=(0, 2))
        >>> run.events
        1 event
          Occurrence(t = 1, x > 1)
        >>> run.states, run.events[0].after
        (('x', 'k'), array([ 1., -2.]))
        """
        found = (Occurrence(*one) for one in self._jumps(self.event_table, self.event_names))
        return Occurrences(found, self.event_names, self.states)

    def _jumps(
        self, table: Array | None, names: tuple[str, ...]
    ) -> Iterator[tuple[float, Array, Array, str]]:
        """Yield time, states before and after, and name of each jump in a table."""
        n = len(self.states)
        for row in () if table is None else table:
            yield float(row[0]), row[2 : 2 + n].copy(), row[2 + n :].copy(), names[int(row[1])]

    @cached_property
    def switches(self) -> Switches:
        """Changes of switches in order of time.

        Examples
        --------
        >>> import sympy as sp, fastslow as fs
        >>> x, q = sp.symbols("x q")
        >>> relay = fs.Model({x: 2 * q - 1}, switches={q: (x < 0, x > 1)})
        >>> run = fs.simulate(relay, {x: 0.5, q: 1}, t=(0, 2))
        >>> run.switches
        2 changes of switches
          SwitchEvent(t = 0.5, q = 0)
          SwitchEvent(t = 1.5, q = 1)
        >>> float(run(1.0)[0]), run.at(t=1.0)[0]["q"]
        (0.5, 0.0)
        """
        table = np.empty((0, 3)) if self.switch_table is None else self.switch_table
        found = (
            SwitchEvent(float(row[0]), self.switch_names[int(row[1])], int(row[2]), row[3:].copy())
            for row in table
        )
        return Switches(found, self.switch_names, self.states)

    @cached_property
    def segments(self) -> tuple[Segment, ...]:
        """The time intervals in one region and with constant switches, in order."""
        found = super().segments
        if self.end_switches is None or self.switch_table is None:
            return found
        values, changes = self._switches_at(-np.inf), self.switch_table
        times = np.unique(changes[:, 0])
        parts, row = [], 0
        for one in found:
            inside = times[(times > one.start) & (times < one.end)].tolist()
            for begin, end in pairwise([one.start, *inside, one.end]):
                while row < len(changes) and changes[row, 0] <= begin:
                    values[int(changes[row, 1])] = changes[row, 2]
                    row += 1
                states = (f"{n} = {v:g}" for n, v in zip(self.switch_names, values, strict=True))
                parts.append(Segment(begin, end, one.region, ", ".join(states)))
        return tuple(parts)

    @property
    def final_state(self) -> dict[str, float]:
        """The state reached, by name and with the switches: an initial state of another run.

        Examples
        --------
        >>> import sympy as sp, fastslow as fs
        >>> x, q = sp.symbols("x q")
        >>> relay = fs.Model({x: 2 * q - 1}, switches={q: (x < 0, x > 1)})
        >>> fs.simulate(relay, {x: 0.5, q: 1}, t=(0, 1)).final_state
        {'x': 0.5, 'q': 0.0}

        Of a run backwards it is the state at its earliest time:

        >>> run = fs.simulate(fs.Model({x: 1}), [0.5], t=(0, -1))
        >>> run.final_state
        {'x': -0.5}
        """
        reached = self.end[1:] if self.earliest is None else self.earliest
        values = reached if self.end_switches is None else [*reached, *self.end_switches]
        return dict(zip((*self.states, *self.switch_names), map(float, values), strict=True))

    def _cut(self, begin: float, end: float, sampled: tuple[Array, Array] | None) -> Self:
        part = super()._cut(begin, end, sampled)
        tables = {
            name: table[(table[:, 0] >= begin) & (table[:, 0] <= end)]
            for name in ("crossing_table", "reset_table", "switch_table", "event_table")
            if (table := getattr(self, name)) is not None
        }
        jumped = any(
            len(tables.get(name, ())) and tables[name][-1, 0] == end
            for name in ("reset_table", "event_table")
        )
        if jumped and end < self.span[1]:
            # the state at a jump is that after it
            tables["end"] = np.append(end, self(end))
        if self.earliest is not None and begin > self.span[0]:
            columns = part.sampled_columns if part.series is None else part.series[0]
            tables["earliest"] = columns[: len(self.states), 0].copy()
        if self.switch_names and end < self.span[1]:
            tables["end_switches"] = np.array(self._switches_at(end))
        return replace(part, **tables, n_periods=None)

    def _switches_at(self, time: float) -> list[float]:
        """Values of the switches at a time, after changes at it."""
        assert self.end_switches is not None
        assert self.switch_table is not None
        values: list[float] = self.end_switches.tolist()
        for row in self.switch_table[::-1]:
            if row[0] <= time:
                break
            values[int(row[1])] = 1.0 - row[2]
        return values

    @cached_property
    def regime(self) -> str | None:
        """The contact regime of a gap in the second half of the run.

        ``"bilateral"``, ``"unilateral upper"``, ``"unilateral lower"``, ``"meshed upper"``,
        ``"meshed lower"`` or ``"free"`` if it is that of all whole periods, or of several
        together after which the motion repeats; else ``"not settled"``. None for models
        without gap or period. A run of fewer than four periods is classified by its last
        period. Sliding along an edge counts as contact; grazing contacts are decided by
        rounding. `regimes` returns the fractions of the periods,
        `fastslow.classify_regime` distinguishes chaos from a transient.
        """
        return None if self._regimes is None else self._regimes.label

    @cached_property
    def _regimes(self) -> Regimes | None:
        known = self.gap is not None and self.period is not None
        return self.regimes() if known else None

    @validated(period=positive, gap=text, since=finite, until=finite, tol=positive)
    def regimes(
        self,
        period: float | None = None,
        *,
        gap: str | None = None,
        since: float | None = None,
        until: float | None = None,
        tol: float = REPEATING,
    ) -> Regimes:
        """Classify each period of a time interval, and detect whether the states repeat.

        Parameters
        ----------
        period : float, optional
            By default that of the forcing.
        gap : str, optional
            Region that counts as the gap, between one region below it and one above it; by
            default the middle one of three with parallel interfaces, if contact accelerates, or
            moves a body that is free inside.
        since, until : float, optional
            The time interval; by default the second half of the run. Whole periods are
            counted back from its end.
        tol : float
            Largest difference that counts as a repeat, in units of each state's range; at
            least a thousand times the rtol of the integration.

        Returns
        -------
        Regimes

        Raises
        ------
        ArgumentError
            Without a gap or period, or for times outside the run.
        UnknownNameError
            If ``gap`` is not a region of the model.

        Examples
        --------
        >>> import sympy as sp, fastslow as fs
        >>> T, S, t = sp.symbols("T S t")
        >>> ice = sp.Piecewise((1, T < -1), (0, T > 1), ((1 - T) / 2, True))
        >>> climate = fs.Model({T: S - ice - T}, forcing={S: 2 * sp.sin(t)})
        >>> run = fs.simulate(climate, [0], periods=4)
        >>> run.regime, run.regimes(gap="S2").label
        (None, 'bilateral')
        """
        if gap is None and self.gap is None:
            raise ArgumentError(
                "this run has no gap: no three regions between two parallel interfaces; name the "
                "region inside as gap="
            )
        if gap is not None and self.model is None:
            raise ArgumentError("this run has no model whose regions gap= could name")
        between = self.gap if gap is None else gap_regions(self.model, gap)
        assert between is not None
        length = self._period(period)
        edges = edges_of_periods(self._window(since, until), length, since is None)
        sides = dict(zip(self.modes, bits_of(self.modes, between).tolist(), strict=True))
        return regimes_of(
            touched_in(self.segments, sides, edges),
            edges,
            length,
            span=self.span,
            dense=None if self.series is None else self.dense,
            allowed=max(tol, INTEGRATION_ERRORS * self._rtol),
            early=stopped_early(self.outcome),
        )

    @property
    def time_fractions(self) -> dict[str, float]:
        """The fraction of time in each region and each sliding motion.

        With switches, those that occur, as in `itinerary`.
        """
        return self._fractions(self.span)

    def _fractions(self, window: tuple[float, float]) -> dict[str, float]:
        regions = () if self.switch_names else self.regions
        return time_fractions_in(self.segments, regions, window)

    @validated(direction=among(-1, 1, None), since=finite, until=finite)
    def hits(
        self,
        interface: Expression,
        *,
        direction: int | None = None,
        since: float | None = None,
        until: float | None = None,
    ) -> int:
        """Count crossings of an interface, upwards (+1), downwards (−1) or both.

        Parameters
        ----------
        interface : str or Expr
        direction : int, optional
        since, until : float, optional
            The time interval, by default that of the run.

        Raises
        ------
        UnknownNameError
            For an unknown interface.
        ArgumentError
            For another direction, or times outside the run.
        """
        window, n = self._window(since, until), len(self.interfaces)
        counts = count_hits(self.crossing_table, n, window, self.span[1])
        up, down = counts[self._index(interface)]
        return int({1: up, -1: down, None: up + down}[direction])

    @validated(since=finite, until=finite, period=positive)
    def contacts(
        self,
        *,
        period: float | None = None,
        since: float | None = None,
        until: float | None = None,
    ) -> Contacts:
        """Return crossings and time fractions in a time interval, in total and by period.

        Parameters
        ----------
        period : float, optional
            By default that of the forcing.
        since, until : float, optional
            The time interval, by default that of the run.

        Returns
        -------
        Contacts
        """
        window = self._window(since, until)
        return contacts_of(
            self.crossing_table,
            self.interfaces,
            self._fractions(window),
            window=window,
            period=self.period if period is None else period,
            last=self.span[1],
        )

    @validated(period=positive, phase=within(0.0, 1.0), since=finite, until=finite)
    def stroboscopic(
        self,
        period: float | None = None,
        *,
        phase: float = 0.0,
        since: float | None = None,
        until: float | None = None,
    ) -> Section:
        """Return the stroboscopic section: states at the times start + (phase + k)·period.

        Parameters
        ----------
        period : float, optional
            By default that of the forcing.
        phase : float
            Phase of the period, 0 to 1, counted from the start of the run.
        since, until : float, optional
            The time interval, by default that of the run.

        Raises
        ------
        ArgumentError
            Without a period, or without dense output.

        Examples
        --------
        >>> import sympy as sp, fastslow as fs
        >>> x, v, t = sp.symbols("x v t")
        >>> run = fs.simulate(fs.Model({x: v, v: sp.sin(t) - x - v}), [-1, 0], periods=3)
        >>> run.stroboscopic()["x"].round(9)
        array([-1., -1., -1., -1.])
        """
        length, window = self._period(period), self._window(since, until)
        return stroboscopic_section(self.dense, length, phase, window)

    @validated(
        expression=formula,
        level=finite,
        direction=among(-1, 0, 1, None),
        interface=formula,
        since=finite,
        until=finite,
    )
    def section(
        self,
        expression: Expression | None = None,
        *,
        level: float = 0.0,
        direction: int | None = None,
        interface: Expression | None = None,
        since: float | None = None,
        until: float | None = None,
    ) -> Section:
        """Return a Poincaré section, at a level of an expression or on an interface.

        All roots of the polynomial of every step are computed to rounding; an initial
        state on the section is not included. For a periodic state the level is taken
        modulo its period.

        Parameters
        ----------
        expression : str or Expr, optional
            A column, or a polynomial in columns, parameters and t.
        level : float
        direction : int, optional
            +1 upwards, −1 downwards, 0 for tangencies; all by default.
        interface : str or Expr, optional
            Instead of an expression: the crossings of this interface.
        since, until : float, optional
            The time interval, by default that of the run.

        Raises
        ------
        UnknownNameError
            For an unknown column, parameter or interface.
        ArgumentError
            For an expression that is not a polynomial, or without dense output.

        Examples
        --------
        >>> import sympy as sp, fastslow as fs
        >>> x, v = sp.symbols("x v")
        >>> fine = fs.Integration(rtol=1e-13)
        >>> run = fs.simulate(fs.Model({x: v, v: -x}), [1, 0], t=(0, 10), integration=fine)
        >>> (run.section("x", direction=-1).t / sp.pi.evalf()).astype(float).round(9)
        array([0.5, 2.5])
        """
        window = self._window(since, until)
        if (expression is None) == (interface is None):
            received = "both" if interface is not None else "neither"
            raise ArgumentError(
                f"expected an expression with its level, or interface=, received {received}"
            )
        if interface is None:
            found = level_section(self.dense, expression, float(level))
        else:
            found = self._on_interface(interface)
        return selected(found, direction, window)

    def _on_interface(self, interface: Expression) -> Section:
        mine = self.crossing_table[self.crossing_table[:, 1] == self._index(interface)]
        t, names, table = mine[:, 0], self.states, mine[:, 6:].T
        if self.series is not None:
            # states projected onto the interface, slow quantities from the series
            names, slow = self.columns, self.dense_columns(t)[len(self.states) :]
            table = np.vstack([table, slow])
        rule, directions = f"{interface} = 0", mine[:, 2].astype(np.int64)
        return Section(rule, names, t, table, directions, early_end(self.outcome))

    @validated(taper=text, samples=whole(8, 2**24), since=finite, until=finite)
    def spectrum(
        self,
        name: Name,
        *,
        taper: str = "hann",
        samples: int | None = None,
        since: float | None = None,
        until: float | None = None,
    ) -> Spectrum:
        """Return the amplitude spectrum of a column.

        Parameters
        ----------
        name : str or Symbol
        taper : str
            Window function: ``"hann"``, ``"flattop"``, ``"blackman"``, ``"hamming"`` or
            ``"rectangular"``.
        samples : int, optional
            Number of equidistant samples of the dense output; by default 16 for each
            step, at least 4096.
        since, until : float, optional
            The time interval, after the transient, by default that of the run; with forcing
            it is shortened to whole periods before its end, so that the harmonics coincide
            with bins.

        Raises
        ------
        UnknownNameError
            For an unknown column or taper.
        ArgumentError
            For a time outside the run, or without dense output.
        """
        window = self._window(since, until)
        return spectrum_of(self.dense, name, window, taper, samples, self.period)

    @validated(period=positive, tol=positive, max_multiple=whole(1, 10**6))
    def periodicity(
        self, period: float | None = None, *, tol: float = 1e-6, max_multiple: int = 16
    ) -> Periodicity:
        """Detect the period of the motion at the end of the run.

        Without forcing, periods are replaced by the returns to a Poincaré section,
        on which the state with the largest range crosses its mean upwards.

        Parameters
        ----------
        period : float, optional
            By default that of the forcing.
        tol : float
            Largest difference that counts as a repeat, in units of each state's range.
        max_multiple : int
            Largest multiple of the period that is tried.

        Returns
        -------
        Periodicity
            If nothing repeats, ``multiple`` is None and ``outcome`` gives the reason.
        """
        length = self.period if period is None else period
        return periodicity_of(self.dense, length, tol, max_multiple, self._rtol)

    @validated(name=formula, since=finite, until=finite)
    def mixed_mode(
        self,
        name: Name | None = None,
        *,
        since: float | None = None,
        until: float | None = None,
    ) -> MixedMode:
        """Count large and small oscillations at the end of the run: the signature L^S.

        Maxima of a state are large or small on both sides of the widest gap between amplitudes,
        the first one from above by a factor of two. The number of canards is only an upper bound
        of the number of small oscillations.

        Parameters
        ----------
        name : str or Symbol, optional
            State, by default the first.
        since, until : float, optional
            Times between which extrema are examined, by default from the middle to the end.

        Returns
        -------
        MixedMode
            If small oscillations are below the integration error, ``outcome`` says so.

        Raises
        ------
        UnknownNameError
            For a name that is not a state.
        ArgumentError
            For times outside the run, or a run without dense output.
        """
        state = self.states[0] if name is None else str(name)
        low, high = self._window(since, until)
        low = low + LATE * (high - low) if since is None else low
        return mixed_mode_of(self.dense, state, (low, high), self._rtol)

    @validated(names=items(formula))
    def sensitivity(self, names: Iterable[Name]) -> Sensitivity:
        """Compute the derivatives of the run with respect to parameters and initial states.

        The variational equations s' = f_z s + f_p are integrated along the run as Taylor series.
        At an event h = 0, s⁺ = s⁻ + (f⁻ − f⁺) dt/dp with the derivative of its time dt/dp =
        −(∇h·s⁻ + h_p)/(∇h·f⁻ + h_t) (Müller, Chaos, Solitons & Fractals 5, 1671-1681, 1995; Hiskens
        and Pai, IEEE Trans. Circuits Syst. I 47, 204-220, 2000).

        Parameters
        ----------
        names : iterable of str or Symbol
            Parameters of the model, and states, which stand for their initial values: of a slice
            of a run those at its start, which is kept when a parameter changes.

        Returns
        -------
        Sensitivity
            Where the flow has no derivative, as after a tangential contact, its ``outcome`` gives
            the time and the reason, and the values after it are NaN.

        Raises
        ------
        UnknownNameError
            For a name that is neither a parameter nor a state.
        ArgumentError
            For a slow quantity, which has a law, no name, a run backwards, or one without dense
            output.
        ModelError
            For a run loaded from a file, which has no equations, or functions without a Taylor
            recurrence.

        Examples
        --------
        >>> import sympy as sp, fastslow as fs
        >>> x, k = sp.symbols("x k")
        >>> decay = fs.Model({x: -k * x}, parameters={k: 2})
        >>> found = fs.simulate(decay, [1], t=(0, 1)).sensitivity([k, x])
        >>> (found.final / np.exp(-2)).round(9)
        array([[-1.,  1.]])
        """
        return computed("fastslow.orbits.derivatives.run_sensitivities", "sensitivity_of")(
            self, names
        )

    def _period(self, period: float | None) -> float:
        """Return the given period, else that of the forcing."""
        length = self.period if period is None else period
        if length is None:
            raise ArgumentError("this run has no forcing with a common period; give period=")
        return length

    def _index(self, interface: Expression) -> int:
        """Return the index of an interface."""
        if str(interface) not in self.interfaces:
            raise unknown_name("interface", interface, self.interfaces)
        return self.interfaces.index(str(interface))

    @property
    def _rtol(self) -> float:
        return float(self.settings.get("rtol", 0.0))

    def _cells(self) -> Cells:
        return self.crossings._cells()

    def __repr__(self) -> str:
        low, high = self.span
        lines = [
            f"Trajectory of {', '.join(self.columns)} for t from {low:.6g} to {high:.6g}",
            f"  {len(self.steps)} steps, {len(self.crossing_table)} crossings, "
            + (f"{len(self.resets)} resets, " if self.reset_names else "")
            + (f"{len(self.switches)} changes of switches, " if self.switch_names else "")
            + (f"{len(self.events)} events, " if self.event_names else "")
            + f"{len(self.segments)} segments"
            + (f", regime {self._regimes.words}" if self._regimes else ""),
            f"  {self.method}",
            f"  {self.outcome}",
        ]
        return "\n".join(lines)
