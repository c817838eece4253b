"""Canards of piecewise-linear models, whose slow manifolds are eigenlines, in closed form.

Where two linear zones meet at a corner, both lines meet on the interface only in the boundary
equilibrium, so that there is no maximal canard (Desroches, Freire, Hogan, Ponce and Thota, Proc.
R. Soc. A 469, 20120603, 2013). A zone between them in which the rates are not separated connects
them at one value of the parameter.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from fastslow.errors import ArgumentError
from fastslow.model.interfaces import Region
from fastslow.model.model import Model
from fastslow.model.rational import exact
from fastslow.model.structure import real
from fastslow.results.base.named_mapping import NamedMapping
from fastslow.results.base.outcome import Outcome
from fastslow.results.orbits.canard import Canard
from fastslow.simulation.one import simulate
from fastslow.simulation.settings import Integration
from fastslow.symbolic.corners import CornerPoint, corner_points

Array = NDArray[np.float64]

#: Samples of half a turn in the zone between both lines, in which its end is looked for.
TURN_SAMPLES = 400

#: Longest run, in slow times of its eigenline.
LONGEST_TURNS = 20.0

#: Times that a run along an eigenline is shortened by a fifth until it starts in its region.
MOST_SHORTER = 60

#: Rounding of the closed form, in units of the parameter, and of the runs in units of the state.
LINE_ROUNDING, SECTION_ROUNDING = 16 * np.finfo(float).eps, 4 * np.finfo(float).eps

#: A gap below this fraction of the largest one is a meeting.
MEETING = 1e-9

#: ∫|Re λ| dt along an eigenline, from its start to the interface.
LINE_CONTRACTION = 45.0


@dataclass(frozen=True, eq=False)
class LinearZone:
    """A region of a planar model with linear rates z' = A z + b.

    Parameters
    ----------
    model : Model
    region : Region
    parameter : str
    """

    model: Model
    region: Region
    parameter: str

    @cached_property
    def _parts(self) -> tuple[Callable[[float], Array], Callable[[float], Array]]:
        names = (*self.model.states, *self.model.slow_states)
        known = {
            real(n): sp.Float(v, 17)
            for n, v in self.model.parameters.items()
            if n != self.parameter
        }
        rates = sp.Matrix([exact(self.region.rates[n]) for n in names]).xreplace(known)
        z = [real(n) for n in names]
        matrix = rates.jacobian(z).applyfunc(sp.simplify)
        if matrix.free_symbols & {*z}:
            raise ArgumentError(
                f"point: the rates of region {self.region.name} are not linear; a canard at a "
                "corner is computed for piecewise-linear models"
            )
        varied = real(self.parameter)
        constant = rates.xreplace(dict.fromkeys(z, sp.S.Zero))
        return sp.lambdify(varied, matrix), sp.lambdify(varied, constant)

    def matrix(self, value: float) -> Array:
        """A at a value of the parameter."""
        return np.asarray(self._parts[0](value), dtype=float)

    def centre(self, value: float) -> Array:
        """The equilibrium, of which the state may be outside the region."""
        constant = np.asarray(self._parts[1](value), dtype=float).ravel()
        return np.linalg.solve(self.matrix(value), -constant)

    def eigenvalues(self, value: float) -> Array:
        """Slow and fast eigenvalue; empty if they are complex."""
        found = np.linalg.eigvals(self.matrix(value))
        if np.iscomplex(found).any():
            return np.empty(0)
        return np.sort(found.real)[np.argsort(np.abs(np.sort(found.real)))]

    @cached_property
    def _walls(self) -> Callable[..., list[float]]:
        names = (*self.model.states, *self.model.slow_states, self.parameter)
        known = {
            real(n): sp.Float(v, 17)
            for n, v in self.model.parameters.items()
            if n != self.parameter
        }
        walls = [
            (self.region.signs[name] * exact(one.function)).xreplace(known)
            for name, one in self.model.interfaces.items()
        ]
        made: Callable[..., list[float]] = sp.lambdify([real(n) for n in names], walls, "math")
        return made

    def holds(self, value: float, state: Array) -> bool:
        """Return whether a state is in the region."""
        return all(wall >= 0.0 for wall in self._walls(*state.tolist(), value))

    def line(self, value: float, x: float) -> Array:
        """The state on the slow eigenline at a value of the fast state."""
        slow = self.eigenvalues(value)[0]
        matrix, centre = self.matrix(value), self.centre(value)
        # (A − λ) v = 0 by the first row, whose entries are large
        direction = np.array([matrix[0, 1], slow - matrix[0, 0]])
        return centre + (x - centre[0]) / direction[0] * direction

    def turning(self, value: float) -> float:
        """The imaginary part of complex eigenvalues."""
        matrix = self.matrix(value)
        return math.sqrt(np.linalg.det(matrix) - 0.25 * np.trace(matrix) ** 2)

    def flow(self, value: float, state: Array, t: Array) -> Array:
        """exp(At) applied to a state, with complex eigenvalues, shape (N, 2)."""
        matrix, centre = self.matrix(value), self.centre(value)
        mean, turn = 0.5 * np.trace(matrix), self.turning(value)
        one = state - centre
        other = (matrix - mean * np.eye(2)) @ one / turn
        grown = np.exp(mean * t)[:, None]
        turned = np.cos(turn * t)[:, None] * one + np.sin(turn * t)[:, None] * other
        return centre + grown * turned


def bisected(function: Callable[[float], float], low: float, high: float) -> float:
    """Return a zero between two numbers, to the last bit, by bisection.

    Examples
    --------
    >>> bisected(lambda v: v * v - 2.0, 1.0, 2.0)
    1.414213562373095
    """
    sign = math.copysign(1.0, function(low))
    while True:
        middle = 0.5 * (low + high)
        if not min(low, high) < middle < max(low, high):
            return float(low)
        low, high = (middle, high) if sign * function(middle) > 0.0 else (low, middle)


@dataclass(frozen=True, eq=False)
class Passage:
    """The eigenlines on both sides of a zone with complex eigenvalues, and the flow between them.

    Parameters
    ----------
    before, between, after : LinearZone
    entry, leaving : float
        Values of the fast state on both interfaces; equal without a zone between.
    """

    before: LinearZone
    between: LinearZone
    after: LinearZone
    entry: float
    leaving: float

    def gap(self, value: float) -> float:
        """Difference of the slow state on the second interface; NaN if it is not reached."""
        start = self.before.line(value, self.entry)
        other = self.after.line(value, self.leaving)
        if self.entry == self.leaving:
            return float(start[1] - other[1])
        zone = self.between
        rate = math.sqrt(
            np.linalg.det(zone.matrix(value)) - 0.25 * np.trace(zone.matrix(value)) ** 2
        )
        t = np.linspace(0.0, 2.0 * math.pi / rate, 4 * TURN_SAMPLES)
        side = math.copysign(1.0, self.leaving - self.entry)

        def left(t: float) -> float:
            return float(side * (zone.flow(value, start, np.array([t]))[0, 0] - self.leaving))

        x = zone.flow(value, start, t)[:, 0]
        over = np.flatnonzero(side * (x - self.leaving) >= 0.0)
        back = np.flatnonzero(side * (x[1:] - self.entry) < 0.0)
        if not over.size or (back.size and back[0] + 1 < over[0]):
            return float("nan")
        end = t[over[0]] if over[0] == 0 else bisected(left, t[over[0] - 1], t[over[0]])
        return float(zone.flow(value, start, np.array([end]))[0, 1] - other[1])

    def solved(self, first: float, last: float) -> float | None:
        """Return the value of the parameter at which the lines are connected, None without one."""
        values = np.linspace(first, last, TURN_SAMPLES + 1)[1:-1]
        gaps = np.array([self.gap(v) for v in values])
        size = float(np.nanmax(np.abs(gaps), initial=0.0))
        for k in np.flatnonzero(~(gaps[:-1] * gaps[1:] > 0.0)):
            known = gaps[k] if np.isfinite(gaps[k]) else gaps[k + 1]
            if np.isnan(known):
                continue
            # a motion that turns back before the second interface has the sign of the other side
            missed = -known

            def signed(value: float, missed: float = missed) -> float:
                gap = self.gap(value)
                return missed if math.isnan(gap) else gap

            found = bisected(signed, values[k], values[k + 1])
            near = [self.gap(v) for v in (found, math.nextafter(found, last))]
            if np.nanmin(np.abs(near), initial=np.inf) <= MEETING * size:
                return found
        return None


def corner_canard(
    model: Model, point: CornerPoint, parameter: str, integration: Integration
) -> Canard:
    """Compute the canard from a corner through a zone beside it, or say why there is none.

    Parameters
    ----------
    model : Model
        Planar, with rates that are linear in every region, and interfaces x = constant.
    point : CornerPoint
        With a code.
    parameter : str
    integration : Integration
        Of the trajectories along both lines.
    """
    if not point.code:
        raise ArgumentError(
            f"point: a {point.words}; expected a corner (BC), at which an attracting and another "
            "sheet meet"
        )
    if point.parameter != parameter:
        raise ArgumentError(
            f"point: the slow rate at the corner is solved for {point.parameter or 'no parameter'};"
            f" use that of slow_flow(model, parameter='{parameter}')"
        )
    fast = model.states[0]
    sides = sorted(point.sides, key=lambda side: not side.attracting)
    before, beside = (LinearZone(model, model.regions[s.region], parameter) for s in sides)
    entry, value = point.values[fast], point.value
    if not before.eigenvalues(value).size:
        raise ArgumentError(
            f"point: fast and slow rates are not separated on the attracting side "
            f"{before.region.name}, whose eigenvalues are complex: it has no slow manifold"
        )
    if beside.eigenvalues(value).size:
        text = (
            f"the slow manifolds are the eigenlines of {before.region.name} and "
            f"{beside.region.name}, which meet on {point.interface} only at {parameter} = "
            f"{value:.9g}, in the equilibrium at the corner. The rates of {beside.region.name} are "
            "separated too: beyond this value the whole cycle appears at once (super-explosion)."
        )
        return _canard(
            Passage(before, before, beside, entry, entry),
            value,
            integration,
            Outcome("no canard", text, False),
        )
    others = [
        (corner, side)
        for corner in corner_points(model, [parameter])
        if corner.interface != point.interface
        and beside.region.name in [s.region for s in corner.sides]
        for side in corner.sides
        if side.region != beside.region.name and not side.attracting
    ]
    if not others:
        raise ArgumentError(
            f"point: fast and slow rates are not separated in {beside.region.name}, whose "
            "eigenvalues are complex, and no repelling sheet follows it: there is no repelling "
            f"slow manifold. The cycle grows in proportion to |{parameter} − {value:.9g}|"
        )
    exit_corner, side = others[0]
    after = LinearZone(model, model.regions[side.region], parameter)
    if not after.eigenvalues(value).size:
        raise ArgumentError(
            f"point: fast and slow rates are not separated in {side.region}, whose eigenvalues "
            "are complex: there is no repelling slow manifold"
        )
    passage = Passage(before, beside, after, entry, exit_corner.values[fast])
    found = passage.solved(value, exit_corner.value)
    if found is None:
        text = f"the eigenlines are not connected through {beside.region.name}."
        return _canard(passage, value, integration, Outcome("no canard", text, False))
    text = f"the eigenlines meet at {parameter} = {found:.16g}."
    return _canard(passage, found, integration, Outcome("connected", text, True))


def _canard(passage: Passage, value: float, integration: Integration, outcome: Outcome) -> Canard:
    """Return the runs along both lines up to the second interface, with their gap there."""
    zone = passage.before
    model, name = zone.model.with_parameters({zone.parameter: value}), zone.parameter
    fast, slow = model.states[0], model.slow_states[0]
    step = 1e-6 * (abs(passage.leaving - passage.entry) or abs(value) or 1.0)
    slope = (passage.gap(value + step) - passage.gap(value - step)) / (2.0 * step)
    section = f"{fast} - ({passage.leaving:.17g})"
    runs, contractions = [], []
    for one, x, way in (
        (passage.before, passage.entry, 1.0),
        (passage.after, passage.leaving, -1.0),
    ):
        state, duration, contraction = _start(one, value, x, way)
        contractions.append(contraction)
        limit = way * (4.0 * duration + LONGEST_TURNS / abs(one.eigenvalues(value)[0]))
        runs.append(
            simulate(
                model, state, t=(0.0, limit), stop=section, dense=True, integration=integration
            )
        )
    gap = float(runs[0].final_state[slow] - runs[1].final_state[slow])
    rounding = (SECTION_ROUNDING * abs(runs[0].final_state[slow]) + abs(gap)) / abs(slope)
    accuracy = rounding + LINE_ROUNDING * abs(value)
    return Canard(
        parameter=name,
        value=value if outcome else math.nan,
        accuracy=accuracy if outcome else math.nan,
        contraction=min(contractions),
        slope=slope,
        gap=gap,
        evaluations=TURN_SAMPLES,
        section=section,
        states=(fast, slow),
        fold=NamedMapping(
            "state", {fast: passage.entry, slow: float(zone.line(value, passage.entry)[1])}
        ),
        attracting=runs[0],
        repelling=runs[1],
        parameters=NamedMapping("parameter", dict(runs[0].parameters)),
        outcome=outcome,
    )


def _start(zone: LinearZone, value: float, x: float, way: float) -> tuple[Array, float, float]:
    """Return a state on an eigenline from which its interface is reached, with time and K."""
    slow, quick = zone.eigenvalues(value)
    end, centre = zone.line(value, x), zone.centre(value)
    duration = LINE_CONTRACTION / abs(quick)
    for _ in range(MOST_SHORTER):
        state = centre + math.exp(-way * slow * duration) * (end - centre)
        if zone.holds(value, state):
            break
        duration *= 0.8
    return state, duration, duration * abs(quick)
