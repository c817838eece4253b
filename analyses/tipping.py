"""Rates at which shifts tip: a pulse of fresh water, a ramp of warming, and impacts on a wall.

Not in the source. The first two models are those of the gallery; the third is a double well that
moves towards a wall.
"""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
import sympy as sp
from matplotlib.axes import Axes

import fastslow as fs
from analyses.claims import Claim, Finding
from analyses.gallery import stommel1961, wieczorek2011
from analyses.output import Output
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

#: Ranges of rate and height of the pulse, and the state in which the circulation is.
PULSES, CIRCULATING = {"r": (0.4, 1.4), "D": (0.2, 0.4)}, {"y": 0.24}

#: Ranges of rate and size of the shift of the wells, the left one, and the shift of the runs.
SHIFTS, LEFT_WELL, SHIFT = {"r": (0.5, 5.0), "D": (1.1, 1.8)}, [-1.0, 0.0], 1.5

#: Position of the wall, and the restitution.
WALL, RESTITUTION = sp.Rational(29, 10), sp.Rational(4, 5)

#: Sizes of shifts, with ranges of the rate, at which other parts of the boundary begin: beyond the
#: sizes at which the runs of the first ones graze the wall.
OTHERS = ((1.2, (2.7, 4.0)), (1.41, (4.55, 5.0)), (1.77, (4.0, 5.0)))

#: Steps along the curves of critical rates: each point is solved to rounding.
ALONG = fs.Continuation(step=0.05, max_step=0.1, max_turn=0.5, min_step=1e-3)

#: Cells of the maps.
CELLS = fs.Refinement(cells=(10, 10), levels=3)


@cache
def wells() -> fs.Model:
    """A double well that moves by D at the rate r, in front of a wall."""
    x, v, w, t, r, D = sp.symbols("x v w t r D")
    y = x - w
    return fs.Model(
        {x: v, v: y - y**3 - v / 10},
        forcing={w: D * (1 + sp.tanh(r * t)) / 2},
        parameters={r: 1, D: SHIFT},
        resets={x >= WALL: {v: -RESTITUTION * v}},
    )


@cache
def pulses() -> fs.CriticalRate:
    """Critical rates of a pulse of height 0.3."""
    return fs.critical_rate(stommel1961.model(), "r", PULSES["r"], branch=CIRCULATING)


@cache
def warming() -> fs.RateThreshold:
    """The critical rate of warming."""
    (found,) = fs.critical_rate(wieczorek2011.model(), "v", (0.05, 0.2))
    return found


@cache
def shifts() -> fs.CriticalRate:
    """Critical rates of the shift of the wells by 1.5."""
    return fs.critical_rate(wells(), "r", SHIFTS["r"], branch=LEFT_WELL)


@cache
def curves() -> tuple[fs.ThresholdCurve, ...]:
    """The boundaries over the size of the shift."""
    return tuple(
        fs.continue_points(one, ("r", "D"), SHIFTS, continuation=ALONG) for one in shifts()
    )


def other_curves() -> list[fs.ThresholdCurve]:
    """The boundaries beyond grazing runs."""
    found = []
    for size, rates in OTHERS:
        (one,) = fs.critical_rate(wells().with_parameters(D=size), "r", rates, branch=LEFT_WELL)
        found.append(fs.continue_points(one, ("r", "D"), SHIFTS, continuation=ALONG))
    return found


@cache
def claims() -> tuple[Claim, ...]:
    """The critical rates, and the impacts of the runs at them."""
    impacts = [len(one.run.resets) for one in shifts()]
    grazed = [one for curve in curves() for one in curve.outcomes if "grazed" in one.message]
    return (
        Claim(
            "B18",
            "Whether a shift tips depends on its rate, and before a wall on the number of impacts.",
            "Critical rates of a pulse in Stommel's boxes, of the ramp of the compost bomb, and of "
            "x'' = y − y³ − x'/10, y = x − D (1 + tanh(rt))/2, in front of a wall at x = 2.9 with "
            "the restitution 0.8.",
            (
                Finding(
                    "either",
                    "beyond the paper",
                    "A pulse of height 0.3 beyond the fold is survived above r = {pulse:.9f}. The "
                    "compost ignites above {ramp:.10f} °C per year, {more:.2%} above the limit of "
                    "infinitely slow carbon. The shift of the wells by 1.5 has {count} critical "
                    "rates between {low:.9f} and {high:.9f}; the runs at them land on the saddle "
                    "after {fewest} to {most} impacts. Over the size of the shift {ends} of the "
                    "{sides} ends of their curves are runs that graze the wall.",
                    {
                        "pulse": pulses().rate,
                        "ramp": warming().rate,
                        "more": warming().rate / warming().limit - 1,
                        "count": len(shifts()),
                        "low": shifts()[0].rate,
                        "high": shifts()[-1].rate,
                        "fewest": min(impacts),
                        "most": max(impacts),
                        "ends": len(grazed),
                        "sides": 2 * len(curves()),
                    },
                ),
            ),
            ("tipping",),
        ),
    )


def main(into: Output) -> None:
    """Draw both maps with their boundaries, runs beside a critical ramp, and runs with impacts."""
    sheet = new_figure(FULL, 130 * MM)
    (ocean, soil), (walls, runs) = ([styled_axes(ax) for ax in row] for row in sheet.subplots(2, 2))
    boxes = stommel1961.model()
    plane = fs.tipping_map(boxes, "r", PULSES, branch=CIRCULATING, refinement=CELLS)
    boundary = fs.continue_points(pulses()[0], ("r", "D"), PULSES, continuation=ALONG)
    fs.plot.tipping_map(plane, boundary, ax=ocean, legend=False)
    _draw_warming(soil)
    plane = fs.tipping_map(wells(), "r", SHIFTS, branch=LEFT_WELL, refinement=CELLS)
    fs.plot.tipping_map(plane, curves()[0], ax=walls, legend=False)
    for curve in (*curves()[1:], *other_curves()):
        walls.plot(curve["r"], curve["D"], color=VERMILION, linestyle="--", linewidth=1.2)
    _draw_impacts(runs)
    for name, ax in zip("abcd", (ocean, soil, walls, runs), strict=True):
        ax.set_title(f"({name})", loc="left", fontsize=TEXT)
    into.save(sheet, "tipping")


def _draw_warming(ax: Axes) -> None:
    """Temperature of the soil at the critical rate, and below and above it."""
    model, critical = wieczorek2011.model(), warming()
    ax.plot(critical.run.t, critical.run["T"], color=BLACK, label="$v_c$")
    for share, color in ((0.999, BLUE), (1.001, VERMILION)):
        ramp = model.with_parameters(v=share * critical.rate)
        run = fs.simulate(ramp, critical.run(0.0), t=(0, 80), stop="T - 45")
        ax.plot(run.t, run["T"], color=color, linewidth=1.2, label=f"{share:g} $v_c$")
    ax.legend(fontsize=SMALL_TEXT, loc="upper left")
    ax.set(xlabel="$t$ (yr)", ylabel="$T$ (°C)")


def _draw_impacts(ax: Axes) -> None:
    """The runs at three critical rates, up to where they are on the saddle."""
    for number, color in ((0, BLACK), (2, BLUE), (5, VERMILION)):
        one = shifts()[number]
        t, count = np.linspace(max(-4, one.run.span[0]), 14, 2000), len(one.run.resets)
        ax.plot(t, one.run(t)[0], color=color, linewidth=1.2, label=f"{one.rate:.3f}, {count}")
    ax.axhline(float(WALL), color=GREY, linewidth=2.5)
    ax.axhline(SHIFT, color=GREY, linewidth=0.8, linestyle=":")
    ax.legend(
        title="$r$, impacts", fontsize=SMALL_TEXT, title_fontsize=SMALL_TEXT, loc="lower right"
    )
    ax.set(xlabel="$t$", ylabel="$x$", ylim=(-1.6, 3.3))


if __name__ == "__main__":
    main(Output(Path("figures")))
