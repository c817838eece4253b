"""Bursts of a neuron that fires and is reset, over the spiking of its frozen model.

Not in the source. The neuron is that of Izhikevich (2003); its frozen model has one state, so that
the period of its spiking is an integral.
"""

from __future__ import annotations

from functools import cache
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.lines import Line2D
from numpy.typing import NDArray

import fastslow as fs
from analyses.claims import Claim, Finding
from analyses.output import Output
from analyses.physical_route import within
from fastslow.plot.layout.style import (
    BLACK,
    BLUE,
    CYCLES,
    FULL,
    GREY,
    MM,
    MOTION,
    SMALL,
    TEXT,
    dot_look,
    new_figure,
    styled_axes,
)

Floats = NDArray[np.float64]

#: Current, ratio of the time scales, voltage after a spike, and increment of the recovery.
CURRENT, RATE, RESET, STEP = 10.0, 0.005, -50.0, 0.5

#: Voltage at which the neuron has fired.
FIRED = 30.0

#: Initial state, at rest.
START = [-73.0, -2.0]

#: Length of the run, and that of the time series.
LENGTH, SHOWN = 1200.0, 420.0

#: Values of the recovery at which orbits are computed.
CHECKED = (-20.0, -6.0, -1.0, -0.01)

#: Smallest distance from the end of the spiking that is drawn.
NEAR = 1e-3


@cache
def neuron() -> fs.Model:
    """The neuron with a slow recovery."""
    return fs.systems.izhikevich(I_0=CURRENT, a=RATE, c=RESET, d=STEP)


@cache
def run() -> fs.Trajectory:
    """Several bursts."""
    return fs.simulate(neuron(), START, t=(0.0, LENGTH))


def fold() -> float:
    """The recovery at which equilibria begin: 0.04 (v + 62.5)² = u − I + 16.25."""
    return CURRENT - 16.25


def end() -> float:
    """The recovery at which the reset is on the saddle."""
    return fold() + 0.04 * (RESET + 62.5) ** 2


def period(u: Floats | float) -> Floats:
    """Period of the spiking at constant recovery: ∫ dv/(0.04 (v + 62.5)² + I − 16.25 − u)."""
    bounds = np.array([RESET, FIRED]) + 62.5
    rest = np.asarray(fold() - u, dtype=complex)
    q = np.sqrt(0.04 / rest)
    return np.asarray((np.arctan(q * bounds[1]) - np.arctan(q * bounds[0])) * q / 0.04).real


@cache
def orbits() -> float:
    """Largest relative difference of the periods of frozen orbits from the integral."""
    frozen = neuron().frozen()
    found = [fs.find_orbit(frozen.with_parameters(u=u), [RESET]).period for u in CHECKED]
    return float(np.abs(np.array(found) / period(np.array(CHECKED)) - 1.0).max())


def intervals() -> tuple[Floats, Floats]:
    """Intervals between spikes within bursts, and the recovery in their middle."""
    spikes = np.array([reset.time for reset in run().resets])
    recovery = run()(0.5 * (spikes[1:] + spikes[:-1]))[1]
    length = np.diff(spikes)
    inside = length < 20.0 * np.median(length)
    return length[inside], recovery[inside]


def bursts() -> list[list[Any]]:
    """The spikes of each whole burst."""
    spikes = list(run().resets)
    pauses = np.diff([spike.time for spike in spikes])
    ends = np.flatnonzero(pauses > 20.0 * np.median(pauses)) + 1
    return [spikes[a:b] for a, b in pairwise(ends)]


@cache
def claims() -> tuple[Claim, ...]:
    """Beginnings and ends of bursts."""
    whole = bursts()
    first = [one[0].before[1] for one in whole]
    last = [one[-1].after[1] for one in whole]
    length, recovery = intervals()
    early = recovery < end() - 1.0
    return (
        Claim(
            "B12",
            "The bursts of a neuron with a reset end where the reset is on a saddle.",
            "Izhikevich's neuron, v' = 0.04v² + 5v + 140 − u + 10, u' = 0.005(0.2v − u), at v = 30 "
            "reset to v = −50 and u + 0.5; equilibria and spiking of the frozen neuron in closed "
            "form, orbits of it, and a run of several bursts.",
            (
                Finding(
                    "either",
                    "beyond the paper",
                    "The frozen neuron is at rest above its fold at u = {fold:.2f} and spikes "
                    "below u = {end:.2f}, where the reset is on the saddle and the period becomes "
                    "infinite. The periods of its orbits are the integral within {apart:.0e}. Each "
                    "of {count:.0f} bursts has at least {least:.0f} spikes, the first at "
                    "u = {early:.2f}, behind the fold, and the last reset to u = {late:.2f}, the "
                    "first one above the saddle. Up to u = {near:.0f} the intervals between spikes "
                    "are the frozen period within {slow:.1%}.",
                    {
                        "fold": fold(),
                        "end": end(),
                        "apart": within(orbits()),
                        "count": len(whole),
                        "least": min(map(len, whole)),
                        "early": float(np.mean(first)),
                        "late": float(np.mean(last)),
                        "near": end() - 1.0,
                        "slow": np.abs(length[early] / period(recovery[early]) - 1.0).max(),
                    },
                ),
            ),
            ("spiking",),
        ),
    )


def main(into: Output) -> None:
    """Draw bursts over time, over the frozen equilibria, and the intervals between spikes."""
    sheet = new_figure(FULL, 105 * MM)
    grid = sheet.add_gridspec(2, 2, height_ratios=[2, 3], width_ratios=[3, 2])
    above, left, right = (
        styled_axes(sheet.add_subplot(spot)) for spot in (grid[0, :], grid[1, 0], grid[1, 1])
    )
    fs.plot.time_series(run(), "v", ax=above, label=False, linewidth=0.6)
    above.set_xlim(0.0, SHOWN)
    u = fold() + np.linspace(0.0, 2.9, 200) ** 2
    swing = 5.0 * np.sqrt(u - fold())
    left.plot(u, -62.5 - swing, color=BLACK, linewidth=2.2, zorder=2)
    left.plot(u, -62.5 + swing, "--", color=BLACK, linewidth=1.2, zorder=3.5)
    left.plot(fold(), -62.5, zorder=5, **dot_look("LP"))
    left.axhline(RESET, color=GREY, linewidth=0.6)
    fs.plot.phase_portrait(run(), "u", "v", ax=left, label=False, linewidth=0.6)
    left.plot(end(), RESET, "s", color=CYCLES, markersize=4.0, zorder=5)
    left.set_xlim(-7.4, 1.2)
    length, recovery = intervals()
    right.semilogx(end() - recovery, length, ".", color=BLUE, markersize=3.5)
    away = np.geomspace(NEAR, 9.0, 200)
    right.semilogx(away, period(end() - away), color=CYCLES, linewidth=1.2)
    right.set_xlabel("$u^* - u$")
    right.set_ylabel("interval between spikes")
    for name, ax in zip("abc", (above, left, right), strict=True):
        ax.set_title(f"({name})", loc="left", fontsize=TEXT)
    keys = [
        Line2D([], [], color=BLACK, linewidth=2.2, label="stable"),
        Line2D([], [], color=BLACK, linewidth=1.2, linestyle="--", label="unstable"),
        Line2D([], [], label="LP fold", **dot_look("LP")),
        Line2D([], [], color=MOTION, linewidth=0.8, label="trajectory"),
        Line2D([], [], color=MOTION, linewidth=0.8, linestyle=":", label="reset"),
        Line2D([], [], marker="s", linestyle="none", color=CYCLES, label="reset on the saddle"),
        Line2D([], [], color=CYCLES, linewidth=1.2, label="spiking of the frozen neuron"),
    ]
    sheet.legend(handles=keys, loc="outside lower center", ncols=4, fontsize=SMALL, frameon=False)
    into.save(sheet, "spiking")


if __name__ == "__main__":
    main(Output(Path("figures")))
