"""A budget of symbolic work, counted in nodes and terms, so that results are the same everywhere.

Algorithms on expressions spend what they handle; inside a `Budget` they end with `PastWorkError`
once the limit is passed. A cached function spends on every call what its first one did.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Hashable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from functools import lru_cache, wraps
from itertools import islice
from typing import TypeVar

import sympy as sp

Given = TypeVar("Given", bound=Hashable)
Result = TypeVar("Result")


#: Nodes up to which replacing symbols is no work beside what follows, and nodes that are usually
#: counted at most.
SHORT, TRAVERSED = 2000, 20_000


class PastWorkError(Exception):
    """A computation exceeds its budget of work."""

    #: Work of a cached function that is not counted yet.
    spent = 0


class Budget:
    """An amount of work, spent inside one or several blocks.

    Parameters
    ----------
    limit : float
        In nodes of expressions.

    Examples
    --------
    >>> budget = Budget(10)
    >>> with budget.spending():
    ...     spend(8)
    >>> with budget.spending():
    ...     spend(3)
    Traceback (most recent call last):
        ...
    fastslow.model.work.PastWorkError
    """

    def __init__(self, limit: float) -> None:
        self.limit = limit
        self.spent = 0

    @property
    def exhausted(self) -> bool:
        """Whether more than the limit is spent."""
        return self.spent > self.limit

    @contextmanager
    def spending(self) -> Iterator[None]:
        """Count the work inside the block; budgets nest, and each counts on its own.

        Raises
        ------
        PastWorkError
            Inside, once it is exhausted, or at once if it was before.
        """
        if self.exhausted:
            raise PastWorkError
        token = _budgets.set((*_budgets.get(), self))
        try:
            yield
        finally:
            _budgets.reset(token)


_budgets: ContextVar[tuple[Budget, ...]] = ContextVar("budgets", default=())


def spend(amount: int) -> None:
    """Count work, in nodes of expressions.

    Raises
    ------
    PastWorkError
        Once one of the budgets around the call is exhausted.
    """
    budgets = _budgets.get()
    for budget in budgets:
        budget.spent += amount
    if any(budget.exhausted for budget in budgets):
        raise PastWorkError


def nodes(expression: sp.Basic, most: int | None = None) -> int:
    """Return the number of nodes of an expression, which are counted up to ``most``.

    Examples
    --------
    >>> nodes(sp.Symbol("x") + 1), nodes(sp.Symbol("x") + 1, most=2)
    (3, 2)
    """
    return sum(1 for _ in islice(sp.preorder_traversal(expression), most))


def spend_traversal(expression: sp.Basic, most: int = TRAVERSED) -> None:
    """Count the work of replacing symbols in a long expression, up to a bound."""
    if (count := nodes(expression, most)) > SHORT:
        spend(count)


def cached(size: int) -> Callable[[Callable[[Given], Result]], Callable[[Given], Result]]:
    """Cache the latest results of a function of one argument with the work that they took."""

    def decorate(function: Callable[[Given], Result]) -> Callable[[Given], Result]:
        @lru_cache(maxsize=size)
        def kept(argument: Given) -> tuple[Result, int]:
            left = min((budget.limit - budget.spent for budget in _budgets.get()), default=math.inf)
            own = Budget(left)
            token = _budgets.set((own,))
            try:
                return function(argument), own.spent
            except PastWorkError as error:
                error.spent = own.spent
                raise
            finally:
                _budgets.reset(token)

        @wraps(function)
        def call(argument: Given) -> Result:
            try:
                result, spent = kept(argument)
            except PastWorkError as error:
                spend(error.spent)
                raise
            spend(spent)
            return result

        return call

    return decorate
