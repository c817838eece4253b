"""Lyapunov exponents by QR decomposition along the variational flow."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fastslow.arguments import StateLike, finite, instance, positive, validated
from fastslow.errors import ArgumentError
from fastslow.kernels.saltations import saltation
from fastslow.model.continued_runs import continuing
from fastslow.model.model import Model
from fastslow.orbits.derivatives.run_sensitivities import STEPS_BETWEEN_NODES
from fastslow.orbits.flow.events import (
    INSTANT_ROUNDING,
    OrbitError,
    condition_met,
    nearest_steps,
)
from fastslow.orbits.flow.flows import after_jumps, fields, flow
from fastslow.orbits.flow.shooting import sizes_of
from fastslow.orbits.flow.variations import Variations, variations_of
from fastslow.results.base.outcome import Outcome
from fastslow.results.trajectory.events.jumps import assignments_of
from fastslow.results.trajectory.long_time.lyapunov_exponents import (
    LyapunovExponents,
    motion_outcome,
    sign_of,
)
from fastslow.results.trajectory.trajectory import Trajectory
from fastslow.simulation.arguments import (
    initial_state,
    initial_switches,
    require_values,
    time_span,
)
from fastslow.simulation.one import integrated, simulate
from fastslow.simulation.prepared_runs import Prepared, prepared_run
from fastslow.simulation.separations import BLOCKS, FINE, INITIAL_INTERVALS, LEAVING, OFF
from fastslow.simulation.settings import Integration, integration_settings

Array = NDArray[np.float64]
Integers = NDArray[np.int64]

#: Steps of a run that are kept at a time.
PIECE = 5_000

#: Periods and steps within which a repetition is searched.
REPETITION_PERIODS, REPETITION_STEPS = 64, 20_000

#: Relative difference of the derivatives of two crossing times up to which they are equal.
SAME_SIDE = 1e-9


@validated(
    model=instance(Model),
    t0=finite,
    period=positive,
    settle=finite,
    integration=integration_settings,
)
def lyapunov(
    model: Model,
    state: StateLike,
    *,
    t: tuple[float, float] | None = None,
    periods: float | None = None,
    t0: float = 0.0,
    period: float | None = None,
    settle: float | None = None,
    integration: Integration = FINE,
) -> LyapunovExponents:
    """Compute all Lyapunov exponents of the attractor that a run approaches.

    The derivatives of the flow are integrated along the run, with the saltation matrix at every
    crossing, reset, change of a switch and instant of a clock or table, and applied to
    orthonormal vectors, which are made orthonormal again by a QR decomposition after each
    matrix: the logarithms of the diagonal of R are averaged (Benettin, Galgani, Giorgilli and
    Strelcyn, Meccanica 15, 9-20, 1980; Müller, Chaos, Solitons & Fractals 5, 1671-1681, 1995,
    for crossings and impacts). At an entry into sliding the saltation matrix is
    singular, and one exponent is minus infinity; at the end of chattering two are. At a contact
    with a wall at zero speed there is no derivative, and the measurement ends.

    Parameters
    ----------
    model : Model
        Forced, with slow states, or frozen with all parameters given.
    state : sequence of float, shape (n,), or mapping
        Initial states and slow states, in order or by name.
    t : (float, float)
        Start and end of time.
    periods : float
        Instead of ``t``: length of the run in periods of the forcing.
    t0 : float
        Start of time with ``periods``.
    period : float, optional
        Period, by default that of the forcing.
    settle : float, optional
        Transient excluded at the beginning, in periods with ``periods``, in time with ``t``;
        by default a fifth of the run.
    integration : Integration
        Error control of the run. Derivatives are computed to rounding.

    Returns
    -------
    LyapunovExponents
        Its ``outcome`` is chaotic if the largest exponent is positive by four standard errors,
        its integral over the run exceeds 10, and the run neither repeats nor diverges.

    Raises
    ------
    ArgumentError
        For an invalid state or span, or a ``settle`` as long as the run.
    UnknownNameError
        For an initial value of an unknown state.
    ModelError
        For functions without a Taylor recurrence.

    See Also
    --------
    fastslow.simulate, fastslow.find_orbit

    Examples
    --------
    >>> import fastslow as fs
    >>> gear = fs.systems.harmonic_gear(D=0.5, omega=1.3)
    >>> spectrum = lyapunov(gear, [0, 0], periods=120)
    >>> spectrum.chaotic, round(float(spectrum.values.sum()), 12)
    (True, -1.0)
    """
    require_values(model)
    start = initial_state(model, state), initial_switches(model, state)
    span, period = time_span(t, periods, t0, period, model.period)
    unit = period if periods is not None and period is not None else 1.0
    whole = span[1] - span[0]
    left_out = 0.2 * whole if settle is None else settle * unit
    if not 0.0 <= left_out < whole:
        raise ArgumentError(
            f"settle = {settle:g}; expected a number from 0 below the length of the run, "
            f"{whole / unit:g}"
        )
    edges = _edges(span, left_out, period)
    variations = variations_of(model)
    limited = replace(integration, max_steps=min(PIECE, integration.max_steps))
    prepared = prepared_run(model, limited), prepared_run(continuing(model), limited)
    measured = _Measurement.along(
        variations, variations.parameter_array(model), prepared, start, span[0], edges, integration
    )
    free = np.array([name not in model.periodic for name in variations.states])
    leaves = measured.ended is None and measured.leaves(free)
    length = float(edges[-1] - edges[1])
    outcome = measured.ended
    values, errors = measured.values, measured.uncertainties
    if outcome is None:
        largest = float(values[0]), float(errors[0])
        again = Outcome("not periodic", "", False)
        if not leaves and sign_of(*largest, length) >= 0:
            again = _recurrence(model, measured, period, integration, length)
        outcome = motion_outcome(*largest, length, leaves, again)
    return LyapunovExponents(
        states=variations.states,
        values=values,
        uncertainties=errors,
        blocks=measured.blocks,
        divergence=measured.divergence,
        span=(float(edges[1]), float(edges[-1])),
        period=period,
        outcome=outcome,
        state=measured.state,
        parameters=dict(model.parameters),
        equations=model.equations,
        settings=replace(prepared[0].resolved, max_steps=integration.max_steps).recorded(),
    )


def _edges(span: tuple[float, float], settle: float, period: float | None) -> Array:
    """Time from which vectors align, then the edges of the blocks, of whole periods if possible."""
    length = span[1] - span[0] - settle
    count = 0 if period is None else round(length / period)
    if count < 2 or abs(length - count * period) > 1e-9 * length:  # type: ignore[operator]
        count = INITIAL_INTERVALS
    ends = np.cumsum([len(part) for part in np.array_split(np.arange(count), min(BLOCKS, count))])
    # a forcing switches at simple fractions of its period: no block begins there
    shift = OFF * min(length / INITIAL_INTERVALS, 0.5 * settle)
    first = span[0] + settle - shift
    aligning = span[0] + 0.5 * settle
    return np.concatenate([[aligning, first], first + length * ends / count])


@dataclass
class _Measurement:
    """Growth of orthonormal vectors along a run.

    Parameters
    ----------
    edges : ndarray, shape (2 + k,)
        Beginning of the alignment, then the edges of k blocks.
    space : ndarray, shape (n, d)
        Vectors, in units of the states' ranges; fewer after sliding.
    sums : ndarray, shape (1 + k, n)
        Logarithms of their growth in the alignment and in every block.
    traces : ndarray, shape (1 + k,)
        Integrals of the divergence.
    extent : ndarray, shape (2, n)
        Largest moduli of the states in the first and in the last quarter of the blocks.
    state : ndarray, shape (n,)
        Final state.
    switches : ndarray, shape (n_switches,)
        Final states of the switches.
    ended : Outcome or None
        Reason why the measurement ended early.
    """

    edges: Array
    space: Array
    sums: Array
    traces: Array
    extent: Array
    state: Array
    switches: Array
    ended: Outcome | None = None

    @classmethod
    def along(
        cls,
        variations: Variations,
        parameters: Array,
        prepared: tuple[Prepared, Prepared],
        start: tuple[Array, Array],
        since: float,
        edges: Array,
        integration: Integration,
    ) -> _Measurement:
        """Measure along the run from a state, with those of switches, in pieces.

        ``prepared`` are those of the first piece and of all others.
        """
        n, k = variations.n, len(edges) - 2
        space = np.linalg.qr(np.random.default_rng(1).standard_normal((n, n)))[0]
        sums = np.zeros((1 + k, n)), np.zeros(1 + k), np.zeros((2, n))
        found = cls(edges, space, *sums, *start)
        taken, mode, units = 0, -1, None
        for run in _pieces(prepared, *start, since, float(edges[-1]), variations):
            found.state = run.end[1:].copy()
            if run.end_switches is not None:
                found.switches = run.end_switches
            taken += len(run.steps)
            if taken > integration.max_steps or not (run.outcome or _continues(run)):
                found.ended = Outcome("stopped early", f"stopped early: {run.outcome}", False)
                break
            if run.span[1] <= edges[0]:
                continue
            if units is None:
                states = _states(run)
                units = sizes_of(states, states)
            try:
                mode = found._add(variations, parameters, run, units, mode)
            except _StoppedError as error:
                found.ended = Outcome("stopped early", f"stopped early: {error}", False)
                break
        return found

    def _add(
        self, variations: Variations, parameters: Array, run: Trajectory, units: Array, mode: int
    ) -> int:
        """Add a piece of the run that begins after a mode; return its last mode."""
        events = _events(run, variations, parameters)
        _refuse_touches(run, variations, events.times)
        times, states, modes = _segments(run, self.edges, events.steps)
        durations = np.diff(times)
        constants = None
        if variations.constants:
            middle = 0.5 * (times[1:] + times[:-1])
            switches = variations.switches_at(run, middle)
            constants = variations.constants_at(middle, parameters, switches)
        flows = flow(variations, modes, states[:-1], times[:-1], durations, parameters, constants)
        incomplete = np.flatnonzero(flows.reached != durations)
        if len(incomplete):
            raise _StoppedError(
                f"the derivatives of the flow are not finite at t = {times[incomplete[0]]:.6g}."
            )
        block = np.clip(np.searchsorted(self.edges, times[:-1], side="right") - 1, 0, None)
        np.add.at(self.traces, block, flows.traces)
        before = np.append(mode if mode >= 0 else modes[0], modes[:-1])
        events = events.among(times[:-1])
        jumped = np.zeros(len(modes), dtype=bool)
        jumped[events.places] = True
        changes = np.flatnonzero((before != modes) & ~jumped)
        if mode < 0:
            start = modes[:1], states[:1], times[:1]
            first = None if constants is None else constants[:1]
            along = _along_interfaces(variations, parameters, start, units, first)
            self.space = along @ self.space
        jumps, logs = _saltations(
            variations,
            parameters,
            before[changes],
            modes[changes],
            times[changes],
            states[changes],
            None if constants is None else constants[changes],
        )
        if len(events.places):
            here = before, modes, states, constants
            across = events.saltations(run, variations, parameters, *here)
            changes, jumps = np.append(changes, events.places), np.concatenate([jumps, across])
            logs = np.append(logs, np.linalg.slogdet(across)[1])
        np.add.at(self.traces, block[changes], logs)
        # the matrix of a crossing acts before those of the segment that follows
        matrices = np.concatenate([jumps, flows.factors]) * units / units[:, None]
        owners = np.concatenate([changes, flows.owners])
        lost = int(variations.deficiency[modes].max(initial=0))
        kept = min(self.space.shape[1], variations.n - lost)
        self.space, self.sums[:, kept:] = self.space[:, :kept], -np.inf
        order = np.argsort(owners, kind="stable")
        logs = np.empty((len(order), kept))
        for row, place in enumerate(order.tolist()):
            self.space, triangle = np.linalg.qr(matrices[place] @ self.space)
            logs[row] = triangle.diagonal()
        with np.errstate(divide="ignore"):
            np.add.at(self.sums[:, :kept], block[owners[order]], np.log(np.abs(logs)))
        share = (times - self.edges[1]) / (self.edges[-1] - self.edges[1])
        for row, inside in enumerate([(share >= 0) & (share <= 0.25), share >= 0.75]):
            size = np.abs(states[inside]).max(axis=0, initial=0.0)
            self.extent[row] = np.maximum(self.extent[row], size)
        return int(modes[-1])

    @property
    def lengths(self) -> Array:
        """Lengths of the blocks."""
        return np.diff(self.edges)[1:]

    @property
    def order(self) -> Integers:
        """Order of the exponents by size."""
        return np.argsort(-self.sums[1:].sum(axis=0), kind="stable")

    @property
    def values(self) -> Array:
        """The exponents."""
        if self.ended is not None:
            return np.full(len(self.state), np.nan)
        return self.sums[1:].sum(axis=0)[self.order] / self.lengths.sum()

    @property
    def blocks(self) -> Array:
        """The exponents of every block."""
        if self.ended is not None:
            return np.full((len(self.lengths), len(self.state)), np.nan)
        return self.sums[1:, self.order] / self.lengths[:, None]

    @property
    def uncertainties(self) -> Array:
        """Standard errors of the exponents."""
        with np.errstate(invalid="ignore"):
            spread = self.blocks.std(axis=0, ddof=1) / np.sqrt(len(self.lengths))
        return np.where(np.isneginf(self.values), 0.0, spread)

    @property
    def divergence(self) -> float:
        """Mean divergence."""
        if self.ended is not None:
            return float("nan")
        if np.isneginf(self.values).any():
            return float("-inf")
        return float(self.traces[1:].sum() / self.lengths.sum())

    def leaves(self, free: NDArray[np.bool_]) -> bool:
        """Check whether states without a period grow throughout the measurement."""
        return bool((self.extent[1] > LEAVING * self.extent[0])[free].any())


class _StoppedError(Exception):
    """A measurement that cannot be continued, with the reason."""


@dataclass(frozen=True, eq=False)
class _Events:
    """Resets, events, instants of clocks and tables, and changes of switches in a run.

    Parameters
    ----------
    times : ndarray, shape (m,)
    steps : ndarray of int, shape (m,)
        The steps that begin with them.
    resets, instants : ndarray of int, shape (m,)
        Number of the reset or event, and the switching function of the instant or of the change
        of a switch; -1 for none.
    left : ndarray, shape (m, n)
        States before it.
    places : ndarray of int, shape (m,)
        Segments that begin with them.
    """

    times: Array
    steps: Integers
    resets: Integers
    instants: Integers
    left: Array
    places: Integers

    def among(self, times: Array) -> _Events:
        """Return the events at the beginnings of some segments."""
        places = np.searchsorted(times, self.times)
        kept = places < len(times)
        kept[kept] = times[places[kept]] == self.times[kept]
        return _Events(
            self.times[kept],
            self.steps[kept],
            self.resets[kept],
            self.instants[kept],
            self.left[kept],
            places[kept],
        )

    def saltations(
        self,
        run: Trajectory,
        variations: Variations,
        parameters: Array,
        before: Integers,
        after: Integers,
        states: Array,
        constants: Array | None,
    ) -> Array:
        """Derivatives across the events, from modes, states and constants of all segments."""
        n, k, m = variations.n, self.places, len(self.places)
        old, new = (None, None) if constants is None else (constants[k - 1], constants[k])
        numbers = np.array(
            [
                variations.jumps.number(*key)
                for key in zip(
                    self.resets.tolist(), before[k].tolist(), after[k].tolist(), strict=True
                )
            ]
        )
        at = self.left, self.times, parameters
        earlier = fields(variations, before[k], *at, old)
        later = fields(variations, after[k], states[k], self.times, parameters, new)
        slopes = after_jumps(variations, numbers, *at, old)[1]
        alone = self.instants < 0
        ends = np.where(alone, variations.interfaces + self.resets, self.instants)
        first = len(variations.jumps.resets)
        for i in np.flatnonzero(self.resets >= first).tolist():
            row, event = slice(i, i + 1), (int(self.resets[i]) - first, int(self.instants[i]))
            there = (before[k[row]], self.left[row], self.times[row])
            given = None if old is None else old[row]
            try:
                ends[i] = condition_met(run, *event, variations, there, parameters, given)
            except OrbitError as error:
                raise _StoppedError(error.outcome.message) from None
        found = np.empty((m, n, n))
        for i in range(m):
            functions = earlier.g_u[i, ends[i]]
            found[i] = saltation(earlier.f[i], later.f[i], functions, slopes[i])[:, :n]
        wrong = np.flatnonzero(~np.isfinite(found).all(axis=(1, 2)))
        if len(wrong):
            raise _StoppedError(
                f"at t = {self.times[wrong[0]]:.10g} a wall is met at zero speed, where the flow "
                "has no derivative; perturb a parameter."
            )
        return found


def _events(run: Trajectory, variations: Variations, parameters: Array) -> _Events:
    """Resets, events, instants and changes of switches at the beginnings of all steps but one."""
    starts, (since, until), n = np.ascontiguousarray(run.steps[:, 0]), run.span, variations.n
    allowed = INSTANT_ROUNDING * max(abs(since), abs(until), until - since)
    known = variations.instants_between(since + allowed, until - allowed, parameters)
    met = nearest_steps(starts, np.array([time for time, _ in known]), allowed)
    table = assignments_of(run)
    changes = np.zeros((0, 3)) if run.switch_table is None else run.switch_table
    jumped = nearest_steps(starts, np.append(table[:, 0], changes[:, 0]), 0.0)
    steps = np.unique(np.append(met, jumped))
    steps = steps[steps > 0]
    assert run.series is not None
    left, resets = run.series[steps, :n, 0].copy(), np.full(len(steps), -1)
    instants = np.full(len(steps), -1)
    for i, time in enumerate(starts[steps].tolist()):
        rows = np.flatnonzero(table[:, 0] == time)
        if len(rows) > 1:
            what = "resets" if table[rows, 1].max() < len(run.reset_names) else "events"
            raise _StoppedError(f"several {what} happen at once, at t = {time:.10g}.")
        if len(rows):
            resets[i], left[i] = int(table[rows[0], 1]), table[rows[0], 2 : 2 + n]
        flips = np.unique(changes[changes[:, 0] == time, 1])
        if len(flips) > 1 or (len(flips) and 0 <= resets[i] < variations.walls):
            raise _StoppedError(f"several switches or resets happen at once, at t = {time:.10g}.")
        if len(flips):
            instants[i] = variations.first_switch + int(flips[0])
    for step, (_, function) in zip(met.tolist(), known, strict=True):
        instants[steps == step] = function
    return _Events(starts[steps], steps, resets, instants, left, steps)


def _refuse_touches(run: Trajectory, variations: Variations, times: Array) -> None:
    """Raise if a run touches a wall at zero speed, or a condition, at none of its jumps."""
    walls = slice(variations.interfaces, variations.interfaces + variations.walls)
    rests = (variations.signs[:, walls] == 0).any(axis=1)
    for wall in variations.jumps.walls:
        # a function that is no polynomial vanishes at no known time
        with suppress(ArgumentError):
            touches = run.section(str(wall.function), direction=0).t
            steps = np.searchsorted(run.step_starts, touches, side="right") - 1
            touches = touches[~rests[run.steps[steps, 2].astype(np.int64)]]
            far = np.abs(touches[:, None] - times).min(axis=1, initial=np.inf)
            allowed = SAME_SIDE * (1.0 + np.abs(touches))
            if (far > allowed).any():
                raise _StoppedError(
                    f"at t = {touches[far > allowed][0]:.7g} the wall {wall.wall} is touched at "
                    "zero speed, where the flow has no derivative; perturb a parameter."
                )
    for k, function in enumerate(variations.jumps.triggers):
        with suppress(ArgumentError):
            for time in run.section(str(function), direction=0).t.tolist():
                near = (np.abs(time - times) <= SAME_SIDE * (1.0 + abs(time))).any()
                if not near and variations.jumps.decides(k, time, run(time)):
                    raise _StoppedError(
                        f"at t = {time:.7g} the condition of an event is touched, {function} = 0, "
                        "where the flow has no derivative; perturb a parameter."
                    )


def _pieces(
    prepared: tuple[Prepared, Prepared],
    state: Array,
    switches: Array,
    since: float,
    until: float,
    variations: Variations,
) -> Iterator[Trajectory]:
    """Yield a run in pieces of limited memory, until it ends.

    Those of a run with jumps end in the middle of a step, where there is none.
    """
    jumping = variations.walls + variations.instants.count + len(switches) > 0
    jumping |= len(variations.jumps.events) > 0
    one, later = prepared
    while since < until:
        run = integrated(one, np.ascontiguousarray(state), (since, until), switches=switches)
        more = _continues(run)
        if more and jumping:
            middle = run.steps[-1, 0] + 0.5 * run.steps[-1, 1]
            (run,) = run.select(between=(since, float(middle)))
            (switches,) = variations.switches_at(run, np.array([middle]))
        yield run
        if not more:
            return
        one, since, state = later, run.span[1], run.end[1:].copy()


def _continues(run: Trajectory) -> bool:
    """Check whether a run was cut by its number of steps alone."""
    return run.outcome.code == "too many steps"


def _states(run: Trajectory) -> Array:
    """States at the beginnings of the steps, and the last one, shape (n_steps + 1, n)."""
    assert run.series is not None
    return np.vstack([run.series[:, : len(run.states), 0], run.end[None, 1:]])


def _segments(run: Trajectory, edges: Array, events: Integers) -> tuple[Array, Array, Integers]:
    """Times and states at the ends of K segments of a run, K + 1 rows, and their modes.

    Segments begin with every change of mode, and with the steps of events.
    """
    starts, mode = run.steps[:, 0], run.steps[:, 2].astype(np.int64)
    chosen = np.zeros(len(starts), dtype=bool)
    chosen[::STEPS_BETWEEN_NODES] = True
    chosen[1:] |= mode[1:] != mode[:-1]
    chosen[events] = True
    inside = edges[(edges > run.span[0]) & (edges < run.span[1])]
    times = np.concatenate([starts[chosen], inside, [run.span[1]]])
    table = _states(run)
    states = np.vstack([table[:-1][chosen], run(inside).T, table[-1:]])
    rows = np.searchsorted(starts, times[:-1], side="right") - 1
    order = np.argsort(times, kind="stable")
    times, states = times[order], states[order]
    rows = np.searchsorted(starts, times[:-1], side="right") - 1
    # the alignment begins at the first edge, and several steps may begin at one time
    kept = np.append((times[1:] > times[:-1]) & (times[:-1] >= edges[0]), True)
    return times[kept], states[kept], mode[rows[kept[:-1]]]


def _along_interfaces(
    variations: Variations,
    parameters: Array,
    start: tuple[Integers, Array, Array],
    units: Array,
    constants: Array | None,
) -> Array:
    """Projection on the tangent space of the sliding interfaces, in given units.

    ``start`` is the mode, the state and the time.
    """
    slides = np.flatnonzero(variations.signs[start[0][0]] == 0)
    known = fields(variations, *start, parameters, constants)
    normals = known.g_u[0, slides, : variations.n]
    return np.eye(variations.n) - np.linalg.pinv(normals * units) @ (normals * units)


def _saltations(
    variations: Variations,
    parameters: Array,
    before: Integers,
    after: Integers,
    times: Array,
    states: Array,
    constants: Array | None,
) -> tuple[Array, Array]:
    """Derivatives of the maps across changes of mode, and the logarithms of |det|.

    Where sliding ends S = I.
    """
    n, m = variations.n, len(times)
    found, logs = np.tile(np.eye(n), (m, 1, 1)), np.zeros(m)
    if not m:
        return found, logs
    old = fields(variations, before, states, times, parameters, constants)
    new = fields(variations, after, states, times, parameters, constants)
    signs = variations.signs
    crossed = (signs[before] != signs[after]) & (signs[before] != 0) & ~variations.continuous
    for k in np.flatnonzero(crossed.any(axis=1)):
        which = np.flatnonzero(crossed[k])
        normal, drift = old.g_u[k, which, :n], old.g_u[k, which, n]
        speed = normal @ old.f[k] + drift
        times_by = normal / speed[:, None]
        gap = np.abs(times_by - times_by[0]).max(axis=0)
        if (gap > SAME_SIDE * np.abs(times_by).max(axis=0)).any():
            raise _StoppedError(
                f"two interfaces are crossed at once at t = {times[k]:.10g}, where the flow has no "
                "derivative; perturb a parameter."
            )
        found[k] = saltation(old.f[k], new.f[k], old.g_u[k, which[0]])[:, :n]
        with np.errstate(divide="ignore"):
            logs[k] = np.log(np.abs((normal[0] @ new.f[k] + drift[0]) / speed[0]))
    return found, logs


def _recurrence(
    model: Model,
    measured: _Measurement,
    period: float | None,
    integration: Integration,
    length: float,
) -> Outcome:
    """Check whether the motion repeats."""
    last = float(measured.edges[-1])
    names = *model.states, *model.slow_states, *model.assigned
    values = np.append(measured.state, measured.switches).tolist()
    run = simulate(
        model,
        dict(zip((*names, *model.switches), values, strict=True)),
        t=(last, last + (REPETITION_PERIODS * period if period is not None else length)),
        period=period,
        integration=replace(integration, max_steps=REPETITION_STEPS),
    )
    return run.periodicity(tol=1e-5).outcome
