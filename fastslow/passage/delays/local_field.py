"""Special point with the vector field around it, for the laws of slow passage."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from fastslow.arguments import either, finite, instance, refusal
from fastslow.diagrams.field import FrozenField
from fastslow.errors import ArgumentError, unknown_name
from fastslow.model.model import Model
from fastslow.model.structure import real
from fastslow.results.overlay.drifts import Drift
from fastslow.results.point_types import POINT_TYPES
from fastslow.results.points import SpecialPoint

Array = NDArray[np.float64]


#: Relative difference below which special points of a diagram are the same.
SAME_POINT = 1e-9


#: Level at the extremum of the slow quantity.
TURN = "turn"

#: End of a jump: index of a state and its height above the point, or an extremum.
Level = tuple[int, float] | str


class WrongWay(ArgumentError):
    """Error for a parameter that drifts towards the stable branch and not past its end."""


@dataclass(frozen=True, eq=False)
class LocalField:
    """Special point with the vector field of its frozen model.

    Parameters
    ----------
    point : SpecialPoint
    field : FrozenField
        Field over the drifting parameter.
    u : ndarray, shape (n + 1,)
        State and parameter.
    """

    point: SpecialPoint
    field: FrozenField
    u: Array

    @property
    def n(self) -> int:
        return self.field.n

    @property
    def unit(self) -> Array:
        """Size of each state on the point's branch, or its natural unit, shape (n,)."""
        if self.point.source is not None:
            return np.asarray(self.point.source.unit)
        return self.field.units_at(abs(float(self.u[-1])))[: self.n]

    def region(self, name: str) -> int:
        return self.field.regions.index(name)

    def slopes(self, region: int) -> tuple[Array, Array]:
        """Jacobian (n, n) and parameter derivative (n,) of a region's rates."""
        _, slopes, _, _ = self.field.evaluate(region, self.u)
        return slopes[:, : self.n], slopes[:, self.n]

    def mixed(self, region: int) -> Array:
        """∂²F/∂x∂p of a region's rates, shape (n, n)."""
        p = real(self.field.parameter)
        rates = self.field.rates(region)
        names = map(real, self.field.model.states)
        table = sp.Matrix([rate.diff(p) for rate in rates]).jacobian(list(names))
        return np.array(table.subs(self._numbers), dtype=float)

    def affine(self, region: int) -> bool:
        """Whether a region's rates and all interfaces are affine in states and parameter."""
        return _affine(self.field, region)

    @property
    def _numbers(self) -> dict[sp.Symbol, float]:
        names = (*self.field.model.states, self.field.parameter)
        values = self.field.model.values
        return {**values, **{real(n): float(v) for n, v in zip(names, self.u, strict=True)}}


@lru_cache(maxsize=256)
def _affine(field: FrozenField, region: int) -> bool:
    moving = [real(n) for n in (*field.model.states, field.parameter)]
    functions = [*field.rates(region), *field.modes[region].rows]
    return all(
        sp.expand(f.diff(a)).free_symbols.isdisjoint(moving)
        for f in functions
        for a in moving
        if a in f.free_symbols
    )


def local_field_at(point: SpecialPoint, parameter: object, model: Model | None) -> LocalField:
    """Combine a special point with the vector field of its model.

    Raises
    ------
    ArgumentError
        If there is no model, or the drifting parameter is ambiguous.
    UnknownNameError
        For an unknown parameter.
    """
    if model is None:
        if point.source is None:
            raise ArgumentError(
                f"the point {point.label} carries no model (it was read from a file or another "
                "process); give model="
            )
        model = point.source.model
    elif model.forcing or model.slow_states:
        model = _frozen(model)
    known = (*model.parameters, *model.free)
    if parameter is None:
        left = [n for n in model.free if n not in model.parameters] or sorted(set(known))
        if not left:
            raise ArgumentError("the model has no parameter that could drift")
        if len(left) > 1:
            raise ArgumentError(
                f"the drifting parameter is ambiguous; give parameter=, one of {', '.join(left)}"
            )
        name = left[0]
    else:
        name = str(parameter)
        if name not in known:
            raise unknown_name("parameter", name, known)
    if name not in point.parameters:
        raise unknown_name("parameter of the point", name, point.parameters)
    values = {n: point.parameters[n] for n in known if n in point.parameters}
    field = _field(model, name, tuple(sorted(values.items())))
    return LocalField(point, field, np.append(point.state, point.parameters[name]))


@lru_cache(maxsize=32)
def _frozen(model: Model) -> Model:
    return model.frozen()


@lru_cache(maxsize=64)
def _field(model: Model, name: str, values: tuple[tuple[str, float], ...]) -> FrozenField:
    return FrozenField(model.with_parameters(dict(values)).with_free(name), name)


def frozen_field(model: Model, parameter: str, values: Mapping[str, float]) -> FrozenField:
    """Fast subsystem of a model over one slow quantity, at given values of the others."""
    fast = _frozen(model) if model.forcing or model.slow_states else model
    known = {n: values[n] for n in (*fast.parameters, *fast.free) if n in values}
    return _field(fast, parameter, tuple(sorted(known.items())))


def require_law(point: SpecialPoint, law: str, words: str) -> None:
    """Raise unless a law of delay applies to points of the type of a special point."""
    if point.kind.law != law:
        known = next(one for one in POINT_TYPES.values() if one.law == law)
        received = f"{point.label}, a {point.kind.name}"
        raise ArgumentError(
            f"{words} requires a point {known.code} ({known.name}); received {received}"
        )


def drift(rate: Any) -> float:
    """Return a finite, nonzero rate of drift."""
    return Drift(rate).rate


def drift_of(local: LocalField, rate: float | Drift) -> Drift:
    """Convert a rate to a `Drift`, and check its states.

    Raises
    ------
    ArgumentError
        For a rate that is zero or not finite.
    UnknownNameError
        For an unknown state.
    """
    drift = rate if isinstance(rate, Drift) else Drift(rate)
    states = local.field.model.states
    for name in drift.by_state:
        if name not in states:
            raise unknown_name("state of the drift", name, states)
    return drift


def passage_at(
    point: SpecialPoint, rate: float | Drift, parameter: object, model: Model | None
) -> tuple[LocalField, Drift]:
    """Return the vector field near a special point and the drift through it.

    Raises
    ------
    ArgumentError
        Without a model, or for a rate that is zero or not finite.
    UnknownNameError
        For an unknown parameter or state of the drift.
    """
    local = local_field_at(point, parameter, model)
    return local, drift_of(local, rate)


def delay_fields(local: LocalField, drift: Drift) -> dict[str, Any]:
    """Return the fields of a `Delay` that do not depend on its law."""
    return {
        "point": local.point,
        "parameter": local.field.parameter,
        "rate": drift.rate,
        "drift": None if drift.constant else drift,
    }


def level_argument(name: str, value: Any) -> Any:
    """Check a level: a mapping of one state, or ``"turn"``."""
    if not (isinstance(value, Mapping) or (isinstance(value, str) and value == TURN)):
        raise refusal(name, value, "a mapping of one state to its value, or 'turn'")
    return value


#: Check of a rate of drift.
rate_argument = either(instance(Drift), finite)


def level_of(local: LocalField, level: Any, drift: Drift) -> Level | None:
    """Index of a level's state and its height above the special point, or an extremum."""
    if level is None:
        return None
    if level == TURN:
        if drift.constant:
            raise ArgumentError(
                "level = 'turn': a constant drift has no extremum; give rate=fs.Drift(...) with "
                "its feedback from the states or its change in time"
            )
        return TURN
    if not isinstance(level, Mapping) or len(level) != 1:
        raise ArgumentError(
            f"level = {level!r}; expected one state and its value, as in {{'x': 1}}, or 'turn'"
        )
    ((name, value),) = level.items()
    states = local.field.model.states
    if str(name) not in states:
        raise unknown_name("state of the level", name, states)
    value = finite(f"level of {name}", value)
    number = states.index(str(name))
    return number, value - float(local.u[number])


def named_level(local: LocalField, level: Level | None) -> dict[str, float] | str | None:
    """Level in the form of the argument."""
    if level is None or isinstance(level, str):
        return level
    number, height = level
    return {local.field.model.states[number]: float(local.u[number]) + height}


def wrong_way(local: LocalField, rate: float) -> WrongWay:
    """Error for a drift towards a stable branch."""
    name, way = local.field.parameter, "rising" if rate > 0 else "falling"
    other = "rate < 0" if rate > 0 else "rate > 0"
    return WrongWay(
        f"rate = {rate:g}: with {name} {way} no stable branch ends at {local.point.label}; "
        f"expected {other}"
    )


def same_point(
    one: SpecialPoint,
    other: SpecialPoint,
    parameter: str,
    length: float,
    within: float = SAME_POINT,
) -> bool:
    """Whether two special points coincide up to rounding, in any units.

    Parameters
    ----------
    one, other : SpecialPoint
    parameter : str
        The parameter that varies.
    length : float
        Length of its range.
    within : float
        Tolerance relative to the size of a state and to the length.
    """
    if (one.code, one.states) != (other.code, other.states):
        return False
    unit = np.maximum(np.abs(one.state), np.abs(other.state))
    for point in (one, other):
        if point.source is not None:
            unit = np.maximum(unit, point.source.unit)
    apart = abs(one[parameter] - other[parameter])
    return bool(
        np.all(np.abs(one.state - other.state) <= within * unit)
        and apart <= within * max(abs(one[parameter]), length)
    )
