"""A gear pair with a rectangular mesh stiffness under a slow torque.

Not in the source, whose stiffness is constant. One or two pairs of teeth are in mesh, so that the
stiffness has two values, and jumps while the teeth may touch or separate.
"""

from __future__ import annotations

from functools import cache
from itertools import pairwise
from pathlib import Path

import numpy as np
import sympy as sp
from numpy.typing import NDArray
from scipy.linalg import expm

import fastslow as fs
from analyses.claims import Claim, Finding
from analyses.output import Output
from fastslow.plot.layout.legends import legend_below
from fastslow.plot.layout.style import (
    BLACK,
    BLUE,
    FULL,
    GREY,
    MM,
    TEXT,
    VERMILION,
    new_figure,
    styled_axes,
)

#: Damping, half-width of the clearance, swing and frequency of the stiffness, and the share of the
#: period with two pairs of teeth in mesh: the contact ratio is 1.6.
DAMPING, WIDTH, SWING, MESH, SHARE = 0.1, 0.5, 0.3, 0.8, 0.6

#: Smallest and largest torque, and its frequency.
TORQUES, SLOW = (0.1, 0.8), 1e-3

#: Range of the torque over which orbits are continued.
OVER = (0.05, 1.0)

#: Torques below and above that of a corner at which its orbit is drawn.
BESIDE = 0.06


@cache
def pair() -> fs.Model:
    """The model x'' + c x' + k(t) f(x) = w, f a dead zone, k rectangular, w a slow torque."""
    x, v, w, k, t = sp.symbols("x v w k t")
    c, D, swing, mesh, share, slow = sp.symbols("c D epsilon Omega s omega")
    gap = sp.Piecewise((x - D, x > D), (x + D, x < -D), (0, True))
    period = 2 * sp.pi / mesh
    both = sp.floor(t / period) - sp.floor(t / period - share)
    middle, half = sum(TORQUES) / 2, (TORQUES[1] - TORQUES[0]) / 2
    return fs.Model(
        {x: v, v: w - c * v - k * gap},
        forcing={k: 1 + swing * (2 * both - 1), w: middle - half * sp.cos(slow * t)},
        parameters={c: DAMPING, D: WIDTH, swing: SWING, mesh: MESH, share: SHARE, slow: SLOW},
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


def closing(point: fs.SpecialOrbit) -> float:
    """Distance by which the orbit at a corner fails to close by matrix exponentials.

    Between the events, whose times are those of the orbit, the motion is linear.
    """
    run, period = point.orbit.trajectory, 2 * np.pi / MESH
    since, until = run.span
    events = [c.time for c in run.crossings() if c.direction != 0]
    first = int(np.floor(since / period))
    events += [(k + part) * period for k in range(first, first + 3) for part in (0.0, SHARE)]
    edges = np.unique([since, *(one for one in events if since < one < until), until])
    begin = state = np.array(point.orbit(since))
    for one, two in pairwise(edges.tolist()):
        middle = 0.5 * (one + two)
        stiff = 1 + SWING * (1 if middle / period % 1 < SHARE else -1)
        x = float(point.orbit(middle)[0])
        level = WIDTH * np.sign(x) if abs(x) > WIDTH else 0.0
        k = stiff if level else 0.0
        # x' = v, v' = w − c v − k (x − level), with a constant as third state
        A = np.array([[0, 1, 0], [-k, -DAMPING, point["w"] + k * level], [0, 0, 0]])
        state = (expm(A * (two - one)) @ [*state, 1.0])[:2]
    return float(np.abs(state - begin).max())


def apart(point: fs.SpecialOrbit) -> float:
    """Difference of the multipliers on both sides of a corner."""
    sides = np.sort_complex(point.multipliers), np.sort_complex(point.multipliers_beyond)
    return float(np.abs(sides[0] - sides[1]).max())


@cache
def claims() -> tuple[Claim, ...]:
    """The branch of orbits, its corners and folds, and the jumps of the run."""
    orbits = branch()
    folds, corners = np.sort(orbits.special("LPC")["w"]), orbits.special("CC")
    passed = [one for one in strobed().transitions if one.special in tuple(corners)]
    up, down = strobed().transitions.select(type="jump")
    values = np.sort(corners["w"])
    return (
        Claim(
            "B8b",
            "With one or two pairs of teeth in mesh, the orbits go on where a tooth pair enters "
            "or leaves as the teeth touch or separate.",
            "Orbits of x'' + 0.1x' + k(t) f(x) = w, D = 0.5, with k = 1.3 during 0.6 of the mesh "
            "period 2π/0.8 and 0.7 else, over 0.05 ≤ w ≤ 1, and a run with "
            "w = 0.45 − 0.35 cos(0.001t).",
            (
                Finding(
                    "either",
                    "beyond the paper",
                    "The order of both events is exchanged at w = {first:.9f}, {second:.9f} and "
                    "{third:.9f}. The multipliers agree on both sides within {apart:.0e}, since "
                    "the teeth carry no force there; by matrix exponentials the orbits close "
                    "within {closed:.0e}. Between the folds at w = {left:.9f} and {right:.9f} two "
                    "stable motions coexist; the run jumps at w = {up:.4f} and {down:.4f}, and "
                    "passes corners {passed:.0f} times, each within {late:.3f} of its torque.",
                    {
                        "first": float(values[0]),
                        "second": float(values[1]),
                        "third": float(values[2]),
                        "left": float(folds[0]),
                        "right": float(folds[1]),
                        "up": up.value,
                        "down": down.value,
                        "passed": len(passed),
                        "late": max(abs(one.delay) for one in passed),
                        "apart": max(1e-9, *map(apart, corners)),
                        "closed": max(1e-12, *map(closing, corners)),
                    },
                ),
            ),
            ("mesh_steps",),
        ),
    )


def motions() -> tuple[fs.SpecialOrbit, list[fs.Orbit]]:
    """The corner of the largest torque, and stable orbits below and above it."""
    corner = max(branch().special("CC"), key=lambda one: float(one["w"]))
    around = [corner["w"] - BESIDE, corner["w"] + BESIDE]
    return corner, [branch().at(w=value, stable=True)[-1] for value in around]


def main(into: Output) -> None:
    """Draw the envelope of run and orbits, and the motion at a corner."""
    sheet = new_figure(FULL, 80 * MM)
    left, right = (styled_axes(ax) for ax in sheet.subplots(1, 2))
    drawn = fs.plot.overlay(strobed(), "max(x)", ax=left, legend=False)
    assert isinstance(drawn, fs.plot.OverlayDrawing)
    fs.plot.overlay(strobed(), "min(x)", ax=left, label=False, legend=False)
    left.set_ylabel("min $x$, max $x$")
    legend_below(left, drawn.handles)
    left.set_title("(a)", loc="left", fontsize=TEXT)
    corner, beside = motions()
    period = corner.orbit.period
    shares = np.linspace(0.0, 1.0, 801)
    for level, name in ((WIDTH, "$D$"), (-WIDTH, "$-D$")):
        right.axhline(level, color=GREY, linewidth=0.5)
        right.text(0.985, level + 0.1, name, fontsize=TEXT, ha="right", va="bottom")
    right.axvline(SHARE, color=GREY, linewidth=0.5)
    for place, stiffness in ((0.5 * SHARE, 1 + SWING), (0.5 * (1 + SHARE), 1 - SWING)):
        right.text(place, 3.75, f"$k = {stiffness:.1f}$", fontsize=TEXT, ha="center")
    for orbit, colour, label in (
        (beside[0], BLUE, ""),
        (corner.orbit, BLACK, f", {corner.label}"),
        (beside[1], VERMILION, ""),
    ):
        x: NDArray[np.float64] = orbit(shares * period)[0]
        name = f"$w = {orbit.parameters['w']:.3f}${label}"
        right.plot(shares, x, color=colour, linewidth=1.0, label=name)
    right.plot([corner.time / period % 1.0], corner.state[:1], "o", color=BLACK, markersize=3)
    right.set_xlabel(r"$\Omega t / 2\pi$")
    right.set_ylabel("$x$")
    right.set_xlim(0.0, 1.0)
    right.set_ylim(-1.6, 4.2)
    right.legend(loc="upper left", bbox_to_anchor=(0.12, 0.88), fontsize=TEXT, frameon=False)
    right.set_title("(b)", loc="left", fontsize=TEXT)
    into.save(sheet, "mesh_steps")


if __name__ == "__main__":
    main(Output(Path("figures")))
