"""Entry-exit prediction along the path of a run, past a Hopf or branch point."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import sympy as sp

from fastslow.errors import ArgumentError
from fastslow.model.structure import TIME
from fastslow.passage.delays.branch_exits import UNDERFLOW, invariant_mode
from fastslow.passage.delays.critical_modes import CriticalMode
from fastslow.passage.delays.entry_exits import MEMORY, bound_in_words
from fastslow.passage.delays.hopf_delays import hopf_mode, with_buffer
from fastslow.passage.delays.path_exits import PathExit, path_exit
from fastslow.passage.overlay.transitions import Passage
from fastslow.results.overlay.delays import BranchPointExit, Delay, HopfExit
from fastslow.results.overlay.transitions import StableBranch, Transition
from fastslow.results.point_types import HOPF
from fastslow.results.points import SpecialPoint

#: Factor between the tolerance of a run and the smallest amplitude it resolves.
NOISY = 10.0


#: Critical mode, reason for the invariance of its branch, largest decay exponent.
Known = tuple[CriticalMode, str, float]


def exit_law(
    p: Passage,
    t: Transition,
    point: SpecialPoint,
    known: dict[tuple[str, int], Known | None],
) -> Delay | None:
    """Predict the exit of a transition by the entry-exit integral along the run, else None.

    The growth rate is integrated over time along the slow quantity of the run, from the
    entry to the vicinity of the branch, for any variation of the forcing in between; the
    amplitudes at both ends are those of the run. ``known`` caches the modes of points.
    """
    if t.land is t.leave:
        # no departure
        return None
    left = next(s for s in p.stable_branches if s.label == t.from_branch)
    way = int(p.outward(left, point))
    key = (point.label, way)
    if key not in known:
        try:
            known[key] = _mode(p, point, way)
        except ArgumentError:
            known[key] = None
    kept = known[key]
    if kept is None:
        return None
    mode, remembered, memory = kept
    if mode.before.first_growth() > 0:
        return None
    found = path_exit(mode, p.slow, _entry(p, t, left), t.leave.time, t.time)
    return None if found is None else _law(p, mode, found, remembered, memory)


def _mode(p: Passage, point: SpecialPoint, way: int) -> Known:
    if point.code == HOPF:
        return hopf_mode(p.diagram, point, way), "", MEMORY
    return invariant_mode(p.diagram, point, way, alone=not _others(p))


def _others(p: Passage) -> bool:
    """Whether the fast rates depend on other slow quantities than the diagram's parameter."""
    run = p.slow.run
    moving = {n for n in run.columns if n != p.slow.name and n not in p.slow.states}
    if run.symbolic_model is None or p.slow.laws:
        return bool(moving) and not p.slow.laws
    return any(
        symbol.name in moving
        for name in p.slow.states
        for symbol in run.symbolic_model.rates[name].free_symbols
    )


def _entry(p: Passage, t: Transition, left: StableBranch) -> float:
    """Time at which the arc of the stable branch left is first followed."""
    number = p.stable_branches.index(left)
    arc = next(c for c in p.m.arcs if number in c.stable_branches)
    on = np.isin(p.followed, arc.stable_branches)
    away = np.flatnonzero(~on[: np.searchsorted(p.m.t, t.leave.time)])
    if not len(away):
        return float(p.m.t[0])
    first = min(int(away[-1]) + 1, len(p.m.t) - 1)
    return float(p.m.t[first])


def _law(
    p: Passage, mode: CriticalMode, found: PathExit, remembered: str, memory: float
) -> HopfExit | BranchPointExit:
    name = p.diagram.parameter
    words, error = found.words, found.error
    floor = _floor(p, found, memory)
    forgotten = bool(floor)
    if math.isfinite(found.exit):
        words = f"along the path of the run, {words}{remembered}"
        if forgotten:
            error = math.nan
            words = (
                f"limited by {floor}: the amplitude decreases by exp(−{found.decay:.0f}), below "
                "this limit, which changes the exit"
            )
        else:
            words += bound_in_words(error, " at these amplitudes")
    elif forgotten:
        words += (
            f"; limited by {floor}: the amplitude decreases by exp(−{found.decay:.0f}), below this "
            "limit, from which the run leaves earlier"
        )
    kind = HopfExit if mode.point.code == HOPF else BranchPointExit
    law = kind(
        point=mode.point,
        parameter=name,
        rate=_rate(p, found.passed),
        delay=abs(found.exit - mode.point[name]),
        validity=words,
        error=error,
        delay_time=found.time - found.passed,
        entry=found.entry,
        decay=found.decay,
        gain=found.gain,
        forgotten=forgotten,
    )
    if not isinstance(law, HopfExit) or forgotten or math.isnan(law.delay):
        return law
    if _constant(p):
        return with_buffer(mode, law)
    return replace(law, validity=f"{law.validity}; the buffer point is not computed on this path")


def _constant(p: Passage) -> bool:
    """Whether the slow quantity is a forcing with constant rate."""
    model, name = p.slow.run.symbolic_model, p.slow.name
    if model is None or p.slow.laws or name not in p.slow.run.forcing:
        return False
    return bool(sp.expand(model.forcing[name].diff(TIME).diff(TIME)) == 0) and not _others(p)


def _rate(p: Passage, time: float) -> float:
    begin, end = float(p.m.t[0]), float(p.m.t[-1])
    step = 1e-5 * (end - begin)
    pair = np.clip([time - step, time + step], begin, end)
    first, second = p.slow.at(pair)[0]
    return float((second - first) / (pair[1] - pair[0]))


def _floor(p: Passage, found: PathExit, memory: float) -> str:
    """The limit below which the amplitude decays, empty if it remains above all of them."""
    if memory == UNDERFLOW:
        return "the smallest number, 1e-300" if found.decay > memory else ""
    rtol = float(p.slow.run.settings.get("rtol", 0.0))
    known = math.isfinite(found.amplitude) and found.amplitude > 0.0
    start = math.log(found.amplitude) if known else 0.0
    if rtol > 0.0 and start - found.decay < math.log(NOISY * rtol):
        return f"the tolerance (rtol = {rtol:g})"
    return "rounding" if found.decay > memory else ""
