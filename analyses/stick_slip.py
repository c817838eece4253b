"""The stick-slip cycle of a block on a belt, with its multiplier 0.

Not in the source. The block is that of Leine, van Campen, de Kraker and van den Steen (1998):
where it sticks, the motion is on the interface, and all that distinguished two motions is lost.
"""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np

import fastslow as fs
from analyses.claims import Claim, Finding
from analyses.output import Output
from analyses.physical_route import within
from fastslow.plot.layout.style import FULL, GREY, MM, TEXT, new_figure, styled_axes

#: Speeds of the belt, and that of the portrait.
SPEEDS, SPEED = (0.05, 1.2), 0.2

#: Initial states of two runs, from inside the cycle and from outside, and their length.
STARTS, LENGTH = ([0.8, 0.0], [1.8, -0.2]), 40.0


@cache
def cycle() -> fs.Orbit:
    """The cycle, from the state at which sticking ends."""
    return fs.find_orbit(fs.systems.stick_slip(v_b=SPEED), [1.0, SPEED])


@cache
def branch() -> fs.OrbitBranch:
    """The cycle over the speed of the belt."""
    return fs.continue_orbits(cycle(), "v_b", over=SPEEDS)


@cache
def runs() -> tuple[fs.Trajectory, ...]:
    """Two runs that merge with the cycle."""
    model = fs.systems.stick_slip(v_b=SPEED)
    return tuple(fs.simulate(model, start, t=(0.0, LENGTH)) for start in STARTS)


def merged() -> float:
    """Distance of the last slip of each run from that of the cycle."""
    ends = [run.crossings("v - v_b")[-2:] for run in runs()]
    states = np.array([[crossing.state for crossing in pair] for pair in ends])
    return float(np.abs(states[0] - states[1]).max())


@cache
def claims() -> tuple[Claim, ...]:
    """Multipliers of the cycle, and the speed at which its sticking phase is divided."""
    point = branch().special("SS")[0]
    arrival = min(crossing.state[0] for crossing in point.orbit.crossings("v - v_b"))
    return (
        Claim(
            "B7",
            "The stick-slip cycle of a block on a belt has a multiplier that is exactly 0.",
            "Orbits of x'' + x = −F_s sign(x' − v_b)/(1 + δ|x' − v_b|), F_s = 1, δ = 3, over belt "
            "speeds 0.05 ≤ v_b ≤ 1.2, with the singular saltation matrix of the entry into "
            "sticking.",
            (
                Finding(
                    "either",
                    "beyond the paper",
                    "{zeros:.0%} of the orbits have the multipliers 1 and 0. At v_b = 0.2 the "
                    "period is {period:.10f}, and runs from inside and outside the cycle are on it "
                    "within {apart:.0e} after sticking once. At v_b = {speed:.10f} the slip ends "
                    "at the edge of the sticking set, x = −F_s within {gap:.0e} "
                    "(switching-sliding); above it the block overtakes the belt before it sticks.",
                    {
                        "zeros": (branch().log_multipliers.min(axis=1) == -np.inf).mean(),
                        "period": cycle().period,
                        "apart": within(merged()),
                        "speed": point["v_b"],
                        "gap": within(abs(arrival + 1.0)),
                    },
                ),
            ),
            ("stick_slip",),
        ),
    )


def main(into: Output) -> None:
    """Draw the cycle with two runs, its multipliers, and its amplitude over the belt's speed."""
    sheet = new_figure(FULL, 58 * MM)
    left, middle, right = (styled_axes(ax) for ax in sheet.subplots(1, 3))
    for run in runs():
        t = np.linspace(0.0, LENGTH, 2000)
        left.plot(*run(t), color=GREY, linewidth=0.6, zorder=1)
        left.plot(*run(0.0), ".", color=GREY, markersize=4)
    fs.plot.phase_portrait(cycle().trajectory, "x", "v", ax=left, crossings=False)
    fs.plot.multipliers(cycle(), ax=middle, legend=False)
    fs.plot.response(branch(), "max(v) - v_b", ax=right)
    right.set_ylabel("$\\max v - v_b$")
    for name, ax in zip("abc", (left, middle, right), strict=True):
        ax.set_title(f"({name})", loc="left", fontsize=TEXT)
    into.save(sheet, "stick_slip")


if __name__ == "__main__":
    main(Output(Path("figures")))
