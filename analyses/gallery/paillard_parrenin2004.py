"""Ice ages as a relaxation oscillation of ice, Antarctic margin and carbon dioxide."""

from __future__ import annotations

from functools import cache

import sympy as sp

import fastslow as fs
from analyses.claims import Claim, Finding, Quantity
from analyses.gallery import About

ABOUT = About(
    title="Paillard, Parrenin: ice ages by a switch of the deep ocean",
    why="Ice ages recur about every 100,000 years, a period at which the insolation has little "
    "power. Can the climate oscillate by itself, through a switch of the deep ocean?",
    source="D. Paillard and F. Parrenin, The Antarctic ice sheet and the triggering of "
    "deglaciations, Earth and Planetary Science Letters 227, 263-271, 2004, equations (1) to (7)",
    field="climate",
    phenomena=("Filippov system", "self-sustained oscillation", "crossing orbit"),
    slow="The ice volume $V$, the Antarctic ice $A$ (15 and 12 kyr) and the carbon dioxide $C$ "
    "(5 kyr) are slow beside the switch of the deep ocean, which is instantaneous. The insolation, "
    "periods of 19 to 41 kyr, is left out: the free oscillation.",
    caption="The oscillation without insolation. (a) Ice volume, and carbon dioxide, which rises "
    "fast where the deep ocean is ventilated. (b) The orbit; circles, the switches.",
    compared="The source shows ice volume and carbon dioxide over time, as in (a), in runs under "
    "insolation. Of the model without insolation it has no figure, but states that the model "
    "oscillates.",
    unsaid=(
        "The period without insolation to more than the order of 100 kyr.",
        "Whether the values here, $a = 0.3$, $b = 0.7$, $d = 0.27$, are those of every figure: "
        "they are varied in the source.",
    ),
)


def model() -> fs.Model:
    """Ice, Antarctic margin and carbon dioxide without insolation; time in thousands of years."""
    V, A, C = sp.symbols("V A C")
    names = sp.symbols("x z beta gamma delta a b d")
    x, z, beta, gamma, delta, a, b, d = names
    stratified = a * V - b * A + d
    carbon = -beta * V + gamma * sp.Heaviside(-stratified) + delta
    return fs.Model(
        {V: (z - x * C - V) / 15, A: (V - A) / 12, C: (carbon - C) / 5},
        parameters=dict(zip(names, (1.3, 0.8, 0.5, 0.5, 0.4, 0.3, 0.7, 0.27), strict=True)),
    )


def figure() -> fs.plot.Drawing:
    """Draw the free oscillation over time and in the plane of ice and carbon dioxide."""
    left, right = fs.plot.axes("ab", height=70)
    orbit = fs.find_orbit(model(), [0.3, 0.5, 0.7])
    run = fs.simulate(model(), orbit(0), t=(0, 400))
    for name, place, color in (("V", (38, 0.6), "#0072B2"), ("C", (12, 0.5), "grey")):
        fs.plot.time_series(run, name, ax=left, label=False, color=color)
        left.text(*place, f"${name}$", color=color)
    left.set(xlabel="$t$ (kyr)", ylabel="ice volume $V$, carbon dioxide $C$")
    return fs.plot.phase_portrait(orbit.trajectory, "V", "C", ax=right)


@cache
def claims() -> tuple[Claim, ...]:
    """Period and switches of the free oscillation."""
    orbit = fs.find_orbit(model(), [0.3, 0.5, 0.7])
    fall, rise = orbit.crossings
    exact = "matrix exponentials in 40 digits (mpmath), switching by Newton's method"
    return (
        Claim(
            "1",
            "Without insolation the model oscillates by itself, with a period of the order of "
            "100 kyr.",
            "The periodic orbit, from its switch to stratification.",
            (
                Finding(
                    "either",
                    "holds",
                    "The orbit is stable; its largest multiplier beside 1 is {multiplier:.6f}.",
                    {"multiplier": orbit.multipliers[1].real},
                ),
            ),
            quantities=(
                Quantity(
                    "period (kyr)", orbit.period, "131.938071908788", exact, "of the order of 100"
                ),
                Quantity(
                    "length of the phase of high carbon dioxide (kyr)",
                    rise.time - fall.time,
                    "19.8390693860843",
                    exact,
                ),
                *(
                    Quantity(f"${name}$ at its end", rise.state[k], digits, exact)
                    for k, (name, digits) in enumerate(
                        (
                            ("V", "0.26807984359568"),
                            ("A", "0.50060564725529"),
                            ("C", "0.69413853712843"),
                        )
                    )
                ),
            ),
        ),
    )
