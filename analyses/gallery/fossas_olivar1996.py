"""The buck converter with voltage-mode control: period doubling and chaos."""

from __future__ import annotations

from functools import cache

import numpy as np

import fastslow as fs
from analyses.claims import Claim, Finding, Quantity
from analyses.gallery import About

ABOUT = About(
    title="Fossas, Olivar: chaos of a buck converter",
    why="A converter of direct current that is operated beyond its design becomes noisy: its "
    "output is chaotic. At which input voltage does the periodic operation lose stability, and "
    "through which bifurcations?",
    source="E. Fossas and G. Olivar, Study of chaos in the buck converter, IEEE Transactions on "
    "Circuits and Systems I 43(1), 13-25, 1996; J. H. B. Deane and D. C. Hamill, Analysis, "
    "simulation and experimental study of chaos in the buck converter, IEEE Power Electronics "
    "Specialists Conference, 1990; M. di Bernardo, F. Garofalo, L. Glielmo and F. Vasca, IEEE "
    "Transactions on Circuits and Systems I 45(2), 133-141, 1998",
    field="power electronics",
    phenomena=("clock", "period doubling", "chaos", "forced orbit", "switched circuit"),
    slow="Nothing in the model; the input voltage $V_\\mathrm{in}$ is varied.",
    caption="(a) Output voltage at whole periods of the sawtooth over the input voltage, up and "
    "down. (b) Output and current in chaos at 33 V, 100 periods.",
    compared="The sources draw the diagram (a) for the same circuit over another range of the "
    "input voltage and in one direction, and the attractor in the plane of (b). Coexisting "
    "motions of larger periods, which they find from other initial states, are not drawn.",
    unsaid=(
        "The initial states of the diagram.",
        "How far the first doubling depends on the values of the circuit; the studies of chaos "
        "with orbits of up to eight periods are in [](studies.md).",
    ),
)


def model() -> fs.Model:
    """The converter in SI units, switched by comparison with a sawtooth of 2.5 kHz."""
    return fs.systems.buck_converter(V_in=24)


def figure() -> fs.plot.Drawing:
    """Draw the output at whole periods over the input voltage, and a chaotic motion."""
    left, right = fs.plot.axes("ab", height=75)
    run = fs.simulate(model().with_parameters(V_in=33), [12, 0.5], periods=100)
    fs.plot.phase_portrait(run, "v", "i", ax=right, label=False, crossings=False, linewidth=0.4)
    voltages = np.linspace(22, 34, 200)
    sweep = fs.bifurcation_sweep(model(), "V_in", voltages, [12, 0.5], settle=150, keep=30)
    drawn = fs.plot.sweep(sweep, ax=left)
    left.set(xlabel=r"$V_\mathrm{in}$ (V)", ylabel="$v$ (V), stroboscopic")
    right.set(xlabel="$v$ (V)", ylabel="$i$ (A)")
    return drawn


@cache
def claims() -> tuple[Claim, ...]:
    """The first period doubling, and the orbit before it."""
    orbit = fs.find_orbit(model(), [12, 0.6])
    branch = fs.continue_orbits(orbit, "V_in", over=(22, 28))
    (doubling,) = branch.special("PD")
    state, period = doubling.orbit(0), model().parameters["T"]
    closing, before = (
        max(crossing.time % period for crossing in one.crossings) for one in (doubling.orbit, orbit)
    )
    own = "matrix exponentials with saltation, eigenvalue −1"
    motion = fs.lyapunov(model().with_parameters(V_in=33), [12, 0.5], periods=300)
    return (
        Claim(
            "1",
            "The output of one period doubles near an input voltage of 24.5 V.",
            "The branch of the orbit of one period of the sawtooth.",
            (Finding("either", "holds", "The orbit is stable up to the doubling."),),
            quantities=(
                Quantity("$V_\\mathrm{in}$ (V)", doubling["V_in"], "24.516572828563", own, "24.5"),
                Quantity("duty ratio", 1 - closing / period, "0.49049032714131", own),
                Quantity("$v$ at the ramp's start (V)", state[0], "12.0277089452064", own),
                Quantity("$i$ at the ramp's start (A)", state[1], "0.6080842878383", own),
                Quantity("$v$ at 24 V", orbit(0)[0], "12.02216502", own),
                Quantity("$i$ at 24 V", orbit(0)[1], "0.60648102", own),
                Quantity("switching time at 24 V (s)", before, "0.000199701617422619", own),
            ),
        ),
        Claim(
            "2",
            "Beyond about 32.3 V the converter is chaotic.",
            "The Lyapunov exponents at 33 V.",
            (
                Finding(
                    "either",
                    "holds",
                    "The motion at 33 V is {outcome}, by its largest exponent.",
                    {"outcome": motion.outcome.code},
                ),
            ),
        ),
    )
