"""Regular spiking of Izhikevich's neuron under a step of current."""

from __future__ import annotations

from functools import cache

import numpy as np

import fastslow as fs
from analyses.claims import Claim, Finding, Quantity
from analyses.gallery import About

ABOUT = About(
    title="Izhikevich: regular spiking of a neuron with a reset",
    why="A quadratic equation with a reset reproduces the firing of many cortical cells at little "
    "cost and is used in large networks. How does the recovery lengthen the intervals between the "
    "spikes?",
    source="E. M. Izhikevich, Simple model of spiking neurons, IEEE Transactions on Neural "
    "Networks 14(6), 1569-1572, 2003, equations (1) to (3), Fig. 2 (RS)",
    field="neuroscience",
    phenomena=("reset", "integrate-and-fire", "adaptation", "Hopf bifurcation", "fold"),
    slow="The recovery $u$, with the rate $a = 0.02$ per millisecond against the voltage $v$.",
    caption="(a) Voltage under a step of current at $t = 0$. (b) The recovery, which increases "
    "until the intervals between spikes are constant; dotted, the resets. (c) The same run over "
    "the equilibria of the frozen model: each spike is a jump from the fold LP1, with a delay.",
    compared="Fig. 2 (RS) of the source shows (a) alone, the voltage in mV over ms, for the same "
    "$a$, $b$, $c$ and $d$; the height of the step of current is not printed. (b) and (c) "
    "are added here.",
    unsaid=(
        "The initial state; here $v = -65$, $u = bv$, as in the program that the source prints.",
        "The height of the step, for which the program has noise; here $I_0 = 10$.",
    ),
)


def model() -> fs.Model:
    """Izhikevich's neuron with the parameters of regular spiking."""
    return fs.systems.izhikevich(I_0=10, a=0.02, b=0.2, c=-65, d=8)


def figure() -> fs.plot.Drawing:
    """Draw voltage and recovery after a step of current, and the overlay on the frozen model."""
    run = fs.simulate(model(), [-65, -13], t=(0, 300))
    upper, lower, right = fs.plot.axes("ac;bc", height=85)
    fs.plot.time_series(run, "v", ax=upper, label=False)
    fs.plot.time_series(run, "u", ax=lower, label=False)
    frozen = fs.continue_equilibria(model().frozen(), "u", over=(-14, 1), window={"v": (-90, 30)})
    drawn = fs.plot.overlay(fs.overlay(frozen, run), "v", ax=right)
    for ax in (upper, lower):
        ax.set(xlabel="$t$ (ms)")
    for ax in (upper, right):
        ax.set(ylabel="$v$ (mV)")
    return drawn


@cache
def claims() -> tuple[Claim, ...]:
    """Adaptation, and the settled spiking."""
    exact = fs.Integration(rtol=1e-14)
    run = fs.simulate(model(), [-65, -13], t=(0, 400), integration=exact)
    spikes = np.array([spike.time for spike in run.resets])
    intervals = np.diff(spikes)
    orbit = fs.find_orbit(model(), [-65, 0.5])
    full = model().frozen(fast=["u"]).with_free("I_0")
    rest = fs.continue_equilibria(full, "I_0", over=(0, 10))
    (hopf,), (fold,) = rest.special("HB"), rest.folds
    solved = "SciPy, DOP853 with events, rtol 3e-14"
    return (
        Claim(
            "1",
            "Under a step of current, regular spiking neurons “fire a few spikes with short "
            "interspike period and then the period increases. This is called the spike frequency "
            "adaptation.”",
            "The spikes after a step to $I_0 = 10$, and the periodic orbit on which they settle.",
            (
                Finding(
                    "either",
                    "holds",
                    "The first interval is {first:.2f} ms and the third {third:.2f} ms; the second "
                    "exceeds it by {over:.2f} ms. The orbit is stable, with the multiplier "
                    "{multiplier:.0e}.",
                    {
                        "first": intervals[0],
                        "third": intervals[2],
                        "over": intervals[1] - intervals[2],
                        "multiplier": orbit.multipliers[1].real,
                    },
                ),
            ),
            quantities=(
                Quantity(
                    "first spike (ms)",
                    spikes[0],
                    "3.127055303876976",
                    "Taylor series in 30 digits (mpmath); SciPy, DOP853, differs by 4e-14",
                ),
                Quantity("settled interval (ms)", orbit.period, "44.8124136681", solved),
                Quantity(
                    "$u$ after a settled spike",
                    float(orbit["u"].max()),
                    "0.500954015600",
                    solved,
                ),
            ),
        ),
        Claim(
            "2",
            "A sufficient current makes the neuron spike; below it rests.",
            "Equilibria of the neuron over the current.",
            (
                Finding(
                    "either",
                    "holds",
                    "Rest loses stability at a {kind} Hopf point, with the first Lyapunov "
                    "coefficient {lyapunov:.3f}, before it vanishes at a fold: the "
                    "onset is no saddle-node on an invariant circle for these parameters.",
                    {"kind": hopf.criticality, "lyapunov": hopf.lyapunov},
                ),
            ),
            quantities=(
                Quantity("Hopf, $I_0$", hopf["I_0"], "3.79750000000000", "closed form: zero trace"),
                Quantity("Hopf, $v$", hopf["v"], "-62.2500000000000", "closed form: zero trace"),
                Quantity(
                    "fold, $I_0$",
                    fold["I_0"],
                    "4.0000000000000",
                    "closed form: $(b - 5)^2 = 0.16 (140 + I_0)$",
                ),
                Quantity("fold, $v$", fold["v"], "-60.0000000000000", "closed form"),
            ),
        ),
    )
