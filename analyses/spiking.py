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
    MM,
    MOTION,
    SMALL_TEXT,
    TEXT,
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

#: Values of the recovery.
RANGE = (-9.0, 2.0)

#: Smallest distance from the end of the spiking that is drawn.
NEAR = 1e-4


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
def cycles() -> fs.OrbitBranch:
    """Spiking of the frozen neuron over its recovery, almost up to the saddle."""
    orbit = fs.find_orbit(neuron().frozen().with_parameters(u=RANGE[0]), [RESET])
    return fs.continue_orbits(orbit, "u", over=(RANGE[0], end() - NEAR))


@cache
def passage() -> fs.Overlay:
    """The run over the equilibria and the spiking of the frozen neuron."""
    diagram = fs.continue_equilibria(neuron().frozen(), "u", over=RANGE)
    return fs.overlay(diagram, run(), cycles=cycles())


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
    last = [one[-1].after[1] for one in whole]
    length, recovery = intervals()
    early = recovery < end() - 1.0
    jumps = [one for one in passage().transitions.select(type="jump") if one.law is not None]
    periods = cycles().period / period(cycles().values) - 1.0
    (folded,) = passage().diagram.folds
    return (
        Claim(
            "B12",
            "The bursts of a neuron with a reset end where the reset is on a saddle.",
            "Izhikevich's neuron, v' = 0.04v² + 5v + 140 − u + 10, u' = 0.005(0.2v − u), at v = 30 "
            "reset to v = −50 and u + 0.5; equilibria and orbits of the frozen neuron, the "
            "latter beside the integral of their period, and a run of several bursts.",
            (
                Finding(
                    "either",
                    "beyond the paper",
                    "The frozen neuron is at rest above its fold at u = {fold:.2f} and spikes "
                    "below u = {end:.2f}, where the reset is on the saddle and the period becomes "
                    "infinite; its orbits have the period of the integral within {apart:.0e}. Each "
                    "of {count:.0f} bursts has at least {least:.0f} spikes, begins {delay:.3f} "
                    "behind the fold, {law:.3f} by the law of slow passage, and ends with a reset "
                    "to u = {late:.2f}, the first one above the saddle. Up to u = {near:.0f} the "
                    "intervals between spikes are the frozen period within {slow:.1%}. The overlay "
                    "names this fold/homoclinic bursting.",
                    {
                        "fold": folded["u"],
                        "end": end(),
                        "apart": within(float(np.abs(periods).max())),
                        "count": len(whole),
                        "least": min(map(len, whole)),
                        "delay": float(np.mean([one.delay for one in jumps])),
                        "law": float(np.mean([one.predicted for one in jumps])),
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
    above.set(xlim=(0.0, SHOWN), xlabel="$t$ (ms)", ylabel="$v$ (mV)")
    drawn = fs.plot.overlay(passage(), ax=left, legend=False, turning=False, linewidth=0.6)
    assert isinstance(drawn, fs.plot.OverlayDrawing)
    left.plot(end(), RESET, "s", color=BLACK, markersize=3.5, zorder=5)
    left.set(xlim=(-7.4, 1.2), ylabel="$v$ (mV)")
    length, recovery = intervals()
    right.semilogx(end() - recovery, length, ".", color=BLUE, markersize=3.5)
    right.semilogx(end() - cycles().values, cycles().period, color=CYCLES, linewidth=1.2)
    right.set_xlabel("$u^* - u$")
    right.set_ylabel("interval between spikes (ms)")
    for name, ax in zip("abc", (above, left, right), strict=True):
        ax.set_title(f"({name})", loc="left", fontsize=TEXT)
    keys = [
        *drawn.handles,
        Line2D([], [], color=MOTION, linewidth=0.8, linestyle=":", label="reset"),
        Line2D(
            [],
            [],
            marker="s",
            markersize=3.5,
            linestyle="none",
            color=BLACK,
            label="reset on the saddle",
        ),
    ]
    sheet.legend(
        handles=keys, loc="outside lower center", ncols=5, fontsize=SMALL_TEXT, frameon=False
    )
    into.save(sheet, "spiking")


if __name__ == "__main__":
    main(Output(Path("figures")))
