"""The canard explosion of van der Pol's oscillator, and that of FitzHugh and Nagumo's model."""

from __future__ import annotations

from functools import cache
from math import pi, sqrt

import numpy as np
import sympy as sp

import fastslow as fs
from analyses.claims import Claim, Finding, Quantity
from analyses.gallery import About
from analyses.physical_route import within

ABOUT = About(
    title="Krupa, Szmolyan: the canard explosion",
    why="Between a small oscillation and a relaxation oscillation there is hardly any value of the "
    "parameter. What do the cycles between them look like, and at which value are they?",
    source="M. Krupa and P. Szmolyan, Relaxation oscillation and canard explosion, Journal of "
    "Differential Equations 174, 312-368, 2001, and SIAM Journal on Mathematical Analysis 33, "
    "286-314, 2001; A. K. Zvonkin and M. A. Shubin, Non-standard analysis and singular "
    "perturbations of ordinary differential equations, Russian Mathematical Surveys 39(2), "
    "69-131, 1984",
    field="physics",
    phenomena=("canard explosion", "relaxation oscillation", "Hopf bifurcation"),
    slow="The state $y$; $x$ is faster by $1/\\epsilon = 100$.",
    caption="(a) Canard cycles of seven heights over the critical manifold: their values of $a$ "
    "agree to $10^{-13}$, but for the lowest one. (b) Their period over their leftmost point.",
    compared="The sources sketch the cycles as in (a); (b) is added here.",
    unsaid=(
        "Values of $\\epsilon$ and heights: here 0.01, and seven heights.",
        "FitzHugh and Nagumo's model is added here, with $b_0 = 0.7$, $b_1 = 0.8$ and "
        "$\\epsilon = 0.02$.",
    ),
)


def model() -> fs.Model:
    """Van der Pol's oscillator with a constant force a."""
    x, y, a, epsilon = sp.symbols("x y a epsilon")
    return fs.Model(
        {x: (y - x**3 / 3 + x) / epsilon}, slow={y: a - x}, parameters={a: 1, epsilon: 0.01}
    )


def figure() -> fs.plot.Drawing:
    """Draw canard cycles over the critical manifold, and their periods."""
    left, right = fs.plot.axes("ab", height=75)
    (point,) = fs.slow_flow(model()).points
    canard = fs.find_canard(model(), point, "a")
    heads = [{"x": -1, "y": y} for y in (0.5, 0, -0.4)]
    points = [{"y": y} for y in (-0.6, -0.4, 0, 0.4)] + heads
    cycles = [fs.find_orbit(model(), canard, at=at) for at in points]
    right.plot([c["min(x)"] for c in cycles], [c.period for c in cycles], "o", color="#009E73")
    right.set(xlabel="smallest $x$", ylabel="period")
    for cycle in cycles:
        fs.plot.phase_portrait(cycle.trajectory, "x", "y", ax=left, label=False, linewidth=0.8)
    manifold = fs.continue_equilibria(model().frozen(), "y", over=(-0.8, 1))
    return fs.plot.diagram(manifold, "y", x="x", ax=left)


def canard_of(one: fs.Model, name: str) -> tuple[fs.Canard, float]:
    """The maximal canard at the left or only canard point, and its value to first order."""
    points = [p for p in fs.slow_flow(one, parameter=name).points if p.canard is not None]
    point = min(points, key=lambda p: p.values[one.states[0]])
    assert point.canard is not None
    return fs.find_canard(one, point, name), point.canard.canard


def neuron() -> fs.Model:
    """FitzHugh and Nagumo's model over its current."""
    v, w, current, epsilon = sp.symbols("v w I epsilon")
    return fs.Model(
        {v: (v - v**3 / 3 - w + current) / epsilon},
        slow={w: v + 0.7 - 0.8 * w},
        parameters={current: 0.3, epsilon: 0.02},
    )


@cache
def claims() -> tuple[Claim, ...]:
    """Values of the maximal canards, and cycles of all heights."""
    canard, first = canard_of(model(), "a")
    small, _ = canard_of(model().with_parameters(epsilon=0.001), "a")
    points = [{"y": -0.4}, {"y": 0.0}, {"y": 0.4}, {"x": -1.0, "y": 0.5}, {"x": -1.0, "y": -0.4}]
    cycles = [fs.find_orbit(model(), canard, at=at) for at in points]
    values = np.array([cycle.trajectory.parameters["a"] for cycle in cycles])
    other, rough = canard_of(neuron(), "I")
    series = "$1 - \\epsilon/8 - 3\\epsilon^2/32 - 173\\epsilon^3/1024$"
    return (
        Claim(
            "1",
            "The attracting and the repelling slow manifold meet at "
            "$a_c = 1 - \\epsilon/8 + O(\\epsilon^{3/2})$.",
            "Both manifolds followed up to the line of the fold, by two-sided shooting.",
            (
                Finding(
                    "either",
                    "holds",
                    "At $\\epsilon = 0.01$ the manifolds meet at $a = {value:.13f}$, within "
                    "{accuracy:.0e}; to first order the value is {first:.5f}.",
                    {
                        "value": canard.value,
                        "accuracy": within(canard.accuracy, 1e-13),
                        "first": first,
                    },
                ),
            ),
            quantities=(
                Quantity(r"$a_c$ at $\epsilon = 0.01$", canard.value, "0.99874045", series),
                Quantity(r"$a_c$ at $\epsilon = 0.001$", small.value, "0.999874906081", series),
                Quantity(
                    r"slope of the gap in units of $\sqrt{2 \pi \epsilon}$",
                    small.slope / sqrt(2 * pi * 0.001),
                    "1.00",
                    "leading order in $\\epsilon$",
                ),
            ),
        ),
        Claim(
            "2",
            "In a canard explosion the cycle grows from the size of the fold to a relaxation "
            "oscillation within an exponentially small interval of the parameter.",
            "Cycles through given heights, by two-sided shooting.",
            (
                Finding(
                    "either",
                    "holds",
                    "The values of $a$ of {count:.0f} cycles, of heights from −0.4 up to the other "
                    "fold and down again with head, differ by less than {apart:.0e}.",
                    {"count": len(cycles), "apart": within(float(np.ptp(values)), 1e-13)},
                ),
            ),
            quantities=(
                Quantity(
                    "period of the cycle with the height 0",
                    cycles[1].period,
                    PERIOD,
                    "SciPy, Radau, both ways from the same point",
                ),
            ),
        ),
        Claim(
            "3",
            "FitzHugh and Nagumo's model has a canard explosion.",
            "The same for the neuron, over its current.",
            (
                Finding(
                    "either",
                    "holds",
                    "The manifolds meet at $I = {value:.13f}$, to first order {first:.6f}.",
                    {"value": other.value, "first": rough},
                ),
            ),
            quantities=(
                Quantity("maximal canard, $I$", other.value, "0.29979121", "SciPy, Radau, root"),
            ),
        ),
    )


#: Period of the cycle with the height 0, by SciPy.
PERIOD = "3.25808863"
