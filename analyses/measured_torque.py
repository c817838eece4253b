"""The gear under a measured torque: crossings of the gap against their law, with the table's slope.

Not in the source, whose load is harmonic. The record is synthetic: a slow random torque with noise,
sampled and rounded as by an instrument, and interpolated by a cubic spline.
"""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import sympy as sp
from matplotlib.lines import Line2D
from numpy.typing import NDArray

import fastslow as fs
from analyses.cases import GAP
from analyses.claims import Claim, Finding
from analyses.output import Output
from analyses.responses import crossing_time
from fastslow.plot.layout.style import (
    BLACK,
    BLUE,
    FULL,
    GREY,
    MM,
    SMALL_TEXT,
    TEXT,
    VERMILION,
    new_figure,
    styled_axes,
)
from fastslow.results.overlay.delays import GapCrossing
from fastslow.systems.gears import dead_zone

Floats = NDArray[np.float64]

#: Seed, length and sampling interval of the record; mean torque; slow periods in it; noise and
#: resolution.
SEED, LENGTH, SAMPLING = 5, 1800.0, 10.0
MEAN, SLOW, NOISE, RESOLUTION = 2.372, range(3, 13), 0.02, 0.001

#: Stiffness.
STIFFNESS = 41.67

#: Range of the frozen torque.
OVER = (-8.0, 12.0)

#: Markers of durations.
CROSS: dict[str, Any] = {"marker": "x", "markersize": 4.5, "linestyle": "none"}
RING: dict[str, Any] = {**CROSS, "marker": "o"}


@cache
def record() -> tuple[Floats, Floats]:
    """Times of the record and torques."""
    rng = np.random.default_rng(SEED)
    t = np.arange(0.0, LENGTH + SAMPLING / 2, SAMPLING)
    angles = 2 * np.pi / LENGTH * np.outer(SLOW, t)
    waves = np.concatenate([np.cos(angles), np.sin(angles)])
    sizes = rng.normal(size=len(waves)) / np.sqrt([*SLOW, *SLOW])
    torque = MEAN + 1.8 * sizes @ waves + NOISE * rng.normal(size=len(t))
    return t, RESOLUTION * np.round(torque / RESOLUTION)


@cache
def gear() -> fs.Model:
    """The gear of the source with the record as its load."""
    x, v, w, A, D = sp.symbols("x v w A D")
    return fs.Model(
        {x: v, v: w - v - (x**2 + A) * dead_zone(x, D)},
        forcing={w: fs.Tabulated(*record(), interpolation="cubic")},
        parameters={A: STIFFNESS, D: GAP},
    )


@cache
def passage() -> fs.Overlay:
    """A run over the whole record on the equilibria of the frozen gear."""
    diagram = fs.continue_equilibria(gear().frozen(), "w", over=OVER)
    return fs.overlay(diagram, fs.simulate(gear(), [0.3, 0.0], t=(0.0, LENGTH)))


@cache
def crossings() -> tuple[Floats, Floats, Floats]:
    """Slope of the torque at each crossing of the gap, its duration, and that of the law."""
    found = passage().transitions.select(type="gap crossing")
    rows = [
        (abs(one.slope), one.duration, one.law.duration)
        for one in found
        if isinstance(one.law, GapCrossing)
    ]
    slope, measured, law = np.transpose(rows)
    return slope, measured, law


@cache
def claims() -> tuple[Claim, ...]:
    """The law of the gap under a torque that is known at instants."""
    slope, measured, law = crossings()
    constant = np.array([crossing_time(GAP, s) for s in slope])
    return (
        Claim(
            "B11",
            "Under a measured torque the gap is crossed by the law of a harmonic one.",
            "The gear with A = 41.67, D = 0.25 under a synthetic record of 1800 time units, a "
            "value every 10, with noise of 0.02, as a cubic table; durations of all crossings of "
            "the gap against fs.predict_delay with the slope of the table.",
            (
                Finding(
                    "either",
                    "beyond the paper",
                    "Each of the {changes:.0f} changes of the torque's sign is followed by one of "
                    "the {count:.0f} crossings of the gap, at slopes from {least:.3f} to "
                    "{most:.3f}. They last {shortest:.2f} to {longest:.2f}, the law within "
                    "{apart:.1%}; with a constant slope it is within {rough:.1%}.",
                    {
                        "changes": len(signs()),
                        "count": len(measured),
                        "least": slope.min(),
                        "most": slope.max(),
                        "shortest": measured.min(),
                        "longest": measured.max(),
                        "apart": np.abs(measured / law - 1).max(),
                        "rough": np.abs(measured / constant - 1).max(),
                    },
                ),
            ),
            ("measured_torque",),
        ),
    )


def signs() -> Floats:
    """Times at which the torque changes its sign."""
    return passage().run.section("w", level=0.0, direction=None).t


def main(into: Output) -> None:
    """Draw the torque, the overlay, and the durations."""
    sheet = new_figure(FULL, 110 * MM)
    grid = sheet.add_gridspec(2, 2, height_ratios=[2, 3])
    above, left, right = (
        styled_axes(sheet.add_subplot(spot)) for spot in (grid[0, :], grid[1, 0], grid[1, 1])
    )
    above.axhline(0.0, color=GREY, linewidth=0.6)
    fs.plot.time_series(passage().run, "w", ax=above, crossings=False, label=False)
    above.plot(*record(), ".", color=BLACK, markersize=1.5, zorder=3.5)
    drawn = fs.plot.overlay(
        passage(), ax=left, legend=False, crossings=False, turning=False, inset=None
    )
    left.set_xlim(-1.0, 1.6)
    left.set_ylim(-0.36, 0.36)
    above.set_xlim(0.0, LENGTH)
    slope, measured, law = crossings()
    steady = np.linspace(0.8 * slope.min(), 1.1 * slope.max(), 100)
    right.plot(steady, [crossing_time(GAP, s) for s in steady], color=GREY, linewidth=0.9)
    right.plot(slope, law, color=VERMILION, **CROSS)
    right.plot(slope, measured, color=BLUE, markerfacecolor="none", **RING)
    right.set_xlabel(r"$|\mathrm{d}w/\mathrm{d}t|$ where the gap is entered")
    right.set_ylabel("duration of the crossing")
    for name, ax in zip("abc", (above, left, right), strict=True):
        ax.set_title(f"({name})", loc="left", fontsize=TEXT)
    keys = [
        Line2D([], [], label="measured", color=BLUE, markerfacecolor="none", **RING),
        Line2D([], [], label="law along the torque", color=VERMILION, **CROSS),
        Line2D([], [], label="law of a constant slope", color=GREY, linewidth=0.9),
    ]
    right.legend(handles=keys, fontsize=SMALL_TEXT, frameon=False)
    assert isinstance(drawn, fs.plot.OverlayDrawing)
    sheet.legend(
        handles=drawn.handles,
        loc="outside lower center",
        ncols=5,
        fontsize=SMALL_TEXT,
        frameon=False,
    )
    into.save(sheet, "measured_torque")


if __name__ == "__main__":
    main(Output(Path("figures")))
