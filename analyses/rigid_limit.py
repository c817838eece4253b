"""The gear with rigid teeth beside the one with stiff teeth.

Not in the source. As A grows, a contact lasts π/√A and returns the speed with the restitution
r = exp(−π/(2√A)): the gear tends to one whose teeth are rigid and bounce with that r. Under the
load of figure 3 the first rebounds on the lower side are compared.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
from matplotlib.lines import Line2D
from numpy.typing import NDArray

import fastslow as fs
from analyses.cases import GAP, STIFFNESSES, gear
from analyses.claims import Claim, Finding
from analyses.output import Output
from analyses.passages import OMEGA, REST
from fastslow.plot.layout.style import (
    BLUE,
    FULL,
    GREY,
    MM,
    SMALL_TEXT,
    TEXT,
    VERMILION,
    new_figure,
    styled_axes,
)

Floats = NDArray[np.float64]

#: Stiffnesses k1, N m/rad: those of figure 4, and beyond them.
STIFF = (*STIFFNESSES, 3e4, 3e5, 3e6, 3e7)

#: Those drawn over time.
DRAWN = (3000, 300_000)

#: Until when the gear is simulated: the load of figure 3 is negative from 387 to 556 on.
END = 420.0

#: What is drawn, from the first impact on the lower side on.
SHOWN = (-1.0, 7.0)


@dataclass(frozen=True, eq=False)
class Rebound:
    """The first impact on the lower side and the one after it.

    Parameters
    ----------
    A : float
    run : Trajectory
    first, second : float
        Times at which the teeth meet.
    speed, again : float
        Speeds of these impacts.
    """

    A: float
    run: fs.Trajectory
    first: float
    second: float
    speed: float
    again: float


def stiff(k1: float) -> Rebound:
    """With elastic teeth."""
    model = gear("consistent", D=GAP, k1=k1)
    run = fs.simulate(model, REST, t=(0.0, END))
    met = [c for c in run.crossings if c.to_region == "S3"]
    speeds = [abs(float(c.state[1])) for c in met[:2]]
    return Rebound(model.parameters["A"], run, met[0].time, met[1].time, speeds[0], speeds[1])


def rigid(k1: float) -> Rebound:
    """With rigid teeth that bounce with the restitution of the elastic ones."""
    p = gear("consistent", D=GAP, k1=k1).parameters
    r = float(np.exp(-np.pi / (2 * np.sqrt(p["A"]))))
    model = fs.systems.rigid_gear(B=p["B"], C=p["C"], D=GAP, r=r, omega=OMEGA)
    run = fs.simulate(model, REST, t=(0.0, END))
    met = [c for c in run.resets if c.before[0] < 0]
    speeds = [abs(float(c.before[1])) for c in met[:2]]
    return Rebound(p["A"], run, met[0].time, met[1].time, speeds[0], speeds[1])


@cache
def pairs() -> tuple[tuple[Rebound, Rebound], ...]:
    """Both, at each stiffness."""
    return tuple((stiff(k1), rigid(k1)) for k1 in STIFF)


def apart() -> tuple[Floats, Floats, Floats]:
    """A, by how much the rebound lasts longer with elastic teeth, and relative error of its end.

    The latter is that of the speed of the second impact.
    """
    longer = [(a.second - a.first) - (b.second - b.first) for a, b in pairs()]
    speed = [a.again / b.again - 1.0 for a, b in pairs()]
    return np.array([a.A for a, _ in pairs()]), np.array(longer), np.array(speed)


def order() -> float:
    """Exponent of 1/A at the largest stiffnesses, of the former."""
    A, longer, _ = apart()
    return float(np.log(longer[-2] / longer[-1]) / np.log(A[-1] / A[-2]))


@cache
def claims() -> tuple[Claim, ...]:
    """How near the limit is."""
    A, longer, speed = apart()
    usual = STIFF.index(3000)
    law = np.pi / np.sqrt(A)
    return (
        Claim(
            "B16",
            "The gear tends to one with rigid teeth as A^(−1/2), but is far from it.",
            "The first impact on the lower side and the one after it under the load of Fig. 3, "
            "D = 0.25 and ω_o = 0.01, with teeth of k1 = 1000 to 3e7 N m/rad and with rigid ones "
            "of the restitution exp(−π/(2√A)), in the consistent scaling.",
            (
                Finding(
                    "either",
                    "beyond the paper",
                    "Between the two impacts pass {longer:.3f} more than with rigid teeth at "
                    "k1 = 3000, of which the contact lasts π/√A = {law:.3f}; the load, which grows "
                    "during it, makes the flight shorter. At 3e7 it is {last:.4f} π/√A, and "
                    "decreases as A^(−{order:.3f}). The speed of the second impact differs by "
                    "{speed:.1%} at k1 = 3000 and by {least:.2%} at 3e7.",
                    {
                        "longer": longer[usual],
                        "law": law[usual],
                        "last": longer[-1] / law[-1],
                        "order": order(),
                        "speed": abs(speed[usual]),
                        "least": abs(speed[-1]),
                    },
                ),
            ),
            ("rigid_limit",),
        ),
    )


def main(into: Output) -> None:
    """Draw the rebounds of two stiffnesses, and the difference over the stiffness."""
    sheet = new_figure(FULL, 62 * MM)
    axes = [styled_axes(ax) for ax in sheet.subplots(1, 3)]
    for ax, k1 in zip(axes[:2], DRAWN, strict=True):
        one, other = pairs()[STIFF.index(k1)]
        for which, colour, width, style in (
            (other, VERMILION, 1.6, (0, (3, 1.5))),
            (one, BLUE, 1.1, "-"),
        ):
            times = which.first + np.linspace(*SHOWN, 3000)
            x = which.run(times)[0]
            ax.plot(times - which.first, x, color=colour, linewidth=width, linestyle=style)
        ax.axhline(-GAP, color=GREY, linewidth=0.8)
        ax.set_xlim(*SHOWN)
        ax.set_ylim(-0.285, -0.17)
        ax.set_xlabel("time after the first impact")
        ax.set_ylabel("$x$", labelpad=1.0)
    A, longer, _ = apart()
    axes[2].loglog(A, longer, "o", color=BLUE, markersize=3.5)
    axes[2].loglog(A, np.pi / np.sqrt(A), color=GREY, linewidth=1.0, label=r"$\pi/\sqrt{A}$")
    axes[2].set_xlabel("$A$")
    axes[2].set_ylabel("more time between impacts")
    axes[2].legend(fontsize=SMALL_TEXT, frameon=False)
    titles = [f"$k_1 = {k1:,}$".replace(",", r"\,") for k1 in DRAWN]
    for letter, ax, title in zip("abc", axes, (*titles, ""), strict=True):
        ax.set_title(f"({letter}) {title}", loc="left", fontsize=TEXT)
    handles = [
        Line2D([], [], color=BLUE, linewidth=1.1, label="elastic teeth"),
        Line2D(
            [], [], color=VERMILION, linewidth=1.6, linestyle=(0, (3, 1.5)), label="rigid teeth"
        ),
    ]
    axes[0].legend(handles=handles, fontsize=SMALL_TEXT, frameon=False, loc="upper right")
    into.save(sheet, "rigid_limit")


if __name__ == "__main__":
    main(Output(Path("figures")))
