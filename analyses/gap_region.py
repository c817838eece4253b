"""Where a change of D alone does what figure 3 of the source shows.

At D = 0.1 and 0.25 impacts are to be bilateral, at D = 0.5 unilateral. Each point
of the map is three runs from the corner x = D. The dashed curves are the slow-load criterion
for D = 0.5 and for D = 0.25, between which the statement is to hold.
"""

from __future__ import annotations

from functools import cache

import numpy as np
from matplotlib.ticker import FuncFormatter
from numpy.typing import NDArray

import fastslow as fs
from analyses.cases import FASTEST, WIDTHS, gear
from analyses.output import Output
from analyses.regime_maps import critical_ratio
from fastslow.plot.layout.style import FULL, MM, TEXT, new_figure, styled_axes
from fastslow.systems.gears import SCALINGS

Floats = NDArray[np.float64]

STATED = ("bilateral", "bilateral", "unilateral upper")

#: What a point of the map is called: which of the widths have bilateral impacts.
AS_STATED, ALL, FEWER = "as stated", "bilateral up to 0.5", "not at 0.25"

#: From a fifth of the source's largest frequency to that; decimal logarithms of C/B − 1.
FREQUENCIES = (0.2 * FASTEST, FASTEST)
EXCESSES = {"consistent": (-2.3, -1.3), "printed": (-3.1, -2.1)}


def word_of(regimes: tuple[str, ...]) -> str:
    """What the regimes at the three widths amount to."""
    if regimes == STATED:
        return AS_STATED
    return ALL if set(regimes) == {"bilateral"} else FEWER


@cache
def region(scaling: str) -> fs.RefinedMap:
    """The map over the load's frequency and the logarithm of C/B − 1."""
    model = gear(scaling)
    B = model.parameters["B"]

    def words(omega: Floats, excess: Floats) -> list[str]:
        swing, count = B * (1 + 10**excess), len(omega)
        many = fs.simulate_many(
            model,
            np.column_stack([np.repeat(WIDTHS, count), np.zeros(len(WIDTHS) * count)]),
            parameters={
                "D": np.repeat(WIDTHS, count),
                "C": np.tile(swing, len(WIDTHS)),
                "omega": np.tile(omega, len(WIDTHS)),
            },
            periods=2,
        )
        rows = np.reshape(many.regime, (len(WIDTHS), count)).T.tolist()
        return [word_of(tuple(row)) for row in rows]

    over = {"omega": FREQUENCIES, "excess": EXCESSES[scaling]}
    # the stiff gear of the printed scaling takes four times as long
    cells = (6, 6) if scaling == "consistent" else (4, 6)
    return fs.refined_map(
        words, over, refinement=fs.Refinement(cells=cells, levels=1, resolution=5e-4)
    )


def edge(scaling: str, width: float, omega: Floats) -> Floats:
    """Decimal logarithm of C/B − 1 at which the criterion's widest gap is a width."""
    p = dict(gear(scaling).parameters)
    ratio = critical_ratio({**p, "D": width, "omega": omega}, exact=True)
    return np.asarray(np.log10(ratio - 1))


def distance(scaling: str) -> float:
    """Largest distance of the map's edges from the criterion's, in parts of C/B − 1."""
    found, worst = region(scaling), 0.0
    for other, width in ((ALL, WIDTHS[2]), (FEWER, WIDTHS[1])):
        for line in found.boundary(AS_STATED, other):
            apart = line.points[:, 1] - edge(scaling, width, line.points[:, 0])
            worst = max(worst, float(np.abs(10**apart - 1).max()))
    return worst


def draw(into: Output) -> None:
    """Draw the region under both scalings."""
    sheet = new_figure(FULL, 70 * MM)
    axes = [styled_axes(ax) for ax in sheet.subplots(1, 2)]
    for ax, letter, scaling in zip(axes, "ab", SCALINGS, strict=True):
        omega = np.linspace(*FREQUENCIES, 100)
        curves = {
            f"criterion, D = {width}": (omega, edge(scaling, width, omega)) for width in WIDTHS[1:]
        }
        found = region(scaling)
        fills = {AS_STATED: "#F7DFA8", ALL: "#8FC3E6", FEWER: "#F4F4F4"}
        fs.plot.regime_map(found, ax=ax, curves=curves, fills=fills, legend=False)
        ax.set_title(f"({letter}) {scaling} scaling", loc="left", fontsize=TEXT)
        ax.set_xlabel(r"$\omega_\mathrm{o}$")
        ax.set_ylabel("$C/B - 1$")
        low, high = EXCESSES[scaling]
        ax.set_xticks([0.005, 0.01, 0.015])
        ticks = [m * 10.0**n for n in range(-4, 0) for m in (1, 2, 5)]
        ax.set_yticks([t for t in np.log10(ticks) if low <= t <= high])
        ax.yaxis.set_major_formatter(FuncFormatter(lambda y, _: f"{10**y:.2g}"))
    into.save(sheet, "gap_region")
