"""Repetitive firing of the giant axon: the equations of Hodgkin and Huxley."""

from __future__ import annotations

from functools import cache

import fastslow as fs
from analyses.claims import Claim, Finding, Quantity
from analyses.gallery import About

ABOUT = About(
    title="Hodgkin, Huxley: repetitive firing of the giant axon",
    why="The model of the squid axon is the foundation of quantitative neuroscience. For which "
    "currents does the axon fire repetitively, and where do rest and firing coexist?",
    source="A. L. Hodgkin and A. F. Huxley, A quantitative description of membrane current and "
    "its application to conduction and excitation in nerve, Journal of Physiology 117(4), 500-544, "
    "1952, equations (3) to (6), (12), (13), (20), (21), (23), (24), (26), table 3; the periodic "
    "orbits are those of J. Rinzel and R. N. Miller, Numerical calculation of stable and unstable "
    "periodic solutions to the Hodgkin-Huxley equations, Mathematical Biosciences 49, 27-59, 1980",
    field="neuroscience",
    phenomena=("Hopf bifurcation", "fold of cycles", "period doubling", "bistability"),
    slow="Nothing is frozen: the gates $h$ and $n$ take up to 9 ms, $m$ and the voltage less "
    "than 1 ms.",
    caption="(a) Voltage under a current of $I_0 = 10$. (b) Equilibria and cycles over the "
    "current (black and green; dashed, unstable): largest and smallest voltage of the cycles "
    "from Hopf point to Hopf point. "
    "(c) The same near the lower Hopf point.",
    compared="The first source draws single action potentials and trains of them, as in (a), with "
    "the depolarisation from rest as variable; the second draws the amplitude of the cycles over "
    "the current, as in (b) and (c).",
    unsaid=(
        "The voltage at rest; here $-65$ mV, so that the reversal potentials are 50, $-77$ and "
        "$-54.4$ mV.",
        "The state at the start of (a); here it is near rest.",
    ),
)


def model() -> fs.Model:
    """The space-clamped axon at 6.3 °C."""
    return fs.systems.hodgkin_huxley(I_0=10)


def figure() -> fs.plot.Drawing:
    """Draw a train of spikes, and the cycles over the current."""
    box = {"V": (-100, 50), "m": (0, 1), "h": (0, 1), "n": (0, 1)}
    run = fs.simulate(model(), [-65, 0.05, 0.6, 0.32], t=(0, 80))
    diagram = fs.continue_equilibria(model(), "I_0", over=(0, 200), window=box)
    cycles = fs.continue_cycles(diagram)
    left, middle, right = fs.plot.axes("abc", height=75)
    fs.plot.time_series(run, "V", ax=left, label=False)
    fs.plot.diagram(diagram, "V", ax=middle, cycles=cycles, label=False, legend=True)
    drawn = fs.plot.diagram(diagram, "V", ax=right, cycles=cycles, legend=False)
    left.set(xlabel="$t$ (ms)", ylabel="$V$ (mV)")
    middle.set(xlabel="$I_0$ (µA/cm²)", ylabel="$V$ (mV)")
    right.set(xlabel="$I_0$ (µA/cm²)", ylabel="$V$ (mV)", xlim=(6, 10), ylim=(-80, 40))
    return drawn


@cache
def claims() -> tuple[Claim, ...]:
    """The spike at a current of 10, and the branch of cycles."""
    box = {"V": (-100, 50), "m": (0, 1), "h": (0, 1), "n": (0, 1)}
    orbit = fs.find_orbit(model(), fs.simulate(model(), [-60, 0.1, 0.5, 0.3], t=(0, 300)))
    diagram = fs.continue_equilibria(model(), "I_0", over=(0, 200), window=box)
    (cycles,) = fs.continue_cycles(diagram)
    lower, upper = sorted(point["I_0"] for point in diagram.special("HB"))
    knee, second, third = sorted(point["I_0"] for point in cycles.special("LPC"))
    doubling = min(point["I_0"] for point in cycles.special("PD"))
    solved = "SciPy, DOP853, rtol 1e-13"
    auto = "AUTO-07p with the exported equations, NTST = 150, NCOL = 5"
    root = "mpmath, 40 digits: zero of the Hopf condition"
    return (
        Claim(
            "1",
            "Under a constant current the membrane fires repetitively.",
            "The periodic orbit on which a run settles at $I_0 = 10$.",
            (
                Finding(
                    "either",
                    "holds",
                    "The spikes repeat on a stable orbit between {low:.1f} and {high:.1f} mV.",
                    {"low": orbit["V"].min(), "high": orbit["V"].max()},
                ),
            ),
            quantities=(Quantity("period (ms)", orbit.period, "14.63832479", solved),),
        ),
        Claim(
            "2",
            "Small unstable cycles leave the lower Hopf point and join large stable ones at a "
            "fold of cycles below it; the stable cycles end at the upper Hopf point.",
            "Cycles from the lower Hopf point.",
            (
                Finding(
                    "either",
                    "holds",
                    "The lower Hopf point is {first} and the upper one {last}. On the branch "
                    "are {folds} folds of cycles and {doublings} period doublings; rest and "
                    "firing coexist over {width:.2f} of the current.",
                    {
                        "first": diagram.special("HB")[0].criticality,
                        "last": diagram.special("HB")[1].criticality,
                        "folds": len(cycles.special("LPC")),
                        "doublings": len(cycles.special("PD")),
                        "width": lower - knee,
                    },
                ),
            ),
            quantities=(
                Quantity("lower Hopf point, $I_0$", lower, "9.779337995393", root),
                Quantity("upper Hopf point, $I_0$", upper, "154.5263336658", root),
                Quantity("lowest fold of cycles, $I_0$", knee, "6.2642212745", auto),
                Quantity("second fold, $I_0$", second, "7.8462471202", auto),
                Quantity("third fold, $I_0$", third, "7.9216854943", auto),
                Quantity("period doubling, $I_0$", doubling, "7.8492373978", auto),
            ),
        ),
    )
