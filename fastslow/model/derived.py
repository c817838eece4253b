"""Caching of functions of a model by its partition into regions."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache, wraps
from typing import Any, Concatenate, ParamSpec, TypeVar

from fastslow.model.keyed import Keyed
from fastslow.model.model import Model
from fastslow.model.motions import PARTITIONS_KEPT

P = ParamSpec("P")
R = TypeVar("R")


def cached_by_partition(
    function: Callable[Concatenate[Model, P], R],
) -> Callable[Concatenate[Model, P], R]:
    """Cache a function of a model whose result does not depend on the parameter values.

    Models with the same partition into regions and the same names of parameters, some of which
    the equations may not contain, share the result.

    Examples
    --------
    >>> import sympy as sp
    >>> x, k = sp.symbols("x k")
    >>> model = Model({x: -k * x}, parameters={k: 1})
    >>> rate = cached_by_partition(lambda model: model.rates["x"])
    >>> rate(model) is rate(model.with_parameters(k=2))
    True
    """

    @lru_cache(maxsize=PARTITIONS_KEPT)
    def kept(given: Keyed[Model], args: tuple[Any, ...], named: tuple[Any, ...]) -> R:
        return function(given.value, *args, **dict(named))

    @wraps(function)
    def remembered(model: Model, /, *args: P.args, **kwargs: P.kwargs) -> R:
        key = model.partition, frozenset(model.parameters)
        return kept(Keyed(key, model), args, tuple(kwargs.items()))

    return remembered
