"""Runs of a model prepared for given settings, and their integration to arrays."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.polynomial.polynomial import polyval
from numpy.typing import NDArray

from fastslow.errors import refuse_events
from fastslow.kernels.loops import load_loop
from fastslow.kernels.taylor.motions_by_signs import MOST_FORMED, SignedSeries, compile_by_signs
from fastslow.kernels.taylor.series import SERIES_KEPT, CompiledSeries, compile_series
from fastslow.results.base.immutable import fixed, read_only
from fastslow.results.stored.reversal import in_reversed_time
from fastslow.results.stored.sign_patterns import Pattern
from fastslow.results.trajectory.long_time.regimes import gap_regions
from fastslow.simulation.arguments import (
    Simulated,
    require_values,
)
from fastslow.simulation.backwards import (
    Reversed,
    first_branching,
)
from fastslow.simulation.formed_motions import FormedMotions
from fastslow.simulation.instants import (
    events_of,
    fill_instants,
    fill_switches,
    instants_of,
)
from fastslow.simulation.loops import INTEGRATE
from fastslow.simulation.pauses import Pace, provide, with_lazy_callbacks
from fastslow.simulation.run_tables import RunMemory
from fastslow.simulation.settings import (
    Integration,
    Resolved,
    resolve,
)
from fastslow.simulation.stepper.implicit import DEGREE
from fastslow.simulation.stepper.phases import (
    ENDLESS_EVENTS,
    MANY_PENDING,
    NEEDS_MOTION,
    NOT_UNIQUE,
    OUT_OF_ROWS,
    OUT_OF_WORK,
    RESET_NOT_FINITE,
)
from fastslow.simulation.stepper.problems import Problem, Record, Run
from fastslow.simulation.stepper.queued_events import memory_size
from fastslow.simulation.stepper.scales import FORGETTING, rules_of
from fastslow.simulation.stepper.workspace import (
    INTERFACE,
    MODE,
    RESETS,
    SAMPLES,
    STEPS,
    WORK,
    beginnings,
)
from fastslow.simulation.stopping import Stop, StopSearch

#: Steps of the first slice of a run with events; each slice has twice as many as the last.
FIRST_SLICE_STEPS = 64

#: Outcome of a run whose tables would be too large, beside those of the loop.
OUT_OF_MEMORY = 11

#: Work space and sizes of tables that a thread keeps from run to run.
_memory = RunMemory()

#: Empty extremes, hits and mode times: steps and crossings are listed instead.
_LISTED = (np.empty((0, 0)), np.empty((0, 2), dtype=np.int64), np.empty(0))


@dataclass(frozen=True, eq=False)
class Prepared:
    """Data shared by all runs of a model with the same settings.

    Parameters
    ----------
    model : Model
    names : tuple of str
        States and slow states.
    compiled : CompiledSeries
    resolved : Resolved
    problem : Problem
    gap : tuple of str or None
    vanishing, together : tuple
        See `with_noise`.
    direction : float
        1, or −1 for runs backwards, whose series, times and places are in the time τ = −t.
    series : SignedSeries, optional
        Of a model whose motions are formed when a run needs them.
    first_motions : tuple of tuple of int
        Signs of those that are formed at once, the first of its modes.
    """

    model: Simulated
    names: tuple[str, ...]
    compiled: CompiledSeries
    resolved: Resolved
    problem: Problem
    gap: tuple[str, str, str] | None
    vanishing: tuple[str, ...]
    together: tuple[tuple[str, ...], ...]
    direction: float = 1.0
    series: SignedSeries | None = None
    first_motions: tuple[Pattern, ...] = ()

    def formed_motions(self) -> FormedMotions | None:
        """The motions of one run, where they are formed when it needs them."""
        return None if self.series is None else FormedMotions(self.series, self.first_motions)

    @cached_property
    def quantities(self) -> tuple[str, ...]:
        """Columns after the states: slow quantities and switches."""
        return (*self.model.forcing, *self.model.switches)

    @cached_property
    def touchable(self) -> bool:
        """Whether the model has discontinuities, walls, thresholds or conditions of events."""
        own = self.compiled
        others = own.n_walls + len(own.switches) + len(own.triggers)
        return bool(others) or not all(own.continuous)

    @cached_property
    def columns(self) -> tuple[str, ...]:
        """States, slow states, parameters that events assign, and quantities."""
        return (*self.names, *self.quantities)

    @cached_property
    def period(self) -> float | None:
        """The common period of the forcing."""
        return self.model.period()

    @cached_property
    def shared(self) -> dict[str, Any]:
        """Fields of a `Trajectory` that are common to all runs."""
        model = self.model
        content = {
            "states": self.names,
            "forcing": self.quantities,
            "interfaces": tuple(model.interfaces),
            "reset_names": tuple(model.resets),
            "switch_names": tuple(model.switches),
            "event_names": tuple(model.events),
            "regions": () if self.series is not None else tuple(model.regions),
            "parameters": constants_of(model),
            "gap": self.gap,
            "modes": self.compiled.modes,
            "equations": model.equations,
            "settings": self.resolved.recorded(),
            "periods": dict(model.periodic),
            "model": model,
        }
        return {name: fixed(name, value) for name, value in content.items()}

    @cached_property
    def largest_number(self) -> float:
        """The largest modulus of a number in the equations or of a parameter."""
        numbers = re.findall(r"(?<![\w.])\d+\.?\d*(?:e[+-]?\d+)?", str(self.model.equations))
        values = [*map(float, numbers), *map(abs, self.model.parameters.values())]
        return max(values, default=0.0)

    @cached_property
    def shape(self) -> tuple[int, ...]:
        """Sizes on which the work space depends."""
        problem = self.problem
        sizes = (problem.n_states, problem.n_forcing, problem.n_interfaces, problem.order)
        return (*sizes, problem.n_fast, self.compiled.n_rows)

    @cached_property
    def _beginning(self) -> tuple[NDArray[Any], ...]:
        """Parameters, and the initial carried state of a run."""
        (_,), (carried,), (counted,) = beginnings(
            np.zeros(1),
            np.zeros((1, len(self.names))),
            0,
            self.problem.rules,
            memory_size(len(self.compiled.events), len(self.names)),
        )
        return self.compiled.parameter_array(self.model), carried, counted

    def run(
        self,
        state: NDArray[np.float64],
        span: tuple[float, float],
        values: Mapping[str, float] | None = None,
        switches: NDArray[np.float64] | None = None,
    ) -> Run:
        """Create a run in its initial state, with other values of some parameters.

        ``switches`` are their given states, NaN for none.
        """
        parameters, carried, counted = self._beginning
        if values:
            parameters = parameters.copy()
            for name, value in values.items():
                if name in self.compiled.parameters:
                    parameters[self.compiled.parameters.index(name)] = value
        changing = (self.compiled.tables, self.compiled.clocks, self.compiled.switches)
        if any(changing) or self.compiled.events:
            parameters = parameters.copy()
            fill_instants(self.compiled, parameters[None, :], np.array([span[0]]))
            fill_switches(self.compiled, parameters[None, :], switches)
        place = np.zeros(1 + len(state) + self.compiled.n_forcing)
        place[0] = span[0]
        place[1 : 1 + len(state)] = state
        return Run(*span, span[0], parameters, place, carried.copy(), counted.copy())


@lru_cache(maxsize=SERIES_KEPT)
def prepared_run(
    model: Simulated, integration: Integration, *, backwards: bool = False
) -> Prepared:
    """Prepare the runs of a model with all parameters given, for some settings."""
    require_values(model)
    if backwards:
        refuse_events(model.events, "a run backwards")
    resolved = resolve(integration, model, implicit=True)
    partition = getattr(model, "partition", None)
    if partition is not None and partition.pieces is not None:
        return _forming(model, resolved, backwards=backwards)
    compiled = compile_series(Reversed(model) if backwards else model, resolved.order)
    return Prepared(
        model=model,
        names=(*model.states, *model.slow_states, *model.assigned),
        compiled=compiled,
        resolved=resolved,
        problem=problem_of(model, compiled, resolved, error_rules(model, resolved, compiled)),
        gap=gap_regions(model),
        vanishing=model.traits.vanishing,
        together=model.traits.together,
        direction=-1.0 if backwards else 1.0,
    )


def _forming(model: Any, resolved: Resolved, *, backwards: bool) -> Prepared:
    """Prepare the runs of a model whose motions are formed when a run needs them."""
    from fastslow.model.piece_operations import operations_by_signs
    from fastslow.model.restriction import whole

    regions = whole(model).partition
    if backwards:
        regions.require_all("a run backwards")
    series = compile_by_signs(operations_by_signs(regions), resolved.order)
    compiled = series.compiled
    problem = problem_of(model, compiled, resolved, error_rules(model, resolved, compiled))
    return Prepared(
        model=model,
        names=(*model.states, *model.slow_states, *model.assigned),
        compiled=compiled,
        resolved=resolved,
        problem=problem._replace(n_modes=MOST_FORMED, forming=1, rests=series.rests),
        gap=None,
        vanishing=(),
        together=(),
        series=series,
        first_motions=model.structure.formed,
    )


def problem_of(
    model: Simulated, compiled: CompiledSeries, resolved: Resolved, rules: NDArray[np.float64]
) -> Problem:
    """Bundle model, series and error control for the stepping loops."""
    settling = resolved.implicit and compiled.order >= DEGREE and not compiled.values_only
    instants, knots = instants_of(compiled)
    first_trigger = compiled.n_interfaces - len(compiled.triggers)
    first_switch = first_trigger - len(compiled.switches)
    return Problem(
        series=compiled.address,
        collocation=0,
        radau=0,
        n_states=compiled.n_states,
        n_forcing=compiled.n_forcing,
        n_interfaces=compiled.n_interfaces,
        n_modes=len(compiled.modes),
        order=compiled.order,
        first_wall=first_switch - compiled.n_walls,
        first_switch=first_switch,
        first_trigger=first_trigger,
        n_resets=len(compiled.resets),
        n_rests=compiled.n_rests,
        switch_place=compiled.switch_place,
        n_fast=len(model.states) if settling else 0,
        max_steps=resolved.max_steps,
        max_crossings=resolved.max_crossings,
        forming=0,
        tol=resolved.rtol,
        signs=compiled.signs,
        saturating=compiled.saturating,
        saturations=compiled.saturations,
        continuous=compiled.continuous,
        of_time=compiled.of_time,
        of_laws=compiled.of_laws,
        rests=(compiled.signs == 0).any(axis=0),
        rules=rules,
        instants=instants,
        knots=knots,
        events=events_of(compiled),
        effects=compiled.effects.astype(np.int64),
        closed=np.array(compiled.triggers, dtype=bool),
    )


def error_rules(
    model: Simulated, resolved: Resolved, compiled: CompiledSeries
) -> NDArray[np.float64]:
    """Error scale rules of a run, from its tolerances."""
    names = (*model.states, *model.slow_states)
    fixed, lasting = np.zeros(len(names)), np.zeros(len(names))
    traits = model.traits
    vanishing = {*traits.vanishing, *(n for some in traits.together for n in some)}
    for i, name in enumerate(names):
        given = resolved.atol[name]
        if given is not None:
            fixed[i] = given / resolved.rtol
        elif name not in vanishing:
            lasting[i] = FORGETTING
    # the parameters that events assign are constant between them
    fixed, lasting = (np.append(v, np.zeros(len(model.assigned))) for v in (fixed, lasting))
    return rules_of(fixed, lasting, compiled.n_forcing, compiled.n_interfaces)


def constants_of(model: Simulated) -> dict[str, float]:
    """Return the parameters that keep their values in a run: those that no event assigns."""
    return {n: v for n, v in model.parameters.items() if n not in model.assigned}


class RunArrays(NamedTuple):
    """Arrays of a run.

    Parameters
    ----------
    code, mode : int
        Return code of the loop, 0 at the end of the time span, and the last mode.
    steps, crossings : ndarray
        As in a `Trajectory`.
    series : ndarray, shape (n_steps, n + n_forcing, order + 1), optional
    place : ndarray, shape (1 + n + n_forcing,)
        Time and columns reached.
    sampled : ndarray
        Columns at the sample times up to the time reached.
    resets : ndarray
        Resets, events and changes of switches, as in a `Record`.
    wall : str
        Relation of the reset beyond whose wall the run ended, the reset or event which failed, or
        the switch without a state at its start; empty for other endings.
    stop : Stop, optional
        The event that ended the run.
    modes : tuple of str
        Names of the modes where they are formed during the run, else empty.
    """

    code: int
    mode: int
    steps: NDArray[np.float64]
    crossings: NDArray[np.float64]
    series: NDArray[np.float64] | None
    place: NDArray[np.float64]
    sampled: NDArray[np.float64]
    resets: NDArray[np.float64]
    wall: str
    stop: Stop | None = None
    modes: tuple[str, ...] = ()

    def until(self, step: int, offset: float, times: NDArray[np.float64]) -> RunArrays:
        """Return the run until an offset into a step; it has samples at some times."""
        assert self.series is not None
        steps, place = self.steps[: step + (offset > 0.0)].copy(), self.place.copy()
        mode = self.mode
        if offset > 0.0:
            steps[step, 1] = offset
            place[0], place[1:] = steps[step, 0] + offset, polyval(offset, self.series[step].T)
            mode = int(steps[step, 2])
        elif step < len(self.steps):
            place[0], place[1:] = self.steps[step, 0], self.series[step, :, 0]
            mode = int(self.steps[step, 2])
        return RunArrays(
            code=0,
            mode=mode,
            steps=read_only(steps),
            crossings=self.crossings[self.crossings[:, 0] <= place[0]],
            series=self.series[: len(steps)],
            place=place,
            sampled=self.sampled[:, : int(np.searchsorted(times, place[0], side="right"))],
            resets=self.resets[self.resets[:, 0] <= place[0]],
            wall="",
            modes=self.modes,
        )


def run_arrays(
    prepared: Prepared,
    run: Run,
    times: NDArray[np.float64],
    *,
    dense: bool = True,
    stops: tuple[Stop, ...] = (),
) -> RunArrays:
    """Integrate a run to its end or to the first of some events, with samples at given times."""
    compiled, problem = prepared.compiled, prepared.problem
    kept = compiled.n_states + compiled.n_forcing
    sampled = np.empty((compiled.n_states if dense else kept, len(times)))
    counted = run.counted
    backwards = prepared.direction < 0
    stride = kept * (compiled.order + 1) if dense or stops or backwards else 0
    tables = _memory.tables(problem, stride)
    workspace = _memory.workspace(prepared.shape, prepared.problem, prepared.compiled.n_rows)
    loop, pace = load_loop(INTEGRATE), Pace(compiled.n_rows, compiled.order)
    motions = prepared.formed_motions()
    if motions is not None:
        motions.begin(run)
        problem, run = motions.problem(problem), motions.run(run)
    search = StopSearch(stops, prepared.columns, prepared.model.parameters, prepared.direction)
    found, quota = None, FIRST_SLICE_STEPS
    while found is None:
        counted[WORK] = pace.begin()
        if stops:
            counted[WORK], quota = min(counted[WORK], quota), 2 * quota
        record = Record(times, sampled, *tables, *_LISTED)
        code = loop(with_lazy_callbacks(problem), run, record, workspace, 0)
        if code == NEEDS_MOTION:
            assert motions is not None
            motions.propose(run, workspace.search)
            problem, run = motions.problem(problem), motions.run(run)
        if stops:
            steps, store = tables.steps[: counted[STEPS]], tables.store[: counted[STEPS] * stride]
            series = store.reshape(len(steps), kept, compiled.order + 1)
            jumps = tables.resets[: counted[RESETS]]
            found = search.first(steps, series, run.inputs if code >= 0 else None, jumps)
        if code == OUT_OF_WORK:
            pace.end()
        elif code == OUT_OF_ROWS:
            larger = tables.with_space(counted, problem, stride)
            if larger is None:
                code = OUT_OF_MEMORY
                break
            tables = larger
        elif code < 0 and code != NEEDS_MOTION:
            provide(code, problem.n_fast)
        elif code >= 0:
            break
    _memory.workspaces[prepared.shape] = workspace
    steps, crossings, resets, store = _memory.filled(tables, counted, stride)
    reached = int(counted[SAMPLES])
    if reached < len(times):
        sampled = sampled[:, :reached].copy()
    arrays = RunArrays(
        code=code,
        mode=int(counted[MODE]),
        steps=steps,
        crossings=crossings,
        series=store.reshape(len(steps), kept, compiled.order + 1) if stride else None,
        place=run.inputs,
        sampled=sampled,
        resets=resets,
        wall=_wall_passed(compiled, counted, code),
    )
    if motions is not None:
        arrays = with_own_modes(arrays, motions, len(prepared.first_motions))
    if found is not None:
        arrays = arrays.until(found.step, found.offset, times)._replace(stop=found.stop)
    if backwards:
        arrays = _until_branching(prepared, arrays, run.parameters, times)
    return arrays if dense else arrays._replace(series=None)


def _wall_passed(compiled: CompiledSeries, counted: NDArray[np.int64], code: int) -> str:
    """Name of the reset, switch or event at which a run ended or did not begin, else empty."""
    place = int(counted[INTERFACE])
    if place < 0 or code == ENDLESS_EVENTS:
        return ""
    failed = code in (RESET_NOT_FINITE, MANY_PENDING)
    resets = [f"reset at {name}" if failed else name for name in compiled.resets]
    walls, kicks = resets[: compiled.n_walls], resets[compiled.n_walls :]
    conditions = [""] * len(compiled.triggers)
    events = [f"event {event.name}" for event in compiled.events]
    names = (*walls, *compiled.switches, *conditions, *kicks, *events)
    count = len(walls) + len(compiled.switches) + len(conditions)
    place -= compiled.n_interfaces - count
    return names[place] if place >= 0 else ""


def with_own_modes(arrays: RunArrays, motions: FormedMotions, first: int) -> RunArrays:
    """Return a run with the modes that it meets, regions before others, after the first ones."""
    steps, crossings, patterns = arrays.steps.copy(), arrays.crossings.copy(), motions.patterns
    met = [*crossings[:, 3:5].reshape(-1), *steps[:, 2], arrays.mode]
    used = [patterns[int(k)] for k in dict.fromkeys(met) if k >= 0]
    kept = dict.fromkeys([*patterns[:first], *sorted(used, key=motions.series.operations.kind)])
    number = {signs: k for k, signs in enumerate(kept)}
    new = np.array([number.get(signs, -1) for signs in patterns] or [-1])
    steps[:, 2] = new[steps[:, 2].astype(int)]
    crossings[:, 3:5] = new[crossings[:, 3:5].astype(int)]
    return arrays._replace(
        mode=int(new[arrays.mode]) if arrays.mode >= 0 else arrays.mode,
        steps=read_only(steps),
        crossings=read_only(crossings),
        modes=tuple(map(motions.series.operations.name, kept)),
    )


def _until_branching(
    prepared: Prepared,
    arrays: RunArrays,
    parameters: NDArray[np.float64],
    times: NDArray[np.float64],
) -> RunArrays:
    """Return a backward run until the first time from which it is not unique."""
    assert arrays.series is not None
    branching = first_branching(
        prepared.compiled,
        in_reversed_time(prepared.model.operations),
        parameters,
        arrays.steps,
        arrays.series,
        arrays.crossings,
    )
    if branching is None:
        return arrays
    step = max(int(np.searchsorted(arrays.steps[:, 0], branching)) - 1, 0)
    offset = branching - float(arrays.steps[step, 0])
    if offset >= arrays.steps[step, 1]:
        step, offset = step + 1, 0.0
    return arrays.until(step, offset, times)._replace(code=NOT_UNIQUE)
