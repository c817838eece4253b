"""Delayed loss of stability in a slow passage through a Hopf bifurcation."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import cast

import numpy as np

from fastslow.errors import ArgumentError
from fastslow.model.model import Model
from fastslow.passage.delays.buffer_points import buffer_of
from fastslow.passage.delays.critical_modes import CriticalMode, critical_mode
from fastslow.passage.delays.delay_law import EntryExitLaw, InvariantMode
from fastslow.passage.delays.entry_exits import MEMORY_EXPONENT, entry_exit, places
from fastslow.passage.delays.local_field import WrongWay, drift, require_law
from fastslow.results.base.named_mapping import NamedMapping
from fastslow.results.branch.diagram import Diagram
from fastslow.results.overlay.delays import Delay, EntryExit, HopfExit
from fastslow.results.points import SpecialPoint


def hopf_exit(
    diagram: Diagram,
    point: SpecialPoint,
    entry: float,
    rate: float,
    *,
    gain: float = 1.0,
) -> HopfExit:
    """Exit point of a slow passage through a Hopf bifurcation (entry-exit function).

    The amplitude decreases as exp(∫ Re λ dp/rate) up to the Hopf point and increases after it.
    Without noise the exit solves

        ∫ Re λ(p) dp = rate · ln gain    from the entry to the exit,

    with the critical pair λ of the frozen equilibria along the branch (Neishtadt 1987; Baer,
    Erneux and Rinzel 1989). A decay exponent above about 30 brings the amplitude below
    rounding, and the exit is earlier than predicted. For analytic rates on a branch that
    depends on the parameter the buffer point, where curves of constant ∫ Re λ dp in the complex
    parameter are interrupted, bounds the delay (Neishtadt 1988); it is computed where the
    pair remains complex.

    Parameters and errors are those of `fastslow.predict_delay`. The delay is nan if the branch
    ends, reverses or loses stability before the exit.

    References
    ----------
    A. I. Neishtadt, Differential Equations 23, 1385-1391, 1987, and 24, 171-176, 1988. S. M. Baer,
    T. Erneux and J. Rinzel, SIAM J. Appl. Math. 49, 55-71, 1989.

    Examples
    --------
    >>> import sympy as sp, fastslow as fs
    >>> x, y, p = sp.symbols("x y p")
    >>> rates = {x: p * x - y - x * (x**2 + y**2), y: x + p * y - y * (x**2 + y**2)}
    >>> diagram = fs.continue_equilibria(fs.Model(rates, parameters={p: 0}), "p", over=(-2, 2))
    >>> law = hopf_exit(diagram, diagram.special("HB")[0], entry=-1, rate=0.05)
    >>> round(law.value, 9), round(law.decay, 9)
    (1.0, 10.0)
    """
    speed = drift(rate)
    mode = hopf_mode(diagram, point, 1 if speed > 0 else -1)
    if mode.before.first_growth() > 0:
        raise WrongWay(
            f"rate = {speed:g}: the branch before {point.label} is not stable in this direction; "
            f"expected rate {'<' if speed > 0 else '>'} 0"
        )
    found = entry_exit(
        mode,
        entry=entry,
        rate=speed,
        gain=gain,
        memory=MEMORY_EXPONENT,
        remembered="exit at the amplitude of the entry",
        lost="limited by rounding: the amplitude decreases by exp(−{decay}), below rounding and "
        "noise, and the exit is earlier",
    )
    law = HopfExit(**found)
    return law if math.isnan(law.delay) else bounded_by_buffer(mode, law)


def bounded_by_buffer(mode: CriticalMode, law: HopfExit) -> HopfExit:
    """Bound the exit for a constant drift by the buffer point if that comes first."""
    speed = abs(law.rate)
    buffer = buffer_of(mode, law.decay * speed)
    if not math.isfinite(buffer.level):
        return replace(law, validity=f"{law.validity}; {buffer.words}")
    at = mode.behind.where(buffer.level)
    if buffer.level / speed > MEMORY_EXPONENT:
        # rounding limits the exit earlier
        return replace(law, buffer=at)
    return replace(
        law,
        delay=abs(at - mode.behind.here),
        delay_time=abs(at - mode.behind.here) / speed,
        error=math.nan,
        validity=buffer.words,
        buffer=at,
        forgotten=False,
    )


def hopf_mode(diagram: Diagram, point: SpecialPoint, way: int) -> CriticalMode:
    """Critical pair of a Hopf point along both sides of the branch.

    Raises
    ------
    ArgumentError
        For a point of another code or diagram.
    """
    require_law(point, LAW.name, "the exit from a Hopf point")
    branch, row = next(places(diagram, point))
    values = branch.eigenvalues[row]
    turning = values[values.imag > 0]
    pair = complex(turning[np.argmin(np.abs(turning.real))])
    return critical_mode(diagram, point, (branch, row), way, pair)


class HopfLaw(EntryExitLaw):
    """The exit past a Hopf point."""

    name = "hopf"
    result = HopfExit

    def exit_of(
        self,
        diagram: Diagram,
        point: SpecialPoint,
        entry: float,
        rate: float,
        *,
        gain: float,
        model: Model | None,
    ) -> EntryExit:
        return hopf_exit(diagram, point, entry, rate, gain=gain)

    def mode(
        self, diagram: Diagram, point: SpecialPoint, way: int, *, alone: bool
    ) -> InvariantMode:
        return InvariantMode(hopf_mode(diagram, point, way), "", MEMORY_EXPONENT)

    def with_buffer(self, mode: CriticalMode, delay: EntryExit, *, constant: bool) -> EntryExit:
        if delay.lost or math.isnan(delay.delay):
            return delay
        if constant:
            return bounded_by_buffer(mode, cast("HopfExit", delay))
        words = "; the buffer point is not computed on this path"
        return replace(delay, validity=delay.validity + words)

    def gradient(self, delay: Delay, name: str) -> NamedMapping[float]:
        if math.isfinite(cast("HopfExit", delay).buffer) and not delay.lost:
            raise ArgumentError(
                "the exit is at the buffer point, which does not depend on the entry; its "
                "derivative is not computed"
            )
        return super().gradient(delay, name)


LAW = HopfLaw()
