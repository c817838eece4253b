"""Canard cycles of planar models: periodic orbits that follow the repelling slow manifold."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from fastslow.arguments import finite
from fastslow.errors import ArgumentError, unknown_name
from fastslow.model.model import Model
from fastslow.orbits.canards.maximal_canards import (
    AT_SECTION,
    CANARD_RUNS,
    ManifoldPair,
    root_of_gap,
)
from fastslow.orbits.canards.sheets import Sheets, planar
from fastslow.orbits.flow.problem import OrbitProblem, joined
from fastslow.results.base.outcome import Outcome, with_notes
from fastslow.results.orbits.canard import Canard
from fastslow.results.orbits.orbit import Orbit
from fastslow.simulation.one import simulate
from fastslow.simulation.settings import Integration

#: Longest half of a cycle, in slow times of the canard.
LONGEST_HALF = 40.0

#: Difference of the parameter from that of the maximal canard, in units of the accuracy of the
#: latter, up to which they agree.
SAME_CANARD = 4.0

#: Newton steps to the line on which the slow rate vanishes.
LINE_NEWTON = 50


@dataclass(eq=False)
class Cycles:
    """Both halves of cycles through one point, over the parameter.

    Parameters
    ----------
    model : Model
    canard : Canard
    sheets : Sheets
    at : mapping
        The slow state, and the fast one unless the slow rate vanishes at the point.
    integration : Integration
    """

    model: Model
    canard: Canard
    sheets: Sheets
    at: Mapping[str, float]
    integration: Integration

    def point(self, value: float) -> tuple[float, float]:
        """Return the point of the cycle at a value of the parameter."""
        (fast,), (slow,) = self.model.states, self.model.slow_states
        y = self.at[slow]
        if fast in self.at:
            return self.at[fast], y
        x = self.canard.fold[fast]
        step = 1e-6 * max(abs(x), 1e-3)
        for _ in range(LINE_NEWTON):
            g, ahead, back = (self.sheets.at(x + d, y, value)[3] for d in (0.0, step, -step))
            slope = (ahead - back) / (2.0 * step)
            change = g / slope if slope else math.nan
            x -= change
            if not abs(change) > 4.0 * np.finfo(float).eps * abs(x):
                break
        if not math.isfinite(x):
            raise ArgumentError(
                f"at: the slow rate does not vanish at {slow} = {y:.6g}; give {fast} too"
            )
        return x, y

    def pair(self, value: float, dense: bool = False) -> ManifoldPair:
        """Return both halves up to the section, and their gap in the slow state there."""
        model = self.model.with_parameters({self.sheets.parameter: value})
        one, other = self.canard.attracting, self.canard.repelling
        longest = LONGEST_HALF * (np.ptp(one.t) + np.ptp(other.t))
        start, text = self.point(value), self.canard.section
        # downwards from the attracting to the repelling side, as the canard passes the section
        (fast,) = self.model.states
        after = ">" if other[fast][-1] > one[fast][0] else "<"
        before = "<" if after == ">" else ">"
        halves = [
            simulate(
                model,
                start,
                t=(0.0, way * longest),
                stop=f"{text} {sign} 0",
                dense=dense,
                integration=self.integration,
            )
            for way, sign in ((1.0, after), (-1.0, before))
        ]
        slow = self.model.slow_states[0]
        reached = [half.outcome.code == AT_SECTION for half in halves]
        gap = halves[0].final_state[slow] - halves[1].final_state[slow]
        if not all(reached):
            gap = math.copysign(math.inf, self.canard.slope * (value - self.canard.value))
        return ManifoldPair(value, float(gap), halves[0], halves[1])


def canard_cycle(
    model: Model, canard: Canard, at: Mapping[Any, float], integration: Integration | None
) -> Orbit:
    """Compute the canard cycle through a point; see `fastslow.find_orbit`."""
    planar(model, "find_orbit of a canard")
    if not canard.outcome:
        raise ArgumentError(f"guess: this canard was not found: {canard.outcome}")
    (fast,), (slow,) = model.states, model.slow_states
    if canard.states != (fast, slow) or canard.parameter not in model.parameters:
        raise ArgumentError(
            f"guess: a canard of {', '.join(canard.states)} over {canard.parameter}; the model has "
            f"the states {fast}, {slow} and the parameters {', '.join(model.parameters)}"
        )
    given = {str(name): finite(f"at of {name}", value) for name, value in at.items()}
    for name in given:
        if name not in (fast, slow):
            raise unknown_name("state", name, (fast, slow))
    if slow not in given:
        raise ArgumentError(
            f"at: expected the height of the cycle as a value of {slow}, received "
            f"{', '.join(given) or 'none'}"
        )
    name = canard.parameter
    others = {n: v for n, v in model.parameters.items() if n != name}
    moved = next((n for n, v in others.items() if canard.parameters.get(n) != v), None)
    if moved is not None:
        raise ArgumentError(
            f"guess: the canard is one at {moved} = {canard.parameters.get(moved)}; the model has "
            f"{moved} = {others[moved]:g}"
        )
    region = next(iter(model.regions))
    sheets = Sheets(model, region, name)
    settings = CANARD_RUNS if integration is None else integration
    cycles = Cycles(model, canard, sheets, given, settings)
    first = cycles.pair(canard.value)
    change = -first.gap / canard.slope
    if not (math.isfinite(change) and change):
        change = 1e-9 * max(abs(canard.value), 1e-3)
    best, _, failed = root_of_gap(cycles.pair, canard.value, change, abs(change))
    pair = cycles.pair(best.value, dense=True)
    run = joined([pair.repelling, pair.attracting])
    problem = OrbitProblem.of(model.with_parameters({name: best.value}), 1, None, settings)
    size = float(np.ptp(run[slow])) or 1.0
    orbit = problem.closed(run, abs(pair.gap) / size)
    return _judged(orbit, canard, best, failed)


def _judged(orbit: Orbit, canard: Canard, best: ManifoldPair, failed: Outcome | None) -> Orbit:
    """Return the orbit with an outcome that names what its parameter does not determine."""
    if failed is not None:
        text = f"the two halves of the cycle do not meet: {failed}"
        return replace(orbit, outcome=Outcome("no canard cycle", text, False))
    if orbit.outcome and abs(best.value - canard.value) <= SAME_CANARD * canard.accuracy:
        note = (
            f"{canard.parameter} = {best.value:.16g} is that of the maximal canard to rounding: it "
            "does not determine the height of the cycle."
        )
        return replace(orbit, outcome=with_notes(orbit.outcome, [note]))
    return orbit
