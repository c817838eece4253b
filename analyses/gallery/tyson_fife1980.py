"""The Oregonator in two variables: the Belousov-Zhabotinskii reaction."""

from __future__ import annotations

from functools import cache

import numpy as np
import sympy as sp

import fastslow as fs
from analyses.claims import Claim, Finding, Quantity
from analyses.gallery import About

ABOUT = About(
    title="Tyson, Fife: relaxation oscillations of the Oregonator",
    why="The Oregonator is the standard model of the Belousov–Zhabotinsky reaction. For which "
    "stoichiometry does the reaction oscillate, and what causes its fast jumps?",
    source="J. J. Tyson and P. C. Fife, Target patterns in a realistic model of the "
    "Belousov-Zhabotinskii reaction, Journal of Chemical Physics 73(5), 2224-2237, 1980, the model "
    "in two variables; R. J. Field and R. M. Noyes, Journal of Chemical Physics 60, 1877-1884, "
    "1974",
    field="chemistry",
    phenomena=("relaxation oscillation", "fold", "Hopf bifurcation"),
    slow="The oxidised catalyst $z$; the bromous acid $x$ is faster by $1/\\epsilon = 25$.",
    caption="(a) Bromous acid and catalyst over time, $f = 1$. (b) The oscillation over the "
    "equilibria of the frozen model; $x$ is drawn logarithmically.",
    compared="The source draws the nullclines in the plane of (b), of which the nullcline of $x$ "
    "is the curve of (b), at other values of $f$. (a) is added here.",
    unsaid=(
        "The value of $\\epsilon$ for this figure; here 0.04, with $q = 8 \\times 10^{-4}$.",
        "Whether the oscillations begin softly at the Hopf points: one is sub-, one supercritical.",
    ),
)


def model() -> fs.Model:
    """The Oregonator with the bromide in equilibrium."""
    x, z = sp.symbols("x z")
    f, q, epsilon = sp.symbols("f q epsilon")
    return fs.Model(
        {x: (x * (1 - x) - f * z * (x - q) / (x + q)) / epsilon},
        slow={z: x - z},
        parameters={f: 1, q: 0.0008, epsilon: 0.04},
    )


def figure() -> fs.plot.Drawing:
    """Draw the oscillation over time and over the frozen equilibria."""
    left, right = fs.plot.axes("ab", height=75)
    run = fs.simulate(model(), [0.5, 0.1], t=(0, 20))
    diagram = fs.continue_equilibria(model().frozen(), "z", over=(0, 0.5), window={"x": (1e-4, 1)})
    for name, color in (("x", "#0072B2"), ("z", "grey")):
        fs.plot.time_series(run, name, ax=left, label=False, color=color)
        left.text(13.0, {"x": 0.6, "z": 0.2}[name], f"${name}$", color=color)
    left.set_ylabel("concentration")
    right.set(yscale="log", ylim=(4e-4, 2))
    return fs.plot.overlay(fs.overlay(diagram, run), "x", ax=right)


@cache
def claims() -> tuple[Claim, ...]:
    """Folds, Hopf points and the period."""
    diagram = fs.continue_equilibria(model().frozen(), "z", over=(0, 0.5), window={"x": (1e-4, 1)})
    high, low = sorted(diagram.folds, key=lambda point: -point["x"])
    full = model().frozen(fast=["z"]).with_free("f")
    states = {"x": (1e-4, 1), "z": (0, 1)}
    hopf = fs.continue_equilibria(full, "f", over=(0.3, 3), window=states).special("HB")
    first, second = sorted(hopf, key=lambda point: point["f"])
    orbit = fs.find_orbit(model(), [0.5, 0.1])
    ends = [point["z"] / point["x"] for point in (high, low)]
    exact = "mpmath"
    return (
        Claim(
            "1",
            "The reaction oscillates for stoichiometric factors $f$ between two Hopf points.",
            "Equilibria of the full model over $f$.",
            (
                Finding(
                    "either",
                    "holds",
                    "The lower point is {first}, the upper one {second}.",
                    {"first": first.criticality, "second": second.criticality},
                ),
            ),
            quantities=(
                Quantity("lower Hopf point, $f$", first["f"], "0.522611987277153", exact),
                Quantity("upper Hopf point, $f$", second["f"], "2.33804017952091", exact),
            ),
        ),
        Claim(
            "2",
            "At $f = 1$ it is a relaxation oscillation, which jumps at two folds.",
            "Folds of the frozen model, and the periodic orbit.",
            (
                Finding(
                    "either",
                    "holds",
                    "The orbit is stable; the logarithm of its multiplier is {multiplier:.0f}.",
                    {"multiplier": orbit.log_multipliers[1]},
                ),
            ),
            quantities=(
                Quantity("upper fold, $f z$", high["z"], "0.250801926170352", exact),
                Quantity("upper fold, $x$", high["x"], "0.49919742557159", exact),
                Quantity("lower fold, $f z$", low["z"], "0.00465373004071852", exact),
                Quantity("lower fold, $x$", low["x"], "0.0019340229055827", exact),
                Quantity("period", orbit.period, "5.75926698", "SciPy, DOP853, rtol 3e-13"),
            ),
        ),
        Claim(
            "3",
            "In the limit $\\epsilon \\to 0$ the reaction oscillates while its equilibrium is "
            "between the folds, to leading order in $q$ for $1/2 < f < 1 + \\sqrt 2$.",
            "The factors $f$ for which an equilibrium $x = z$ is at a fold of the frozen model.",
            (
                Finding(
                    "either",
                    "holds",
                    "At this $q$ the factors differ from 1/2 and $1 + \\sqrt 2$ by {low:.4f} and "
                    "{high:.4f}.",
                    {"low": ends[0] - 0.5, "high": ends[1] - 1 - np.sqrt(2)},
                ),
            ),
            quantities=(
                Quantity("lower factor", ends[0], "0.5024102957", exact, "1/2"),
                Quantity("upper factor", ends[1], "2.4062434976", exact, "$1 + \\sqrt 2$"),
            ),
        ),
    )
