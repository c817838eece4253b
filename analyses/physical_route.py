"""From two inertias to the dimensionless gear: one motion in four models.

The source reduces the two inertias (2) to the relative twist (5) and scales that
to (6). Here both steps are derived, and the same motion is simulated with the two
inertias, with the twist alone, with the dimensionless gear, and with the
dimensionless gear whose A, B and C are those that the source prints. The overlay
of the twist on its frozen equilibria is drawn in rad and N m.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
import sympy as sp
from numpy.typing import NDArray

import fastslow as fs
from analyses.cases import FASTEST, GAP, NARROW, STIFFNESSES, WIDTHS, gear
from analyses.claims import Claim, Finding
from analyses.output import Output
from fastslow.model.structure import real
from fastslow.plot.layout.style import (
    BLACK,
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
from fastslow.systems.gears import SCALINGS, gear_scales
from fastslow.systems.geartrain import gear_scaling

Floats = NDArray[np.float64]

#: Angular frequency of the load, rad/s: the largest that the source allows.
SPEED = 1.0
TOLERANCE = 1e-12

#: To what the models are to agree, in units of the dimensionless twist.
AGREEMENT = 1e-9


@dataclass(frozen=True, eq=False)
class Route:
    """One motion from rest over three periods of the load, in four models.

    Parameters
    ----------
    time : ndarray, shape (N,)
        In seconds.
    load_side, rigid : ndarray, shape (N,)
        Angle θ_o of the load side, and the part of it that is the rigid-body
        motion (J_o θ_o + N J_i θ_i)/(J_o + N² J_i), both from the two inertias.
    inertias, twist, dimensionless, printed : ndarray, shape (N,)
        Relative twist in rad from each model.
    rigid_law : ndarray, shape (N,)
        The rigid-body motion in closed form, T_am (ω t − sin ω t)/(ω² (J_o + N² J_i)).
    scale : float
        θ_s of the consistent scaling, rad.
    """

    time: Floats
    load_side: Floats
    rigid: Floats
    inertias: Floats
    twist: Floats
    dimensionless: Floats
    printed: Floats
    rigid_law: Floats
    scale: float

    @property
    def spread(self) -> float:
        """Largest difference of the first three models, in units of θ_s."""
        pairs = ((self.inertias, self.twist), (self.inertias, self.dimensionless))
        return max(float(np.abs(one - other).max()) for one, other in pairs) / self.scale

    @property
    def rigid_error(self) -> float:
        """Of the rigid-body motion, relative to its largest value."""
        return float(np.abs(self.rigid - self.rigid_law).max() / np.abs(self.rigid_law).max())

    @property
    def misfit(self) -> float:
        """Largest error of the printed scaling, relative to the largest twist."""
        return float(np.abs(self.printed - self.twist).max() / np.abs(self.twist).max())


@cache
def route() -> Route:
    """Derive the three models, simulate each, and bring the twist back to rad."""
    scales = gear_scales()
    derived = gear_scaling().consistent
    pair = fs.systems.harmonic_gear_two_inertias(omega=SPEED)
    single = fs.systems.harmonic_gear_twist(omega=SPEED)
    known = {real(name): value for name, value in single.parameters.items()}
    scaled = fs.systems.harmonic_gear().with_parameters(
        {name: float(law.subs(known)) for name, law in derived.items()}
    )
    wrong = fs.systems.harmonic_gear_from_physical("printed", omega=SPEED)
    span = 6 * np.pi / SPEED
    runs = [
        fs.simulate(
            model,
            [0.0] * len(model.states),
            t=(0, end),
            integration=fs.Integration(rtol=TOLERANCE),
            samples=3001,
        )
        for model, end in (
            (pair, span),
            (single, span),
            (scaled, span / scales.time),
            (wrong, span / scales.time),
        )
    ]
    p = pair.parameters
    moment = p["J_o"] + p["N"] ** 2 * p["J_i"]
    outer, inner = runs[0]["theta_o"], runs[0]["theta_i"]
    time = runs[0].t
    return Route(
        time,
        outer,
        (p["J_o"] * outer + p["N"] * p["J_i"] * inner) / moment,
        outer - inner / p["N"],
        runs[1]["theta"],
        scales.angle * runs[2]["x"],
        gear_scales("printed").angle * runs[3]["x"],
        p["T_am"] * (SPEED * time - np.sin(SPEED * time)) / (SPEED**2 * moment),
        scales.angle,
    )


@cache
def overlay() -> fs.Overlay:
    """The twist in rad over the torque in N m, ω = 1 rad/s, on its frozen equilibria."""
    model = fs.systems.harmonic_gear_twist(omega=SPEED)
    p = model.parameters
    swing = p["T_am"] * p["J_eq"] / p["J_o"]
    over = (p["T_m"] - 1.1 * swing, p["T_m"] + 1.1 * swing)
    diagram = fs.continue_equilibria(model.frozen(), "w", over=over)
    return fs.overlay(diagram, fs.simulate(model, [0.0, 0.0], periods=3))


def draw_overlay(into: Output) -> None:
    """Draw that overlay, the twist in milliradians."""
    drawing = fs.plot.overlay(overlay(), "1000*theta")
    drawing.ax.set_xlabel(r"load torque $w$ (N m)")
    drawing.ax.set_ylabel(r"relative twist $\theta$ (mrad)")
    into.save(drawing.figure, "physical_overlay")


def within(difference: float, bound: float = AGREEMENT) -> float:
    """The bound where a difference is inside it, else the difference."""
    return bound if difference <= bound else difference


@cache
def claims() -> tuple[Claim, ...]:
    """The reduction, the scaling, and the two time scales."""
    found, law = route(), gear_scaling()
    ratios = {name: float(value.subs(_physical())) for name, value in law.ratios.items()}
    reduces = law.reduced and found.spread <= AGREEMENT
    return (
        Claim(
            "2",
            'Figure 2 and (2): two inertias, which "can be simplified into" the twist (5).',
            "(5) derived from (2) by elimination; both simulated from rest over three periods at "
            "ω = 1 rad/s; the rigid-body motion against its closed form.",
            (
                Finding(
                    "either",
                    "holds" if reduces else "does not hold",
                    "Derived exactly. The twist agrees within {spread:.0e} θ_s, the rigid-body "
                    "motion, {turn:.2f} rad long, within {rigid:.0e} of its closed form.",
                    {
                        "spread": within(found.spread),
                        "turn": float(found.rigid_law[-1]),
                        "rigid": within(found.rigid_error),
                    },
                ),
            ),
            ("physical_route", "physical_overlay"),
        ),
        Claim(
            "3",
            "With A, B, C and D as given, (5) becomes the dimensionless equation (6).",
            "The scaling derived from (5); (6) simulated with either set of parameters and its "
            "twist brought back to rad.",
            (
                Finding(
                    "consistent",
                    "holds" if law.agrees and reduces else "does not hold",
                    "With A = J k1/C_eq² and so on the twist agrees within {spread:.0e} θ_s.",
                    {"spread": within(found.spread)},
                ),
                Finding(
                    "printed",
                    "holds" if found.misfit < 0.01 else "does not hold",
                    "A is {A:.1f} times and B and C are {B:.2f} times too large; the factor θ_s "
                    "in f_h(θ) = θ_s f(x) was forgotten. The twist is off by {misfit:.0%}.",
                    {"A": ratios["A"], "B": ratios["B"], "misfit": found.misfit},
                ),
            ),
            ("physical_route",),
        ),
        Claim(
            "3b",
            'The widths studied, "D = 0.1, 0.25, 0.5", are those of a gap "φ = 1.75 × 10⁻²" rad.',
            "D = φ/θ_s of the gap given, and the gaps that the widths are.",
            tuple(map(_width, SCALINGS)),
        ),
        Claim(
            "3c",
            "The symbols of (2) to (6) are those that the text explains.",
            "Each read from its place in the equations; (5) and (6) derived with the other "
            "reading of T_im and with θ_Γ left in.",
            (_misprints(),),
        ),
        Claim(
            "4",
            'Excitation and natural frequency: this "involves a magnitude difference" (fast-slow).',
            "Natural frequency at the corner, √(A + D² − 1/4), over ω_o at ω = 1 rad/s, for the "
            "softest and the stiffest gear of figures 3 to 5.",
            tuple(map(_separates, SCALINGS)),
        ),
    )


def _separates(scaling: str) -> Finding:
    soft, hard = (
        _separation(gear(scaling, FASTEST, k1=k1, D=NARROW))
        for k1 in (STIFFNESSES[0], STIFFNESSES[-1])
    )
    usual = _separation(gear(scaling, FASTEST, D=GAP))
    return Finding(
        scaling,
        "holds" if soft > 10 else "does not hold",
        "At ω = 1 rad/s the natural frequency is {soft:.1f} times that of the load at k1 = 1000, "
        "{usual:.1f} times at 3000 and {hard:.1f} times at 7000; at smaller ω more.",
        {"soft": soft, "usual": usual, "hard": hard},
    )


def shaft_torque() -> float:
    """Mean of the right side of (5), N m, were T_im the torque of the input shaft itself.

    (2) then has −T_im for −T_im/N, and the mean is J_eq [T_m/J_o + T_m/(N J_i)].
    """
    p = fs.systems.harmonic_gear_two_inertias().parameters
    return float(gear_scales().inertia * p["T_m"] * (1 / p["J_o"] + 1 / (p["N"] * p["J_i"])))


def allowed_shift() -> float:
    """The θ_Γ/θ_s for which x = (θ − θ_Γ)/θ_s leaves the factor x² + A of (6) as it is."""
    x, shift, A = map(real, ("x", "x_shift", "A"))
    left = sp.Poly((x + shift) ** 2 + A - (x**2 + A), x).coeffs()
    (found,) = sp.solve(left, [shift])
    return float(found[0])


def _misprints() -> Finding:
    return Finding(
        "either",
        "does not hold",
        "T_on and T_cm are T_om; T_in is T_im; J_ea is J_eq; θ_c is θ_o; ω_c is ω_o. θ_Γ is not "
        "explained: the factor x² + A of (6) follows for θ_Γ = {shift:.0f} only. T_im, "
        '"of the input shaft", enters (2) as a torque on the output side: were it that of the '
        "shaft, the mean of (5) would be {shaft:.2f} N m and not T_m = 10.",
        {"shift": allowed_shift(), "shaft": shaft_torque()},
    )


def _width(scaling: str) -> Finding:
    scales = gear_scales("printed" if scaling == "printed" else "consistent")
    D = gear(scaling).parameters["D"]
    return Finding(
        scaling,
        "holds" if WIDTHS[0] <= D <= WIDTHS[-1] else "does not hold",
        "The gap given is D = {D:.4g}. The widths studied are gaps of ±{narrow:.3g}, ±{middle:.3g} "
        "and ±{wide:.3g} mrad.",
        {
            "D": D,
            **{
                name: 1e3 * width * scales.angle
                for name, width in zip(("narrow", "middle", "wide"), WIDTHS, strict=True)
            },
        },
    )


def _separation(model: fs.Model) -> float:
    p = model.parameters
    return float(np.sqrt(p["A"] + p["D"] ** 2 - 0.25) / p["omega"])


def _physical() -> dict[sp.Symbol, float]:
    given = fs.systems.harmonic_gear_twist(omega=SPEED).parameters
    return {real(name): value for name, value in given.items()}


def main(into: Output) -> Route:
    """Draw the motion in four models and return it."""
    found = route()
    sheet = new_figure(FULL, 60 * MM)
    left, middle, right = (styled_axes(ax) for ax in sheet.subplots(1, 3))
    left.plot(found.time, found.load_side, color=BLUE, linewidth=1.2)
    left.set_ylabel(r"$\theta_\mathrm{o}$ (rad)")
    left.annotate(
        "two inertias:\nrigid-body motion\nand twist",
        (0.06, 0.92),
        xycoords="axes fraction",
        fontsize=SMALL_TEXT,
        va="top",
    )
    milli = 1e3
    middle.plot(found.time, milli * found.printed, color=VERMILION, linewidth=0.8)
    middle.plot(found.time, milli * found.twist, color=BLUE, linewidth=1.2)
    middle.set_ylabel(r"$\theta$ (mrad)")
    middle.set_ylim(-24, 44)
    notes = [(middle, 0.96, "consistent (6) and (5)", BLUE), (middle, 0.87, "printed", VERMILION)]
    # the largest distance so far: that at each time is rounding, and one hides the other
    for other, colour, width in ((found.dimensionless, GREY, 2.6), (found.twist, BLUE, 1.0)):
        apart = np.maximum.accumulate(np.abs(found.inertias - other)) / found.scale
        right.semilogy(found.time, np.maximum(apart, 1e-18), color=colour, linewidth=width)
    right.axhline(AGREEMENT, color=BLACK, linewidth=1.0, linestyle=(0, (4, 2)))
    right.set_ylim(1e-18, 1e-6)
    right.set_ylabel(r"largest distance from (2) in $\theta_\mathrm{s}$")
    notes += [(right, 0.96, "dimensionless (6)", GREY), (right, 0.87, "twist alone (5)", BLUE)]
    for ax, height, words, colour in notes:
        ax.annotate(
            words,
            (0.04, height),
            xycoords="axes fraction",
            color=colour,
            fontsize=SMALL_TEXT,
            va="top",
        )
    for letter, ax in zip("abc", (left, middle, right), strict=True):
        ax.set_title(f"({letter})", loc="left", fontsize=TEXT)
        ax.set_xlabel(r"$t_0$ (s)")
        ax.set_xlim(0, found.time[-1])
    into.save(sheet, "physical_route")
    draw_overlay(into)
    return found
