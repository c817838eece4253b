"""The two sheets of a critical manifold of one fast state beside a fold."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import sympy as sp

from fastslow.errors import ArgumentError
from fastslow.model.model import Model
from fastslow.model.rational import exact
from fastslow.model.structure import real

#: Contraction ∫|Re λ| dt between a start and the section: what is left of a deviation is
#: exp(−45) = 3e-20, below rounding.
MANIFOLD_CONTRACTION = 45.0

#: Fraction of the largest |f_x| on a sheet to which |f_x| may fall before a start: beyond, towards
#: another fold, the start would be on the other side of it.
TOWARDS_FOLD = 0.5

#: Points along a sheet: in the distance at which the contraction is reached if f is quadratic, and
#: at most.
SHEET_POINTS, MOST_SHEET_POINTS = 400, 20_000

#: Newton steps at one point.
SHEET_NEWTON = 12


class SheetPoint(NamedTuple):
    """A point of a sheet, with ∫|f_x| dt and the slow time between it and the fold."""

    x: float
    y: float
    contraction: float
    duration: float


@dataclass(frozen=True, eq=False)
class Sheets:
    """The critical manifold f = 0 of a region of a planar model, over one parameter.

    Parameters
    ----------
    model : Model
        With one fast and one slow state.
    region : str
    parameter : str
    """

    model: Model
    region: str
    parameter: str

    @cached_property
    def symbols(self) -> tuple[sp.Symbol, sp.Symbol, sp.Symbol]:
        """The fast state, the slow state and the parameter."""
        (x,), (y,) = self.model.states, self.model.slow_states
        return real(x), real(y), real(self.parameter)

    @cached_property
    def _function(self) -> Callable[..., list[float]]:
        """f, f_x, f_y, g, f_xx, f_xy, and the signed functions of the interfaces."""
        x, y, varied = self.symbols
        region = self.model.regions[self.region]
        known = {s: sp.Float(v, 17) for s, v in self.model.values.items() if s != varied}
        f, g = (region.rates[s.name].xreplace(known) for s in (x, y))
        walls = [
            (region.signs[name] * exact(one.function)).xreplace(known)
            for name, one in self.model.interfaces.items()
        ]
        given = [f, f.diff(x), f.diff(y), g, f.diff(x, 2), f.diff(x, y), *walls]
        made: Callable[..., list[float]] = sp.lambdify((x, y, varied), given, "math")
        return made

    def at(self, x: float, y: float, value: float) -> list[float]:
        """Evaluate f, f_x, f_y, g, f_xx, f_xy and the interfaces; NaN where they are not real."""
        try:
            return [float(entry) for entry in self._function(x, y, value)]
        except (ValueError, OverflowError, ZeroDivisionError, TypeError):
            return [math.nan] * (6 + len(self.model.interfaces))

    def fold(self, x: float, y: float, value: float) -> tuple[float, float]:
        """Return the fold f = f_x = 0 near a point, by Newton's method."""
        for _ in range(SHEET_NEWTON):
            f, fx, fy, _, fxx, fxy, *_ = self.at(x, y, value)
            determinant = fx * fxy - fy * fxx
            if not determinant:
                break
            dx, dy = (fxy * f - fy * fx) / determinant, (fx * fx - fxx * f) / determinant
            x, y = x - dx, y - dy
            if abs(dx) <= 1e-15 * abs(x) and abs(dy) <= 1e-15 * abs(y):
                break
        return x, y

    def height(self, x: float, y: float, value: float) -> float:
        """Return y on the manifold at a given x."""
        for _ in range(SHEET_NEWTON):
            f, _, fy, *_ = self.at(x, y, value)
            step = f / fy if fy else math.nan
            y -= step
            if not abs(step) > 1e-16 * abs(y):
                break
        return y

    def start(self, fold: tuple[float, float], side: int, value: float) -> SheetPoint:
        """Return the point of a sheet from which deviations decay by exp(−45) up to the fold.

        Nearer if the sheet ends before: towards another fold or at an interface.

        Parameters
        ----------
        fold : (float, float)
        side : int
            Sign of x minus that of the fold.
        value : float
            Value of the parameter, at which the slow rate vanishes on the fold.
        """
        x, y = fold
        step = side * self._distance(fold, value) / SHEET_POINTS
        contraction = duration = largest = 0.0
        before = math.nan, math.nan
        last = SheetPoint(x, y, 0.0, 0.0)
        for _ in range(MOST_SHEET_POINTS):
            moved = x + step
            y = self.height(moved, y, value)
            _, fx, fy, g, _, _, *walls = self.at(moved, y, value)
            speed = abs(fy * g)
            # K' = f_x²/|f_y g| and t' = |f_x|/|f_y g| over x
            now = (fx * fx / speed, abs(fx) / speed) if speed else (math.nan, math.nan)
            over = not math.isfinite(y) or not speed or any(not h >= 0.0 for h in walls)
            largest = max(largest, abs(fx))
            if over or abs(fx) < TOWARDS_FOLD * largest:
                break
            rates = [
                (0.5 if math.isfinite(b) else 1.0) * (n + (b if math.isfinite(b) else 0.0))
                for n, b in zip(now, before, strict=True)
            ]
            contraction += abs(step) * rates[0]
            duration += abs(step) * rates[1]
            x, before = moved, now
            last = SheetPoint(x, y, contraction, duration)
            if contraction >= MANIFOLD_CONTRACTION:
                break
        return last

    def _distance(self, fold: tuple[float, float], value: float) -> float:
        """Distance in x from the fold at which the contraction is reached, if f is quadratic."""
        x, y = fold
        small = 1e-6 * max(abs(x), 1e-3)
        _, _, fy, _, fxx, *_ = self.at(x, y, value)
        ahead, back = (self.at(x + side * small, y, value)[3] for side in (1, -1))
        slope = abs(ahead - back) / (2.0 * small)
        if not (fxx and slope and math.isfinite(slope)):
            raise ArgumentError(
                f"the point at {self.symbols[0].name} = {x:.6g} is degenerate: the fold is not "
                "quadratic, or the slow rate does not change sign on it"
            )
        return math.sqrt(2.0 * MANIFOLD_CONTRACTION * abs(fy) * slope) / abs(fxx)

    def corrected(self, place: SheetPoint, value: float) -> tuple[float, float]:
        """Return a point of the slow manifold to first order, x + f_x⁻¹ dx/dt, at the same y."""
        _, fx, fy, g, *_ = self.at(place.x, place.y, value)
        return place.x - fy * g / (fx * fx), place.y


def planar(model: Model, task: str) -> None:
    """Raise ArgumentError unless a model has one fast and one slow state."""
    if not model.slow_states:
        raise ArgumentError(f"{task}: this model has no slow state; expected Model(..., slow=)")
    shape = len(model.states), len(model.slow_states)
    if shape != (1, 1) or model.forcing or model.period() is not None:
        more = " and a forcing" if model.forcing or model.period() is not None else ""
        raise ArgumentError(
            f"{task}: this model has {shape[0]} fast and {shape[1]} slow states{more}; expected "
            "one of each. With several fast states the repelling slow manifold attracts in other "
            "directions, so that it is not reached backwards in time"
        )
