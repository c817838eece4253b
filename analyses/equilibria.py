"""The frozen gear: equilibria of every case, eigenvalues along them, nodes, foci and folds.

This is the fast-slow analysis that the source's title names and its text does not give.
"""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from numpy.typing import NDArray

import fastslow as fs
from analyses.cases import GAP, gear, laid_cases
from analyses.claims import Claim, Finding
from analyses.output import Output
from analyses.passages import Case
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
    point_colour,
    styled_axes,
)
from fastslow.results.point_types import POINT_TYPES
from fastslow.systems.gears import SCALINGS, gear_scales

Floats = NDArray[np.float64]
FIGURES = ("gap_width", "stiffness", "load_amplitude")

#: A stiffness with nodes beside the gap, foci farther out, for the eigenvalues.
SOFT = 0.1


def corner(case: Case) -> fs.SpecialPoint:
    """The boundary equilibrium at x = D."""
    (point,) = (p for p in case.diagram.boundary_equilibria if p["x"] > 0)
    return point


def complex_from(case: Case) -> float:
    """Where along the Clarke path at the corner the eigenvalues turn complex, by bisection."""
    path = corner(case).clarke
    assert path is not None
    outside = 1.0 if path.regions[0] == "S1" else 0.0
    low, high = 0.0, 1.0
    for _ in range(60):
        middle = 0.5 * (low + high)
        q = middle if outside else 1.0 - middle
        matrix = q * path.jacobians[0] + (1.0 - q) * path.jacobians[1]
        turned = bool(np.abs(np.linalg.eigvals(matrix).imag).max() > 0)
        low, high = (low, middle) if turned else (middle, high)
    return high


def node_load(A: float, D: float) -> float:
    """The load up to which the equilibrium beside the gap is a node: 3x² − 2Dx + A = 1/4.

    Zero where it is a focus from the corner on, A + D² ≥ 1/4.
    """
    if A + D * D >= 0.25:
        return 0.0
    x = (D + np.sqrt(D * D - 3 * (A - 0.25))) / 3
    return float((x * x + A) * (x - D))


#: Steps fine enough to show where two eigenvalues meet.
FINE = fs.Continuation(step=0.004, max_step=0.004)


@cache
def soft_diagram() -> fs.Diagram:
    """Of the gear with A = 0.1 at D = 0.25."""
    model = gear("consistent").with_parameters(A=SOFT, D=GAP)
    return fs.continue_equilibria(model.frozen(), "w", over=(-0.1, 0.3), continuation=FINE)


def _one_curve(scaling: str) -> Finding:
    cases = [case for figure in FIGURES for case in laid_cases(figure, scaling)]
    folds = sum(len(case.diagram.folds) for case in cases)
    ends = sum(len(case.diagram.boundary_equilibria) for case in cases)
    curves = sum(len(case.diagram.branches) for case in cases)
    reals = [
        float(branch.eigenvalues.real[branch.region == "S1"][5:-5].mean())
        for case in cases
        for branch in case.diagram.branches
    ]
    stiff = cases[0].setting.model.parameters
    q = complex_from(cases[0])
    return Finding(
        scaling,
        "beyond the paper",
        "{cases} cases: {curves} curves, {folds} folds, {ends} corners, each degenerate (det J is "
        "A + D² outside and 0 inside). Outside the gap all are stable foci with real part "
        "{real:.2f}; at D = 0.1 the eigenvalues turn complex at q = {q:.2e} of the Clarke path, "
        "1/(4(A + D²)) = {law:.2e}.",
        {
            "cases": len(cases),
            "curves": curves,
            "folds": folds,
            "ends": ends,
            "real": float(np.mean(reals)),
            "q": q,
            "law": 1 / (4 * (stiff["A"] + stiff["D"] ** 2)),
        },
    )


def _nodes(scaling: str) -> Finding:
    scales = gear_scales("printed" if scaling == "printed" else "consistent")
    per = gear(scaling).parameters["A"] / 3000.0
    smallest = min(
        case.setting.model.parameters["A"]
        for figure in FIGURES
        for case in laid_cases(figure, scaling)
    )
    return Finding(
        scaling,
        "beyond the paper",
        "A node beside the gap needs A < 1/4 − D²: k1 below {k1:.3g} N m/rad at D = {D}, "
        "a gap of ±{gap:.2g} rad. The cases have A from {smallest:.3g} on: no change between "
        "node and focus but in the gap itself.",
        {
            "k1": (0.25 - GAP**2) / per,
            "gap": GAP * scales.angle,
            "D": GAP,
            "smallest": smallest,
        },
    )


@cache
def claims() -> tuple[Claim, ...]:
    """What the frozen gear of every case is."""
    return (
        Claim(
            "B2",
            "The frozen gear has one curve of equilibria without a fold: steep at the gap, "
            "no S-shape.",
            "Diagrams of the nine cases of figures 3 to 5, with all special points; the Clarke "
            "path at the corners.",
            tuple(map(_one_curve, SCALINGS)),
            ("equilibria", "eigenvalues"),
        ),
        Claim(
            "B3",
            "Between node and focus the equilibria change where 3x² − 2Dx + A = 1/4.",
            "The eigenvalues along the curves; the condition in closed form.",
            tuple(map(_nodes, SCALINGS)),
            ("eigenvalues",),
        ),
    )


def _draw_cases(ax: Axes, figure: str, scaling: str) -> None:
    colours = (BLUE, GREEN, VERMILION)
    words = {"gap_width": "D", "stiffness": "k_1", "load_amplitude": r"T_\mathrm{am}"}
    for k, (case, colour) in enumerate(zip(laid_cases(figure, scaling), colours, strict=True)):
        (branch,) = case.diagram.branches
        # three equal curves would hide each other: the loads reach differently far
        width = 1.2 + (1.4 * (2 - k) if figure == "load_amplitude" else 0.0)
        for region in ("S1", "S2", "S3"):
            rows = np.flatnonzero(branch.region == region)
            rows = np.r_[max(rows[0] - 1, 0), rows, min(rows[-1] + 1, len(branch) - 1)]
            look: dict[str, Any] = {"color": colour, "linewidth": width, "zorder": 2 + k}
            if region == "S2":
                look |= {"linestyle": LINES["neutral"]["linestyle"], "linewidth": 0.9}
            ax.plot(branch.values[rows], branch["x"][rows], **look)
        for point in case.diagram.boundary_equilibria:
            marker, fill = POINT_TYPES["BE"].marker, point_colour("BE")
            ax.plot(point["w"], point["x"], marker, color=fill, markersize=4, zorder=6)
        value = case.setting.name.split("_")[-2]
        ax.annotate(
            f"${words[figure]} = {value}$",
            (0.97, 0.06 + 0.1 * k),
            xycoords="axes fraction",
            color=colour,
            fontsize=SMALL_TEXT,
            ha="right",
        )
    ax.set_xlabel("$w$")
    ax.set_ylabel("$x$")


def draw_equilibria(into: Output) -> None:
    """Draw the equilibria of every case."""
    sheet = new_figure(FULL, 110 * MM)
    grid = sheet.subplots(2, 3)
    for row, scaling in enumerate(SCALINGS):
        for column, figure in enumerate(FIGURES):
            ax = styled_axes(grid[row, column])
            _draw_cases(ax, figure, scaling)
            letter = "abcdef"[3 * row + column]
            ax.set_title(f"({letter}) Fig. {3 + column}, {scaling}", loc="left", fontsize=TEXT)
    marker, fill = POINT_TYPES["BE"].marker, point_colour("BE")
    handles = [
        Line2D([], [], color=BLACK, linewidth=1.2, label="stable"),
        Line2D([], [], color=BLACK, linewidth=0.9, linestyle=LINES["neutral"]["linestyle"],
               label="neutral: every twist in the gap"),
        Line2D([], [], color=fill, marker=marker, markersize=4, linestyle="none",
               label="boundary equilibrium"),
    ]  # fmt: skip
    sheet.legend(
        handles=handles, loc="outside lower center", ncols=3, fontsize=SMALL_TEXT, frameon=False
    )
    into.save(sheet, "equilibria")


def draw_eigenvalues(into: Output) -> None:
    """Draw the eigenvalues along two curves: that of the source, and one with nodes."""
    sheet = new_figure(FULL, 62 * MM)
    axes = [styled_axes(ax) for ax in sheet.subplots(1, 2)]
    for ax, letter, diagram, title in (
        (axes[0], "a", laid_cases("gap_width", "consistent")[1].diagram, "$A = 41.67$"),
        (axes[1], "b", soft_diagram(), f"$A = {SOFT}$"),
    ):
        (branch,) = diagram.branches
        along = branch["x"]
        # the eigenvalues are discontinuous at the interfaces
        jumps = np.flatnonzero(branch.region[1:] != branch.region[:-1]) + 1
        cut = np.insert(along, jumps, np.nan)
        for k in range(2):
            values = np.insert(branch.eigenvalues[:, k], jumps, np.nan)
            ax.plot(cut, values.imag, color=VERMILION, linewidth=1.0, zorder=2)
            ax.plot(cut, values.real, color=BLUE, linewidth=1.6, zorder=3)
        for side in (-GAP, GAP):
            ax.axvline(side, color=GREY, linewidth=0.7)
        if letter == "b":
            load = node_load(SOFT, GAP)
            x = float(np.interp(load, branch.values, along))
            for place in (-x, x):
                if along.min() < place < along.max():
                    ax.axvline(place, color=GREEN, linewidth=0.9, linestyle=(0, (4, 2)))
            ax.annotate(
                "node to focus",
                (x, 0.05),
                xycoords=("data", "axes fraction"),
                xytext=(3, 0),
                textcoords="offset points",
                color=GREEN,
                fontsize=SMALL_TEXT,
            )
        for height, words, colour in (
            (0.93, "real", BLUE),
            (0.84, "imaginary", VERMILION),
        ):
            ax.annotate(
                words, (0.5, height), xycoords="axes fraction", color=colour, fontsize=SMALL_TEXT,
                va="top", ha="center",
            )  # fmt: skip
        ax.set_xlim(along.min(), along.max())
        ax.set_xlabel("$x$ of the equilibrium")
        ax.set_ylabel("eigenvalues")
        ax.set_title(f"({letter}) {title}, $D = {GAP}$", loc="left", fontsize=TEXT)
    into.save(sheet, "eigenvalues")


def main(into: Output) -> None:
    """Draw the figures."""
    draw_equilibria(into)
    draw_eigenvalues(into)
