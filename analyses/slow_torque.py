"""A gear pair with a fast mesh stiffness under a slow torque, over the orbits of its frozen model.

Not in the source, whose stiffness is constant. The frozen model keeps the stiffness 1 + ε cos Ωt:
it has periodic orbits where that of the source has equilibria.
"""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
import sympy as sp

import fastslow as fs
from analyses.claims import Claim, Finding
from analyses.output import Output
from fastslow.plot.layout.legends import legend_below
from fastslow.plot.layout.style import FULL, MM, TEXT, new_figure, styled_axes

#: Damping, half-width of the clearance, and amplitude and frequency of the mesh stiffness.
DAMPING, WIDTH, SWING, MESH = 0.1, 0.5, 0.4, 0.8

#: Smallest and largest torque, and its frequency.
TORQUES, SLOW = (0.1, 0.8), 1e-3

#: Range of the torque over which orbits are continued.
OVER = (0.05, 1.0)

#: Torques beside each fold, relative to it, at which motions are simulated.
BESIDE = 1e-3

#: Periods of the mesh after which they have settled.
SETTLE = 1000


@cache
def pair() -> fs.Model:
    """The model x'' + c x' + (1 + ε cos Ωt) f(x) = w, f a dead zone, w a slow harmonic torque."""
    x, v, w, k, t = sp.symbols("x v w k t")
    c, D, swing, mesh, slow = sp.symbols("c D epsilon Omega omega")
    gap = sp.Piecewise((x - D, x > D), (x + D, x < -D), (0, True))
    middle, half = sum(TORQUES) / 2, (TORQUES[1] - TORQUES[0]) / 2
    return fs.Model(
        {x: v, v: w - c * v - k * gap},
        forcing={k: 1 + swing * sp.cos(mesh * t), w: middle - half * sp.cos(slow * t)},
        parameters={c: DAMPING, D: WIDTH, swing: SWING, mesh: MESH, slow: SLOW},
    )


@cache
def branch() -> fs.OrbitBranch:
    """Orbits of the frozen model over the torque, with the period of the mesh."""
    orbit = fs.find_orbit(pair().frozen(fast=["k"]).with_parameters(w=OVER[1]), [1.5, 0.0])
    return fs.continue_orbits(orbit, "w", over=OVER)


@cache
def strobed() -> fs.Overlay:
    """A run over one period of the torque, from the orbit at its smallest value."""
    (start,) = branch().at(w=TORQUES[0], stable=True)
    return fs.overlay(branch(), fs.simulate(pair(), start(0.0), t=(0.0, 2 * np.pi / SLOW)))


@cache
def settled() -> tuple[int, int]:
    """Motions at constant torques beside the folds, and those on the stable orbits there.

    Motions begin on each of the two stable slices; inside the folds both persist, outside one.
    """
    left, right = np.sort(branch().special("LPC")["w"])
    on = count = 0
    frozen = pair().frozen(fast=["k"])
    for fold, inward in ((left, 1.0), (right, -1.0)):
        inside = fold * (1.0 + inward * BESIDE)
        starts = [orbit(0.0) for orbit in branch().at(w=inside, stable=True)]
        for torque in (inside, fold * (1.0 - inward * BESIDE)):
            period = 2 * np.pi / MESH
            many = fs.simulate_many(
                frozen.with_parameters(w=torque), starts, t=(0.0, SETTLE * period)
            )
            orbits = [orbit(0.0) for orbit in branch().at(w=torque, stable=True)]
            away = np.abs(many.final[:, None] - np.array(orbits)).max(axis=2)
            reached = {int(k) for k in away.argmin(axis=1)}
            count += len(orbits)
            on += len(reached) if away.min(axis=1).max() < 1e-6 else 0
    return count, on


@cache
def claims() -> tuple[Claim, ...]:
    """Jumps of the gear pair at folds of orbits."""
    folds, (touch,) = np.sort(branch().special("LPC")["w"]), branch().special("GR")["w"]
    up, down = strobed().transitions.select(type="jump")
    count, on = settled()
    return (
        Claim(
            "B8",
            "With a fast mesh stiffness a slow torque makes a gear pair jump between motions.",
            "Orbits of x'' + 0.1x' + (1 + 0.4 cos 0.8t) f(x) = w, D = 0.5, over 0.05 ≤ w ≤ 1, a "
            "run with w = 0.45 − 0.35 cos(0.001t) at whole periods of the stiffness, and "
            "simulations at constant torques 0.1% beside the folds.",
            (
                Finding(
                    "either",
                    "beyond the paper",
                    "The teeth touch on both sides from w = {touch:.9f} on. Between the folds of "
                    "orbits at w = {left:.9f} and {right:.9f} two stable motions coexist; {on:.0f} "
                    "of the {count:.0f} stable orbits beside the folds are reached by simulation. "
                    "The run jumps to the bilateral motion at w = {up:.4f} and back at {down:.4f}.",
                    {
                        "touch": float(touch),
                        "left": float(folds[0]),
                        "right": float(folds[1]),
                        "on": on,
                        "count": count,
                        "up": up.value,
                        "down": down.value,
                    },
                ),
            ),
            ("slow_torque",),
        ),
    )


def main(into: Output) -> None:
    """Draw the strobed states and the envelope."""
    sheet = new_figure(FULL, 80 * MM)
    left, right = (styled_axes(ax) for ax in sheet.subplots(1, 2))
    drawn = fs.plot.overlay(strobed(), "x", ax=left, legend=False)
    assert isinstance(drawn, fs.plot.OverlayDrawing)
    legend_below(left, drawn.handles)
    left.set_title("(a)", loc="left", fontsize=TEXT)
    fs.plot.overlay(strobed(), "max(x)", ax=right, legend=False)
    fs.plot.overlay(strobed(), "min(x)", ax=right, label=False)
    right.set_ylabel("min $x$, max $x$")
    right.set_title("(b)", loc="left", fontsize=TEXT)
    into.save(sheet, "slow_torque")


if __name__ == "__main__":
    main(Output(Path("figures")))
