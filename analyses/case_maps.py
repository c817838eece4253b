"""Where the cases of the source lie among the regimes: maps wide enough to hold them.

Both scalings, over the width of the gap and the load's excess C/B − 1, over the
load's frequency and the width of the gap, and over stiffness and torque. The
runs begin at the corner x = D, where a load that pushes upwards holds the gear.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import FuncFormatter
from numpy.typing import NDArray

import fastslow as fs
from analyses.cases import (
    FASTEST,
    GAP,
    STIFFNESSES,
    TORQUES,
    WIDTHS,
    gear,
)
from analyses.output import Output
from analyses.passages import OMEGA
from analyses.regime_maps import critical_ratio
from fastslow.passage.regimes import regimes_at
from fastslow.plot.areas import FILLS
from fastslow.plot.layout.style import (
    FULL,
    MM,
    SMALL_TEXT,
    TEXT,
    VERMILION,
    new_figure,
    styled_axes,
)
from fastslow.results.maps.adaptive_map import MapComparison
from fastslow.systems.gears import SCALINGS

Floats = NDArray[np.float64]
Values = dict[str, Floats]

#: Runs that do not settle within two periods are continued up to so many.
LONGEST = 64

#: Mean torque of the cases and the amplitude of figures 3 and 4, N m.
MEAN, SWING = 10.0, 15.0


@dataclass(frozen=True, eq=False)
class CaseMap:
    """A plane, with the cases in it.

    Parameters
    ----------
    name : str
        What the figure's file is called.
    over : mapping
        Range along each axis; of the decimal logarithm, but for k1.
    labels : (str, str)
        Of the axes, as mathematics.
    marks : mapping
        Name of a case to its place.
    logarithmic : (bool, bool)
        Whether an axis shows powers of ten.
    """

    name: str
    over: Mapping[str, tuple[float, float]]
    labels: tuple[str, str]
    marks: Mapping[str, tuple[float, float]]
    logarithmic: tuple[bool, bool] = (True, True)


def _log(value: float) -> float:
    return float(np.log10(value))


#: C/B of a torque amplitude, the same in both scalings.
PER_TORQUE = gear("consistent").parameters["C"] / gear("consistent").parameters["B"] / SWING

MAPS = (
    CaseMap(
        "map_width_load",
        {"D": (-1.3, 2.0), "excess": (-3.0, 1.2)},
        ("$D$", "$C/B - 1$"),
        {
            **{f"{D:g}": (_log(D), _log(PER_TORQUE * SWING - 1)) for D in WIDTHS},
            **{f"{T} N m": (_log(GAP), _log(PER_TORQUE * T - 1)) for T in TORQUES[1:]},
        },
    ),
    CaseMap(
        "map_frequency_width",
        {"omega": (-2.8, 0.5), "D": (-1.3, 2.0)},
        (r"$\omega_\mathrm{o}$", "$D$"),
        {f"{D:g}": (_log(OMEGA), _log(D)) for D in WIDTHS},
    ),
    CaseMap(
        "map_stiffness_torque",
        {"k1": (500.0, 8000.0), "torque": (_log(9.8), _log(10.4))},
        (r"$k_1$ (N m/rad)", r"$T_\mathrm{am}$ (N m)"),
        {"10 N m": (3000.0, 1.0)},
        (False, True),
    ),
)


def values(plane: CaseMap, scaling: str, first: Floats, second: Floats) -> Values:
    """Parameters of the gear at points of a plane."""
    p = gear(scaling).parameters
    one = np.ones_like(first)
    if plane.name == "map_width_load":
        ratio, D, omega, A = 1 + 10**second, 10**first, OMEGA * one, p["A"] * one
    elif plane.name == "map_frequency_width":
        ratio, D, omega, A = PER_TORQUE * SWING * one, 10**second, 10**first, p["A"] * one
    else:
        ratio, D, omega = PER_TORQUE * 10**second, GAP * one, OMEGA * one
        A = p["A"] * first / STIFFNESSES[1]
    return {"A": A, "C": p["B"] * ratio, "D": D, "omega": omega}


def refinement(plane: CaseMap, scaling: str) -> fs.Refinement:
    """Cells of a map."""
    # the stiff gear of the printed scaling takes four times as long, and chaos longer than that
    chaotic = plane.name == "map_frequency_width"
    levels = 3 - (scaling == "printed" and all(plane.logarithmic)) - chaotic
    return fs.Refinement(cells=(8, 7), levels=levels, resolution=1e-2 if chaotic else 2e-3)


@cache
def simulated(plane: CaseMap, scaling: str) -> fs.RefinedMap:
    """The regimes over a plane."""
    model = gear(scaling)

    def regimes(first: Floats, second: Floats) -> list[str]:
        given = values(plane, scaling, first, second)
        starts = np.column_stack([given["D"], np.zeros_like(first)])
        found = regimes_at(model, starts, given, periods=2, max_periods=LONGEST)
        return [str(regime) for regime in found]

    return fs.refined_map(regimes, plane.over, refinement=refinement(plane, scaling))


def criterion(plane: CaseMap, scaling: str) -> MapComparison:
    """What the slow-load criterion, solved in the gap, says at the points of a map."""
    model = gear(scaling)

    def predicted(first: Floats, second: Floats) -> list[str]:
        given = values(plane, scaling, first, second)
        load = fs.systems.slow_load_criterion(model, given, exact=True)
        return [str(w) for w in load.regime.tolist()]

    return simulated(plane, scaling).compare(predicted)


def _curve(plane: CaseMap, scaling: str) -> tuple[Floats, Floats]:
    """The criterion between bilateral and unilateral, in the axes of the plane."""
    low, high = next(iter(plane.over.values()))
    first = np.linspace(low, high, 200)
    p = {**dict(gear(scaling).parameters)}
    if plane.name == "map_frequency_width":
        omega = 10**first
        widest = fs.systems.slow_load_gap(p["B"], p["C"], omega, stiffness=p["A"], exact=True)
        return first, np.log10(np.where(widest > 0, widest, np.nan))
    given = values(plane, scaling, first, np.zeros_like(first))
    ratio = critical_ratio({**p, "A": given["A"], "D": given["D"]}, exact=True)
    if plane.name == "map_width_load":
        return first, np.log10(ratio - 1)
    return first, np.log10(ratio / PER_TORQUE)


def _power(value: float, _: object = None) -> str:
    return f"$10^{{{value:.0f}}}$" if abs(value - round(value)) < 1e-9 else ""


def _dress(ax: Axes, plane: CaseMap) -> None:
    ax.set_xlabel(plane.labels[0])
    ax.set_ylabel(plane.labels[1])
    for axis, logarithmic in zip((ax.xaxis, ax.yaxis), plane.logarithmic, strict=True):
        if logarithmic:
            low, high = axis.get_view_interval()
            if high - low > 1:
                axis.set_ticks(np.arange(np.ceil(low), np.floor(high) + 1))
                axis.set_major_formatter(FuncFormatter(_power))
            else:
                ticks = np.round(np.arange(np.ceil(10 * 10**low), 10 * 10**high) / 10, 1)
                axis.set_ticks(np.log10(ticks), [f"{tick:g}" for tick in ticks])


def draw(plane: CaseMap, into: Output) -> None:
    """Draw a plane under both scalings, with the cases and the criterion."""
    sheet = new_figure(FULL, 78 * MM)
    axes = [styled_axes(ax) for ax in sheet.subplots(1, 2)]
    areas: dict[Any, PolyCollection] = {}
    named: set[Any] = set()
    for ax, letter, scaling in zip(axes, "ab", SCALINGS, strict=True):
        found = simulated(plane, scaling)
        curve = {"slow-load criterion": _curve(plane, scaling)}
        drawn = fs.plot.regime_map(found, ax=ax, curves=curve, annotate=plane.marks, legend=False)
        areas |= {word: drawn.fills[word] for word in found.labels}
        named |= set(drawn.names)
        # the name in one panel is enough
        for word in named & set(found.labels):
            drawn.fills[word].set_hatch("")
        _dress(ax, plane)
        for mark in drawn.marks:
            # above the points of one row, else beside each, away from the limit of the frequency
            row = sum(other.xy[1] == mark.xy[1] for other in drawn.marks)
            side = -6 if "omega" in plane.over else 6
            mark.set_position((side, 0) if row == 1 else (0, 8))
            if row == 1:
                mark.set_horizontalalignment("left" if side > 0 else "right")
        ax.set_title(f"({letter}) {scaling} scaling", loc="left", fontsize=TEXT)
        if plane.name == "map_frequency_width":
            limit = np.log10(FASTEST)
            ax.axvline(limit, color="black", linewidth=0.8, linestyle=":")
            for word, name in drawn.names.items():
                name.set_bbox({"facecolor": FILLS[word], "edgecolor": "none", "pad": 1.5})
            ax.annotate(
                r"$\omega = 1\,\mathrm{rad/s}$",
                (limit, 0.03),
                xycoords=("data", "axes fraction"),
                xytext=(3, 0),
                textcoords="offset points",
                fontsize=SMALL_TEXT,
            )
    dashed = Line2D([], [], color=VERMILION, linestyle=(0, (4, 2)), label="slow-load criterion")
    line = Line2D([], [], color="black", linewidth=0.8, label="boundary by simulation")
    dot = Line2D([], [], color="black", marker="o", linestyle="none", markersize=4, label="cases")
    unnamed = [
        Patch(facecolor=FILLS[word], hatch=area.get_hatch(), label=str(word))
        for word, area in areas.items()
        if word not in named
    ]
    sheet.legend(
        handles=[line, dashed, dot, *unnamed],
        loc="outside lower center",
        ncols=4,
        fontsize=SMALL_TEXT,
        frameon=False,
    )
    into.save(sheet, plane.name)


def main(into: Output) -> None:
    """Draw the maps."""
    for plane in MAPS:
        draw(plane, into)
