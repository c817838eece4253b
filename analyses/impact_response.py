"""The response of an impact oscillator over the frequency: its grazings and its impacts.

Not in the source. The oscillator is linear between impacts, so that its motions without impact and
those of one impact in a period are in closed form (Shaw and Holmes 1983).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from pathlib import Path

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
    SMALL,
    TEXT,
    VERMILION,
    dot_look,
    new_figure,
    styled_axes,
)

Floats = NDArray[np.float64]

#: Damping, amplitude of the forcing, position of the stop, and restitution.
DAMPING, AMPLITUDE, STOP, RESTITUTION = 0.05, 0.6, 1.0, 0.8

#: Frequencies, the number at which motions are simulated, and periods in which they settle.
RANGE, SWEPT, SETTLE = (0.4, 2.2), 150, 300

#: Frequencies of motions in closed form, and points of each at which the stop is checked.
DRAWN, POINTS = 600, 200

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


@dataclass(frozen=True)
class Impacting:
    """A motion with one impact in a period of the forcing.

    Parameters
    ----------
    omega, speed : float
        Frequency, and speed before the impact.
    linear : ndarray
        The linear motion and its rate at the impact.
    depth : float
        Largest distance below x = 0.
    multiplier : float
        Largest modulus of a multiplier.
    """

    omega: float
    speed: float
    linear: Floats
    depth: float
    multiplier: float


def one_impact(omega: float) -> list[Impacting]:
    """Motions with one impact in a period of the forcing, in closed form.

    With y = x − p, p the linear motion, the homogeneous motion M over a period and the
    approach speed u, the impact at the end gives (M − 1) y = u k, k = (0, 1) + r M e₂, and
    p² + (p'/ω)² is the square of the linear motion's amplitude: a quadratic equation in u. Those
    that pass the stop in between are left out.
    """
    matrix = np.array([[0.0, 1.0], [-1.0, -2.0 * DAMPING]])
    period = 2 * np.pi / omega
    whole = expm(matrix * period)
    kick = np.array([0.0, 1.0]) + RESTITUTION * whole[:, 1]
    y = np.linalg.solve(whole - np.eye(2), kick)
    square = y[0] ** 2 + (y[1] / omega) ** 2
    speeds = np.roots([square, -2.0 * STOP * y[0], STOP**2 - gain(omega) ** 2])
    found = []
    for u in speeds.real[(speeds.imag == 0) & (speeds.real > 0)]:
        p, q = linear = np.array([STOP - u * y[0], -u * y[1]])
        t = np.linspace(0.0, period, POINTS)
        part = expm(matrix * t[1])
        free = np.array([u * y[0], -RESTITUTION * u + u * y[1]])
        x = []
        for now in t:
            x.append(free[0] + p * np.cos(omega * now) + q / omega * np.sin(omega * now))
            free = part @ free
        if max(x[1:-1]) <= STOP:
            growth = np.abs(np.linalg.eigvals(whole @ saltation(omega, u, linear))).max()
            found.append(Impacting(omega, float(u), linear, -min(x), float(growth)))
    return found


def saltation(omega: float, speed: float, linear: Floats) -> Floats:
    """Jacobian of the impact: R_z + (f⁺ − R_z f⁻) nᵀ / (nᵀ f⁻), with R = (x, −r v)."""
    force = (1.0 - omega**2) * linear[0] + 2.0 * DAMPING * linear[1] - STOP
    reset = np.diag([1.0, -RESTITUTION])
    before = np.array([speed, force - 2.0 * DAMPING * speed])
    after = np.array([-RESTITUTION * speed, force + 2.0 * DAMPING * RESTITUTION * speed])
    return reset + np.outer(after - reset @ before, [1.0, 0.0]) / speed


@cache
def closed() -> tuple[tuple[Impacting, ...], ...]:
    """The motions with one impact over the frequency: the faster ones, and two slow branches.

    The slower ones begin with zero speed, each at a grazing frequency.
    """
    found = [one_impact(float(omega)) for omega in np.linspace(*RANGE, DRAWN)]
    fast = [max(some, key=lambda one: one.speed) for some in found if some]
    slow = [min(some, key=lambda one: one.speed) for some in found if len(some) > 1]
    below = [one for one in slow if one.omega < 1.0]
    return tuple(fast), tuple(below), tuple(one for one in slow if one.omega > 1.0)


def growth(omega: float) -> float:
    """The limit of |μ| u at a grazing: the saltation matrix is (1 + r) a/u below its diagonal.

    The acceleration a at the touch is −σ ω².
    """
    matrix = np.array([[0.0, 1.0], [-1.0, -2.0 * DAMPING]])
    whole = expm(matrix * 2 * np.pi / omega)
    return float(abs(whole[0, 1] * (1.0 + RESTITUTION) * STOP * omega**2))


def speeds() -> tuple[Floats, Floats]:
    """Speed before the impact of the settled motions, and that of the closed form next to it."""
    many = settled()
    rows = np.flatnonzero(many.resets[:, 0] == MOST)
    measured, expected = [], []
    for row in rows:
        omega = float(many.parameters["omega"][row])
        model = oscillator().with_parameters(omega=omega)
        (impact,) = fs.simulate(model, many.initial[row], periods=1).resets
        every = np.array([one.speed for one in one_impact(omega)])
        measured.append(impact.before[1])
        expected.append(every[np.abs(every - impact.before[1]).argmin()])
    return np.array(measured), np.array(expected)


@cache
def claims() -> tuple[Claim, ...]:
    """The grazings, and what coexists beside them."""
    many = settled()
    omega, impacting = many.parameters["omega"], many.resets[:, 0] > 0
    up, down = np.split(np.arange(len(omega)), 2)
    both = np.sort(omega[up][impacting[up] != impacting[down][::-1]])
    measured, expected = speeds()
    low, high = grazing_frequencies()
    first = closed()[2][0]
    return (
        Claim(
            "B10",
            "An oscillator that begins to graze its stop jumps to a motion with fast impacts.",
            "Simulations of x'' + 0.1x' + x = 0.6 cos ωt with a stop at x = 1 and r = 0.8, up and "
            "down over 0.4 ≤ ω ≤ 2.2, beside the motions with one impact in a period in closed "
            "form.",
            (
                Finding(
                    "either",
                    "beyond the paper",
                    "The linear motion touches the stop at ω = {low:.10f} and {high:.10f}; the "
                    "motions with one impact that begin there are unstable and turn back. Motions "
                    "with and without impacts coexist at frequencies from {first:.3f} to "
                    "{second:.3f} and from {third:.3f} to {fourth:.3f}. All {count:.0f} settled "
                    "motions with impacts are those of the closed form within {apart:.0e}. Where "
                    "the impact becomes slow near {high:.4f}, the largest multiplier grows like "
                    "{grown:.3f}/u, u its speed: {slowest:.3f}/u at u = {slow:.4f}.",
                    {
                        "low": low,
                        "high": high,
                        "first": both[both < 1].min(),
                        "second": both[both < 1].max(),
                        "third": both[both > 1].min(),
                        "fourth": both[both > 1].max(),
                        "count": len(measured),
                        "apart": within(float(np.abs(measured - expected).max())),
                        "grown": growth(high),
                        "slow": first.speed,
                        "slowest": first.speed * first.multiplier,
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
    many, omega = settled(), np.linspace(*RANGE, DRAWN)
    for rows, colour in zip(np.split(np.arange(2 * SWEPT), 2), (BLUE, VERMILION), strict=True):
        left.plot(
            many.parameters["omega"][rows],
            -many.minimum[rows, 0],
            "o" if colour == BLUE else ".",
            color=colour,
            markersize=3.0,
            markerfacecolor="none" if colour == BLUE else colour,
            markeredgewidth=0.5,
            zorder=1.5,
        )
    low, high = grazing_frequencies()
    for part in (omega[omega < low], omega[omega > high]):
        left.plot(part, gain(part), color=BLACK, linewidth=1.0)
    for branch in closed():
        over = [one.omega for one in branch]
        stable = np.array([one.multiplier < 1.0 for one in branch])
        for ax, what in ((left, "depth"), (middle, "speed")):
            heights = np.array([getattr(one, what) for one in branch])
            for rows, look in ((stable, "-"), (~stable, "--")):
                ax.plot(over, np.where(rows, heights, np.nan), look, color=BLACK, linewidth=1.0)
        right.loglog(
            [one.speed for one in branch],
            [one.multiplier for one in branch],
            color=BLACK,
            linewidth=1.0,
        )
    for ax in (left, middle):
        level = STOP if ax is left else 0.0
        ax.plot([low, high], [level, level], zorder=5, **dot_look("GR"))
        ax.set_xlabel(r"$\omega$")
    left.set_ylabel(r"$-\min\,x$")
    middle.set_ylabel("speed before the impact $u$")
    right.axhline(1.0, color=GREY, linewidth=0.6)
    right.set_xlabel("$u$")
    right.set_ylabel("largest multiplier")
    for name, ax in zip("abc", (left, middle, right), strict=True):
        ax.set_title(f"({name})", loc="left", fontsize=TEXT)
    keys = [
        Line2D([], [], color=BLACK, linewidth=1.0, label="stable"),
        Line2D([], [], color=BLACK, linewidth=1.0, linestyle="--", label="unstable"),
        Line2D([], [], label="GR grazing", **dot_look("GR")),
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
    ]
    sheet.legend(handles=keys, loc="outside lower center", ncols=5, fontsize=SMALL, frameon=False)
    into.save(sheet, "impact_response")


if __name__ == "__main__":
    main(Output(Path("figures")))
