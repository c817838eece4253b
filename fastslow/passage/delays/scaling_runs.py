"""Delays measured by simulation over a range of rates."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from tqdm import tqdm

from fastslow.arguments import (
    finite,
    flag,
    formula,
    instance,
    mapping,
    numbers,
    validated,
)
from fastslow.diagrams.trace.tracing import continue_equilibria
from fastslow.errors import ArgumentError, FastSlowError
from fastslow.model.model import Model
from fastslow.passage.delays.boundary_delays import approach_of
from fastslow.passage.delays.delay_laws import predict_delay
from fastslow.passage.delays.local_field import Site, WrongWay, same_point, site_of
from fastslow.passage.delays.scaling_fits import fitted
from fastslow.results.base.outcome import Outcome
from fastslow.results.branch.branch import Branch
from fastslow.results.branch.diagram import Diagram
from fastslow.results.overlay.delay_scaling import DelayScaling
from fastslow.results.overlay.delays import BoundaryDelay, FoldDelay, GapTransit
from fastslow.results.overlay.drifts import Drift
from fastslow.results.point_types import POINT_TYPES, point_name
from fastslow.results.points import SpecialPoint
from fastslow.results.trajectory.section import Section
from fastslow.results.trajectory.trajectory import Trajectory
from fastslow.simulation.one import simulate
from fastslow.simulation.settings import Integration, integration_settings

Array = NDArray[np.float64]
Law = FoldDelay | BoundaryDelay | GapTransit

#: Error control of the runs, by default.
PRECISE = Integration(rtol=1e-13)

#: A run starts where this many relaxation times of its sheet, integrated, lie before the point.
FORGOTTEN = 40.0

#: A point found again over a shorter range differs by less than this part of its size.
AGAIN = 1e-7

#: A run ends at this multiple of the predicted delay.
REACH = 4.0


@validated(
    model=instance(Model),
    point=instance(SpecialPoint),
    level=mapping,
    start=finite,
    parameter=formula,
    integration=integration_settings,
    progress=flag,
)
def delay_scaling(
    model: Model,
    point: SpecialPoint,
    rates: ArrayLike,
    *,
    level: Mapping[Any, float] | None = None,
    start: float | None = None,
    parameter: object = None,
    integration: Integration = PRECISE,
    progress: bool = False,
) -> DelayScaling:
    """Measure the delay past a special point at a range of rates, beside its law.

    At each rate the frozen model's parameter drifts through the point, from the
    quasi-static state on the stable sheet far enough before that the start is
    forgotten; the delay is read where the trajectory reaches a level or an
    interface, found on its series to rounding.

    Parameters
    ----------
    model : Model
        The frozen model, or the full one to be frozen.
    point : SpecialPoint
        A fold (LP) or a boundary equilibrium (BE).
    rates : array_like, shape (m,)
        Speeds of the drift, positive; its direction is the one in which the stable
        sheet ends (rising, where it goes on either way).
    level : mapping
        One state and its value at which a jump counts as done, e.g. ``{"x": 1}``; at a
        fold or a non-smooth fold. Persistence is measured at its interface, a gap
        at the far one.
    start : float, optional
        Value of the parameter at which every run starts.
    parameter : str or Symbol, optional
        What drifts, by default the parameter of the point's diagram.
    integration : Integration
        Error control of the runs, and where one of them stops; by default with
        ``rtol=1e-13``, so that small delays keep their digits.
    progress : bool
        Whether to show a progress bar.

    Returns
    -------
    DelayScaling

    Raises
    ------
    ArgumentError
        For a point without a law of delay (see `predict_delay`), rates that are not
        positive or equal, a missing level, or a start off the stable sheet.

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
    site = site_of(point, parameter, model)
    name = site.field.parameter
    direction, first = _direction(site, eps[0], level)
    if isinstance(first, FoldDelay) and level is None:
        raise ArgumentError(
            "the delay of a jump is that of reaching a level; give level={state: value}"
        )
    laws = [first]
    laws += [_law(site, direction * e, level) for e in eps[1:]]
    ramp = site.field.model.with_ramp(name, direction * eps[0])
    before = _starts(site, laws, start)
    delays, outcomes = [], []
    for law, (value, state) in zip(
        tqdm(laws, unit="rate", disable=not progress), before, strict=True
    ):
        delay, outcome = _measured(ramp, site, law, value, state, integration)
        delays.append(delay)
        outcomes.append(outcome)
    return fitted(site, direction, _event(first), eps, np.array(delays), laws, outcomes)


def _speeds(rates: ArrayLike) -> Array:
    eps = numbers("rates", rates)
    if eps.ndim != 1 or len(eps) < 2 or not np.isfinite(eps).all() or np.any(eps <= 0):
        raise ArgumentError(f"rates = {rates!r}; expected at least two positive speeds")
    eps = np.sort(eps)[::-1]
    if np.any(eps[1:] == eps[:-1]):
        raise ArgumentError(f"rates = {rates!r}; expected speeds that differ")
    return np.ascontiguousarray(eps)


def _law(site: Site, rate: float, level: Mapping[Any, float] | None) -> Law:
    if POINT_TYPES[site.point.code].law == "entry-exit":
        raise ArgumentError(
            f"expected a fold (LP) or a boundary equilibrium (BE), received {site.point.label}, a "
            f"{point_name(site.point.code)}, whose exit depends on the entry: see predict_delay"
        )
    law = predict_delay(
        site.point, rate, level=level, parameter=site.field.parameter, model=site.field.model
    )
    assert isinstance(law, FoldDelay | BoundaryDelay | GapTransit)
    return law


def _direction(site: Site, eps: float, level: Mapping[Any, float] | None) -> tuple[int, Law]:
    """The direction in which the stable sheet ends, and the law for it."""
    try:
        return 1, _law(site, eps, level)
    except WrongWay:
        return -1, _law(site, -eps, level)


def _event(law: Law) -> str:
    """What ends the delay, in words."""
    if isinstance(law, GapTransit):
        return f"{law.interfaces[1]} = 0"
    if law.level is None or (isinstance(law, BoundaryDelay) and law.subtype == "persistence"):
        return f"{law.point.interface} = 0"
    assert isinstance(law.level, Mapping)
    ((state, value),) = law.level.items()
    return f"{state} = {value:g}"


def _starts(site: Site, laws: list[Law], start: float | None) -> list[tuple[float, Array]]:
    """Value of the parameter and quasi-static state from which each run starts."""
    name, here = site.field.parameter, float(site.u[-1])
    way = 1.0 if laws[0].rate > 0 else -1.0
    far = [_distance(site, law) for law in laws]
    if start is not None:
        if not (way * (here - start) > 0):
            side = "below" if way > 0 else "above"
            raise ArgumentError(f"start = {start:g}; expected a value {side} {name} = {here:g}")
        far = [abs(here - start)] * len(laws)
    ends = sorted((here - 1.02 * way * max(far), here + 0.05 * way * max(far)))
    model = site.field.model
    diagram = continue_equilibria(model, name, (ends[0], ends[1]))
    branch, rows = _stable_rows(site, diagram.branches, way, ends[1] - ends[0])
    found = []
    for law, distance in zip(laws, far, strict=True):
        value = here - way * distance
        low, high = sorted((float(branch.parameter[rows[0]]), float(branch.parameter[rows[-1]])))
        if not low <= value <= high:
            raise ArgumentError(
                f"at rate {abs(law.rate):.3g} a run would start at {name} = {value:.6g}, but the "
                f"stable sheet before {site.point.label} goes from {low:.6g} to {high:.6g}; give "
                "smaller rates, or start="
            )
        region = str(branch.region[rows[len(rows) // 2]])
        order = np.argsort(branch.parameter[rows])
        across, sheet = branch.parameter[rows][order], branch.state[rows][order]
        guess = np.array([np.interp(value, across, sheet[:, k]) for k in range(site.n)])
        corrected = _corrected(site, diagram, region, guess, value)
        _, slopes, _, _ = site.field.evaluate(site.region(region), np.append(corrected, value))
        jacobian, slope = slopes[:, : site.n], slopes[:, site.n]
        lag = np.linalg.solve(jacobian, np.linalg.solve(jacobian, slope)) * law.rate
        found.append((value, corrected - lag))
    return found


def _corrected(site: Site, diagram: Diagram, region: str, guess: Array, value: float) -> Array:
    """The equilibrium near a state, to rounding."""
    solved = diagram.corrector(region, guess, value) if diagram.corrector is not None else None
    if solved is None:
        raise ArgumentError(
            f"no equilibrium was found at {site.field.parameter} = {value:.6g} on the sheet before "
            f"{site.point.label}"
        )
    return solved.state


def _distance(site: Site, law: Law) -> float:
    """How far before the point the start is forgotten when the point is reached."""
    speed = abs(law.rate)
    if isinstance(law, FoldDelay):
        # |λ| = 2 √(|ab| |μ|) next to the fold
        pull = math.sqrt(abs(law.quadratic * law.slope))
        return float((0.75 * FORGOTTEN * speed / pull) ** (2.0 / 3.0))
    return FORGOTTEN * speed / abs(approach_of(site, Drift(law.rate)).stable)


def _stable_rows(
    site: Site, branches: tuple[Branch, ...], way: float, length: float
) -> tuple[Branch, NDArray[np.intp]]:
    """The branch through the point, and its rows along the stable sheet before it.

    ``length`` is that of the range over which the branches were traced.
    """
    name = site.field.parameter
    for branch in branches:
        for other, row in zip(branch.special, branch.special_rows, strict=True):
            if not same_point(site.point, other, name, length, AGAIN):
                continue
            second = row + POINT_TYPES[other.code].two_rows
            for begin, step in ((row, -1), (second, 1)):
                rows = _monotone(branch, begin, step, way)
                if len(rows) > 1:
                    return branch, rows
    raise ArgumentError(
        f"the stable sheet before {site.point.label} was not found; expected a point of this model"
    )


def _monotone(branch: Branch, row: int, step: int, way: float) -> NDArray[np.intp]:
    """Rows of one region from one on, as long as they are stable and lead back before the point."""
    rows, stable, values = [row], branch.stable, branch.parameter
    following = row + step
    while 0 <= following < len(values):
        back = way * (values[rows[-1]] - values[following]) > 0
        if not (back and stable[following] and branch.region[following] == branch.region[row]):
            break
        rows.append(following)
        following += step
    return np.array(rows)


def _measured(
    ramp: Model, site: Site, law: Law, value: float, state: Array, integration: Integration
) -> tuple[float, Outcome]:
    """The delay of one run, nan with the reason where there is none."""
    name, speed = site.field.parameter, abs(law.rate)
    ahead = abs(float(site.u[-1]) - value)
    span = abs(law.delay) if math.isfinite(law.delay) else ahead
    model = ramp.with_parameters({f"{name}_rate": law.rate, f"{name}_start": value})
    end = (ahead + REACH * span) / speed
    try:
        run = simulate(model, state, t=(0.0, end), integration=integration)
    except FastSlowError as error:
        return math.nan, Outcome("not simulated", str(error), False)
    times = _hits(run, law, ahead / speed)
    if not len(times):
        reason = (
            str(run.outcome) if not run.outcome else f"not reached by {name} = {run[name][-1]:.6g}."
        )
        return math.nan, Outcome("not reached", f"{_event(law)}: {reason}", False)
    delay = speed * (float(times.times[0]) - ahead / speed)
    return delay, Outcome("reached", f"{_event(law)} was reached.", True)


def _hits(run: Trajectory, law: Law, passed: float) -> Section:
    """Where the run reaches what ends the delay."""
    if isinstance(law, GapTransit):
        found = run.section(interface=law.interfaces[1])
    elif law.level is None or (isinstance(law, BoundaryDelay) and law.subtype == "persistence"):
        found = run.section(interface=law.point.interface)
    else:
        assert isinstance(law.level, Mapping)
        ((state, value),) = law.level.items()
        found = run.section(state, level=value, since=min(passed, run.span[1]))
    return found
