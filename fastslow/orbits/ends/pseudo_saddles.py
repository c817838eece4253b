"""Homoclinic orbits of a pseudo-saddle with one sliding direction.

The cycle lands on the interface near the pseudo-saddle, slides away and leaves the interface.
Sliding orbits on one side of the pseudo-saddle coincide after some time, so that a run that begins
there lands where the cycle does. The homoclinic orbit lands on the pseudo-saddle itself
(Kuznetsov, Rinaldi & Gragnani 2003): this is one equation for the parameter.

References
----------
Yu. A. Kuznetsov, S. Rinaldi and A. Gragnani, One-parameter bifurcations in planar Filippov systems,
International Journal of Bifurcation and Chaos 13(8), 2157-2188, 2003.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fastslow.orbits.ends.slowest_points import (
    Saddle,
    Slowest,
    equilibrium_near,
    fields_at,
    with_value,
)
from fastslow.orbits.find.orbit_curve import OrbitCurve, Row
from fastslow.orbits.flow.segments import winding_of

Array = NDArray[np.float64]

#: Distance from the pseudo-saddle, in units of the ranges, at which the runs begin.
BEGIN = 1e-3

#: Largest number of secant steps, and the last one relative to the first.
SECANTS, CONVERGED = 15, 1e-9


class Landing(NamedTuple):
    """Where a run from near the pseudo-saddle slides again.

    Parameters
    ----------
    gap : float
        Along the interface from the pseudo-saddle, in units of the ranges.
    modes : tuple of int
        Until then.
    saddle : Saddle
    """

    gap: float
    modes: tuple[int, ...]
    saddle: Saddle


def pseudo_homoclinic(
    curve: OrbitCurve, last: Row, slow: Slowest, saddle: Saddle, expected: float
) -> float | None:
    """Solve for the parameter of a homoclinic orbit of a pseudo-saddle.

    Parameters
    ----------
    curve : OrbitCurve
    last : Row
        A cycle of long period.
    slow : Slowest
        On its sliding segment.
    saddle : Saddle
        At the parameter of the cycle, with one sliding direction.
    expected : float
        Distance of the parameter.

    Returns
    -------
    float or None
        None without convergence, if the runs have different itineraries, or if the pseudo-saddle
        is not in the sliding region.
    """
    winding = winding_of(last.orbit.trajectory, slow.time, last.arrays.period)
    side = float(saddle.tangents[:, 0] @ ((slow.state - saddle.state) / slow.size))
    out = np.sign(side) * saddle.tangents[:, 0]
    here = _landing(curve, last, slow, last.value, out, winding)
    step = expected
    if here is None or side == 0.0 or not here.gap > 0:
        return None
    value = last.value
    for _ in range(SECANTS):
        there = _landing(curve, last, slow, value + step, out, winding)
        if there is None or there.modes != here.modes or there.gap == here.gap:
            return None
        value += step
        step *= there.gap / (here.gap - there.gap)
        here = there
        if abs(step) <= max(CONVERGED * abs(expected), np.spacing(abs(value))):
            return value + step if _slides(curve, last, slow, value, here.saddle) else None
    return None


def _landing(
    curve: OrbitCurve, last: Row, slow: Slowest, value: float, out: Array, winding: Array
) -> Landing | None:
    """Run from beside the pseudo-saddle until it slides again; None if it does not."""
    values = with_value(last.shooting, value)
    here = curve.problem.at(values)
    saddle = equilibrium_near(here, slow, values)
    if saddle is None:
        return None
    run = here.run(saddle.state + BEGIN * out * slow.size, 0.0, last.arrays.period)
    assert run.series is not None
    modes = run.steps[:, 2].astype(np.int64)
    begins = np.flatnonzero(np.diff(modes, prepend=-1))
    # beside the interface by rounding, the run first falls onto it
    slides = np.flatnonzero(modes[begins] == slow.mode)
    if len(slides) < 2:
        return None
    first, again = slides[:2]
    landed = run.series[begins[again], : len(saddle.state), 0] - winding
    gap = float(out @ ((landed - saddle.state) / slow.size))
    return Landing(gap, tuple(modes[begins[first:again]].tolist()), saddle)


def _slides(curve: OrbitCurve, last: Row, slow: Slowest, value: float, saddle: Saddle) -> bool:
    """Check that a pseudo-saddle is on the same side of all bounds as the sliding segment."""
    slides = np.flatnonzero(curve.problem.variations.signs[slow.mode] == 0)
    known, there = (
        fields_at(curve.problem, slow.mode, state, with_value(last.shooting, at)).g[0]
        for state, at in ((slow.state, last.value), (saddle.state, value))
    )
    return bool((np.delete(known * there, slides) >= 0).all())
