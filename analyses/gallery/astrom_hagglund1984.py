"""Relay feedback of three equal lags: the exact oscillation beside the describing function."""

from __future__ import annotations

from functools import cache
from math import pi, sqrt

import sympy as sp

import fastslow as fs
from analyses.claims import Claim, Finding, Quantity
from analyses.gallery import About

ABOUT = About(
    title="Åström, Hägglund: the oscillation of relay feedback",
    why="A relay in the loop makes a stable process oscillate, and the period and the amplitude "
    "of this oscillation give the settings of its controller: industrial controllers are tuned in "
    "this way. Which oscillation does a plant have under a relay, and is it stable?",
    source="K. J. Åström and T. Hägglund, Automatic tuning of simple regulators with "
    "specifications on phase and amplitude margins, Automatica 20(5), 645-651, 1984; "
    "K. H. Johansson, A. Rantzer and K. J. Åström, Fast switches in relay feedback systems, "
    "Automatica 35(4), 539-552, 1999",
    field="control",
    phenomena=("relay feedback", "self-sustained oscillation", "crossing orbit"),
    slow="Nothing; the experiment is made to tune the controller of a slow plant.",
    caption="The plant $1/(s + 1)^3$ under relay feedback. (a) Output from an arbitrary state. "
    "(b) The periodic orbit; circles, the switches of the relay. (c) Its multipliers.",
    compared="The sources show the output under relay feedback over time, as in (a), for other "
    "plants; none of their figures has this one. (b) and (c) are added here.",
    unsaid=("The plant is an example of both papers' class, not one of their figures.",),
)


def model() -> fs.Model:
    """Three equal lags with an ideal relay."""
    x, y, z = sp.symbols("x y z")
    return fs.Model({x: -x - sp.sign(z), y: x - y, z: y - z})


def figure() -> fs.plot.Drawing:
    """Draw the output, the periodic orbit and its multipliers."""
    left, middle, right = fs.plot.axes("abc", height=60)
    run = fs.simulate(model(), [1, 1, 1], t=(0, 25))
    orbit = fs.find_orbit(model(), [0.7, 0.3, 0.01])
    fs.plot.time_series(run, "z", ax=left, label=False)
    fs.plot.phase_portrait(orbit.trajectory, "z", "y", ax=middle, label=False)
    return fs.plot.multipliers(orbit, ax=right, legend=False)


@cache
def claims() -> tuple[Claim, ...]:
    """Period, switching state and multipliers of the orbit."""
    orbit = fs.find_orbit(model(), [0.7, 0.3, 0.01])
    rising = next(crossing for crossing in orbit.crossings if crossing.direction > 0)
    exact = "half-period equation with the matrix exponential, 40 digits (mpmath)"
    halves = "squares of the multipliers of a half-period, by projection at the switch"
    frequency = 2 * pi / orbit.period
    return (
        Claim(
            "1",
            "Relay feedback oscillates near the frequency at which the phase of the plant is "
            "−180°, here $\\sqrt{3}$.",
            "The periodic orbit across the switches.",
            (
                Finding(
                    "either",
                    "holds",
                    "The frequency is {low:.1%} below that of the describing function. The orbit "
                    "is stable.",
                    {"low": 1 - frequency / sqrt(3)},
                ),
            ),
            quantities=(
                Quantity("period", orbit.period, "3.679750670864798", exact),
                Quantity("angular frequency", frequency, "1.707502999300478", exact),
                Quantity("$x$ at the rising switch", rising.state[0], "0.725867925797884", exact),
                Quantity("$y$ at the rising switch", rising.state[1], "0.290630922229303", exact),
                Quantity(
                    "second multiplier",
                    orbit.multipliers[1].real,
                    "0.147448763704",
                    halves,
                ),
                Quantity("third multiplier", orbit.multipliers[2].real, "0.00010891122204", halves),
            ),
        ),
    )
