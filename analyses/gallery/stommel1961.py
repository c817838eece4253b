"""Stommel's two boxes of the ocean under a pulse of fresh water: tracking, return and tipping."""

from __future__ import annotations

from functools import cache

import sympy as sp

import fastslow as fs
from analyses.claims import Claim, Finding, Quantity
from analyses.gallery import About

ABOUT = About(
    title="Stommel: two boxes of the ocean under a pulse of fresh water",
    why="The overturning circulation of the Atlantic may stop as fresh water from melting ice "
    "reaches it. Which pulses are short enough, although they exceed the value at which the "
    "circulation loses its equilibrium?",
    source="H. Stommel, Thermohaline convection with two stable regimes of flow, Tellus 13, "
    "224-230, 1961; P. Cessi, A simple box model of stochastically forced thermohaline flow, "
    "Journal of Physical Oceanography 24, 1911-1920, 1994; P. D. L. Ritchie, J. J. Clarke, "
    "P. M. Cox and C. Huntingford, Overshooting tipping point thresholds in a changing climate, "
    "Nature 592, 517-523, 2021",
    field="climate",
    phenomena=("fold", "rate-induced tipping", "overshoot"),
    slow="The flux of fresh water $F$, a pulse of height $D$ and duration $1/r$.",
    caption="Pulses of rate $r$ and height $D$: the circulation tracks its branch, returns to it "
    "after it was outside its basin, or tips. Dashed: the critical rates as a curve.",
    compared="Ritchie et al. draw the boundary between safe and unsafe overshoots over their time "
    "and height, for other models; the boundary here is computed as a curve of critical rates, "
    "without a published value.",
    unsaid=(
        "The shape of the pulse, here $F_0 + D/\\cosh(r t)$ with $F_0 = 1.1$ between both folds.",
        "The response of temperature, which is fixed as in Cessi's model, with $\\mu^2 = 6.2$.",
    ),
)


def model() -> fs.Model:
    """Difference of salinity of both boxes, with the temperatures fixed."""
    y, F, r, D, t = sp.symbols("y F r D t")
    flow = 1 + sp.Rational(31, 5) * (1 - y) ** 2
    pulse = sp.Rational(11, 10) + D / sp.cosh(r * t)
    return fs.Model({y: F - y * flow}, forcing={F: pulse}, parameters={r: 0.5, D: 0.3})


def figure() -> fs.plot.Drawing:
    """Draw track, return and tip over rate and height, with the boundary as a curve."""
    over, on = {"r": (0.4, 1.4), "D": (0.2, 0.4)}, {"y": 0.24}
    cells = fs.Refinement(cells=(10, 10), levels=3)
    plane = fs.tipping_map(model(), "r", over, branch=on, refinement=cells)
    found = fs.critical_rate(model(), "r", over["r"], branch=on)
    steps = fs.Continuation(step=0.05, max_step=0.1, max_turn=0.5)
    boundary = fs.continue_points(found[0], ("r", "D"), over, continuation=steps)
    return fs.plot.tipping_map(plane, boundary, width=110)


@cache
def claims() -> tuple[Claim, ...]:
    """Folds, and the critical rate of a pulse beyond the upper one."""
    boxes = model()
    diagram = fs.continue_equilibria(boxes.frozen(), "F", over=(0.8, 1.6))
    upper, lower = sorted(diagram.folds, key=lambda point: -point["F"])
    found = fs.critical_rate(boxes, "r", (0.4, 1.4), branch={"y": 0.24})
    exact = "mpmath"
    return (
        Claim(
            "1",
            "Between two values of the fresh-water flux the circulation has two stable states.",
            "Equilibria over the flux.",
            (
                Finding(
                    "either",
                    "holds",
                    "Both states are stable for {low:.4f} < F < {high:.4f}.",
                    {"low": lower["F"], "high": upper["F"]},
                ),
            ),
            quantities=(
                Quantity("upper fold, $F$", upper["F"], "1.2962183604402", exact),
                Quantity("its $y$", upper["y"], "0.42719293063097", exact),
                Quantity("lower fold, $F$", lower["F"], "0.95563349141165", exact),
                Quantity("its $y$", lower["y"], "0.90614040270237", exact),
            ),
        ),
        Claim(
            "2",
            "A pulse beyond the fold is survived if it is short enough.",
            "The critical rate of a pulse of height 0.3 from F = 1.1, beyond the fold at 1.296.",
            (
                Finding(
                    "either",
                    "holds",
                    "The run {below} below it and {above} above it; the truncation errors are at "
                    "most {error:.0e}.",
                    {
                        "below": found[0].below,
                        "above": found[0].above,
                        "error": max(found[0].start_error, found[0].end_error, 1e-15),
                    },
                ),
            ),
            quantities=(
                Quantity(
                    "critical rate, $r$",
                    found.rate,
                    "0.705292806004",
                    "SciPy, bisection of runs with DOP853, rtol 3e-13",
                ),
            ),
        ),
    )
