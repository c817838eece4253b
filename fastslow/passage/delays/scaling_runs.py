"""Delays measured by simulation over a range of rates."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fastslow.arguments import Name, finite, formula, instance, mapping, numbers, validated
from fastslow.diagrams.trace.tracing import continue_equilibria
from fastslow.errors import ArgumentError, FastSlowError
from fastslow.model.model import Model
from fastslow.passage.delays.local_field import LocalField, WrongWay, local_field_at, same_point
from fastslow.passage.delays.predicting import law_at, predict_delay
from fastslow.passage.delays.scaling_fits import fitted
from fastslow.results.base.outcome import Outcome
from fastslow.results.branch.branch import Branch
from fastslow.results.branch.diagram import Diagram
from fastslow.results.overlay.delay_scaling import DelayScaling
from fastslow.results.overlay.delays import Delay, PassageEnd
from fastslow.results.points import SpecialPoint
from fastslow.simulation.one import simulate
from fastslow.simulation.settings import (
    EXECUTION,
    Execution,
    Integration,
    integration_settings,
    map_settings,
)
from fastslow.sweeps.grid_sweep import sweep

Array = NDArray[np.float64]

#: Default error control of the runs.
PRECISE = Integration(rtol=1e-13)

#: Relative difference of a point located again over a shorter range.
AGAIN = 1e-7

#: End of a run as a multiple of the predicted delay.
RUN_END = 4.0


@validated(
    model=instance(Model),
    point=instance(SpecialPoint),
    level=mapping,
    from_value=finite,
    parameter=formula,
    integration=integration_settings,
    execution=map_settings,
)
def delay_scaling(
    model: Model,
    point: SpecialPoint,
    rates: ArrayLike,
    *,
    level: Mapping[Any, float] | None = None,
    from_value: float | None = None,
    parameter: Name | None = None,
    integration: Integration = PRECISE,
    execution: Execution = EXECUTION,
) -> DelayScaling:
    """Measure and predict the delay past a special point over a range of rates.

    At each rate the parameter of the frozen model drifts through the point, from a
    quasi-static state on the stable branch, far enough before the point for initial
    transients to decay. The delay is measured where the trajectory reaches a level or an
    interface, located to rounding on its Taylor series.

    Parameters
    ----------
    model : Model
        The frozen model, or the full model, which is then frozen.
    point : SpecialPoint
        A fold (LP) or a boundary equilibrium (BE).
    rates : array_like, shape (m,)
        Positive speeds of the drift; its direction is the one in which the stable
        branch ends (increasing if it ends in neither).
    level : mapping
        One state and its value that marks the end of a jump, e.g. ``{"x": 1}``, at a fold
        or a non-smooth fold. Persistence is measured at the interface, a gap crossing at
        the far interface.
    from_value : float, optional
        Value of the parameter at which every run starts.
    parameter : str or Symbol, optional
        The drifting parameter, by default that of the point's diagram.
    integration : Integration
        Error control and limits of the runs; by default ``rtol=1e-13``, as small delays
        require.
    execution : Execution
        Executor and number of runs of its tasks; by default the rates are taken one after another
        in this process. A store keeps the delay at each rate, and the same call resumes it.
        Progress bar.

    Returns
    -------
    DelayScaling

    Raises
    ------
    ArgumentError
        For a point without a law of delay (see `predict_delay`), rates that are not positive
        and distinct, a missing level, or a ``from_value`` that is not on the stable branch.

    See Also
    --------
    fastslow.predict_delay, fastslow.overlay, fastslow.plot.delay_scaling

    Examples
    --------
    >>> import fastslow as fs
    >>> fast = fs.systems.cusp().frozen()
    >>> fold = fs.continue_equilibria(fast, "p", over=(-1, 1)).folds[0]
    >>> measured = delay_scaling(fast, fold, [1e-5, 1e-6, 1e-7], level={"x": 0.5})
    >>> measured.local_exponents.round(3)
    array([0.668, 0.668])
    """
    eps = _speeds(rates)
    local = local_field_at(point, parameter, model)
    name = local.field.parameter
    direction, first = _direction(local, eps[0], level)
    if first.end is None:
        raise ArgumentError(
            "the delay of a jump depends on the level that ends it; give level={state: value}"
        )
    laws = [first]
    laws += [_predicted(local, direction * e, level) for e in eps[1:]]
    ramp = local.field.model.with_ramp(name, direction * eps[0])
    before = _starts(local, laws, from_value)
    here = float(local.u[-1])
    runs = DelayRuns(ramp, name, here, direction, first.end, integration)
    states = np.array([state for _, state in before])
    axes: dict[str, ArrayLike] = {
        "rate": eps,
        "start": np.array([value for value, _ in before]),
        # where the law gives no finite delay, the distance to the point
        "predicted": [
            abs(law.delay) if math.isfinite(law.delay) else abs(here - value)
            for law, (value, _) in zip(laws, before, strict=True)
        ],
        **{f"initial {n}": states[:, k] for k, n in enumerate(local.field.model.states)},
    }
    found = sweep(runs, axes, paired=True, execution=replace(execution, errors="raise"))
    reasons = dict(zip(found.failed.tolist(), found.reasons, strict=True))
    delays, outcomes = np.full(len(eps), math.nan), []
    for row in range(len(eps)):
        code, text = "not simulated", reasons.get(row, "")
        if row not in reasons:
            delays[row], code, text = (found[n][row] for n in ("delay", "code", "text"))
        outcomes.append(_outcome(str(code), str(text)))
    return fitted(local, direction, str(runs.end), eps, delays, laws, outcomes)


def _speeds(rates: ArrayLike) -> Array:
    eps = numbers("rates", rates)
    if eps.ndim != 1 or len(eps) < 2 or not np.isfinite(eps).all() or np.any(eps <= 0):
        raise ArgumentError(f"rates = {rates!r}; expected at least two positive speeds")
    eps = np.sort(eps)[::-1]
    if np.any(eps[1:] == eps[:-1]):
        raise ArgumentError(f"rates = {rates!r}; expected speeds that differ")
    return np.ascontiguousarray(eps)


def _predicted(local: LocalField, rate: float, level: Mapping[Any, float] | None) -> Delay:
    law = law_at(local.point)
    if law is not None and law.entry_exit is not None:
        raise ArgumentError(
            f"expected a fold (LP) or a boundary equilibrium (BE), received {local.point.label}, a "
            f"{local.point.kind.name}, whose exit depends on the entry: see predict_delay"
        )
    return predict_delay(
        local.point, rate, level=level, parameter=local.field.parameter, model=local.field.model
    )


def _direction(
    local: LocalField, eps: float, level: Mapping[Any, float] | None
) -> tuple[int, Delay]:
    """Direction in which the stable branch ends, and the prediction for it."""
    try:
        return 1, _predicted(local, eps, level)
    except WrongWay:
        return -1, _predicted(local, -eps, level)


def _starts(
    local: LocalField, laws: list[Delay], from_value: float | None
) -> list[tuple[float, Array]]:
    """Parameter value and quasi-static state at the start of each run."""
    name, here = local.field.parameter, float(local.u[-1])
    way = 1.0 if laws[0].rate > 0 else -1.0
    known = law_at(local.point)
    assert known is not None
    far = [known.settling_distance(local, law) for law in laws]
    if from_value is not None:
        if not (way * (here - from_value) > 0):
            side = "below" if way > 0 else "above"
            raise ArgumentError(
                f"from_value = {from_value:g}; expected a value {side} {name} = {here:g}"
            )
        far = [abs(here - from_value)] * len(laws)
    ends = sorted((here - 1.02 * way * max(far), here + 0.05 * way * max(far)))
    model = local.field.model
    diagram = continue_equilibria(model, name, (ends[0], ends[1]))
    branch, rows = _stable_rows(local, diagram.branches, way, ends[1] - ends[0])
    found = []
    for law, distance in zip(laws, far, strict=True):
        value = here - way * distance
        low, high = sorted((float(branch.values[rows[0]]), float(branch.values[rows[-1]])))
        if not low <= value <= high:
            raise ArgumentError(
                f"at rate {abs(law.rate):.3g} a run would start at {name} = {value:.6g}, but the "
                f"stable branch before {local.point.label} extends from {low:.6g} to {high:.6g}; "
                "give smaller rates, or from_value="
            )
        region = str(branch.region[rows[len(rows) // 2]])
        order = np.argsort(branch.values[rows])
        across, states = branch.values[rows][order], branch.state[rows][order]
        guess = np.array([np.interp(value, across, states[:, k]) for k in range(local.n)])
        corrected = _corrected(local, diagram, region, guess, value)
        _, slopes, _, _ = local.field.evaluate(local.region(region), np.append(corrected, value))
        jacobian, slope = slopes[:, : local.n], slopes[:, local.n]
        lag = np.linalg.solve(jacobian, np.linalg.solve(jacobian, slope)) * law.rate
        found.append((value, corrected - lag))
    return found


def _corrected(
    local: LocalField, diagram: Diagram, region: str, guess: Array, value: float
) -> Array:
    """Equilibrium near a state, up to rounding."""
    solved = diagram.corrector(region, guess, value) if diagram.corrector is not None else None
    if solved is None:
        raise ArgumentError(
            f"no equilibrium found at {local.field.parameter} = {value:.6g} on the branch before "
            f"{local.point.label}"
        )
    return solved.state


def _stable_rows(
    local: LocalField, branches: tuple[Branch, ...], way: float, length: float
) -> tuple[Branch, NDArray[np.intp]]:
    """Branch through the point, and its rows on the stable branch before the point.

    ``length`` is the length of the parameter range of the branches.
    """
    name = local.field.parameter
    for branch in branches:
        for other, row in zip(branch.special, branch.special_rows, strict=True):
            if not same_point(local.point, other, name, length, AGAIN):
                continue
            second = row + other.kind.two_rows
            for begin, step in ((row, -1), (second, 1)):
                rows = _monotone(branch, begin, step, way)
                if len(rows) > 1:
                    return branch, rows
    raise ArgumentError(
        f"no stable branch found before {local.point.label}; expected a point of this model"
    )


def _monotone(branch: Branch, row: int, step: int, way: float) -> NDArray[np.intp]:
    """Successive stable rows of one region, in the direction away from the point."""
    rows, stable, values = [row], branch.stable, branch.values
    following = row + step
    while 0 <= following < len(values):
        back = way * (values[rows[-1]] - values[following]) > 0
        if not (back and stable[following] and branch.region[following] == branch.region[row]):
            break
        rows.append(following)
        following += step
    return np.array(rows)


def _outcome(code: str, text: str) -> Outcome:
    if code == "reached":
        return Outcome("reached", text, True)
    if code == "not reached":
        return Outcome("not reached", text, False)
    return Outcome("not simulated", text, False)


@dataclass(frozen=True)
class DelayRuns:
    """Function that measures the delay of a run at one rate, in this or another process.

    Parameters
    ----------
    ramp : Model
    parameter : str
    here : float
        Value of the parameter at the point.
    direction : int
    end : PassageEnd
    integration : Integration
    """

    ramp: Model
    parameter: str
    here: float
    direction: int
    end: PassageEnd
    integration: Integration

    def __call__(
        self, rate: float, start: float, predicted: float, **state: float
    ) -> dict[str, float | str]:
        """Return the delay, nan if the event is not reached, and the outcome of a run."""
        name, ahead = self.parameter, abs(self.here - start)
        changed = {f"{name}_rate": self.direction * rate, f"{name}_start": start}
        length = (ahead + RUN_END * predicted) / rate
        try:
            run = simulate(
                self.ramp.with_parameters(changed),
                list(state.values()),
                t=(0.0, length),
                integration=self.integration,
            )
        except FastSlowError as error:
            return {"delay": math.nan, "code": "not simulated", "text": str(error)}
        times = self.end.hits(run, ahead / rate)
        if not len(times):
            reason = (
                str(run.outcome)
                if not run.outcome
                else f"not reached by {name} = {run[name][-1]:.6g}."
            )
            return {"delay": math.nan, "code": "not reached", "text": f"{self.end}: {reason}"}
        delay = rate * (float(times.t[0]) - ahead / rate)
        return {"delay": delay, "code": "reached", "text": f"{self.end} was reached."}
