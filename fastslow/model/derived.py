"""What is derived from a model, kept for all models with the same content."""

from __future__ import annotations

from collections.abc import Callable, Hashable
from functools import lru_cache, wraps
from typing import Any, Concatenate, ParamSpec, TypeVar

from fastslow.model.keyed import Keyed
from fastslow.model.model import Model

P = ParamSpec("P")
R = TypeVar("R")

#: Contents for which a function's result is kept.
KEPT = 256


def partition_of(model: Model) -> Hashable:
    """All of a model but the values of its parameters."""
    return model.partition


def sloped(model: Model) -> Hashable:
    """The same, with the values of those parameters that turn an interface."""
    return model.partition, _values(model, model.structure.sloping)


def timed(model: Model) -> Hashable:
    """The equations, with the values of those parameters that stand beside time."""
    return model.structure, _values(model, model.structure.timed)


def _values(model: Model, names: tuple[str, ...]) -> tuple[float | None, ...]:
    return tuple(model.parameters.get(name) for name in names)


def once(
    content: Callable[[Model], Hashable],
) -> Callable[[Callable[Concatenate[Model, P], R]], Callable[Concatenate[Model, P], R]]:
    """Keep a function's results by what they depend on of a model, and by other arguments.

    Parameters
    ----------
    content : callable
        `partition_of`, `sloped` or `timed`: what the result depends on, and nothing else.

    Examples
    --------
    >>> import sympy as sp
    >>> x, k = sp.symbols("x k")
    >>> model = Model({x: -k * x}, parameters={k: 1})
    >>> rate = once(partition_of)(lambda model: model.rates["x"])
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
