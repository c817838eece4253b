"""The simplest dissipative nonautonomous chaotic circuit: Murali, Lakshmanan and Chua."""

from __future__ import annotations

from functools import cache

import numpy as np
import sympy as sp

import fastslow as fs
from analyses.claims import Claim, Finding, Quantity
from analyses.gallery import About

ABOUT = About(
    title="Murali, Lakshmanan, Chua: period doubling in a driven circuit",
    why="The circuit of Murali, Lakshmanan and Chua, one inductor, one capacitor and one "
    "piecewise-linear resistor, is the simplest driven circuit that is chaotic. Through which "
    "bifurcations does chaos appear as the amplitude of the drive grows?",
    source="K. Murali, M. Lakshmanan and L. O. Chua, The simplest dissipative nonautonomous "
    "chaotic circuit, IEEE Transactions on Circuits and Systems I 41(6), 462-463, 1994, "
    "equations (1) and (2)",
    field="circuits",
    phenomena=("piecewise-linear circuit", "forced orbit", "period doubling", "chaos"),
    slow="Nothing in the model; the amplitude $F$ of the drive is varied.",
    caption="(a) States at whole periods of the drive over its amplitude, up and down. (b) The "
    "double-band attractor at $F = 0.15$, 60 periods.",
    compared="The source shows phase portraits of the experiment and of the equations at single "
    "amplitudes, with the axes of (b) and the same parameters; (a) is drawn here alone.",
    unsaid=(
        "The initial states; two attractors exist, each the mirror image of the other.",
        "The amplitudes of the doublings.",
    ),
)


def model() -> fs.Model:
    """Chua's diode in a driven series circuit, dimensionless."""
    x, y, t = sp.symbols("x y t")
    a, b, beta, nu, omega, F = names = sp.symbols("a b beta nu omega F")
    diode = b * x + (a - b) / 2 * (sp.Abs(x + 1) - sp.Abs(x - 1))
    return fs.Model(
        {x: y - diode, y: F * sp.sin(omega * t) - beta * (1 + nu) * y - beta * x},
        parameters=dict(zip(names, (-1.02, -0.55, 1, 0.015, 0.72, 0.065), strict=True)),
    )


def figure() -> fs.plot.Drawing:
    """Draw states at whole periods over the amplitude, and the double-band attractor."""
    left, right = fs.plot.axes("ab", height=75)
    run = fs.simulate(model().with_parameters(F=0.15), [-1, 1], periods=60)
    fs.plot.phase_portrait(run, "x", "y", ax=right, label=False, crossings=False, linewidth=0.4)
    amplitudes = np.linspace(0.05, 0.15, 200)
    sweep = fs.bifurcation_sweep(model(), "F", amplitudes, [-1, 1], settle=150, keep=40)
    return fs.plot.sweep(sweep, ax=left)


@cache
def claims() -> tuple[Claim, ...]:
    """The first period doubling, and the motions on both sides."""
    orbit = fs.find_orbit(model(), [-1.16, 0.98])
    branch = fs.continue_orbits(orbit, "F", over=(0.05, 0.1))
    (doubling,) = branch.special("PD")
    own = "shooting with variational equations divided at the switchings, eigenvalue −1"
    periods = [
        fs.simulate(model().with_parameters(F=F), [-1, 1], periods=400).periodicity().multiple or 0
        for F in (0.065, 0.08)
    ]
    chaotic = model().with_parameters(F=0.15)
    spectrum = fs.lyapunov(chaotic, [-1, 1], periods=300)
    visited = sorted(set(fs.simulate(chaotic, [-1, 1], periods=300).itinerary))
    return (
        Claim(
            "1",
            "As the amplitude grows, the motion has one period of the drive, then two, then is "
            "chaotic, on one band and at last on both.",
            "Simulations at $F = 0.065$, 0.08 and 0.15.",
            (
                Finding(
                    "either",
                    "holds",
                    "At $F = 0.15$ the motion is {outcome}, by its largest Lyapunov exponent, and "
                    "on both bands.",
                    {"outcome": spectrum.outcome.code},
                ),
            ),
            quantities=(
                Quantity("periods at $F = 0.065$", periods[0], "1", "the source", "1"),
                Quantity("periods at $F = 0.08$", periods[1], "2", "the source", "2"),
                Quantity(
                    "segments of the diode visited at $F = 0.15$",
                    ", ".join(visited),
                    "S1, S2, S3",
                    "a double band has all",
                ),
            ),
        ),
        Claim(
            "2",
            "The first period doubling.",
            "The branch of the orbit of one period over the amplitude.",
            (
                Finding(
                    "either",
                    "beyond the paper",
                    "The orbit crosses the break point $x = -1$ of the diode twice.",
                ),
            ),
            quantities=(
                Quantity("$F$ of the doubling", doubling["F"], "0.06882571456507", own),
                Quantity("$x$ at phase 0", doubling.orbit(0)[0], "-1.160419452383", own),
                Quantity("$y$ at phase 0", doubling.orbit(0)[1], "0.986158491831", own),
                Quantity(
                    "first multiplier at $F = 0.065$", orbit.multipliers[0].real, "-0.8958321", own
                ),
                Quantity("second", orbit.multipliers[1].real, "-0.12475829", own),
            ),
        ),
    )
