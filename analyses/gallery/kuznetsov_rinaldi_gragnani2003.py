"""Harvesting above a threshold: a Filippov predator-prey model with sliding cycles."""

from __future__ import annotations

from functools import cache

import sympy as sp

import fastslow as fs
from analyses.claims import Claim, Finding, Quantity
from analyses.gallery import About

ABOUT = About(
    title="Kuznetsov, Rinaldi, Gragnani: harvesting a predator above a threshold",
    why="A predator is harvested only while its population exceeds a threshold. For which "
    "thresholds does the population oscillate, and which bifurcations occur that smooth systems "
    "do not have?",
    source="Yu. A. Kuznetsov, S. Rinaldi and A. Gragnani, One-parameter bifurcations in planar "
    "Filippov systems, International Journal of Bifurcation and Chaos 13(8), 2157-2188, 2003, "
    "section 6; F. Dercole and Yu. A. Kuznetsov, SlideCont, ACM Transactions on Mathematical "
    "Software 31(1), 95-119, 2005",
    field="ecology",
    phenomena=(
        "Filippov system",
        "pseudo-saddle-node",
        "pseudo-equilibrium",
        "boundary equilibrium",
        "grazing-sliding",
        "sliding cycle",
        "homoclinic orbit of a pseudo-saddle",
    ),
    slow="Nothing in the model; the threshold $P$ of harvesting is varied, as by management.",
    caption="(a) Equilibria and pseudo-equilibria over the threshold, with the envelope of the "
    "cycles: above GS the natural cycle, below it a cycle with sliding, which ends at a homoclinic "
    "orbit. (b) A sliding cycle, at $P = 1.5$.",
    compared="The source draws the phase portraits between its bifurcations with the axes of (b), "
    "and a diagram in two parameters; (a) is a section through the latter, drawn here alone.",
    unsaid=(
        "The values of the parameters are recalled from SlideCont's example and not confirmed.",
    ),
)


def model() -> fs.Model:
    """Prey and predator of Rosenzweig and MacArthur; the predator is harvested above P."""
    x, y = sp.symbols("x y")
    a, b, d, E, P = names = sp.symbols("a b d E P")
    eaten = a * x / (b + x) * y
    harvest = sp.Piecewise((E * y, y > P), (0, True))
    return fs.Model(
        {x: x * (1 - x) - eaten, y: eaten - d * y - harvest},
        parameters=dict(zip(names, (0.3556, 0.33, 0.0444, 0.2067, 1.5), strict=True)),
    )


def figure() -> fs.plot.Drawing:
    """Draw equilibria and cycles over the threshold, and a sliding cycle."""
    left, right = fs.plot.axes("ab", height=85)
    left.set_ylim(-0.05, 1.05)
    diagram = fs.continue_equilibria(model().with_free("P"), "P", over=(0.4, 3))
    orbit = fs.find_orbit(model(), [0.3, 1])
    cycles = fs.continue_orbits(orbit, "P", over=(1.1, 3))
    fs.plot.phase_portrait(orbit.trajectory, "x", "y", ax=right)
    return fs.plot.diagram(diagram, "x", ax=left, cycles=cycles)


@cache
def claims() -> tuple[Claim, ...]:
    """Boundary equilibria, the pseudo-saddle-node, and both ends of the sliding cycles."""
    diagram = fs.continue_equilibria(model().with_free("P"), "P", over=(0.4, 3))
    harvested, natural = sorted(diagram.boundary_equilibria, key=lambda point: point["P"])
    (fold,) = diagram.folds
    cycles = fs.continue_orbits(fs.find_orbit(model(), [0.3, 1]), "P", over=(1.1, 3))
    grazing = cycles.special("GS")[0]
    (end,) = (each for each in cycles.outcomes if each.code == "homoclinic to a pseudo-saddle")
    closed = "closed form"
    return (
        Claim(
            "1",
            "With a falling threshold the natural cycle becomes a sliding cycle, then a "
            "pseudo-equilibrium, then the harvested equilibrium.",
            "Equilibria and cycles over the threshold.",
            (
                Finding(
                    "either",
                    "holds",
                    "The natural cycle grazes the threshold at $P = {grazing:.5f}$; all cycles "
                    "below slide, down to $P = {last:.4f}$, beside the value at which they become "
                    "{end}. The harvested boundary equilibrium is of type {harvested}, the natural "
                    "one a {natural}.",
                    {
                        "grazing": grazing["P"],
                        "last": cycles["P"].min(),
                        "end": end.code,
                        "harvested": harvested.type,
                        "natural": natural.type,
                    },
                ),
            ),
            quantities=(
                Quantity(
                    "harvested boundary equilibrium, $P$",
                    harvested["P"],
                    "0.653850415512465",
                    closed,
                ),
                Quantity("its $x$", harvested["x"], "0.792947368421053", closed),
                Quantity(
                    "natural boundary equilibrium, $P$", natural["P"], "1.01048474765565", closed
                ),
                Quantity("its $x$", natural["x"], "0.0470822622107969", closed),
                Quantity("pseudo-saddle-node, $P$", fold["P"], "1.24360236220472", closed),
                Quantity("its $x = (1 - b)/2$", fold["x"], "0.33500000000000", closed),
            ),
        ),
    )
