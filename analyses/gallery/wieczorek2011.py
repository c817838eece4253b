"""The compost bomb: peat soil that overheats above a critical rate of warming."""

from __future__ import annotations

from functools import cache

import numpy as np
import sympy as sp

import fastslow as fs
from analyses.claims import Claim, Finding, Quantity
from analyses.gallery import About

ABOUT = About(
    title="Wieczorek, Ashwin, Luke, Cox: the compost bomb, tipping by a rate",
    why="Peat warms when it decomposes, and decomposes faster when it is warm. Can it ignite "
    "because the air warms too fast, although every temperature of the air has a stable "
    "equilibrium?",
    source="S. Wieczorek, P. Ashwin, C. M. Luke, P. M. Cox, Excitability in ramped systems: the "
    "compost-bomb instability, Proceedings of the Royal Society A 467, 1243-1269, 2011, equations "
    "(4.1) and (4.2)",
    field="climate",
    phenomena=("rate-induced tipping", "folded saddle", "canard", "ramp"),
    slow="The carbon $C$ of the soil, and the air temperature $T_a = vt$, against the temperature "
    "$T$ of the soil, with $\\epsilon = 0.064$.",
    caption="(a) The only equilibrium over the air temperature, and two runs: at 0.088 °C per year "
    "the soil follows it with a lag, at 0.09 it leaves. (b) The same runs over time, in years.",
    compared="The source draws the temperature of the soil for rates on both sides of the "
    "critical one, and phase portraits in the plane of temperature and carbon; here the "
    "temperature is drawn over the ramp, with the equilibria, and over time.",
    unsaid=(
        "The start of the ramp; here the equilibrium at $T_a = 0$.",
        "The critical rate depends on that start; it is computed for this one alone.",
    ),
)


def model() -> fs.Model:
    """Temperature and carbon of a soil under air that warms at a constant rate."""
    t, T, C, T_a, v, r, alpha, k, P, eps = sp.symbols("t T C T_a v r_0 alpha k Pi epsilon")
    decay = C * r * sp.exp(alpha * T)
    values = {r: 0.01, alpha: np.log(2.5) / 10, k: 5.049 / 39, P: 1.055, eps: 0.064, v: 0.09}
    rates = {T: (decay - k * (T - T_a)) / eps}
    return fs.Model(rates, slow={C: P - decay}, forcing={T_a: v * t}, parameters=values)


def figure() -> fs.plot.Drawing:
    """Draw runs below and above the critical rate over the equilibria."""
    diagram = fs.continue_equilibria(model().frozen(fast=["C"]), "T_a", over=(0, 9))
    left, right = fs.plot.axes("ab", height=70)
    drawn = fs.plot.diagram(diagram, "T", ax=left)
    for v, gap, side, end in ((0.088, -2, "right", "bottom"), (0.09, 2, "left", "top")):
        ramp = model().with_parameters(v=v)
        run = fs.simulate(ramp, diagram.at(T_a=0)[0].state, t=(0, 100), stop="T - 60")
        fs.plot.phase_portrait(run, "T_a", "T", ax=left)
        fs.plot.time_series(run, "T", ax=right)
        last = run.t[-1] + gap, run["T"][-1] + 1
        right.text(*last, f"{v:g} °C/yr", ha=side, va=end, fontsize=8)
    left.set(xlabel="$T_a$ (°C)", ylabel="$T$ (°C)")
    right.set(xlabel="$t$ (yr)", ylabel="$T$ (°C)")
    return drawn


@cache
def claims() -> tuple[Claim, ...]:
    """One equilibrium, a critical rate, and the canard behind it."""
    full = model().frozen(fast=["C"])
    diagram = fs.continue_equilibria(full, "T_a", over=(0, 9))
    (rest,) = fs.equilibria(full, {"T_a": 0})
    fast = fs.continue_equilibria(model().frozen().with_parameters(T_a=0), "C", over=(10, 90))
    (fold,) = fast.folds
    (critical,) = fs.critical_rate(model(), "v", (0.05, 0.2))
    rate, limit = critical.rate, critical.limit
    assert critical.canard is not None
    closed = "closed form"
    return (
        Claim(
            "1",
            "For every constant air temperature the soil has one equilibrium, which is stable.",
            "Equilibria over the air temperature, with the carbon as a state.",
            (
                Finding(
                    "either",
                    "holds" if diagram.completeness == "complete" else "holds conditionally",
                    "{branches} branch, in a complete list; its stable part is {stable:.0f} % of "
                    "the range.",
                    {
                        "branches": len(diagram),
                        "stable": 100 * sum(b - a for a, b in diagram[0].stable_intervals()) / 9,
                    },
                ),
            ),
            quantities=(
                Quantity("$T$ at $T_a = 0$", rest["T"], "8.14913844325609", closed),
                Quantity("$C$ at $T_a = 0$", rest["C"], "49.9994972353518", closed),
            ),
        ),
        Claim(
            "2",
            "Above a critical rate of warming the temperature of the soil explodes, although the "
            "equilibrium never loses stability.",
            "Runs from the equilibrium at $T_a = 0$; the rate at which one is a canard.",
            (
                Finding(
                    "either",
                    "holds",
                    "The critical rate is {rate:.4f} °C per year from this start. S. Wieczorek "
                    "told the press about 1 °C per decade (LiveScience, 2010).",
                    {"rate": rate},
                ),
            ),
            quantities=(
                Quantity(
                    "critical rate (°C per year)",
                    rate,
                    "0.08846855393",
                    "SciPy, Radau, rtol 1e-11, bisection",
                    "0.1",
                ),
            ),
        ),
        Claim(
            "3",
            "The threshold is a canard through a folded saddle of the critical manifold.",
            "The fold of the fast temperature, the canard, and the rate at which the slow flow "
            "from the same start runs into the folded saddle, in the limit $\\epsilon \\to 0$.",
            (
                Finding(
                    "either",
                    "holds",
                    "In the limit the critical rate is {limit:.4f} °C per year; at $\\epsilon = "
                    "0.064$ it is {more:.0f} % larger. Its run passes the folded saddle at $T_a = "
                    "{air:.2f}$ °C.",
                    {
                        "limit": limit,
                        "more": 100 * (rate / limit - 1),
                        "air": critical.canard["T_a"],
                    },
                ),
            ),
            quantities=(
                Quantity(r"fold, $T - T_a = 1/\alpha$", fold["T"], "10.9135666793729", closed),
                Quantity(
                    r"critical rate for $\epsilon \to 0$",
                    limit,
                    "0.080774063401",
                    "SciPy, DOP853: forwards by bisection, and the stable manifold of the folded "
                    "saddle backwards",
                ),
            ),
        ),
    )
