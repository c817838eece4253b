"""Delayed loss of stability in a slow passage through a Hopf point."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from fastslow.arguments import finite, instance, positive, validated
from fastslow.passage.delays.buffer_points import buffer_of
from fastslow.passage.delays.critical_modes import CriticalMode, critical_mode
from fastslow.passage.delays.entry_exits import MEMORY, entry_exit, places
from fastslow.passage.delays.local_field import WrongWay, drift, require_code
from fastslow.results.branch.diagram import Diagram
from fastslow.results.overlay.delays import HopfExit
from fastslow.results.points import SpecialPoint


@validated(
    diagram=instance(Diagram),
    point=instance(SpecialPoint),
    entry=finite,
    rate=finite,
    gain=positive,
)
def hopf_exit(
    diagram: Diagram,
    point: SpecialPoint,
    entry: float,
    rate: float,
    *,
    gain: float = 1.0,
) -> HopfExit:
    """Where a trajectory that came to a sheet before a Hopf point leaves it behind the point.

    The amplitude falls as exp(∫ Re λ dp/rate) up to the Hopf point and grows as
    long again: without noise the exit solves

        ∫ Re λ(p) dp = rate · ln gain    from the entry to the exit,

    with the pair λ of the frozen equilibria along the branch (Neishtadt 1987; Baer,
    Erneux and Rinzel 1989). A decay beyond about 30 is forgotten in rounding, and
    the exit comes earlier than predicted. For analytic rates the buffer point, where
    curves of constant ∫ Re λ dp in the complex parameter break, bounds the delay of a
    branch that moves (Neishtadt 1988): it is computed where the pair stays complex.

    Parameters
    ----------
    diagram : Diagram
        With the branch on both sides of the point.
    point : SpecialPoint
        A Hopf point of the diagram, code HB.
    entry : float
        The parameter where the trajectory comes to the sheet.
    rate : float
        Of the parameter, with its sign.
    gain : float
        Amplitude about the sheet at the exit by that at the entry.

    Returns
    -------
    HopfExit
        The delay is nan where the branch ends, turns or loses stability before.

    Raises
    ------
    ArgumentError
        For a point of another code or diagram, a rate of zero or towards the
        stable side, an entry that is not on the sheet before the point, or a gain
        that is not positive.

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
            f"rate = {speed:g}: the sheet before {point.label} is not stable in this direction; "
            f"expected rate {'<' if speed > 0 else '>'} 0"
        )
    found = entry_exit(
        mode,
        entry=entry,
        rate=speed,
        gain=gain,
        memory=MEMORY,
        remembered="the exit at the amplitude of the entry",
        lost="rounding decides: the amplitude falls by exp(−{decay}), below rounding and noise, "
        "and the exit comes earlier than this",
    )
    law = HopfExit(**found)
    return law if math.isnan(law.delay) else with_buffer(mode, law)


def with_buffer(mode: CriticalMode, law: HopfExit) -> HopfExit:
    """The law of a constant drift, bounded by the buffer point where that comes first."""
    speed = abs(law.rate)
    buffer = buffer_of(mode, law.decay * speed)
    if not math.isfinite(buffer.level):
        return replace(law, validity=f"{law.validity}; {buffer.words}")
    at = mode.behind.where(buffer.level)
    if buffer.level / speed > MEMORY:
        # rounding comes before it
        return replace(law, buffer=at)
    return replace(
        law,
        delay=abs(at - mode.behind.here),
        time=abs(at - mode.behind.here) / speed,
        error=math.nan,
        validity=buffer.words,
        buffer=at,
        forgotten=False,
    )


def hopf_mode(diagram: Diagram, point: SpecialPoint, way: int) -> CriticalMode:
    """The pair that crosses the imaginary axis, on both sides of a Hopf point.

    Raises
    ------
    ArgumentError
        For a point of another code or diagram.
    """
    require_code(point, "HB", "the exit after a Hopf point")
    branch, row = next(places(diagram, point))
    values = branch.eigenvalues[row]
    turning = values[values.imag > 0]
    pair = complex(turning[np.argmin(np.abs(turning.real))])
    return critical_mode(diagram, point, (branch, row), way, pair)
