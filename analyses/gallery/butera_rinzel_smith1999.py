"""Bursting of a pacemaker neuron of the respiratory rhythm: model 1 of Butera, Rinzel and Smith."""

from __future__ import annotations

from functools import cache

import numpy as np
import sympy as sp

import fastslow as fs
from analyses.claims import Claim, Finding, Quantity
from analyses.gallery import About

ABOUT = About(
    title="Butera, Rinzel, Smith: bursting of a respiratory pacemaker neuron",
    why="Neurons of the pre-Bötzinger complex generate the rhythm of breathing. Which current "
    "makes a single cell burst, and which bifurcations begin and end a burst?",
    source="R. J. Butera, J. Rinzel and J. C. Smith, Models of respiratory rhythm generation in "
    "the pre-Bötzinger complex. I. Bursting pacemaker neurons, Journal of Neurophysiology 82(1), "
    "382-397, 1999, model 1, equations (1) to (7), Figs. 2 to 4",
    field="neuroscience",
    phenomena=("square-wave bursting", "fold", "Hopf bifurcation", "homoclinic orbit"),
    slow="The inactivation $h$ of the persistent sodium current, with a time constant of up to "
    "10 s; the voltage $V$ and the activation $n$ take milliseconds. Voltages in mV, times in ms.",
    caption="Voltage at the leak potentials (a) $E_L = -62$, silence, (b) $-57.5$, bursting, and "
    "(c) $-52$, beating. (d) The bursts of (b) over the frozen model: equilibria, and the envelope "
    "of its cycles, which end at a homoclinic orbit.",
    compared="Fig. 4 A3 of the source shows bursts at $E_L = -57.5$ mV; the CellML version of the "
    "model (ModelDB 247647) runs this case over 10 s. The other two potentials are chosen here. "
    "The source draws the bifurcation diagram over a larger range of $h$.",
    unsaid=("The initial states; here $V = -52$, $n = 0.004$, $h = 0.45$.",),
)


def model() -> fs.Model:
    """Model 1: fast and persistent sodium, potassium and leak currents."""
    V, n, h = sp.symbols("V n h")
    names = sp.symbols("C g_NaP g_Na g_K g_L E_Na E_K E_L")
    C, g_NaP, g_Na, g_K, g_L, E_Na, E_K, E_L = names

    def gate(half: float, slope: float) -> sp.Expr:
        return 1 / (1 + sp.exp((V - half) / slope))

    sodium = g_Na * gate(-34, -5) ** 3 * (1 - n) + g_NaP * gate(-40, -6) * h
    current = sodium * (V - E_Na) + g_K * n**4 * (V - E_K) + g_L * (V - E_L)
    return fs.Model(
        {V: -current / C, n: (gate(-29, -4) - n) * sp.cosh((V + 29) / 8) / 10},
        slow={h: (gate(-48, 6) - h) * sp.cosh((V + 48) / 12) / 10000},
        parameters=dict(zip(names, (21, 2.8, 28, 11.2, 2.8, 50, -85, -57.5), strict=True)),
    )


def figure() -> fs.plot.Drawing:
    """Draw silence, beating and bursting, and the bursts over the frozen model."""
    silent, bursting, beating, plane = fs.plot.axes("ad;bd;cd", height=85)
    for ax, potential in ((silent, -62), (beating, -52), (bursting, -57.5)):
        leak = model().with_parameters(E_L=potential)
        run = fs.simulate(leak, [-52, 0.004, 0.45], t=(0, 5000))
        fs.plot.time_series(run, "V", ax=ax, label=False)
        ax.set(ylim=(-65, 15), xlabel="$t$ (ms)", ylabel="$V$ (mV)")
    diagram = fs.continue_equilibria(model().frozen(), "h", over=(0.445, 0.48))
    cycle = fs.find_orbit(model().frozen().with_parameters(h=0.48), [-30, 0.5])
    cycles = fs.continue_orbits(cycle, "h", over=(0.445, 0.48))
    drawn = fs.plot.overlay(fs.overlay(diagram, run, cycles=cycles), "V", ax=plane)
    plane.set_ylabel("$V$ (mV)")
    return drawn


@cache
def claims() -> tuple[Claim, ...]:
    """Special points of the frozen and of the full model, and the type of bursting."""
    frozen = model().frozen()
    diagram = fs.continue_equilibria(frozen, "h", over=(0, 1))
    (fold,), (hopf,) = diagram.folds, diagram.special("HB")
    cycle = fs.find_orbit(frozen.with_parameters(h=0.52), [-30, 0.5])
    cycles = fs.continue_orbits(cycle, "h", over=(0.4, 0.52))
    run = fs.simulate(model(), [-52, 0.004, 0.45], t=(0, 5000))
    overlay = fs.overlay(diagram, run, cycles=cycles)
    full = model().frozen(fast=["h"]).with_free("E_L")
    (onset,) = fs.continue_equilibria(full, "E_L", over=(-70, -58)).special("HB")
    exact = "mpmath, 30 digits: $dh/dV = 0$ on the closed equilibrium curve"
    return (
        Claim(
            "1",
            "As the leak potential rises, the neuron is silent, then bursts, then beats.",
            "Simulations at three leak potentials, and the Hopf bifurcation of the full model.",
            (
                Finding(
                    "either",
                    "holds",
                    "At $E_L = -62$ there is no spike; at −57.5 the intervals between spikes are "
                    "{short:.0f} to {long:.0f} ms, at −52 all are {beat:.1f} ms. Rest becomes "
                    "unstable at a {kind} Hopf point.",
                    {**intervals(), "kind": onset.criticality},
                ),
            ),
            quantities=(
                Quantity(
                    "Hopf, $E_L$",
                    onset["E_L"],
                    "-60.552075223411",
                    "mpmath, Routh-Hurwitz conditions",
                ),
                Quantity(
                    "Hopf, $V$",
                    onset["V"],
                    "-53.482750347315",
                    "mpmath, Routh-Hurwitz conditions",
                ),
            ),
        ),
        Claim(
            "2",
            "A burst begins at the fold of the frozen equilibria and ends at a homoclinic orbit of "
            "the frozen cycle.",
            "Equilibria and cycles of the frozen model over $h$, with an overlay of the bursts.",
            (
                Finding(
                    "either",
                    "holds",
                    "The overlay finds the beginnings {delay:.4f} behind the fold and the ends "
                    "{end:.4f} behind the homoclinic orbit.",
                    {
                        "delay": overlay.transitions.select(type="jump")[0].delay,
                        "end": -overlay.transitions.select(type="end of oscillation")[0].delay,
                    },
                ),
            ),
            quantities=(
                Quantity("fold, $h$", fold["h"], "0.468326447366812", exact),
                Quantity("fold, $V$", fold["V"], "-50.0207445162917", exact),
                Quantity(
                    "homoclinic orbit, $h$",
                    cycles.special("HC")[0]["h"],
                    "0.4582804869",
                    "SciPy, DOP853 from the saddle, bisection",
                ),
                Quantity(
                    "type",
                    str(overlay.bursting),
                    "fold/homoclinic bursting",
                    "square-wave bursting in the classification of Izhikevich (2000)",
                ),
            ),
        ),
        Claim(
            "3",
            "The frozen equilibrium of high voltage loses stability at a Hopf bifurcation.",
            "The Hopf point of the frozen model.",
            (
                Finding(
                    "either",
                    "beyond the paper",
                    "It is {kind}; the first Lyapunov coefficient is {lyapunov:.3g}.",
                    {"kind": hopf.criticality, "lyapunov": hopf.lyapunov},
                ),
            ),
            quantities=(
                Quantity("Hopf, $h$", hopf["h"], "0.818535718438011", "mpmath, zero trace"),
                Quantity("Hopf, $V$", hopf["V"], "-22.7851915011188", "mpmath, zero trace"),
            ),
        ),
    )


def intervals() -> dict[str, float]:
    """Shortest and longest interval between spikes of a burster, and the interval of a beater."""
    found = []
    for potential in (-57.5, -52):
        leak = model().with_parameters(E_L=potential)
        run = fs.simulate(leak, [-52, 0.004, 0.45], t=(0, 20000))
        spikes = run.section("V", level=-20, direction=1).t
        found.append(np.diff(spikes[spikes > 10000]))
    return {"short": found[0].min(), "long": found[0].max(), "beat": found[1].mean()}
