"""Basins of attraction of motions that coexist under two fast loads.

Not in the source, under whose slow loads there is one motion. Under a load of 10 N m, which never
changes sign, the teeth may stay in contact or meet both flanks; under one of 15 N m motions of
one and of two periods coexist.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from pathlib import Path

from matplotlib.patches import Patch

import fastslow as fs
from analyses.cases import GAP, gear
from analyses.claims import Claim, Finding
from analyses.output import Output
from fastslow.plot.layout.style import FULL, GREY, MM, SMALL_TEXT, TEXT, new_figure, styled_axes

#: Amplitude of the torque, N m, and frequency.
LOADS = ((10.0, 3.2), (15.0, 7.8))

#: Initial states, and how they are divided.
BOX = {"x": (-0.9, 0.9), "v": (-5.0, 5.0)}
REFINEMENT = fs.Refinement(cells=(20, 15), levels=2, resolution=5e-3)

#: Initial states from which attractors are found.
TRIED = 60

#: Colours of the basins.
COLOURS = ("#BFD7EA", "#F6D5B8", "#C9E4CA")


@dataclass(frozen=True, eq=False)
class Coexisting:
    """The motions under a load, by their largest twist, and their basins."""

    T_am: float
    omega: float
    known: fs.Attractors
    plane: fs.RefinedMap


@cache
def coexisting(T_am: float, omega: float) -> Coexisting:
    """Find the motions under a load and their basins."""
    model = gear("consistent", omega, D=GAP, T_am=T_am)
    known = fs.attractors(model, BOX, TRIED)
    return Coexisting(T_am, omega, known, fs.basins(model, BOX, known=known, refinement=REFINEMENT))


def sides(orbit: fs.Orbit) -> str:
    """Sides on which the teeth of a motion are in contact."""
    upper, lower = orbit["max(x)"] > GAP, orbit["min(x)"] < -GAP
    return "bilateral" if upper and lower else "unilateral"


def size(orbit: fs.Orbit) -> float:
    """The twist, peak to peak."""
    return float(orbit["max(x)"] - orbit["min(x)"])


def motions(found: Coexisting) -> list[fs.Orbit]:
    """The motions under a load; all of them are periodic."""
    orbits = [one for one in found.known if isinstance(one, fs.Orbit)]
    assert len(orbits) == len(found.known)
    return orbits


@cache
def claims() -> tuple[Claim, ...]:
    """How many motions coexist, and how likely each is."""
    light, heavy = (coexisting(*load) for load in LOADS)
    (both, upper), (one, two) = motions(light), motions(heavy)
    kinds = [sides(orbit) for orbit in (both, upper, one, two)]
    assert kinds == ["bilateral", "unilateral", "unilateral", "unilateral"]
    assert [orbit.multiple for orbit in (both, upper, one, two)] == [1, 1, 1, 2]
    return (
        Claim(
            "B17",
            "Under fast loads the initial state decides which motion is reached.",
            "Attractors from 60 initial states and their basins, refined at their boundaries, for "
            "|x| ≤ 0.9 and |v| ≤ 5 at time 0, at T_am = 10 N m with ω_o = 3.2 and at 15 N m with "
            "7.8, D = 0.25, in the consistent scaling.",
            (
                Finding(
                    "either",
                    "beyond the paper",
                    "At 10 N m, a load that never changes sign, a bilateral motion of size "
                    "{both:.4f}, peak to peak, has {share:.1%} of the area, and a unilateral one "
                    "of size {upper:.4f} the rest. At 15 N m unilateral motions of one and of two "
                    "periods, of sizes {one:.4f} and {two:.4f}, have {single:.1%} and "
                    "{double:.1%}.",
                    {
                        "both": size(both),
                        "upper": size(upper),
                        "share": light.plane.shares["A1"],
                        "one": size(one),
                        "two": size(two),
                        "single": heavy.plane.shares["A1"],
                        "double": heavy.plane.shares["A2"],
                    },
                ),
            ),
            ("coexistence",),
        ),
    )


def main(into: Output) -> None:
    """Draw the basins under both loads, with the motions at whole periods of the load."""
    sheet = new_figure(FULL, 84 * MM)
    axes = [styled_axes(ax) for ax in sheet.subplots(1, 2)]
    handles = []
    for letter, ax, load in zip("ab", axes, LOADS, strict=True):
        found = coexisting(*load)
        fills = dict(zip(found.known.labels, COLOURS, strict=False))
        fs.plot.basins(found.plane, found.known, ax=ax, fills=fills, legend=False)
        torque, frequency = load
        title = rf"$T_\mathrm{{am}} = {torque:g}$ N m, $\omega_\mathrm{{o}} = {frequency:g}$"
        ax.set_title(f"({letter}) {title}", loc="left", fontsize=TEXT)
        for name, orbit in zip(found.known.labels, motions(found), strict=True):
            periods = f"{orbit.multiple} period{'s' if orbit.multiple != 1 else ''}"
            words = f"({letter}) {name}: {sides(orbit)}, {periods}"
            handles.append(Patch(facecolor=fills[name], edgecolor=GREY, linewidth=0.5, label=words))
    # the columns of the legend are those of the panels
    sheet.legend(
        handles=handles, loc="outside lower center", ncols=2, fontsize=SMALL_TEXT, frameon=False
    )
    into.save(sheet, "coexistence")


if __name__ == "__main__":
    main(Output(Path("figures")))
