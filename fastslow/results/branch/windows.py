"""State windows: the ranges of the states within which branches are traced."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fastslow.arguments import real_number, shown
from fastslow.errors import ArgumentError, unknown_name
from fastslow.results.angles import nearest_copy
from fastslow.results.base.display import Displayed
from fastslow.results.base.outcome import Outcome

Array = NDArray[np.float64]

#: Outcome code of a branch that ends at a bound of the window.
LEFT = "left the window"

#: Distance of a default bound from the known equilibria, in units of their size.
DEFAULT_MARGIN = 1e4

#: Largest range of equilibria in units of their median distance from the median; for
#: uniformly distributed numbers the range is four times that distance.
TYPICAL = 8.0

#: Distances below this fraction of the size of a state are rounding errors.
DISTANCE_ROUNDING = 1e-9

#: Distance from a bound, in units of the state, below which a state is on it.
ON_EDGE = 1e-9


@dataclass(frozen=True)
class StateWindow(Displayed):
    """The ranges of the states within which branches are traced.

    ``window["x"]`` is the range of one state, (low, high); an infinite end means no bound.

    Parameters
    ----------
    states : tuple of str
        State names.
    lower, upper : tuple of float
        Bounds, state by state, in the states' units.
    given : tuple of (bool, bool)
        Whether the lower and the upper bound of each state were given; the others
        are defaults.
    core : tuple of (float, float) or None
        For each state the range of the equilibria from which branches were traced,
        without outliers near a pole.
    periods : tuple of float
        The period of each state, 0 without one; empty without any.

    Examples
    --------
    >>> window = state_window(("x", "y"), {"x": (0, None)})
    >>> window["x"], window.chosen
    ((0.0, inf), True)
    >>> window.around(np.array([[0.0, 1.0], [2.0, 3.0]]))
    StateWindow(x in [0, 20002], y in [-29999, 30003])
    """

    states: tuple[str, ...]
    lower: tuple[float, ...]
    upper: tuple[float, ...]
    given: tuple[tuple[bool, bool], ...]
    core: tuple[tuple[float, float] | None, ...]
    periods: tuple[float, ...] = ()

    def __getitem__(self, state: object) -> tuple[float, float]:
        name = str(state)
        if name not in self.states:
            raise unknown_name("state", name, self.states)
        k = self.states.index(name)
        return self.lower[k], self.upper[k]

    @property
    def chosen(self) -> bool:
        """True if any bound was given."""
        return any(low or high for low, high in self.given)

    @property
    def moduli(self) -> dict[str, float]:
        """Largest modulus in the window of every bounded state."""
        ends = {n: max(abs(low), abs(high)) for n in self.states for low, high in [self[n]]}
        return {n: (1.0 + ON_EDGE) * end for n, end in ends.items() if 0 < end < np.inf}

    def contains(self, state: Array, unit: Array | float = 0.0) -> NDArray[np.bool_]:
        """Return True for states, shape (…, n), in the closed window.

        ``unit`` is the scale of each state for rounding errors at a bound.
        """
        slack = ON_EDGE * np.maximum(np.abs(state), unit)
        inside = (state >= np.array(self.lower) - slack) & (state <= np.array(self.upper) + slack)
        return np.asarray(inside.all(axis=-1))

    def intersects(self, lower: Array, upper: Array) -> bool:
        """Return True if a box of states, or a copy by whole periods, intersects the window."""
        low, high = np.array(self.lower), np.array(self.upper)
        periodic = (self._periods > 0) & np.isfinite(low) & np.isfinite(upper)
        period = np.where(periodic, self._periods, 1.0)
        # the first copy that is not below the window
        first = np.where(periodic, low, 0.0) / period - np.where(periodic, upper, 0.0) / period
        move = np.where(periodic, period * np.ceil(first - ON_EDGE), 0.0)
        return bool(np.all((upper + move >= low) & (lower + move <= high)))

    def around(self, points: Array, known: NDArray[np.bool_] | None = None) -> StateWindow:
        """Return the window with default bounds in place of those that were not given.

        The distance of a default bound from the equilibria is `DEFAULT_MARGIN` times their size,
        the larger of their range and their largest modulus, so that the window does not
        depend on units. Periodic states have no default bounds.

        Parameters
        ----------
        points : ndarray, shape (m, n)
            Known equilibria.
        known : ndarray of bool, shape (m, n), optional
            False for values that are zero up to rounding.
        """
        kept = np.isfinite(points) & (True if known is None else known)
        lower, upper = list(self.lower), list(self.upper)
        core: list[tuple[float, float] | None] = []
        for k in range(len(self.states)):
            column = points[kept[:, k], k]
            if not column.size or (self.periods and self.periods[k]):
                core.append(None)
                continue
            low, high = float(column.min()), float(column.max())
            middle = float(np.median(column))
            wide = float(typical(column[:, None], DISTANCE_ROUNDING * max(abs(low), abs(high)))[0])
            core.append((max(low, middle - wide), min(high, middle + wide)))
            size = max(high - low, abs(low), abs(high))
            if size > 0 and not self.given[k][0]:
                lower[k] = low - DEFAULT_MARGIN * size
            if size > 0 and not self.given[k][1]:
                upper[k] = high + DEFAULT_MARGIN * size
        return replace(self, lower=tuple(lower), upper=tuple(upper), core=tuple(core))

    def near(self, states: Array) -> NDArray[np.bool_]:
        """Return True for states whose distance from the core is at most its width, shape (N,).

        The axes of figures are scaled to these if a branch goes to infinity.
        """
        found = np.ones(len(states), dtype=bool)
        for k, core in enumerate(self.core):
            if core is not None:
                wide = core[1] - core[0] or abs(core[0])
                found &= (states[:, k] >= core[0] - wide) & (states[:, k] <= core[1] + wide)
        return found

    def middle(self) -> Array:
        """Return the middle of the core, 0 without one, NaN for periodic states, shape (n,)."""
        middle = [0.0 if c is None else 0.5 * (c[0] + c[1]) for c in self.core]
        return np.where(self._periods > 0, np.nan, middle)

    @property
    def _periods(self) -> Array:
        return np.array(self.periods or (0.0,) * len(self.states))

    def shifted(self, states: Array) -> Array:
        """Return states, shape (…, n), shifted by whole periods into the window."""
        if not self.periods:
            return np.array(states, dtype=float)
        low, high = np.array(self.lower), np.array(self.upper)
        bounded = (self._periods > 0) & np.isfinite(low)
        middle = np.where(bounded, low, 0.0) / 2.0 + np.where(bounded, high, 0.0) / 2.0
        return np.where(bounded, nearest_copy(states, middle, self._periods), states)

    def __str__(self) -> str:
        return ", ".join(
            f"{name} in [{low:g}, {high:g}]"
            for name, low, high in zip(self.states, self.lower, self.upper, strict=True)
            if math.isfinite(low) or math.isfinite(high)
        )

    def __repr__(self) -> str:
        return f"StateWindow({self})"


def typical(points: Array, least: Array | float) -> Array:
    """Return the typical range of each state, without outliers.

    It is `TYPICAL` times the median distance from the median, of distances above
    ``least``; infinite without any. Shapes (m, n) and (n,).

    Examples
    --------
    >>> typical(np.array([[-1.0], [0.0], [1.0], [2.0], [1e6]]), 1e-9).tolist()
    [12.0]
    """
    if not len(points):
        return np.full(points.shape[1], np.inf)
    away = np.abs(points - np.median(points, axis=0))
    found = [
        a[a > bound] for a, bound in zip(away.T, np.broadcast_to(least, away.shape[1]), strict=True)
    ]
    return np.array([TYPICAL * float(np.median(a)) if a.size else np.inf for a in found])


def state_window(
    states: tuple[str, ...],
    given: Mapping[Any, Any] | None = None,
    periodic: Mapping[str, float] | None = None,
) -> StateWindow:
    """Return the window given by the user, without default bounds.

    Parameters
    ----------
    states : tuple of str
    given : mapping, optional
        The range (low, high) of states (symbols or names); None in place of an end
        selects the default bound, an infinite end means no bound.
    periodic : mapping, optional
        The period of periodic states.

    Raises
    ------
    UnknownNameError
        For a name that is not a state.
    ArgumentError
        For an invalid range.

    Examples
    --------
    >>> state_window(("x", "y"), {"x": (-5, 5)})
    StateWindow(x in [-5, 5])
    >>> state_window(("x",), {"x": (5, -5)})
    Traceback (most recent call last):
    ...
    fastslow.errors.ArgumentError: window of x = (5, -5); expected two numbers, the lower one \
first, or None for an end without bound; did you mean (-5, 5)?
    """
    lower, upper = [-math.inf] * len(states), [math.inf] * len(states)
    bounded = [(False, False)] * len(states)
    for key, ends in (given or {}).items():
        name = str(key)
        if name not in states:
            raise unknown_name("state of the window", name, states)
        k = states.index(name)
        lower[k], upper[k] = _range(name, ends)
        bounded[k] = (ends[0] is not None, ends[1] is not None)
        period = (periodic or {}).get(name)
        if period is not None and not upper[k] - lower[k] <= period * (1 + ON_EDGE):
            raise ArgumentError(
                f"window of {name} = {shown(ends)}; expected a range no longer than the period "
                f"{period:g} of {name}"
            )
    none = (None,) * len(states)
    periods = tuple(float((periodic or {}).get(name, 0.0)) for name in states)
    return StateWindow(
        states, tuple(lower), tuple(upper), tuple(bounded), none, periods if any(periods) else ()
    )


def _range(name: str, ends: Any) -> tuple[float, float]:
    expected = "two numbers, the lower one first, or None for an end without bound"
    if not isinstance(ends, tuple | list | np.ndarray) or len(ends) != 2:
        raise ArgumentError(f"window of {name} = {shown(ends)}; expected {expected}")
    low = -math.inf if ends[0] is None else real_number(ends[0])
    high = math.inf if ends[1] is None else real_number(ends[1])
    if low is None or high is None or math.isnan(low) or math.isnan(high):
        raise ArgumentError(f"window of {name} = {shown(ends)}; expected {expected}")
    if low >= high:
        hint = f"; did you mean ({high:g}, {low:g})?" if low > high else ""
        raise ArgumentError(f"window of {name} = {shown(ends)}; expected {expected}{hint}")
    return low, high


def left_window(window: StateWindow, state: Array, unit: Array, where: str) -> Outcome:
    """Return the outcome of a curve that ends at a bound of a window.

    Parameters
    ----------
    window : StateWindow
    state, unit : ndarray, shape (n,)
        The last state, and the unit of each component.
    where : str
        The parameter values there, as text.
    """
    bounds = np.array([window.lower, window.upper]).T
    off = np.abs(state[:, None] - bounds) / unit[:, None]
    k, side = np.unravel_index(np.argmin(np.where(np.isfinite(off), off, np.inf)), off.shape)
    name, bound = window.states[k], bounds[k, side]
    if window.given[k][side]:
        return Outcome(
            "left the window",
            f"reached {name} = {bound:g}, a bound of the window, at {where}.",
            True,
        )
    return Outcome(
        "left the window",
        f"{name} reached {bound:.6g} at {where}, {DEFAULT_MARGIN:g} times the size of the "
        "equilibria from which branches are traced, and may go to infinity; "
        f"window={{'{name}': (low, high)}} sets other bounds.",
        False,
    )
