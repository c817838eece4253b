"""The trace of a branch of periodic orbits in one direction, stretch by stretch."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from fastslow.continuation import curves
from fastslow.continuation.settings import Continuation
from fastslow.orbits.endings import (
    HOPF_POINT,
    NOT_CONFIRMED,
    NOT_SOLVED,
    PERIOD_DOUBLING,
    RETRACED,
)
from fastslow.orbits.ends.homoclinic import InfinitePeriod
from fastslow.orbits.find.orbit_curve import CurveSystem, OrbitCurve, Row, completed
from fastslow.orbits.flow.problem import ORBIT_SOLVED
from fastslow.orbits.flow.segments import SEGMENT_GROWTH, SHORT_SEGMENT
from fastslow.orbits.flow.shooting import Shooting
from fastslow.orbits.trace.beyond_contacts import AFTER_CONTACT
from fastslow.orbits.trace.bifurcation_rows import halved
from fastslow.orbits.trace.branch_ends import ended, place, two_fold, unbounded
from fastslow.orbits.trace.itinerary_changes import ItineraryChange
from fastslow.orbits.trace.restarts import NEAR_START, renewed
from fastslow.orbits.trace.retracing import Retracing
from fastslow.orbits.trace.vanishing_cycles import is_passed, is_point, vanished
from fastslow.results.base.outcome import Outcome
from fastslow.results.trajectory.trajectory import Trajectory

Array = NDArray[np.float64]

#: Largest distance of an orbit from its prediction, as a fraction of the step.
PREDICTION_ERROR = 0.3

#: Growth of the period or of the range of a state from which its unit is renewed.
LARGER = 1.5

#: Growth along a segment from which nodes are inserted anew in a branch of orbits that slide:
#: beside a two-fold nodes do not reduce it.
SLIDING = 100.0 * SEGMENT_GROWTH

#: How far on the way from the last cycle to a Hopf point a smaller one is computed.
APPROACH = 0.65


@dataclass(eq=False)
class Tracer:
    """The trace of a branch in one direction, row by row."""

    curve: OrbitCurve
    settings: Continuation
    #: Rows of the other direction, in order along the branch.
    before: Sequence[Row] = ()
    rows: list[Row] = field(default_factory=list)
    outcome: Outcome = field(init=False)
    closed: bool = False
    #: Why the last stretch was stopped: a bad row, or a row from which to start anew, with other
    #: segments or units.
    bad: Array | None = None
    #: Largest residual or correction of that row.
    unsolved: float = 0.0
    renew: bool = False
    rescale: bool = False
    #: Growth along a segment from which nodes are inserted, and whether they were at the last row.
    limit: float = SEGMENT_GROWTH
    divided: bool = False
    #: Whether the branch ended at an equilibrium, at an infinite period or where it is halved.
    ended: bool = False
    #: Units of the states and the period of this stretch.
    units: Array = field(default_factory=lambda: np.empty(0))
    retracing: Retracing = field(init=False)

    def trace(self, first: Row, along: Array) -> None:
        """Trace from a row along a tangent."""
        self.rows = [replace(first, slope=float(along[-1]))]
        self.retracing = Retracing(self.curve, self.settings, self.before)
        known = self.curve.problem
        excluded = known.forcing or known.variations.jumps.switches
        infinite = None if excluded else InfinitePeriod(self.curve)
        step = self.settings.step
        shooting, u = first.shooting, first.u
        while True:
            self.bad, self.renew, self.rescale = None, False, False
            self.units = self.units_of(self.rows[-1])
            # the states of a single node have no ranges
            alone = known.forcing is None and len(shooting.form) == 1
            if alone or (infinite is not None and shooting.winding.any()):
                shooting, along = self.with_ranges(shooting, u, along)
            system = CurveSystem(shooting)
            left = self.settings.max_points - len(self.rows)
            if left < 2:
                self.outcome = self.ending(curves.FULL)
                return
            settings = replace(self.settings, step=step, max_points=left)
            frame = self.curve.frame(shooting, u, self.rows[-1].arrays)
            along = along / np.sqrt(along**2 @ frame.weight)
            z, tangents, status = curves.follow(
                *(system, u, along, frame, settings),
                stop=partial(self.judged, system, infinite),
                aside=PREDICTION_ERROR,
            )
            if status == curves.RANGE and system.point is not None:
                self.judged(system, None, z[-1])
            self.complete(tangents[:, -1])
            if self.ended:
                return
            if self.bad is not None:
                change = ItineraryChange(self.curve, self.settings, self.rows)
                after = change.across(shooting, z, tangents, frame, self.bad)
                if isinstance(after, Outcome):
                    self.outcome = after
                    if after.code == NOT_CONFIRMED.code:
                        if self.unsolved > ORBIT_SOLVED:
                            where = place(self.curve, self.rows[-1].value, 10)
                            numbers = {"size": self.unsolved, "largest": ORBIT_SOLVED}
                            self.outcome = NOT_SOLVED.at(where=where, **numbers)
                        self.doubt(infinite)
                    return
                shooting, u, along = after
                step = max(AFTER_CONTACT, self.settings.min_step)
                continue
            if self.renew or self.rescale:
                ahead = shooting, z[-1], tangents[-1]
                if self.renew:
                    moved = renewed(self.curve, self.rows[-1], ahead)
                    if isinstance(moved, Outcome):
                        self.outcome = moved
                        self.doubt(infinite)
                        return
                    self.rows[-1], (shooting, u, along) = moved
                else:
                    shooting, u, along = ahead
                if self.rescale:
                    frame = self.curve.frame(*ahead[:2], self.run)
                gap = (z[-1] - z[-2])[: frame.size]
                step = float(np.sqrt((gap**2) @ frame.weight[: frame.size]))
                step = min(max(step, self.settings.min_step), self.settings.max_step)
                continue
            self.closed = status == curves.CLOSED
            self.outcome = self.ending(status)
            if not self.outcome:
                self.doubt(infinite)
            return

    def ending(self, status: str) -> Outcome:
        """The outcome of a stretch that ends with a status of `curves`."""
        return ended(status, self.curve, self.rows[-1], len(self.rows), self.settings)

    def doubt(self, infinite: InfinitePeriod | None) -> None:
        """Set the outcome of a trace that fails close to a saddle."""
        if infinite is not None and infinite.candidate is not None:
            self.outcome = infinite.candidate

    @property
    def run(self) -> Trajectory:
        """The trajectory of the last row."""
        return self.rows[-1].orbit.trajectory

    def judged(self, system: CurveSystem, infinite: InfinitePeriod | None, _: Array) -> bool:
        """Add the last point as a row; return True if the stretch ends there."""
        shooting, point = system.shooting, system.point
        assert point is not None
        row = self.curve.confirmed(shooting, point)
        if row is None:
            self.bad, self.unsolved = point.u, max(point.residual, point.accuracy)
            return True
        self.ended = self.ends(row)
        if self.ended:
            if self.outcome.code == HOPF_POINT.code:
                self.approach(system, row)
            return True
        self.rows.append(row)
        escaped = unbounded(self.curve, self.rows)
        if escaped is not None:
            self.outcome = escaped
        if escaped is not None or self.retraced():
            self.ended = True
            return True
        found = None if infinite is None else infinite.end(self.rows)
        if found is not None:
            self.outcome, self.ended = found.outcome, True
            self.rows += [] if found.row is None else [found.row]
            return True
        whole = shooting.unpack(point.u)[0].without_nodes()
        begin, end = whole.durations[0], whole.durations[-1]
        near = min(begin, end) < NEAR_START * (begin + end)
        near |= begin + end < 0.5 * SHORT_SEGMENT * whole.durations.max()
        least = SLIDING if shooting.slides else SEGMENT_GROWTH
        divide = point.growth > max(self.limit, least)
        if divide and self.divided:
            # nodes do not reduce it, as in a segment along which a state hardly changes
            self.limit, divide = LARGER * point.growth, False
        elif point.growth <= least:
            self.limit = least
        self.divided = divide
        folded = two_fold(self.curve, shooting, row) if divide else None
        if folded is not None:
            self.outcome, self.ended = folded, True
            return True
        self.renew = bool(len(whole) > 1 and near) or divide
        if infinite is not None:
            self.rescale = bool((self.units_of(row) > LARGER * self.units).any())
        return self.renew or self.rescale

    def retraced(self) -> bool:
        """Check whether the last rows repeat earlier ones; then remove them, set the outcome."""
        first = self.retracing.first_repeated(self.rows)
        if first is None:
            return False
        del self.rows[first:]
        self.outcome = RETRACED.at(where=place(self.curve, self.rows[-1].value, 10))
        return True

    def with_ranges(self, shooting: Shooting, u: Array, along: Array) -> tuple[Shooting, Array]:
        """The equations with the ranges of the last orbit in the phase condition; the tangent."""
        shooting = replace(shooting, ranges=self.units[:-1])
        frame = self.curve.frame(shooting, u, self.rows[-1].arrays)
        turned = curves.tangent(CurveSystem(shooting), u, frame)
        return shooting, turned if (turned * frame.weight) @ along >= 0 else -turned

    def units_of(self, row: Row) -> Array:
        """The units of the states and the period."""
        return np.append(row.sizes, row.arrays.period)

    def ends(self, row: Row) -> bool:
        """Check whether the branch ends before an orbit; then set the outcome."""
        if self.curve.problem.forcing is None:
            met = is_point(self.rows, row)
            if not met and is_passed(self.rows, row):
                del self.rows[-1]
                met = True
            if met:
                self.outcome = vanished(self.curve, self.rows)
                return True
        last = halved(self.curve, self.rows[-1], row)
        if last is None:
            return False
        self.rows.append(last)
        self.outcome = PERIOD_DOUBLING.at(where=place(self.curve, last.value, 10))
        return True

    def approach(self, system: CurveSystem, beyond: Row) -> None:
        """Add a smaller cycle before a Hopf point, between the last one and one beyond it."""
        last, shooting = self.rows[-1], beyond.shooting
        if len(last.u) != len(beyond.u):
            return
        sizes = [one.sizes.max() for one in (last, beyond)]
        gap = beyond.u - last.u
        frame = self.curve.frame(shooting, last.u, last.arrays)
        share = APPROACH * sizes[0] / (sizes[0] + sizes[1])
        along = gap / np.sqrt(gap**2 @ frame.weight)
        system.solved(last.u + share * gap, along, frame, self.settings)
        row = None if system.point is None else self.curve.confirmed(shooting, system.point)
        if row is not None and row.sizes.max() < sizes[0]:
            self.rows += completed([row], [last.slope])

    def complete(self, slopes: Array) -> None:
        """Complete the rows of a stretch: components of the tangents along the parameter."""
        places = [k for k, row in enumerate(self.rows) if row.solved is not None]
        known = slopes[1 : 1 + len(places)].tolist()
        for k, row in zip(places, completed([self.rows[k] for k in places], known), strict=True):
            self.rows[k] = row
