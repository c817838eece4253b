"""The strong canard of a folded node in the slow flow, which bounds its funnel."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from fastslow.model.structure import TIME, real
from fastslow.orbits.canards.slow_pieces import PlaceOnSheet, SingularFlow
from fastslow.results.trajectory.trajectory import Trajectory
from fastslow.symbolic.folded_points import FoldedPoint
from fastslow.symbolic.sheet_flows import FLOW_UNIT

Array = NDArray[np.float64]

#: Distance from the folded node at which the strong canard begins, in sizes of the variables.
STRONG_START = 1e-6

#: Most runs backwards along the strong canard, each twice as long.
STRONG_RUNS = 6

#: Samples of a step, in which the nearest place is looked for, and Newton steps to it.
SAMPLES_PER_STEP, NEAREST_NEWTON = 8, 40

#: Steps from the strong canard to a landing along a sheet, and the largest change of a state in one
#: of them, in its size.
SHEET_STEPS, SHEET_JUMP = 60, 0.25

#: Periods of a forcing by which a landing is moved.
LANDING_PERIODS = 3


@dataclass(eq=False)
class StrongCanard:
    """The strong canard of a folded node: the slow flow backwards along the strong direction.

    Parameters
    ----------
    flow : SingularFlow
    node : FoldedPoint
        With a funnel.
    """

    flow: SingularFlow
    node: FoldedPoint

    @cached_property
    def _place(self) -> PlaceOnSheet:
        at = np.array([self.node.values[n] for n in self.flow.names])
        return PlaceOnSheet(self.node.form.region, at)

    @cached_property
    def _directions(self) -> tuple[Array, Array]:
        """Strong and weak eigenvectors, towards the attracting sheet."""
        sheet = self.flow.sheets[self._place.sheet]
        z = [*sheet.x, *sheet.y]
        matrix = sp.Matrix(sheet.desingularised).jacobian(z)
        known = {real(n): v for n, v in self.flow.model.parameters.items()}
        known |= dict(zip(z, self._place.at.tolist(), strict=True))
        numbers = np.array([float(sp.N(e.xreplace(known))) for e in matrix], dtype=float)
        jacobian = numbers.reshape(matrix.shape)
        slope = self.flow.numbers(self._place).slope
        found = []
        for value in self.node.eigenvalues:
            unit = self.flow.unit
            shifted = (jacobian - value.real * np.eye(len(z))) * unit / unit[:, None]
            vector = np.linalg.svd(shifted)[2][-1] * unit
            found.append(vector * math.copysign(1.0, float(slope @ vector)))
        return found[0], found[1]

    @cached_property
    def runs(self) -> tuple[Trajectory, ...]:
        """The strong canard, backwards from the folded node."""
        strong = self._directions[0]
        at = self._place.at + STRONG_START * strong / np.abs(strong / self.flow.unit).max()
        start = self.flow.nearest(self._place._replace(at=at))
        return tuple(self.flow.run(start, -1.0, STRONG_RUNS)[0])

    def distance(self, landing: PlaceOnSheet, ranges: Array) -> float:
        """Signed distance of a landing, in ranges of the slow variables: positive in the funnel.

        NaN where the landing is not on the sheet of the node.
        """
        if landing.sheet != self._place.sheet or not self.runs:
            return math.nan
        found = [self._signed(landing._replace(at=at), ranges) for at in self._moved(landing.at)]
        known = [one for one in found if math.isfinite(one)]
        return min(known, key=abs, default=math.nan)

    def _moved(self, at: Array) -> list[Array]:
        """The landing in several periods of the forcing."""
        period = self.flow.period
        if period is None:
            return [at]
        k = self.flow.names.index(TIME.name)
        shift = period * math.floor((self._place.at[k] - at[k]) / period)
        moved = []
        for count in range(-LANDING_PERIODS, LANDING_PERIODS + 1):
            other = at.copy()
            other[k] += shift + count * period
            moved.append(other)
        return moved

    def _signed(self, landing: PlaceOnSheet, ranges: Array) -> float:
        n = len(self.flow.model.states)
        target, unit = landing.at[n:] / ranges, ranges
        run, s = self._nearest(target, unit)
        here = run(s)[:-1]
        tangent = self.flow.numbers(landing._replace(at=here)).flow[n:] / unit
        away = target - here[n:] / unit
        if not self._same_sheet(landing, here):
            return math.nan
        side = _cross(tangent, away) * self._inside(unit)
        return math.copysign(float(np.linalg.norm(away)), side)

    def _nearest(self, target: Array, unit: Array) -> tuple[Trajectory, float]:
        """The place of the strong canard that is nearest in the slow variables."""
        n = len(self.flow.model.states)
        best = math.inf, self.runs[0], 0.0
        for run in self.runs:
            steps = np.union1d(run.step_starts, run.span)
            times = np.interp(
                np.linspace(0.0, len(steps) - 1.0, SAMPLES_PER_STEP * len(steps)),
                np.arange(len(steps)),
                steps,
            )
            away = np.linalg.norm(run(times).T[:, n:-1] / unit - target, axis=1)
            k = int(np.argmin(away))
            if away[k] < best[0]:
                best = float(away[k]), run, float(times[k])
        _, run, s = best
        low, high = run.span
        rate = run.parameters[FLOW_UNIT.name]
        for _ in range(NEAREST_NEWTON):
            here = run(s)[:-1]
            sheet = self.flow.sheets[self._place.sheet]
            slope = rate * sheet.at(here, self.flow.model.parameters).flow[n:] / unit
            if not slope @ slope > 0.0:
                break
            change = float((target - here[n:] / unit) @ slope / (slope @ slope))
            s = min(max(s + change, low), high)
            if abs(change) <= 1e-14 * (high - low):
                break
        return run, s

    def _same_sheet(self, landing: PlaceOnSheet, here: Array) -> bool:
        """Whether the sheet leads from the strong canard to the landing without a fold."""
        n, at = len(self.flow.model.states), here.copy()
        for part in np.linspace(0.0, 1.0, SHEET_STEPS):
            at[n:] = here[n:] + part * (landing.at[n:] - here[n:])
            moved = self.flow.on_sheet(landing._replace(at=at))
            if moved is None or not self.flow.numbers(moved).attracting:
                return False
            if (np.abs(moved.at - at) / self.flow.unit).max() > SHEET_JUMP:
                return False
            at = moved.at.copy()
        return bool((np.abs(at - landing.at) / self.flow.unit).max() < 1e-6)

    def _inside(self, unit: Array) -> float:
        """Orientation of the weak direction from the strong canard, in the slow variables.

        Both have the same projection at the node, that of g; beside it, on the sheet, they differ.
        """
        n = len(self.flow.model.states)
        strong, weak = (v / np.abs(v / self.flow.unit).max() for v in self._directions)
        start = self.flow.nearest(self._place._replace(at=self._place.at + 1e-3 * strong))
        here, centre = self.flow.numbers(start), self.flow.numbers(self._place)
        phi = np.linalg.svd(centre.inner * self.flow.unit[:n])[2][-1] * self.flow.unit[:n]
        phi, along = phi / np.linalg.norm(phi), centre.g / np.linalg.norm(centre.g)
        rows = np.zeros((n + 2, n + 2))
        rows[:n], rows[n, :n], rows[n + 1, n:] = here.jacobian, phi, along
        tangents = [
            np.linalg.solve(rows, [*np.zeros(n), phi @ v[:n], along @ v[n:]])[n:] / unit
            for v in (-strong, weak)
        ]
        return math.copysign(1.0, _cross(*tangents))


def _cross(one: Array, other: Array) -> float:
    return float(one[0] * other[1] - one[1] * other[0])
