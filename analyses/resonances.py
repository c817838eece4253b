"""Fast loads: where resonances make figure 3 of the source as stated, at its own torques.

A load that changes sign as far as that of figure 3 carries the teeth across gaps of these widths,
whatever its frequency within the source's range. Loads nearly as fast as the vibration in
contact do not: the gap is too wide for the time that they leave. In between many motions are
chaotic, and meet both sides in some periods and not in others: these have no regime.
"""

from __future__ import annotations

from functools import cache
from itertools import pairwise

import numpy as np
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from numpy.typing import NDArray

import fastslow as fs
from analyses.cases import WIDTHS, gear
from analyses.gap_region import STATED
from analyses.output import Output
from fastslow.passage.regimes import regimes_at
from fastslow.plot.areas import FILLS
from fastslow.plot.layout.style import FULL, GREY, MM, SMALL_TEXT, TEXT, new_figure, styled_axes

Floats = NDArray[np.float64]

#: Steps in which frequencies are scanned, and these frequencies.
STEPS = {"consistent": 0.02, "printed": 0.5}
SCANNED = {
    "consistent": np.arange(0.1, 6.01, STEPS["consistent"]),
    "printed": np.arange(5.0, 100.01, STEPS["printed"]),
}

#: Periods of the load that runs have at first, and at most.
PERIODS, LONGEST = 32, 256

#: Where runs begin: at rest in the middle of the gap, or at its upper end.
STARTS = ("rest", "corner")

#: The plane, and its cells.
OVER = {"omega": (0.25, 6.25), "D": (0.05, 0.65)}
REFINEMENT = fs.Refinement(cells=(24, 12), levels=1, resolution=1e-2)

#: A chaotic load, in the consistent scaling, and how many of its periods are looked at.
CHAOTIC, MANY = 1.3, 4000


def regimes(scaling: str, omega: Floats, width: Floats, start: str = "rest") -> list[str]:
    """Regimes of the motions that runs settle on at the torques of figure 3."""
    begin = np.stack([width * (start == "corner"), np.zeros_like(width)], axis=1)
    given = {"omega": omega, "D": width}
    found = regimes_at(gear(scaling), begin, given, periods=PERIODS, max_periods=LONGEST)
    return [str(regime) for regime in found]


@cache
def scanned(scaling: str, width: float, start: str = "rest") -> list[str]:
    """Regimes over the frequencies."""
    omega = SCANNED[scaling]
    return regimes(scaling, omega, np.full_like(omega, width), start)


@cache
def bands(scaling: str, start: str = "rest") -> list[tuple[float, float]]:
    """Runs of frequencies at which figure 3 is as stated, the longest first."""
    omega = SCANNED[scaling]
    stated = np.array(scanned(scaling, WIDTHS[2], start)) == STATED[2]
    for width, regime in zip(WIDTHS[:2], STATED[:2], strict=True):
        rows = np.flatnonzero(stated)
        if not len(rows):
            break
        found = regimes(scaling, omega[rows], np.full(len(rows), width), start)
        stated[rows] = np.array(found) == regime
    edges = [0, *(k for k in range(1, len(stated)) if stated[k] != stated[k - 1]), len(stated)]
    runs = [(a, b - 1) for a, b in pairwise(edges) if stated[a]]
    runs.sort(key=lambda ends: ends[0] - ends[1])
    return [(float(omega[a]), float(omega[b])) for a, b in runs]


@cache
def chaotic_below_one() -> tuple[float, ...]:
    """Frequencies up to ω_o = 1 at which the widest gap is chaotic from some start."""
    omega = SCANNED["consistent"]
    found = zip(omega, *(scanned("consistent", WIDTHS[2], start) for start in STARTS), strict=True)
    return tuple(float(w) for w, *words in found if w < 1.001 and "chaotic" in words)


@cache
def chaos() -> tuple[float, float]:
    """Largest Lyapunov exponent per period, and the part of the periods that meet both sides."""
    model = gear("consistent", CHAOTIC, D=WIDTHS[2])
    exponent = fs.lyapunov(model, [0.0, 0.0], periods=MANY)
    assert exponent.chaotic
    many = fs.simulate_many(model, [0.0, 0.0], periods=MANY)
    return float(exponent.per_period[0]), float(many.fractions["bilateral"][0])


@cache
def refined() -> fs.RefinedMap:
    """The regimes over frequency and width under the consistent scaling, boundaries refined."""

    def words(omega: Floats, width: Floats) -> list[str]:
        # which side the impacts are on matters less than that there is one
        return [_side(word) for word in regimes("consistent", omega, width)]

    return fs.refined_map(words, OVER, refinement=REFINEMENT)


def _side(regime: str) -> str:
    return "unilateral" if regime.startswith("unilateral") else regime


@cache
def longest(scaling: str, start: str = "rest") -> tuple[float, float]:
    """Ends of the longest of those runs, by bisection of its neighbouring frequencies."""
    omega = SCANNED[scaling]
    step = float(omega[1] - omega[0])
    ends = []
    for inside, outward in zip(bands(scaling, start)[0], (-step, step), strict=True):
        outside = inside + outward
        for _ in range(8):
            middle = 0.5 * (inside + outside)
            found = regimes(scaling, np.full(3, middle), np.array(WIDTHS), start)
            as_stated = tuple(found) == STATED
            inside, outside = (middle, outside) if as_stated else (inside, middle)
        ends.append(inside)
    return ends[0], ends[1]


def draw(into: Output) -> None:
    """Draw the plane under the consistent scaling, and the three widths under the printed one."""
    sheet = new_figure(FULL, 78 * MM)
    left, right = (styled_axes(ax) for ax in sheet.subplots(1, 2, width_ratios=(1.35, 1)))
    fills = {**FILLS, "unilateral": FILLS["unilateral upper"], "free": "#BDBDBD"}
    plane = refined()
    own = {word: fills[word] for word in plane.labels}
    fs.plot.regime_map(plane, ax=left, fills=own, legend=False, linewidth=0.8)
    for width in WIDTHS:
        left.axhline(width, color=GREY, linewidth=0.8, linestyle=(0, (4, 2)))
    left.plot(longest("consistent"), [0.06, 0.06], color="black", linewidth=3)
    omega = SCANNED["printed"]
    step = omega[1] - omega[0]
    for row, width in enumerate(WIDTHS):
        found = scanned("printed", width)
        for word in dict.fromkeys(map(_side, found)):
            starts = [
                (w - step / 2, step) for w, r in zip(omega, found, strict=True) if _side(r) == word
            ]
            colour = fills[word]
            right.broken_barh(starts, (row - 0.35, 0.7), facecolor=colour, linewidth=0)
    for band in bands("printed"):
        right.plot(band, [-0.45, -0.45], color="black", linewidth=3, solid_capstyle="butt")
    right.set_xlim(omega[0], omega[-1])
    right.set_ylim(-0.6, 2.5)
    right.set_yticks(range(3), [f"{D:g}" for D in WIDTHS])
    for ax, title in ((left, "(a) consistent scaling"), (right, "(b) printed scaling")):
        ax.set_xlabel(r"$\omega_\mathrm{o}$")
        ax.set_ylabel("$D$")
        ax.set_title(title, loc="left", fontsize=TEXT)
    handles = [
        *(Patch(facecolor=fills[w], edgecolor=GREY, linewidth=0.5, label=w)
          for w in ("bilateral", "unilateral", "chaotic", "not settled")),
        Line2D([], [], color=GREY, linestyle=(0, (4, 2)), label="widths of Fig. 3"),
        Line2D([], [], color="black", linewidth=3, label="as Fig. 3 states"),
    ]  # fmt: skip
    sheet.legend(
        handles=handles, loc="outside lower center", ncols=6, fontsize=SMALL_TEXT, frameon=False
    )
    into.save(sheet, "resonances")
