"""Regimes of a gap for asymptotic motions, and their maps over two parameters."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fastslow.arguments import (
    either,
    function,
    instance,
    mapping,
    positive,
    validated,
)
from fastslow.errors import (
    ArgumentError,
    refuse_resets,
    refuse_switches,
    unknown_name,
)
from fastslow.formulas.columns import evaluated, names_in
from fastslow.model.events import refuse_memory
from fastslow.model.model import Model
from fastslow.results.base.outcome import Outcome
from fastslow.results.maps.adaptive_map import RefinedMap
from fastslow.results.trajectory.ensemble import Ensemble
from fastslow.results.trajectory.long_time.lyapunov_exponents import LyapunovExponents
from fastslow.results.trajectory.long_time.regimes import (
    CHAOTIC,
    NO_GAP,
    NOT_SETTLED,
    REGIMES,
    Regimes,
    RegimeSet,
    coexisting,
    ending_of,
)
from fastslow.simulation.many import simulate_many
from fastslow.simulation.many_arguments import starts_and_parameters
from fastslow.simulation.one import simulate
from fastslow.simulation.separations import FINE, Exponents, exponents
from fastslow.simulation.settings import (
    DEFAULT,
    EXECUTION,
    Execution,
    Integration,
    integration_settings,
    map_settings,
    progress_bar,
    thread_settings,
)
from fastslow.sweeps.refinement import refined_map
from fastslow.sweeps.settings import Refinement, refinement_settings

Floats = NDArray[np.float64]
Parameters = Mapping[Any, Any] | Callable[[Floats, Floats], Mapping[Any, Any]]


#: Lengths in periods to which unsettled runs are extended; exponents are computed from the
#: first of them on.
PERIODS_TRIED = (64, 256, 1024)

#: Largest number of intervals per period for exponents: where separations shrink below rounding
#: within one, their sign does not depend on the number.
FINEST_INTERVALS = 32

#: Initial fraction of a computation of exponents that is discarded.
DISCARDED = 0.25


#: Refinement of a map of regimes by default.
COARSE = Refinement(levels=5)


@validated(
    model=instance(Model),
    period=positive,
    periods=positive,
    max_periods=positive,
    integration=integration_settings,
    execution=thread_settings,
)
def classify_regime(
    model: Model,
    states: ArrayLike | Mapping[Any, ArrayLike],
    *,
    periods: float = 64,
    max_periods: float = PERIODS_TRIED[-1],
    period: float | None = None,
    integration: Integration = DEFAULT,
    execution: Execution = EXECUTION,
) -> RegimeSet:
    """Classify the regimes of the asymptotic motions from several initial states.

    Each run is continued until its states repeat stroboscopically, or its largest Lyapunov
    exponent is positive, as decided by `fastslow.lyapunov`, or is negative while all
    periods of the second half have the same regime, or the longest run is reached; the label is
    then the regime of all periods, or ``"not settled"`` if they differ. Periodic motions are
    distinguished by their states; all chaotic motions count as one, as do those that have not
    settled.

    Parameters
    ----------
    model : Model
        Model with a gap and a period.
    states : array_like, shape (m, n) or (n,), or mapping
        Initial states; by name, numbers or arrays of shape (m,).
    periods : float
        Initial length of the runs, in periods of the forcing. The periods of the second half
        are classified one by one.
    max_periods : float
        Largest length of a run.
    period, integration, execution
        As in `simulate_many`.

    Returns
    -------
    RegimeSet

    Raises
    ------
    ArgumentError
        For a model without a gap or a period, wrong states, or a run that ends early.
    ModelError
        For resets and switches, and for events with a memory: a delay, or parameters that they
        assign.

    See Also
    --------
    fastslow.regime_map, fastslow.simulate

    Examples
    --------
    >>> import fastslow as fs
    >>> gear = fs.systems.harmonic_gear_from_physical().with_parameters(D=0.5, omega=1.3)
    >>> found = classify_regime(gear, [[0, 0], [0.5, 0]])
    >>> found.label, {kind: round(share, 1) for kind, share in found.fractions.items()}
    ('chaotic', {'unilateral upper': 0.7, 'bilateral': 0.3})
    """
    refuse_resets(model.resets, "classify_regime")
    refuse_switches(model.switches, "classify_regime")
    refuse_memory(model.events, model.assigned, "classify_regime")
    starts, _ = starts_and_parameters(model, states, None)
    found = _settled(model, starts, {}, periods, max_periods, period, integration, execution)
    if found.failures:
        row, outcome = next(iter(found.failures.items()))
        raise ArgumentError(f"the run from state {row} ended early: {outcome}")
    if NO_GAP in found.labels:
        raise ArgumentError(
            "this model has no gap: no three regions between two parallel interfaces; "
            "simulate(...).regimes(gap=...) takes any region between two others"
        )
    motions: list[Regimes] = []
    places: list[Floats] = []
    index = np.zeros(len(starts), dtype=np.int64)
    for row in range(len(starts)):
        motion, place = found.motion(row), found.places(row, integration)
        same = [
            k
            for k, (known, other) in enumerate(zip(motions, places, strict=True))
            if known.label == motion.label and _same_motion(place, other, found.scale(row))
        ]
        if not same:
            motions.append(motion)
            places.append(place)
        index[row] = same[0] if same else len(motions) - 1
    return RegimeSet(tuple(motions), starts, index, dict(model.parameters), model.equations)


def _same_motion(one: Floats, other: Floats, scale: Floats) -> bool:
    """Whether two periodic motions share a state, or neither is periodic."""
    if not len(one) or not len(other):
        return len(one) == len(other)
    apart = np.abs(one[:, None] - other[None]) / scale
    return bool((apart.max(axis=2) < SAME_MOTION).any())


#: Distance of states, in units of their ranges, below which motions are the same.
SAME_MOTION = 1e-4


class _Settled:
    """Asymptotic motions of many runs.

    Parameters
    ----------
    labels : list of str
    runs : dict
        For each run the last ensemble, its row there, and its length in periods.
    exponents : dict
        For some runs the exponents computed last, and the row there.
    failures : dict
        Runs that ended early, with the reason.
    """

    def __init__(self, model: Model, count: int) -> None:
        self.model = model
        self.labels = [NOT_SETTLED] * count
        self.runs: dict[int, tuple[Ensemble, int, float]] = {}
        self.exponents: dict[int, tuple[Exponents, int, Integration]] = {}
        self.failures: dict[int, Outcome] = {}

    def scale(self, row: int) -> Floats:
        """Range of each state of a run."""
        many, i, _ = self.runs[row]
        ranges = many.maximum[i] - many.minimum[i]
        return np.where(ranges > 0, ranges, 1.0)

    def places(self, row: int, integration: Integration) -> Floats:
        """Stroboscopic states of a periodic motion, shape (multiple, n)."""
        many, i, _ = self.runs[row]
        multiple = int(many.multiples[i])
        if not multiple:
            return np.empty((0, many.final.shape[1]))
        here = self.model.with_parameters({name: v[i] for name, v in many.parameters.items()})
        first = float(many.span[i, 1])
        length = self._period(row)
        run = simulate(
            here,
            many.final[i],
            t=(first, first + multiple * length),
            period=length,
            integration=integration,
        )
        return np.asarray(run(first + length * np.arange(multiple)).T)

    def _period(self, row: int) -> float:
        many, i, length = self.runs[row]
        return float((many.span[i, 1] - many.span[i, 0]) / length)

    def _largest_exponent(self, row: int) -> LyapunovExponents | None:
        if row not in self.exponents:
            return None
        many, i, _ = self.runs[row]
        measured, k, integration = self.exponents[row]
        here = self.model.with_parameters({name: v[i] for name, v in many.parameters.items()})
        unsettled = Outcome("not periodic", "the states do not repeat.", False)
        return measured.of(k, here, self._period(row), integration, unsettled)

    def motion(self, row: int) -> Regimes:
        """Asymptotic motion of a run as a result."""
        many, i, _ = self.runs[row]
        touched = many.touched[i][many.touched[i] > 0]
        kinds = tuple(REGIMES[bits] for bits in touched)
        length = self._period(row)
        last = float(many.span[i, 1])
        multiple = int(many.multiples[i])
        exponent = self._largest_exponent(row)
        outcome = ending_of(multiple, float(many.changes[i]), len(kinds))
        if exponent is not None and not multiple:
            text = f"The largest Lyapunov exponent is {exponent.words}."
            if exponent.chaotic:
                outcome = Outcome("chaotic", text, True)
            elif self.labels[row] != NOT_SETTLED and exponent.largest < 0:
                change = f"The states change by {many.changes[i]:.2g} of their ranges in a period."
                outcome = Outcome("settled", f"{change} {text}", True)
            else:
                outcome = replace(outcome, message=f"{outcome.message} {text}")
        return Regimes(
            self.labels[row],
            kinds,
            length,
            (last - len(kinds) * length, last),
            multiple or None,
            float(many.changes[i]),
            outcome,
            exponent,
        )


def regimes_at(
    model: Model,
    states: Floats,
    parameters: Mapping[str, Floats],
    *,
    periods: float = 3,
    max_periods: float = PERIODS_TRIED[-1],
    period: float | None = None,
    integration: Integration = DEFAULT,
    execution: Execution = EXECUTION,
) -> list[str | Outcome]:
    """Regimes of the asymptotic motions at many parameter sets, as by `classify_regime`.

    Parameters
    ----------
    model : Model
    states : ndarray, shape (m, n) or (n,)
    parameters : mapping
        Parameter to its values, shape (m,).
    periods, max_periods, period, integration, execution
        As in `regime_map`.

    Returns
    -------
    list of str or Outcome
        Labels; for a run that ended early, its outcome.
    """
    starts, swept = starts_and_parameters(model, states, parameters)
    found = _settled(model, starts, swept, periods, max_periods, period, integration, execution)
    return [found.failures.get(row, label) for row, label in enumerate(found.labels)]


def _settled(
    model: Model,
    starts: Floats,
    swept: Mapping[str, Floats],
    periods: float,
    max_periods: float,
    period: float | None,
    integration: Integration,
    execution: Execution,
) -> _Settled:
    """Continue runs until they are periodic or classified as chaotic."""
    found = _Settled(model, len(starts))
    waiting = np.arange(len(starts))
    lengths = [periods, *(float(n) for n in PERIODS_TRIED if periods < n <= max_periods)]
    for length in lengths:
        if not len(waiting):
            break
        many = simulate_many(
            model,
            starts[waiting],
            parameters={name: values[waiting] for name, values in swept.items()},
            periods=length,
            period=period,
            integration=integration,
            execution=execution,
        )
        open_ = []
        for i, row in enumerate(waiting.tolist()):
            found.runs[row] = (many, i, length)
            found.labels[row] = str(many.regime[i]) or NO_GAP
            if not many.success[i]:
                found.failures[row] = many.outcomes[i]
            elif many.regime[i] and not many.multiples[i]:
                found.labels[row] = NOT_SETTLED
                open_.append(i)
        rows = np.array(open_, dtype=np.intp)
        waiting = waiting[rows]
        if not len(rows) or length < min(PERIODS_TRIED[0], max_periods):
            continue
        last = length == lengths[-1]
        decided = _measured(
            found=found,
            model=model,
            many=many,
            rows=rows,
            waiting=waiting,
            length=length,
            integration=integration,
            execution=execution,
            last=last,
        )
        waiting = waiting[~decided]
    return found


def _measured(
    found: _Settled,
    model: Model,
    many: Ensemble,
    rows: NDArray[np.intp],
    waiting: NDArray[np.intp],
    length: float,
    integration: Integration,
    execution: Execution,
    last: bool,
) -> NDArray[np.bool_]:
    """Compute the exponents of runs that are not periodic, from their ends on.

    Returns whether each of them has a label, shape (m,).
    """
    periods = (many.span[rows, 1] - many.span[rows, 0]) / length
    count = max(10, int(length))
    begin = many.span[rows, 1]
    first = begin + np.ceil(DISCARDED * count) * periods
    fine = replace(integration, rtol=min(integration.rtol, FINE.rtol))
    with progress_bar(execution, "run") as bar:
        measured = exponents(
            model=model,
            starts=many.final[rows],
            swept={name: values[rows] for name, values in many.parameters.items()},
            times=np.stack([begin, first, first + count * periods], axis=1),
            integration=fine,
            execution=execution,
            units=count,
            finest=FINEST_INTERVALS * count,
            report=bar.update,
        )
    decided = np.zeros(len(rows), dtype=bool)
    for k, row in enumerate(waiting.tolist()):
        found.exponents[row] = (measured, k, fine)
        sign, regime = measured.sign(k), str(many.regime[rows[k]])
        if sign > 0:
            found.labels[row] = CHAOTIC
        elif sign < 0 or last:
            # slow convergence: labelled if all periods have the same regime
            found.labels[row] = regime
        decided[k] = found.labels[row] != NOT_SETTLED
    return decided


@validated(
    model=instance(Model),
    over=mapping,
    parameters=either(function, mapping),
    integration=integration_settings,
    refinement=refinement_settings,
    period=positive,
    periods=positive,
    max_periods=positive,
    execution=map_settings,
)
def regime_map(
    model: Model,
    over: Mapping[Any, tuple[float, float]],
    state: Sequence[float] | Mapping[Any, float] | Floats,
    *,
    parameters: Parameters | None = None,
    refinement: Refinement = COARSE,
    periods: float = 3,
    max_periods: float = PERIODS_TRIED[-1],
    period: float | None = None,
    integration: Integration = DEFAULT,
    execution: Execution = EXECUTION,
) -> RefinedMap:
    """Map the regimes of a gap over two parameters, with refined boundaries.

    The label of each point is the regime of the asymptotic motion, as by `classify_regime`:
    runs that are not periodic over the second half of ``periods`` are extended, and their
    largest Lyapunov exponent is computed. ``"chaotic"`` means that it is positive,
    ``"not settled"`` that the periods of the longest run differ and it is not periodic,
    ``"coexisting: a + b"`` that several initial states lead to regimes a and b, ``"no gap"`` that
    there is no gap, and ``"failed"`` that a run could not be continued.

    Parameters
    ----------
    model : Model
        Model with a gap and a period.
    over : mapping
        Two names with their ranges: parameters of the model, or names from which
        ``parameters`` computes them.
    state : sequence of float, shape (n,) or (k, n), or mapping
        Initial state of every run, or of k runs at every point.
    parameters : mapping or callable, optional
        Parameter to an expression in the names of the axes and the other parameters,
        ``{"C": "B*ratio"}``; or a function of two arrays that returns parameter values.
    refinement : Refinement
        As in `refined_map`, by default with five levels; all new points of a level are
        simulated together.
    periods, max_periods : float
        Initial and largest length of a run, in periods of the forcing.
    period, integration
        As in `simulate_many`.
    execution : Execution
        As in `refined_map`, with threads of each task; the progress bar counts points.

    Returns
    -------
    RefinedMap

    Raises
    ------
    UnknownNameError
        For a name that is no parameter and from which none is computed.
    ArgumentError
        For a model without a gap or period at any point, or an invalid argument of
        `refined_map` or `simulate_many`.

    See Also
    --------
    fastslow.classify_regime, fastslow.refined_map, fastslow.plot.regime_map

    Examples
    --------
    >>> import fastslow as fs
    >>> gear = fs.systems.harmonic_gear(omega=0.1)
    >>> over = {"D": (0.02, 0.3), "ratio": (0.95, 1.1)}
    >>> found = regime_map(
    ...     gear,
    ...     over,
    ...     [0, 0],
    ...     parameters={"C": "B*ratio"},
    ...     refinement=fs.Refinement(cells=(4, 4), levels=2),
    ...     periods=2,
    ... )
    >>> found.labels
    ('bilateral', 'meshed upper', 'unilateral upper')
    >>> found.at(D=0.05, ratio=1.05), found.at(D=0.29, ratio=1.05), found.at(D=0.1, ratio=0.96)
    ('bilateral', 'unilateral upper', 'meshed upper')
    """
    refuse_resets(model.resets, "regime_map")
    refuse_switches(model.switches, "regime_map")
    refuse_memory(model.events, model.assigned, "regime_map")
    begin, _ = starts_and_parameters(model, state, None)
    values_at = _values(model, [str(name) for name in over], parameters)
    labels = _RegimeLabels(model, begin, values_at, periods, max_periods, period, integration)
    found = refined_map(labels, over, refinement=refinement, execution=execution)
    if found.labels == (NO_GAP,):
        raise ArgumentError(
            "this model has no gap anywhere in the map: no three regions between two parallel "
            "interfaces; simulate(...).regimes(gap=...) takes any region between two others"
        )
    return found


@dataclass(frozen=True)
class _RegimeLabels:
    """The regime at points of a map, a function that can be sent to other processes.

    Parameters
    ----------
    model : Model
    begin : ndarray, shape (k, n)
        Initial states of every point.
    values_at : callable
        From values along the axes to values of parameters.
    periods, max_periods, period, integration
        As in `regime_map`.
    """

    model: Model
    begin: Floats
    values_at: Callable[[Floats, Floats], dict[str, Any]]
    periods: float
    max_periods: float
    period: float | None
    integration: Integration

    def __call__(self, first: Floats, second: Floats) -> list[Any]:
        given = self.values_at(first, second)
        values = {name: np.broadcast_to(value, len(first)) for name, value in given.items()}
        found = [
            regimes_at(
                self.model,
                start,
                values,
                periods=self.periods,
                max_periods=self.max_periods,
                period=self.period,
                integration=self.integration,
            )
            for start in self.begin
        ]
        words: list[Any] = []
        for point in zip(*found, strict=True):
            failed = [word for word in point if isinstance(word, Outcome)]
            words.append(failed[0] if failed else coexisting(point))
        return words


@dataclass(frozen=True)
class _Given:
    """Values of parameters from a function of the axes."""

    function: Callable[..., Any]

    def __call__(self, *arrays: Floats) -> dict[str, Any]:
        returned = mapping("what parameters returns", self.function(*arrays))
        return {str(name): values for name, values in returned.items()}


@dataclass(frozen=True)
class _Laws:
    """Values of parameters from the axes themselves, and by expressions in them."""

    parameters: Mapping[str, float]
    axes: tuple[str, ...]
    laws: Mapping[str, str]

    def __call__(self, *arrays: Floats) -> dict[str, Any]:
        own = dict(zip(self.axes, arrays, strict=True))
        known: dict[str, ArrayLike] = {**self.parameters, **own}
        direct = {name: values for name, values in own.items() if name in self.parameters}
        turned = {
            name: np.broadcast_to(evaluated(law, known), arrays[0].shape)
            for name, law in self.laws.items()
        }
        return {**direct, **turned}


def _values(
    model: Model, axes: list[str], parameters: Parameters | None
) -> Callable[[Floats, Floats], dict[str, Any]]:
    """Function from values along the axes to values of the model's parameters."""
    if callable(parameters):
        return _Given(parameters)
    laws = {str(name): str(law) for name, law in (parameters or {}).items()}
    for name in laws:
        if name not in model.parameters:
            raise unknown_name("parameter", name, model.parameters)
    valid = dict.fromkeys([*model.parameters, *axes])
    used = {name for law in laws.values() for name in names_in(law, valid)}
    for name in axes:
        if name not in model.parameters and name not in used:
            raise unknown_name("parameter", name, model.parameters)
    return _Laws(dict(model.parameters), tuple(axes), laws)
