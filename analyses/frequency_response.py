"""Frequency responses with backlash: the gear pair of Kahraman and Singh (1990), and the gear.

Not in the source. The equation of the gear pair and its approximation by the mean and one harmonic,
with the describing function of the dead zone in closed form, are those of Kahraman and Singh;
all numbers are computed here. The gear is nearly the same oscillator: in units of D and 1/√A it has
ζ = 1/(2√A), the mean load B/(A D) and the amplitude C/(A D); its cubic stiffness is small beside A.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.lines import Line2D
from numpy.typing import NDArray
from scipy.optimize import brentq

import fastslow as fs
from analyses.cases import GAP, gear
from analyses.claims import Claim, Finding
from analyses.output import Output
from analyses.physical_route import within
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

#: Frequencies of the gear pair, its damping, and mean and amplitude of its torque.
PAIR, DAMPING, MEAN, AMPLITUDE = (0.4, 1.6), 0.05, 0.1, 0.05

#: Frequencies of the gear, and amplitudes of its torque, N m.
FAST, TORQUES = (3.0, 10.0), (3.0, 5.0)

#: Amplitudes of the approximation along a curve, and the look of its line.
POINTS = 4000
LOOK: dict[str, Any] = {"color": GREY, "linewidth": 2.6, "zorder": 1}

STEPS = fs.Continuation(max_step=0.05)


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
def fast_gear(T_am: float) -> fs.OrbitBranch:
    """Orbits of the gear over the frequency of the load, from the motion in contact."""
    model = gear("consistent", FAST[0], D=GAP, T_am=T_am)
    p = model.parameters
    orbit = fs.find_orbit(model, [GAP + p["B"] / p["A"], 0.0])
    return fs.continue_orbits(orbit, "omega", over=FAST, continuation=STEPS)


def ramp(level: float, amplitude: float) -> tuple[float, float]:
    """Mean and first harmonic of max(a sin φ − c, 0).

    Examples
    --------
    >>> ramp(-3.0, 2.0), ramp(3.0, 2.0), [round(v, 6) for v in ramp(0.0, 1.0)]
    ((3.0, 2.0), (0.0, 0.0), [0.31831, 0.5])
    """
    s = level / amplitude
    if abs(s) >= 1.0:
        return (-level, amplitude) if s < 0 else (0.0, 0.0)
    root = np.sqrt(1.0 - s * s)
    mean = amplitude / np.pi * (root - s * np.arccos(s))
    return float(mean), float(amplitude / np.pi * (np.arccos(s) - s * root))


def dead_zone(mean: float, amplitude: float, D: float) -> tuple[float, float]:
    """Mean and first harmonic of the dead zone of m + a sin φ: its describing function times a."""
    upper, lower = ramp(D - mean, amplitude), ramp(D + mean, amplitude)
    return upper[0] - lower[0], upper[1] + lower[1]


@dataclass(frozen=True, eq=False)
class Approximation:
    """Mean and one harmonic of the response, over the amplitude and back.

    Parameters
    ----------
    frequency, top : ndarray, shape (N,)
        Frequency of the load, and largest x, m + a.
    """

    frequency: Floats
    top: Floats

    def folds(self) -> Floats:
        """Frequencies at which the curve turns back, in increasing order."""
        f = self.frequency
        k = 1 + np.flatnonzero((f[1:-1] - f[:-2]) * (f[2:] - f[1:-1]) < 0)
        return np.sort(f[k])


def approximation(
    D: float,
    stiffness: float,
    damping: float,
    load: float,
    swing: tuple[float, float],
    largest: float,
) -> Approximation:
    """Solve x'' + c x' + k f(x) = load + P sin(ω t) with the mean and one harmonic.

    (k N − W)² + c² W = P²/a² with the describing function N(m(a), a) and W = ω², a quadratic
    equation in W at each amplitude a; k f has the mean load.

    Parameters
    ----------
    D, stiffness, damping, load : float
    swing : (float, float)
        P = swing[0] + swing[1] W.
    largest : float
        Amplitude up to which it is solved.
    """
    constant, square = swing
    slower: list[tuple[float, float]] = []
    faster: list[tuple[float, float]] = []
    for a in np.linspace(0.0, largest, POINTS + 1)[1:]:
        high = D + load / stiffness + a

        def short(m: float, a: float = float(a)) -> float:
            return stiffness * dead_zone(m, a, D)[0] - load

        m = brentq(short, -high, high, xtol=1e-14)
        k = stiffness * dead_zone(m, float(a), D)[1] / a
        if constant:
            polynomial = (1.0, damping**2 - 2 * k, k * k - (constant / a) ** 2)
        else:
            polynomial = (1.0 - (square / a) ** 2, damping**2 - 2 * k, k * k)
        roots = np.roots(polynomial)
        for square_root in np.sort(np.sqrt(roots.real[(roots.imag == 0) & (roots.real > 0)])):
            below = square_root**2 < k - 0.5 * damping**2
            (slower if below else faster).append((float(square_root), m + float(a)))
    frequency, top = np.array([*slower, *faster[::-1]]).T
    return Approximation(frequency, top)


@cache
def pair_approximation() -> Approximation:
    """Of the gear pair."""
    return approximation(1.0, 1.0, 2 * DAMPING, MEAN, (0.0, AMPLITUDE), 0.5)


@cache
def gear_approximation(T_am: float) -> Approximation:
    """Of the gear, with the linear stiffness of its corner, A + D²."""
    p = gear("consistent", D=GAP, T_am=T_am).parameters
    stiffness = p["A"] + p["D"] ** 2
    return approximation(GAP, stiffness, 1.0, p["B"], (p["C"], 0.0), 0.5)


def jumps(branch: fs.OrbitBranch) -> Floats:
    """Frequencies of the outermost folds of a branch."""
    folds = np.sort(branch.special("LPC")[branch.parameter])
    return folds[[0, -1]]


def _jumps(curve: Approximation) -> Floats:
    return curve.folds()[[0, -1]]


@cache
def claims() -> tuple[Claim, ...]:
    """Folds and grazing of the gear pair, and those of the gear through its resonance."""
    folds, touches = (pair().special(code)["Omega"] for code in ("LPC", "GR"))
    apart = float(np.abs(np.sort(touches) - grazing_frequencies()).max())
    near = _jumps(pair_approximation())
    height = float(pair()["max(x)"].max())
    other = float(pair_approximation().top.max())
    p = gear("consistent", D=GAP).parameters
    root = float(np.sqrt(p["A"] + p["D"] ** 2))
    light, heavy = (jumps(fast_gear(T)) for T in TORQUES)
    close = [np.abs(_jumps(gear_approximation(T)) / jumps(fast_gear(T)) - 1) for T in TORQUES]
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
            ("frequency_response",),
        ),
        Claim(
            "B5b",
            "One harmonic, as in Kahraman and Singh (1990), gives the jump up of a gear pair well, "
            "the jump down less so.",
            "Mean and first harmonic with the describing function of the dead zone in closed form, "
            "at the values of B5, beside the orbits. Equation and method are those of the 1990 "
            "paper; all numbers are computed here, none is read off its figures.",
            (
                Finding(
                    "either",
                    "beyond the paper",
                    "The jump up, with rising frequency, is at Ω = {right:.4f}, that of the orbits "
                    "within {up:.2%}, the jump down at {left:.4f}, within {down:.1%}; the largest "
                    "x is {other:.4f}, that of the orbits {height:.4f}.",
                    {
                        "left": near[0],
                        "right": near[1],
                        "down": abs(near[0] / folds.min() - 1),
                        "up": abs(near[1] / folds.max() - 1),
                        "other": other,
                        "height": height,
                    },
                ),
            ),
            ("frequency_response",),
        ),
        Claim(
            "B5c",
            "Through √A the gear responds as such an oscillator.",
            "Orbits of the gear in the consistent scaling with D = 0.25 at T_am = 3 and 5 N m over "
            "3 ≤ ω_o ≤ 10, beside the mean and first harmonic with the stiffness A + D² of the "
            "corner.",
            (
                Finding(
                    "either",
                    "beyond the paper",
                    "In units of D and 1/√A it has the damping ratio {zeta:.4f} and the mean load "
                    "{mean:.4f}. Below √(A + D²) = {root:.3f} two motions of one period coexist, "
                    "at 3 N m from ω_o = {first:.4f} to {second:.4f} and at 5 N m from {third:.4f} "
                    "to {fourth:.4f}. One harmonic gives the upper ends, at which the motion "
                    "jumps up, within {up:.1%}, the lower ones within {down:.0%}.",
                    {
                        "zeta": 1 / (2 * float(np.sqrt(p["A"]))),
                        "mean": p["B"] / (p["A"] * p["D"]),
                        "root": root,
                        "first": light[0],
                        "second": light[1],
                        "third": heavy[0],
                        "fourth": heavy[1],
                        "up": max(off[1] for off in close),
                        "down": max(off[0] for off in close),
                    },
                ),
            ),
            ("frequency_response",),
        ),
    )


def main(into: Output) -> None:
    """Draw both responses over those of one harmonic."""
    sheet = new_figure(FULL, 74 * MM)
    left, right = (styled_axes(ax) for ax in sheet.subplots(1, 2))
    curve = pair_approximation()
    left.plot(curve.frequency, curve.top, **LOOK)
    drawn = fs.plot.response(pair(), "max(x)", ax=left, legend=False, linewidth=1.1)
    left.set_xlim(*PAIR)
    left.set_xlabel(r"$\Omega$")
    for T_am, colour in zip(TORQUES, (BLUE, VERMILION), strict=True):
        curve = gear_approximation(T_am)
        right.plot(curve.frequency, curve.top, **LOOK)
        fs.plot.response(
            fast_gear(T_am), "max(x)", ax=right, label=False, color=colour, linewidth=1.1
        )
    p = gear("consistent", D=GAP).parameters
    right.axvline(np.sqrt(p["A"]), color=GREY, linewidth=0.8, linestyle=(0, (1, 2)))
    right.annotate(
        r"$\sqrt{A}$",
        (np.sqrt(p["A"]), 0.02),
        xycoords=("data", "axes fraction"),
        xytext=(3, 0),
        textcoords="offset points",
        fontsize=SMALL_TEXT,
    )
    right.set_xlim(*FAST)
    right.set_xlabel(r"$\omega_\mathrm{o}$")
    handles = [
        *drawn.handles,
        *(
            Line2D([], [], color=colour, linewidth=1.1, label=rf"(b) $T_\mathrm{{am}} = {T:g}$ N m")
            for T, colour in zip(TORQUES, (BLUE, VERMILION), strict=True)
        ),
        Line2D([], [], label="one harmonic", **LOOK),
    ]
    sheet.legend(
        handles=handles, loc="outside lower center", ncols=4, fontsize=SMALL_TEXT, frameon=False
    )
    for letter, ax in zip("ab", (left, right), strict=True):
        ax.set_title(f"({letter})", loc="left", fontsize=TEXT)
    into.save(sheet, "frequency_response")


if __name__ == "__main__":
    main(Output(Path("figures")))
