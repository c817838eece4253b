"""Critical rates of a ramp that does not settle: canards of a folded saddle."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fastslow.arguments import StateLike
from fastslow.diagrams.trace.tracing import continue_equilibria
from fastslow.errors import ArgumentError
from fastslow.model.model import Model
from fastslow.passage.tipping.landings import Constraint, Landed, landed
from fastslow.passage.tipping.moving_equilibria import MovingEquilibrium
from fastslow.passage.tipping.ramp_landings import SheetLanding, SlowFlowLanding
from fastslow.passage.tipping.ramps import Ramp, ramp_of
from fastslow.passage.tipping.tracked_branches import stable_start
from fastslow.results.base.named_mapping import NamedMapping
from fastslow.results.base.outcome import Outcome
from fastslow.results.orbits.folded_canards import FoldedCanard
from fastslow.results.points import Equilibrium
from fastslow.results.tipping import CriticalRate, RateThreshold
from fastslow.results.trajectory.trajectory import Trajectory
from fastslow.simulation.one import simulate
from fastslow.simulation.settings import Integration

Array = NDArray[np.float64]

#: Error control of the runs by which critical rates of ramps are bracketed.
RAMPING = Integration(rtol=1e-11)

#: Words of both ends.
TRACKS, TIPS = "tracks", "tips over the fold"

#: Relaxation times of the start during which a run may reach the fold.
LONGEST_RAMP = 1000.0

#: Logarithm of the growth beyond the folded saddle after which runs are compared with the sheet,
#: and multiples of the time until then at which they are if there is none before.
GROWTH_COMPARED, LATER_COMPARED = 8.0, (1.0, 1.5, 2.0, 3.0, 4.0, 6.0, 8.0, 12.0, 16.0)

#: Bisections of a bracket of rates at most.
RAMP_BISECTIONS = 50

#: Logarithms of the growth at the first length of a run to which Newton's method is applied.
GROWTH_LANDED = (3.0, 5.0, 8.0)

#: Correction of the repelling slow manifold up to which a run is compared with it, in units of the
#: distance of the sheet from the fold.
SHEET_IS_SLOW = 0.1

#: Samples of a run on the side of the fold where the repelling sheet is that are compared with it,
#: in order of time, and at which it first reaches a height.
PAST_COMPARED = 12

#: Samples of a canard on each side, and of a piece of the slow flow.
RAMP_SAMPLES = 201

#: Growth times of the folded saddle during which the slow flow may reach it, and the distance from
#: it, in units of the nearest one, at which it has passed.
SLOW_PASSAGES, SLOW_DEPARTED = 60, 1.5

#: Factor by which the rate changes until the slow flow passes on the other side, and how often.
SLOW_CHANGE, SLOW_CHANGES = 0.97, 40


def critical_rates_of_ramp(
    model: Model,
    rate: str,
    over: tuple[float, float],
    rates: Array,
    branch: Equilibrium | StateLike | None,
) -> CriticalRate:
    """Return the critical rates of a ramp among rates at which runs are made; see critical_rate."""
    ramp = ramp_of(model, rate, next(iter(model.regions)))
    name = ramp.names[2]
    full = model.frozen(fast=model.slow_states)
    start = stable_start(full, name, _beginning(ramp), branch, "branch")
    if start.region not in model.regions:
        raise ArgumentError(
            f"branch: the start {start!r} slides along an interface; expected one within a region"
        )
    ramp = Ramp(model, start.region)
    origin = MovingEquilibrium(full, name, start.region, start.state)
    search = _RampSearch(ramp, rate, origin, start)
    saddles = search.saddles(rates)
    tips = np.array([search.tips(v, s) for v, s in zip(rates.tolist(), saddles, strict=True)])
    found = []
    for k in np.flatnonzero(tips[1:] != tips[:-1]).tolist():
        near = saddles[k] if saddles[k + 1] is None else saddles[k + 1]
        found.append(search.threshold((rates[k], rates[k + 1]), near, bool(tips[k])))
    words = np.where(tips, TIPS, TRACKS)
    first = _beginning(ramp)
    passed = [first, *(float(s[2]) for s in saddles if s is not None)]
    speed = ramp.at(np.zeros(3), dict(model.parameters)).speed
    return CriticalRate(
        parameter=rate,
        quantity=name,
        over=over,
        thresholds=tuple(found),
        rates=rates,
        ends=words,
        limits=(first, math.copysign(math.inf, speed)),
        origin=start,
        target=None,
        edges=(),
        overshoot=False,
        diagram=continue_equilibria(full, name, over=(min(passed), max(passed))),
        outcome=_outcome(found, words),
    )


def _beginning(ramp: Ramp) -> float:
    return ramp.at(np.zeros(3), dict(ramp.model.parameters)).begin


def _outcome(found: list[RateThreshold], words: NDArray[np.str_]) -> Outcome:
    runs, count = f"the ends of the runs at {len(words)} rates", len(found)
    if count:
        head = "one critical rate separates" if count == 1 else f"{count} critical rates separate"
        doubtful = sum(one.canard is None for one in found)
        tail = ""
        if doubtful:
            tail = (
                f"; {doubtful} by bisection alone: no run was found that follows the repelling "
                "sheet, as where the ratio of the rates is not small, and runs that tip may not be "
                "told from others there"
            )
        return Outcome("critical rates", f"{head} {runs}{tail}.", not doubtful)
    return Outcome(
        "no change",
        f"no critical rate in this range: all runs end alike, {words[0]}; expected a range with "
        "lower and higher rates.",
        True,
    )


@dataclass(frozen=True, eq=False)
class _RampSearch:
    """Runs of a ramp, compared with the repelling sheet beyond its folded saddle.

    Parameters
    ----------
    ramp : Ramp
    rate : str
    origin : MovingEquilibrium
    start : Equilibrium
    """

    ramp: Ramp
    rate: str
    origin: MovingEquilibrium
    start: Equilibrium

    @cached_property
    def longest(self) -> float:
        """Time during which a run may reach the fold."""
        decay = -self.start.eigenvalues.real
        return LONGEST_RAMP / float(decay[np.isfinite(decay)].min())

    def values(self, rate: float) -> dict[str, float]:
        return {**self.ramp.model.parameters, self.rate: rate}

    def saddles(self, rates: Array) -> list[Array | None]:
        """The folded saddle at each rate, None where there is none.

        It is found from the places at which runs reach the fold, and continued over the rate.
        """
        found: list[Array | None] = [None] * len(rates)
        for first in range(len(rates) - 1, -1, -1):
            place = self.reached_fold(float(rates[first]))
            near = None if place is None else self.saddle(float(rates[first]), place)
            if near is None:
                continue
            found[first] = near
            for way in (-1, 1):
                k, last = first + way, near
                while (
                    0 <= k < len(rates) and (one := self.saddle(float(rates[k]), last)) is not None
                ):
                    found[k] = last = one
                    k += way
            return found
        name, law = self.ramp.names[2], next(iter(self.ramp.model.forcing.values()))
        raise ArgumentError(
            f"the ramp {name} = {law} does not settle, and no folded saddle was found from the "
            f"runs at {len(rates)} rates, {self.rate} in [{rates[0]:g}, {rates[-1]:g}]: expected a "
            "range of rates in which runs reach the fold of the fast state near one"
        )

    def saddle(self, rate: float, near: Array) -> Array | None:
        place = self.ramp.folded(near, self.values(rate))
        if place is None or not self.ramp.at(place, self.values(rate)).is_saddle:
            return None
        return place

    def reached_fold(self, rate: float) -> Array | None:
        """Where the run at a rate reaches the fold, None if it does not."""
        model = self.ramp.model.with_parameters({self.rate: rate})
        fold = self.ramp.fold
        if not {s.name for s in fold.free_symbols} & set(self.ramp.names):
            return None
        run = simulate(
            model, self.start.state, t=(0.0, self.longest), stop=fold, integration=RAMPING
        )
        return self._end_of(run) if run.outcome.code == "stopped" else None

    @staticmethod
    def _end_of(run: Trajectory) -> Array:
        """The fast state, the slow state and the slow quantity at the end of a run."""
        return np.array([one[-1] for one in run.dense_columns(np.array([run.span[1]]))])

    def landing(self, saddle: Array) -> SheetLanding:
        return SheetLanding(self.ramp, (self.rate,), self.origin, saddle)

    def tips(self, rate: float, saddle: Array | None) -> bool:
        """Whether a run passes beyond the repelling sheet, or the fold before it."""
        if saddle is None:
            return self.reached_fold(rate) is not None
        landing, values = self.landing(saddle), self.values(rate)
        time, _ = landing.passage(np.array([rate]))
        if not time > 0.0:
            return False
        model, tips = self.ramp.model.with_parameters({self.rate: rate}), True
        (end,) = landing.ends(np.array([rate]), [GROWTH_COMPARED])
        for multiple in LATER_COMPARED:
            last = time + multiple * (end - time)
            run = simulate(model, self.start.state, t=(0.0, last), integration=RAMPING)
            if not run.outcome or self._has_jumped(run, saddle, values):
                return True
            # beyond the fold there is no sheet, though a run may return before it has jumped
            beyond = self._beyond(self._end_of(run), saddle, values)
            if beyond is None:
                continue
            tips = beyond[0] > 0.0
            if beyond[1] < SHEET_IS_SLOW:
                break
        return tips

    def _has_jumped(self, run: Trajectory, saddle: Array, values: dict[str, float]) -> bool:
        """Whether a run was beyond the repelling sheet, even if it has come back."""
        # a jump and the return from it may be far shorter than the run: its steps resolve them
        times = np.union1d(np.linspace(*run.span, RAMP_SAMPLES), run.t)
        path = np.column_stack([*run.dense_columns(times)])
        past = (path[:, 0] - saddle[0]) * self.ramp.at(saddle, values).bends[0]
        later = np.flatnonzero(past > 0.0)
        heights = past.max() * np.arange(1, PAST_COMPARED + 1) / PAST_COMPARED
        first = np.argmax(past[:, None] >= heights, axis=0)
        chosen = np.union1d(later[:: max(1, len(later) // PAST_COMPARED)], first)
        found = (self._beyond(path[k], saddle, values) for k in chosen.tolist() if past[k] > 0.0)
        return any(one is not None and one[0] > 1.0 and one[1] < SHEET_IS_SLOW for one in found)

    def _beyond(
        self, place: Array, saddle: Array, values: dict[str, float]
    ) -> tuple[float, float] | None:
        """Distance beyond the repelling slow manifold, and its correction, in units of the sheet.

        The unit is the distance of the repelling sheet from the fold. None if there is no sheet.
        """
        sheet = self.ramp.repelling(np.array([saddle[0], *place[1:]]), values)
        if sheet is None:
            return None
        late = self.ramp.at(sheet[0], values).late
        return float((place[0] - sheet[0][0] - late) / sheet[1]), abs(late / sheet[1])

    def threshold(
        self, between: tuple[float, float], saddle: Array | None, below: bool
    ) -> RateThreshold:
        """The critical rate between two rates whose runs end differently."""
        low, high = between
        for _ in range(RAMP_BISECTIONS):
            middle = 0.5 * (low + high)
            near = None if saddle is None else self.saddle(middle, saddle)
            if near is not None:
                saddle, landing = near, self.landing(near)
                for end in landing.ends(np.array([middle]), GROWTH_LANDED):
                    constraint = Constraint.of_one(middle, low, high)
                    found = landed(landing, np.array([middle]), end, constraint)
                    if found is not None:
                        return self._made(landing, found, below)
            if self.tips(middle, near) == below:
                low = middle
            else:
                high = middle
        return self._bisected(low, high, below, saddle)

    def _made(self, landing: SheetLanding, found: Landed, below: bool) -> RateThreshold:
        landing = landing.moved(found.unknowns) or landing
        rate, run = float(found.unknowns[0]), found.residual.run
        (begun,) = landing.ends(found.unknowns, GROWTH_LANDED[:1])
        self._require_one_region(run, rate, begun)
        values = self.values(rate)
        time, _ = landing.passage(found.unknowns)
        times = np.linspace(time, found.end, RAMP_SAMPLES)
        path = np.column_stack([*run.dense_columns(times)])
        growth = [max(float(self.ramp.at(place, values).slopes[0]), 0.0) for place in path]
        before = np.column_stack([*run.dense_columns(np.linspace(0.0, time, RAMP_SAMPLES))])
        canard = FoldedCanard(
            type="saddle",
            states=self.ramp.names,
            state=path[0],
            parameters=NamedMapping("parameter", values),
            path=np.vstack([before, path[1:]]),
            residual=abs(found.residual.value),
        )
        return self._between(
            *(rate, below, run),
            method="canard",
            start_error=0.0,
            end_error=found.change,
            expansion=abs(float(found.residual.slopes[0])),
            canard=canard,
            contraction=float(np.trapezoid(growth, times)),
            limit=self.limit(landing, rate),
            source=(landing, found),
        )

    def _require_one_region(self, run: Trajectory, rate: float, until: float) -> None:
        first = next((one for one in run.crossings if one.time < until), None)
        if first is not None:
            raise ArgumentError(
                f"the run at {self.rate} = {rate:.6g} crosses {first.interface} at t = "
                f"{first.time:.6g}; expected a canard within one region"
            )

    def _bisected(
        self, low: float, high: float, below: bool, saddle: Array | None
    ) -> RateThreshold:
        rate = 0.5 * (low + high)
        model = self.ramp.model.with_parameters({self.rate: rate})
        end, stop = self.longest, [self.ramp.fold]
        if saddle is not None:
            (end,), stop = self.landing(saddle).ends(np.array([rate]), [GROWTH_COMPARED]), []
        run = simulate(model, self.start.state, t=(0.0, end), stop=stop)
        self._require_one_region(run, rate, end)
        unknown = dict.fromkeys(("start_error", "end_error", "expansion"), np.nan)
        return self._between(rate, below, run, method="bisection", **unknown)

    def _between(self, rate: float, below: bool, run: Trajectory, **known: Any) -> RateThreshold:
        """The threshold at a rate, below which runs tip or above which they do."""
        lower, upper = (TIPS, TRACKS) if below else (TRACKS, TIPS)
        return RateThreshold(
            parameter=self.rate,
            rate=rate,
            below=lower,
            above=upper,
            edge=None,
            run=run,
            parameters=self.values(rate),
            **known,
        )

    def limit(self, landing: SheetLanding, rate: float) -> float:
        """The critical rate of the slow flow, NaN if it is not found."""
        below, above = rate, rate
        side = self._slow_side(landing, rate)
        for _ in range(SLOW_CHANGES):
            below, above = below * SLOW_CHANGE, above / SLOW_CHANGE
            for outer, inner in ((below, below / SLOW_CHANGE), (above, above * SLOW_CHANGE)):
                other = self._slow_side(landing, outer)
                if other is None or side is None or other[0] == side[0]:
                    continue
                bracket = Constraint.of_one(inner, *sorted((inner, outer)))
                for guess, end in ((inner, side[1]), (outer, other[1])):
                    moved = landing.moved(np.array([guess])) or landing
                    found = landed(SlowFlowLanding(moved), np.array([guess]), end, bracket)
                    if found is not None:
                        return float(found.unknowns[0])
        return math.nan

    def _slow_side(self, landing: SheetLanding, rate: float) -> tuple[bool, float] | None:
        """Side on which the slow flow passes the folded saddle, and when it is nearest to it."""
        unknowns = np.array([rate])
        moved = landing.moved(unknowns)
        if moved is None:
            return None
        flow = SlowFlowLanding(moved)
        begun, target = flow.start(unknowns), flow.target(unknowns, 0.0, np.empty(3))
        if begun is None or target is None:
            return None
        size = np.abs(begun[0] - target.state)
        size = np.where(size > 0.0, size, 1.0)
        model, state = flow.model(unknowns), begun[0]
        nearest, time, side = np.inf, 0.0, False
        for k in range(SLOW_PASSAGES):
            run = simulate(model, state, t=(0.0, 1.0 / target.growth), integration=RAMPING)
            times = np.linspace(0.0, run.span[1], RAMP_SAMPLES)
            apart = run(times).T - target.state
            away = np.abs(apart / size).max(axis=1)
            row = int(np.argmin(away))
            if away[row] < nearest:
                nearest, time = float(away[row]), k / target.growth + float(times[row])
                side = bool(target.adjoint @ apart[row] > 0.0)
            if not run.outcome or away[-1] > SLOW_DEPARTED * nearest:
                break
            state = run.end[1:4]
        return side, time
