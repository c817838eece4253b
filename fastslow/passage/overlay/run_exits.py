"""Entry-exit prediction along the path of a run, past a Hopf or branch point."""

from __future__ import annotations

import math

import numpy as np
import sympy as sp

from fastslow.errors import ArgumentError
from fastslow.model.structure import TIME
from fastslow.passage.delays.delay_law import EntryExitLaw, InvariantMode
from fastslow.passage.delays.entry_exits import UNDERFLOW, bound_in_words
from fastslow.passage.delays.path_exits import PathExit, path_exit
from fastslow.passage.overlay.transitions import OverlaidRun
from fastslow.results.overlay.delays import Delay, EntryExit
from fastslow.results.overlay.transitions import StableBranch, Transition
from fastslow.results.points import SpecialPoint

#: Factor between the tolerance of a run and the smallest amplitude it resolves.
NOISY = 10.0


def exit_delay(
    p: OverlaidRun,
    t: Transition,
    point: SpecialPoint,
    law: EntryExitLaw,
    known: dict[tuple[str, int], InvariantMode | None],
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
            known[key] = law.mode(p.diagram, point, way, alone=not _others(p))
        except ArgumentError:
            known[key] = None
    kept = known[key]
    if kept is None:
        return None
    mode = kept.mode
    if mode.before.first_growth() > 0:
        return None
    found = path_exit(mode, p.slow, _entry(p, t, left), t.leave.time, t.time)
    if found is None:
        return None
    return law.with_buffer(mode, _delay(p, law, found, kept), constant=_constant(p))


def _others(p: OverlaidRun) -> bool:
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


def _entry(p: OverlaidRun, t: Transition, left: StableBranch) -> float:
    """Time at which the arc of the stable branch left is first followed."""
    number = p.stable_branches.index(left)
    arc = next(c for c in p.m.arcs if number in c.stable_branches)
    on = np.isin(p.followed, arc.stable_branches)
    away = np.flatnonzero(~on[: np.searchsorted(p.m.t, t.leave.time)])
    if not len(away):
        return float(p.m.t[0])
    first = min(int(away[-1]) + 1, len(p.m.t) - 1)
    return float(p.m.t[first])


def _delay(p: OverlaidRun, law: EntryExitLaw, found: PathExit, known: InvariantMode) -> EntryExit:
    words, error, point = found.words, found.error, known.mode.point
    floor = _floor(p, found, known.memory)
    forgotten = bool(floor)
    if math.isfinite(found.exit):
        words = f"along the path of the run, {words}{known.reason}"
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
    return law.result(
        point=point,
        parameter=p.diagram.parameter,
        rate=_rate(p, found.passed),
        delay=abs(found.exit - point[p.diagram.parameter]),
        validity=words,
        error=error,
        delay_time=found.time - found.passed,
        entry=found.entry,
        decay=found.decay,
        gain=found.gain,
        forgotten=forgotten,
    )


def _constant(p: OverlaidRun) -> bool:
    """Whether the slow quantity is a forcing with constant rate."""
    model, name = p.slow.run.symbolic_model, p.slow.name
    if model is None or p.slow.laws or name not in p.slow.run.forcing:
        return False
    return bool(sp.expand(model.forcing[name].diff(TIME).diff(TIME)) == 0) and not _others(p)


def _rate(p: OverlaidRun, time: float) -> float:
    begin, end = float(p.m.t[0]), float(p.m.t[-1])
    step = 1e-5 * (end - begin)
    pair = np.clip([time - step, time + step], begin, end)
    first, second = p.slow.at(pair)[0]
    return float((second - first) / (pair[1] - pair[0]))


def _floor(p: OverlaidRun, found: PathExit, memory: float) -> str:
    """The limit below which the amplitude decays, empty if it remains above all of them."""
    if memory == UNDERFLOW:
        return "the smallest number, 1e-300" if found.decay > memory else ""
    rtol = float(p.slow.run.settings.get("rtol", 0.0))
    known = math.isfinite(found.amplitude) and found.amplitude > 0.0
    start = math.log(found.amplitude) if known else 0.0
    if rtol > 0.0 and start - found.decay < math.log(NOISY * rtol):
        return f"the tolerance (rtol = {rtol:g})"
    return "rounding" if found.decay > memory else ""
