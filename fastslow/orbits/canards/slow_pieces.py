"""Pieces of singular orbits: the slow flow along a sheet, and the jumps from where it ends."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fastslow.model.model import Model
from fastslow.model.rational import exact
from fastslow.model.structure import TIME, real
from fastslow.results.base.named_mapping import NamedMapping
from fastslow.results.orbits.singular import SingularPiece
from fastslow.results.trajectory.trajectory import Trajectory
from fastslow.simulation.one import simulate
from fastslow.simulation.settings import Integration
from fastslow.symbolic.folded_points import FoldedPoint
from fastslow.symbolic.sheet_flows import FLOW_UNIT, SheetFlow, SheetNumbers, across

Array = NDArray[np.float64]

#: Settings of both flows.
SINGULAR_RUNS = Integration(rtol=1e-13)

#: Fraction of the orientation at the start of a piece at which its fold is reached.
AT_FOLD = 1e-9

#: Time of one run of the desingularised flow, in units in which a state changes by its size, and
#: the most runs, each twice as long.
FIRST_RUN, MOST_RUNS = 16.0, 24

#: Fraction of the orientation at the start of a piece, above which a place is not at a fold.
REST_ON_SHEET = 1e-5

#: Speed, in these units, below which the slow flow is at an equilibrium.
SLOW_FLOW_AT_REST = 1e-11

#: Samples of a run.
PIECE_SAMPLES = 200

#: Distance, in sizes of the variables, up to which two places are one: at folded points, and at
#: the end of a cycle.
AT_FOLDED_POINT, CLOSED_CYCLE = 1e-6, 1e-10

#: Distance from a fold or a corner at which a jump begins, in sizes of the states.
SINGULAR_JUMP = 1e-3

#: Distance from an interface between slow variables at which a jump begins, in their sizes.
BEYOND_SLOW_WALL = 1e-12

#: Size of a Newton step, in sizes of the states, up to which a jump has landed.
LANDED_STEP = 1e-6

#: Time in which a jump settles, in units of the largest eigenvalue of the fast rates, and the most
#: runs, each twice as long.
SETTLING, MOST_JUMP_RUNS = 50.0, 12

#: Sizes of a variable beyond which an orbit is unbounded.
UNBOUNDED_ORBIT = 1e4

#: Newton steps to a sheet or a fold.
PLACE_NEWTON = 40


class PlaceOnSheet(NamedTuple):
    """A place (x, y) on a sheet, and what ends a slow piece there."""

    sheet: str
    at: Array
    end: str = ""
    wall: str = ""


@dataclass(eq=False)
class SingularFlow:
    """The slow flow on the sheets of a model and its jumps, at its parameter values.

    Parameters
    ----------
    model : Model
    slow : tuple of str
    sheets : mapping of str to SheetFlow
    points : tuple of FoldedPoint
    period : float or None
        Of the forcing.
    sizes : ndarray, shape (n + m,)
        Largest sizes of the variables so far.
    """

    model: Model
    slow: tuple[str, ...]
    sheets: Mapping[str, SheetFlow]
    points: tuple[FoldedPoint, ...]
    period: float | None
    sizes: Array
    pieces: list[SingularPiece] = field(default_factory=list)

    @property
    def names(self) -> tuple[str, ...]:
        """Fast states and slow variables."""
        return (*self.model.states, *self.slow)

    @property
    def unit(self) -> Array:
        """The sizes; 1 for a variable that has been 0, and the period for the phase."""
        unit = np.where(self.sizes > 0.0, self.sizes, 1.0)
        if self.period is not None:
            unit[self.names.index(TIME.name)] = self.period
        return unit

    def numbers(self, place: PlaceOnSheet) -> SheetNumbers:
        """The slow flow at a place of a sheet."""
        return self.sheets[place.sheet].at(place.at, self.model.parameters)

    def apart(self, one: Array, other: Array) -> float:
        """Largest difference of two places, in sizes; the phase of a forcing modulo its period."""
        away = np.abs(one - other)
        if self.period is not None:
            k = self.names.index(TIME.name)
            away[k] = abs(math.remainder(away[k], self.period))
        return float((away / self.unit).max())

    def run(
        self, place: PlaceOnSheet, way: float, most: int = MOST_RUNS
    ) -> tuple[list[Trajectory], str]:
        """Follow the desingularised flow from a place, and say why it ends.

        Empty text if the flow has not ended after ``most`` runs.
        """
        sheet, here = self.sheets[place.sheet], self.numbers(place)
        speed = float((np.abs(here.flow) / self.unit).max())
        if not (speed > 0.0 and math.isfinite(speed)):
            return [], "equilibrium"
        model = sheet.over_time.with_parameters(
            {**dict(self.model.parameters), FLOW_UNIT.name: 1.0 / speed}
        )
        least = AT_FOLD * here.orientation
        stops = [
            f"{text} < {least if name == 'fold' else 0.0!r}" for name, text in sheet.stops().items()
        ]
        # |x| beyond every bound
        bounds = [
            f"{n}**2 > {(UNBOUNDED_ORBIT * size) ** 2!r}"
            for n, size in zip(self.model.states, self.unit.tolist(), strict=False)
        ]
        state, runs, length = np.append(place.at, 0.0), list[Trajectory](), FIRST_RUN
        for _ in range(most):
            # beyond the bounds a series overflows
            with np.errstate(over="ignore"):
                run = simulate(
                    model,
                    state,
                    t=(0.0, way * length),
                    stop=[*stops, *bounds],
                    integration=SINGULAR_RUNS,
                )
            runs.append(run)
            state = np.array([*run.final_state.values()])
            far = (np.abs(state[:-1]) > 0.5 * UNBOUNDED_ORBIT * self.unit).any()
            if far or not run.outcome:
                return runs, "unbounded"
            if run.outcome.code == "stopped":
                return runs, "stopped"
            moving = sheet.at(state[:-1], self.model.parameters)
            resting = (np.abs(moving.flow) / self.unit).max() < SLOW_FLOW_AT_REST * speed
            # near a fold the flow is slow on its way to a folded node
            if resting and moving.orientation > REST_ON_SHEET * here.orientation:
                return runs, "equilibrium"
            length *= 2.0
        return runs, ""

    def slow_piece(self, place: PlaceOnSheet) -> PlaceOnSheet:
        """Follow the slow flow to the end of a sheet, add the piece, and return its end."""
        runs, why = self.run(place, 1.0)
        before = self.numbers(place)
        rows = [np.append(place.at, 0.0)[None]]
        for run in runs:
            times = np.linspace(*run.span, PIECE_SAMPLES)[1:]
            path = run(times).T.copy()
            path[:, -1] += rows[-1][-1, -1] - run(run.span[0])[-1]
            rows.append(path)
        table = np.concatenate(rows)
        last = place._replace(at=table[-1, :-1])
        self.sizes = np.maximum(self.sizes, np.abs(table[:, :-1]).max(axis=0))
        end = self._ended(last, before, table[:, :-1]) if why == "stopped" else None
        end = end or last._replace(end=why or "not ended")
        duration = float(table[-1, -1])
        if end.end == "folded node":
            # what is left of an approach along the weak direction
            duration += self._remaining(end, self.numbers(last).orientation)
        table[-1, :-1] = end.at
        self._add("slow", end.sheet, end.end, table[:, -1], table[:, :-1], duration)
        return end

    def _remaining(self, end: PlaceOnSheet, orientation: float) -> float:
        node = self.folded(end)
        weak = abs(node.eigenvalues[1].real) if node is not None else math.nan
        return orientation / weak if weak else math.nan

    def _add(self, kind: str, sheet: str, end: str, t: Array, path: Array, duration: float) -> None:
        self.pieces.append(
            SingularPiece(
                type=kind,
                sheet=sheet,
                end=end,
                states=self.names,
                state=path[0].copy(),
                last=path[-1].copy(),
                duration=duration,
                parameters=NamedMapping("parameter", dict(self.model.parameters)),
                t=t,
                path=path,
            )
        )

    def _ended(self, last: PlaceOnSheet, before: SheetNumbers, path: Array) -> PlaceOnSheet:
        """Return the end of a piece that a stop has ended: a fold, interface or Hopf point."""
        sheet, here = self.sheets[last.sheet], self.numbers(last)
        ratios = {"fold": abs(here.orientation / before.orientation - AT_FOLD)}
        rows = path if sheet.walls else path[:0]
        heights = np.array([sheet.at(p, self.model.parameters).walls for p in rows])
        for k, name in enumerate(sheet.walls):
            reach = float(np.abs(heights[:, k]).max())
            ratios[name] = abs(float(here.walls[k])) / reach if reach else 0.0
        name = min(ratios, key=ratios.__getitem__)
        if ratios[name] > AT_FOLD:
            return last._replace(end="Hopf point")
        if name != "fold":
            return last._replace(end="interface", wall=name)
        place = self.nearest(last, on_fold=True)
        point = self.folded(place)
        if point is not None and point.funnel:
            return place._replace(end="folded node", at=self.place_of(point, place.at))
        if point is not None and math.isnan(point.ratio):
            return place._replace(end=point.words.split(":")[0])
        at = self.numbers(place)
        pushed = np.abs(at.flow / self.unit).max()
        resting = pushed <= AT_FOLDED_POINT * np.abs(before.flow / self.unit).max()
        return place._replace(end="canard point" if resting else "fold")

    def folded(self, place: PlaceOnSheet) -> FoldedPoint | None:
        """Return the folded singularity at a place."""
        near = [
            p
            for p in self.points
            if p.code
            and p.form.region == place.sheet
            and self.apart(self.place_of(p, place.at), place.at) < AT_FOLDED_POINT
        ]
        return near[0] if near else None

    def place_of(self, point: FoldedPoint, near: Array) -> Array:
        """Return a folded point as a place, in the period of another place."""
        at = np.array([point.values[n] for n in self.names])
        if self.period is not None:
            k = self.names.index(TIME.name)
            at[k] += self.period * round((near[k] - at[k]) / self.period)
        return at

    def nearest(self, place: PlaceOnSheet, *, on_fold: bool = False) -> PlaceOnSheet:
        """Return the nearest place on the sheet, or on its fold curve, by Newton's method."""
        at = place.at.copy()
        for _ in range(PLACE_NEWTON):
            here = self.numbers(place._replace(at=at))
            rows, known = here.jacobian * self.unit, here.f
            if on_fold:
                rows = np.vstack([rows, here.slope * self.unit])
                known = np.append(known, here.orientation)
            scale = np.abs(rows).max(axis=1)
            if not (np.isfinite(rows).all() and scale.all()):
                break
            step = np.linalg.lstsq(rows / scale[:, None], -known / scale, rcond=None)[0]
            at = at + step * self.unit
            if np.abs(step).max() <= 4.0 * np.finfo(float).eps:
                break
        return place._replace(at=at)

    def jump(self, start: Array, y: Array, rate: float, left: Array | None = None) -> PlaceOnSheet:
        """Follow the frozen fast flow from x to a sheet, add the jump, and return the landing.

        Parameters
        ----------
        start : ndarray, shape (n,)
        y : ndarray, shape (m,)
        rate : float
            Of the first motion, in 1/time.
        left : ndarray, shape (n + m,), optional
            The fold or corner beside which the jump starts, its first row.
        """
        frozen = self.frozen(y)
        x, length, path = start, 10.0 / rate, [np.append(start, y)]
        if left is not None:
            path.insert(0, left)
        landed: PlaceOnSheet | None = self.landing(x, y)
        why = "no landing"
        for count in range(0 if landed is not None else MOST_JUMP_RUNS):
            with np.errstate(over="ignore"):
                run = simulate(frozen, x, t=(0.0, length), integration=SINGULAR_RUNS)
                rows = run(np.linspace(*run.span, PIECE_SAMPLES)[1:]).T
            path += [np.append(row, y) for row in rows]
            x = np.array([*run.final_state.values()])
            far = not (np.abs(x) < UNBOUNDED_ORBIT * self.unit[: len(x)]).all()
            if far or not run.outcome:
                why = "unbounded jump" if far else "no landing"
                break
            self.sizes[: len(x)] = np.maximum(self.sizes[: len(x)], np.abs(rows).max(axis=0))
            landed = self.landing(x, y)
            if landed is not None:
                break
            length = self._settling(x, y) if count == 0 else 2.0 * length
        table = np.array([*path, landed.at if landed is not None else path[-1]])
        end = "lands" if landed is not None else why
        sheet = landed.sheet if landed is not None else ""
        self._add("jump", sheet, end, np.zeros(len(table)), table, 0.0)
        return landed._replace(end=end) if landed is not None else PlaceOnSheet("", table[-1], why)

    def _settling(self, x: Array, y: Array) -> float:
        """A time in which the fast flow settles, by the eigenvalues of f_x where it has arrived."""
        place = np.append(x, y)
        inner = [sheet.at(place, self.model.parameters).inner for sheet in self.sheets.values()]
        sizes = [np.abs(np.linalg.eigvals(one)).max() for one in inner if np.isfinite(one).all()]
        return SETTLING / max([s for s in sizes if s > 0.0], default=1.0)

    def frozen(self, y: Array) -> Model:
        """Return the fast subsystem at the slow variables."""
        values = dict(zip(self.slow, y.tolist(), strict=True))
        frozen = self.model.frozen()
        known = {real(n): v for n, v in (*self.model.parameters.items(), *values.items())}
        for name, law in self.model.forcing.items():
            values[name] = float(exact(law).xreplace(known))
        return frozen.with_parameters({n: v for n, v in values.items() if n in frozen.free})

    def landing(self, x: Array, y: Array) -> PlaceOnSheet | None:
        """Return the attracting sheet at x, None if there is none."""
        for name in self.sheets:
            place = self.on_sheet(PlaceOnSheet(name, np.append(x, y)))
            if place is None:
                continue
            away = np.abs(place.at - np.append(x, y)) / self.unit
            here = self.numbers(place)
            inside = all(h >= -1e-9 * (abs(h) + 1.0) for h in here.walls)
            if away.max() <= LANDED_STEP and inside and here.attracting:
                return place
        return None

    def on_sheet(self, place: PlaceOnSheet) -> PlaceOnSheet | None:
        """Return the place on a sheet at the same slow variables, by Newton's method."""
        at, n = place.at.copy(), len(self.model.states)
        for _ in range(PLACE_NEWTON):
            here = self.numbers(place._replace(at=at))
            if not (np.isfinite(here.inner).all() and np.isfinite(here.f).all()):
                return None
            try:
                step = -np.linalg.solve(here.inner, here.f)
            except np.linalg.LinAlgError:
                return None
            at[:n] += step
            if (np.abs(step) <= 8.0 * np.finfo(float).eps * self.unit[:n]).all():
                return place._replace(at=at)
        return None

    def off_fold(self, place: PlaceOnSheet) -> tuple[Array, float] | None:
        """Return the start of the jump from a fold, on its center manifold, and its rate.

        None if the fold is not quadratic.
        """
        n, here = len(self.model.states), self.numbers(place)
        unit = self.unit[:n]
        inner = here.inner * unit
        scale = np.abs(inner).max(axis=1)
        left, _, right = np.linalg.svd(inner / np.where(scale > 0.0, scale, 1.0)[:, None])
        phi, psi = right[-1], left[:, -1] / np.where(scale > 0.0, scale, 1.0)
        psi = psi / (psi @ (phi * unit))
        bent = self.sheets[place.sheet].bending(place.at, self.model.parameters)
        curved = np.einsum("ijk,j,k->i", bent, phi * unit, phi * unit)
        push = float(psi @ curved)
        side = math.copysign(SINGULAR_JUMP, push)
        border = np.block([[inner, phi[:, None]], [phi[None], np.zeros((1, 1))]])
        bow = np.linalg.lstsq(border, np.append(-curved, 0.0), rcond=None)[0][:n]
        start = place.at[:n] + (side * phi + 0.5 * side**2 * bow) * unit
        moved = self.numbers(place._replace(at=np.append(start, place.at[n:])))
        speed, expected = float(psi @ moved.f), 0.5 * push * side**2
        if not abs(speed - expected) < 0.5 * abs(expected):
            return None
        return start, self.rate(np.append(start, place.at[n:]))

    def rate(self, place: Array, reach: float = SINGULAR_JUMP) -> float:
        """Rate of a first motion at a distance from its start, in 1/time."""
        n, rates = len(self.model.states), []
        for sheet in self.sheets.values():
            here = sheet.at(place, self.model.parameters)
            if not sheet.sliding and np.isfinite(here.f).all() and (here.walls >= 0.0).all():
                rates.append(float((np.abs(here.f) / self.unit[:n]).max()) / reach)
        return max(rates, default=0.0) or 1.0

    def beyond(self, place: PlaceOnSheet) -> tuple[PlaceOnSheet | None, Array]:
        """Return the sheet on which the slow flow continues at an interface, or a jump's start.

        The start is given as (x, y): y is moved across an interface between slow variables alone.
        """
        n = len(self.model.states)
        sheet = self.sheets[place.sheet]
        if sheet.sliding:
            return self._entered(PlaceOnSheet(place.wall, place.at))
        other = across(self.model, place.sheet, place.wall)
        if other is None:
            return None, place.at
        if self.model.continuous[place.wall]:
            return self._entered(PlaceOnSheet(other, place.at), place.wall)
        here = self.sheets[other].at(place.at, self.model.parameters)
        gradient = self._gradient(self.sheets[other], place.wall, place.at)
        if not gradient[:n].any():
            across_wall = gradient[n:] * self.unit[n:]
            moved = place.at.copy()
            moved[n:] += BEYOND_SLOW_WALL * across_wall / np.abs(across_wall).max() * self.unit[n:]
            return None, moved
        if gradient[:n] @ here.f > 0.0:
            away = SINGULAR_JUMP * here.f / np.abs(here.f / self.unit[:n]).max()
            return None, place.at + np.append(away, np.zeros(len(place.at) - n))
        for name in (f"{place.sheet}|{other}", f"{other}|{place.sheet}"):
            if name in self.sheets:
                on = self.on_sheet(PlaceOnSheet(name, place.at))
                if on is not None and self.numbers(on).attracting:
                    return on._replace(end="sliding"), place.at
        return None, place.at

    def _entered(self, place: PlaceOnSheet, wall: str = "") -> tuple[PlaceOnSheet | None, Array]:
        """Return the sheet of a region in which the slow flow leaves an interface, or a jump."""
        n, here = len(self.model.states), self.numbers(place)
        sheet = self.sheets[place.sheet]
        walls = [wall] if wall else list(sheet.walls)
        nearest = min(walls, key=lambda w: abs(here.walls[list(sheet.walls).index(w)]))
        gradient = self._gradient(sheet, nearest, place.at)
        if here.attracting and gradient @ here.flow > 0.0:
            return place._replace(end="corner"), place.at
        values, vectors = np.linalg.eig(here.inner)
        k = int(np.argmax(values.real))
        away = vectors[:, k].real
        away = away * math.copysign(1.0, float(gradient[:n] @ away) or 1.0)
        away = SINGULAR_JUMP * away / np.abs(away / self.unit[:n]).max()
        return None, place.at + np.append(away, np.zeros(len(place.at) - n))

    def _gradient(self, sheet: SheetFlow, wall: str, at: Array) -> Array:
        """Gradient of the function of an interface, positive on a sheet's side."""
        k = list(sheet.walls).index(wall)
        rows = []
        for j in range(len(at)):
            step = np.zeros(len(at))
            step[j] = 1e-6 * self.unit[j]
            ends = [sheet.at(at + s * step, self.model.parameters).walls[k] for s in (1, -1)]
            rows.append((ends[0] - ends[1]) / (2.0 * step[j]))
        return np.array(rows)

    def words(self, at: Array) -> str:
        """A place as text."""
        return ", ".join(f"{n} = {v:.6g}" for n, v in zip(self.names, at, strict=True))
