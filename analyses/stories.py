"""What the overlay finds in each case: what is followed, how late, and how the gap is passed.

The numbers are those of `overlay.summary()`. The figure draws the last period beside
the gap, where the delay shows.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from analyses.cases import extent, laid_cases
from analyses.claims import Claim, Finding
from analyses.negative_stiffness import case as folded_case
from analyses.output import Output
from analyses.passages import PERIODS, Case
from fastslow.plot.layout.style import (
    BLACK,
    BLUE,
    FULL,
    GREEN,
    GREY,
    LINES,
    MM,
    SMALL_TEXT,
    TEXT,
    VERMILION,
    new_figure,
    styled_axes,
)
from fastslow.results.overlay.delays import GapCrossing
from fastslow.systems.gears import SCALINGS

FIGURES = ("gap_width", "stiffness", "load_amplitude")
FOLDED = "negative_stiffness"

#: The figures that show overlays.
CASES = (*(f"{figure}_{scaling}" for figure in FIGURES for scaling in SCALINGS), FOLDED)

#: Parts of the width of the gap, and of the largest delay, that the drawing shows.
AROUND, BESIDE = 1.25, 1.3


@dataclass(frozen=True)
class Story:
    """An overlay in numbers.

    Parameters
    ----------
    case : str
        What differs from the other cases, as mathematics.
    upper, lower : float
        Parts of the time on the equilibria of S1 and of S3.
    behind : float
        Median time by which the motion is behind those equilibria.
    kind : str
        Of the transitions: "gap crossing", "jump" at a fold, "" without any.
    count : int
        Transitions in the run.
    down, up : float
        The load where the first transition down, and the first up, arrives; nan without one.
    measured, law : float
        Of the first transition, and what the law of delay says: of a transit the time in the
        gap, of a jump the load past the fold; nan without one.
    rhythm : str
        What the overlay calls the rhythm, "" without one.
    """

    case: str
    upper: float
    lower: float
    behind: float
    kind: str
    count: int
    down: float
    up: float
    measured: float
    law: float
    rhythm: str


def story(case: Case) -> Story:
    """The numbers of an overlay."""
    overlay = case.overlay
    shares, found = overlay.shares(), overlay.transitions
    nan = float("nan")
    arrivals = {t.from_branch: t.land.value for t in reversed(found) if t.land is not None}
    measured, law = nan, nan
    if found:
        law = found[0].predicted
        measured = found[0].delay
        if isinstance(found[0].law, GapCrossing):
            measured, law = found[0].duration, found[0].law.duration
    return Story(
        case.setting.title,
        shares.get("S1", 0.0),
        shares.get("S3", 0.0),
        float(np.nanmedian(overlay.lag)),
        found[0].type if found else "",
        len(found),
        arrivals.get("S1", nan),
        arrivals.get("S3", nan),
        measured,
        law,
        "" if overlay.bursting is None else overlay.bursting.name,
    )


@cache
def stories() -> dict[str, tuple[Story, ...]]:
    """The overlays of every figure that shows some."""
    found = {
        f"{figure}_{scaling}": tuple(map(story, laid_cases(figure, scaling)))
        for figure in FIGURES
        for scaling in SCALINGS
    }
    return {**found, FOLDED: (story(folded_case()),)}


def paragraphs(found: Sequence[Story]) -> list[str]:
    """The overlays of a figure as a table in Markdown, and their rhythm in a sentence.

    The law is that of the overlay, `fastslow.predict_delay`, not the one of claim B1.
    """
    jumps = any(s.kind == "jump" for s in found)
    lines = [
        f"What the overlay finds over {PERIODS} periods:",
        "",
        "| case | time on S1 | time on S3 | behind by | transitions | arrives below at w | "
        f"above at w | {'load past the fold' if jumps else 'time in the gap'} | "
        "by the overlay's law |",
        "|---|---|---|---|---|---|---|---|---|",
    ]
    for s in found:
        numbers = (
            f"{value:.3g}".replace("-", "−") if np.isfinite(value) else "–"
            for value in (s.down, s.up, s.measured, s.law)
        )
        what = f"{s.count} × {s.kind}" if s.count else "none"
        # GitHub would take the backslash from \, and leave the comma
        case = s.case.replace("\\,", "\\ ")
        cells = (case, f"{s.upper:.1%}", f"{s.lower:.1%}", f"{s.behind:.2g}", what, *numbers)
        lines.append("| " + " | ".join(cells) + " |")
    rhythms = dict.fromkeys(s.rhythm for s in found if s.rhythm)
    if rhythms:
        lines += ["", f"Rhythm: {'; '.join(rhythms)}."]
    return [*lines, ""]


def _alternates(scaling: str) -> Finding:
    cases = [case for figure in FIGURES for case in laid_cases(figure, scaling)]
    rhythmic = [case for case in cases if case.overlay.bursting is not None]
    unloads = [
        c for c in cases if c.setting.model.parameters["C"] > c.setting.model.parameters["B"]
    ]
    near = [near_equilibria(case) for case in cases]
    return Finding(
        scaling,
        "holds conditionally" if rhythmic == unloads and len(unloads) < len(cases) else "holds",
        "In the {rhythmic} of {cases} cases whose load changes sign: slow drift along the "
        "equilibria, interrupted by fast crossings of the gap, each with a vibration that decays. "
        "The gear is within 1% of its largest twist from the frozen equilibria for {least:.1%} of "
        "the time or more, {most:.0%} at T_am = 10 N m, where it never leaves them.",
        {
            "rhythmic": len(rhythmic),
            "cases": len(cases),
            "least": min(near),
            "most": max(near),
        },
        "in part",
    )


def near_equilibria(case: Case) -> float:
    """Part of the last period in which x is near the equilibrium of the load of the moment."""
    (branch,) = case.diagram.branches
    end = case.run.span[1]
    times = np.linspace(end * (1 - 1 / PERIODS), end, 20001)
    x, _ = case.run(times)
    p = case.setting.model.parameters
    load = p["B"] + p["C"] * np.sin(p["omega"] * times)
    low, high = extent(case)
    apart = np.abs(x - np.interp(load, branch.values, branch["x"]))
    return float((apart < 0.01 * max(-low, high)).mean())


@cache
def claims() -> tuple[Claim, ...]:
    """Section 3 on what fast-slow oscillations are."""
    return (
        Claim(
            "4b",
            'There are "fast-slow oscillations that alternately evolve from small-amplitude '
            'oscillations to large-amplitude oscillations".',
            "The overlay of each of the nine cases on its frozen equilibria: rhythm, and distance "
            "from them in the last period.",
            tuple(map(_alternates, SCALINGS)),
            ("passages",),
        ),
    )


#: Widths of the curves of three cases.
WIDTHS = (2.4, 1.4, 0.6)


def _draw_panel(ax: Axes, figure: str, scaling: str) -> None:
    cases = laid_cases(figure, scaling)
    words = {"gap_width": "D", "stiffness": "k_1", "load_amplitude": r"T_\mathrm{am}"}
    reach = BESIDE * max(t.land.value for c in cases for t in c.overlay.transitions if t.land)
    for k, (case, colour) in enumerate(zip(cases, (BLUE, GREEN, VERMILION), strict=True)):
        p, end = case.setting.model.parameters, case.run.span[1]
        (branch,) = case.diagram.branches
        for side in ("S1", "S3"):
            rows = branch.region == side
            line = (branch.values[rows], branch["x"][rows] / p["D"])
            ax.plot(*line, color=BLACK, zorder=2, **LINES["stable"])
        times = np.linspace(end * (1 - 1 / PERIODS), end, 60001)
        x, _ = case.run(times)
        load = p["B"] + p["C"] * np.sin(p["omega"] * times)
        value = case.setting.name.split("_")[-2]
        # of curves that coincide each is seen beside the narrower one above it
        look: dict[str, Any] = {"color": colour, "linewidth": WIDTHS[k], "zorder": 3 + k}
        ax.plot(load, x / p["D"], label=f"${words[figure]} = {value}$", **look)
    ax.plot((0, 0), (-1, 1), color=BLACK, zorder=2, **LINES["neutral"])
    for edge in (-1, 1):
        ax.axhline(edge, color=GREY, linewidth=0.5, zorder=1)
    ax.set_xlim(-reach, reach)
    ax.set_ylim(-AROUND, AROUND)


def draw_passages(into: Output) -> None:
    """Draw the last period of every case beside the gap."""
    sheet = new_figure(FULL, 105 * MM)
    grid = sheet.subplots(2, 3)
    for row, scaling in enumerate(SCALINGS):
        for column, figure in enumerate(FIGURES):
            ax = styled_axes(grid[row, column])
            _draw_panel(ax, figure, scaling)
            letter = "abcdef"[3 * row + column]
            ax.set_title(f"({letter}) Fig. {3 + column}, {scaling}", loc="left", fontsize=TEXT)
            if row:
                ax.set_xlabel("load $w$")
                ax.legend(
                    loc="upper center",
                    bbox_to_anchor=(0.5, -0.24),
                    ncols=3,
                    fontsize=SMALL_TEXT,
                    frameon=False,
                    handlelength=1.0,
                    handletextpad=0.3,
                    columnspacing=0.7,
                )
            if not column:
                ax.set_ylabel("$x/D$")
    into.save(sheet, "passages")
