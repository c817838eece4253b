"""Slow manifolds of one fast and two slow variables, on a section through a folded singularity."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from fastslow.model.model import Model
from fastslow.model.rational import exact
from fastslow.model.structure import real
from fastslow.simulation.many import simulate_many
from fastslow.simulation.one import simulate
from fastslow.simulation.settings import Integration
from fastslow.symbolic.folded_points import FoldedPoint

Array = NDArray[np.float64]

#: ∫|Re λ| dt along the strong canard between its start and the section: exp(−36) = 2e-16.
FOLDED_CONTRACTION = 36.0

#: Factor by which starts move towards the fold until both sheets are there, and how often.
SHIFT_TO_FOLD, MOST_SHIFTS = 0.8, 30

#: Newton steps to the fold and to the sheet.
START_NEWTON = 40

#: Size of the last Newton step, in units of the place, up to which a start is on its sheet.
FUNNEL_START_ROUNDING = 1e-9

#: Most steps of a run to the section.
MOST_FUNNEL_STEPS = 300

#: Samples of a canard on each side of the section.
PATH_SAMPLES = 400

#: Names of the fast state, the distances along and across the fold, and the length of a run.
FAST, ALONG, ACROSS, LENGTH = sp.symbols("fast_0 along_0 across_0 length_0", real=True)


@dataclass(frozen=True, eq=False)
class FoldedSection:
    """The flow near a folded singularity, over the distance σ along the fold.

    At the singularity the slow rates g are tangent to the fold curve, so that σ = g·(y − y₀)/|g|
    increases in time near it, and σ = 0 is a section transverse to the fold. Where g turns far from
    the singularity, σ may be one of the slow variables instead.

    Parameters
    ----------
    model : Model
        With one fast state and two slow variables.
    point : FoldedPoint
    nearer : float
        Factor of the distance of the starts.
    direction : int
        0 for σ along g, k for the slow variable with number k − 1.
    """

    model: Model
    point: FoldedPoint
    nearer: float = 1.0
    direction: int = 0

    @cached_property
    def slow(self) -> tuple[str, ...]:
        """The slow variables; ``"t"`` is the phase of a forcing."""
        return tuple(name for name in self.point.state if name not in self.model.states)

    @cached_property
    def centre(self) -> Array:
        """The singularity: fast state, slow variables."""
        return np.array([self.point.values[n] for n in (*self.model.states, *self.slow)])

    @cached_property
    def _rates(self) -> tuple[sp.Expr, list[sp.Expr]]:
        """Rates of the fast and slow variables in numbers, f and g."""
        region = self.model.regions[self.point.form.region]
        laws = {real(n): exact(law) for n, law in region.forcing.items()}
        known = {s: sp.Float(v, 17) for s, v in self.model.values.items()}

        def number(name: str) -> sp.Expr:
            rate = exact(region.rates[name]) if name in region.rates else sp.S.One
            return sp.sympify(rate).xreplace(laws).xreplace(known)

        (fast,) = self.model.states
        return number(fast), [number(name) for name in self.slow]

    @cached_property
    def speed(self) -> Array:
        """Slow rates g at the singularity."""
        names = (*self.model.states, *self.slow)
        at = dict(zip(map(real, names), self.centre.tolist(), strict=True))
        return np.array([float(sp.N(g.subs(at))) for g in self._rates[1]])

    @cached_property
    def axes(self) -> Array:
        """Unit vectors of the slow variables along and across the fold, shape (2, 2)."""
        along = self.speed / np.linalg.norm(self.speed)
        if self.direction:
            one = along[self.direction - 1]
            along = np.where(np.arange(2) == self.direction - 1, math.copysign(1.0, one), 0.0)
        return np.array([along, [-along[1], along[0]]])

    @cached_property
    def local(self) -> tuple[sp.Expr, sp.Expr, sp.Expr]:
        """f, σ' and the rate across the fold, in local coordinates."""
        f, g = self._rates
        (fast,) = self.model.states
        new = {real(fast): FAST}
        for k, name in enumerate(self.slow):
            along, across = self.axes[:, k].tolist()
            new[real(name)] = float(self.centre[1 + k]) + along * ALONG + across * ACROSS
        moved = [e.xreplace(new) for e in g]
        rows = [self.axes[j, 0] * moved[0] + self.axes[j, 1] * moved[1] for j in range(2)]
        return f.xreplace(new), rows[0], rows[1]

    @cached_property
    def over_distance(self) -> Model:
        """The model over τ from 0 to 1 with σ = length (τ − 1), so that runs end on the section."""
        f, along, across = self.local
        return Model(
            {FAST: LENGTH * f / along},
            slow={ALONG: LENGTH, ACROSS: LENGTH * across / along},
            parameters={LENGTH: 1.0},
        )

    @cached_property
    def slopes(self) -> tuple[Array, Array]:
        """λ of the desingularised slow flow, the larger first, and (x − x_f)/σ along them.

        x_f(σ) is the fold: where f_x depends on σ, it is not at x₀ for σ ≠ 0.
        """
        f, along, across = self.local
        at = {FAST: float(self.centre[0]), ALONG: 0.0, ACROSS: 0.0}
        stretch = f.diff(FAST)
        pushed = f.diff(ALONG) * along + f.diff(ACROSS) * across
        known = [[pushed.diff(FAST), pushed.diff(ALONG)]]
        known.append([-stretch.diff(FAST) * along, -stretch.diff(ALONG) * along])
        # along the sheet the distance across the fold is a function of the other two
        tilt = -f.diff(ALONG) / f.diff(ACROSS)
        known[0][1] += tilt * pushed.diff(ACROSS)
        known[1][1] += -tilt * stretch.diff(ACROSS) * along
        matrix = np.array([[float(e.subs(at)) for e in row] for row in known])
        values = np.linalg.eigvals(matrix).real
        values = values[np.argsort(-np.abs(values))]
        # the second row is −f_xx (x − x_f): σ' = λσ along an eigenvector
        return values, values / matrix[1, 0]

    @cached_property
    def tilt(self) -> float:
        """Slope of the fold curve at the singularity, across over along."""
        at = {FAST: float(self.centre[0]), ALONG: 0.0, ACROSS: 0.0}
        f = self.local[0]
        return float((-f.diff(ALONG) / f.diff(ACROSS)).subs(at))

    @cached_property
    def rate(self) -> float:
        """σ' at the singularity."""
        return float(self.axes[0] @ self.speed)

    @cached_property
    def attracting(self) -> int:
        """Sign of x − x₀ on the attracting sheet."""
        at = {FAST: float(self.centre[0]), ALONG: 0.0, ACROSS: 0.0}
        return -1 if float(self.local[0].diff(FAST, 2).subs(at)) > 0 else 1

    @cached_property
    def _function(self) -> Callable[..., Any]:
        f, along, across = self.local
        rows = [f, f.diff(FAST), f.diff(ACROSS), f.diff(FAST, 2), f.diff(FAST, ACROSS)]
        rows += [f.diff(ALONG) * along + f.diff(ACROSS) * across, along]
        made: Callable[..., Any] = sp.lambdify((FAST, ALONG, ACROSS), rows, "numpy")
        return made

    def starts(self, side: int, along: Array, distance: float) -> Array:
        """Points of a sheet beside the fold at distances σ, shape (N, 3); NaN where there are none.

        Parameters
        ----------
        side : int
            Sign of x − x₀.
        along : ndarray, shape (N,)
        distance : float
            In x from the fold.
        """
        x, across = np.full_like(along, self.centre[0]), self.tilt * along
        with np.errstate(all="ignore"):
            for _ in range(START_NEWTON):
                f, fx, fw, fxx, fxw, *_ = self._function(x, along, across)
                determinant = fx * fxw - fw * fxx
                x = x - (fxw * f - fw * fx) / determinant
                moved = (fx * fx - fxx * f) / determinant
                across = across - moved
            converged = np.abs(moved) <= FUNNEL_START_ROUNDING * (np.abs(across) + np.abs(along))
            x = x + side * distance
            for _ in range(START_NEWTON):
                f, fx, fw, *_ = self._function(x, along, across)
                across = across - f / fw
            converged &= np.abs(f / fw) <= FUNNEL_START_ROUNDING * (np.abs(across) + np.abs(along))
            # the sheet beside this fold attracts, or repels
            converged &= side * self.attracting * fx < 0.0
            # the slow manifold to first order, x + f_x⁻¹ dx/dt
            _, fx, *_, pushed, _ = self._function(x, along, across)
            x = x - pushed / (fx * fx)
        return np.where(converged[:, None], np.column_stack([x, along, across]), np.nan)

    @cached_property
    def distance(self) -> float:
        """Distance in x of the starts from the fold."""
        values, slopes = self.slopes
        length = math.sqrt(2.0 * FOLDED_CONTRACTION / abs(values[0])) * self.rate
        found = float(abs(slopes[0]) * length)
        for _ in range(MOST_SHIFTS):
            along = np.array([-1.0, 1.0]) * found / abs(slopes[0])
            signs = []
            for side, way in ((self.attracting, along[:1]), (-self.attracting, along[1:])):
                x, sigma, across = self.starts(side, way, found).T
                half = self.starts(side, 0.5 * way, 0.5 * found).T
                far, near = (self._function(*p) for p in ((x, sigma, across), half))
                whole, part = far[1][0], near[1][0]
                # beyond, |f_x| decreases towards another fold, or σ does not increase
                increases = bool(np.all(np.asarray(far[6]) > 0.0))
                signs.append(whole * part > 0.0 and abs(whole) > abs(part) and increases)
            if all(signs):
                break
            found *= SHIFT_TO_FOLD
        return self.nearer * found

    def turned(self) -> FoldedSection:
        """Return the section with the strongest contraction, this one if that is complete."""
        if self.contraction >= (1.0 - 1e-9) * FOLDED_CONTRACTION:
            return self
        others = [replace(self, direction=k + 1) for k in range(2)]
        # σ must change along the fold
        least = 0.1 * float(np.linalg.norm(self.speed))
        across = [one for one in others if abs(self.speed[one.direction - 1]) > least]
        return max([self, *across], key=lambda one: one.contraction)

    def moved(self, factor: float) -> FoldedSection:
        """Return the same section with starts at another distance from the fold."""
        return replace(self, nearer=self.nearer * factor)

    @property
    def contraction(self) -> float:
        """∫|Re λ| dt along the strong canard."""
        values, slopes = self.slopes
        length = self.distance / abs(float(slopes[0])) / self.rate
        return 0.5 * abs(float(values[0])) * length**2

    def curve(self, side: int, lengths: Array, rtol: float) -> Array:
        """Points on the section of runs from starts at |σ| = lengths, shape (N, 2); NaN if missed.

        Coordinates are x − x₀ and the distance across the fold.
        """
        way = -1.0 if side == self.attracting else 1.0
        starts = self.starts(side, way * lengths, self.distance)
        good = np.isfinite(starts).all(axis=1)
        found = np.full((len(lengths), 2), np.nan)
        if not good.any():
            return found
        many = simulate_many(
            self.over_distance,
            starts[good],
            parameters={LENGTH.name: -way * lengths[good]},
            t=(0.0, 1.0),
            integration=Integration(rtol=rtol, max_steps=MOST_FUNNEL_STEPS),
        )
        ends = many.final[:, [0, 2]] - [self.centre[0], 0.0]
        ends[~many.success] = np.nan
        found[good] = ends
        return found

    def path(self, lengths: tuple[float, float]) -> Array:
        """The canard with starts at |σ| on both sheets, in the variables of the model, (M, 3)."""
        pieces = []
        for side, length in zip((self.attracting, -self.attracting), lengths, strict=True):
            way = -1.0 if side == self.attracting else 1.0
            (start,) = self.starts(side, np.array([way * length]), self.distance)
            run = simulate(
                self.over_distance.with_parameters({LENGTH.name: -way * length}),
                start,
                t=(0.0, 1.0),
                samples=PATH_SAMPLES,
            )
            local = np.column_stack([run[n.name] for n in (FAST, ALONG, ACROSS)])
            pieces.append(local if side == self.attracting else local[::-1])
        local = np.concatenate(pieces)
        return np.column_stack([local[:, 0], self.centre[1:] + local[:, 1:] @ self.axes])

    def on_section(self, place: Array) -> Array:
        """The variables of the model at coordinates on the section."""
        return np.append(self.centre[0] + place[0], self.centre[1:] + place[1] * self.axes[1])
