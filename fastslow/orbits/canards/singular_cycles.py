"""Singular cycles: slow pieces and jumps, and their return to the funnel of a folded node."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fastslow.arguments import Name, StateLike, formula, instance, interval, validated
from fastslow.errors import (
    ArgumentError,
    refuse_events,
    refuse_resets,
    refuse_switches,
    unknown_name,
)
from fastslow.model.model import Model
from fastslow.model.structure import TIME
from fastslow.orbits.canards.endings import (
    CLOSED,
    DEAD_ENDS,
    NOT_CLOSED,
    NOT_ON_CANARD,
    ON_CANARD,
    PASSED_CANARD,
    THROUGH_NODE,
)
from fastslow.orbits.canards.slow_pieces import CLOSED_CYCLE, PlaceOnSheet, SingularFlow
from fastslow.orbits.canards.strong_canards import StrongCanard
from fastslow.results.base.outcome import Outcome, with_notes
from fastslow.results.orbits.singular import SingularCycle, SingularPiece
from fastslow.simulation.arguments import initial_state, require_values
from fastslow.symbolic.folded_points import FoldedPoint
from fastslow.symbolic.sheet_flows import SheetFlow, flows_of_sheets
from fastslow.symbolic.slow_flows import slow_flow

Array = NDArray[np.float64]

#: Most pieces that are followed.
MOST_SINGULAR_PIECES = 400

#: Values of the parameter at which a change of sign is looked for.
FUNNEL_SAMPLES = 9

#: Distance at which a return is on the strong canard, in ranges of the slow variables, and the
#: relative error of the parameter there.
ON_STRONG_CANARD, BRENT = 1e-9, 4.0 * float(np.finfo(float).eps)


@dataclass(eq=False)
class SingularOrbit:
    """A singular orbit from a start until it closes or ends.

    Parameters
    ----------
    flow : SingularFlow
    node : FoldedPoint or None
        The folded node at which it starts.
    once : bool
        Whether it ends with the first return to the sheet of the node.
    """

    flow: SingularFlow
    node: FoldedPoint | None = None
    once: bool = False
    returned: float = math.nan
    marks: list[tuple[int, PlaceOnSheet]] = field(default_factory=list)
    first: int = 0
    outcome: Outcome | None = None

    def follow(self, start: Array) -> None:
        """Follow the orbit from a start (x, y), or from the folded node there."""
        n = len(self.flow.model.states)
        if self.node is None:
            place = self.flow.landing(start[:n], start[n:])
            if place is None:
                place = self.flow.jump(start[:n], start[n:], self.flow.rate(start, 1.0))
        else:
            begin = PlaceOnSheet(self.node.form.region, start, "folded node")
            self.marks.append((0, begin))
            place = self._jump(begin)
        while self.outcome is None:
            if place.end in DEAD_ENDS:
                self._end(place)
            elif len(self.flow.pieces) >= MOST_SINGULAR_PIECES:
                self.outcome = NOT_CLOSED.at(count=MOST_SINGULAR_PIECES)
            elif not self._closed(place):
                place = self._next(self.flow.slow_piece(place))

    def _jump(self, place: PlaceOnSheet) -> PlaceOnSheet:
        off = self.flow.off_fold(place)
        if off is None:
            return place._replace(end="degenerate fold")
        return self.flow.jump(off[0], place.at[len(off[0]) :], off[1], place.at)

    def _next(self, end: PlaceOnSheet) -> PlaceOnSheet:
        """Return where the orbit goes on after a slow piece."""
        if end.end == "fold":
            return self._jump(end)
        if end.end == "folded node":
            return end if self._closed(end) else self._jump(end)
        if end.end == "interface":
            sheet, start = self.flow.beyond(end)
            if sheet is not None:
                return sheet
            self.flow.pieces[-1] = replace(self.flow.pieces[-1], end="corner")
            n = len(self.flow.model.states)
            return self.flow.jump(start[:n], start[n:], self.flow.rate(start), end.at)
        return end

    def _closed(self, place: PlaceOnSheet) -> bool:
        """Whether the orbit has been at a landing or at a folded node before; else mark it."""
        if self.outcome is not None:
            return True
        if place.end not in ("lands", "folded node", ""):
            return False
        for first, other in self.marks:
            same = (place.sheet, place.end) == (other.sheet, other.end)
            if same and self.flow.apart(place.at, other.at) < CLOSED_CYCLE:
                self.first, jumps = first, sum(p.type == "jump" for p in self.flow.pieces[first:])
                words = f"{jumps} jump{'s' if jumps > 1 else ''}"
                self.outcome = CLOSED.at(jumps=words, time=f"{self.period:.12g}")
                return True
        self.marks.append((len(self.flow.pieces), place))
        if self.node is not None and place.end == "lands" and math.isnan(self.returned):
            self.returned = StrongCanard(self.flow, self.node).distance(place, self._ranges())
            if self.once and math.isfinite(self.returned):
                self.outcome = CLOSED.at(jumps="one return", time="not known")
                return True
        return False

    def _end(self, place: PlaceOnSheet) -> None:
        self.outcome = DEAD_ENDS[place.end].at(where=self.flow.words(place.at))

    @property
    def cycle(self) -> list[SingularPiece]:
        """The pieces of the cycle, or all of them."""
        return self.flow.pieces[self.first :]

    @property
    def period(self) -> float:
        """Slow time of the cycle."""
        return float(sum(p.duration for p in self.cycle))

    def _ranges(self) -> Array:
        """Ranges of the slow variables over the pieces."""
        n = len(self.flow.model.states)
        ranges = np.ptp(np.concatenate([p.path for p in self.flow.pieces])[:, n:], axis=0)
        return np.asarray(np.where(ranges > 0.0, ranges, 1.0))

    def distance(self) -> float:
        """Distance of the return from the strong canard, in ranges of the slow variables."""
        if self.node is not None:
            return self.returned
        nodes = [p for p in self.flow.points if p.code and p.funnel]
        landings = [place for _, place in self.marks if place.end == "lands"]
        for canard in (StrongCanard(self.flow, node) for node in nodes):
            for place in landings[::-1]:
                found = canard.distance(place, self._ranges())
                if math.isfinite(found):
                    return found
        return math.nan

    def result(self) -> SingularCycle:
        """Return the cycle with its outcome."""
        assert self.outcome is not None
        distance, outcome = self.distance(), self.outcome
        passed = any(p.end == "folded node" for p in self.cycle)
        if outcome and passed:
            outcome = replace(THROUGH_NODE.at(closes=outcome.message), notes=outcome.notes)
        elif outcome and math.isfinite(distance):
            note = "It lands outside the funnel of the folded node: relaxation oscillations."
            outcome = with_notes(outcome, [note])
        period = self.period if outcome else math.nan
        return SingularCycle(self.cycle, period=period, distance=distance, outcome=outcome)


@validated(
    model=instance(Model),
    parameter=formula,
    over=interval,
)
def singular_cycle(
    model: Model,
    state: FoldedPoint | StateLike,
    parameter: Name | None = None,
    over: tuple[float, float] | None = None,
) -> SingularCycle:
    """Compute the singular cycle of a model: slow pieces along attracting sheets, and jumps.

    Along a sheet the desingularised slow flow is followed up to a fold, an interface or a folded
    node; the jump from there follows the fast flow at frozen slow variables to the sheet on which
    it lands. In piecewise-smooth models a slow piece continues across interfaces and along sliding
    sheets, and jumps at corners. The slow times ∫ dy/g of the pieces add up to the limit of the
    period for rates that are separated ever farther.

    Parameters
    ----------
    model : Model
        With one or two slow variables; the phase t of a periodic forcing is one.
    state : sequence of float, mapping or FoldedPoint
        The fast and slow states from which the fast flow leads to a first sheet, in order or by
        name, with ``"t"`` for the phase (default 0); or a folded node with a funnel, from which
        the orbit jumps.
    parameter : str or Symbol, optional
        With a folded node: the parameter at whose value the return lands on the strong canard,
        which separates relaxation oscillations from mixed modes.
    over : (float, float), optional
        Range in which it is looked for.

    Returns
    -------
    SingularCycle
        Also if the orbit does not close; ``outcome`` says why.

    Raises
    ------
    ArgumentError
        For another state, a model without slow variables or with more than two, a forcing without
        a period, or fast rates that contain t.
    ModelError
        For a model with resets, switches or events.
    UnknownNameError
        For an unknown name.

    See Also
    --------
    fastslow.slow_flow, fastslow.find_canards, fastslow.find_orbit

    Notes
    -----
    The return to the funnel of a folded node is that of M. Brøns, M. Krupa and M. Wechselberger,
    Fields Inst. Commun. 49, 39-63, 2006.

    Examples
    --------
    >>> import sympy as sp, fastslow as fs
    >>> x, y = sp.symbols("x y")
    >>> model = fs.Model({x: 100 * (y - x**3 / 3 + x)}, slow={y: -x})
    >>> cycle = fs.singular_cycle(model, [2, 0])
    >>> abs(cycle.period - (3 - 2 * math.log(2))) < 1e-14
    True
    """
    slow = _slow_variables(model)
    if (parameter is None) != (over is None):
        raise ArgumentError("parameter and over: expected both or none")
    if parameter is not None:
        if not isinstance(state, FoldedPoint):
            raise ArgumentError(
                "parameter: expected a folded node as the state, whose strong canard is reached"
            )
        if str(parameter) not in model.parameters:
            raise unknown_name("parameter", parameter, model.parameters)
    sheets = flows_of_sheets(model, slow)
    if isinstance(state, FoldedPoint):
        _check_node(state, model, slow)
        orbit = _from_node(model, slow, sheets, state)
        if parameter is None or over is None:
            return orbit.result()
        return _onto_strong_canard(model, sheets, state, str(parameter), over)
    begin = _start(model, slow, state)
    points = slow_flow(model).points if len(slow) == 2 else ()
    orbit = SingularOrbit(SingularFlow(model, slow, sheets, points, model.period(), np.abs(begin)))
    orbit.follow(begin)
    return orbit.result()


def _slow_variables(model: Model) -> tuple[str, ...]:
    """Return the slow variables of a model whose slow flow can be followed."""
    require_values(model)
    refuse_resets(list(model.resets), "singular_cycle")
    refuse_switches(list(model.switches), "singular_cycle")
    refuse_events(model.events, "singular_cycle")
    timed = model.forcing or any(
        TIME in rate.free_symbols for r in model.regions.values() for rate in r.rates.values()
    )
    if timed and model.period() is None:
        raise ArgumentError(
            "singular_cycle: a forcing of this model has no period; expected periodic forcings, "
            "whose phase is a slow variable. Write a ramp as a slow state: slow={w: r}"
        )
    slow = (*model.slow_states, *((TIME.name,) if timed else ()))
    if not 1 <= len(slow) <= 2:
        raise ArgumentError(
            f"singular_cycle: this model has {len(slow)} slow variables; expected one or two: slow "
            "states, Model(..., slow=), and the phase of a periodic forcing"
        )
    if any(TIME in rate.free_symbols for rate in (model.rates[n] for n in model.states)):
        raise ArgumentError(
            "singular_cycle: a fast rate contains t; define the term that depends on time in "
            "forcing=, so that it can be frozen"
        )
    return slow


def _start(model: Model, slow: tuple[str, ...], start: Any) -> Array:
    """Return a given start as fast states and slow variables."""
    phase = 0.0
    if isinstance(start, Mapping):
        given = {str(name): value for name, value in start.items()}
        if TIME.name in slow:
            phase = float(given.pop(TIME.name, 0.0))
        start = given
    found = initial_state(model, start)
    return np.append(found, phase) if TIME.name in slow else found


def _check_node(node: FoldedPoint, model: Model, slow: tuple[str, ...]) -> None:
    """Raise ArgumentError unless a folded point is a folded node of the model with a funnel."""
    if set(node.values) != {*model.states, *slow}:
        raise ArgumentError(
            f"state: a folded point of {', '.join(node.state)}; the model has "
            f"{', '.join((*model.states, *slow))}"
        )
    if not node.funnel:
        name = node.words if node.code else node.note or "a point without a code"
        raise ArgumentError(f"state: {name}; expected a folded node (FN) with a funnel, or a state")


def _from_node(
    model: Model,
    slow: tuple[str, ...],
    sheets: Mapping[str, SheetFlow],
    node: FoldedPoint,
    once: bool = False,
) -> SingularOrbit:
    """Follow the singular orbit that jumps from a folded node."""
    at = np.array([node.values[n] for n in (*model.states, *slow)])
    flow = SingularFlow(model, slow, sheets, (node,), model.period(), np.abs(at))
    orbit = SingularOrbit(flow, node, once)
    orbit.follow(at)
    return orbit


def _at_value(node: FoldedPoint, model: Model) -> FoldedPoint | None:
    """Return the folded node nearest to a given one, at the parameter values of a model."""
    assert node.flow is not None
    moved = replace(node.flow, parameters=model.parameters).typed(replace(node.form, code=""))
    found = [p for p in moved if p.code and p.funnel]

    def away(point: FoldedPoint) -> float:
        return sum((point.values[n] - v) ** 2 for n, v in node.values.items())

    return min(found, key=away, default=None)


def _onto_strong_canard(
    model: Model,
    sheets: Mapping[str, SheetFlow],
    node: FoldedPoint,
    name: str,
    over: tuple[float, float],
) -> SingularCycle:
    """Solve for the parameter at which the return to a folded node lands on its strong canard."""
    slow = tuple(n for n in node.values if n not in model.states)

    def orbit(value: float, once: bool = False) -> SingularOrbit | None:
        moved = model.with_parameters({name: value})
        there = _at_value(node, moved)
        return None if there is None else _from_node(moved, slow, sheets, there, once)

    def distance(value: float) -> float:
        found = orbit(value, once=True)
        return math.nan if found is None else found.returned

    values = np.linspace(*over, FUNNEL_SAMPLES)
    known = [distance(float(v)) for v in values]
    changes = [k for k in range(len(values) - 1) if known[k] * known[k + 1] <= 0.0]
    if not changes:
        low, high = (f"{v:.6g}" for v in over)
        finite = [d for d in known if math.isfinite(d)]
        reach = f"from {min(finite):.4g} to {max(finite):.4g}" if finite else "not known"
        outcome = NOT_ON_CANARD.at(name=name, low=low, high=high, reach=reach)
        return SingularCycle([], parameter=name, outcome=outcome)
    zeros = [_zero(distance, float(values[k]), float(values[k + 1])) for k in changes]
    sizes = [abs(distance(value)) for value in zeros]
    on = [k for k, size in enumerate(sizes) if size <= ON_STRONG_CANARD]
    value = zeros[on[0] if on else 0]
    found = orbit(value)
    if found is None or not on:
        outcome = PASSED_CANARD.at(where=f"{name} = {value:.6g}")
        return SingularCycle([], parameter=name, value=value, outcome=outcome)
    result = found.result()
    notes = [f"It does so at {len(on)} values; this is the first."] * (len(on) > 1)
    outcome = with_notes(ON_CANARD.at(where=f"{name} = {value:.12g}"), notes)
    return SingularCycle(
        result,
        period=found.period,
        distance=result.distance,
        parameter=name,
        value=value,
        outcome=outcome,
    )


def _zero(function: Callable[[float], float], low: float, high: float) -> float:
    """Return where a function changes its sign between two values, or is not known."""
    from scipy.optimize import brentq

    # a value that is not known ends the search there, beside a change of sign that is no zero
    found: float = brentq(lambda v: np.nan_to_num(function(v)), low, high, xtol=1e-300, rtol=BRENT)
    return found
