"""Den Hartog's forced oscillator with Coulomb friction, with and without stops."""

from __future__ import annotations

from functools import cache

import numpy as np
import sympy as sp

import fastslow as fs
from analyses.claims import Claim, Finding, Quantity
from analyses.gallery import About

ABOUT = About(
    title="Den Hartog: forced vibrations with Coulomb friction",
    why="Dry friction limits the resonance of machines and can stop the motion twice in each "
    "period. How large is the response of a forced mass, and when does the mass stick?",
    source="J. P. Den Hartog, Forced vibrations with combined Coulomb and viscous friction, "
    "Transactions of the ASME 53, APM-53-9, 107-115, 1931",
    field="mechanics",
    phenomena=("Coulomb friction", "periodic orbit", "crossing-sliding", "sticking"),
    slow="Nothing in the model; the ratio $r$ of the frequencies is varied.",
    caption="(a) Amplitude over the ratio of frequencies for a friction of 0.2, 0.4 and 0.6 of the "
    "force; C marks a crossing-sliding point, the limit of motion without stops. (b) Velocity at "
    "$r = 0.6$ with a friction of 0.6; the mass stops twice in a period.",
    compared="The source draws the amplitude in units of the static deflection over the ratio of "
    "frequencies, as in (a), for more values of the friction and from ratio 0 on. It draws the "
    "limit of motion without stops as a curve; here this limit is marked where a curve meets it. "
    "The curves are cut at 5: with a friction below $\\pi/4$ they are unbounded at the resonance. "
    "(b) is added here; phase angles and viscous friction are not reproduced.",
    unsaid=(
        "What happens at the ratio 1/2: one multiplier of the motion without stops tends to 1, "
        "so that the motion is no longer isolated.",
    ),
)


def model() -> fs.Model:
    """An oscillator with unit mass, stiffness and force."""
    t, x, v, r, f = sp.symbols("t x v r f")
    return fs.Model({x: v, v: sp.cos(r * t) - x - f * sp.sign(v)}, parameters={r: 2, f: 0.3})


def figure() -> fs.plot.Drawing:
    """Draw the amplitude over the frequency, and a motion with stops."""
    left, right = fs.plot.axes("ab", height=75)
    left.set_ylim(0, 5)
    for f, colour in ((0.2, "#0072b2"), (0.4, "#009e73"), (0.6, "#d55e00")):
        for r, over in ((0.7, (0.52, 0.94)), (1.5, (1.05, 2.5))):
            orbit = fs.find_orbit(model().with_parameters(r=r, f=f), [0, 0])
            branch = fs.continue_orbits(orbit, "r", over=over)
            drawn = fs.plot.response(branch, "max(x)", ax=left, label=False, color=colour)
        drawn.lines[0].set_label(f"$f = {f}$")
    named = [line for line in left.lines if "$f" in str(line.get_label())]
    left.legend(handles=[*named, *drawn.markers], fontsize="x-small")
    stops = fs.find_orbit(model().with_parameters(r=0.6, f=0.6), [0, 0])
    fs.plot.time_series(stops.trajectory, "v", ax=right)
    return drawn


def amplitude(r: float, f: float) -> float:
    """Largest displacement of the periodic orbit, from rest."""
    orbit = fs.find_orbit(model().with_parameters(r=r, f=f), [0, 0])
    return float(orbit.trajectory.extremes("x")[1])


@cache
def claims() -> tuple[Claim, ...]:
    """Amplitudes and the limit of motion without stops, both in closed form."""
    by_friction = fs.continue_orbits(fs.find_orbit(model(), [0, 0]), "f", over=(0.2, 0.8))
    by_ratio = [
        fs.continue_orbits(
            fs.find_orbit(model().with_parameters(r=r, f=0.6), [0, 0]), "r", over=over
        )
        for r, over in ((0.7, (0.55, 0.9)), (1.5, (1.15, 2.5)))
    ]
    (limit,) = by_friction.special("CS")
    lower, upper = (branch.special("CS")[0]["r"] for branch in by_ratio)
    closed = r"$\sqrt{V^2 - f^2 U^2}$"
    stops = r"root of $f\sqrt{U^2 + r^{-4}} = \lvert V\rvert$"
    return (
        Claim(
            "1",
            "Without stops the amplitude is $\\sqrt{V^2 - f^2 U^2}$, with $V = 1/(1 - r^2)$ and "
            "$U = \\sin(\\pi/r)/(r(1 + \\cos(\\pi/r)))$.",
            "Extremes of periodic orbits.",
            (
                Finding(
                    "either",
                    "holds",
                    "The orbit at $r = 2$, $f = 0.3$ is stable, with multipliers of modulus "
                    "{size:.4f}.",
                    {"size": float(np.abs(fs.find_orbit(model(), [0, 0]).multipliers).max())},
                ),
            ),
            quantities=(
                *(
                    Quantity(f"$r = {r}$, $f = {f}$", amplitude(r, f), digits, "formula", closed)
                    for r, f, digits in (
                        (2, 0.3, "0.29767618499153"),
                        (1.5, 0.2, "0.76594168620507"),
                        (0.7, 0.4, "1.8251665658836"),
                    )
                ),
            ),
        ),
        Claim(
            "2",
            "Above a friction that depends on the frequency the mass stops twice in every period.",
            "Crossing-sliding of periodic orbits over the friction, and over the ratio.",
            (
                Finding(
                    "either",
                    "holds",
                    "Beyond the limit the orbit at $r = 2$ sticks {stops} times in a period.",
                    {"stops": max(len(route) for route in by_friction.itineraries) - 2},
                ),
            ),
            quantities=(
                Quantity("$f$ at $r = 2$", limit["f"], "0.5962847939999", stops),
                Quantity("$r < 1$ at $f = 0.6$", lower, "0.6329711910102", stops),
                Quantity("$r > 1$ at $f = 0.6$", upper, "1.9433405182216", stops),
            ),
        ),
    )
