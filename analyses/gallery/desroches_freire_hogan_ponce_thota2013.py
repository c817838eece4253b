"""Corners of a piecewise-linear oscillator: full cycles at once, or in proportion."""

from __future__ import annotations

from functools import cache

import numpy as np
import sympy as sp

import fastslow as fs
from analyses.claims import Claim, Finding, Quantity
from analyses.gallery import About

ABOUT = About(
    title="Desroches, Freire, Hogan, Ponce, Thota: canards in piecewise-linear systems",
    why="A piecewise-linear oscillator has corners where a smooth one has folds. Does its cycle "
    "grow in a canard explosion too?",
    source="M. Desroches, E. Freire, S. J. Hogan, E. Ponce and P. Thota, Canards in "
    "piecewise-linear systems: explosions and super-explosions, Proceedings of the Royal Society "
    "A 469, 20120603, 2013",
    field="physics",
    phenomena=("canard explosion", "relaxation oscillation", "boundary equilibrium"),
    slow="The state $y$; $x$ is faster by $1/\\epsilon = 100$.",
    caption="(a) The cycle at $a = 0.001$ over the critical manifold (dashed: repelling), with "
    "inner slope $s = 0.5 > 2 \\sqrt\\epsilon$: the full cycle. (b) Extent of the cycle in $x$ "
    "over $a$: constant for $s = 0.5$, in proportion to $a$ for $s = 0.1$.",
    compared="The source sketches the cycles of such systems; (b) is added here.",
    unsaid=(
        "Values: here the outer slopes −1, a middle zone of width 1, $\\epsilon = 0.01$, and the "
        "inner slopes 0.5 and 0.1.",
    ),
)


def model() -> fs.Model:
    """An oscillator with two corners, at x = 0 and x = 1."""
    x, y, a, s, epsilon = sp.symbols("x y a s epsilon")
    slopes = sp.Piecewise((-x, x < 0), (s * x, x < 1), (s - (x - 1), True))
    return fs.Model(
        {x: (y + slopes) / epsilon}, slow={y: a - x}, parameters={a: 0.001, s: 0.5, epsilon: 0.01}
    )


def figure() -> fs.plot.Drawing:
    """Draw the cycle that appears at once, and the extent of cycles over the parameter."""
    left, right = fs.plot.axes("ab", height=75)
    right.set(xlabel="$a$", ylabel="extent in $x$", xscale="log", yscale="log")
    over = (1e-4, 3e-4, 1e-3, 3e-3, 1e-2)
    for s, look in ((0.5, "ko"), (0.1, "k^")):
        reach = []
        for a in over:
            run = fs.simulate(model().with_parameters(a=a, s=s), [0, 0], t=(0, 60))
            reach.append(np.ptp(run["x"][run.t > 30]))
        right.plot(over, reach, look, markersize=4, label=f"$s = {s}$")
    right.legend(loc="lower right", fontsize="small")
    run = fs.simulate(model(), [0, 0], t=(0, 20))
    fs.plot.phase_portrait(run, "x", "y", ax=left, label=False, linewidth=0.8)
    manifold = fs.continue_equilibria(model().frozen(), "y", over=(-0.8, 0.4))
    return fs.plot.diagram(manifold, "y", x="x", ax=left, legend=False)


def extent(a: float, s: float) -> float:
    """Extent in x of the cycle that a run from the corner settles on."""
    run = fs.simulate(model().with_parameters(a=a, s=s), [0, 0], t=(0, 60))
    late = run["x"][run.t > 30]
    return float(np.ptp(late))


@cache
def claims() -> tuple[Claim, ...]:
    """The corner, the threshold of the inner slope, and the extent of cycles."""
    corners = fs.slow_flow(model(), parameter="a").corners
    corner = next(one for one in corners if one.values["x"] == 0.0)
    canard = fs.find_canard(model(), corner, "a")
    full, twice = (extent(a, 0.5) for a in (1e-3, 2e-3))
    small, larger = (extent(a, 0.1) for a in (1e-3, 2e-3))
    ratio = larger / small
    closed = "closed form"
    return (
        Claim(
            "1",
            "With separated rates on both sides of a corner there is no maximal canard, and the "
            "full cycle appears at once (super-explosion).",
            "The eigenlines of both zones, `fs.find_canard`, and simulation.",
            (
                Finding(
                    "either",
                    "holds",
                    "The eigenlines meet only at $a = 0$; the extent of the cycle is "
                    "{full:.3f} at $a = 0.001$ and {twice:.3f} at $a = 0.002$.",
                    {"full": full, "twice": twice},
                ),
            ),
            quantities=(
                Quantity("slow rate zero at the corner, $a$", corner.value, "0.000000", closed),
                Quantity("canards found", float(bool(canard.outcome)), "0", closed),
                Quantity("extent at $2a$ over that at $a$, $s = 0.5$", twice / full, "1.0", closed),
            ),
        ),
        Claim(
            "2",
            "For $s < 2 \\sqrt\\epsilon$ the inner eigenvalues are complex, and the cycle grows in "
            "proportion to $a$.",
            "Simulation at two values of $a$.",
            (
                Finding(
                    "either",
                    "holds",
                    "With $s = 0.1$ the extent is {small:.4f} at $a = 0.001$ and {larger:.4f} at "
                    "$a = 0.002$.",
                    {"small": small, "larger": larger},
                ),
            ),
            quantities=(
                Quantity("extent at $2a$ over that at $a$, $s = 0.1$", ratio, "2.00", closed),
            ),
        ),
    )
