"""How long the gap is crossed and how far the gear twists, over D, k1 and T_am.

Both have a law for a slow load. With s = ω_o √(C² − B²), the slope of the load at
zero, x'' + x' = −s t crosses the gap of width 2D in the time t with

    t²/2 − t + 1 − e^(−t) = 2D/s,

which tends to √(4D/s) + 1 where that is long and to (12D/s)^(1/3) where it is
short. The twist follows the equilibria of the frozen gear at the largest and the
smallest load.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from itertools import pairwise

import numpy as np
from matplotlib.lines import Line2D
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter
from numpy.typing import NDArray
from scipy.optimize import brentq

import fastslow as fs
from analyses.cases import GAP, NARROW, STIFFNESSES, TORQUES, WIDTHS, gear
from analyses.claims import Claim, Finding
from analyses.output import Output
from analyses.passages import OMEGA, REST
from analyses.stiffness import flank
from fastslow.plot.layout.style import (
    BLACK,
    BLUE,
    FULL,
    MM,
    SMALL_TEXT,
    TEXT,
    VERMILION,
    new_figure,
    styled_axes,
)
from fastslow.systems.gears import SCALINGS

Floats = NDArray[np.float64]

#: What is varied, its values and what is kept: the source's, and between and beyond them.
SWEEPS: Mapping[str, tuple[tuple[float, ...], Mapping[str, float]]] = {
    "D": ((0.03, 0.055, *WIDTHS, 0.9, 1.6), {}),
    "k1": ((300, 550, *STIFFNESSES, 15000, 30000), {"D": NARROW}),
    "T_am": ((12, 15, 25, *TORQUES[1:], 200, 400), {"D": GAP}),
}

LABELS = {
    "D": "$D$",
    "k1": r"$k_1$ (N m/rad)",
    "T_am": r"$T_\mathrm{am}$ (N m)",
}


@dataclass(frozen=True, eq=False)
class Response:
    """What was measured over one parameter, and the laws.

    Parameters
    ----------
    values : ndarray, shape (m,)
    transit, transit_law, transit_slow : ndarray, shape (m,)
        Time from one side of the gap to the other; the law, and √(4D/s) + 1.
    twist, twist_law : ndarray, shape (m,)
        x, peak to peak over the last period.
    """

    values: Floats
    transit: Floats
    transit_law: Floats
    transit_slow: Floats
    twist: Floats
    twist_law: Floats


@cache
def response(name: str, scaling: str) -> Response:
    """Run the gear over the values of one parameter."""
    values, kept = SWEEPS[name]
    rows = [_measured(gear(scaling, **{**kept, name: value})) for value in values]
    return Response(np.array(values, dtype=float), *np.array(rows).T)


def _measured(model: fs.Model) -> tuple[float, ...]:
    p = model.parameters
    run = fs.simulate(model, REST, periods=2)
    since = 0.5 * run.span[1]
    transit = next(
        far.time - near.time
        for near, far in pairwise(run.crossings)
        if near.time > since and (near.interface, far.interface) == ("x - D", "x + D")
    )
    low, high = run.extremes("x", since=since)
    slope = p["omega"] * np.sqrt(p["C"] ** 2 - p["B"] ** 2)
    top = flank(p["B"] + p["C"], p["A"], p["D"])
    bottom = -flank(p["C"] - p["B"], p["A"], p["D"])
    slow = float(np.sqrt(4 * p["D"] / slope) + 1)
    return transit, crossing_time(p["D"], slope), slow, high - low, top - bottom


def crossing_time(D: float, slope: float) -> float:
    """The time in the gap: t²/2 − t + 1 − e^(−t) = 2D/s.

    Examples
    --------
    >>> round(crossing_time(1e-3 / 12, 1.0), 3), round(crossing_time(1e6, 1.0), 3)
    (0.102, 2001.0)
    """

    def short(t: float) -> float:
        return t * t / 2 - t - float(np.expm1(-t)) - 2 * D / slope

    return float(brentq(short, 0.0, 2 + np.sqrt(4 * D / slope), xtol=1e-14))


@cache
def claims() -> tuple[Claim, ...]:
    """The two laws."""
    findings = []
    for scaling in SCALINGS:
        found = [response(name, scaling) for name in SWEEPS]

        def apart(one: str, other: str, found: list[Response] = found) -> float:
            ratios = [getattr(r, one) / getattr(r, other) for r in found]
            return float(np.abs(np.concatenate(ratios) - 1).max())

        times = np.concatenate([r.transit for r in found])
        stiff = found[1].transit[2:5]
        findings.append(
            Finding(
                scaling,
                "beyond the paper",
                "The time in the gap, {least:.2f} to {most:.1f}, is that of t²/2 − t + 1 − e^(−t) "
                "= 2D/s within {late:.1%}; √(4D/s) + 1, its limit for slow loads, within "
                "{slow:.0%}. The law starts from rest at the corner under a load of constant "
                "slope; that in the tables of overlays, of fs.predict_delay, starts on the elastic "
                "flank, which is left late, and knows the load's curvature. From k1 = 1000 to 7000 "
                "the time changes by {stiff:.1%}. The twist is that of the frozen gear within "
                "{far:.1%}.",
                {
                    "least": float(times.min()),
                    "most": float(times.max()),
                    "late": apart("transit", "transit_law"),
                    "slow": apart("transit", "transit_slow"),
                    "stiff": float(stiff.max() / stiff.min() - 1),
                    "far": apart("twist", "twist_law"),
                },
            )
        )
    return (
        Claim(
            "B1",
            "The gap is crossed late by a law of D and the load's slope alone; the twist is "
            "quasi-static.",
            f"Seven values each of D, k1 and T_am, ω_o = {OMEGA:g}, the second period from rest.",
            tuple(findings),
            ("responses",),
        ),
    )


def main(into: Output) -> None:
    """Draw both responses over the three parameters."""
    sheet = new_figure(FULL, 110 * MM)
    grid = sheet.subplots(2, 3, sharex="col")
    looks = {"consistent": (BLUE, "o"), "printed": (VERMILION, "s")}
    ticks = {"D": (0.03, 0.1, 0.3, 1), "k1": (300, 1000, 3000, 10000), "T_am": (15, 50, 100, 300)}
    for column, name in enumerate(SWEEPS):
        for row, (what, law) in enumerate((("transit", "transit_law"), ("twist", "twist_law"))):
            ax = styled_axes(grid[row, column])
            for scaling, (colour, marker) in looks.items():
                found = response(name, scaling)
                ax.plot(found.values, getattr(found, law), color=colour, linewidth=1.0)
                if not row:
                    (slow,) = ax.plot(found.values, found.transit_slow, color=colour)
                    slow.set(linestyle=(0, (4, 2)), linewidth=0.8)
                ax.plot(
                    found.values,
                    getattr(found, what),
                    linestyle="none",
                    marker=marker,
                    markersize=4,
                    markerfacecolor="white",
                    markeredgecolor=colour,
                    label=f"{scaling} scaling",
                )
            ax.set_xscale("log")
            ax.set_yscale("log")
            ax.yaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
            ax.yaxis.set_major_formatter(FuncFormatter(lambda y, _: f"{y:g}"))
            for axis in (ax.xaxis, ax.yaxis):
                axis.set_minor_formatter(NullFormatter())
            ax.set_xticks(ticks[name], [f"{tick:g}" for tick in ticks[name]])
            ax.set_title(f"({'abcdef'[3 * row + column]})", loc="left", fontsize=TEXT)
            if row:
                ax.set_xlabel(LABELS[name])
            if not column:
                ax.set_ylabel("$x$, peak to peak" if row else "time in the gap")
    handles, labels = grid[0, 0].get_legend_handles_labels()
    handles += [
        Line2D([], [], color=BLACK, linewidth=1.0),
        Line2D([], [], color=BLACK, linewidth=0.8, linestyle=(0, (4, 2))),
    ]
    labels += ["law", r"$\sqrt{4D/s} + 1$"]
    sheet.legend(
        handles,
        labels,
        loc="outside lower center",
        ncols=4,
        fontsize=SMALL_TEXT,
        frameon=False,
    )
    into.save(sheet, "responses")
