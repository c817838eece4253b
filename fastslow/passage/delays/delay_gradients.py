"""Derivatives of predicted delays by central differences of the law."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from fastslow.diagrams.curves.point_gradients import PointPath, path_of
from fastslow.errors import ArgumentError, unknown_name
from fastslow.model.model import Model
from fastslow.results.base.named_mapping import NamedMapping
from fastslow.results.overlay.delays import Delay
from fastslow.results.overlay.drifts import Drift
from fastslow.results.points import SpecialPoint

Array = NDArray[np.float64]

#: A law as a function of the point and the rate.
Law = Callable[[SpecialPoint, float | Drift], Delay]

#: Name of the rate, by which a law can be differentiated too.
RATE = "rate"

#: Largest step of differences, relative to the sizes of the parameter, the states and the
#: critical value, and number of halvings.
GRADIENT_STEP, GRADIENT_HALVINGS = 0.05, 5

#: Fractions of the largest step from which differences begin, in order.
SMALLER = (1.0, 1 / 8, 1 / 64)

#: Largest estimated error of differences, relative to the size of the law in units of a step.
GRADIENT_ERROR = 1e-7


def gradient_by_differences(delay: Delay, name: str, law: Law) -> NamedMapping[float]:
    """Differentiate a law by a parameter of the model or by the rate of a constant drift.

    Raises
    ------
    ArgumentError
        Without a model, for the rate of a drift that is not constant, or without a derivative.
    UnknownNameError
        For another name.
    """
    if delay.point.source is None:
        raise ArgumentError(
            "the point of this delay has no model (it was read from a file or another process); "
            "compute it again and predict its delay"
        )
    model: Model = delay.point.source.model
    if name == RATE and name not in model.parameters:
        if delay.drift is not None:
            raise ArgumentError(
                "this drift is not constant, and has no single rate; expected a parameter: "
                + ", ".join(other_parameters(model, delay.parameter))
            )
        return _differentiated(
            lambda rate: law(delay.point, rate), delay.rate, abs(delay.rate), delay, name
        )
    if name not in (*model.parameters, *model.free):
        raise unknown_name("parameter", name, (*other_parameters(model, delay.parameter), RATE))
    path = path_of(delay.point, name, delay.parameter)
    drift = delay.rate if delay.drift is None else delay.drift

    def moved(value: float) -> Delay | None:
        point = path.at(value)
        return None if point is None else law(point, drift)

    return _differentiated(moved, delay.point.parameters[name], _reach(path), delay, name)


def other_parameters(model: Model, own: str) -> list[str]:
    """Names of all parameters but the drifting one."""
    return [name for name in dict.fromkeys((*model.parameters, *model.free)) if name != own]


def _reach(path: PointPath) -> float:
    """Change of a parameter that changes it, the states or the critical value by their size."""
    n, point = path.system.n, path.point
    value, here = path.z[n + 1], path.z[n]
    sizes = [abs(value), *point.source.unit, abs(here)]
    speeds = [1.0, *np.abs(path.along[:n]), abs(path.along[n])]
    known = [size / speed for size, speed in zip(sizes, speeds, strict=True) if size * speed > 0]
    return float(min(known, default=1.0))


def _differentiated(
    law: Callable[[float], Delay | None], value: float, size: float, delay: Delay, name: str
) -> NamedMapping[float]:
    """Central differences of a law, extrapolated to the limit of small steps (Ridders 1982)."""
    first = law(value)
    assert first is not None
    names = [q for q in delay.quantities if math.isfinite(getattr(first, q))]

    def values(at: float) -> Array:
        try:
            found = law(at)
        except ArgumentError:
            found = None
        return np.array([getattr(found, q, math.nan) for q in names], dtype=float)

    scale = np.abs([getattr(first, q) for q in names])
    for fraction in SMALLER:
        step = GRADIENT_STEP * size * fraction
        found, error = _extrapolated(values, value, step)
        if (error * step <= GRADIENT_ERROR * np.maximum(scale, np.abs(found) * step)).all():
            return NamedMapping("quantity", dict(zip(names, found.tolist(), strict=True)))
    raise ArgumentError(
        f"the delay has no derivative by {name}, as far as differences of the law show: it "
        "changes abruptly or is not defined next to this value"
    )


def _extrapolated(
    values: Callable[[float], Array], value: float, step: float
) -> tuple[Array, Array]:
    """Derivatives with the estimate of their errors."""
    row: list[Array] = []
    best, error = np.array(math.nan), np.array(math.inf)
    for k in range(GRADIENT_HALVINGS + 1):
        h = step * 0.5**k
        following = [(values(value + h) - values(value - h)) / (2.0 * h)]
        for j, last in enumerate(row):
            following.append(following[j] + (following[j] - last) / (4.0 ** (j + 1) - 1.0))
        if row:
            apart = np.abs(following[-1] - row[-1])
            better = apart < error
            best = np.where(better, following[-1], best)
            error = np.where(better, apart, error)
        row = following
    return best, error
