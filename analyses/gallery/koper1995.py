"""Mixed-mode oscillations of an electrochemical reaction: Koper's model with a folded node."""

from __future__ import annotations

from functools import cache

import numpy as np
import sympy as sp

import fastslow as fs
from analyses.claims import Claim, Finding, Quantity
from analyses.gallery import About

ABOUT = About(
    title="Koper: mixed-mode oscillations by a folded node",
    why="Oscillations in which small and large amplitudes alternate occur in electrochemistry and "
    "in neurons. Where do the small oscillations come from?",
    source="M. T. M. Koper, Bifurcations of mixed-mode oscillations in a three-variable "
    "autonomous Van der Pol-Duffing model with a cross-shaped phase diagram, Physica D 80, 72-94, "
    "1995; M. Desroches, J. Guckenheimer, B. Krauskopf, C. Kuehn, H. M. Osinga and "
    "M. Wechselberger, Mixed-mode oscillations with multiple time scales, SIAM Review 54(2), "
    "211-288, 2012",
    field="chemistry",
    phenomena=("mixed-mode oscillation", "folded node", "Hopf bifurcation", "two slow variables"),
    slow="The concentrations $y$ and $z$; the potential $x$ is faster by $1/\\epsilon_1 = 10$.",
    caption="(a) The mixed-mode oscillation at $\\lambda = 7$. (b) The oscillation over the "
    "critical manifold, whose projection is a curve; square, the folded node.",
    compared="The sources draw $x$ over time, as in (a), and the oscillation over the critical "
    "manifold in space, of which (b) is the projection along $z$, at other values of $\\lambda$ "
    "and $\\epsilon_1$; $k = -10$ and $\\epsilon_2 = 1$ are theirs.",
    unsaid=(
        "Small oscillations in a period at these values: at $\\epsilon_1 = 0.1$ two and three in "
        "turn, fewer than the seven of the folded node, which are for well separated rates.",
    ),
)


def model() -> fs.Model:
    """Koper's three variables, of which two are slow."""
    x, y, z = sp.symbols("x y z")
    k, lam, fast, slow = names = sp.symbols("k lambda epsilon_1 epsilon_2")
    return fs.Model(
        {x: (k * y - x**3 + 3 * x - lam) / fast},
        slow={y: x - 2 * y + z, z: slow * (y - z)},
        parameters=dict(zip(names, (-10, 7, 0.1, 1), strict=True)),
    )


def figure() -> fs.plot.Drawing:
    """Draw the mixed-mode oscillation over time and over the critical manifold."""
    left, right = fs.plot.axes("ab", height=75)
    start = fs.simulate(model(), [-1, -0.9, -0.8], t=(0, 100)).final_state
    run = fs.simulate(model(), start, t=(0, 20))
    manifold = fs.continue_equilibria(model().frozen().with_parameters(z=0), "y", over=(-1, -0.4))
    fs.plot.time_series(run, "x", ax=left, label=False)
    fs.plot.diagram(manifold, "x", ax=right)
    right.plot(-0.9, -1, "ks", markersize=4, zorder=5)
    return fs.plot.phase_portrait(run, "y", "x", ax=right, label=False)


@cache
def claims() -> tuple[Claim, ...]:
    """Folded singularities, the Hopf point and the signature."""
    node, focus = sorted(fs.slow_flow(model()).points, key=lambda point: point.values["x"])
    # in slow time, with the fast rate as in the sources
    strong, weak = 0.1 * np.real(node.eigenvalues)
    small = model().with_parameters(epsilon_1=0.001)
    (separated,) = (one for one in fs.slow_flow(small).points if one.code == node.code)
    canards = fs.find_canards(small, separated)
    turned = fs.continue_points(node, "lambda", (3, 9))
    full = model().frozen(fast=["y", "z"]).with_free("lambda")
    hopf = fs.continue_equilibria(full, "lambda", over=(0, 10)).special("HB")[0]
    run = fs.simulate(model(), [-1, -0.9, -0.8], t=(0, 200))
    orbit = fs.find_orbit(model(), run.final_state, period=6.11)
    closed = "closed form"
    return (
        Claim(
            "1",
            "At $\\lambda = 7$ one fold of the critical manifold carries a folded node, the other "
            "a folded focus.",
            "The folded singularities of the slow flow, `fs.slow_flow`, and the canards of the "
            "folded node, `fs.find_canards`.",
            (
                Finding(
                    "either",
                    "holds",
                    "The node has the ratio {ratio:.4f} of its eigenvalues; at "
                    "$\\epsilon_1 = 10^{{-3}}$ it has {count:.0f} canards, $s + 1$.",
                    {"ratio": node.ratio, "count": len(canards)},
                ),
            ),
            quantities=(
                Quantity("folded node, $x$", node.values["x"], "-1.00000000000000", closed),
                Quantity("folded node, $y$", node.values["y"], "-0.90000000000000", closed),
                Quantity("folded node, $z$", node.values["z"], "-0.80000000000000", closed),
                Quantity("strong eigenvalue", strong, "-9.3588989435407", closed),
                Quantity("weak eigenvalue", weak, "-0.6411010564593", closed),
                Quantity(r"$\mu$", node.ratio, "0.0685017607655", closed),
                Quantity(
                    "most small oscillations",
                    node.rotations,
                    "7",
                    r"$\lfloor(1 + \mu)/(2\mu)\rfloor$",
                ),
                Quantity(
                    "folded focus, real part", 0.1 * focus.eigenvalues[0].real, "-5.0000", closed
                ),
                Quantity(
                    "folded focus, imaginary part",
                    0.1 * abs(focus.eigenvalues[0].imag),
                    "8.06225774829855",
                    closed,
                ),
            ),
        ),
        Claim(
            "2",
            "The folded node vanishes in a folded saddle-node of type II at $\\lambda = -(k + 2)$.",
            "The folded node over $\\lambda$, by `fs.continue_points`.",
            (Finding("either", "holds", "It becomes a folded saddle there, FSN2."),),
            quantities=(
                Quantity(
                    r"FSN2, $\lambda$",
                    turned.special("FSN2")[0]["lambda"],
                    "8.0000000000",
                    closed,
                    "8",
                ),
            ),
        ),
        Claim(
            "3",
            "Between the folded saddle-node and the folded focus there are mixed-mode "
            "oscillations, below a Hopf bifurcation of the full model.",
            "The Hopf point of the full model, and the orbit at $\\lambda = 7$.",
            (
                Finding(
                    "either",
                    "holds",
                    "The Hopf point is {kind}; the orbit is stable, with the multiplier "
                    "{multiplier:.4f}.",
                    {"kind": hopf.criticality, "multiplier": orbit.multipliers[1].real},
                ),
            ),
            quantities=(
                Quantity(r"Hopf point, $\lambda$", hopf["lambda"], "7.66955138389113", "mpmath"),
                Quantity("signature", run.mixed_mode().signature, "1²1³", "SciPy, LSODA, counted"),
                Quantity("period", orbit.period, "6.1126856", "SciPy, LSODA, rtol 1e-11"),
            ),
        ),
    )
