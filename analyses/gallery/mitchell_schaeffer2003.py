"""Action potential of the heart: the two-current model of Mitchell and Schaeffer."""

from __future__ import annotations

from functools import cache
from math import log

import sympy as sp

import fastslow as fs
from analyses.claims import Claim, Finding, Quantity
from analyses.gallery import About

ABOUT = About(
    title="Mitchell, Schaeffer: an action potential of the heart",
    why="The duration of an action potential of the heart depends on the preceding rest, and "
    "arrhythmias can begin there; a model with two currents gives this duration in closed form. "
    "What ends an action potential?",
    source="C. C. Mitchell and D. G. Schaeffer, A two-current model for the dynamics of cardiac "
    "membrane, Bulletin of Mathematical Biology 65(5), 767-793, 2003, equations (1) to (4)",
    field="cardiology",
    phenomena=("relaxation oscillation", "fold", "excitability", "discontinuous slow rate"),
    slow="The gate $h$, which closes in 150 ms above $v_\\mathrm{gate}$ and opens in 120 ms below; "
    "the voltage $v$ takes 0.3 to 6 ms.",
    caption="(a) Voltage and gate after a stimulus: upstroke, plateau, fall at the fold, and "
    "recovery. (b) The action potential over the equilibria of the frozen model.",
    compared="The source draws the voltage over time, as in (a), for the same time constants, and "
    "the nullclines with the axes of (b) exchanged; the equilibria in (b) are its nullcline of "
    "the voltage. The restitution curves of the source are not drawn.",
    unsaid=(
        "The state after the stimulus; here $v = 0.3$, $h = 1$.",
        "The correction of the duration: the leading order ends at the fold, and the voltage needs "
        "another 43 ms to fall to $v_\\mathrm{gate}$.",
    ),
)


def model() -> fs.Model:
    """Voltage with an inward and an outward current, and a gate that switches."""
    v, h = sp.symbols("v h")
    names = sp.symbols("tau_in tau_out tau_open tau_close v_gate")
    inward, outward, opening, closing, switch = names
    gate = sp.Piecewise(((1 - h) / opening, v < switch), (-h / closing, True))
    return fs.Model(
        {v: h * v**2 * (1 - v) / inward - v / outward},
        slow={h: gate},
        parameters=dict(zip(names, (0.3, 6, 120, 150, 0.13), strict=True)),
    )


def figure() -> fs.plot.Drawing:
    """Draw an action potential over time, and over the frozen equilibria."""
    left, right = fs.plot.axes("ab", height=75)
    run = fs.simulate(model(), [0.3, 1], t=(0, 600))
    diagram = fs.continue_equilibria(model().frozen(), "h", over=(0, 1))
    for name, color in (("v", "#0072B2"), ("h", "grey")):
        fs.plot.time_series(run, name, ax=left, label=False, color=color)
        left.text(100, {"v": 0.95, "h": 0.55}[name], f"${name}$", color=color)
    left.set(xlabel="$t$ (ms)", ylabel="voltage $v$, gate $h$")
    return fs.plot.overlay(fs.overlay(diagram, run), "v", ax=right)


@cache
def claims() -> tuple[Claim, ...]:
    """The fold in closed form, and the duration of the action potential."""
    parameters = model().parameters
    diagram = fs.continue_equilibria(model().frozen(), "h", over=(0, 1))
    (fold,) = diagram.folds
    run = fs.simulate(model(), [0.3, 1], t=(0, 600), integration=fs.Integration(rtol=1e-14))
    overlay = fs.overlay(diagram, run)
    (end,), (jump,) = run.crossings, overlay.transitions
    solved = "Taylor series in 30 digits (mpmath); SciPy, DOP853, differs by 3e-12"
    return (
        Claim(
            "1",
            "The excited branch ends at "
            "$h_\\mathrm{min} = 4 \\tau_\\mathrm{in}/\\tau_\\mathrm{out}$; to leading order the "
            "action potential lasts "
            "$\\tau_\\mathrm{close} \\ln(1/h_\\mathrm{min})$.",
            "The fold of the frozen equilibria, and the closing of the gate up to it.",
            (Finding("either", "holds", "The derivation gives the same fold for all parameters."),),
            quantities=(
                Quantity(
                    "fold, $h$",
                    fold["h"],
                    "0.20000000000000",
                    "closed form",
                    r"$4 \tau_\mathrm{in}/\tau_\mathrm{out}$",
                ),
                Quantity("fold, $v$", fold["v"], "0.50000000000000", "closed form"),
                Quantity(
                    "leading duration (ms)",
                    -parameters["tau_close"] * log(fold["h"]),
                    "241.4156868651150",
                    r"closed form $150 \ln 5$",
                    r"$\tau_\mathrm{close} \ln(1/h_\mathrm{min})$",
                ),
            ),
        ),
        Claim(
            "2",
            "An action potential has four phases: upstroke, plateau, fall and recovery.",
            "One action potential, as an overlay on the frozen equilibria.",
            (
                Finding(
                    "either",
                    "holds",
                    "The plateau is left by a {words} at $h = {value:.3f}$; the delay behind the "
                    "fold is {delay:.4f} in $h$ and {predicted:.4f} by the law of slow passage.",
                    {
                        "words": jump.type,
                        "value": jump.value,
                        "delay": jump.delay,
                        "predicted": jump.predicted,
                    },
                ),
            ),
            quantities=(
                Quantity(
                    r"time from $(0.3, 1)$ to $v_\mathrm{gate}$ (ms)",
                    end.time,
                    "284.688037646529",
                    solved,
                ),
                Quantity("$h$ at this time", end.state[1], "0.149880008105479", solved),
            ),
        ),
    )
