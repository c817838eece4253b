"""Numerical evaluation of the law of a drift, for NumPy and for compiled code."""

from __future__ import annotations

import re
import sys
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from fastslow.kernels.fields import compile_function
from fastslow.model.equations import read_expression
from fastslow.model.functions import numpy_function
from fastslow.model.structure import TIME, real

Array = NDArray[np.float64]

#: Nodes per interval of a table, initial and largest number of intervals.
INTERVAL_NODES, FIRST_INTERVALS, MOST_INTERVALS = 16, 4, 4096

#: Bound of the last two coefficients of an interval, relative to the largest of the table.
LAST_COEFFICIENTS = 1e-14

_ANGLES = np.pi * (np.arange(INTERVAL_NODES) + 0.5) / INTERVAL_NODES

#: Nodes in [-1, 1], and the matrix from values to Chebyshev coefficients.
_PLACES = np.cos(_ANGLES)
_TO_COEFFICIENTS = np.cos(np.arange(INTERVAL_NODES)[:, None] * _ANGLES) * 2.0 / INTERVAL_NODES
_TO_COEFFICIENTS[0] *= 0.5


#: Digits of numbers in the formula of a drift.
DRIFT_DIGITS = 17

#: The time in a formula, measured from a given time.
_SHIFTED = re.compile(r"\(t ([+-]) ([0-9.]+(?:e[+-]?[0-9]+)?)\)")
_TIME = re.compile(r"\bt\b")


def shifted(text: str, time: float) -> str:
    """Return a formula with the time measured from a given time.

    Examples
    --------
    >>> shifted("0.1*cos(t)", 2.5), shifted("sin(t)", -1e-20), shifted("x**2", 2.5)
    ('0.1*cos((t + 2.5))', 'sin((t - 1e-20))', 'x**2')
    """
    if abs(time) < sys.float_info.min:
        # a subnormal number is the rounding of 0
        return text
    return _TIME.sub(f"(t {'-' if time < 0.0 else '+'} {abs(time)!r})", text)


def _unshifted(text: str) -> tuple[str, float]:
    """Return a formula in which all times are measured from the same time, and that time.

    Examples
    --------
    >>> _unshifted("0.1*cos((t + 2.5))"), _unshifted("t*cos((t + 2.5))")
    (('0.1*cos(t)', 2.5), ('t*cos((t + 2.5))', 0.0))
    """
    found = set(_SHIFTED.findall(text))
    if len(found) != 1:
        return text, 0.0
    bare = _SHIFTED.sub("@", text)
    if _TIME.search(bare):
        return text, 0.0
    ((sign, number),) = found
    return bare.replace("@", "t"), float(sign + number)


@lru_cache(maxsize=256)
def _read(text: str, names: tuple[str, ...]) -> tuple[sp.Expr, Callable[..., Any]]:
    """Return a formula, and its evaluation at (states, w, t) by NumPy."""
    expression = read_expression("law of the drift", text, [*names, "t"])
    function: Callable[..., Any] = numpy_function([*map(real, names), TIME], expression)
    return expression, function


@dataclass(frozen=True, eq=False)
class DriftLaw:
    """w' as a function of the fast states, the slow quantity and time.

    Parameters
    ----------
    text : str
    names : tuple of str
        Names of the states and of the slow quantity.
    """

    text: str
    names: tuple[str, ...]

    @cached_property
    def _parts(self) -> tuple[sp.Expr, Callable[..., Any], float]:
        """The formula in a time of its own, its evaluation, and that time at t = 0.

        Passages of a run differ in this time only: the formula is read once for all of them.
        """
        text, since = _unshifted(self.text)
        return *_read(text, self.names), since

    @cached_property
    def in_time(self) -> bool:
        """Whether it depends on time only."""
        return bool(self._parts[0].free_symbols <= {TIME})

    def at(self, u: Array, time: float) -> float:
        """Value at one point u (n + 1,) and a time."""
        _, function, since = self._parts
        return float(function(*u, time + since))

    def along(self, points: Array, times: Array) -> Array:
        """Values at points (N, n + 1) and times (N,)."""
        _, function, since = self._parts
        values = np.asarray(function(*points.T, times + since), dtype=float)
        return np.broadcast_to(values, len(times)).copy()

    def table(self, start: float, stop: float) -> tuple[Array, Array]:
        """Piecewise Chebyshev approximation of a law that depends on time only.

        Parameters
        ----------
        start, stop : float

        Returns
        -------
        breaks : ndarray, shape (K + 1,)
        coefficients : ndarray, shape (K, NODES)

        Examples
        --------
        >>> breaks, sums = DriftLaw("cos(t)", ("x", "w")).table(0.0, 10.0)
        >>> s = 2.0 * (9.0 - breaks[-2]) / (breaks[-1] - breaks[-2]) - 1.0
        >>> bool(abs(np.polynomial.chebyshev.chebval(s, sums[-1]) - np.cos(9.0)) < 1e-14)
        True
        """
        none, (_, function, since) = np.zeros(len(self.names)), self._parts
        edges = np.linspace(start, stop, FIRST_INTERVALS + 1)
        low, high = edges[:-1], edges[1:]
        done: list[tuple[Array, Array]] = []
        largest, count = 0.0, 0
        while len(low):
            half = 0.5 * (high - low)
            times = (0.5 * (low + high))[:, None] + half[:, None] * _PLACES
            values = function(*none, times.ravel() + since)
            table = np.broadcast_to(np.asarray(values, dtype=float), times.size)
            found = table.reshape(times.shape) @ _TO_COEFFICIENTS.T
            largest = max(largest, float(np.abs(found).max()))
            fine = np.abs(found[:, -2:]).max(axis=1) <= LAST_COEFFICIENTS * largest
            fine |= half <= 1e-13 * (stop - start)
            count += len(low)
            if count > MOST_INTERVALS:
                fine[:] = True
            done.append((low[fine], found[fine]))
            middle = (0.5 * (low + high))[~fine]
            low, high = np.append(low[~fine], middle), np.append(middle, high[~fine])
        starts = np.concatenate([part[0] for part in done])
        order = np.argsort(starts)
        sums = np.concatenate([part[1] for part in done])[order]
        return np.append(starts[order], stop), np.ascontiguousarray(sums)

    @cached_property
    def compiled(self) -> tuple[int, Array]:
        """Address of the compiled function of (states, w, t) with slopes, and its parameters."""
        expression, _, since = self._parts
        later = {TIME: TIME + sp.Float(since, DRIFT_DIGITS)} if since else {}
        return compile_function(expression.xreplace(later), [*map(real, self.names), TIME])


@lru_cache(maxsize=256)
def drift_law(text: str, names: tuple[str, ...]) -> DriftLaw:
    """Law with a given formula; its functions are cached."""
    return DriftLaw(text, names)
