"""The response of an impact oscillator over the frequency: its grazings and its impacts.

Not in the source. The oscillator is linear between impacts, so that its motions without impact and
those of one impact in a period are in closed form (Shaw and Holmes 1983).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.lines import Line2D
from numpy.typing import NDArray
from scipy.linalg import expm

import fastslow as fs
from analyses.claims import Claim, Finding
from analyses.output import Output
from analyses.physical_route import within
from fastslow.plot.layout.style import (
    BLACK,
    BLUE,
    FULL,
    GREY,
    MM,
    SMALL_TEXT,
    TEXT,
    VERMILION,
    dot_look,
    new_figure,
    styled_axes,
)

Floats = NDArray[np.float64]

#: Damping, amplitude of the forcing, position of the stop, and restitution.
DAMPING, AMPLITUDE, STOP, RESTITUTION = 0.05, 0.6, 1.0, 0.8

#: Of the motion without impacts.
MATRIX = np.array([[0.0, 1.0], [-1.0, -2.0 * DAMPING]])

#: Frequencies, the number at which motions are simulated, and periods in which they settle.
RANGE, SWEPT, SETTLE = (0.4, 2.2), 64, 300

#: Frequencies of orbits in closed form, and rows of a branch that are compared with them.
DRAWN, EVERY = 200, 6

#: Frequency of an orbit with a slow impact.
SLOW = 1.262

#: Look of the closed form, and of orbits.
LOOK: dict[str, Any] = {"color": GREY, "linewidth": 2.2, "zorder": 1}
DOTS: dict[str, Any] = {"color": BLACK, "marker": ".", "markersize": 3.0, "linestyle": "none"}

#: Periods after which a settled motion repeats, at most, and the difference of states that is
#: none.
MOST, SAME = 6, 1e-7


@cache
def oscillator() -> fs.Model:
    """The oscillator at the lowest frequency."""
    return fs.systems.impact_oscillator(
        zeta=DAMPING, f=AMPLITUDE, sigma=STOP, r=RESTITUTION, omega=RANGE[0]
    )


def grazing_frequencies() -> Floats:
    """Frequencies at which the linear motion touches the stop.

    Roots of f² = σ² ((1 − ω²)² + (2 ζ ω)²), a quadratic equation in ω².
    """
    squares = np.roots([1.0, 4.0 * DAMPING**2 - 2.0, 1.0 - (AMPLITUDE / STOP) ** 2])
    return np.sort(np.sqrt(squares))


def gain(omega: Floats | float) -> Floats:
    """Amplitude of the linear motion."""
    return np.asarray(AMPLITUDE / np.hypot(1.0 - np.square(omega), 2.0 * DAMPING * omega))


@cache
def swept() -> fs.BifurcationSweep:
    """Settled motions over the frequency, up and down."""
    values = np.linspace(*RANGE, SWEPT)
    return fs.bifurcation_sweep(oscillator(), "omega", values, [0, 0], settle=SETTLE, keep=1)


@cache
def settled() -> fs.Ensemble:
    """The settled motions, up and then down, over some periods."""
    passes = swept().passes
    omega = np.concatenate([one.values for one in passes])
    states = np.concatenate([one.ends for one in passes])
    return fs.simulate_many(oscillator(), states, parameters={"omega": omega}, periods=MOST)


@cache
def branch() -> fs.OrbitBranch:
    """Orbits from the one without impacts at the lowest frequency, through both grazings."""
    return fs.continue_orbits(fs.find_orbit(oscillator(), [0.0, 0.0]), "omega", over=RANGE)


@dataclass(frozen=True)
class Impacting:
    """An orbit with one impact in a period of the forcing.

    Parameters
    ----------
    omega, speed : float
        Frequency, and speed before the impact.
    multiplier : float
        Largest modulus of a multiplier.
    """

    omega: float
    speed: float
    multiplier: float


@cache
def impacting() -> tuple[Impacting, ...]:
    """Some orbits with impacts, along the branch.

    Those at special points are left out: at a fold the closed form has a double root, which is
    known to the square root of rounding.
    """
    rows = set(range(0, len(branch()), EVERY)).difference(branch().special_rows)
    some = (branch()[k] for k in sorted(rows))
    return tuple(impact_of(orbit) for orbit in some if len(orbit.trajectory.resets) == 1)


def impact_of(orbit: fs.Orbit) -> Impacting:
    """The impact of an orbit."""
    (impact,) = orbit.trajectory.resets
    growth = float(np.exp(orbit.log_multipliers.max()))
    return Impacting(orbit.parameters["omega"], float(impact.before[1]), growth)


def one_impact(omega: float) -> list[Impacting]:
    """Orbits with one impact in a period of the forcing, in closed form.

    With y = x − p, p the linear motion, the homogeneous motion M over a period and the
    approach speed u, the impact at the end gives (M − 1) y = u k, k = (0, 1) + r M e₂, and
    p² + (p'/ω)² is the square of the linear motion's amplitude: a quadratic equation in u.
    """
    whole = expm(MATRIX * 2 * np.pi / omega)
    kick = np.array([0.0, 1.0]) + RESTITUTION * whole[:, 1]
    y = np.linalg.solve(whole - np.eye(2), kick)
    square = y[0] ** 2 + (y[1] / omega) ** 2
    speeds = np.roots([square, -2.0 * STOP * y[0], STOP**2 - gain(omega) ** 2])
    found = []
    for u in speeds.real[(speeds.imag == 0) & (speeds.real > 0)]:
        jump = saltation(omega, u, STOP - u * y[0], -u * y[1])
        found.append(
            Impacting(omega, float(u), float(np.abs(np.linalg.eigvals(whole @ jump)).max()))
        )
    return found


def saltation(omega: float, speed: float, p: float, rate: float) -> Floats:
    """Jacobian of the impact, R_z + (f⁺ − R_z f⁻) nᵀ/(nᵀ f⁻), with R = (x, −r v).

    The force is that of which the linear motion has the value p and the given rate.
    """
    force = (1.0 - omega**2) * p + 2.0 * DAMPING * rate - STOP
    reset = np.diag([1.0, -RESTITUTION])
    before = np.array([speed, force - 2.0 * DAMPING * speed])
    after = np.array([-RESTITUTION * speed, force + 2.0 * DAMPING * RESTITUTION * speed])
    return reset + np.outer(after - reset @ before, [1.0, 0.0]) / speed


@cache
def closed() -> tuple[tuple[Impacting, ...], ...]:
    """Closed form between the folds: the faster impacts, and the slower ones up to a grazing."""
    left, right = np.sort(branch().special("LPC")["omega"])
    low, high = grazing_frequencies()
    curves = []
    for ends, which in (((left, right), max), ((left, low), min), ((high, right), min)):
        # denser towards both ends
        inside = np.mean(ends) - np.ptp(ends) / 2 * np.cos(np.linspace(0.0, np.pi, DRAWN)[1:-1])
        known = [which(one_impact(float(o)), key=lambda one: one.speed) for o in inside]
        curves.append(tuple(known))
    return tuple(curves)


@cache
def apart() -> float:
    """Largest difference of speeds, and relative one of multipliers, from the closed form."""
    found = []
    for one in impacting():
        other = min(one_impact(one.omega), key=lambda known: abs(known.speed - one.speed))
        found += [one.speed - other.speed, one.multiplier / other.multiplier - 1.0]
    return float(np.abs(found).max())


@cache
def on_orbits() -> int:
    """Number of settled motions that are on stable orbits of the branch."""
    many, count = settled(), 0
    for omega, state in zip(many.parameters["omega"], many.initial, strict=True):
        here = [orbit(0.0) for orbit in branch().at(omega=omega, stable=True)]
        count += any(np.abs(place - state).max() <= SAME for place in here)
    return count


def growth(omega: float) -> float:
    """The limit of |μ| u at a grazing: the saltation matrix is (1 + r) a/u below its diagonal.

    The acceleration a at the touch is −σ ω².
    """
    whole = expm(MATRIX * 2 * np.pi / omega)
    return float(abs(whole[0, 1] * (1.0 + RESTITUTION) * STOP * omega**2))


@cache
def claims() -> tuple[Claim, ...]:
    """The grazings, the folds behind them, and what coexists."""
    touches, folds = (np.sort(branch().special(code)["omega"]) for code in ("GR", "LPC"))
    low, high = grazing_frequencies()
    (slow,) = map(impact_of, branch().at(omega=SLOW, stable=False))
    return (
        Claim(
            "B10",
            "An oscillator that begins to graze its stop jumps to a motion with fast impacts.",
            "Orbits of x'' + 0.1x' + x = 0.6 cos ωt with a stop at x = 1 and r = 0.8 over "
            "0.4 ≤ ω ≤ 2.2, beside simulations up and down; grazing frequencies, impact speeds and "
            "multipliers against their closed forms.",
            (
                Finding(
                    "either",
                    "beyond the paper",
                    "The motion without impacts grazes the stop at ω = {low:.10f} and "
                    "{high:.10f}, the closed form within {near:.0e}. The orbits with one impact "
                    "that begin there are unstable and turn back at folds, at ω = {left:.10f} and "
                    "{right:.10f}; between fold and grazing two stable motions coexist. Impact "
                    "speeds u and multipliers are those of the closed form within {apart:.0e}. The "
                    "largest multiplier tends to {grown:.3f}/u at the second grazing; it is "
                    "{slowest:.3f}/u at ω = 1.262, where u = {slow:.4f}. {on:.0f} of {all:.0f} "
                    "settled motions are on stable orbits.",
                    {
                        "low": touches[0],
                        "high": touches[1],
                        "near": within(float(np.abs(touches - [low, high]).max())),
                        "left": folds[0],
                        "right": folds[1],
                        "apart": within(apart(), 1e-8),
                        "grown": growth(high),
                        "slow": slow.speed,
                        "slowest": slow.speed * slow.multiplier,
                        "on": on_orbits(),
                        "all": 2 * SWEPT,
                    },
                ),
            ),
            ("impact_response",),
        ),
    )


def main(into: Output) -> None:
    """Draw the response, the speed of the impacts, and the largest multiplier."""
    sheet = new_figure(FULL, 70 * MM)
    left, middle, right = (styled_axes(ax) for ax in sheet.subplots(1, 3, width_ratios=[3, 2, 2]))
    many = settled()
    for rows, colour in zip(np.split(np.arange(2 * SWEPT), 2), (BLUE, VERMILION), strict=True):
        left.plot(
            many.parameters["omega"][rows],
            -many.minimum[rows, 0],
            "o" if colour == BLUE else ".",
            color=colour,
            markersize=3.0,
            markerfacecolor="none" if colour == BLUE else colour,
            markeredgewidth=0.5,
            zorder=3,
        )
    drawn = fs.plot.response(branch(), "-min(x)", ax=left, label=False, linewidth=1.0)
    for curve in closed():
        middle.plot([one.omega for one in curve], [one.speed for one in curve], **LOOK)
        right.loglog([one.speed for one in curve], [one.multiplier for one in curve], **LOOK)
    middle.plot([one.omega for one in impacting()], [one.speed for one in impacting()], **DOTS)
    right.plot([one.speed for one in impacting()], [one.multiplier for one in impacting()], **DOTS)
    middle.plot(grazing_frequencies(), [0.0, 0.0], zorder=5, **dot_look("GR"))
    for ax in (left, middle):
        ax.set_xlabel(r"$\omega$")
    left.set_ylabel(r"$-\min\,x$")
    middle.set_ylabel("speed before the impact $u$")
    right.axhline(1.0, color=GREY, linewidth=0.6)
    right.set_xlabel("$u$")
    right.set_xlim(1e-3, 4.0)
    right.set_ylim(0.3, 1e3)
    right.set_ylabel("largest multiplier")
    for name, ax in zip("abc", (left, middle, right), strict=True):
        ax.set_title(f"({name})", loc="left", fontsize=TEXT)
    keys = [
        *drawn.handles,
        Line2D(
            *([], []),
            linestyle="none",
            marker="o",
            markersize=3.0,
            color=BLUE,
            markerfacecolor="none",
            markeredgewidth=0.5,
            label="simulated, up",
        ),
        Line2D(
            *([], []),
            linestyle="none",
            marker=".",
            markersize=3.0,
            color=VERMILION,
            label="simulated, down",
        ),
        Line2D([], [], label="orbits", **DOTS),
        Line2D([], [], label="closed form", **LOOK),
    ]
    sheet.legend(
        handles=keys, loc="outside lower center", ncols=4, fontsize=SMALL_TEXT, frameon=False
    )
    into.save(sheet, "impact_response")


if __name__ == "__main__":
    main(Output(Path("figures")))
