"""A special point with the rates around it, as the laws of slow passage need them."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from fastslow.arguments import finite
from fastslow.diagrams.fields import FrozenField
from fastslow.errors import ArgumentError, unknown_name
from fastslow.model.model import Model
from fastslow.model.structure import real
from fastslow.results.point_types import point_name
from fastslow.results.points import SpecialPoint

Array = NDArray[np.float64]


class WrongWay(ArgumentError):
    """The parameter drifts towards the stable sheet and not off its end."""


@dataclass(frozen=True, eq=False)
class Site:
    """A special point on the field of its frozen model.

    Parameters
    ----------
    point : SpecialPoint
    field : FrozenField
        Over the parameter that drifts.
    u : ndarray, shape (n + 1,)
        State and parameter.
    """

    point: SpecialPoint
    field: FrozenField
    u: Array

    @property
    def n(self) -> int:
        return self.field.n

    def region(self, name: str) -> int:
        return self.field.regions.index(name)

    def slopes(self, region: int) -> tuple[Array, Array]:
        """Jacobian (n, n) and derivative by the parameter (n,) of a region's rates."""
        _, slopes, _, _ = self.field.at(region, self.u)
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
        moving = [real(n) for n in (*self.field.model.states, self.field.parameter)]
        functions = [*self.field.rates(region), *self.field.modes[region].rows]
        return all(
            sp.expand(f.diff(a)).free_symbols.isdisjoint(moving)
            for f in functions
            for a in moving
            if a in f.free_symbols
        )

    @property
    def _numbers(self) -> dict[sp.Symbol, float]:
        names = (*self.field.model.states, self.field.parameter)
        values = self.field.model.values
        return {**values, **{real(n): float(v) for n, v in zip(names, self.u, strict=True)}}


def site_of(point: SpecialPoint, parameter: object, model: Model | None) -> Site:
    """Put a special point on the field of its model.

    Raises
    ------
    ArgumentError
        If there is no model, or it is not clear which parameter drifts.
    UnknownNameError
        For a name that is no parameter.
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
        left = [n for n in model.free if n not in model.parameters]
        if len(left) != 1:
            raise ArgumentError(
                "which parameter drifts? give parameter=, one of " + ", ".join(sorted(set(known)))
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
    return Site(point, field, np.append(point.state, point.parameters[name]))


@lru_cache(maxsize=32)
def _frozen(model: Model) -> Model:
    return model.frozen()


@lru_cache(maxsize=64)
def _field(model: Model, name: str, values: tuple[tuple[str, float], ...]) -> FrozenField:
    return FrozenField(model.with_parameters(dict(values)).freed(name), name)


def require_code(point: SpecialPoint, code: str, law: str) -> None:
    """Raise unless a special point is of a code."""
    if point.code != code:
        received = f"{point.label}, a {point_name(point.code)}"
        raise ArgumentError(
            f"{law} holds at a point {code} ({point_name(code)}); received {received}"
        )


def drift(rate: Any) -> float:
    """A rate of drift that is finite and not zero."""
    try:
        value = float(rate)
    except (TypeError, ValueError):
        value = math.nan
    if not math.isfinite(value) or value == 0.0:
        raise ArgumentError(f"rate = {rate!r}; expected a finite rate of drift other than zero")
    return value


def level_of(site: Site, level: Any) -> tuple[int, float] | None:
    """The state of a level, by its number, and how far it is from the special point."""
    if level is None:
        return None
    if not isinstance(level, Mapping) or len(level) != 1:
        raise ArgumentError(
            f"level = {level!r}; expected one state and its value, as in {{'x': 1}}"
        )
    ((name, value),) = level.items()
    states = site.field.model.states
    if str(name) not in states:
        raise unknown_name("state of the level", name, states)
    value = finite(f"level of {name}", value)
    number = states.index(str(name))
    return number, value - float(site.u[number])


def named_level(site: Site, level: tuple[int, float] | None) -> dict[str, float] | None:
    """A level as it was given."""
    if level is None:
        return None
    number, height = level
    return {site.field.model.states[number]: float(site.u[number]) + height}


def wrong_way(site: Site, rate: float) -> WrongWay:
    """The error for a drift towards a stable sheet."""
    name, way = site.field.parameter, "rising" if rate > 0 else "falling"
    other = "rate < 0" if rate > 0 else "rate > 0"
    return WrongWay(
        f"rate = {rate:g}: with {name} {way} no stable sheet ends at {site.point.label}; "
        f"expected {other}"
    )
