"""Periodic orbits over the frequency of the load: a gear pair, and the gear under a fast load.

Not in the source, whose load is slow. The gear pair is that of Kahraman and Singh (1990); its
contact-loss grazing is in closed form, because the motion in contact is linear.
"""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import fastslow as fs
from analyses.claims import Claim, Finding
from analyses.output import Output
from analyses.physical_route import within
from fastslow.plot.layout.style import BLUE, FULL, MM, TEXT, new_figure, styled_axes

Floats = NDArray[np.float64]

#: Frequencies of the gear pair, and of the gear.
PAIR, FAST = (0.4, 1.6), (2.5, 12.0)

#: Damping, mean and amplitude of the torque of the gear pair.
DAMPING, MEAN, AMPLITUDE = 0.05, 0.1, 0.05

#: Frequencies at which the motion of the gear is simulated, down and up.
SWEPT = 96

#: Periods of the load over which the largest twist is measured.
COMMON = 12

#: Difference of states below which a motion repeats, or is that of an orbit.
SAME = 1e-4


@cache
def pair() -> fs.OrbitBranch:
    """Orbits of the gear pair over the frequency, from the motion in contact."""
    model = fs.systems.gear_pair(zeta=DAMPING, Fm=MEAN, Fa=AMPLITUDE, Omega=PAIR[0])
    orbit = fs.find_orbit(model, [1.0 + MEAN, 0.0])
    return fs.continue_orbits(orbit, "Omega", over=PAIR)


def grazing_frequencies() -> Floats:
    """Frequencies at which the linear motion in contact touches the gap.

    Roots of Fa Ω² = Fm sqrt((1 − Ω²)² + 4 ζ² Ω²), a quadratic equation in Ω².
    """
    ratio = (AMPLITUDE / MEAN) ** 2
    squares = np.roots([1.0 - ratio, 4.0 * DAMPING**2 - 2.0, 1.0])
    return np.sort(np.sqrt(squares))


@cache
def fast_gear() -> fs.Model:
    """The gear of the source with its values under the consistent scaling, and D = 0.25."""
    return fs.systems.harmonic_gear(A=41.67, B=2.372, C=3.546, D=0.25, omega=FAST[1])


@cache
def settled() -> tuple[Floats, Floats]:
    """Frequencies, and the states of the gear that a sweep down and up has settled on."""
    found = fs.bifurcation_sweep(
        fast_gear(), "omega", np.linspace(FAST[1], FAST[0], SWEPT), [0.4, 0.0], settle=200, keep=1
    )
    return (
        np.concatenate([one.values for one in found.passes]),
        np.concatenate([one.ends for one in found.passes]),
    )


@cache
def fast() -> fs.OrbitBranch:
    """Orbits of the gear that repeat after one period of the load, from that at rest in contact."""
    orbit = fs.find_orbit(fast_gear(), [0.4, 0.0])
    return fs.continue_orbits(orbit, "omega", over=FAST)


@cache
def repeating() -> tuple[int, int]:
    """Number of settled motions that repeat after one period, and of those on the branch."""
    omega, states = settled()
    once = fs.simulate_many(fast_gear(), states, parameters={"omega": omega}, periods=1)
    same = np.abs(once.final - states).max(axis=1) <= SAME
    found = [
        min(np.abs(orbit(0.0) - state).max() for orbit in fast().at(omega=value))
        for value, state in zip(omega[same], states[same], strict=True)
    ]
    return int(same.sum()), int((np.array(found) <= 10 * SAME).sum())


@cache
def claims() -> tuple[Claim, ...]:
    """Folds and grazing of the gear pair; coexisting motions of the gear."""
    folds, touches = (pair().special(code)["Omega"] for code in ("LPC", "GR"))
    apart = float(np.abs(np.sort(touches) - grazing_frequencies()).max())
    settled_once, on_branch = repeating()
    touch, doubled = _doubling(fast())
    return (
        Claim(
            "B5",
            "Loss of contact bends the response of a gear pair to lower frequencies.",
            "Orbits of x'' + 2ζx' + g(x) = Fm + Fa Ω² sin(Ωt), ζ = 0.05, Fm = 0.1, Fa = 0.05, over "
            "0.4 ≤ Ω ≤ 1.6; the frequencies of grazing against their closed form.",
            (
                Finding(
                    "either",
                    "beyond the paper",
                    "Contact is lost above Ω = {low:.10f} and regained at {high:.10f}, the closed "
                    "form within {apart:.0e}. Between the folds at Ω = {left:.10f} and "
                    "{right:.10f} two stable motions coexist.",
                    {
                        "low": touches.min(),
                        "high": touches.max(),
                        "apart": within(apart),
                        "left": folds.min(),
                        "right": folds.max(),
                    },
                ),
            ),
            ("orbits",),
        ),
        Claim(
            "B6",
            "Under a fast load motions of the gear coexist, and one doubles its period.",
            "Orbits of the gear with A = 41.67, B = 2.372, C = 3.546, D = 0.25 over "
            "2.5 ≤ ω_o ≤ 12, beside a sweep of simulations down and up.",
            (
                Finding(
                    "either",
                    "beyond the paper",
                    "{on:.0f} of {all:.0f} settled motions that repeat after one period are on "
                    "the branch. Between its folds at ω_o = {left:.6f} and {right:.6f} two stable "
                    "motions coexist. It doubles its period at {doubled:.9f}, {gap:.1e} below "
                    "its grazing at {touch:.9f}.",
                    {
                        "on": on_branch,
                        "all": settled_once,
                        "left": fast().special("LPC")["omega"].min(),
                        "right": fast().special("LPC")["omega"].max(),
                        "doubled": doubled,
                        "gap": touch - doubled,
                        "touch": touch,
                    },
                ),
            ),
            ("orbits",),
        ),
    )


def _doubling(branch: fs.OrbitBranch) -> tuple[float, float]:
    """A grazing of a branch with the period doubling nearest to it."""
    touches, doublings = (branch.special(code)["omega"] for code in ("GR", "PD"))
    away = np.abs(touches[:, None] - doublings)
    row, column = np.unravel_index(np.argmin(away), away.shape)
    return float(touches[row]), float(doublings[column])


def main(into: Output) -> None:
    """Draw both responses."""
    sheet = new_figure(FULL, 80 * MM)
    left, right = (styled_axes(ax) for ax in sheet.subplots(1, 2))
    fs.plot.response(pair(), "max(x)", ax=left)
    left.set_title("(a)", loc="left", fontsize=TEXT)
    omega, states = settled()
    many = fs.simulate_many(fast_gear(), states, parameters={"omega": omega}, periods=COMMON)
    right.plot(
        omega, many.maximum[:, 0], ".", color=BLUE, markersize=3, zorder=1.5, label="simulated"
    )
    fs.plot.response(fast(), "max(x)", ax=right)
    right.set_title("(b)", loc="left", fontsize=TEXT)
    into.save(sheet, "orbits")


if __name__ == "__main__":
    main(Output(Path("figures")))
