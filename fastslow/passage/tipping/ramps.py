"""Ramps that do not settle, with the sheets of the fast state beside a folded saddle."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from fastslow.errors import ArgumentError, refuse_events, refuse_resets, refuse_switches
from fastslow.model.model import Model
from fastslow.model.rational import exact
from fastslow.model.structure import TIME, real
from fastslow.passage.tipping.shifts import require_rate

Array = NDArray[np.float64]

#: Newton steps to a folded singularity and to a sheet, and the change relative to the place at
#: which they end.
FOLDED_STEPS, FOLDED_CHANGE = 50, 1e-13


@dataclass(frozen=True, eq=False)
class Ramp:
    """A slow quantity w that changes at a constant speed, one fast state x and one slow state y.

    x' = f(x, y, w), y' = g(x, y, w), w = w₀ + c t from t = 0 on.

    Parameters
    ----------
    model : Model
    region : str
        In which the sheets f = 0 meet at a fold.
    """

    model: Model
    region: str

    @cached_property
    def names(self) -> tuple[str, str, str]:
        """The fast state, the slow state and the slow quantity."""
        return (*self.model.states, *self.model.slow_states, *self.model.forcing)  # type: ignore[return-value]

    @cached_property
    def rates(self) -> tuple[sp.Expr, sp.Expr]:
        """Rates f and g."""
        rates, (fast, slow, _) = self.model.regions[self.region].rates, self.names
        return sp.sympify(exact(rates[fast])), sp.sympify(exact(rates[slow]))

    @property
    def fold(self) -> sp.Expr:
        """f_x, which vanishes on the fold."""
        return self.rates[0].diff(real(self.names[0]))

    @cached_property
    def law(self) -> tuple[sp.Expr, sp.Expr]:
        """w₀ and c."""
        (written,) = self.model.forcing.values()
        law = sp.sympify(exact(written))
        return law.subs(TIME, 0), law.diff(TIME)

    @cached_property
    def desingularised(self) -> tuple[sp.Expr, sp.Expr, sp.Expr]:
        """Slow flow in another time: x' = f_y g + f_w c, y' = −f_x g, w' = −f_x c."""
        (f, g), (_, speed) = self.rates, self.law
        x, y, w = map(real, self.names)
        return f.diff(y) * g + f.diff(w) * speed, -f.diff(x) * g, -f.diff(x) * speed

    @cached_property
    def _function(self) -> Callable[..., list[Any]]:
        (f, g), (begin, speed) = self.rates, self.law
        symbols = tuple(map(real, self.names))
        pushed, fold = self.desingularised[0], self.fold
        rows = [f, *(f.diff(s) for s in symbols), *(fold.diff(s) for s in symbols)]
        rows += [pushed, *(pushed.diff(s) for s in symbols), g, begin, speed]
        return self._made(rows)

    def _made(self, rows: list[sp.Expr]) -> Callable[..., list[Any]]:
        names = tuple(real(n) for n in (*self.names, *self.model.parameters))
        made: Callable[..., list[Any]] = sp.lambdify(names, rows, "numpy")
        return made

    def at(self, place: Array, values: dict[str, float]) -> SheetPlace:
        """What is known of a place (x, y, w) at values of all parameters."""
        with np.errstate(all="ignore"):
            found = [float(one) for one in self._function(*place, *values.values())]
        f, fx, fy, fw, fxx, fxy, fxw, pushed, px, py, pw, g, begin, speed = found
        return SheetPlace(
            f, np.array([fx, fy, fw]), np.array([fxx, fxy, fxw]), pushed, np.array([px, py, pw]),
            g, begin, speed,
        )  # fmt: skip

    def by_parameter(self, name: str) -> Callable[..., list[Any]]:
        """Derivatives of f, f_x, f_y g + f_w c, w₀ and c with respect to a parameter."""
        if name not in self._by_parameter:
            (f, _), (begin, speed) = self.rates, self.law
            rows = (f, self.fold, self.desingularised[0], begin, speed)
            self._by_parameter[name] = self._made([e.diff(real(name)) for e in rows])
        return self._by_parameter[name]

    @cached_property
    def _by_parameter(self) -> dict[str, Callable[..., list[Any]]]:
        return {}

    def folded(self, near: Array, values: dict[str, float]) -> Array | None:
        """The zero of f, f_x and f_y g + f_w c near a place, None without convergence."""
        place = np.array(near, dtype=float)
        size = np.maximum(np.abs(place), 1e-300)
        for _ in range(FOLDED_STEPS):
            here = self.at(place, values)
            matrix = np.vstack([here.slopes, here.bends, here.turns])
            right = np.array([here.rate, here.slopes[0], here.pushed])
            if not (np.isfinite(matrix).all() and np.isfinite(right).all()):
                return None
            rows = np.abs(matrix).max(axis=1)
            if not rows.all():
                return None
            try:
                step = np.linalg.solve(matrix / rows[:, None], -right / rows)
            except np.linalg.LinAlgError:
                return None
            place = place + step
            size = np.maximum(size, np.abs(place))
            if float(np.abs(step / size).max()) <= FOLDED_CHANGE:
                return place
        return None

    def folded_slopes(self, place: Array, values: dict[str, float], name: str) -> Array:
        """Derivative of a folded singularity with respect to a parameter, shape (3,)."""
        here = self.at(place, values)
        matrix = np.vstack([here.slopes, here.bends, here.turns])
        moved = self.by_parameter(name)(*place, *values.values())[:3]
        return np.asarray(-np.linalg.solve(matrix, np.array(moved, dtype=float)))

    def repelling(self, place: Array, values: dict[str, float]) -> tuple[Array, float] | None:
        """The state on the repelling sheet over (y, w), and its distance from the fold.

        Parameters
        ----------
        place : ndarray, shape (3,)
            With the fast state of a fold nearby.
        values : dict

        Returns
        -------
        (ndarray, float) or None
            None beyond the fold, where there is no sheet.
        """
        turn = self._root(place, values, 1)
        if turn is None:
            return None
        here = self.at(np.array([turn, *place[1:]]), values)
        square = -2.0 * here.rate / here.bends[0] if here.bends[0] else math.nan
        if not square > 0.0:
            return None
        first = turn + math.copysign(math.sqrt(square), here.bends[0])
        x = self._root(np.array([first, *place[1:]]), values, 0)
        if x is None:
            return None
        found = np.array([x, *place[1:]])
        return (found, x - turn) if self.at(found, values).slopes[0] > 0.0 else None

    def _root(self, place: Array, values: dict[str, float], order: int) -> float | None:
        """Zero of f (order 0) or of f_x (1) in the fast state alone, near a place."""
        x = float(place[0])
        for _ in range(FOLDED_STEPS):
            here = self.at(np.array([x, *place[1:]]), values)
            value, slope = (
                (here.rate, here.slopes[0]) if order == 0 else (here.slopes[0], here.bends[0])
            )
            step = -value / slope if slope and math.isfinite(slope) else math.nan
            x += step
            if not math.isfinite(x):
                return None
            if abs(step) <= FOLDED_CHANGE * max(abs(x), 1e-300):
                return x
        return None


@dataclass(frozen=True, eq=False)
class SheetPlace:
    """Rates and their derivatives at one place.

    Parameters
    ----------
    rate : float
        f.
    slopes, bends, turns : ndarray, shape (3,)
        Derivatives of f, f_x and f_y g + f_w c with respect to x, y and w.
    pushed : float
        f_y g + f_w c.
    drift : float
        g.
    begin, speed : float
        w₀ and c.
    """

    rate: float
    slopes: Array
    bends: Array
    pushed: float
    turns: Array
    drift: float
    begin: float
    speed: float

    @property
    def matrix(self) -> Array:
        """Jacobian of the desingularised slow flow on the fold, shape (3, 3)."""
        return np.vstack([self.turns, -self.drift * self.bends, -self.speed * self.bends])

    @property
    def eigenvalues(self) -> tuple[float, float]:
        """The two that are not 0 identically, in ascending order; NaN if they are not real."""
        matrix = self.matrix
        total = float(np.trace(matrix))
        product = sum(
            matrix[i, i] * matrix[j, j] - matrix[i, j] * matrix[j, i]
            for i in range(3)
            for j in range(i)
        )
        square = 0.25 * total**2 - product
        if not square >= 0.0:
            return math.nan, math.nan
        larger = 0.5 * total + math.copysign(math.sqrt(square), total)
        other = product / larger if larger else 0.0
        return min(larger, other), max(larger, other)

    @property
    def is_saddle(self) -> bool:
        """Whether it is a folded saddle."""
        low, high = self.eigenvalues
        return low < 0.0 < high

    @property
    def late(self) -> float:
        """First-order correction of the slow manifold, x₁ = f_x⁻¹ dx/dt."""
        return float(-self.pushed / self.slopes[0] ** 2)


def ramp_of(model: Model, rate: str, region: str) -> Ramp:
    """Return the ramp of a model with one fast and one slow state.

    Raises
    ------
    ModelError
        For a model with switches, events or resets.
    ArgumentError
        For other numbers of states or slow quantities, a forcing that is not affine in time, and
        one whose value at t = 0 depends on the rate.
    """
    refuse_switches(model.switches, "a run of this ramp")
    refuse_events(model.events, "a run of this ramp")
    refuse_resets(list(model.resets), "a run of this ramp")
    shape = len(model.states), len(model.slow_states), len(model.forcing)
    if shape != (1, 1, 1):
        raise ArgumentError(
            f"the model has {shape[0]} fast and {shape[1]} slow states, and {shape[2]} forcings; "
            "expected a ramp as forcing= and one of each, Model(..., slow=), whose threshold is "
            "the canard of a folded saddle. For a shift that settles give all states without slow="
        )
    require_rate(model, rate)
    ramp = Ramp(model, region)
    begin, speed = ramp.law
    ((name, law),) = model.forcing.items()
    if TIME in speed.free_symbols or speed == 0:
        raise ArgumentError(
            f"the forcing {name} = {law} of a model with slow states is no ramp w0 + c t; for a "
            "shift that settles give all states without slow="
        )
    if real(rate) in begin.free_symbols:
        raise ArgumentError(f"the ramp {name} = {law} begins at a value that depends on {rate}")
    return ramp
