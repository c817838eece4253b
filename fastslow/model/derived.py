"""Caching of functions of a model by the content on which their result depends."""

from __future__ import annotations

from collections.abc import Callable, Hashable
from functools import lru_cache, wraps
from typing import Any, Concatenate, ParamSpec, TypeVar

from fastslow.model.keyed import Keyed
from fastslow.model.model import Model

P = ParamSpec("P")
R = TypeVar("R")

#: Number of cached results of a function.
KEPT = 256


def partition_of(model: Model) -> Hashable:
    """Return everything of a model except its parameter values."""
    return model.partition


def with_slopes(model: Model) -> Hashable:
    """Return the partition, with the values of parameters in the slopes of interfaces."""
    return model.partition, _values(model, model.structure.sloping)


def with_time_parameters(model: Model) -> Hashable:
    """Return the equations, with the values of parameters in time-dependent expressions."""
    return model.structure, _values(model, model.structure.timed)


def _values(model: Model, names: tuple[str, ...]) -> tuple[float | None, ...]:
    return tuple(model.parameters.get(name) for name in names)


def cached_by(
    content: Callable[[Model], Hashable],
) -> Callable[[Callable[Concatenate[Model, P], R]], Callable[Concatenate[Model, P], R]]:
    """Cache a function of a model by the content that its result depends on.

    Parameters
    ----------
    content : callable
        Everything of a model that the result depends on: `partition_of`, `with_slopes` or
        `with_time_parameters`.

    Examples
    --------
    >>> import sympy as sp
    >>> x, k = sp.symbols("x k")
    >>> model = Model({x: -k * x}, parameters={k: 1})
    >>> rate = cached_by(partition_of)(lambda model: model.rates["x"])
    >>> rate(model) is rate(model.with_parameters(k=2))
    True
    """

    def decorate(
        function: Callable[Concatenate[Model, P], R],
    ) -> Callable[Concatenate[Model, P], R]:
        @lru_cache(maxsize=KEPT)
        def kept(given: Keyed[Model], args: tuple[Any, ...], named: tuple[Any, ...]) -> R:
            return function(given.value, *args, **dict(named))

        @wraps(function)
        def remembered(model: Model, /, *args: P.args, **kwargs: P.kwargs) -> R:
            return kept(Keyed(content(model), model), args, tuple(kwargs.items()))

        return remembered

    return decorate
