"""The slow flow of the forced van der Pol equation: its folded singularities over the load."""

from __future__ import annotations

from functools import cache
from math import cos, pi, sqrt

import numpy as np
import sympy as sp

import fastslow as fs
from analyses.claims import Claim, Finding, Quantity
from analyses.gallery import About

ABOUT = About(
    title="Guckenheimer, Hoffman, Weckesser: the slow flow of the forced van der Pol equation",
    why="Under a slow periodic load the relaxation oscillation jumps where its slow flow reaches a "
    "fold. Where does the flow turn there instead, and how does that depend on the load?",
    source="J. Guckenheimer, K. Hoffman and W. Weckesser, The forced van der Pol equation I: the "
    "slow flow and its bifurcations, SIAM Journal on Applied Dynamical Systems 2, 1-35, 2003",
    field="physics",
    phenomena=("folded singularities", "relaxation oscillation"),
    slow="The state $y$ and the phase of the load; $x$ is faster by $1/\\epsilon = 100$.",
    caption="(a) Phase of the folded singularities on the fold $x = 1$ over the amplitude $a$ of "
    "the load: a saddle and a focus, which is a node close to $a = 1$, where both collide (FSN1). "
    "(b) The ratio $\\mu$ of the eigenvalues of the node; dots: $\\mu = 1$ in closed form, where "
    "it becomes a focus.",
    compared="The source gives the points and their types in closed form; the figure is added "
    "here.",
    unsaid=("The value of $\\epsilon$, which changes neither places nor types: here 0.01.",),
)


def model() -> fs.Model:
    """Van der Pol's oscillator with a slow harmonic load."""
    x, y, t, a, omega, epsilon = sp.symbols("x y t a omega epsilon")
    return fs.Model(
        {x: (y - x**3 / 3 + x) / epsilon},
        slow={y: a * sp.sin(omega * t) - x},
        parameters={a: 2, omega: 1, epsilon: 0.01},
    )


def figure() -> fs.plot.Drawing:
    """Draw the folded singularities over the amplitude, and the ratio of the folded nodes."""
    left, right = fs.plot.axes("ab", height=75)
    right.set(xlabel="$a$", ylabel="$\\mu$", xlim=(1, 1.8), ylim=(0, 1.12))
    fine = fs.Continuation(step=0.001, max_step=0.005)
    for omega in (0.1, 0.2, 0.5):
        points = fs.slow_flow(model().with_parameters(omega=omega, a=1.001)).points
        (node,) = (p for p in points if p.code == "FN" and p.values["x"] > 0)
        last = np.sqrt(1 + 1 / (8 * omega) ** 2)
        curve = fs.continue_points(node, "a", (0.99, 1.002 * last), continuation=fine)
        right.plot(curve["a"], curve.coefficient, color="#D55E00")
        right.plot(last, 1, "ko", markersize=3.5)
        words = f"$\\omega = {omega}$"
        right.annotate(words, (last, 1), (0, 5), textcoords="offset points", fontsize="small")
    saddle, _ = (p for p in fs.slow_flow(model()).points if p.values["x"] > 0)
    # through FSN1 to the node and the focus
    curve = fs.continue_points(saddle, "a", (0.5, 4))
    return fs.plot.parameter_plane(curve, y="t", ax=left, legend=True)


@cache
def claims() -> tuple[Claim, ...]:
    """Places, types and eigenvalues of the folded singularities, and where two of them collide."""
    saddle, focus = (p for p in fs.slow_flow(model()).points if p.values["x"] > 0)
    curve = fs.continue_points(saddle, "a", (0.5, 4))
    meet = curve.special("FSN1")[0]
    fine = fs.Continuation(step=0.001, max_step=0.005)
    near = fs.slow_flow(model().with_parameters(a=1.001)).points
    (node,) = (p for p in near if p.code == "FN" and p.values["x"] > 0)
    types = fs.continue_points(node, "a", (0.995, 1.01), continuation=fine)
    last = types["a"][types.codes == node.code].max()
    over = fs.continue_points(saddle, "omega", (0.2, 3))
    places = over["omega"] * over["t"]
    closed = "closed form"
    return (
        Claim(
            "1",
            "For $a > 1$ each fold carries a folded saddle and a folded node or focus, where "
            "$a \\sin \\omega t = x$; for $a < 1$ there is none.",
            "`fs.slow_flow`, and its points over $a$ and $\\omega$ by `fs.continue_points`.",
            (
                Finding(
                    "either",
                    "holds",
                    "The saddle and the focus, which is a node before, collide at "
                    "$a = {value:.12f}$.",
                    {"value": meet["a"]},
                ),
            ),
            quantities=(
                Quantity("FSN1, $a$", meet["a"], "1.000000000000", closed),
                Quantity("FSN1, $t$", meet["t"], "1.570796326795", closed),
                Quantity("saddle at $a = 2$, $t$", saddle.values["t"], "0.523598775598", closed),
                Quantity(
                    "$\\omega t$ of the saddle over $\\omega$ from 0.2 to 3, largest",
                    float(np.max(places)),
                    "0.523598775598",
                    closed,
                ),
            ),
        ),
        Claim(
            "2",
            "The eigenvalues of the slow flow satisfy "
            "$\\lambda^2 + \\lambda - 2 \\omega a \\cos \\omega t = 0$ at $x = 1$.",
            "Eigenvalues in slow time, and the amplitude at which the node becomes a focus.",
            (
                Finding(
                    "either",
                    "holds",
                    "With $\\omega = 1$ the node becomes a focus at $a = {value:.4f}$.",
                    {"value": float(last)},
                ),
            ),
            quantities=(
                Quantity(
                    "saddle at $a = 2$, positive eigenvalue",
                    0.01 * max(one.real for one in saddle.eigenvalues),
                    f"{(sqrt(1 + 16 * cos(pi / 6)) - 1) / 2:.12f}",
                    closed,
                ),
                Quantity(
                    "focus at $a = 2$, imaginary part",
                    0.01 * abs(focus.eigenvalues[0].imag),
                    f"{sqrt(16 * cos(pi / 6) - 1) / 2:.12f}",
                    closed,
                ),
                Quantity(
                    "node becomes a focus, $a$",
                    float(last),
                    f"{sqrt(1 + 1 / 64):.3f}",
                    "closed form; the last row of the curve before",
                ),
            ),
        ),
    )
