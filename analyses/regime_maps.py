"""Where the gear's impacts change from bilateral to unilateral, and what slow-load theory says.

The source states that a wider gap alone turns bilateral impacts (D = 0.1, 0.25)
into unilateral ones (D = 0.5). With its loads, C/B = 1.49, it does not; it does
where the load barely changes sign. The maps show where: over the width of the
gap and the load's ratio C/B, and over the load's frequency and C/B. The dashed
curve is the criterion for a slow load; it needs no simulation.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import fastslow as fs
from analyses.output import Output
from analyses.passages import OMEGA, REST

Floats = NDArray[np.float64]

#: Gap of the map over the frequency.
GAP = 0.25

#: Two widths of the source, on either side of the change that it states.
WIDTHS = (0.25, 0.5)

#: How often a cell is halved at most.
LEVELS = 3


@dataclass(frozen=True, eq=False)
class Plane:
    """A plane of two parameters, the second of which is C/B.

    Parameters
    ----------
    name : str
        What the figure's file is called.
    title : str
        What is kept fixed, as mathematics.
    parameter : str
        The first parameter, and how its axis is labelled.
    over : (float, float)
    ratios : (float, float)
        Range of C/B.
    cells : (int, int)
    """

    name: str
    title: str
    parameter: str
    over: tuple[float, float]
    ratios: tuple[float, float]
    cells: tuple[int, int]


#: The widths of the source, 0.1, 0.25 and 0.5, are lines of the grid.
PLANES = (
    Plane(
        "regimes_width", rf"$\omega_\mathrm{{o}} = {OMEGA:g}$", "D", (0.05, 0.65), (0.9948, 1.0248),
        (12, 6),
    ),
    Plane("regimes_frequency", f"$D = {GAP}$", "omega", (0.01, 0.17), (0.979, 1.079), (8, 5)),
)  # fmt: skip


@dataclass(frozen=True)
class MapRow:
    """The numbers of one map.

    Parameters
    ----------
    map : str
    bilateral, unilateral, meshed : float
        Parts of its area.
    corners, pixels : int
        Corners of its cells, and points of a grid as fine as the finest of them.
    evaluations : int
        Points simulated, those along the edges included.
    agreement, agreement_exact : float
        Part of the area on which the criterion says what the simulation shows:
        expanded for a slow load, and solved in the gap.
    distance, distance_exact : float
        Largest distance in C/B of the simulated edge between bilateral and
        unilateral from the criterion's.
    change_from, change_to : float
        C/B between which the smaller of two widths is bilateral and the larger
        unilateral; NaN for a map over something else.
    """

    map: str
    bilateral: float
    unilateral: float
    meshed: float
    corners: int
    pixels: int
    evaluations: int
    agreement: float
    agreement_exact: float
    distance: float
    distance_exact: float
    change_from: float
    change_to: float


def gear() -> fs.Model:
    """The gear of all maps."""
    return fs.systems.harmonic_gear_from_physical().with_parameters(D=GAP, omega=OMEGA)


@cache
def simulated(plane: Plane) -> fs.RefinedMap:
    """The regimes in a plane, each from the second of two periods from rest."""
    return fs.regime_map(
        gear(),
        {plane.parameter: plane.over, "ratio": plane.ratios},
        REST,
        parameters={"C": "B*ratio"},
        refinement=fs.Refinement(cells=plane.cells, levels=LEVELS, resolution=2e-4),
        periods=2,
    )


def predicted(plane: Plane, exact: bool) -> Callable[[Floats, Floats], list[str]]:
    """What the criterion says in a plane."""
    model = gear()

    def regimes(first: Floats, ratio: Floats) -> list[str]:
        values = {plane.parameter: first, "C": model.parameters["B"] * ratio}
        regimes = fs.systems.slow_load_criterion(model, values, exact=exact).regime.tolist()
        return [str(word) for word in regimes]

    return regimes


def critical_ratio(parameters: Mapping[str, Any], exact: bool) -> Floats:
    """C/B at which the criterion's widest gap is the gap itself, by bisection.

    Parameters
    ----------
    parameters : mapping
        A, B, D and omega of the gear, numbers or arrays broadcast together.
    exact : bool
        As in `fastslow.systems.slow_load_gap`.
    """
    A, B, D, omega = np.broadcast_arrays(*(parameters[name] for name in ("A", "B", "D", "omega")))
    # the excess C/B - 1 is halved on a logarithmic scale
    low, high = np.full(D.shape, -9.0), np.full(D.shape, 9.0)
    for _ in range(60):
        middle = 0.5 * (low + high)
        swing = B * (1.0 + 10.0**middle)
        wide = fs.systems.slow_load_gap(B, swing, omega, stiffness=A + D**2, exact=exact) < D
        low, high = np.where(wide, middle, low), np.where(wide, high, middle)
    return np.asarray(1.0 + 10.0**high)


def _along(plane: Plane, first: Floats) -> dict[str, Any]:
    return {**dict(gear().parameters), plane.parameter: first}


def row(plane: Plane) -> MapRow:
    """The numbers of a map."""
    found = simulated(plane)
    lines = found.boundary("bilateral", "unilateral upper")
    edge = np.concatenate([line.points for line in lines])
    shares = found.shares
    agree, away, change = [], [], []
    for exact in (False, True):
        agree.append(found.compare(predicted(plane, exact)).share)
        there = critical_ratio(_along(plane, edge[:, 0]), exact)
        away.append(float(np.abs(there - edge[:, 1]).max()))
    for width in WIDTHS:
        at = edge[np.abs(edge[:, 0] - width) < 1e-9, 1]
        change.append(float(at[0]) if plane.parameter == "D" else float("nan"))
    return MapRow(
        plane.name,
        shares["bilateral"],
        shares["unilateral upper"],
        shares["meshed upper"],
        len(found.corners),
        found.n_pixels,
        found.n_evaluations,
        *agree,
        *away,
        *change,
    )


def draw(plane: Plane, into: Output) -> None:
    """Draw the map with the criterion's curve over it."""
    first = np.linspace(*plane.over, 200)
    curve = (first, critical_ratio(_along(plane, first), exact=False))
    drawing = fs.plot.regime_map(simulated(plane), curves={"slow-load criterion": curve})
    drawing.ax.set_ylabel("$C/B$")
    drawing.ax.set_title(plane.title, fontsize=8)
    if plane.parameter == "omega":
        drawing.ax.set_xlabel(r"$\omega_\mathrm{o}$")
    into.save(drawing.figure, plane.name)


def main(into: Output) -> None:
    """Draw the maps and print their numbers."""
    for plane in PLANES:
        draw(plane, into)
        print(row(plane))


if __name__ == "__main__":
    main(Output(Path("figures")))
