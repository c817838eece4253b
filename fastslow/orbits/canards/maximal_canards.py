"""Maximal canards of planar models: the slow manifolds on both sides of a fold meet."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import sympy as sp

from fastslow.arguments import Expression, Name, formula, instance, validated
from fastslow.errors import ArgumentError, unknown_name
from fastslow.model.equations import read_expression
from fastslow.model.model import Model
from fastslow.orbits.canards.corner_canards import SECTION_ROUNDING, corner_canard
from fastslow.orbits.canards.sheets import SheetPoint, Sheets, planar
from fastslow.results.base.named_mapping import NamedMapping
from fastslow.results.base.outcome import Outcome
from fastslow.results.orbits.canard import Canard
from fastslow.results.trajectory.trajectory import Trajectory
from fastslow.simulation.arguments import require_values
from fastslow.simulation.one import simulate
from fastslow.simulation.settings import Integration, integration_settings
from fastslow.symbolic.corners import CornerPoint
from fastslow.symbolic.folded_points import FoldedPoint

#: Settings of the trajectories.
CANARD_RUNS = Integration(rtol=1e-13)

#: Least ∫|Re λ| dt along a sheet up to the fold, of slow manifolds.
LEAST_CONTRACTED = 3.0

#: Longest trajectory, in slow times from its start to the fold.
LONGEST_PASSAGE = 20.0

#: Most pairs of trajectories.
MOST_PAIRS = 80

#: First change of the parameter, in distances between the predicted canard and Hopf values.
FIRST_CHANGE = 1e-4

#: Outcome of a run that has reached the section.
AT_SECTION = "stopped"

#: Difference of two gaps, in units of the slow state, from which their slope is known.
RESOLVED_GAP = 1e-9


class ManifoldPair(NamedTuple):
    """The trajectories of both slow manifolds at one value of the parameter.

    ``gap`` is infinite where one of them misses the section.
    """

    value: float
    gap: float
    attracting: Trajectory
    repelling: Trajectory

    @property
    def height(self) -> float:
        """Size of the slow state on the section."""
        return max(
            abs([*run.final_state.values()][-1]) for run in (self.attracting, self.repelling)
        )


@dataclass(eq=False)
class Manifolds:
    """The slow manifolds beside a fold up to a section, as functions of one parameter.

    Parameters
    ----------
    model : Model
    sheets : Sheets
    section : str
    attracting, repelling : SheetPoint
        Starts, at the predicted value of the parameter.
    fold : (float, float)
        The fold there.
    integration : Integration
    """

    model: Model
    sheets: Sheets
    section: str
    attracting: SheetPoint
    repelling: SheetPoint
    fold: tuple[float, float]
    integration: Integration
    evaluations: int = 0
    corrected: bool = True
    _opens: float = field(init=False)

    def __post_init__(self) -> None:
        # the sheets are on this side of the fold in the slow state
        self._opens = math.copysign(1.0, self.attracting.y - self.fold[1])

    @property
    def slow(self) -> str:
        return self.model.slow_states[0]

    def pair(self, value: float, dense: bool = False) -> ManifoldPair:
        """Return both trajectories and their gap in the slow state on the section."""
        self.evaluations += 1
        model = self.model.with_parameters({self.sheets.parameter: value})
        runs = []
        for place, way in ((self.attracting, 1.0), (self.repelling, -1.0)):
            here = place._replace(y=self.sheets.height(place.x, place.y, value))
            state = self.sheets.corrected(here, value) if self.corrected else (here.x, here.y)
            length = LONGEST_PASSAGE * (self.attracting.duration + self.repelling.duration)
            runs.append(
                simulate(
                    model,
                    state,
                    t=(0.0, way * length),
                    stop=self.section,
                    dense=dense,
                    integration=self.integration,
                )
            )
        missed = [run.outcome.code != AT_SECTION for run in runs]
        if all(missed):
            raise ArgumentError(
                f"section: {self.section} = 0 is missed by both slow manifolds at "
                f"{self.sheets.parameter} = {value:.9g}; expected a section through the fold"
            )
        one, other = runs
        # what misses the section turns back before the fold, on the side of the sheets
        gap = one.final_state[self.slow] - other.final_state[self.slow]
        if any(missed):
            gap = self._opens * (math.inf if missed[0] else -math.inf)
        return ManifoldPair(value, float(gap), one, other)


@validated(
    model=instance(Model),
    point=instance(FoldedPoint, CornerPoint),
    parameter=formula,
    section=formula,
    integration=integration_settings,
)
def find_canard(
    model: Model,
    point: FoldedPoint | CornerPoint,
    parameter: Name,
    *,
    section: Expression | None = None,
    integration: Integration = CANARD_RUNS,
) -> Canard:
    """Compute the value of a parameter at which there is a maximal canard.

    The attracting slow manifold is followed forwards in time and the repelling one backwards, each
    from a start at which ∫|Re λ| dt up to the fold is 45, so that deviations decay below rounding,
    up to a section through the fold. The parameter at which they meet there is solved for by the
    secant method, beginning at the value of `slow_flow` to first order.

    Parameters
    ----------
    model : Model
        With one fast and one slow state.
    point : FoldedPoint or CornerPoint
        A canard point (CN) of ``slow_flow(model, parameter=parameter)``; of a piecewise-linear
        model a corner (BC), from whose slow manifolds, which are eigenlines, the canard is
        computed in closed form.
    parameter : str or Symbol
    section : str or Expr, optional
        Expression in the states that vanishes on the section, across the fast direction; by
        default the fast state minus its value at the fold.
    integration : Integration, optional
        Settings of the trajectories; by default ``rtol=1e-13``.

    Returns
    -------
    Canard
        Also if the manifolds do not meet: then ``outcome`` gives the reason.

    Raises
    ------
    ArgumentError
        For another model or point, a degenerate fold, or a section that both manifolds miss.
    UnknownNameError
        For an unknown name.

    See Also
    --------
    fastslow.slow_flow, fastslow.find_canards, fastslow.find_orbit

    Notes
    -----
    The method is that of J. Guckenheimer and M. D. LaMar, *Understanding Complex Systems*, 335-351,
    2007. Deviations of the starts decay by exp(−K), which is not below rounding if the sheet
    ends early, as for a ratio of rates of 0.05: ``accuracy`` contains it.

    Examples
    --------
    >>> x, y, a = sp.symbols("x y a")
    >>> model = Model({x: 100 * (y - x**3 / 3 + x)}, slow={y: a - x}, parameters={a: 1})
    >>> from fastslow.symbolic.slow_flows import slow_flow
    >>> (point,) = slow_flow(model).points
    >>> round(find_canard(model, point, "a").value, 12)
    0.998740451246
    """
    planar(model, "find_canard")
    require_values(model)
    name = str(parameter)
    if name not in model.parameters:
        raise unknown_name("parameter", parameter, model.parameters)
    if isinstance(point, CornerPoint):
        if section is not None:
            raise ArgumentError("section: the section at a corner is its interface; expected None")
        return corner_canard(model, point, name, integration)
    if point.canard is None:
        code = f"a {point.words}" if point.code else "a point without a code"
        raise ArgumentError(f"point: {code}; expected a canard point (CN), of one slow variable")
    if point.canard.parameter != name:
        raise ArgumentError(
            f"point: the canard point is one in {point.canard.parameter}; use that of "
            f"slow_flow(model, parameter='{name}')"
        )
    manifolds = _manifolds(model, point, name, section, integration)
    guess = point.canard
    change = max(abs(guess.canard - guess.hopf), abs(guess.canard - guess.value))
    if not change > 0.0:
        change = FIRST_CHANGE * max(abs(guess.value), 1.0)
    return _connected(manifolds, guess.canard, FIRST_CHANGE * change, change)


def _manifolds(
    model: Model,
    point: FoldedPoint,
    name: str,
    section: Expression | None,
    integration: Integration,
) -> Manifolds:
    """Return the slow manifolds beside a canard point, with a section."""
    assert point.canard is not None
    sheets = Sheets(model, point.form.region, name)
    value = point.canard.value
    (fast,), (slow,) = model.states, model.slow_states
    fold = sheets.fold(point.values[fast], point.values[slow], value)
    starts = [sheets.start(fold, side, value) for side in (1, -1)]
    slopes = [sheets.at(place.x, place.y, value)[1] for place in starts]
    if not min(slopes) < 0.0 < max(slopes):
        both = "attract" if max(slopes) < 0.0 else "repel"
        raise ArgumentError(
            f"point: both sheets {both} beside {fast} = {fold[0]:.6g}; expected a fold, at which "
            "an attracting and a repelling sheet meet"
        )
    contraction = min(place.contraction for place in starts)
    if contraction < LEAST_CONTRACTED:
        raise ArgumentError(
            f"point: fast and slow rates are not separated: along a sheet deviations decay by "
            f"exp(−{contraction:.3g}) up to the fold; expected at least exp(−{LEAST_CONTRACTED:g})"
        )
    if slopes[0] > slopes[1]:
        starts.reverse()
    text = f"{fast} {'-' if fold[0] >= 0 else '+'} {abs(fold[0]):.17g}"
    text = text if section is None else str(section)
    names = (*model.states, *model.slow_states, *model.parameters)
    across = read_expression("section", text, names)
    if not across.has(sp.Symbol(fast, real=True)):
        raise ArgumentError(
            f"section = {text}; expected a curve across the fast direction, an expression that "
            f"contains {fast}"
        )
    return Manifolds(model, sheets, text, starts[0], starts[1], fold, integration)


def _connected(manifolds: Manifolds, value: float, change: float, reach: float) -> Canard:
    """Solve for the value of the parameter at which the gap vanishes."""
    best, slope, failed = root_of_gap(manifolds.pair, value, change, reach)
    sheets, model = manifolds.sheets, manifolds.model
    contraction = min(manifolds.attracting.contraction, manifolds.repelling.contraction)
    (fast,), (slow,) = model.states, model.slow_states
    accuracy = math.nan
    if not failed:
        plain = replace(manifolds, corrected=False)
        moved = plain.pair(best.value)
        manifolds.evaluations = plain.evaluations
        # the starts are wrong by less than their correction of first order
        starts = abs(moved.gap - best.gap) / abs(slope) if math.isfinite(moved.gap) else math.inf
        rounding = (SECTION_ROUNDING * best.height + abs(best.gap)) / abs(slope)
        accuracy = rounding + math.exp(-contraction) + starts
    pair = manifolds.pair(best.value, dense=True)
    fold = sheets.fold(*manifolds.fold, best.value)
    outcome = Outcome(
        "connected", f"the slow manifolds meet at {sheets.parameter} = {best.value:.16g}.", True
    )
    return Canard(
        parameter=sheets.parameter,
        value=math.nan if failed else best.value,
        accuracy=accuracy,
        contraction=contraction,
        slope=slope,
        gap=best.gap,
        evaluations=manifolds.evaluations,
        section=manifolds.section,
        states=(fast, slow),
        fold=NamedMapping("state", {fast: fold[0], slow: fold[1]}),
        attracting=pair.attracting,
        repelling=pair.repelling,
        parameters=NamedMapping("parameter", dict(pair.attracting.parameters)),
        outcome=failed or outcome,
    )


def root_of_gap(
    pair: Callable[[float], ManifoldPair], value: float, change: float, reach: float
) -> tuple[ManifoldPair, float, Outcome | None]:
    """Solve gap = 0 by the secant method, safeguarded by signs, which a missed section has too.

    Parameters
    ----------
    pair : callable
    value, change : float
        First value, and its first change.
    reach : float
        Change by which a sign is looked for where no secant is known.

    Returns
    -------
    ManifoldPair, float, Outcome or None
        The pair with the smallest gap, the last slope, and the reason if there is no root.
    """
    known = [pair(value), pair(value + change)]
    slope = math.nan
    while len(known) < MOST_PAIRS:
        best, *others = sorted(known, key=lambda p: abs(p.gap))
        second = next((p for p in others if math.isfinite(p.gap)), None)
        if second is not None and abs(second.gap - best.gap) > RESOLVED_GAP * best.height:
            slope = (second.gap - best.gap) / (second.value - best.value)
        if best.gap == 0.0 or _stalled(known):
            return best, slope, None
        tried = best.value - best.gap / slope if math.isfinite(best.gap) else math.nan
        signs = _bracket(known)
        if signs is not None:
            low, high = signs
            tried = tried if low < tried < high else 0.5 * (low + high)
        elif not math.isfinite(tried):
            # alternately on both sides
            count = len(known)
            tried = value + (-1.0) ** count * reach * 2.0 ** (count // 2 - 4)
        if abs(tried - best.value) <= np.finfo(float).eps * abs(best.value):
            if _small(best, 1e6):
                return best, slope, None
            break
        known.append(pair(tried))
    best = min(known, key=lambda p: abs(p.gap))
    low, high = (float(f(p.value for p in known)) for f in (min, max))
    words = f"at {len(known)} values of the parameter from {low:.9g} to {high:.9g}"
    text = f"the slow manifolds did not meet {words}; the smallest gap is {best.gap:.3g}."
    return best, slope, Outcome("no canard", text, False)


def _bracket(known: list[ManifoldPair]) -> tuple[float, float] | None:
    """Return the closest values between which the gap changes its sign."""
    ordered = sorted(known, key=lambda p: p.value)
    found = [
        (one.value, other.value) for one, other in pairwise(ordered) if one.gap * other.gap < 0.0
    ]
    return min(found, key=lambda ends: ends[1] - ends[0], default=None)


def _small(pair: ManifoldPair, times: float) -> bool:
    """Whether a gap is below a multiple of rounding on the section."""
    return bool(abs(pair.gap) <= times * SECTION_ROUNDING * pair.height)


def _stalled(known: list[ManifoldPair]) -> bool:
    """Whether the last two pairs have not improved on a gap of the size of rounding."""
    best = min(known[:-2], key=lambda p: abs(p.gap), default=known[0])
    later = min(abs(p.gap) for p in known[-2:])
    return len(known) > 3 and _small(best, 1.0) and later >= abs(best.gap)
