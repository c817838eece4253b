"""Welander's box model of ocean convection, a Filippov oscillator."""

from __future__ import annotations

import re
from functools import cache

import sympy as sp

import fastslow as fs
from analyses.claims import Claim, Finding, Quantity
from analyses.gallery import About

ABOUT = About(
    title="Welander: a self-sustained oscillation of ocean convection",
    why="Convection in the ocean can switch on and off without external forcing. For which "
    "thresholds of convection does a column of water oscillate, and how does the oscillation "
    "begin?",
    source="P. Welander, A simple heat-salt oscillator, Dynamics of Atmospheres and Oceans 6, "
    "233-242, 1982; as a Filippov system: J. Leifeld, Smooth and nonsmooth bifurcations in "
    "Welander's convection model, arXiv 1601.07936, 2016",
    field="climate",
    phenomena=(
        "Filippov system",
        "two-fold",
        "pseudo-equilibrium",
        "boundary equilibrium",
        "self-sustained oscillation",
    ),
    slow="Nothing in the model; the threshold $\\epsilon$ of convection is varied.",
    caption="(a) Equilibria and pseudo-equilibria over the threshold, with the envelope of the "
    "oscillation. (b) The oscillation at $\\epsilon = -0.01$ over the density "
    "$S - \\alpha T$, whose value $\\epsilon$ is the interface.",
    compared="The sources draw phase portraits at single thresholds, with temperature and "
    "salinity as axes; the diagram (a) is drawn here alone. Leifeld uses coordinates that make "
    "the interface a line of constant $y$.",
    unsaid=(
        "The values of the parameters, $\\alpha = 0.8$, $\\beta = 0.5$, $k_0 = 0$ and $k_1 = 5$, "
        "are recalled and not confirmed.",
    ),
)


def model() -> fs.Model:
    """Welander's temperature and salinity with an abrupt onset of convection."""
    T, S, threshold = sp.symbols("T S epsilon")
    alpha, beta, k_0, k_1 = sp.symbols("alpha beta k_0 k_1")
    k = sp.Piecewise((k_1, S - alpha * T > threshold), (k_0, True))
    return fs.Model(
        {T: 1 - T - k * T, S: beta * (1 - S) - k * S},
        parameters={alpha: 0.8, beta: 0.5, k_0: 0, k_1: 5, threshold: -0.01},
    )


def figure() -> fs.plot.Drawing:
    """Draw the bifurcation diagram with the oscillation, and one phase portrait."""
    diagram = fs.continue_equilibria(model().with_free("epsilon"), "epsilon", over=(-0.1, 0.3))
    orbit = fs.find_orbit(model(), [0.75, 0.62])
    cycles = fs.continue_orbits(orbit, "epsilon", over=(-0.1, -1e-4))
    left, right = fs.plot.axes("ab", height=75)
    fs.plot.phase_portrait(orbit.trajectory, "T", "S - alpha*T", ax=right)
    return fs.plot.diagram(diagram, "T", ax=left, cycles=cycles)


@cache
def claims() -> tuple[Claim, ...]:
    """Special points in closed form, and periods."""
    diagram = fs.continue_equilibria(model().with_free("epsilon"), "epsilon", over=(-0.1, 0.3))
    low, high = sorted(point["epsilon"] for point in diagram.boundary_equilibria)
    (fold,) = diagram.folds
    two = diagram.special("TF")[0]
    closed = "closed form"
    orbit = fs.find_orbit(model(), [0.75, 0.62])
    cycles = fs.continue_orbits(orbit, "epsilon", over=(-0.1, -0.01))
    limit = re.search(r"epsilon = (\S+),", str(cycles.outcomes[0]))
    periods = [
        Quantity(
            rf"period at $\epsilon = {threshold:g}$",
            fs.find_orbit(model().with_parameters(epsilon=threshold), [0.75, 0.62]).period,
            digits,
            "SciPy, DOP853 with events, rtol 3e-14",
        )
        for threshold, digits in (
            (-0.005, "1.16190788098"),
            (-0.01, "1.57334879877"),
            (-0.03, "2.39133903877"),
        )
    ]
    return (
        Claim(
            "1",
            "For a threshold just below zero the convection oscillates by itself, although the "
            "forcing is constant.",
            "Periodic orbits at three thresholds.",
            (Finding("either", "holds", "The orbits are stable and cross the interface twice."),),
            quantities=tuple(periods),
        ),
        Claim(
            "2",
            "The oscillation begins where the pseudo-equilibrium loses stability at a two-fold.",
            "Equilibria and pseudo-equilibria over the threshold.",
            (
                Finding(
                    "either",
                    "holds",
                    "Pseudo-equilibria are stable (sliding) above the two-fold and unstable "
                    "(escaping) below it.",
                ),
            ),
            quantities=(
                Quantity(r"two-fold, $\epsilon$", two["epsilon"], "0.0000000000000", closed, "0"),
                Quantity("two-fold, $T$", two["T"], "0.75000000000000", closed),
                Quantity("two-fold, $S$", two["S"], "0.60000000000000", closed),
                Quantity(
                    r"boundary equilibrium, $\epsilon = 1 - \alpha$",
                    high,
                    "0.20000000000000",
                    closed,
                ),
                Quantity(
                    r"boundary equilibrium, $\epsilon = \beta/(\beta + k_1) - \alpha/(1 + k_1)$",
                    low,
                    "-0.04242424242424",
                    closed,
                ),
                Quantity(
                    r"fold of pseudo-equilibria, $\epsilon$",
                    fold["epsilon"],
                    "-0.07017787186530",
                    closed,
                ),
            ),
        ),
        Claim(
            "3",
            "The oscillation ends at a boundary equilibrium.",
            "The branch of oscillations, traced from $\\epsilon = -0.01$ downwards.",
            (Finding("either", "holds", f"The outcome of the branch: {cycles.outcomes[0]}"),),
            quantities=(
                Quantity(
                    r"limit of the branch, $\epsilon$",
                    limit[1] if limit else "none",
                    "-0.04242424242",
                    closed,
                ),
            ),
        ),
    )
