"""A ball on a vibrating table: one bounce in a period, and its period doubling."""

from __future__ import annotations

from functools import cache

import numpy as np

import fastslow as fs
from analyses.claims import Claim, Finding, Quantity
from analyses.gallery import About

ABOUT = About(
    title="Holmes: a ball that bounces on a vibrating table",
    why="A ball on a vibrating table is the simplest oscillator with impacts and a model of "
    "rattling parts. Up to which acceleration of the table does the ball bounce once in each "
    "period?",
    source="P. J. Holmes, The dynamics of repeated impacts with a sinusoidally vibrating table, "
    "Journal of Sound and Vibration 84(2), 173-189, 1982; with the exact height of the table: "
    "A. C. J. Luo and R. P. S. Han, The dynamics of a bouncing ball with a sinusoidally vibrating "
    "table revisited, Nonlinear Dynamics 10, 1-18, 1996",
    field="mechanics",
    phenomena=("impact", "forced orbit", "fold of cycles", "period doubling"),
    slow="Nothing in the model; the amplitude $A$ of the table is varied. With $g = \\omega = 1$ "
    "it is the largest acceleration of the table over gravity.",
    caption="(a) Largest height of the ball over the amplitude: the orbits of one bounce in a "
    "period of the table and, from PD1, of two bounces in two periods, which doubles too. (b) Ball "
    "and table (grey) at $A = 1.15$.",
    compared="The sources draw phase portraits of the map, in the plane of the phase and the "
    "velocity of the impacts; here the height is drawn over the amplitude and over time.",
    unsaid=(
        "Where the orbit of two bounces in two periods ends; it is drawn up to $A = 1.25$.",
        "Which other motions coexist: the ball can also rest on the table while $A < 1$.",
    ),
)


def model() -> fs.Model:
    """The ball over an exact table, with the coefficient of restitution 0.8."""
    return fs.systems.bouncing_ball(g=1, A=0.8, omega=1, r=0.8)


def figure() -> fs.plot.Drawing:
    """Draw the orbits of one and two bounces over the amplitude, and the ball over time."""
    left, right = fs.plot.axes("ab", height=75)
    one = fs.continue_orbits(fs.find_orbit(model(), [3.6, -2]), "A", over=(0.3, 1.25))
    doubled = fs.find_orbit(model(), one["PD1"])
    two = fs.continue_orbits(doubled, "A", over=(1, 1.25))
    ball = model().with_parameters(A=1.15)
    run = fs.simulate(ball, two.at(A=1.15)[0](0), t=(0, 25))
    fs.plot.time_series(run, "x", ax=right, label=False)
    right.set_xlim(0, 25)
    right.plot(run.t, 1.15 * np.sin(run.t), color="grey", linewidth=0.8)
    fs.plot.response(two, "max(x)", ax=left, label=False, color="#009E73")
    return fs.plot.response(one, "max(x)", ax=left)


@cache
def claims() -> tuple[Claim, ...]:
    """Existence and period doubling of the orbit of one bounce."""
    branch = fs.continue_orbits(fs.find_orbit(model(), [3.6, -2]), "A", over=(0.3, 1.25))
    (fold,), (doubling,) = branch.special("LPC"), branch.special("PD")
    multipliers = np.sort(doubling.orbit.multipliers.real)
    holmes = np.hypot(np.pi * 0.2 / 1.8, 1)
    closed = "closed form"
    return (
        Claim(
            "1",
            "An orbit of one bounce in a period exists from $A = \\pi (1 - r)/(1 + r)$ on.",
            "The branch of this orbit over the amplitude.",
            (Finding("either", "holds", "There it is born with an unstable one at a fold."),),
            quantities=(
                Quantity(
                    "fold of cycles, $A$",
                    fold["A"],
                    "0.349065850398866",
                    closed,
                    r"$\pi (1 - r)/(1 + r)$",
                ),
            ),
        ),
        Claim(
            "2",
            "With the exact height of the table, it doubles its period at "
            "$A^2 = [\\pi (1 - r)/(1 + r)]^2 + [2 (1 + r^2)/(1 + r)^2]^2$.",
            "The period doubling of the branch.",
            (
                Finding(
                    "either",
                    "holds",
                    "It is stable between the two; the product of its multipliers is $r^2$.",
                ),
            ),
            quantities=(
                Quantity("period doubling, $A$", doubling["A"], "1.070836468247907", closed),
                Quantity("first multiplier", multipliers[0], "-1.0000000000000", closed),
                Quantity("second multiplier", multipliers[1], "-0.6400000000000", closed),
            ),
        ),
        Claim(
            "3",
            "In Holmes' map, which replaces the height of the table at an impact by its mean, the "
            "orbit begins at the same amplitude and doubles at "
            "$A^2 = [\\pi (1 - r)/(1 + r)]^2 + 1$.",
            "The period doubling of the branch beside this formula, which follows from the "
            "Jacobian of the map.",
            (
                Finding(
                    "either",
                    "holds conditionally",
                    "The formula gives $A = {holmes:.4f}$; with the exact height the doubling is "
                    "{later:.1%} later. The product of the multipliers is $r$ in the map and "
                    "$r^2$ with the exact height.",
                    {"holmes": holmes, "later": doubling["A"] / holmes - 1},
                    "in part",
                ),
            ),
        ),
    )
