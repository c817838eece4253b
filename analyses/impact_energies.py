"""The gear in physical units: transmission error, contact torque, and the energy of each impact.

At the values of figure 3 with the gap given, φ = 1.75e-2 rad, and ω = 1 rad/s, and at
the torques of figure 5. The energy of an impact is that with which the inertia J_eq meets a flank.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
from matplotlib.lines import Line2D
from numpy.typing import NDArray

import fastslow as fs
from analyses.cases import TORQUES
from analyses.claims import Claim, Finding
from analyses.output import Output
from analyses.physical_route import SPEED, within
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

Floats = NDArray[np.float64]

#: Amplitude of the torque of figure 3, N m, and of those of figure 5 that change sign.
FIRST, HEAVY = 15.0, tuple(float(T) for T in TORQUES[1:])

#: Samples of a period, for its dissipation and its largest torque.
SAMPLES = 400_001

#: To what work and dissipation are to agree.
BALANCE = 1e-6


@dataclass(frozen=True, eq=False)
class Contact:
    """One contact of the teeth.

    Parameters
    ----------
    time : float
        In s, from the beginning of the period.
    energy : float
        J_eq θ'²/2 where the teeth meet, J.
    upper : bool
        Side on which they meet.
    """

    time: float
    energy: float
    upper: bool


@dataclass(frozen=True, eq=False)
class Period:
    """One period of the settled motion.

    Parameters
    ----------
    time, twist, torque, load : ndarray, shape (N,)
        In s, rad and N m: θ, the torque of the contact (k1 + k2 θ²) f_h(θ), and w.
    contacts : tuple of Contact
    work, dissipated : float
        Of the load, and by the damping, J.
    """

    time: Floats
    twist: Floats
    torque: Floats
    load: Floats
    contacts: tuple[Contact, ...]
    work: float
    dissipated: float

    @property
    def largest(self) -> float:
        """Energy of the strongest impact, J."""
        return max(contact.energy for contact in self.contacts)


@cache
def period(T_am: float) -> Period:
    """The settled motion, from the second period after rest on."""
    model = fs.systems.harmonic_gear_twist(omega=SPEED, T_am=T_am)
    p = model.parameters
    first = fs.simulate(model, [0.0, 0.0], periods=1)
    run = fs.simulate(model, first(first.span[1]).tolist(), periods=1)
    time = np.linspace(*run.span, SAMPLES)
    twist, speed = run(time)
    beyond = np.sign(twist) * np.maximum(np.abs(twist) - p["phi"], 0.0)
    load = p["T_m"] + p["T_am"] * p["J_eq"] / p["J_o"] * np.sin(p["omega"] * time)
    contacts = tuple(
        Contact(c.time, 0.5 * p["J_eq"] * float(c.state[1]) ** 2, c.to_region == "S1")
        for c in run.crossings
        if c.to_region != "S2"
    )
    return Period(
        time,
        twist,
        (p["k1"] + p["k2"] * twist**2) * beyond,
        load,
        contacts,
        float(np.trapezoid(load * speed, time)),
        float(np.trapezoid(p["C_eq"] * speed**2, time)),
    )


@cache
def claims() -> tuple[Claim, ...]:
    """Sizes in physical units."""
    usual = period(FIRST)
    heavy, heavier = (period(T) for T in HEAVY)
    total = sum(contact.energy for contact in usual.contacts)
    return (
        Claim(
            "B15",
            "Impacts have millijoules of energy, and less torque than the largest load.",
            "One settled period at ω = 1 rad/s and φ = 1.75e-2 rad: the transmission error θ, the "
            "torque of the contact (k1 + k2 θ²) f_h(θ), the energy J_eq θ'²/2 with which the teeth "
            "meet, and the work of the load against C_eq ∫ θ'² dt.",
            (
                Finding(
                    "either",
                    "beyond the paper",
                    "At T_am = 15 N m the transmission error is {error:.1f} mrad, peak to peak, of "
                    "which the gap is 35; the torque of the contact is {torque:.2f} N m at most, "
                    "the load {load:.2f}. The teeth meet {count:.0f} times in a period; the "
                    "strongest impact has {energy:.2f} mJ, all have {total:.2f} mJ. At 50 and "
                    "100 N m the strongest has {heavy:.1f} and {heavier:.1f} mJ. The load does "
                    "{work:.2f} mJ of work in a period, the damping takes as much within "
                    "{balance:.0e} of it.",
                    {
                        "error": 1e3 * float(np.ptp(usual.twist)),
                        "torque": float(usual.torque.max()),
                        "load": float(usual.load.max()),
                        "count": len(usual.contacts),
                        "energy": 1e3 * usual.largest,
                        "total": 1e3 * total,
                        "heavy": 1e3 * heavy.largest,
                        "heavier": 1e3 * heavier.largest,
                        "work": 1e3 * usual.work,
                        "balance": within(abs(usual.work / usual.dissipated - 1), BALANCE),
                    },
                ),
            ),
            ("impact_energies",),
        ),
    )


def main(into: Output) -> None:
    """Draw the transmission error, the torque of the contact, and the energies of impacts."""
    sheet = new_figure(FULL, 62 * MM)
    left, middle, right = (styled_axes(ax) for ax in sheet.subplots(1, 3))
    found = period(FIRST)
    some = slice(None, None, 40)
    left.plot(found.time[some], 1e3 * found.twist[some], color=BLUE, linewidth=1.2)
    gap = 1e3 * fs.systems.harmonic_gear_twist().parameters["phi"]
    left.axhspan(-gap, gap, color="#EFEFEF", zorder=0)
    left.annotate("gap", (0.03, 0.0), xycoords=("axes fraction", "data"), fontsize=SMALL_TEXT)
    left.set_ylabel(r"transmission error $\theta$ (mrad)")
    middle.plot(found.time[some], found.load[some], color=GREY, linewidth=2.6)
    middle.plot(found.time[some], found.torque[some], color=BLUE, linewidth=0.9)
    middle.set_ylabel("torque (N m)")
    middle.set_ylim(-9.0, 37.0)
    handles = [
        Line2D([], [], color=BLUE, linewidth=0.9, label="of the contact"),
        Line2D([], [], color=GREY, linewidth=2.6, label="load $w$"),
    ]
    middle.legend(handles=handles, fontsize=SMALL_TEXT, frameon=False, loc="upper right")
    for T_am, colour in zip((FIRST, *HEAVY), (BLUE, VERMILION, BLACK), strict=True):
        contacts = period(T_am).contacts
        for upper, marker in ((True, "^"), (False, "v")):
            chosen = [contact for contact in contacts if contact.upper is upper]
            right.semilogy(
                [contact.time for contact in chosen],
                [1e3 * contact.energy for contact in chosen],
                marker,
                color=colour,
                markersize=3.5,
                markeredgewidth=0,
                clip_on=False,
            )
    right.set_ylabel("energy of an impact (mJ)", labelpad=1.0)
    right.set_ylim(0.2, 200.0)
    handles = [
        Line2D([], [], color=colour, marker="s", markersize=3.5, linestyle="none", label=f"{T:g}")
        for T, colour in zip((FIRST, *HEAVY), (BLUE, VERMILION, BLACK), strict=True)
    ]
    right.legend(
        handles=handles,
        title=r"$T_\mathrm{am}$ (N m)",
        title_fontsize=SMALL_TEXT,
        fontsize=SMALL_TEXT,
        frameon=False,
        loc="upper left",
    )
    for letter, ax in zip("abc", (left, middle, right), strict=True):
        ax.set_title(f"({letter})", loc="left", fontsize=TEXT)
        ax.set_xlabel("$t_0$ (s)")
        ax.set_xlim(0.0, found.time[-1])
    into.save(sheet, "impact_energies")


if __name__ == "__main__":
    main(Output(Path("figures")))
